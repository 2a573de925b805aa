//! The robots of other gateways, as their owners tell of them.
//!
//! What is here are copies: of the last values, over the stream that browsers use (`sharing/far.rs`), and of
//! the state of the robot. Each gateway that tells of a robot has a copy of its own ([`Far`]), and the rows
//! of the store say which of them counts: so a gateway that was frozen and goes on with a robot that it has
//! lost changes nothing. Readers get a copy as they get a robot of this gateway ([`Shown`]), under numbers of
//! this gateway. Once the owner is not heard of any more, no value is told as fresh; whether a stop holds is
//! read from the store then, and the lease is told until the rows say that its owner ended.

mod copied;
mod teller;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};
use std::time::Duration;

use r6_api::gateway::{LiveChange, RobotState, RobotSummary, Signal};
use r6_proto::time::Instant;

pub use self::copied::HEARD;
use self::copied::{Copied, millis};
pub use self::teller::Teller;
use crate::clock;
use crate::core::live::follower::Step;
use crate::core::live::numbers::{Numbers, Span};
use crate::core::owner::EXPIRES;
use crate::core::seat::Saved;

/// How long a stop may have been told without being in the store: its owner writes for 2 s at most.
const WRITTEN: Duration = EXPIRES;

/// A robot as readers of live values see it, whichever gateway owns it.
pub trait Shown: Send + Sync {
    /// Its name.
    fn name(&self) -> &str;
    /// All but its values.
    fn summary(&self) -> RobotSummary;
    /// The robot with these values.
    fn state_with(&self, number: u64, signals: Vec<Signal>) -> RobotState;
    /// What a reader gets, and the values for it.
    fn tell_reader(&self, step: &mut dyn FnMut(Span) -> Step) -> (Span, Step, Vec<Signal>);
}

/// A robot of another gateway, or of none at the moment.
#[derive(Debug)]
pub struct Far {
    name: String,
    /// Of this gateway: numbers count from its start.
    epoch: u64,
    held: Mutex<Held>,
}

#[derive(Debug)]
struct Held {
    /// The gateway that owns it and lives, as the rows of the store said last.
    by_rows: Option<u64>,
    /// The gateway whose copy counts. It has one.
    owner: Option<u64>,
    /// The copies, by the gateways that tell of the robot.
    told: BTreeMap<u64, Copied>,
    /// What is shown without an owner: nothing of it is fresh.
    last: Copied,
    /// The gateway that told it last; `None`: that is over, and so is its lease.
    last_of: Option<u64>,
    /// Since when that is so.
    last_since: Instant,
    numbers: Numbers,
}

impl Far {
    /// A robot of which this is known, and that no gateway tells of. `born` is larger than all numbers
    /// before.
    #[must_use]
    pub fn new(state: RobotState, epoch: u64, born: u64) -> Self {
        let name = state.summary.name.clone();
        let last = Copied::new(None, state, Duration::ZERO).ended();
        let numbers = Numbers::new(born, last.rows.len());
        let held = Held {
            by_rows: None,
            owner: None,
            told: BTreeMap::new(),
            last_since: last.begun,
            last,
            last_of: None,
            numbers,
        };
        Self { name, epoch, held: Mutex::new(held) }
    }

    /// Whether a gateway tells of it.
    #[must_use]
    pub fn is_told(&self) -> bool {
        !self.held().told.is_empty()
    }

    /// Whether what this gateway tells of it may be told on: no other one is known to have it.
    #[must_use]
    pub fn may_be_of(&self, gateway: u64) -> bool {
        self.held().owner.is_none_or(|owner| owner == gateway)
    }

    /// Whether the copy of a gateway is shown.
    #[must_use]
    pub fn has_owner(&self) -> bool {
        self.held().owner.is_some()
    }

    /// How far what is told of it may be behind its owner, while one tells.
    #[must_use]
    pub fn behind(&self, now: Instant) -> Duration {
        let held = self.held();
        let copied = held.copied();
        copied.teller.as_ref().map_or(Duration::ZERO, |teller| teller.behind(now, copied.begun))
    }

    /// A gateway tells all of it. `suspect_after`: for how long after its period it tells a value as fresh.
    /// `draw` gives the next number. It counts at once if neither the rows of the store nor another gateway
    /// say otherwise.
    pub fn take_snapshot(
        &self,
        teller: &Arc<Teller>,
        state: RobotState,
        suspect_after: Duration,
        draw: impl FnOnce() -> u64,
    ) {
        let mut held = self.held();
        let number = teller.number();
        held.told.insert(number, Copied::new(Some(Arc::clone(teller)), state, suspect_after));
        let is_its = |owner: Option<u64>| owner.is_none_or(|owner| owner == number);
        if is_its(held.owner) && is_its(held.by_rows) {
            held.show(number, draw());
        }
    }

    /// A gateway tells what changed. `false`: something is missing in between.
    pub fn take_change(&self, gateway: u64, change: LiveChange, draw: impl FnOnce() -> u64) -> bool {
        let mut held = self.held();
        let is_shown = held.owner == Some(gateway);
        let Some(places) = held.told.get_mut(&gateway).and_then(|copied| copied.change(change)) else {
            return false;
        };
        if is_shown && !places.is_empty() {
            let number = draw();
            held.numbers.change(&places, number);
        }
        true
    }

    /// A gateway tells the present state of it, and was asked for it then.
    pub fn take_summary(&self, gateway: u64, summary: RobotSummary, asked: Instant) {
        // A snapshot that came since then is newer.
        if let Some(copied) = self.held().told.get_mut(&gateway).filter(|copied| copied.begun <= asked) {
            (copied.summary, copied.summed_at) = (summary, asked);
            copied.summary.stopped |= copied.stopped_at.is_some_and(|stopped_at| stopped_at > asked);
        }
    }

    /// A gateway tells that a stop began that holds. Its state, which says more, comes after that, unless the
    /// gateway ends.
    pub fn take_stop(&self, gateway: u64) {
        if let Some(copied) = self.held().told.get_mut(&gateway) {
            (copied.summary.stopped, copied.stopped_at) = (true, Some(clock::now()));
        }
    }

    /// What the store had of it, which was asked for then. It counts while no gateway tells more. Returns
    /// whether readers are told.
    pub fn take_saved(&self, saved: &Saved, asked: Instant, draw: impl FnOnce() -> u64) -> bool {
        let mut held = self.held();
        let Saved { stopped, stopped_by, identity, .. } = saved;
        let summary = &held.last.summary;
        let known = (&summary.stopped, &summary.stopped_by, &summary.identity);
        if held.owner.is_some() || held.last_since > asked || known == (stopped, stopped_by, identity) {
            return false;
        }
        // A stop that its owner has just told may not be in the store yet.
        let is_its = held.last_of.is_some() && held.last_of == held.by_rows;
        if is_its && summary.stopped && !stopped && asked.since(held.last_since) < WRITTEN {
            return false;
        }
        let summary = &mut held.last.summary;
        summary.stopped = *stopped;
        summary.stopped_by.clone_from(stopped_by);
        summary.identity.clone_from(identity);
        held.anew(draw());
        true
    }

    /// A gateway does not tell of it any more. Returns whether readers are told.
    pub fn forget(&self, gateway: u64, draw: impl FnOnce() -> u64) -> bool {
        let mut held = self.held();
        let is_shown = held.owner == Some(gateway);
        if is_shown {
            held.lose(draw());
        }
        held.told.remove(&gateway);
        is_shown
    }

    /// The rows of the store were seen: this gateway owns it, if any does, and these live. Returns whether
    /// readers are told.
    pub fn settle(&self, owner: Option<u64>, live: &BTreeSet<u64>, draw: impl Fn() -> u64) -> bool {
        let mut held = self.held();
        held.by_rows = owner;
        let mut is_changed = match owner.filter(|owner| held.told.contains_key(owner)) {
            owner if owner == held.owner => false,
            Some(owner) => {
                held.show(owner, draw());
                true
            }
            None => {
                held.lose(draw());
                true
            }
        };
        // A lease ends with its owner.
        if held.owner.is_none() && held.last_of != owner {
            held.last_of = None;
            if held.last.summary.lease.take().is_some() {
                held.anew(draw());
                is_changed = true;
            }
        }
        held.told.retain(|number, _| live.contains(number));
        is_changed
    }

    /// What this gateway knew of it, when it lets go of it.
    pub fn leave(&self, state: RobotState, draw: impl FnOnce() -> u64) {
        let mut held = self.held();
        held.put_last(Copied::new(None, state, Duration::ZERO).ended(), None);
        held.anew(draw());
    }

    /// How it was in the end, after [`Self::leave`].
    pub fn take_last(&self, summary: RobotSummary, draw: impl FnOnce() -> u64) {
        let mut held = self.held();
        held.last.summary = RobotSummary { lease: None, ..summary };
        held.last.silence();
        held.last_since = clock::now();
        if held.owner.is_none() {
            held.anew(draw());
        }
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Held {
    /// What is shown.
    fn copied(&self) -> &Copied {
        self.owner.and_then(|owner| self.told.get(&owner)).unwrap_or(&self.last)
    }

    /// Shows the copy of this gateway from now on. `born` is larger than all numbers before.
    fn show(&mut self, owner: u64, born: u64) {
        self.owner = Some(owner);
        self.anew(born);
    }

    /// Shows what was shown, and nothing of it as fresh. Readers begin anew: the link is down, which no
    /// value says.
    fn lose(&mut self, born: u64) {
        self.put_last(self.copied().clone().lost(), self.owner);
        self.anew(born);
    }

    /// From now on no gateway tells of it, and this is the last that was told, by this gateway.
    fn put_last(&mut self, last: Copied, of: Option<u64>) {
        (self.owner, self.last, self.last_of, self.last_since) = (None, last, of, clock::now());
    }

    /// Every reader begins anew with what is shown.
    fn anew(&mut self, born: u64) {
        self.numbers = Numbers::new(born, self.copied().rows.len());
    }
}

impl Shown for Far {
    fn name(&self) -> &str {
        &self.name
    }

    fn summary(&self) -> RobotSummary {
        let held = self.held();
        let copied = held.copied();
        let passed = millis(clock::now().since(copied.summed_at));
        let mut summary = copied.summary.clone();
        // While no gateway tells of it, it is not known which one has it.
        summary.owner = summary.owner.filter(|_| held.owner.is_some());
        if let Some(lease) = &mut summary.lease {
            lease.expires_in_ms = lease.expires_in_ms.saturating_sub(passed);
        }
        summary
    }

    fn state_with(&self, number: u64, signals: Vec<Signal>) -> RobotState {
        let (period_ms, groups) = {
            let held = self.held();
            (held.copied().period_ms, held.copied().groups.clone())
        };
        RobotState { summary: self.summary(), period_ms, groups, epoch: self.epoch, number, signals }
    }

    fn tell_reader(&self, step: &mut dyn FnMut(Span) -> Step) -> (Span, Step, Vec<Signal>) {
        let held = self.held();
        let span = held.numbers.span();
        let step = step(span);
        let (now, copied) = (clock::now(), held.copied());
        let signals = match step {
            Step::Nothing => Vec::new(),
            Step::Snapshot { .. } => copied.signals(now),
            Step::Changes { after } => {
                held.numbers.since(after).filter_map(|place| copied.signal(place, now)).collect()
            }
        };
        (span, step, signals)
    }
}

/// All robots of other gateways, by their names. A robot of this gateway may be here too; then it is not
/// shown.
#[derive(Debug, Default)]
pub struct FarRobots(RwLock<BTreeMap<String, Arc<Far>>>);

impl FarRobots {
    /// The robot with this name.
    #[must_use]
    pub fn one(&self, name: &str) -> Option<Arc<Far>> {
        self.read().get(name).cloned()
    }

    /// All of them.
    #[must_use]
    pub fn all(&self) -> Vec<Arc<Far>> {
        self.read().values().cloned().collect()
    }

    /// The same. While this is held, no robot comes or goes.
    pub fn read(&self) -> RwLockReadGuard<'_, BTreeMap<String, Arc<Far>>> {
        self.0.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// The robot with this name, which is added if it is not there. `make` is called under the lock.
    pub fn one_or(&self, name: &str, make: impl FnOnce() -> Far) -> Arc<Far> {
        let mut robots = self.0.write().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(robots.entry(name.to_owned()).or_insert_with(|| Arc::new(make())))
    }

    /// Removes those that do not stay. `removed` is called under the lock for each.
    pub fn retain(&self, stays: impl Fn(&Far) -> bool, removed: impl Fn()) {
        let mut robots = self.0.write().unwrap_or_else(PoisonError::into_inner);
        robots.retain(|_, robot| {
            let stays = stays(robot);
            if !stays {
                removed();
            }
            stays
        });
    }
}

#[cfg(test)]
mod tests;
