//! Figures of production, from the samples and events of a robot.

use r6_proto::Address;

use super::events::walk;
use super::{Open, Question, answer as samples};
use crate::core::history::event::{Event, Observed};
use crate::core::history::sample::{Micros, Sample};
use crate::core::name::RobotName;
use crate::core::production::{Figures, Production};
use crate::store::StoreError;
use crate::store::history::HistoryStore;

/// The most samples of the mode or the alarm of one answer: a change every 5 s of a month.
const MAX_SAMPLES: usize = 500_000;

/// The most events of one answer: a cycle every 5 s of a month. They take a second.
const MAX_EVENTS: usize = 500_000;

/// How far behind the range to look for an event that says that its end was not seen: a week.
const LOOK_BEHIND: i64 = 7 * 86_400_000_000;

/// How many samples of the counter are looked at in one go for a value. Gaps that follow each other are rare.
const LOOKED_AT: usize = 64;

/// How often: more gaps than these are those of a counter that the robot does not have.
const MAX_LOOKS: usize = 16;

/// Samples that are not in the files.
#[derive(Clone, Debug, Default)]
pub struct Opens {
    /// Those of the mode,
    pub mode: Open,
    /// of the alarm,
    pub alarm: Open,
    /// and of the counter of parts.
    pub counter: Open,
}

/// What is asked for.
#[derive(Clone, Debug)]
pub struct ProductionQuestion {
    /// The robot.
    pub robot: RobotName,
    /// The begin of the range.
    pub from: Micros,
    /// Its end, which does not belong to it.
    pub to: Micros,
    /// Until when the robot was read, and what was read is on the disk; `None` if that is not known.
    pub read_until: Option<Micros>,
    /// The number of its counter of parts.
    pub counter: Option<u32>,
}

/// What there is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProductionAnswer {
    /// The figures. Parts are there if the counter of parts was read.
    pub figures: Figures,
    /// How many chunks, events and files cannot be read.
    pub unreadable: u64,
    /// Whether there is too much to read.
    pub is_too_much: bool,
}

/// The first event behind a range that tells of a gap, and up to where it was looked for.
#[derive(Clone, Debug)]
struct NextGap {
    looked_from: Micros,
    event: Option<Event>,
}

/// Answers questions about one robot, which are in the order of time.
///
/// # Errors
/// [`StoreError`].
pub(super) fn answers<S: HistoryStore>(
    store: &mut S,
    questions: &[ProductionQuestion],
    open: &Opens,
) -> Result<Vec<ProductionAnswer>, StoreError> {
    let mut gap = None;
    // The last one first: what is behind a range was read for the one behind it.
    let answers = questions.iter().rev().map(|question| answer(store, question, open, &mut gap));
    let mut answers = answers.collect::<Result<Vec<_>, _>>()?;
    answers.reverse();
    Ok(answers)
}

fn answer<S: HistoryStore>(
    store: &mut S,
    question: &ProductionQuestion,
    Opens { mode, alarm, counter }: &Opens,
    next_gap: &mut Option<NextGap>,
) -> Result<ProductionAnswer, StoreError> {
    let ProductionQuestion { robot, from, to, read_until, counter: number } = question;
    let mut answer = ProductionAnswer::default();
    let mut production = Production::new(*from, *to, *read_until, *number);
    let mut count = 0;
    let next = walk(store, robot, (*from, *to), None, &mut answer.unreadable, |kept| {
        kept.event.iter().for_each(|event| production.event(event));
        count += 1;
        count < MAX_EVENTS
    })?;
    answer.is_too_much = next.is_some();
    // The first event behind the range that tells a gap may tell that its end was not seen.
    let known = next_gap.take().filter(|known| known.looked_from >= *to);
    let later = Micros(to.0.saturating_add(LOOK_BEHIND));
    let later = known.as_ref().map_or(later, |known| known.looked_from.min(later));
    let mut gap = None;
    walk(store, robot, (*to, later), None, &mut answer.unreadable, |kept| {
        let is_gap = |event: &Event| matches!(event.observed, Observed::Unseen { .. });
        gap = kept.event.filter(is_gap);
        count += 1;
        gap.is_none() && count < MAX_EVENTS
    })?;
    let gap = gap.or_else(|| known.and_then(|known| known.event));
    gap.iter().for_each(|event| production.event(event));
    *next_gap = Some(NextGap { looked_from: *to, event: gap });
    let mut series = Vec::new();
    for (address, open) in [(Address::CurMode, mode), (Address::CurAlarm, alarm)] {
        let (samples, is_whole, unreadable) = all(store, question, address, open)?;
        answer.is_too_much |= !is_whole;
        answer.unreadable += unreadable;
        series.push(samples);
    }
    if let [mode, alarm] = &series[..] {
        answer.figures = production.finish(mode, alarm);
    }
    if let Some(number) = number
        && answer.figures.parts.is_none()
        && is_read(store, question, Address::Counter(*number), counter)?
    {
        // A counter that did not grow has counted nothing.
        answer.figures.parts = Some(0);
    }
    Ok(answer)
}

/// Whether a value of a signal was read in the range.
fn is_read<S: HistoryStore>(
    store: &mut S,
    question: &ProductionQuestion,
    address: Address,
    open: &Open,
) -> Result<bool, StoreError> {
    let ProductionQuestion { robot, from, to, .. } = question;
    let mut cursor = None;
    for _ in 0..MAX_LOOKS {
        let question = Question {
            robot: robot.clone(),
            address,
            from: *from,
            to: *to,
            bucket: None,
            limit: LOOKED_AT,
            cursor,
        };
        let read = samples(store, &question, open.clone())?;
        if read.samples.iter().any(|sample| sample.state.gap().is_none()) {
            return Ok(true);
        }
        if read.next <= cursor {
            break;
        }
        cursor = read.next;
    }
    Ok(false)
}

/// All samples of a signal in the range, and whether these are all. The store reads a limited number of
/// chunks at a time, so a month takes several calls.
fn all<S: HistoryStore>(
    store: &mut S,
    question: &ProductionQuestion,
    address: Address,
    open: &Open,
) -> Result<(Vec<Sample>, bool, u64), StoreError> {
    let ProductionQuestion { robot, from, to, .. } = question;
    let (mut all, mut unreadable, mut cursor) = (Vec::new(), 0, None);
    while all.len() < MAX_SAMPLES {
        let question = Question {
            robot: robot.clone(),
            address,
            from: *from,
            to: *to,
            bucket: None,
            limit: MAX_SAMPLES - all.len(),
            cursor,
        };
        let read = samples(store, &question, open.clone())?;
        all.extend(read.samples);
        unreadable += read.unreadable;
        match read.next {
            None => return Ok((all, true, unreadable)),
            // Each answer has to come further, or this would not end.
            next if next <= cursor => break,
            next => cursor = next,
        }
    }
    Ok((all, false, unreadable))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use r6_api::gateway::Gap;

    use super::*;
    use crate::core::history::block::{Write, chunks};
    use crate::core::history::codec::Times;
    use crate::core::history::sample::{Interval, State};
    use crate::store::history::MemoryDays;

    const MINUTE: i64 = 60_000_000;
    const DAY: i64 = 1_440 * MINUTE;

    #[test]
    fn a_month_of_samples_of_each_minute_is_read() {
        let robot = RobotName::new("press").unwrap();
        let mut store = MemoryDays::default();
        // As a gateway writes it: a chunk spans ten minutes at most.
        for day in 0..31 {
            let mut made = Vec::new();
            for (address, value) in [(Address::CurMode, 7), (Address::CurAlarm, 0)] {
                for first in (0..DAY).step_by(10 * 60_000_000) {
                    let sample = |minute: i64| Sample {
                        time: Micros(day * DAY + first + minute * MINUTE),
                        state: State::Integer(value),
                    };
                    let samples: Vec<_> = (0..10).map(sample).collect();
                    let interval = Interval::of_period(Duration::from_millis(100));
                    made.extend(
                        chunks(&mut Times::default(), interval, &samples)
                            .into_iter()
                            .map(|chunk| (address, chunk)),
                    );
                }
            }
            store.write(day, &[(robot.clone(), Write { chunks: made, ..Write::default() })]).unwrap();
        }
        let (from, to) = (Micros(0), Micros(31 * DAY));
        let question = ProductionQuestion { robot, from, to, read_until: None, counter: None };
        let answer = answers(&mut store, &[question], &Opens::default()).unwrap().remove(0);
        assert!(!answer.is_too_much && answer.unreadable == 0);
        assert_eq!((answer.figures.running, answer.figures.unseen), (31 * DAY, 0));
    }

    #[test]
    fn ranges_that_are_asked_for_together_are_as_if_asked_for_alone() {
        let robot = RobotName::new("press").unwrap();
        let mut store = MemoryDays::default();
        let interval = Interval::of_period(Duration::from_millis(100));
        let mut made = Vec::new();
        for address in [Address::CurMode, Address::CurAlarm] {
            let sample = |minute: i64| Sample { time: Micros(minute * MINUTE), state: State::Integer(0) };
            let samples: Vec<_> = (0..600).map(sample).collect();
            for samples in samples.chunks(10) {
                made.extend(
                    chunks(&mut Times::default(), interval, samples)
                        .into_iter()
                        .map(|chunk| (address, chunk)),
                );
            }
        }
        let gap = |from: i64, to| {
            let (from, to) = (Some(Micros(from * MINUTE)), Micros(to * MINUTE));
            let because = r6_api::gateway::UnseenBecause::Link;
            Event::new(to, Observed::Unseen { from, to, because })
        };
        // The first one begins two ranges before its end.
        let events = vec![gap(95, 215), gap(310, 320), gap(449, 450)];
        store.write(0, &[(robot.clone(), Write { chunks: made, events, ..Write::default() })]).unwrap();
        let question = |from: i64| ProductionQuestion {
            robot: robot.clone(),
            from: Micros(from * MINUTE),
            to: Micros((from + 60) * MINUTE),
            read_until: None,
            counter: None,
        };
        let questions: Vec<_> = (0..9).map(|hour| question(hour * 60)).collect();
        let together = answers(&mut store, &questions, &Opens::default()).unwrap();
        let unseen: Vec<_> = together.iter().map(|answer| answer.figures.unseen / MINUTE).collect();
        assert_eq!(unseen, [0, 25, 60, 35, 0, 10, 0, 1, 0]);
        for (question, answer) in questions.into_iter().zip(together) {
            assert_eq!(answers(&mut store, &[question], &Opens::default()).unwrap(), [answer]);
        }
    }

    #[test]
    fn parts_are_zero_only_if_their_counter_was_read() {
        let robot = RobotName::new("press").unwrap();
        let mut store = MemoryDays::default();
        let count = |time| Sample { time: Micros(time), state: State::Text("{}".into()) };
        let gap = |time| Sample { time: Micros(time), state: State::Gap(Gap::None) };
        let interval = Interval::of_period(Duration::from_millis(100));
        let mut made = Vec::new();
        for (number, sample) in [(4, count(MINUTE)), (5, gap(MINUTE))] {
            let chunks = chunks(&mut Times::default(), interval, &[sample]).into_iter();
            made.extend(chunks.map(|chunk| (Address::Counter(number), chunk)));
        }
        store.write(0, &[(robot.clone(), Write { chunks: made, ..Write::default() })]).unwrap();
        let mut parts = |counter, from| {
            let (from, to) = (Micros(from), Micros(DAY));
            let question = ProductionQuestion { robot: robot.clone(), from, to, read_until: None, counter };
            answers(&mut store, &[question], &Opens::default()).unwrap().remove(0).figures.parts
        };
        assert_eq!([parts(Some(4), 0), parts(Some(5), 0), parts(Some(6), 0)], [Some(0), None, None]);
        assert_eq!((parts(None, 0), parts(Some(4), 60 * MINUTE)), (None, None), "nothing was read then");
    }
}
