//! The robots of other gateways, as their owners tell of them.
//!
//! What is here are copies: of the last values, over the stream that browsers use (`sharing/far.rs`), and of
//! the state of the robot. Each gateway that tells of a robot has a copy of its own ([`Far`]), and the rows
//! of the store say which of them counts: so a gateway that was frozen and goes on with a robot that it has
//! lost changes nothing. Readers get a copy as they get a robot of this gateway ([`Shown`]), under numbers of
//! this gateway. Once the owner is not heard of any more, no value is told as fresh; whether a stop holds is
//! read from the store then, and the lease is told until the rows say that its owner ended.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};
use std::time::Duration;

use r6_api::gateway::{LiveChange, RobotLink, RobotState, RobotSummary, Signal, SignalQuality};
use r6_proto::time::Instant;

use crate::clock;
use crate::core::live::follower::Step;
use crate::core::live::numbers::{Numbers, Span};
use crate::core::owner::{CLOSE, EXPIRES};
use crate::core::seat::Saved;

/// For how long a value that its owner told as fresh is still told as fresh if the owner says nothing more of
/// it, beyond the greatest age of a fresh value. An owner that is silent for longer may have lost the robot.
pub const HEARD: Duration = CLOSE;

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

/// A gateway that tells of its robots, over one stream.
#[derive(Debug)]
pub struct Teller {
    number: u64,
    /// Until when nothing had changed that it did not tell.
    confirmed: Mutex<Instant>,
    /// Since when something that it told waits here, before readers get it.
    waits_since: Mutex<Option<Instant>>,
}

impl Teller {
    /// The gateway with this number, which has confirmed nothing yet.
    #[must_use]
    pub fn new(number: u64) -> Self {
        Self { number, confirmed: Mutex::new(Instant::ORIGIN), waits_since: Mutex::default() }
    }

    /// The number of the gateway.
    #[must_use]
    pub fn number(&self) -> u64 {
        self.number
    }

    /// It says that until then nothing had changed that it did not tell.
    pub fn confirm(&self, until: Instant) {
        let mut confirmed = self.confirmed.lock().unwrap_or_else(PoisonError::into_inner);
        *confirmed = (*confirmed).max(until);
    }

    fn confirmed(&self) -> Instant {
        *self.confirmed.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Since when something that it told waits here, before readers get it; `None`: nothing does.
    pub fn hold_back(&self, since: Option<Instant>) {
        *self.waits_since.lock().unwrap_or_else(PoisonError::into_inner) = since;
    }

    /// How far its readers here may be behind it.
    fn behind(&self, now: Instant, begun: Instant) -> Duration {
        let waits = *self.waits_since.lock().unwrap_or_else(PoisonError::into_inner);
        let waits = waits.map_or(Duration::ZERO, |since| now.since(since));
        now.since(self.confirmed().max(begun)).max(waits)
    }
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

/// What one gateway told of a robot.
#[derive(Clone, Debug)]
struct Copied {
    /// `None`: it is not heard of.
    teller: Option<Arc<Teller>>,
    summary: RobotSummary,
    /// When the values came first.
    begun: Instant,
    /// When the summary came.
    summed_at: Instant,
    /// When a stop was told that holds. A list that was asked for before may not know of it.
    stopped_at: Option<Instant>,
    period_ms: u64,
    /// The greatest age that its owner tells a fresh value with.
    fresh_for: Duration,
    /// The number of the last change, as its owner counts.
    there: u64,
    /// The values, and when each came.
    rows: Vec<(Signal, Instant)>,
}

impl Copied {
    fn new(teller: Option<Arc<Teller>>, state: RobotState, fresh_for: Duration) -> Self {
        let now = clock::now();
        let RobotState { summary, period_ms, number, signals, .. } = state;
        let rows = signals.into_iter().map(|signal| (signal, now)).collect();
        let stopped_at = None;
        Self {
            teller,
            summary,
            begun: now,
            summed_at: now,
            stopped_at,
            period_ms,
            fresh_for,
            there: number,
            rows,
        }
    }

    /// The same, once it is not heard of any more: nothing is fresh.
    fn lost(mut self) -> Self {
        self.silence();
        for (signal, _) in &mut self.rows {
            if signal.quality == SignalQuality::Fresh {
                signal.quality = SignalQuality::Stale;
            }
        }
        self
    }

    /// No owner tells of it.
    fn silence(&mut self) {
        self.teller = None;
        self.summary.link = RobotLink::Down;
        self.summary.stops_under_way = 0;
        self.summary.global_speed = None;
    }

    /// Its owner is not its owner any more, so the lease is over.
    fn ended(mut self) -> Self {
        self.summary.lease = None;
        self.lost()
    }

    /// Takes in what changed. Returns the places; `None`: something is missing in between.
    fn change(&mut self, change: LiveChange) -> Option<Vec<usize>> {
        if self.there != change.after {
            return None;
        }
        let now = clock::now();
        let mut places = Vec::new();
        for signal in change.signals {
            let place = self.rows.iter().position(|(known, _)| known.address == signal.address)?;
            *self.rows.get_mut(place)? = (signal, now);
            places.push(place);
        }
        self.there = change.number;
        Some(places)
    }

    /// A value as it is told now.
    fn signal(&self, place: usize, now: Instant) -> Option<Signal> {
        let (signal, told_at) = self.rows.get(place)?;
        let mut signal = signal.clone();
        let Some(age) = signal.age_ms else { return Some(signal) };
        let mut age = age.saturating_add(millis(now.since(*told_at)));
        if let (SignalQuality::Fresh, Some(teller)) = (signal.quality, &self.teller) {
            let confirmed = teller.confirmed();
            if confirmed >= *told_at {
                // Its owner reads it again and again, and tells of it only if it changes or grows old.
                age = age.min(millis(self.fresh_for + now.since(confirmed)));
            }
            if age > millis(self.fresh_for + HEARD) {
                signal.quality = SignalQuality::Stale;
            }
        }
        signal.age_ms = Some(age);
        Some(signal)
    }

    fn signals(&self, now: Instant) -> Vec<Signal> {
        (0..self.rows.len()).filter_map(|place| self.signal(place, now)).collect()
    }
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

    /// A gateway tells all of it. `fresh_for`: the greatest age of a value that it tells as fresh. `draw`
    /// gives the next number. It counts at once if neither the rows of the store nor another gateway say
    /// otherwise.
    pub fn take_snapshot(
        &self,
        teller: &Arc<Teller>,
        state: RobotState,
        fresh_for: Duration,
        draw: impl FnOnce() -> u64,
    ) {
        let mut held = self.held();
        let number = teller.number();
        held.told.insert(number, Copied::new(Some(Arc::clone(teller)), state, fresh_for));
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
        if let Some(lease) = &mut summary.lease {
            lease.expires_in_ms = lease.expires_in_ms.saturating_sub(passed);
        }
        summary
    }

    fn state_with(&self, number: u64, signals: Vec<Signal>) -> RobotState {
        let period_ms = self.held().copied().period_ms;
        RobotState { summary: self.summary(), period_ms, epoch: self.epoch, number, signals }
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

fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    const FRESH_FOR: Duration = Duration::from_millis(500);

    fn state(value: &str, number: u64) -> RobotState {
        let state = json!({
            "name": "press", "address": "10.0.0.1:9760", "managed_by": "file", "link": "up", "identity": null,
            "identity_changed": null, "virtual": null, "stopped": false, "stops_under_way": 0, "period_ms": 100,
            "lease": { "number": 1, "holder": "token 1", "expires_in_ms": 9_000 }, "epoch": 7, "number": number,
            "signals": [signal(value, SignalQuality::Fresh)],
        });
        serde_json::from_value(state).unwrap()
    }

    fn signal(unit: &str, quality: SignalQuality) -> Signal {
        // The unit says which copy it is of.
        let unit = Some(unit.to_owned());
        Signal { address: "axis-0".to_owned(), value: None, unit, quality, age_ms: Some(0) }
    }

    fn change(unit: &str, after: u64, number: u64) -> LiveChange {
        let signals = vec![signal(unit, SignalQuality::Fresh)];
        LiveChange { robot: "press".to_owned(), after, number, signals }
    }

    /// What a reader sees: whose copy, whether it is fresh, and the numbers.
    fn seen(far: &Far) -> (String, bool, Span) {
        let (span, _, signals) = far.tell_reader(&mut |_| Step::Snapshot { reset: false });
        let signal = signals.into_iter().next().unwrap();
        (signal.unit.unwrap(), signal.quality == SignalQuality::Fresh, span)
    }

    fn heard(number: u64) -> Arc<Teller> {
        let teller = Teller::new(number);
        teller.confirm(clock::now());
        Arc::new(teller)
    }

    #[test]
    fn the_rows_say_whose_copy_counts_in_whatever_order_the_gateways_tell() {
        let far = Far::new(state("start", 0), 7, 1);
        assert_eq!(seen(&far), ("start".to_owned(), false, Span { born: 1, number: 1 }));
        let live = BTreeSet::from([3, 4]);
        far.take_snapshot(&heard(3), state("three", 5), FRESH_FOR, || 2);
        assert_eq!(
            seen(&far),
            ("three".to_owned(), true, Span { born: 2, number: 2 }),
            "no other owner is known"
        );
        assert!(!far.settle(Some(3), &live, || unreachable!()));
        // The next owner is faster than the rows.
        far.take_snapshot(&heard(4), state("four", 8), FRESH_FOR, || unreachable!());
        assert!(far.take_change(4, change("four", 8, 9), || unreachable!()));
        assert_eq!(seen(&far).0, "three");
        assert!(far.settle(Some(4), &live, || 3));
        assert_eq!(seen(&far), ("four".to_owned(), true, Span { born: 3, number: 3 }));
        // The last one goes on with what it has lost.
        assert!(far.take_change(3, change("three", 5, 6), || unreachable!()));
        far.take_snapshot(&heard(3), state("three", 7), FRESH_FOR, || unreachable!());
        assert!(!far.forget(3, || unreachable!()));
        assert_eq!(seen(&far).0, "four");
        assert!(far.take_change(4, change("four", 9, 11), || 4));
        assert_eq!(seen(&far).2, Span { born: 3, number: 4 });
        assert!(!far.take_change(4, change("four", 10, 12), || unreachable!()), "a change is missing");
        assert!(
            !far.take_change(3, change("three", 7, 8), || unreachable!()),
            "it told nothing to begin with"
        );
    }

    #[test]
    fn nothing_is_fresh_once_the_owner_is_lost_and_a_copy_is_never_stuck() {
        let live = BTreeSet::from([3]);
        let far = Far::new(state("start", 0), 7, 1);
        far.take_snapshot(&heard(3), state("three", 5), FRESH_FOR, || 2);
        // A look that is older than the snapshot.
        assert!(far.settle(None, &live, || 3));
        assert_eq!(seen(&far), ("three".to_owned(), false, Span { born: 3, number: 3 }));
        assert_eq!((far.summary().link, far.summary().lease), (RobotLink::Down, None));
        assert!(far.settle(Some(3), &live, || 4));
        assert_eq!(seen(&far), ("three".to_owned(), true, Span { born: 4, number: 4 }));
        // This gateway had it for a while, and the next owner told of it before.
        far.leave(state("here", 9), || 5);
        assert_eq!(seen(&far), ("here".to_owned(), false, Span { born: 5, number: 5 }));
        assert!(far.settle(Some(3), &live, || 6));
        assert_eq!(seen(&far), ("three".to_owned(), true, Span { born: 6, number: 6 }));
        assert!(far.forget(3, || 7));
        assert_eq!(seen(&far), ("three".to_owned(), false, Span { born: 7, number: 7 }));
        assert!(!far.is_told());
    }

    #[test]
    fn a_lease_is_told_until_the_rows_say_that_its_owner_ended() {
        let live = BTreeSet::from([3]);
        let lease = |far: &Far| far.summary().lease.map(|lease| lease.holder);
        let far = Far::new(state("start", 0), 7, 1);
        assert_eq!(lease(&far), None, "no gateway tells of it");
        far.take_snapshot(&heard(3), state("three", 5), FRESH_FOR, || 2);
        assert!(!far.settle(Some(3), &live, || unreachable!()));
        // Its owner lives, and is not heard of.
        assert!(far.forget(3, || 3));
        assert!(!far.settle(Some(3), &live, || unreachable!()));
        assert_eq!((lease(&far).as_deref(), far.summary().link), (Some("token 1"), RobotLink::Down));
        assert!(far.settle(None, &live, || 4));
        assert_eq!((lease(&far), seen(&far).2), (None, Span { born: 4, number: 4 }), "readers are told");
        assert!(!far.settle(None, &live, || unreachable!()));
        // It has another owner, which is not heard of either.
        far.take_snapshot(&heard(3), state("three", 5), FRESH_FOR, || 5);
        far.forget(3, || 6);
        assert!(far.settle(Some(4), &live, || 7));
        assert_eq!(lease(&far), None);
        // The gateway that had it goes on with it.
        far.take_snapshot(&heard(3), state("three", 5), FRESH_FOR, || unreachable!());
        assert!(!far.has_owner());
    }

    #[test]
    fn a_stop_is_told_at_once_and_what_is_older_says_nothing_against_it() {
        let far = Far::new(state("start", 0), 7, 1);
        far.take_snapshot(&heard(3), state("three", 5), FRESH_FOR, || 2);
        let (before, old) = (clock::now(), far.summary());
        std::thread::sleep(Duration::from_millis(2));
        far.take_stop(3);
        assert!(far.summary().stopped);
        far.take_summary(3, old.clone(), before);
        assert!(far.summary().stopped, "the list was asked for before the stop");
        far.forget(3, || 3);
        assert!(far.summary().stopped, "its gateway ended");
        let saved = Saved::default();
        assert!(!far.take_saved(&saved, before, || unreachable!()), "so was the store");
        assert!(far.summary().stopped);
        std::thread::sleep(Duration::from_millis(2));
        assert!(far.take_saved(&saved, clock::now(), || 4), "somebody cleared it");
        assert_eq!((far.summary().stopped, seen(&far).2), (false, Span { born: 4, number: 4 }));
        let stopped = Saved { stopped: true, ..Saved::default() };
        assert!(far.take_saved(&stopped, clock::now(), || 5));
        assert!(!far.take_saved(&stopped, clock::now(), || unreachable!()), "nothing is new");
        assert!(far.summary().stopped);
        far.take_snapshot(&heard(3), state("three", 5), FRESH_FOR, || 6);
        assert!(!far.take_saved(&stopped, clock::now(), || unreachable!()), "its owner tells more");
        far.take_stop(3);
        far.take_summary(3, old.clone(), clock::now());
        assert!(!far.summary().stopped, "it was asked for after the stop");
        let asked = clock::now();
        std::thread::sleep(Duration::from_millis(2));
        let mut newer = state("three", 6);
        newer.summary.stopped = true;
        far.take_snapshot(&heard(3), newer, FRESH_FOR, || 7);
        far.take_summary(3, old, asked);
        assert!(far.summary().stopped, "the snapshot is newer than the list");
    }

    #[test]
    fn the_store_may_not_have_a_stop_yet_that_its_living_owner_told() {
        let live = BTreeSet::from([3]);
        let far = Far::new(state("start", 0), 7, 1);
        far.take_snapshot(&heard(3), state("three", 5), FRESH_FOR, || 2);
        far.settle(Some(3), &live, || unreachable!());
        far.take_stop(3);
        far.forget(3, || 3);
        let (lost, saved) = (clock::now(), Saved::default());
        assert!(!far.take_saved(&saved, lost + Duration::from_secs(1), || unreachable!()));
        assert!(far.summary().stopped);
        assert!(far.take_saved(&saved, lost + WRITTEN, || 4), "it was cleared since");
        assert!(!far.summary().stopped);
        let stopped = Saved { stopped: true, ..Saved::default() };
        assert!(far.take_saved(&stopped, lost + WRITTEN, || 5));
        // Its owner ended: what the store has counts.
        far.settle(None, &live, || 6);
        assert!(far.take_saved(&saved, lost + WRITTEN, || 7));
    }

    #[test]
    fn what_a_gateway_tells_of_a_robot_of_another_one_is_not_told_on() {
        let live = BTreeSet::from([3, 4]);
        let far = Far::new(state("start", 0), 7, 1);
        assert!(far.may_be_of(3) && far.may_be_of(4), "nothing is known");
        far.take_snapshot(&heard(3), state("three", 5), FRESH_FOR, || 2);
        far.take_snapshot(&heard(4), state("four", 5), FRESH_FOR, || unreachable!());
        far.settle(Some(4), &live, || 3);
        assert!(!far.may_be_of(3) && far.may_be_of(4));
    }

    #[test]
    fn what_waits_here_is_behind_its_owner() {
        let now = clock::now();
        let (far, teller) = (Far::new(state("start", 0), 7, 1), heard(3));
        far.take_snapshot(&teller, state("three", 5), FRESH_FOR, || 2);
        let later = now + Duration::from_secs(9);
        teller.confirm(later);
        assert_eq!(far.behind(later), Duration::ZERO);
        teller.hold_back(Some(now));
        assert_eq!(far.behind(later), Duration::from_secs(9), "an event is not told yet");
        teller.hold_back(None);
        assert_eq!(far.behind(later), Duration::ZERO);
    }

    #[test]
    fn a_value_of_an_owner_that_says_nothing_is_not_told_as_fresh_for_long() {
        let now = clock::now();
        let teller = Arc::new(Teller::new(3));
        let copied = Copied::new(Some(Arc::clone(&teller)), state("three", 5), FRESH_FOR);
        let at = |after: Duration| {
            let signal = copied.signal(0, now + after).unwrap();
            (signal.quality, Duration::from_millis(signal.age_ms.unwrap()))
        };
        let long = Duration::from_secs(60);
        assert_eq!(at(Duration::from_millis(10)).0, SignalQuality::Fresh);
        assert_eq!(at(FRESH_FOR + HEARD + Duration::from_millis(10)).0, SignalQuality::Stale);
        assert!(at(long).1 + Duration::from_millis(1) >= long, "nothing says that it is younger");
        // Its owner says again and again that nothing changed.
        teller.confirm(now + long);
        assert_eq!(at(long), (SignalQuality::Fresh, FRESH_FOR));
        assert_eq!(Far::new(state("start", 0), 7, 1).behind(now + long), Duration::ZERO, "it is not fresh");
        let far = Far::new(state("start", 0), 7, 1);
        far.take_snapshot(&teller, state("three", 5), FRESH_FOR, || 2);
        assert_eq!(far.behind(now + long), Duration::ZERO);
        assert_eq!(far.behind(now + long + HEARD), HEARD);
        let last = long + HEARD;
        assert_eq!(at(last), (SignalQuality::Fresh, FRESH_FOR + HEARD));
        assert_eq!(at(last + Duration::from_millis(1)).0, SignalQuality::Stale);
    }
}
