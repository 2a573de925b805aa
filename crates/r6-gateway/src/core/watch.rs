//! What happens at a robot, from the values that are read of it.
//!
//! An event comes from two readings of a value that follow each other: over one connection, with nothing lost
//! between them, and not further apart than [`late_after`] says. Otherwise the later one is a new beginning,
//! and an event `unseen` says that something may have happened that has no event.
//!
//! Times between readings are those of a clock that does not jump. The time of day is only told.

pub mod cycle;
#[cfg(test)]
mod tests;

use std::time::Duration;

use r6_api::gateway::UnseenBecause;
use r6_proto::time::Instant;
use r6_proto::{Address, OperationMode, Reading};

use super::history::event::{Event, Observed};
use super::history::sample::{MAX_TEXT, Micros};
use super::history::turns::Turns;

/// A value that a poll has read.
#[derive(Clone, Copy, Debug)]
pub struct Value<'r> {
    /// Its address.
    pub address: Address,
    /// The value; `None` if there is no usable one.
    pub reading: Option<&'r Reading>,
    /// When the reply was there at the latest.
    pub by: Instant,
    /// When it was asked for,
    pub at: Instant,
    /// and the time of day then.
    pub time: Micros,
}

/// What is known of the robot before the first reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Before {
    /// It was never read.
    Never,
    /// It was read last at this time; `None` if that is not known.
    Seen(Option<Micros>),
}

/// After what time without a reading something may have been missed: 2.5 periods, or as long as a live value
/// stays fresh, whichever is longer.
#[must_use]
pub fn late_after(period: Duration) -> Duration {
    (period * 5 / 2).max(period + Duration::from_millis(1500))
}

/// Watches one robot.
#[derive(Clone, Debug)]
pub struct Watcher {
    /// After what time without the mode nothing comes any more.
    mode_late: Duration,
    /// After what time without another value something may have been missed.
    late: Duration,
    /// The same of the counter of parts.
    parts_late: Duration,
    parts: Option<Address>,
    before: Before,
    last: Option<Last>,
    /// Whether it was told that the link is lost.
    is_lost: bool,
    /// Whether readings were lost since the last one.
    has_missed: bool,
    /// Whether another robot answered since the last one.
    is_replaced: bool,
    /// In the present poll: the last reading of a value that was not read for too long.
    unread: Option<(Instant, Micros)>,
    mode: Slot<i64>,
    alarm: Slot<Alarm>,
    program: Slot<String>,
    counter: Slot<i64>,
    cycle: Slot<cycle::Reading>,
    /// Whether a mode was read since the last reading of the cycle in which no program runs.
    has_stood: bool,
    /// Where events stand.
    turns: Turns,
}

/// The last reading of any value.
#[derive(Clone, Copy, Debug)]
struct Last {
    at: Instant,
    time: Micros,
    connection: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Alarm {
    code: u32,
    /// When it was read first; `None` if its begin was not seen.
    since: Option<Instant>,
}

/// The last reading of one value.
#[derive(Clone, Debug)]
struct Slot<T>(Option<(Instant, Micros, T)>);

/// What a reading is to the one before it.
enum Step<T> {
    /// It follows this one.
    After(T),
    /// It is a new beginning. If there was a reading before: when, and the time of day.
    Begin(Option<(Instant, Micros)>),
    /// It is older than the last one.
    Old,
}

impl<T: Clone> Slot<T> {
    fn step(&mut self, value: &Value<'_>, late: Duration, next: impl FnOnce(Option<&T>) -> T) -> Step<T> {
        let last = self.0.take();
        match last {
            Some(last) if value.at <= last.0 => {
                self.0 = Some(last);
                Step::Old
            }
            Some((at, _, last)) if value.at.since(at) <= late => {
                self.0 = Some((value.at, value.time, next(Some(&last))));
                Step::After(last)
            }
            last => {
                self.0 = Some((value.at, value.time, next(None)));
                Step::Begin(last.map(|(at, time, _)| (at, time)))
            }
        }
    }
}

impl Watcher {
    /// Watches a robot whose addresses are read with these periods. The mode and the counter of parts may
    /// have their own; the rest of what is watched has one. `parts`: that counter, a `counter-n`.
    #[must_use]
    pub fn new(period: impl Fn(Address) -> Duration, parts: Option<Address>, before: Before) -> Self {
        let late = |address| late_after(period(address));
        Self {
            mode_late: late(Address::CurMode),
            late: late(Address::CurAlarm),
            parts_late: parts.map_or(Duration::ZERO, late),
            parts,
            before,
            last: None,
            is_lost: false,
            has_missed: false,
            is_replaced: false,
            unread: None,
            mode: Slot(None),
            alarm: Slot(None),
            program: Slot(None),
            counter: Slot(None),
            cycle: Slot(None),
            has_stood: false,
            turns: Turns::default(),
        }
    }

    /// Takes in the values of a poll, which came over this connection. Numbers of connections only grow.
    /// Returns what happened, at most a dozen events.
    #[must_use]
    pub fn take(&mut self, connection: u64, poll: &[Value<'_>]) -> Vec<Event> {
        let mut out = Vec::new();
        let (Some(first), Some(newest)) =
            (poll.iter().min_by_key(|value| value.at), poll.iter().max_by_key(|value| value.at))
        else {
            return Vec::new();
        };
        // A late reply of an earlier connection says nothing about now.
        if self.last.is_some_and(|last| connection < last.connection) {
            return Vec::new();
        }
        self.arrive(connection, first, &mut out);
        if self.last.is_none_or(|last| newest.at > last.at || connection > last.connection) {
            self.last = Some(Last { at: newest.at, time: newest.time, connection });
        }
        let of = |address| poll.iter().find(|value| value.address == address);
        of(Address::CurMode).into_iter().for_each(|value| self.mode(value, &mut out));
        of(Address::CurAlarm).into_iter().for_each(|value| self.alarm(value, &mut out));
        of(Address::CurMold).into_iter().for_each(|value| self.program(value, &mut out));
        let parts = self.parts.and_then(of);
        parts.into_iter().for_each(|value| self.parts(value, &mut out));
        if let Some(last) = of(Address::LastCycle) {
            self.cycle(last, of(Address::CurCycle), &mut out);
        }
        if let Some((_, from)) = self.unread.take() {
            unseen(Some(from), newest, UnseenBecause::Unread, &mut out);
        }
        out.into_iter().map(|(at, event)| self.turns.place(at, event)).collect()
    }

    /// Another robot answers in place of this one, as was noticed now, at this time of day. What it says is
    /// not taken in. Returns that from the last reading on nothing of this robot was seen, once.
    #[must_use]
    pub fn replaced(&mut self, now: Instant, time: Micros) -> Option<Event> {
        if std::mem::replace(&mut self.is_replaced, true) {
            return None;
        }
        let from = match (self.last, self.before) {
            (Some(last), _) => Some(last.time),
            (None, Before::Seen(from)) => from,
            // Nothing was ever seen, so there is nothing that this ends.
            (None, Before::Never) => return None,
        };
        let because = UnseenBecause::AnotherRobot;
        let event = Event::new(time, Observed::Unseen { from, to: time, because });
        Some(self.turns.place(now, event))
    }

    /// Looks whether a reading is overdue.
    #[must_use]
    pub fn look(&mut self, now: Instant, time: Micros) -> Option<Event> {
        let is_overdue = self.last.is_some_and(|last| now.since(last.at) > self.mode_late);
        if self.is_lost || self.is_replaced || !is_overdue {
            return None;
        }
        self.is_lost = true;
        Some(self.turns.place(now, Event::new(time, Observed::LinkLost {})))
    }

    /// Readings were lost since the last one: the next one is a new beginning.
    pub fn miss(&mut self) {
        self.has_missed = true;
    }

    /// Looks whether this reading follows the one before.
    fn arrive(&mut self, connection: u64, first: &Value<'_>, out: &mut Vec<(Instant, Event)>) {
        let was_replaced = std::mem::take(&mut self.is_replaced);
        let Some(last) = self.last else {
            // What was lost before the first reading is within what was not seen.
            self.has_missed = false;
            if let Before::Seen(from) = self.before {
                let because = if was_replaced { UnseenBecause::AnotherRobot } else { UnseenBecause::Start };
                unseen(from, first, because, out);
            }
            return;
        };
        let is_new = connection != last.connection;
        if is_new && !self.is_lost {
            out.push((first.at, Event::new(first.time, Observed::LinkLost {})));
        }
        let was_lost = std::mem::take(&mut self.is_lost) || is_new;
        if was_lost {
            out.push((first.at, Event::new(first.time, Observed::LinkBack {})));
        }
        let has_missed = std::mem::take(&mut self.has_missed);
        let is_late = first.at.since(last.at) > self.mode_late;
        let because = match (was_lost, has_missed, is_late) {
            _ if was_replaced => UnseenBecause::AnotherRobot,
            (true, _, _) => UnseenBecause::Link,
            (false, true, _) => UnseenBecause::Lost,
            (false, false, true) => UnseenBecause::Late,
            (false, false, false) => return,
        };
        unseen(Some(last.time), first, because, out);
        self.forget();
    }

    fn forget(&mut self) {
        self.mode = Slot(None);
        self.alarm = Slot(None);
        self.program = Slot(None);
        self.counter = Slot(None);
        self.cycle = Slot(None);
    }

    /// Takes in a value. Returns the one before it, if it follows that.
    fn follow<T: Clone>(
        &mut self,
        slot: impl FnOnce(&mut Self) -> (&mut Slot<T>, Duration),
        value: &Value<'_>,
        next: impl FnOnce(Option<&T>) -> T,
    ) -> Option<T> {
        let (slot, late) = slot(self);
        match slot.step(value, late, next) {
            Step::After(last) => Some(last),
            Step::Old | Step::Begin(None) => None,
            Step::Begin(Some((at, time))) => {
                self.unread = Some(self.unread.map_or((at, time), |unread| unread.min((at, time))));
                None
            }
        }
    }

    fn mode(&mut self, value: &Value<'_>, out: &mut Vec<(Instant, Event)>) {
        let Some(Reading::Integer(to)) = value.reading else { return };
        self.has_stood |= !is_running(*to);
        let before = self.follow(|watcher| (&mut watcher.mode, watcher.mode_late), value, |_| *to);
        if let Some(from) = before.filter(|from| from != to) {
            out.push((value.at, Event::new(value.time, Observed::ModeChanged { from, to: *to })));
        }
    }

    fn alarm(&mut self, value: &Value<'_>, out: &mut Vec<(Instant, Event)>) {
        let Some(Reading::Integer(code)) = value.reading else { return };
        let Ok(code) = u32::try_from(*code) else { return };
        let next = |before: Option<&Alarm>| match before {
            Some(before) if before.code == code => *before,
            Some(_) => Alarm { code, since: Some(value.at) },
            None => Alarm { code, since: None },
        };
        let before = self.follow(|watcher| (&mut watcher.alarm, watcher.late), value, next);
        let Some(before) = before.filter(|before| before.code != code) else { return };
        if before.code != 0 {
            let lasted = before.since.map(|since| value.at.since(since).as_millis());
            let lasted_ms = lasted.and_then(|lasted| u64::try_from(lasted).ok());
            let observed = Observed::AlarmEnded { code: before.code, lasted_ms };
            out.push((value.at, Event::new(value.time, observed)));
        }
        if code != 0 {
            out.push((value.at, Event::new(value.time, Observed::AlarmBegan { code })));
        }
    }

    fn program(&mut self, value: &Value<'_>, out: &mut Vec<(Instant, Event)>) {
        let Some(Reading::Text(to)) = value.reading else { return };
        // Longer texts are not kept in samples either.
        if to.len() > MAX_TEXT {
            return;
        }
        let before = self.follow(|watcher| (&mut watcher.program, watcher.late), value, |_| to.clone());
        if let Some(from) = before.filter(|from| from != to) {
            out.push((value.at, Event::new(value.time, Observed::ProgramChanged { from, to: to.clone() })));
        }
    }

    fn parts(&mut self, value: &Value<'_>, out: &mut Vec<(Instant, Event)>) {
        let (Some(Reading::Counter(read)), Address::Counter(counter)) = (value.reading, value.address) else {
            return;
        };
        let total = read.current;
        let Some(from) = self.follow(|watcher| (&mut watcher.counter, watcher.parts_late), value, |_| total)
        else {
            return;
        };
        let observed = match total.checked_sub(from) {
            Some(0) => return,
            Some(added) if added > 0 => Observed::Parts { counter, added: added.unsigned_abs(), total },
            // It went back, or it jumped by more than any counter counts.
            Some(_) | None => Observed::PartsReset { counter, from, to: total },
        };
        out.push((value.at, Event::new(value.time, observed)));
    }

    fn cycle(&mut self, last: &Value<'_>, current: Option<&Value<'_>>, out: &mut Vec<(Instant, Event)>) {
        let Some(Reading::Decimal(seconds)) = last.reading else { return };
        let current = current.filter(|current| current.at == last.at).and_then(|current| {
            if let Some(Reading::Decimal(seconds)) = current.reading { Some(*seconds) } else { None }
        });
        let mode = self.mode.0.as_ref().filter(|(at, ..)| last.at.since(*at) <= self.mode_late);
        let runs = mode.is_some_and(|(_, _, mode)| is_running(*mode));
        let stood = std::mem::take(&mut self.has_stood);
        let now = cycle::Reading { at: last.at, by: last.by, last: *seconds, current, runs, stood };
        let Some(before) = self.follow(|watcher| (&mut watcher.cycle, watcher.late), last, |_| now) else {
            return;
        };
        let Some(done) = cycle::between(&before, &now) else { return };
        let cycle::Done { count, at_least, ms, ended_before } = done;
        let at = last.time.after(last.by.since(last.at)).before(ended_before).kept();
        out.push((last.at, Event::new(last.time, Observed::CycleDone { count, at_least, ms, at })));
    }
}

fn unseen(from: Option<Micros>, value: &Value<'_>, because: UnseenBecause, out: &mut Vec<(Instant, Event)>) {
    let observed = Observed::Unseen { from, to: value.time, because };
    out.push((value.at, Event::new(value.time, observed)));
}

/// Whether a program runs by itself in this mode.
#[must_use]
pub fn is_running(mode: i64) -> bool {
    matches!(OperationMode::of_number(mode), OperationMode::Running | OperationMode::SingleCycle)
}
