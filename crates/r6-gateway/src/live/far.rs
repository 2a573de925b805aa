//! The robots of other gateways, as their owners tell of them.
//!
//! What is here is a copy: of the last values, over the stream that browsers use (`sharing/far.rs`), and of
//! the state of the robot. Readers get it as they get that of a robot of this gateway ([`Shown`]), under
//! numbers of this gateway. Once the owner is not heard of any more, no value is told as fresh.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};
use std::time::Duration;

use r6_api::gateway::{LiveChange, RobotLink, RobotState, RobotSummary, Signal, SignalQuality};
use r6_proto::time::Instant;

use crate::clock;
use crate::core::live::follower::Step;
use crate::core::live::numbers::{Numbers, Span};

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
    /// The greatest age that its owner tells a fresh value with.
    fresh_for: Duration,
    held: Mutex<Held>,
}

#[derive(Debug)]
struct Held {
    /// The gateway that tells of it; `None` if it is not heard of.
    owner: Option<u64>,
    summary: RobotSummary,
    /// When the summary came.
    summed_at: Instant,
    period_ms: u64,
    /// The number of the last change, as the owner counts.
    there: u64,
    numbers: Numbers,
    rows: Vec<(Signal, Instant)>,
    /// Until when nothing else had changed.
    confirmed: Instant,
}

impl Far {
    /// A robot of which this is known. No value of it is fresh yet, and `born` is larger than all numbers
    /// before.
    #[must_use]
    pub fn new(state: RobotState, epoch: u64, fresh_for: Duration, born: u64) -> Self {
        let now = clock::now();
        let RobotState { summary, period_ms, signals, .. } = state;
        let mut held = Held {
            owner: None,
            summary,
            summed_at: now,
            period_ms,
            there: 0,
            numbers: Numbers::new(born, signals.len()),
            rows: signals.into_iter().map(|signal| (signal, now)).collect(),
            confirmed: now,
        };
        held.lose();
        Self { name: held.summary.name.clone(), epoch, fresh_for, held: Mutex::new(held) }
    }

    /// The gateway that tells of it.
    #[must_use]
    pub fn owner(&self) -> Option<u64> {
        self.held().owner
    }

    /// Its owner tells all of it. `draw` gives the next number.
    pub fn take_snapshot(&self, owner: u64, state: RobotState, draw: impl FnOnce() -> u64) {
        let now = clock::now();
        let RobotState { summary, period_ms, number, signals, .. } = state;
        let mut held = self.held();
        let numbers = Numbers::new(draw(), signals.len());
        *held = Held {
            owner: Some(owner),
            summary,
            summed_at: now,
            period_ms,
            there: number,
            numbers,
            rows: signals.into_iter().map(|signal| (signal, now)).collect(),
            confirmed: now,
        };
    }

    /// Its owner tells what changed. `false`: something is missing in between.
    pub fn take_change(&self, owner: u64, change: LiveChange, draw: impl FnOnce() -> u64) -> bool {
        let now = clock::now();
        let mut held = self.held();
        if held.owner != Some(owner) || held.there != change.after {
            return false;
        }
        let mut places = Vec::new();
        for signal in change.signals {
            let row =
                held.rows.iter_mut().enumerate().find(|(_, (known, _))| known.address == signal.address);
            let Some((place, row)) = row else { return false };
            *row = (signal, now);
            places.push(place);
        }
        held.there = change.number;
        if !places.is_empty() {
            let number = draw();
            held.numbers.change(&places, number);
        }
        true
    }

    /// Its owner says that nothing else had changed until then.
    pub fn confirm(&self, owner: u64, until: Instant) {
        let mut held = self.held();
        if held.owner == Some(owner) {
            held.confirmed = held.confirmed.max(until);
        }
    }

    /// Its owner tells its present state.
    pub fn take_summary(&self, owner: u64, summary: RobotSummary) {
        let mut held = self.held();
        if held.owner == Some(owner) {
            (held.summary, held.summed_at) = (summary, clock::now());
        }
    }

    /// Its owner is not heard of any more: no value is fresh. Returns whether that is new.
    pub fn lose(&self, draw: impl FnOnce() -> u64) -> bool {
        let mut held = self.held();
        if held.owner.is_none() {
            return false;
        }
        let stale = held.lose();
        let number = draw();
        held.numbers.change(&stale, number);
        true
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Held {
    /// Makes what was fresh stale. Returns the places of it.
    fn lose(&mut self) -> Vec<usize> {
        self.owner = None;
        self.summary.link = RobotLink::Down;
        // A lease ends with its owner.
        self.summary.lease = None;
        self.summary.stops_under_way = 0;
        let mut stale = Vec::new();
        for (place, (signal, _)) in self.rows.iter_mut().enumerate() {
            if signal.quality == SignalQuality::Fresh {
                signal.quality = SignalQuality::Stale;
                stale.push(place);
            }
        }
        stale
    }

    /// A value as it is told now.
    fn signal(&self, place: usize, now: Instant, fresh_for: Duration) -> Option<Signal> {
        let (signal, told_at) = self.rows.get(place)?;
        let mut signal = signal.clone();
        if let Some(age) = &mut signal.age_ms {
            *age = age.saturating_add(millis(now.since(*told_at)));
            if signal.quality == SignalQuality::Fresh && self.confirmed >= *told_at {
                // Its owner reads it again and again, and tells of it only if it changes or grows old.
                *age = (*age).min(millis(fresh_for + now.since(self.confirmed)));
            }
        }
        Some(signal)
    }

    fn signals(&self, now: Instant, fresh_for: Duration) -> Vec<Signal> {
        (0..self.rows.len()).filter_map(|place| self.signal(place, now, fresh_for)).collect()
    }
}

impl Shown for Far {
    fn name(&self) -> &str {
        &self.name
    }

    fn summary(&self) -> RobotSummary {
        let held = self.held();
        let passed = millis(clock::now().since(held.summed_at));
        let mut summary = held.summary.clone();
        if let Some(lease) = &mut summary.lease {
            lease.expires_in_ms = lease.expires_in_ms.saturating_sub(passed);
        }
        summary
    }

    fn state_with(&self, number: u64, signals: Vec<Signal>) -> RobotState {
        let period_ms = self.held().period_ms;
        RobotState { summary: self.summary(), period_ms, epoch: self.epoch, number, signals }
    }

    fn tell_reader(&self, step: &mut dyn FnMut(Span) -> Step) -> (Span, Step, Vec<Signal>) {
        let held = self.held();
        let span = held.numbers.span();
        let step = step(span);
        let now = clock::now();
        let signals = match step {
            Step::Nothing => Vec::new(),
            Step::Snapshot { .. } => held.signals(now, self.fresh_for),
            Step::Changes { after } => {
                let places = held.numbers.since(after);
                places.filter_map(|place| held.signal(place, now, self.fresh_for)).collect()
            }
        };
        (span, step, signals)
    }
}

/// All robots of other gateways, by their names.
#[derive(Debug, Default)]
pub struct FarRobots(RwLock<BTreeMap<String, Arc<Far>>>);

impl FarRobots {
    /// The robot with this name.
    #[must_use]
    pub fn one(&self, name: &str) -> Option<Arc<Far>> {
        self.read().get(name).cloned()
    }

    /// All of them. While this is held, none comes or goes.
    pub fn read(&self) -> RwLockReadGuard<'_, BTreeMap<String, Arc<Far>>> {
        self.0.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a robot, or puts it in the place of the one of its name. `make` is called under the lock.
    pub fn put(&self, make: impl FnOnce() -> Far) {
        let mut robots = self.0.write().unwrap_or_else(PoisonError::into_inner);
        let robot = make();
        robots.insert(robot.name.clone(), Arc::new(robot));
    }

    /// Removes those that do not stay. `removed` is called under the lock for each.
    pub fn retain(&self, stays: impl Fn(&str) -> bool, removed: impl Fn()) {
        let mut robots = self.0.write().unwrap_or_else(PoisonError::into_inner);
        robots.retain(|name, _| {
            let stays = stays(name);
            if !stays {
                removed();
            }
            stays
        });
    }
}

fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}
