//! The observer of a gateway. It knows what its callers asked for and heard, what its disk has, and what left
//! it for the robots.
//!
//! `gate.rs` is the host of the gateway with the wires to the robots; `caller.rs` and the files of `caller/`
//! are the callers; `values.rs` judges what is told of robots.

pub mod caller;
pub mod gate;
pub mod http;
mod values;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use r6_api::gateway::{AuditRecord, CommandOutcome, Deed, Role};
use r6_gateway::RobotName;
use r6_gateway::simulation::Disk;
use r6_proto::{CommandName, Effect};
use serde_json::Value;

use crate::fault::{Class, Promise};
use crate::floor::SKEW;
use crate::plan::{HallPlan, Part};
use crate::record::Record;

/// How long what belongs to a stop may leave after somebody asked for it: the client of the gateway takes
/// 15 s at most, and a stop may wait 4 s for a connection.
const STOP_LASTS: Duration = Duration::from_secs(25);

/// A disk that failed is tried again within a second. Some milliseconds later it has everything, and from
/// then on it has a stop before the answer tells of it.
const TRIED_AGAIN: Duration = Duration::from_millis(1300);

/// A started gateway has the values of robots that are sound, and answers, after this time: the longest wait
/// between two attempts to connect is 5 s.
const STARTS_WITHIN: Duration = Duration::from_secs(8);

/// How many entries may come to the audit log while it is read over HTTP at the end.
const LATE_ENTRIES: usize = 5;

/// The text of a token.
#[must_use]
pub fn token_of(caller: usize) -> String {
    format!("r6_{caller:064x}")
}

/// The role of a caller's token.
#[must_use]
pub fn role_of(part: Part) -> Role {
    match part {
        Part::Inspector | Part::Admin | Part::Engineer => Role::Admin,
        Part::Viewer | Part::Reader | Part::Hostile => Role::Viewer,
        Part::Operator | Part::Stopper => Role::Operator,
    }
}

/// The name of a robot.
#[must_use]
pub fn name_of(robot: usize) -> String {
    format!("robot-{robot}")
}

/// A command of which the audit log has the intent.
#[derive(Clone, Debug)]
struct Intent {
    robot: Option<String>,
    command: String,
    lease: u64,
    actor: String,
    /// How often it left.
    left: u32,
    outcome: Option<CommandOutcome>,
}

/// A lease that a caller holds.
#[derive(Clone, Copy, Debug, Default)]
struct Held {
    /// When it ends at the latest, as its holder asked for it.
    until: Duration,
    /// How many renewals are under way.
    renewals: u32,
    /// Since when it is over for sure.
    over: Option<Duration>,
}

/// What is known of one robot.
#[derive(Clone, Debug, Default)]
struct Post {
    /// The lease that began last, as the audit log says.
    last_began: u64,
    /// The number of the last lease that was given out.
    last_given: u64,
    /// When a stop was asked for last.
    stop_asked: Option<Duration>,
    /// Since when a stop holds that was told as confirmed, and no request to clear it was made.
    stopped: Option<Duration>,
    /// How many requests to clear a stop are under way, and when the last one was answered.
    clears: u32,
    last_clear: Duration,
}

/// The state of a hall.
#[derive(Debug)]
pub struct Hall {
    /// The disk of the gateway.
    pub disk: Disk,
    plan: HallPlan,
    /// How the audit log calls the caller of each token, and its role.
    actors: BTreeMap<String, Role>,
    /// The audit log as it was read.
    log: Vec<AuditRecord>,
    intents: BTreeMap<u64, Intent>,
    /// Who holds each lease, as the audit log says: by robot and number.
    began: BTreeMap<(String, u64), String>,
    ended: BTreeSet<(String, u64)>,
    held: BTreeMap<(usize, u64), Held>,
    posts: Vec<Post>,
    /// Numbers of intents and leases that callers were told of, by the number of the entry or the lease.
    told_commands: Vec<(u64, usize, String)>,
    /// Since when a gateway runs.
    pub up_since: Option<Duration>,
    /// Whether its system gives it no sockets.
    pub has_no_files: bool,
    /// Whether its disk has no room.
    disk_is_full: bool,
    /// Whether its disk is slow.
    disk_is_slow: bool,
    /// Since when its disk has room and is fast.
    disk_well_since: Option<Duration>,
    /// The last value that a caller wrote: no value is written twice.
    pub last_value: i64,
    /// The last key of a lease of each robot, for those who try to use the key of another caller.
    pub last_keys: BTreeMap<usize, String>,
    /// Whether each caller has done its work.
    pub is_done: Vec<bool>,
    /// Whether everything worked at the end.
    pub is_well: bool,
}

impl Hall {
    /// A hall before its first event. The tokens of the callers are on the disk.
    ///
    /// # Panics
    /// If a store in memory cannot be made: then no world can run.
    #[must_use]
    pub fn new(plan: &HallPlan, seed: u64) -> Self {
        let disk = Disk::new(seed).expect("a store in memory");
        let add = |(number, caller): (usize, &crate::plan::CallerPlan)| {
            let role = role_of(caller.part);
            let name = format!("caller-{number}");
            let actor = disk.add_token(&token_of(number), role, &name).expect("a store with room");
            (actor, role)
        };
        let actors = plan.callers.iter().enumerate().map(add).collect();
        let (intents, began, ended, held) = Default::default();
        Self {
            disk,
            actors,
            log: Vec::new(),
            intents,
            began,
            ended,
            held,
            posts: vec![Post::default(); plan.periods.len()],
            told_commands: Vec::new(),
            up_since: None,
            has_no_files: false,
            disk_is_full: false,
            disk_is_slow: false,
            disk_well_since: Some(Duration::ZERO),
            last_value: 0,
            last_keys: BTreeMap::new(),
            is_done: vec![false; plan.callers.len()],
            is_well: false,
            plan: plan.clone(),
        }
    }

    /// Whether the gateway has to answer, and to have the values of this robot.
    #[must_use]
    pub fn is_sound(&self, robot: usize, at: Duration) -> bool {
        self.plan.is_sound(robot, at) && self.up_since.is_some_and(|since| since + STARTS_WITHIN < at)
    }

    /// Whether the gateway has to answer what is asked at this time and is not answered until then.
    #[must_use]
    pub fn has_to_answer(&self, asked: Duration, until: Duration) -> bool {
        !self.plan.is_away(asked, until) && self.up_since.is_some_and(|since| since + STARTS_WITHIN < asked)
    }

    /// Its disk has no room from now on, or has room again.
    pub fn disk_fills(&mut self, at: Duration, is_full: bool) {
        self.disk_is_full = is_full;
        self.note_disk(at);
    }

    /// Its disk is slow from now on, or fast again.
    pub fn disk_slows(&mut self, at: Duration, is_slow: bool) {
        self.disk_is_slow = is_slow;
        self.note_disk(at);
    }

    fn note_disk(&mut self, at: Duration) {
        self.disk_well_since = (!self.disk_is_full && !self.disk_is_slow).then_some(at);
    }

    /// A value that was never written.
    pub fn next_value(&mut self) -> i64 {
        self.last_value += 1;
        self.last_value
    }

    /// Reads what is new in the audit log.
    fn read_audit(&mut self) {
        loop {
            let page = self.disk.entries(self.seen()).unwrap_or_default();
            if page.is_empty() {
                return;
            }
            for (number, record) in page {
                self.log.push(record.clone());
                self.enter(number, record);
            }
        }
    }

    /// The number of the last entry that was read. There are no gaps.
    fn seen(&self) -> u64 {
        self.log.len() as u64
    }

    /// The whole audit log as the disk has it now.
    fn log_on_disk(&self) -> Result<Vec<AuditRecord>, String> {
        let mut log = Vec::new();
        loop {
            let page = self.disk.entries(log.len() as u64).map_err(|error| error.to_string())?;
            if page.is_empty() {
                return Ok(log);
            }
            log.extend(page.into_iter().map(|(_, record)| record));
        }
    }

    fn enter(&mut self, number: u64, record: AuditRecord) {
        let AuditRecord { actor, robot, deed, .. } = record;
        match (deed, robot) {
            (Deed::LeaseBegan { lease, .. }, Some(robot)) => {
                if let Some(post) = self.posts.iter_mut().enumerate().find(|(of, _)| name_of(*of) == robot) {
                    post.1.last_began = post.1.last_began.max(lease);
                }
                self.began.insert((robot, lease), actor);
            }
            (Deed::LeaseEnded { lease, .. }, Some(robot)) => drop(self.ended.insert((robot, lease))),
            (Deed::CommandIntent { command, lease }, robot) => {
                let intent = Intent { robot, command, lease, actor, left: 0, outcome: None };
                self.intents.insert(number, intent);
            }
            (Deed::CommandOutcome { intent, outcome, .. }, _) => {
                if let Some(intent) = self.intents.get_mut(&intent) {
                    intent.outcome = Some(outcome);
                }
            }
            _ => {}
        }
    }

    /// A whole frame leaves the gateway for a robot.
    pub fn leaves(&mut self, at: Duration, robot: usize, frame: &Value, record: &mut Record) {
        record.tally.frames += 1;
        let words: Vec<_> =
            frame["cmdData"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        let is_list = frame["reqType"] == "AddRCC";
        let is_command = frame["reqType"] == "command";
        if !is_list && !is_command {
            return;
        }
        let word = words.first().copied().unwrap_or_default();
        let effect = if is_list {
            // No caller of a world runs a program: only a stop clears the list.
            let clears = frame["instructions"].as_array().is_some_and(Vec::is_empty);
            if clears { Effect::Stops } else { Effect::Moves }
        } else {
            CommandName::exact(word.as_bytes()).map_or(Effect::Moves, CommandName::effect)
        };
        let post = &self.posts[robot];
        match effect {
            Effect::Stops => {
                let asked = post.stop_asked.is_some_and(|asked| at <= asked + STOP_LASTS);
                record.check(Promise::Meant, at, asked, || {
                    format!("{}: a stop leaves, and no request for one was made: {frame}", name_of(robot))
                });
            }
            Effect::Reads => {}
            Effect::Changes | Effect::Moves => self.acts(at, robot, effect, &text_of(&words), record),
        }
    }

    /// A command that changes or moves leaves.
    fn acts(&mut self, at: Duration, robot: usize, effect: Effect, text: &str, record: &mut Record) {
        self.read_audit();
        let name = name_of(robot);
        let stopped = self.posts[robot].stopped;
        let holds = effect != Effect::Moves || stopped.is_none_or(|since| at <= since);
        record.check(Promise::I4, at, holds, || {
            format!("{name}: {text} leaves, a stop holds since {:?}", stopped.unwrap_or_default())
        });
        let is_of = |intent: &Intent| intent.robot.as_deref() == Some(&name) && intent.command == text;
        let open = self.intents.values_mut().find(|intent| is_of(intent) && intent.outcome.is_none());
        record.check(Promise::I12, at, open.is_some(), || {
            format!("{name}: {text} leaves, and the audit log has no open intent of it")
        });
        let Some(intent) = open else { return };
        intent.left += 1;
        let (left, lease, actor) = (intent.left, intent.lease, intent.actor.clone());
        record.check(Promise::Once, at, left == 1, || format!("{name}: {text} left {left} times"));
        let role = self.actors.get(&actor).copied();
        record.check(Promise::I12, at, role.is_some_and(|role| role >= Role::Operator), || {
            format!("{name}: {text} leaves for {actor}, whose role is {role:?}")
        });
        let holder = self.began.get(&(name.clone(), lease));
        record.check(Promise::I12, at, holder == Some(&actor), || {
            format!("{name}: {text} leaves for {actor} under lease {lease}, which is of {holder:?}")
        });
        let last = self.posts[robot].last_began;
        let is_over = self.ended.contains(&(name.clone(), lease)) || last != lease;
        record.check(Promise::I12, at, !is_over, || {
            format!("{name}: {text} leaves under lease {lease}, which has ended; the last one is {last}")
        });
        let held = self.held.get(&(robot, lease)).copied();
        let lives = held.is_some_and(|held| {
            held.over.is_none_or(|over| at <= over) && (held.renewals > 0 || at <= held.until + SKEW)
        });
        record.check(Promise::I12, at, lives, || {
            format!("{name}: {text} leaves under lease {lease}, which is over: {held:?}")
        });
    }

    /// A caller was given a lease for which it had asked.
    pub fn gives_lease(
        &mut self,
        at: Duration,
        robot: usize,
        (number, lasts): (u64, Duration),
        record: &mut Record,
    ) {
        self.read_audit();
        let name = name_of(robot);
        let holder = self.began.get(&(name.clone(), number));
        record.check(Promise::I7, at, holder.is_some(), || {
            format!("{name}: lease {number} was given out, and the disk does not know that it began")
        });
        let saved =
            RobotName::new(&name).and_then(|name| self.disk.seat(&name).ok()).map_or(0, |seat| seat.0);
        record.check(Promise::I7, at, saved >= number, || {
            format!("{name}: lease {number} was given out, and the disk has number {saved}")
        });
        let post = &mut self.posts[robot];
        let last = post.last_given;
        record.check(Promise::I12, at, number > last, || {
            format!("{name}: lease {number} was given out after lease {last}")
        });
        post.last_given = last.max(number);
        for ((_, earlier), held) in self.held.range_mut((robot, 0)..(robot, number)) {
            debug_assert!(*earlier < number, "the range ends before it");
            held.over.get_or_insert(at);
        }
        self.held.insert((robot, number), Held { until: at + lasts, ..Held::default() });
    }

    /// A renewal is asked for.
    pub fn renews(&mut self, robot: usize, number: u64) {
        self.held.entry((robot, number)).or_default().renewals += 1;
    }

    /// What became of a renewal: until when the lease lasts at the latest, if it was renewed.
    pub fn renewed(&mut self, robot: usize, number: u64, until: Option<Duration>) {
        let held = self.held.entry((robot, number)).or_default();
        held.renewals = held.renewals.saturating_sub(1);
        held.until = held.until.max(until.unwrap_or_default());
    }

    /// A lease was given back.
    pub fn released(&mut self, at: Duration, robot: usize, number: u64) {
        self.held.entry((robot, number)).or_default().over.get_or_insert(at);
    }

    /// A stop is asked for.
    pub fn asks_stop(&mut self, at: Duration, robot: usize) {
        self.posts[robot].stop_asked = Some(at);
    }

    /// A stop that was asked for at `asked` was told as confirmed. Returns whether it holds for sure: whether
    /// no request may have cleared it meanwhile.
    pub fn stopped(&mut self, at: Duration, robot: usize, asked: Duration) -> bool {
        let post = &mut self.posts[robot];
        // What belongs to the stop may still leave where others stop the robot, too.
        let holds = post.clears == 0 && post.last_clear < asked;
        if holds {
            post.stopped.get_or_insert(at);
        }
        holds
    }

    /// Somebody asks to clear a stop.
    pub fn asks_clear(&mut self, robot: usize) {
        let post = &mut self.posts[robot];
        post.clears += 1;
        post.stopped = None;
    }

    /// The answer to a request to clear a stop has come, or its caller has gone.
    pub fn cleared(&mut self, at: Duration, robot: usize) {
        let post = &mut self.posts[robot];
        post.clears = post.clears.saturating_sub(1);
        post.last_clear = at;
    }

    /// A caller was told that its command was accepted.
    pub fn accepted(&mut self, at: Duration, robot: usize, (id, text): (u64, &str), record: &mut Record) {
        self.read_audit();
        let intent = self.intents.get(&id);
        let is_kept = intent.is_some_and(|intent| intent.command == text && intent.left == 1);
        record.check(Promise::I7, at, is_kept, || {
            format!("{}: {text} was accepted as {id}, and the audit log has {intent:?}", name_of(robot))
        });
        self.told_commands.push((id, robot, text.to_owned()));
    }

    /// The process of the gateway was killed.
    pub fn is_killed(&mut self, at: Duration, record: &mut Record) {
        self.disk.unmount();
        self.up_since = None;
        for held in self.held.values_mut() {
            held.over.get_or_insert(at);
        }
        self.check_disk(at, record);
    }

    /// Checks that the disk has what callers were told of: stops, leases and commands.
    pub fn check_disk(&mut self, at: Duration, record: &mut Record) {
        self.check_log(at, record);
        let is_well = self.disk_well_since.is_some_and(|since| since + TRIED_AGAIN < at);
        for (robot, post) in self.posts.iter_mut().enumerate() {
            let seat = RobotName::new(&name_of(robot)).and_then(|name| self.disk.seat(&name).ok());
            let (number, is_saved) = seat.unwrap_or_default();
            let given = post.last_given;
            record.check(Promise::I7, at, number >= given, || {
                format!("{}: lease {given} was given out, and the disk has {number}", name_of(robot))
            });
            let Some(since) = post.stopped else { continue };
            record.check(Promise::I7, at, is_saved || !is_well, || {
                format!("{}: a stop holds since {since:?}, and the disk does not know", name_of(robot))
            });
            if !is_saved {
                // It was not on the disk yet: so it may be lost.
                post.stopped = None;
            }
        }
    }

    /// Checks the chain of the audit log, that it still has what was read of it before, and that it has all
    /// commands that callers were told of.
    fn check_log(&mut self, at: Duration, record: &mut Record) {
        self.read_audit();
        let verified = self.disk.verify();
        record.check(Promise::I7, at, verified == Ok(self.seen()), || {
            format!("the audit log has {} entries: {verified:?}", self.seen())
        });
        let kept = self.log_on_disk();
        record.check(Promise::I7, at, kept.as_ref() == Ok(&self.log), || {
            format!("the audit log has other entries than before: {:?}", kept.map(|log| log.len()))
        });
        for (id, robot, text) in &self.told_commands {
            let is_there = self.intents.get(id).is_some_and(|intent| {
                intent.command == *text && intent.robot.as_ref() == Some(&name_of(*robot))
            });
            record.check(Promise::I7, at, is_there, || format!("{text} was accepted as {id}, and is lost"));
        }
    }

    /// Compares the audit log as it was told over HTTP with the disk. What was noted meanwhile may have been
    /// written since: some entries at most.
    ///
    /// # Errors
    /// What differs.
    pub fn compare_log(&mut self, told: &[AuditRecord]) -> Result<(), String> {
        self.read_audit();
        let differs = told.iter().zip(&self.log).position(|(told, kept)| told != kept);
        if let Some(place) = differs {
            return Err(format!(
                "entry {} is {:?}, and the disk has {:?}",
                place + 1,
                told[place],
                self.log[place]
            ));
        }
        let (told, kept) = (told.len(), self.log.len());
        let is_whole = told <= kept && kept <= told + LATE_ENTRIES;
        if is_whole { Ok(()) } else { Err(format!("it ends with {told}, and the disk has {kept}")) }
    }

    /// The commands whose outcome the audit log does not have.
    pub fn open_intents(&mut self) -> Vec<u64> {
        self.read_audit();
        let open = self.intents.iter().filter(|(_, intent)| intent.outcome.is_none());
        open.map(|(number, _)| *number).collect()
    }

    /// Counts writes to the disk that failed.
    pub fn count_refused(&self, record: &mut Record) {
        for _ in 0..self.disk.take_refused() {
            record.strikes(Class::S1);
        }
    }
}

/// A command as the audit log tells it.
fn text_of(words: &[&str]) -> String {
    let Some((word, arguments)) = words.split_first() else { return String::new() };
    let arguments: Vec<_> = arguments.iter().map(|argument| format!("{argument:?}")).collect();
    if arguments.is_empty() { (*word).to_owned() } else { format!("{word} {}", arguments.join(",")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disk_is_well_when_it_has_room_and_is_fast() {
        let Some(plan) = crate::plan::Plan::with_gateway(1).hall else { panic!("a hall") };
        let mut hall = Hall::new(&plan, 1);
        let second = Duration::from_secs;
        hall.disk_fills(second(1), true);
        hall.disk_slows(second(2), true);
        hall.disk_fills(second(3), false);
        assert_eq!(hall.disk_well_since, None, "it is slow");
        hall.disk_slows(second(4), false);
        assert_eq!(hall.disk_well_since, Some(second(4)));
    }

    #[test]
    fn a_command_is_told_as_the_audit_log_tells_it() {
        let command = r6_proto::Command::RewriteData {
            register: r6_proto::RegisterIndex::new(800).expect("a register"),
            value: 5,
            savable: false,
        };
        assert_eq!(text_of(&["rewriteData", "800", "5", "0"]), command.to_string());
        assert_eq!(text_of(&["startButton"]), r6_proto::Command::StartButton.to_string());
    }
}
