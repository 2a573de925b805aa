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

/// What is asked for.
#[derive(Clone, Debug)]
pub struct ProductionQuestion {
    /// The robot.
    pub robot: RobotName,
    /// The begin of the range.
    pub from: Micros,
    /// Its end, which does not belong to it.
    pub to: Micros,
    /// Until when the robot was read; `None` if that is not known.
    pub read_until: Option<Micros>,
}

/// What there is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProductionAnswer {
    /// The figures.
    pub figures: Figures,
    /// How many chunks, events and files cannot be read.
    pub unreadable: u64,
    /// Whether there is too much to read.
    pub is_too_much: bool,
}

/// Answers a question.
///
/// # Errors
/// [`StoreError`].
pub(super) fn answer<S: HistoryStore>(
    store: &mut S,
    question: &ProductionQuestion,
    (mode, alarm): (Open, Open),
) -> Result<ProductionAnswer, StoreError> {
    let ProductionQuestion { robot, from, to, read_until } = question;
    let mut answer = ProductionAnswer::default();
    let mut production = Production::new(*from, *to, *read_until);
    let mut count = 0;
    let next = walk(store, robot, (*from, *to), None, &mut answer.unreadable, |kept| {
        kept.event.iter().for_each(|event| production.event(event));
        count += 1;
        count < MAX_EVENTS
    })?;
    answer.is_too_much = next.is_some();
    // The first event behind the range that tells a gap may tell that its end was not seen.
    let later = Micros(to.0.saturating_add(LOOK_BEHIND));
    walk(store, robot, (*to, later), None, &mut answer.unreadable, |kept| {
        let is_gap = |event: &Event| matches!(event.observed, Observed::Unseen { .. });
        let gap = kept.event.filter(is_gap);
        gap.iter().for_each(|event| production.event(event));
        count += 1;
        gap.is_none() && count < MAX_EVENTS
    })?;
    let mut series = Vec::new();
    for (address, open) in [(Address::CurMode, mode), (Address::CurAlarm, alarm)] {
        let (samples, is_whole, unreadable) = all(store, question, address, &open)?;
        answer.is_too_much |= !is_whole;
        answer.unreadable += unreadable;
        series.push(samples);
    }
    if let [mode, alarm] = &series[..] {
        answer.figures = production.finish(mode, alarm);
    }
    Ok(answer)
}

/// All samples of a signal in the range, and whether these are all. One answer reads so many chunks at most, so
/// a month takes several.
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

    use super::*;
    use crate::core::history::block::{Write, chunks};
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
                    made.extend(chunks(interval, &samples).into_iter().map(|chunk| (address, chunk)));
                }
            }
            store.write(day, &[(robot.clone(), Write { chunks: made, ..Write::default() })]).unwrap();
        }
        let (from, to) = (Micros(0), Micros(31 * DAY));
        let question = ProductionQuestion { robot, from, to, read_until: None };
        let answer = answer(&mut store, &question, (Vec::new(), Vec::new())).unwrap();
        assert!(!answer.is_too_much && answer.unreadable == 0);
        assert_eq!((answer.figures.running, answer.figures.unseen), (31 * DAY, 0));
    }
}
