//! Figures of production, from what was kept of a robot: its mode, its alarm, and its events.
//!
//! Each µs of the range is in one state, or unseen. It is unseen if the mode or the alarm has no value, if an
//! event says that the robot was not seen, and behind the last reading.

use std::collections::BTreeMap;

use r6_api::gateway::Gap;
use r6_proto::OperationMode;

use super::history::event::{Event, Observed};
use super::history::sample::{Micros, Sample, State};

/// What was computed. Times are in µs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figures {
    /// A program ran.
    pub running: i64,
    /// Auto or stop, and no program ran.
    pub waiting: i64,
    /// There was an alarm.
    pub alarm: i64,
    /// Manual or single step.
    pub manual: i64,
    /// Another mode.
    pub other: i64,
    /// It was not seen.
    pub unseen: i64,
    /// How many cycles ended.
    pub cycles: u64,
    /// Whether more may have ended.
    pub cycles_at_least: bool,
    /// The times of cycles in ms, the shortest first.
    pub cycle_times: Vec<u64>,
    /// How many parts its counter counted; `None` if it did not grow.
    pub parts: Option<u64>,
    /// How often the counter of parts went back.
    pub part_resets: u64,
    /// Each alarm code: how often it began, and for how many µs it was there.
    pub alarms: BTreeMap<u32, (u64, i64)>,
}

impl Figures {
    /// How many µs were seen.
    #[must_use]
    pub fn seen(&self) -> i64 {
        self.running + self.waiting + self.alarm + self.manual + self.other
    }

    /// The time in which a program ran, divided by the time that was seen; `None` if nothing was.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "a range of a month is below 2^53 µs")]
    pub fn availability(&self) -> Option<f64> {
        (self.seen() > 0).then(|| self.running as f64 / self.seen() as f64)
    }

    /// The cycle time that this share of the cycles did not exceed, in percent from 1 to 100.
    #[must_use]
    pub fn percentile(&self, percent: usize) -> Option<u64> {
        let rank = (self.cycle_times.len() * percent).div_ceil(100);
        self.cycle_times.get(rank.checked_sub(1)?).copied()
    }
}

/// Takes in the events of a range. Then the samples make the [`Figures`].
#[derive(Debug)]
pub struct Production {
    from: Micros,
    to: Micros,
    figures: Figures,
    /// Spans that were not seen.
    unseen: Vec<(Micros, Micros)>,
    /// The ends of spans that were not seen, of which the begin is not known.
    unseen_until: Vec<Micros>,
    /// The number of the counter of parts.
    counter: Option<u32>,
}

impl Production {
    /// Nothing is known of this range. What is behind `read_until` was not read yet. `counter`: the number of
    /// the counter of parts. What other counters counted, which had its place before, is not parts.
    #[must_use]
    pub fn new(from: Micros, to: Micros, read_until: Option<Micros>, counter: Option<u32>) -> Self {
        let to = to.max(from);
        let unseen = read_until.map(|until| (until, to)).into_iter().collect();
        Self { from, to, figures: Figures::default(), unseen, unseen_until: Vec::new(), counter }
    }

    /// Takes in an event. An `unseen` may be behind the range; others are in it.
    pub fn event(&mut self, event: &Event) {
        if let Observed::Unseen { from, to, .. } = event.observed {
            match from.filter(|from| *from <= to) {
                Some(from) => self.unseen.push((from, to)),
                // Not known, or the clock was set back meanwhile.
                None => self.unseen_until.push(to),
            }
            return;
        }
        if !(self.from..self.to).contains(&event.time) {
            return;
        }
        let figures = &mut self.figures;
        match event.observed {
            Observed::AlarmBegan { code } => figures.alarms.entry(code).or_default().0 += 1,
            Observed::CycleDone { count, at_least, ms, .. } => {
                figures.cycles = figures.cycles.saturating_add(count);
                figures.cycles_at_least |= at_least;
                figures.cycle_times.extend(ms);
            }
            Observed::Parts { counter, added, .. } if Some(counter) == self.counter => {
                figures.parts = Some(figures.parts.unwrap_or(0).saturating_add(added));
            }
            Observed::PartsReset { counter, .. } if Some(counter) == self.counter => figures.part_resets += 1,
            Observed::Parts { .. }
            | Observed::PartsReset { .. }
            | Observed::AlarmEnded { .. }
            | Observed::ModeChanged { .. }
            | Observed::ProgramChanged { .. }
            | Observed::LinkLost {}
            | Observed::LinkBack {}
            | Observed::Unseen { .. } => {}
        }
    }

    /// The figures. The samples are in the order of time; each counts until the next one. Gaps are samples
    /// too. A span that was not seen, of which the begin is not known, begins at the last sample before its
    /// end.
    #[must_use]
    pub fn finish(mut self, mode: &[Sample], alarm: &[Sample]) -> Figures {
        let (from, to) = (self.from, self.to);
        for until in std::mem::take(&mut self.unseen_until) {
            let last = [mode, alarm].into_iter().filter_map(|samples| last_before(samples, until)).max();
            self.unseen.push((last.unwrap_or(from), until));
        }
        let spans = merged(std::mem::take(&mut self.unseen));
        let edges = mode.iter().chain(alarm).map(|sample| sample.time);
        let edges = edges.chain(spans.iter().flat_map(|(begin, end)| [*begin, *end]));
        let mut edges: Vec<_> = edges.filter(|edge| (from..to).contains(edge)).chain([from, to]).collect();
        edges.sort_unstable();
        edges.dedup();
        let (mut mode, mut alarm) = (Held::new(mode), Held::new(alarm));
        let mut spans = spans.into_iter().peekable();
        for edge in edges.windows(2) {
            let [begin, end] = edge else { continue };
            let time = end.0.saturating_sub(begin.0);
            while spans.next_if(|(_, until)| until <= begin).is_some() {}
            let is_unseen = spans.peek().is_some_and(|(since, _)| since <= begin);
            let (mode, alarm) = (mode.at(*begin), alarm.at(*begin));
            let seen = mode.zip(alarm).filter(|_| !is_unseen);
            *self.figures.state(seen) += time;
            if let Some((_, code)) = seen
                && let Ok(code @ 1..) = u32::try_from(code)
            {
                self.figures.alarms.entry(code).or_default().1 += time;
            }
        }
        self.figures.cycle_times.sort_unstable();
        self.figures
    }
}

impl Figures {
    /// The state of a mode and an alarm.
    fn state(&mut self, seen: Option<(i64, i64)>) -> &mut i64 {
        let Some((mode, alarm)) = seen else { return &mut self.unseen };
        if alarm != 0 {
            return &mut self.alarm;
        }
        match OperationMode::of_number(mode) {
            OperationMode::Running | OperationMode::SingleCycle => &mut self.running,
            OperationMode::Auto | OperationMode::Stop => &mut self.waiting,
            OperationMode::Manual | OperationMode::SingleStep => &mut self.manual,
            OperationMode::None | OperationMode::Unknown(_) => &mut self.other,
        }
    }
}

/// The value of a signal at times that only grow.
struct Held<'s> {
    /// The samples that are still to come.
    rest: &'s [Sample],
    value: Option<i64>,
}

impl<'s> Held<'s> {
    fn new(samples: &'s [Sample]) -> Self {
        Self { rest: samples, value: None }
    }

    fn at(&mut self, time: Micros) -> Option<i64> {
        while let Some((sample, rest)) = self.rest.split_first()
            && sample.time <= time
        {
            self.rest = rest;
            self.value = if let State::Integer(value) = sample.state { Some(value) } else { None };
        }
        self.value
    }
}

/// The time of the last sample before this time that comes from the robot.
fn last_before(samples: &[Sample], time: Micros) -> Option<Micros> {
    let before = samples.partition_point(|sample| sample.time < time);
    // The query itself adds where values end.
    let is_read = |sample: &&Sample| sample.state.gap() != Some(Gap::NoData);
    samples.get(..before)?.iter().rev().find(is_read).map(|sample| sample.time)
}

/// Spans that may overlap, as spans that do not.
fn merged(mut spans: Vec<(Micros, Micros)>) -> Vec<(Micros, Micros)> {
    spans.retain(|(begin, end)| begin < end);
    spans.sort_unstable();
    let mut merged: Vec<(Micros, Micros)> = Vec::new();
    for (begin, end) in spans {
        match merged.last_mut() {
            Some(last) if begin <= last.1 => last.1 = last.1.max(end),
            _ => merged.push((begin, end)),
        }
    }
    merged
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use r6_api::gateway::UnseenBecause;

    use super::*;

    fn whole(time: i64, value: i64) -> Sample {
        Sample { time: Micros(time), state: State::Integer(value) }
    }

    fn gap(time: i64) -> Sample {
        Sample { time: Micros(time), state: State::Gap(Gap::Stale) }
    }

    fn event(time: i64, observed: Observed) -> Event {
        Event::new(Micros(time), observed)
    }

    fn unseen(from: Option<i64>, to: i64) -> Event {
        let (from, to) = (from.map(Micros), Micros(to));
        Event::new(to, Observed::Unseen { from, to, because: UnseenBecause::Link })
    }

    fn cycle(time: i64, ms: u64) -> Event {
        event(time, Observed::CycleDone { count: 1, at_least: false, ms: Some(ms), at: Micros(time) })
    }

    #[test]
    fn each_state_has_its_time_and_what_was_not_seen_has_none() {
        let mode =
            [whole(-5, 2), whole(10, 7), whole(40, 1), whole(50, 3), whole(60, 0), gap(70), whole(90, 9)];
        let alarm = [whole(-5, 0), whole(20, 42), whole(30, 0)];
        let mut production = Production::new(Micros(0), Micros(100), None, Some(4));
        production.event(&event(20, Observed::AlarmBegan { code: 42 }));
        production.event(&unseen(Some(92), 200));
        let figures = production.finish(&mode, &alarm);
        assert_eq!((figures.waiting, figures.running, figures.alarm), (20, 22, 10));
        assert_eq!((figures.manual, figures.other, figures.unseen), (10, 10, 28));
        assert_eq!(figures.alarms, BTreeMap::from([(42, (1, 10))]));
        assert_eq!((figures.seen(), figures.availability()), (72, Some(22.0 / 72.0)));
    }

    #[test]
    fn without_an_alarm_value_or_a_reading_nothing_is_seen() {
        let figures = Production::new(Micros(0), Micros(100), None, Some(4)).finish(&[whole(0, 7)], &[]);
        assert_eq!((figures.unseen, figures.availability()), (100, None));
        let both = ([whole(0, 7)], [whole(0, 0)]);
        let figures =
            Production::new(Micros(0), Micros(100), Some(Micros(30)), Some(4)).finish(&both.0, &both.1);
        assert_eq!((figures.running, figures.unseen), (30, 70), "behind the last reading");
        let figures = Production::new(Micros(100), Micros(0), None, Some(4)).finish(&both.0, &both.1);
        assert_eq!(figures, Figures::default(), "a range that is empty");
    }

    #[test]
    fn a_gap_with_no_known_begin_begins_at_the_last_sample_before_its_end() {
        let no_data = Sample { time: Micros(30), state: State::Gap(Gap::NoData) };
        let mode = [whole(0, 7), whole(20, 7), no_data, whole(60, 7)];
        let alarm = [whole(0, 0), whole(10, 0), whole(60, 0)];
        for from in [None, Some(61), Some(i64::MAX)] {
            let mut production = Production::new(Micros(0), Micros(100), None, Some(4));
            production.event(&unseen(from, 60));
            let figures = production.finish(&mode, &alarm);
            assert_eq!((figures.running, figures.unseen), (60, 40), "{from:?}");
        }
        // Its end is behind the range; and nothing is there before it.
        let mut production = Production::new(Micros(0), Micros(100), None, Some(4));
        production.event(&unseen(None, 200));
        assert_eq!(production.finish(&mode[..2], &alarm[..2]).running, 20);
        let mut production = Production::new(Micros(0), Micros(100), None, Some(4));
        production.event(&unseen(None, 60));
        assert_eq!(production.finish(&mode[3..], &alarm[2..]).running, 40);
    }

    #[test]
    fn cycles_and_parts_of_the_range_are_counted() {
        let mut production = Production::new(Micros(0), Micros(100), None, Some(4));
        (1..=10_u32).for_each(|at| production.event(&cycle(i64::from(at), u64::from(11 - at) * 100)));
        production.event(&cycle(100, 7));
        production
            .event(&event(5, Observed::CycleDone { count: 1, at_least: true, ms: None, at: Micros(5) }));
        production.event(&event(6, Observed::Parts { counter: 4, added: 3, total: 9 }));
        production.event(&event(7, Observed::PartsReset { counter: 4, from: 9, to: 0 }));
        // Another counter, which had its place before.
        production.event(&event(8, Observed::Parts { counter: 5, added: 90, total: 90 }));
        production.event(&event(9, Observed::PartsReset { counter: 5, from: 90, to: 0 }));
        let figures = production.finish(&[], &[]);
        assert_eq!((figures.cycles, figures.cycles_at_least, figures.cycle_times.len()), (11, true, 10));
        let shares = [1, 50, 90, 91, 100].map(|percent| figures.percentile(percent));
        assert_eq!(shares, [100, 500, 900, 1000, 1000].map(Some));
        assert_eq!((figures.parts, figures.part_resets), (Some(3), 1));
        assert_eq!(Figures::default().percentile(50), None);
    }

    proptest! {
        /// All times together are the range, and each µs is what a look at this µs alone says.
        #[test]
        fn times_sum_to_the_range(
            mode in prop::collection::btree_map(-50..250_i64, prop::option::weighted(0.8, 0..10_i64), 0..12),
            alarm in prop::collection::btree_map(-50..250_i64, prop::option::weighted(0.8, 0..3_i64), 0..12),
            spans in prop::collection::vec((prop::option::of(-60..260_i64), -60..260_i64), 0..6),
            (from, length) in (-10..60_i64, 0..200_i64),
            read_until in prop::option::of(0..300_i64),
        ) {
            let to = from + length;
            let series = |values: &BTreeMap<i64, Option<i64>>| -> Vec<Sample> {
                values.iter().map(|(time, value)| value.map_or(gap(*time), |value| whole(*time, value))).collect()
            };
            let mut production = Production::new(Micros(from), Micros(to), read_until.map(Micros), Some(4));
            spans.iter().for_each(|(begin, end)| production.event(&unseen(*begin, *end)));
            let figures = production.finish(&series(&mode), &series(&alarm));
            prop_assert_eq!(figures.seen() + figures.unseen, length);
            prop_assert_eq!(figures.alarms.values().map(|alarm| alarm.1).sum::<i64>(), figures.alarm);
            let mut expected = Figures::default();
            for time in from..to {
                let held = |values: &BTreeMap<i64, Option<i64>>| values.range(..=time).next_back().and_then(|at| *at.1);
                let last_before = |end: i64| {
                    let last = [&mode, &alarm].map(|values| values.range(..end).next_back().map(|at| *at.0));
                    last.into_iter().flatten().max().unwrap_or(from)
                };
                let is_unseen = spans.iter().any(|(begin, end)| {
                    let begin = begin.filter(|begin| begin <= end).unwrap_or_else(|| last_before(*end));
                    (begin..*end).contains(&time)
                })
                    || read_until.is_some_and(|until| time >= until);
                let seen = held(&mode).zip(held(&alarm)).filter(|_| !is_unseen);
                *expected.state(seen) += 1;
            }
            let times = |of: &Figures| [of.running, of.waiting, of.alarm, of.manual, of.other, of.unseen];
            prop_assert_eq!(times(&figures), times(&expected));
        }
    }
}
