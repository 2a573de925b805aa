//! Keeps the values of one robot: every poll, of which the history keeps the changes; and what happens.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use r6_api::gateway::Gap;
use r6_client::{Address, Recorded, Robot};
use r6_proto::address::{AddressMap, Walk};
use r6_proto::time::Instant;

use super::config::RobotConfig;
use super::held::{Held, Poll};
use super::observe::Observer;
use super::station::{Answers, Station};
use crate::clock;
use crate::core::history::change::ChangeOnly;
use crate::core::history::event::Event;
use crate::core::history::sample::{Interval, Micros, Sample, State};
use crate::core::history::waiting::Waiting;
use crate::core::name::RobotName;
use crate::core::watch::Before;
use crate::history::{Batch, NotKept, Recorder, RobotCounts};

/// How often to look whether values are overdue, and to say that everything until now was read.
const LOOK: Duration = Duration::from_millis(500);

/// How long after its time a value is missing, if none comes: as for live values, which are stale then.
const OVERDUE: Duration = Duration::from_millis(1500);

/// How often to look whether a robot whose polls wait has said who it is.
const LOOK_AT_HELD: Duration = Duration::from_millis(20);

/// Watches what is read of the robot, and keeps it if a history is kept, until the handle is closed or this
/// is dropped.
pub(super) async fn record(station: &Station, robot: &Robot, config: &RobotConfig) {
    let Some(mut polls) = robot.record() else { return std::future::pending().await };
    let recorder = station.shared.history.clone();
    let before = match &recorder {
        Some(recorder) => recorder.last_seen(config.name.clone()).await,
        None => Before::Never,
    };
    let mut observer = Observer::new(station, config, before);
    let mut feed =
        recorder.clone().map(|recorder| Feed::new(recorder, config, Arc::clone(&station.counts.history)));
    let time = |at| recorder.as_ref().map_or_else(|| time_of_system(at), |recorder| recorder.time(at));
    let (mut lost, mut held) = (0, Held::default());
    let mut look = clock::every(LOOK);
    loop {
        let values = tokio::select! {
            biased;
            values = polls.next() => match values {
                Some(values) => Some(values),
                None => return,
            },
            _ = look.tick() => None,
            () = tokio::time::sleep(LOOK_AT_HELD), if held.first().is_some() => None,
        };
        let now = clock::now();
        let is_poll = values.is_some();
        // A poll without values says nothing.
        if let Some(values) = values.filter(|values| !values.is_empty()) {
            let newly_lost = polls.lost().saturating_sub(std::mem::replace(&mut lost, polls.lost()));
            if let Some(dropped) = held.push(Poll { at: now, values, lost: newly_lost }) {
                observer.miss();
                feed.iter_mut().for_each(|feed| feed.miss(now, &dropped));
            }
        }
        while let Some(connection) =
            held.first().and_then(|poll| poll.values.first()).map(|value| value.connection)
        {
            let answers = station.answers(connection);
            if answers == Answers::Unknown {
                break;
            }
            let Some(Poll { at, values, lost }) = held.next() else { break };
            if lost > 0 {
                observer.miss();
                feed.iter_mut().for_each(|feed| feed.lose(lost, at));
            }
            if answers == Answers::Gone {
                observer.miss();
                continue;
            }
            if answers == Answers::Another {
                // Its values are not those of this robot.
                station.replace_alarms();
                let event = observer.replaced(at, time);
                feed.iter_mut().for_each(|feed| feed.replaced(event.iter().cloned().collect(), at));
                continue;
            }
            let events = observer.take(at, &values, time);
            station.read_alarm(at, &values, &events, time);
            if let Some(feed) = &mut feed {
                feed.note(events);
                feed.take(at, values);
            }
        }
        // What waiting polls bring is not overdue: the look is at the time of the first of them.
        let now = held.first().map_or_else(clock::now, |poll| poll.at);
        if !is_poll {
            let event = observer.look(now, time);
            if let Some(feed) = &mut feed {
                feed.note(event.into_iter().collect());
                feed.look(now);
            }
        }
    }
}

/// The time of day at a moment, by the clock of the system now.
fn time_of_system(at: Instant) -> Micros {
    clock::system().before(clock::now().since(at))
}

/// What is kept of one robot.
struct Feed {
    recorder: Recorder,
    robot: RobotName,
    signals: AddressMap<Signal>,
    counts: Arc<RobotCounts>,
    /// What goes to the recorder next.
    samples: Vec<(Address, Interval, Sample)>,
    events: Waiting,
    /// Since when samples are lost that the recorder was not told of.
    lost_from: Option<Micros>,
    /// The losses and the steps of the clock that this has seen.
    seen: (u64, u64),
    /// When something was handed over last.
    told: Instant,
    /// When the last value was asked for.
    until: Micros,
}

struct Signal {
    period: Duration,
    interval: Interval,
    filter: ChangeOnly,
    /// When it was asked for last.
    asked_at: Option<Instant>,
    /// Whether a value of it was lost that the recorder was not told of.
    is_lost: bool,
}

impl Signal {
    /// Whether a value was due since the last one. The poller may ask for it a quarter of its period early.
    fn was_due(&self, now: Instant) -> bool {
        self.asked_at.is_none_or(|asked_at| asked_at + self.period * 3 / 4 <= now)
    }
}

impl Feed {
    fn new(recorder: Recorder, config: &RobotConfig, counts: Arc<RobotCounts>) -> Self {
        let signal = |address: Address| {
            let (group, period) = (config.group_of(address), config.period_of(address));
            if group.is_some_and(|group| !group.is_kept) {
                return None;
            }
            let interval = Interval::of_period(period);
            let deadband = group.and_then(|group| group.deadband);
            let deadband = deadband.unwrap_or_else(|| recorder.settings().deadband(address));
            let filter = ChangeOnly::new(interval, deadband);
            Some((address, Signal { period, interval, filter, asked_at: None, is_lost: false }))
        };
        let signals = config.all_addresses().into_iter().filter_map(signal).collect();
        let seen = (counts.now().1, recorder.counts().clock_steps.load(Ordering::Relaxed));
        Self {
            recorder,
            robot: config.name.clone(),
            signals,
            counts,
            samples: Vec::new(),
            events: Waiting::default(),
            lost_from: None,
            seen,
            told: clock::now(),
            until: Micros::default(),
        }
    }

    /// Takes in what happened. It goes to the recorder with the samples of the same poll.
    fn note(&mut self, events: Vec<Event>) {
        let lost = self.events.note(events);
        self.counts.lose_events(lost);
    }

    /// Takes in the values of a poll.
    fn take(&mut self, now: Instant, values: Vec<Recorded>) {
        self.notice(now);
        // Most values of a poll were asked for together.
        let (mut last, mut walk) = (None, Walk::default());
        for Recorded { address, reading, age, connection: _ } in values {
            let asked_at = clock::before(now, age);
            let (_, time) = last
                .filter(|(of, _)| *of == asked_at)
                .unwrap_or_else(|| (asked_at, self.recorder.time(asked_at)));
            last = Some((asked_at, time));
            // A clock that was set back begins anew.
            self.until = time;
            self.counts.read(time);
            // The poller also reads what is not kept.
            let Some(signal) = self.signals.walk_to_mut(&mut walk, address) else { continue };
            signal.asked_at = Some(asked_at);
            let state = reading.as_ref().map_or(State::Gap(Gap::None), State::of);
            let kept = signal.filter.take(time, state);
            self.samples.extend(kept.map(|sample| (address, signal.interval, sample)));
        }
        self.hand_over(now);
    }

    /// Looks whether values are overdue.
    fn look(&mut self, now: Instant) {
        self.notice(now);
        for (address, signal) in self.signals.iter_mut() {
            let Some(asked_at) = signal.asked_at else { continue };
            let until = asked_at + signal.period + OVERDUE;
            if until < now {
                let gap = signal.filter.gap(self.recorder.time(until), Gap::Stale);
                self.samples.extend(gap.map(|sample| (address, signal.interval, sample)));
            }
        }
        self.hand_over(now);
    }

    /// Notices what the recorder lost, and that the clock of the system was set.
    fn notice(&mut self, now: Instant) {
        let steps = self.recorder.counts().clock_steps.load(Ordering::Relaxed);
        let seen = (self.counts.now().1, steps);
        let (lost, stepped) = (seen.0 != self.seen.0, seen.1 != self.seen.1);
        self.seen = seen;
        if stepped {
            let time = self.recorder.time(now);
            for (address, signal) in self.signals.iter_mut() {
                // On the new scale the last sample may be in the future.
                let was_known = signal.filter.gap(time, Gap::ClockStepped).is_some();
                signal.filter.forget();
                let gap = Sample { time, state: State::Gap(Gap::ClockStepped) };
                self.samples.extend(was_known.then_some((address, signal.interval, gap)));
            }
        }
        if lost {
            self.signals.iter_mut().for_each(|(_, signal)| signal.filter.forget());
        }
    }

    /// Values were lost between those that were taken last and now. A signal that is read seldom may have
    /// lost none.
    fn lose(&mut self, count: u64, now: Instant) {
        self.signals.iter_mut().for_each(|(_, signal)| signal.is_lost |= signal.was_due(now));
        self.counts.lose(count);
        let behind = Micros(self.until.0.saturating_add(100));
        let from = if self.until == Micros::default() { self.recorder.time(now) } else { behind };
        self.lost_from.get_or_insert(from);
        self.notice(now);
    }

    /// This poll cannot be kept, because the robot has not said for too long who it is: from the last values
    /// on, those of it are not known.
    fn miss(&mut self, now: Instant, poll: &Poll) {
        if self.until == Micros::default() {
            // The history of this robot has not begun.
            return;
        }
        let behind = Micros(self.until.0.saturating_add(100));
        for value in &poll.values {
            let Some(signal) = self.signals.get_mut(value.address) else { continue };
            let gap = signal.filter.gap(behind, Gap::Lost);
            self.samples.extend(gap.map(|sample| (value.address, signal.interval, sample)));
        }
        let lost = poll.lost.saturating_add(poll.values.len() as u64);
        self.counts.lose(lost);
        // This loss is told here. Signals that have none of it go on.
        self.seen.0 = self.seen.0.saturating_add(lost);
        self.hand_over(now);
    }

    /// Another robot answers in place of this one: from now on its values are not known.
    fn replaced(&mut self, events: Vec<Event>, now: Instant) {
        self.note(events);
        let time = self.recorder.time(now);
        for (address, signal) in self.signals.iter_mut() {
            let gap = signal.filter.gap(time, Gap::Ended);
            self.samples.extend(gap.map(|sample| (address, signal.interval, sample)));
            signal.asked_at = None;
        }
        self.hand_over(now);
    }

    fn hand_over(&mut self, now: Instant) {
        if self.samples.is_empty() && self.events.is_empty() && now.since(self.told) < LOOK {
            return;
        }
        self.told = now;
        let mut samples = std::mem::take(&mut self.samples);
        if let Some(since) = self.lost_from {
            let gap = |(address, signal): (Address, &Signal)| {
                (address, signal.interval, Sample { time: since, state: State::Gap(Gap::Lost) })
            };
            drop(samples.splice(0..0, self.signals.iter().filter(|(_, signal)| signal.is_lost).map(gap)));
        }
        let batch = Batch {
            robot: self.robot.clone(),
            time: self.until,
            samples,
            events: self.events.take(self.until),
            counts: Arc::clone(&self.counts),
        };
        let Err(NotKept { samples, events }) = self.recorder.keep(batch) else {
            if self.lost_from.take().is_some() {
                self.signals.iter_mut().for_each(|(_, signal)| signal.is_lost = false);
            }
            return;
        };
        self.events.put_back(events);
        for (address, ..) in &samples {
            self.signals.get_mut(*address).into_iter().for_each(|signal| signal.is_lost = true);
        }
        if let Some(first) = samples.iter().map(|(.., sample)| sample.time).min() {
            if self.lost_from.is_none() {
                tracing::warn!(robot = %self.robot, "the history takes no more samples: they are lost from here on");
            }
            self.lost_from.get_or_insert(first);
            self.counts.lose(samples.len() as u64);
            self.notice(now);
        }
    }
}

impl Drop for Feed {
    /// From now on nothing is read.
    fn drop(&mut self) {
        let now = clock::now();
        let time = self.recorder.time(now);
        for (address, signal) in self.signals.iter_mut() {
            let gap = signal.filter.gap(time, Gap::Ended);
            self.samples.extend(gap.map(|sample| (address, signal.interval, sample)));
        }
        self.hand_over(now);
        self.counts.lose_events(self.events.count());
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use r6_proto::Reading;

    use super::super::group::PollGroup;
    use super::*;
    use crate::history::HistorySettings;
    use crate::store::history::Place;

    #[tokio::test]
    async fn only_a_signal_that_was_due_has_lost_a_value() {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::Folder(folder.path().to_owned());
        let recorder = Recorder::start(place, HistorySettings::default()).unwrap();
        let (often, seldom) = (Address::parse("Addr-800").unwrap(), Address::parse("Addr-801").unwrap());
        let config = RobotConfig {
            addresses: vec![often],
            groups: vec![PollGroup::new(Duration::from_secs(3600), vec![seldom])],
            ..RobotConfig::new(RobotName::new("press").unwrap(), "10.0.0.1")
        };
        let mut feed = Feed::new(recorder.clone(), &config, Arc::default());
        let value = |address, number| {
            let (reading, age) = (Some(Reading::Integer(number)), Duration::ZERO);
            Recorded { address, reading, age, connection: 1 }
        };
        let begun = clock::now();
        feed.take(begun, vec![value(often, 1), value(seldom, 5)]);
        // The next poll is there, and one before it was lost.
        feed.lose(1, begun + Duration::from_millis(200));
        feed.take(begun + Duration::from_millis(200), vec![value(often, 2)]);
        let kept = async |address| {
            let open = recorder.open(config.name.clone(), address).await.unwrap();
            let samples = open.into_iter().flat_map(|(_, samples)| samples);
            samples.map(|sample| (sample.state.number(), sample.state.gap())).collect::<Vec<_>>()
        };
        assert_eq!(kept(often).await, [(Some(1.0), None), (None, Some(Gap::Lost)), (Some(2.0), None)]);
        assert_eq!(kept(seldom).await, [(Some(5.0), None)]);

        // What could not be handed over is lost, also of a signal that has just been read.
        recorder.end().await.unwrap();
        for number in 6.. {
            feed.take(begun + Duration::from_millis(300), vec![value(seldom, number)]);
            if feed.lost_from.is_some() {
                break;
            }
            // The thread ends a moment after its answer.
            assert!(clock::now().since(begun) < Duration::from_secs(20));
            tokio::task::yield_now().await;
        }
        let is_lost = |address| feed.signals.get(address).unwrap().is_lost;
        assert!(is_lost(seldom) && !is_lost(often));
    }
}
