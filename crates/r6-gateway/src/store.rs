//! What the gateway keeps: tokens, users, the audit log, the state of the seats, alarms, robots, programs,
//! points, runs and the keys of commands.
//!
//! [`Store`] is the contract; every implementation passes the same tests (`contract.rs`). Nothing outside
//! this folder knows SQL. The gateway talks to its store through a [`Keeper`], a thread of its own, so that
//! no request waits for the disk in a task.

mod accounts;
mod cameras;
pub mod commands;
#[cfg(test)]
mod contract;
mod error;
mod heads;
pub mod history;
mod keeper;
mod library;
mod link;
#[cfg(test)]
mod memory;
mod points;
pub mod postgres;
mod robots;
pub mod runs;
mod sqlite;
mod versions;

use r6_api::gateway::{AuditRecord, Deed, GuardWanted, PollGroup, Role, Run};

use crate::core::account::{Account, Decided, UserName, Wish};
use crate::core::alarms;
use crate::core::camera::CameraGrant;
use crate::core::chain::Hash;
use crate::core::library::{Condition, ProgramName};
use crate::core::name::RobotName;
use crate::core::owner::Claim;
use crate::core::point::PointName;
use crate::core::role::{Grant, GrantRobots};
use crate::core::seat::Saved;
use crate::expiry::Expiry;

use accounts::{check_link, decide, link_made, user_changed};
pub use cameras::NewGrant;
use commands::{KeptCommand, NewCommand, Noted};
pub use error::StoreError;
pub use heads::{Ends, Heads};
pub use keeper::Keeper;
pub use library::{Kept, LibraryError, NewVersion};
pub use link::Link;
#[cfg(test)]
pub use memory::Memory;
pub use points::{KeptPoint, NewPoint};
use runs::{Begun, KeptRun, NewRun};
pub use sqlite::{FILE, HALF_RESTORED, HISTORY, Sqlite, copy};

/// The most tokens of one store: they are all held in memory, and listed at once.
pub const MAX_TOKENS: usize = 10_000;

/// The most entries of one page of the audit log.
pub const MAX_PAGE: usize = 1_000;

/// A place that keeps what must outlive the process. When a method that writes returns, its data is durable:
/// it survives a power cut. The outcomes of commands ([`Self::append`] of them alone, [`Self::end_command`])
/// survive the end of the process then, and a power cut after [`Self::settle`].
pub trait Store: Send {
    /// What is written from now on is about these robots, and belongs to these terms. A store that others
    /// share writes only while all of the claims hold.
    fn hold(&mut self, _claims: &[Claim]) {}

    /// Notes at which addresses these robots are from now on, if no arm there has another name. Those that
    /// leave give their addresses up. A store of one gateway notes nothing.
    ///
    /// # Errors
    /// [`StoreError::AddressTaken`].
    fn tie(&mut self, _robots: &[(RobotName, String)], _leaving: &[RobotName]) -> Result<(), StoreError> {
        Ok(())
    }

    /// Appends entries to the audit log, all or none. Returns the number of the first one. Without entries it
    /// adds nothing, but fails as with them.
    ///
    /// # Errors
    /// [`StoreError`]: nothing was appended, or that is unknown.
    fn append(&mut self, records: &[AuditRecord]) -> Result<u64, StoreError>;

    /// Makes durable what only survives the end of the process yet. To be called soon after an outcome was
    /// written.
    ///
    /// # Errors
    /// [`StoreError`]: after a power cut the outcomes may be missing, and the next start writes that they are
    /// unknown.
    fn settle(&mut self) -> Result<(), StoreError>;

    /// Entries of the audit log after a number, oldest first, at most [`MAX_PAGE`].
    ///
    /// # Errors
    /// [`StoreError`].
    fn entries(&mut self, after: u64, most: usize) -> Result<Vec<Entry>, StoreError>;

    /// The ends of the audit log.
    ///
    /// # Errors
    /// [`StoreError`].
    fn ends(&mut self) -> Result<Ends, StoreError>;

    /// The signed heads of the audit log; none if an older r6 made the store.
    ///
    /// # Errors
    /// [`StoreError`].
    fn heads(&mut self) -> Result<Heads, StoreError>;

    /// Puts the public key of the heads in the place of the one before, and the head of the removed entries
    /// as this key signed it. Removes the newest head, which another key signed. Appends a record to the
    /// audit log. All or nothing.
    ///
    /// # Errors
    /// [`StoreError`].
    fn put_key(&mut self, key: &str, cut: Option<&str>, record: &AuditRecord) -> Result<(), StoreError>;

    /// Puts a signed head of the audit log in the place of the one before.
    ///
    /// # Errors
    /// [`StoreError`].
    fn put_head(&mut self, note: &str) -> Result<(), StoreError>;

    /// Removes the entries of the audit log up to this number, and puts the signed head of the last one of
    /// them in the place of the one before, both or neither. Changes nothing if no entry would be left:
    /// numbers go on behind the newest entry.
    ///
    /// # Errors
    /// [`StoreError`].
    fn cut(&mut self, until: u64, note: &str) -> Result<(), StoreError>;

    /// The numbers and robots of commands whose outcome is not in the audit log.
    ///
    /// # Errors
    /// [`StoreError`].
    fn open_intents(&mut self) -> Result<Vec<(u64, Option<String>)>, StoreError>;

    /// Adds a token and tells the audit log of it, both or neither. Returns its number. Numbers are not used
    /// again.
    ///
    /// # Errors
    /// [`StoreError`].
    fn add_token(&mut self, token: &NewToken, author: &Author) -> Result<i64, StoreError>;

    /// Revokes a token with its grants and tells the audit log of it, both or neither. `false` if no valid
    /// token has this number.
    ///
    /// # Errors
    /// [`StoreError`].
    fn revoke_token(&mut self, number: i64, author: &Author) -> Result<bool, StoreError>;

    /// The tokens that are not revoked, in the order of their numbers.
    ///
    /// # Errors
    /// [`StoreError`].
    fn tokens(&mut self) -> Result<Vec<Token>, StoreError>;

    /// The grants of cameras of a robot, or all, by robot, camera and token. A revoked token has none.
    ///
    /// # Errors
    /// [`StoreError`].
    fn cameras(&mut self, of: Option<&RobotName>) -> Result<Vec<(RobotName, CameraGrant)>, StoreError>;

    /// Gives a token the grant for a camera and tells the audit log of it, both or neither. `false` if it has
    /// it: nothing is changed.
    ///
    /// # Errors
    /// [`StoreError::NoSuchToken`], [`StoreError::TokenOfAnother`], [`StoreError::TooManyGrants`]: nothing
    /// was changed. Other [`StoreError`]s.
    fn grant_camera(&mut self, new: &NewGrant, author: &Author) -> Result<bool, StoreError>;

    /// Takes the grant for a camera from a token and tells the audit log of it, both or neither. `false` if
    /// it has none.
    ///
    /// # Errors
    /// [`StoreError`].
    fn revoke_camera(&mut self, grant: &NewGrant, author: &Author) -> Result<bool, StoreError>;

    /// The users, in the order of their names.
    ///
    /// # Errors
    /// [`StoreError`].
    fn users(&mut self) -> Result<Vec<StoredUser>, StoreError>;

    /// Changes a user as [`decide`](crate::core::account::decide) allows, uses up the link if there is one,
    /// and tells the audit log of it, all or nothing. Returns what became of the user, and the new stamp.
    ///
    /// # Errors
    /// [`StoreError::Denied`], [`StoreError::LinkVoid`], [`StoreError::UserChanged`]: nothing was changed.
    /// Other [`StoreError`]s: nothing was changed, or that is unknown.
    fn change_user(&mut self, change: &UserChange, author: &Author) -> Result<(Decided, u64), StoreError>;

    /// Keeps a one-time link in the place of the one before for the same user, and tells the audit log of it,
    /// both or neither.
    ///
    /// # Errors
    /// [`StoreError::Denied`] if there is no such user; for the link of the first admin, if there is an
    /// admin. Other [`StoreError`]s.
    fn put_link(&mut self, link: &Link, author: &Author) -> Result<(), StoreError>;

    /// The one-time link with this hash, if it is valid at this time.
    ///
    /// # Errors
    /// [`StoreError`].
    fn link(&mut self, hash: &[u8; 32], now: u64) -> Result<Option<Link>, StoreError>;

    /// Removes the link for the first admin, if there is one.
    ///
    /// # Errors
    /// [`StoreError`].
    fn remove_setup_link(&mut self) -> Result<(), StoreError>;

    /// What was saved of a robot's seat; the default if nothing was.
    ///
    /// # Errors
    /// [`StoreError`].
    fn seat(&mut self, robot: &RobotName) -> Result<Saved, StoreError>;

    /// Saves what has to outlive the process of a robot's seat.
    ///
    /// # Errors
    /// [`StoreError`].
    fn save_seat(&mut self, robot: &RobotName, saved: &Saved) -> Result<(), StoreError>;

    /// What was saved of a robot's alarms; the default if nothing was.
    ///
    /// # Errors
    /// [`StoreError`].
    fn alarms(&mut self, robot: &RobotName) -> Result<alarms::Saved, StoreError>;

    /// Saves the alarms of a robot, and appends these records to the audit log, both or neither.
    ///
    /// # Errors
    /// [`StoreError`].
    fn save_alarms(
        &mut self,
        robot: &RobotName,
        saved: &alarms::Saved,
        records: &[AuditRecord],
    ) -> Result<(), StoreError>;

    /// The settings of the hall that were put last; `None` if none were.
    ///
    /// # Errors
    /// [`StoreError`].
    fn settings(&mut self) -> Result<Option<StoredSettings>, StoreError>;

    /// Puts the settings of the hall in the place of those before, and appends a record to the audit log,
    /// both or neither.
    ///
    /// # Errors
    /// [`StoreError`].
    fn put_settings(&mut self, settings: &StoredSettings, record: &AuditRecord) -> Result<(), StoreError>;

    /// The robots that were put, in the order of their names.
    ///
    /// # Errors
    /// [`StoreError`].
    fn robots(&mut self) -> Result<Vec<StoredRobot>, StoreError>;

    /// Adds a robot, or replaces the one of its name, and appends a record to the audit log, both or neither.
    ///
    /// # Errors
    /// [`StoreError`].
    fn put_robot(&mut self, robot: &StoredRobot, record: &AuditRecord) -> Result<(), StoreError>;

    /// Removes a robot, if it was put, and appends these records to the audit log, both or neither. Its seat
    /// stays.
    ///
    /// # Errors
    /// [`StoreError`].
    fn remove_robot(&mut self, name: &RobotName, records: &[AuditRecord]) -> Result<(), StoreError>;

    /// The latest version of each program, in the order of their names.
    ///
    /// # Errors
    /// [`StoreError`].
    fn programs(&mut self) -> Result<Vec<Kept>, StoreError>;

    /// The versions of a program that are kept, the latest first; none without such a program.
    ///
    /// # Errors
    /// [`StoreError`].
    fn program_versions(&mut self, name: &ProgramName) -> Result<Vec<Kept>, StoreError>;

    /// A version of a program, or the latest, with its text; `None` if it is not kept.
    ///
    /// # Errors
    /// [`StoreError`].
    fn program(
        &mut self,
        name: &ProgramName,
        version: Option<u64>,
    ) -> Result<Option<(Kept, String)>, StoreError>;

    /// Adds a version of a program and tells the audit log of it, both or neither. The oldest version goes,
    /// if there are [`MAX_VERSIONS`](crate::core::library::MAX_VERSIONS).
    ///
    /// # Errors
    /// [`LibraryError`].
    fn put_program(&mut self, new: &NewVersion, condition: &Condition) -> Result<Kept, LibraryError>;

    /// Removes a program with its versions and tells the audit log of it, both or neither.
    ///
    /// # Errors
    /// [`LibraryError`].
    fn remove_program(
        &mut self,
        name: &ProgramName,
        condition: &Condition,
        by: &Author,
    ) -> Result<(), LibraryError>;

    /// The latest version of each point, in the order of their names.
    ///
    /// # Errors
    /// [`StoreError`].
    fn points(&mut self) -> Result<Vec<KeptPoint>, StoreError>;

    /// The versions of a point that are kept, the latest first; none without such a point.
    ///
    /// # Errors
    /// [`StoreError`].
    fn point_versions(&mut self, name: &PointName) -> Result<Vec<KeptPoint>, StoreError>;

    /// Adds a version of a point and tells the audit log of it, both or neither. The oldest version goes, if
    /// there are [`MAX_VERSIONS`](crate::core::library::MAX_VERSIONS).
    ///
    /// # Errors
    /// [`LibraryError`].
    fn put_point(&mut self, new: &NewPoint, condition: &Condition) -> Result<KeptPoint, LibraryError>;

    /// Removes a point with its versions and tells the audit log of it, both or neither.
    ///
    /// # Errors
    /// [`LibraryError`].
    fn remove_point(
        &mut self,
        name: &PointName,
        condition: &Condition,
        by: &Author,
    ) -> Result<(), LibraryError>;

    /// Adds a run and tells the audit log of its intent, both or neither, if its caller has not used its key.
    /// From then on a stop is owed for the robot. Runs that are too old go. Numbers are not used again.
    ///
    /// # Errors
    /// [`StoreError`].
    fn begin_run(&mut self, new: &NewRun) -> Result<Begun, StoreError>;

    /// The run that this caller asked for with this key at this time or later, in seconds since 1970. Earlier
    /// ones only if they have not ended, or a stop is owed for them.
    ///
    /// # Errors
    /// [`StoreError`].
    fn run_of_key(&mut self, caller: &str, key: &str, since: u64) -> Result<Option<KeptRun>, StoreError>;

    /// The run of this robot with this number.
    ///
    /// # Errors
    /// [`StoreError`].
    fn run(&mut self, robot: &RobotName, id: u64) -> Result<Option<KeptRun>, StoreError>;

    /// The runs of this robot with smaller numbers than `before`, the newest first, `most` at most.
    ///
    /// # Errors
    /// [`StoreError`].
    fn runs(&mut self, robot: &RobotName, before: u64, most: usize) -> Result<Vec<Run>, StoreError>;

    /// The runs that have not ended, in the order of their numbers.
    ///
    /// # Errors
    /// [`StoreError`].
    fn open_runs(&mut self) -> Result<Vec<Run>, StoreError>;

    /// Keeps the answer to the request for this run.
    ///
    /// # Errors
    /// [`StoreError`].
    fn answer_run(&mut self, id: u64, answer: &str) -> Result<(), StoreError>;

    /// What was saved of the seat and of the alarms of each of these robots, in their order.
    ///
    /// # Errors
    /// [`StoreError`].
    fn kept(&mut self, robots: &[RobotName]) -> Result<Vec<(Saved, alarms::Saved)>, StoreError> {
        robots.iter().map(|robot| Ok((self.seat(robot)?, self.alarms(robot)?))).collect()
    }

    /// Keeps the ends of these runs, for each of which a stop is owed, and appends a record of each.
    ///
    /// # Errors
    /// [`StoreError`]: some may be kept.
    fn end_runs(&mut self, ends: &[(Run, AuditRecord)]) -> Result<(), StoreError> {
        ends.iter().try_for_each(|(run, record)| self.end_run(run, true, std::slice::from_ref(record)))
    }

    /// Keeps the end of a run, and whether a stop is still owed for it, and appends records to the audit log,
    /// all or nothing.
    ///
    /// # Errors
    /// [`StoreError`].
    fn end_run(&mut self, run: &Run, owed: bool, records: &[AuditRecord]) -> Result<(), StoreError>;

    /// The robots for which a stop is owed: a list of a run may still be there.
    ///
    /// # Errors
    /// [`StoreError`].
    fn owed_stops(&mut self) -> Result<Vec<RobotName>, StoreError>;

    /// No stop is owed for this robot any more, except for a run that has not ended.
    ///
    /// # Errors
    /// [`StoreError`].
    fn forget_owed_stop(&mut self, robot: &RobotName) -> Result<(), StoreError>;

    /// Appends the intent of a command, if its caller has not used its key. The oldest keys go.
    ///
    /// # Errors
    /// [`StoreError`].
    fn begin_command(&mut self, new: &NewCommand) -> Result<Noted, StoreError>;

    /// The command that this caller asked for with this key at this time or later, in seconds since 1970.
    ///
    /// # Errors
    /// [`StoreError`].
    fn command_of_key(
        &mut self,
        caller: &str,
        key: &str,
        since: u64,
    ) -> Result<Option<KeptCommand>, StoreError>;

    /// Keeps the answer to the request for the command with this intent, and appends its outcome to the audit
    /// log, both or neither.
    ///
    /// # Errors
    /// [`StoreError`].
    fn end_command(&mut self, intent: u64, answer: &str, outcome: &AuditRecord) -> Result<(), StoreError>;
}

/// The settings of the hall in the store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredSettings {
    /// The number of their version, from 1.
    pub version: u64,
    /// The settings, JSON.
    pub text: String,
}

/// A robot that was added through the API.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredRobot {
    /// Its name.
    pub name: RobotName,
    /// Its address, as the API has it.
    pub address: String,
    /// How often its values are read.
    pub period_ms: u64,
    /// The addresses to read, besides the usual ones.
    pub read: Vec<String>,
    /// The values that are read with a period of their own.
    pub groups: Vec<PollGroup>,
    /// The model of its arm.
    pub model: Option<String>,
    /// The counter of parts; `None`: the first counter that is read.
    pub parts: Option<String>,
    /// The limits of its lists.
    pub guard: Option<Box<GuardWanted>>,
}

/// An entry of the audit log as it is stored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Its number, from 1 without a gap.
    pub number: u64,
    /// Its text, JSON: what the hash is over.
    pub body: String,
    /// Its hash.
    pub hash: Hash,
}

/// Who changes users, tokens, programs or points, and when.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Author {
    /// The time of day, for the audit log.
    pub time: String,
    /// Who it is.
    pub actor: String,
    /// The address that the request came from; `None` for the command line and the gateway itself.
    pub source: Option<String>,
}

impl Author {
    /// The command line.
    pub fn shell(time: String) -> Self {
        Self { time, actor: "shell".to_owned(), source: None }
    }

    /// A record about no robot.
    pub fn record(&self, deed: Deed) -> AuditRecord {
        let Self { time, actor, source } = self.clone();
        AuditRecord { time, actor, source, robot: None, deed }
    }
}

/// A user in the store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredUser {
    /// What is decided about.
    pub account: Account,
    /// When it was made.
    pub created: String,
    /// The number of the entry of the audit log about its last change. So it grows with each change, also if
    /// the user is removed and made again.
    pub stamp: u64,
}

/// A change of a user.
#[derive(Clone, Debug)]
pub struct UserChange {
    /// The user.
    pub name: UserName,
    /// What shall become of it.
    pub wish: Wish,
    /// The hash of the one-time link that allows it, and the present time in seconds since 1970.
    pub link: Option<([u8; 32], u64)>,
    /// Only if the user has this stamp.
    pub if_stamp: Option<u64>,
}

/// A token to add.
#[derive(Clone, Debug)]
pub struct NewToken {
    /// SHA-256 of the token.
    pub hash: [u8; 32],
    /// What it allows.
    pub grant: Grant,
    /// What people call it.
    pub name: String,
    /// When it ends; `None`: it holds until it is revoked.
    pub expires: Option<Expiry>,
}

/// A token that is not revoked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token {
    /// Its number.
    pub number: i64,
    /// SHA-256 of the token.
    pub hash: [u8; 32],
    /// What it allows.
    pub grant: Grant,
    /// What people call it.
    pub name: String,
    /// When it ends or has ended; `None`: it holds until it is revoked.
    pub expires: Option<Expiry>,
}

/// The text of a record in the audit log.
///
/// # Errors
/// [`StoreError`]: it cannot be written as JSON.
pub fn body(record: &AuditRecord) -> Result<String, StoreError> {
    serde_json::to_string(record).map_err(|error| StoreError::Unreadable(error.to_string()))
}

/// The record about a new token.
fn token_made(number: i64, token: &NewToken, author: &Author) -> AuditRecord {
    author.record(Deed::TokenMade {
        token: number,
        role: token.grant.role,
        only: token.grant.robots.as_ref().map(ToString::to_string),
        name: token.name.clone(),
        expires_at: token.expires.as_ref().map(ToString::to_string),
    })
}

/// The record about a revoked token.
fn token_revoked(number: i64, author: &Author) -> AuditRecord {
    author.record(Deed::TokenRevoked { token: number })
}

/// The grant of a row: a role, and the robots as [`GrantRobots`] writes them.
fn grant(word: &str, robots: Option<&str>) -> Result<Grant, StoreError> {
    let unreadable = |error| StoreError::Unreadable(format!("robots of a user or a token: {error}"));
    let robots = robots.map(GrantRobots::read).transpose().map_err(unreadable)?;
    Ok(Grant { role: role(word)?, robots })
}

/// The role with this word.
fn role(word: &str) -> Result<Role, StoreError> {
    Role::of_word(word).ok_or_else(|| StoreError::Unreadable(format!("the role `{word}`")))
}
