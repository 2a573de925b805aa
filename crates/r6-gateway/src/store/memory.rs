//! A store that keeps nothing beyond the process, for tests.

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::{Receiver, Sender};

use r6_api::gateway::{AuditRecord, Deed, Run};

use super::commands::{KEPT as KEYS_KEPT, KEPT_AT_LEAST, KeptCommand, MAX_KEYS, NewCommand, Noted};
use super::library::removed;
use super::runs::{Begun, KEPT, KeptRun, MAX_RUNS, MAX_RUNS_OF_ONE, NewRun};
use super::{
    Author, Ends, Entry, Heads, Kept, KeptPoint, LibraryError, Link, MAX_PAGE, MAX_TOKENS, NewGrant,
    NewPoint, NewToken, NewVersion, Store, StoreError, StoredRobot, StoredSettings, StoredUser, Token,
    UserChange, body, check_link, decide, link_made, points, token_made, token_revoked, user_changed,
};
use crate::core::account::{Decided, UserName};
use crate::core::alarms;
use crate::core::camera::{Camera, CameraGrant};
use crate::core::chain::{Hash, link};
use crate::core::library::{Condition, MAX_VERSIONS, ProgramName};
use crate::core::name::RobotName;
use crate::core::point::PointName;
use crate::core::retention::BATCH;
use crate::core::seat::Saved;

/// A store in memory.
#[derive(Debug, Default)]
pub struct Memory {
    entries: Vec<Entry>,
    heads: Heads,
    tokens: Vec<Token>,
    last_token: i64,
    seats: BTreeMap<RobotName, Saved>,
    alarms: BTreeMap<RobotName, alarms::Saved>,
    settings: Option<StoredSettings>,
    robots: BTreeMap<RobotName, StoredRobot>,
    /// The versions of each program, the oldest first.
    programs: BTreeMap<ProgramName, Vec<(Kept, String)>>,
    /// The versions of each point, the oldest first.
    points: BTreeMap<PointName, Vec<KeptPoint>>,
    cameras: BTreeMap<(RobotName, Camera, i64), CameraGrant>,
    users: BTreeMap<UserName, StoredUser>,
    links: Vec<Link>,
    runs: BTreeMap<u64, MemoryRun>,
    last_run: u64,
    /// The commands with a key, the oldest first.
    commands: VecDeque<MemoryCommand>,
    /// Asked when it is settled.
    settles: Option<Gate>,
}

/// Tells a test that the store is settled now, and waits until it may.
type Gate = (Sender<()>, Receiver<()>);

#[derive(Debug)]
struct MemoryCommand {
    of: (String, String),
    made: u64,
    kept: KeptCommand,
}

#[derive(Debug)]
struct MemoryRun {
    robot: RobotName,
    of: (String, String),
    made: u64,
    owed: bool,
    kept: KeptRun,
}

#[cfg(test)]
impl Memory {
    /// A store that says when it is settled, and waits then.
    pub fn with_gate(gate: Gate) -> Self {
        Self { settles: Some(gate), ..Self::default() }
    }
}

impl Store for Memory {
    fn append(&mut self, records: &[AuditRecord]) -> Result<u64, StoreError> {
        let first = self.entries.last().map_or(1, |entry| entry.number + 1);
        let bodies = records.iter().map(body).collect::<Result<Vec<_>, _>>()?;
        for (number, body) in (first..).zip(bodies) {
            let before = self.entries.last().map_or(Hash::ORIGIN, |entry| entry.hash);
            let hash = link(before, number, &body);
            self.entries.push(Entry { number, body, hash });
        }
        Ok(first)
    }

    fn settle(&mut self) -> Result<(), StoreError> {
        if let Some((began, may_end)) = &self.settles {
            let _ = began.send(());
            let _ = may_end.recv();
        }
        Ok(())
    }

    fn entries(&mut self, after: u64, most: usize) -> Result<Vec<Entry>, StoreError> {
        let entries = self.entries.iter().filter(|entry| entry.number > after);
        Ok(entries.take(most.min(MAX_PAGE)).cloned().collect())
    }

    fn ends(&mut self) -> Result<Ends, StoreError> {
        let first = self.entries.first().map_or(0, |entry| entry.number);
        let (last, hash) = self.entries.last().map_or((0, Hash::ORIGIN), |entry| (entry.number, entry.hash));
        let open = self.open_intents()?.into_iter().map(|(number, _)| number);
        Ok(Ends { first, last, hash, open: open.take_while(|number| *number < first + BATCH).next() })
    }

    fn heads(&mut self) -> Result<Heads, StoreError> {
        Ok(self.heads.clone())
    }

    fn put_key(&mut self, key: &str, cut: Option<&str>, record: &AuditRecord) -> Result<(), StoreError> {
        self.append(std::slice::from_ref(record))?;
        self.heads = Heads {
            key: Some(key.to_owned()),
            end: None,
            cut: cut.map(str::to_owned).or(self.heads.cut.take()),
        };
        Ok(())
    }

    fn put_head(&mut self, note: &str) -> Result<(), StoreError> {
        self.heads.end = Some(note.to_owned());
        Ok(())
    }

    fn cut(&mut self, until: u64, note: &str) -> Result<(), StoreError> {
        if self.entries.last().is_some_and(|last| until < last.number) {
            self.entries.retain(|entry| entry.number > until);
            self.heads.cut = Some(note.to_owned());
        }
        Ok(())
    }

    fn open_intents(&mut self) -> Result<Vec<(u64, Option<String>)>, StoreError> {
        let mut open = BTreeMap::new();
        for entry in &self.entries {
            let record: AuditRecord = serde_json::from_str(&entry.body)
                .map_err(|error| StoreError::Unreadable(error.to_string()))?;
            match record.deed {
                Deed::CommandIntent { .. } => drop(open.insert(entry.number, record.robot)),
                Deed::CommandOutcome { intent, .. } => drop(open.remove(&intent)),
                _ => {}
            }
        }
        Ok(open.into_iter().collect())
    }

    fn add_token(&mut self, token: &NewToken, author: &Author) -> Result<i64, StoreError> {
        if self.tokens.len() >= MAX_TOKENS {
            return Err(StoreError::TooManyTokens);
        }
        let number = self.last_token + 1;
        self.append(&[token_made(number, token, author)])?;
        self.last_token = number;
        let NewToken { hash, grant, name, expires } = token.clone();
        self.tokens.push(Token { number, hash, grant, name, expires });
        Ok(number)
    }

    fn revoke_token(&mut self, number: i64, author: &Author) -> Result<bool, StoreError> {
        let Some(at) = self.tokens.iter().position(|token| token.number == number) else { return Ok(false) };
        self.append(&[token_revoked(number, author)])?;
        self.tokens.remove(at);
        self.cameras.retain(|(_, _, token), _| *token != number);
        Ok(true)
    }

    fn tokens(&mut self) -> Result<Vec<Token>, StoreError> {
        Ok(self.tokens.clone())
    }

    fn cameras(&mut self, of: Option<&RobotName>) -> Result<Vec<(RobotName, CameraGrant)>, StoreError> {
        let wanted = self.cameras.iter().filter(|((robot, ..), _)| of.is_none_or(|of| of == robot));
        Ok(wanted.map(|((robot, ..), grant)| (robot.clone(), grant.clone())).collect())
    }

    fn grant_camera(&mut self, new: &NewGrant, author: &Author) -> Result<bool, StoreError> {
        let known: Vec<_> = self.cameras(Some(&new.robot))?.into_iter().map(|(_, grant)| grant).collect();
        if !new.is_new(&self.tokens, &known)? {
            return Ok(false);
        }
        self.append(&[new.granted(author)])?;
        self.cameras.insert((new.robot.clone(), new.camera, new.token), new.given(author));
        Ok(true)
    }

    fn revoke_camera(&mut self, grant: &NewGrant, author: &Author) -> Result<bool, StoreError> {
        let key = (grant.robot.clone(), grant.camera, grant.token);
        if self.cameras.remove(&key).is_none() {
            return Ok(false);
        }
        self.append(&[grant.revoked(author)])?;
        Ok(true)
    }

    fn users(&mut self) -> Result<Vec<StoredUser>, StoreError> {
        Ok(self.users.values().cloned().collect())
    }

    fn change_user(&mut self, change: &UserChange, author: &Author) -> Result<(Decided, u64), StoreError> {
        let link =
            change.link.and_then(|(hash, _)| self.links.iter().find(|link| link.hash == hash)).cloned();
        let decided = decide(&self.users()?, change, link.as_ref())?;
        let Some(record) = user_changed(change, &decided, author) else { return Ok((decided, 0)) };
        let stamp = self.append(&[record])?;
        let old = self.users.remove(&change.name);
        let is_removed = decided == Decided::Removed;
        if let Decided::Made(account) | Decided::Changed(account) = &decided {
            let created = old.map_or_else(|| author.time.clone(), |old| old.created);
            let user = StoredUser { account: account.clone(), created, stamp };
            self.users.insert(change.name.clone(), user);
        }
        if is_removed || change.wish.sets_password() {
            self.links.retain(|link| link.user.as_ref() != Some(&change.name));
        }
        self.links.retain(|link| change.link.is_none_or(|(hash, _)| hash != link.hash));
        Ok((decided, stamp))
    }

    fn put_link(&mut self, link: &Link, author: &Author) -> Result<(), StoreError> {
        check_link(&self.users()?, link)?;
        self.append(&[link_made(link, author)])?;
        self.links.retain(|other| other.user != link.user);
        self.links.push(link.clone());
        Ok(())
    }

    fn link(&mut self, hash: &[u8; 32], now: u64) -> Result<Option<Link>, StoreError> {
        let mut valid = self.links.iter().filter(|link| link.is_valid(now));
        Ok(valid.find(|link| link.hash == *hash).cloned())
    }

    fn remove_setup_link(&mut self) -> Result<(), StoreError> {
        self.links.retain(|link| link.user.is_some());
        Ok(())
    }

    fn seat(&mut self, robot: &RobotName) -> Result<Saved, StoreError> {
        Ok(self.seats.get(robot).cloned().unwrap_or_default())
    }

    fn save_seat(&mut self, robot: &RobotName, saved: &Saved) -> Result<(), StoreError> {
        self.seats.insert(robot.clone(), saved.clone());
        Ok(())
    }

    fn alarms(&mut self, robot: &RobotName) -> Result<alarms::Saved, StoreError> {
        Ok(self.alarms.get(robot).cloned().unwrap_or_default())
    }

    fn save_alarms(
        &mut self,
        robot: &RobotName,
        saved: &alarms::Saved,
        records: &[AuditRecord],
    ) -> Result<(), StoreError> {
        self.append(records)?;
        self.alarms.insert(robot.clone(), saved.clone());
        Ok(())
    }

    fn settings(&mut self) -> Result<Option<StoredSettings>, StoreError> {
        Ok(self.settings.clone())
    }

    fn put_settings(&mut self, settings: &StoredSettings, record: &AuditRecord) -> Result<(), StoreError> {
        self.append(std::slice::from_ref(record))?;
        self.settings = Some(settings.clone());
        Ok(())
    }

    fn robots(&mut self) -> Result<Vec<StoredRobot>, StoreError> {
        Ok(self.robots.values().cloned().collect())
    }

    fn put_robot(&mut self, robot: &StoredRobot, record: &AuditRecord) -> Result<(), StoreError> {
        self.append(std::slice::from_ref(record))?;
        self.robots.insert(robot.name.clone(), robot.clone());
        Ok(())
    }

    fn remove_robot(&mut self, name: &RobotName, records: &[AuditRecord]) -> Result<(), StoreError> {
        self.append(records)?;
        self.robots.remove(name);
        Ok(())
    }

    fn programs(&mut self) -> Result<Vec<Kept>, StoreError> {
        Ok(self.programs.values().filter_map(|versions| Some(versions.last()?.0.clone())).collect())
    }

    fn program_versions(&mut self, name: &ProgramName) -> Result<Vec<Kept>, StoreError> {
        let versions = self.programs.get(name).into_iter().flatten().rev();
        Ok(versions.map(|(kept, _)| kept.clone()).collect())
    }

    fn program(
        &mut self,
        name: &ProgramName,
        version: Option<u64>,
    ) -> Result<Option<(Kept, String)>, StoreError> {
        let mut versions = self.programs.get(name).into_iter().flatten().rev();
        let found = versions.find(|(kept, _)| version.is_none_or(|version| version == kept.tag.version));
        Ok(found.cloned())
    }

    fn put_program(&mut self, new: &NewVersion, condition: &Condition) -> Result<Kept, LibraryError> {
        let versions = self.programs.get(&new.name).cloned().unwrap_or_default();
        let last = versions.last().map(|(kept, _)| kept.tag);
        condition.check(last)?;
        let kept = new.kept(last);
        let goes = (versions.len() + 1).saturating_sub(MAX_VERSIONS);
        let total: u64 = self.programs.values().flatten().map(|(kept, _)| kept.bytes).sum();
        let freed: u64 = versions.iter().take(goes).map(|(kept, _)| kept.bytes).sum();
        new.check_room(last.is_none().then_some(self.programs.len()), total - freed)?;
        self.append(&[new.record(&kept)])?;
        let stays = versions.into_iter().skip(goes).chain([(kept.clone(), new.text.clone())]);
        self.programs.insert(new.name.clone(), stays.collect());
        Ok(kept)
    }

    fn remove_program(
        &mut self,
        name: &ProgramName,
        condition: &Condition,
        by: &Author,
    ) -> Result<(), LibraryError> {
        let last = self.programs.get(name).and_then(|versions| Some(versions.last()?.0.tag));
        let last = last.ok_or(LibraryError::NoSuchProgram)?;
        condition.check(Some(last))?;
        self.append(&[removed(name, last, by)])?;
        self.programs.remove(name);
        Ok(())
    }

    fn points(&mut self) -> Result<Vec<KeptPoint>, StoreError> {
        Ok(self.points.values().filter_map(|versions| versions.last().cloned()).collect())
    }

    fn point_versions(&mut self, name: &PointName) -> Result<Vec<KeptPoint>, StoreError> {
        Ok(self.points.get(name).into_iter().flatten().rev().cloned().collect())
    }

    fn put_point(&mut self, new: &NewPoint, condition: &Condition) -> Result<KeptPoint, LibraryError> {
        let versions = self.points.get(&new.name).cloned().unwrap_or_default();
        let last = versions.last().map(|kept| kept.tag);
        condition.check(last)?;
        if last.is_none() {
            points::check_room(self.points.len())?;
        }
        let kept = new.kept(last);
        self.append(&[new.record(&kept)])?;
        let goes = (versions.len() + 1).saturating_sub(MAX_VERSIONS);
        let stays = versions.into_iter().skip(goes).chain([kept.clone()]);
        self.points.insert(new.name.clone(), stays.collect());
        Ok(kept)
    }

    fn remove_point(
        &mut self,
        name: &PointName,
        condition: &Condition,
        by: &Author,
    ) -> Result<(), LibraryError> {
        let last = self.points.get(name).and_then(|versions| Some(versions.last()?.tag));
        let last = last.ok_or(LibraryError::NoSuchPoint)?;
        condition.check(Some(last))?;
        self.append(&[points::removed(name, last, by)])?;
        self.points.remove(name);
        Ok(())
    }

    fn begin_run(&mut self, new: &NewRun) -> Result<Begun, StoreError> {
        let oldest = new.now.saturating_sub(KEPT);
        self.runs.retain(|_, run| run.made >= oldest || !run.kept.ended || run.owed);
        if let Some(known) = self.run_of_key(&new.caller, &new.key, 0)? {
            return Ok(Begun::Known(Box::new(known)));
        }
        let own = self.runs.values().filter(|run| run.robot == new.robot).count();
        if self.runs.len() >= MAX_RUNS || own >= MAX_RUNS_OF_ONE {
            return Ok(Begun::Full);
        }
        let id = self.last_run + 1;
        self.append(&[new.record(id)])?;
        self.last_run = id;
        let kept = KeptRun {
            hash: new.hash,
            run: Run { run_id: id, ..new.run.clone() },
            answer: None,
            ended: false,
        };
        let of = (new.caller.clone(), new.key.clone());
        self.runs.insert(id, MemoryRun { robot: new.robot.clone(), of, made: new.now, owed: true, kept });
        Ok(Begun::New(id))
    }

    fn run_of_key(&mut self, caller: &str, key: &str, since: u64) -> Result<Option<KeptRun>, StoreError> {
        let kept = |run: &&MemoryRun| run.made >= since || !run.kept.ended || run.owed;
        let mut runs = self.runs.values().filter(kept);
        Ok(runs.find(|run| run.of.0 == caller && run.of.1 == key).map(|run| run.kept.clone()))
    }

    fn run(&mut self, robot: &RobotName, id: u64) -> Result<Option<KeptRun>, StoreError> {
        Ok(self.runs.get(&id).filter(|run| run.robot == *robot).map(|run| run.kept.clone()))
    }

    fn runs(&mut self, robot: &RobotName, before: u64, most: usize) -> Result<Vec<Run>, StoreError> {
        let earlier = self.runs.range(..before).rev().map(|(_, run)| run);
        let own = earlier.filter(|run| run.robot == *robot);
        Ok(own.take(most).map(|run| run.kept.run.clone()).collect())
    }

    fn open_runs(&mut self) -> Result<Vec<Run>, StoreError> {
        Ok(self.runs.values().filter(|run| !run.kept.ended).map(|run| run.kept.run.clone()).collect())
    }

    fn answer_run(&mut self, id: u64, answer: &str) -> Result<(), StoreError> {
        if let Some(run) = self.runs.get_mut(&id) {
            run.kept.answer = Some(answer.to_owned());
        }
        Ok(())
    }

    fn end_run(&mut self, run: &Run, owed: bool, records: &[AuditRecord]) -> Result<(), StoreError> {
        self.append(records)?;
        if let Some(known) = self.runs.get_mut(&run.run_id) {
            (known.kept.run, known.kept.ended, known.owed) = (run.clone(), true, owed);
        }
        Ok(())
    }

    fn owed_stops(&mut self) -> Result<Vec<RobotName>, StoreError> {
        let owed: std::collections::BTreeSet<_> =
            self.runs.values().filter(|run| run.owed).map(|run| run.robot.clone()).collect();
        Ok(owed.into_iter().collect())
    }

    fn forget_owed_stop(&mut self, robot: &RobotName) -> Result<(), StoreError> {
        let ended = |run: &&mut MemoryRun| run.robot == *robot && run.kept.ended;
        self.runs.values_mut().filter(ended).for_each(|run| run.owed = false);
        Ok(())
    }

    fn begin_command(&mut self, new: &NewCommand) -> Result<Noted, StoreError> {
        let oldest = new.now.saturating_sub(KEYS_KEPT);
        self.commands.retain(|command| command.made >= oldest);
        if let Some(known) = self.command_of_key(&new.caller, &new.key, 0)? {
            return Ok(Noted::Known(known));
        }
        if self.commands.len() as u64 >= MAX_KEYS {
            let certain = new.now.saturating_sub(KEPT_AT_LEAST);
            if self.commands.front().is_some_and(|oldest| oldest.made > certain) {
                return Ok(Noted::Full);
            }
            self.commands.pop_front();
        }
        let intent = self.append(std::slice::from_ref(&new.intent))?;
        let kept = KeptCommand { intent, hash: new.hash, answer: None, ended: false };
        let of = (new.caller.clone(), new.key.clone());
        self.commands.push_back(MemoryCommand { of, made: new.now, kept });
        Ok(Noted::New(intent))
    }

    fn command_of_key(
        &mut self,
        caller: &str,
        key: &str,
        since: u64,
    ) -> Result<Option<KeptCommand>, StoreError> {
        let open = self.open_intents()?;
        let mut known = self.commands.iter().filter(|known| known.made >= since);
        let known = known.find(|known| known.of.0 == caller && known.of.1 == key);
        Ok(known.map(|MemoryCommand { kept, .. }| {
            let ended = open.iter().all(|(number, _)| *number != kept.intent);
            KeptCommand { ended, ..kept.clone() }
        }))
    }

    fn end_command(&mut self, intent: u64, answer: &str, outcome: &AuditRecord) -> Result<(), StoreError> {
        self.append(std::slice::from_ref(outcome))?;
        let mut commands = self.commands.iter_mut();
        if let Some(known) = commands.find(|known| known.kept.intent == intent) {
            known.kept.answer = Some(answer.to_owned());
        }
        Ok(())
    }
}
