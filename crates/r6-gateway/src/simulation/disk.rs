//! The disk of a simulated gateway. It outlives the gateways that write to it, and can be full or slow.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_api::gateway::{AuditRecord, Role, Run};

use crate::core::account::Decided;
use crate::core::alarms;
use crate::core::camera::CameraGrant;
use crate::core::library::{Condition, ProgramName};
use crate::core::name::RobotName;
use crate::core::point::PointName;
use crate::core::role::Grant;
use crate::core::seat::Saved;
use crate::secret;
use crate::store::commands::{KeptCommand, NewCommand, Noted};
use crate::store::runs::{Begun, KeptRun, NewRun};
use crate::store::{
    Author, Ends, Entry, Heads, Kept, KeptPoint, LibraryError, Link, MAX_PAGE, NewGrant, NewPoint, NewToken,
    NewVersion, Sqlite, Store, StoreError, StoredRobot, StoredSettings, StoredUser, Token, UserChange,
};
use crate::tokens;
use crate::verify::{self, VerifyError};

/// What a disk takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fullness {
    /// Everything.
    HasRoom,
    /// What fits into the pages that the file has: a transaction fails where it needs one more.
    NoPages,
    /// Nothing: each write fails.
    Nothing,
}

/// A disk with the store of a gateway: the tables and the SQL of the real one, in memory. What was committed
/// is there after the end of a gateway, and nothing else. Clones are the same disk.
#[derive(Clone)]
pub struct Disk(Arc<Mutex<Platter>>);

struct Platter {
    store: Sqlite,
    fullness: Fullness,
    /// How long a write takes: at least, and at most.
    takes: (Duration, Duration),
    draws: u64,
    /// The number of the gateway that has it now.
    mounted: u64,
    refused: u64,
}

impl fmt::Debug for Disk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Disk")
    }
}

impl Disk {
    /// A new disk with an empty store. A write takes up to 4 ms.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn new(seed: u64) -> Result<Self, StoreError> {
        let platter = Platter {
            store: Sqlite::in_memory()?,
            fullness: Fullness::HasRoom,
            takes: (Duration::ZERO, Duration::from_millis(4)),
            draws: seed,
            mounted: 0,
            refused: 0,
        };
        Ok(Self(Arc::new(Mutex::new(platter))))
    }

    /// The store for one more gateway. The one before can use it no more.
    pub(crate) fn mount(&self) -> Mounted {
        let mut platter = self.platter();
        platter.mounted += 1;
        Mounted { disk: self.clone(), number: platter.mounted }
    }

    /// The gateway that has it is killed: it writes and reads nothing from now on.
    pub fn unmount(&self) {
        self.platter().mounted += 1;
    }

    /// Fills it up, or makes room.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn fill(&self, fullness: Fullness) -> Result<(), StoreError> {
        let mut platter = self.platter();
        platter.fullness = fullness;
        platter.store.set_full(fullness == Fullness::NoPages)
    }

    /// How long a write takes from now on: at least, and at most.
    pub fn set_takes(&self, least: Duration, most: Duration) {
        self.platter().takes = (least, most);
    }

    /// How long the next job takes.
    pub(crate) fn takes(&self) -> Duration {
        let mut platter = self.platter();
        let (least, most) = platter.takes;
        platter.draws = platter.draws.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let share = u32::try_from(platter.draws >> 40).unwrap_or(0);
        least + most.saturating_sub(least).mul_f64(f64::from(share) / f64::from(1_u32 << 24))
    }

    /// How many writes failed since the last call.
    #[must_use]
    pub fn take_refused(&self) -> u64 {
        std::mem::take(&mut self.platter().refused)
    }

    /// Adds a token with this text, as `r6 gateway token` does. Returns how the audit log calls its bearer.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn add_token(&self, text: &str, role: Role, name: &str) -> Result<String, StoreError> {
        let (grant, hash) = (Grant { role, robots: None }, secret::hash(text));
        let token = NewToken { hash, grant, name: name.to_owned(), expires: None };
        let author = Author::shell(crate::clock::time_of_day());
        let number = self.platter().store.add_token(&token, &author)?;
        Ok(tokens::label(number, name))
    }

    /// The entries of the audit log after this number, oldest first, at most a page.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn entries(&self, after: u64) -> Result<Vec<(u64, AuditRecord)>, StoreError> {
        let entries = self.platter().store.entries(after, MAX_PAGE)?.into_iter();
        let unreadable = |error: serde_json::Error| StoreError::Unreadable(error.to_string());
        entries
            .map(|entry| Ok((entry.number, serde_json::from_str(&entry.body).map_err(unreadable)?)))
            .collect()
    }

    /// Checks the audit log and its signed heads. Returns the number of its last entry.
    ///
    /// # Errors
    /// [`VerifyError`].
    pub fn verify(&self) -> Result<u64, VerifyError> {
        let verified = verify::of_store(&mut self.platter().store, &[], None)?;
        Ok(verified.removed + verified.entries)
    }

    /// How many entries of its audit log were removed because there were too many.
    ///
    /// # Errors
    /// [`VerifyError`].
    pub fn removed(&self) -> Result<u64, VerifyError> {
        Ok(verify::of_store(&mut self.platter().store, &[], None)?.removed)
    }

    /// The number of the last lease of a robot as it was saved, and whether a stop was saved.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn seat(&self, robot: &RobotName) -> Result<(u64, bool), StoreError> {
        self.platter().store.seat(robot).map(|saved| (saved.number, saved.stopped))
    }

    fn platter(&self) -> MutexGuard<'_, Platter> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The store of one gateway.
pub(crate) struct Mounted {
    disk: Disk,
    number: u64,
}

impl Mounted {
    fn read<T, E: From<StoreError>>(&self, read: impl FnOnce(&mut Sqlite) -> Result<T, E>) -> Result<T, E> {
        let mut platter = self.disk.platter();
        if platter.mounted != self.number {
            return Err(StoreError::Closed.into());
        }
        read(&mut platter.store)
    }

    fn write<T, E: From<StoreError>>(&self, write: impl FnOnce(&mut Sqlite) -> Result<T, E>) -> Result<T, E> {
        let mut platter = self.disk.platter();
        if platter.mounted != self.number {
            return Err(StoreError::Closed.into());
        }
        let written = match platter.fullness {
            Fullness::Nothing => Err(StoreError::Unavailable("database or disk is full".to_owned()).into()),
            Fullness::HasRoom | Fullness::NoPages => write(&mut platter.store),
        };
        if written.is_err() && platter.fullness != Fullness::HasRoom {
            platter.refused += 1;
        }
        written
    }
}

impl Store for Mounted {
    fn append(&mut self, records: &[AuditRecord]) -> Result<u64, StoreError> {
        self.write(|store| store.append(records))
    }

    fn settle(&mut self) -> Result<(), StoreError> {
        self.read(|store| store.settle())
    }

    fn entries(&mut self, after: u64, most: usize) -> Result<Vec<Entry>, StoreError> {
        self.read(|store| store.entries(after, most))
    }

    fn ends(&mut self) -> Result<Ends, StoreError> {
        self.read(|store| store.ends())
    }

    fn heads(&mut self) -> Result<Heads, StoreError> {
        self.read(|store| store.heads())
    }

    fn put_key(&mut self, key: &str, cut: Option<&str>, record: &AuditRecord) -> Result<(), StoreError> {
        self.write(|store| store.put_key(key, cut, record))
    }

    fn put_head(&mut self, note: &str) -> Result<(), StoreError> {
        self.write(|store| store.put_head(note))
    }

    fn cut(&mut self, until: u64, note: &str) -> Result<(), StoreError> {
        self.write(|store| store.cut(until, note))
    }

    fn open_intents(&mut self) -> Result<Vec<(u64, Option<String>)>, StoreError> {
        self.read(|store| store.open_intents())
    }

    fn add_token(&mut self, token: &NewToken, author: &Author) -> Result<i64, StoreError> {
        self.write(|store| store.add_token(token, author))
    }

    fn revoke_token(&mut self, number: i64, author: &Author) -> Result<bool, StoreError> {
        self.write(|store| store.revoke_token(number, author))
    }

    fn tokens(&mut self) -> Result<Vec<Token>, StoreError> {
        self.read(|store| store.tokens())
    }

    fn cameras(&mut self, of: Option<&RobotName>) -> Result<Vec<(RobotName, CameraGrant)>, StoreError> {
        self.read(|store| store.cameras(of))
    }

    fn grant_camera(&mut self, new: &NewGrant, author: &Author) -> Result<bool, StoreError> {
        self.write(|store| store.grant_camera(new, author))
    }

    fn revoke_camera(&mut self, grant: &NewGrant, author: &Author) -> Result<bool, StoreError> {
        self.write(|store| store.revoke_camera(grant, author))
    }

    fn users(&mut self) -> Result<Vec<StoredUser>, StoreError> {
        self.read(|store| store.users())
    }

    fn change_user(&mut self, change: &UserChange, author: &Author) -> Result<(Decided, u64), StoreError> {
        self.write(|store| store.change_user(change, author))
    }

    fn put_link(&mut self, link: &Link, author: &Author) -> Result<(), StoreError> {
        self.write(|store| store.put_link(link, author))
    }

    fn link(&mut self, hash: &[u8; 32], now: u64) -> Result<Option<Link>, StoreError> {
        self.read(|store| store.link(hash, now))
    }

    fn remove_setup_link(&mut self) -> Result<(), StoreError> {
        self.write(|store| store.remove_setup_link())
    }

    fn seat(&mut self, robot: &RobotName) -> Result<Saved, StoreError> {
        self.read(|store| store.seat(robot))
    }

    fn save_seat(&mut self, robot: &RobotName, saved: &Saved) -> Result<(), StoreError> {
        self.write(|store| store.save_seat(robot, saved))
    }

    fn robots(&mut self) -> Result<Vec<StoredRobot>, StoreError> {
        self.read(|store| store.robots())
    }

    fn put_robot(&mut self, robot: &StoredRobot, record: &AuditRecord) -> Result<(), StoreError> {
        self.write(|store| store.put_robot(robot, record))
    }

    fn remove_robot(&mut self, name: &RobotName, records: &[AuditRecord]) -> Result<(), StoreError> {
        self.write(|store| store.remove_robot(name, records))
    }

    fn programs(&mut self) -> Result<Vec<Kept>, StoreError> {
        self.read(|store| store.programs())
    }

    fn program_versions(&mut self, name: &ProgramName) -> Result<Vec<Kept>, StoreError> {
        self.read(|store| store.program_versions(name))
    }

    fn program(
        &mut self,
        name: &ProgramName,
        version: Option<u64>,
    ) -> Result<Option<(Kept, String)>, StoreError> {
        self.read(|store| store.program(name, version))
    }

    fn put_program(&mut self, new: &NewVersion, condition: &Condition) -> Result<Kept, LibraryError> {
        self.write(|store| store.put_program(new, condition))
    }

    fn remove_program(
        &mut self,
        name: &ProgramName,
        condition: &Condition,
        by: &Author,
    ) -> Result<(), LibraryError> {
        self.write(|store| store.remove_program(name, condition, by))
    }

    fn points(&mut self) -> Result<Vec<KeptPoint>, StoreError> {
        self.read(|store| store.points())
    }

    fn point_versions(&mut self, name: &PointName) -> Result<Vec<KeptPoint>, StoreError> {
        self.read(|store| store.point_versions(name))
    }

    fn put_point(&mut self, new: &NewPoint, condition: &Condition) -> Result<KeptPoint, LibraryError> {
        self.write(|store| store.put_point(new, condition))
    }

    fn remove_point(
        &mut self,
        name: &PointName,
        condition: &Condition,
        by: &Author,
    ) -> Result<(), LibraryError> {
        self.write(|store| store.remove_point(name, condition, by))
    }

    fn alarms(&mut self, robot: &RobotName) -> Result<alarms::Saved, StoreError> {
        self.read(|store| store.alarms(robot))
    }

    fn save_alarms(
        &mut self,
        robot: &RobotName,
        saved: &alarms::Saved,
        records: &[AuditRecord],
    ) -> Result<(), StoreError> {
        self.write(|store| store.save_alarms(robot, saved, records))
    }

    fn settings(&mut self) -> Result<Option<StoredSettings>, StoreError> {
        self.read(|store| store.settings())
    }

    fn put_settings(&mut self, settings: &StoredSettings, record: &AuditRecord) -> Result<(), StoreError> {
        self.write(|store| store.put_settings(settings, record))
    }

    fn begin_run(&mut self, new: &NewRun) -> Result<Begun, StoreError> {
        self.write(|store| store.begin_run(new))
    }

    fn run_of_key(&mut self, caller: &str, key: &str, since: u64) -> Result<Option<KeptRun>, StoreError> {
        self.read(|store| store.run_of_key(caller, key, since))
    }

    fn run(&mut self, robot: &RobotName, id: u64) -> Result<Option<KeptRun>, StoreError> {
        self.read(|store| store.run(robot, id))
    }

    fn runs(&mut self, robot: &RobotName, before: u64, most: usize) -> Result<Vec<Run>, StoreError> {
        self.read(|store| store.runs(robot, before, most))
    }

    fn open_runs(&mut self) -> Result<Vec<Run>, StoreError> {
        self.read(|store| store.open_runs())
    }

    fn answer_run(&mut self, id: u64, answer: &str) -> Result<(), StoreError> {
        self.write(|store| store.answer_run(id, answer))
    }

    fn end_run(&mut self, run: &Run, owed: bool, records: &[AuditRecord]) -> Result<(), StoreError> {
        self.write(|store| store.end_run(run, owed, records))
    }

    fn owed_stops(&mut self) -> Result<Vec<RobotName>, StoreError> {
        self.read(|store| store.owed_stops())
    }

    fn forget_owed_stop(&mut self, robot: &RobotName) -> Result<(), StoreError> {
        self.write(|store| store.forget_owed_stop(robot))
    }

    fn begin_command(&mut self, new: &NewCommand) -> Result<Noted, StoreError> {
        self.write(|store| store.begin_command(new))
    }

    fn command_of_key(
        &mut self,
        caller: &str,
        key: &str,
        since: u64,
    ) -> Result<Option<KeptCommand>, StoreError> {
        self.read(|store| store.command_of_key(caller, key, since))
    }

    fn end_command(&mut self, intent: u64, answer: &str, outcome: &AuditRecord) -> Result<(), StoreError> {
        self.write(|store| store.end_command(intent, answer, outcome))
    }
}

#[cfg(test)]
mod tests;
