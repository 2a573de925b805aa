//! Events of one robot in a range of time, a page at a time.

use std::cmp::Ordering;

use super::unless_gone;
use crate::core::history::event::{Event, Kind};
use crate::core::history::sample::Micros;
use crate::core::name::RobotName;
use crate::store::StoreError;
use crate::store::history::{AskEvents, HistoryStore, KeptEvent, Part};

/// How many rows of one file are read in one go: some hundred kilobytes.
const TOGETHER: usize = if cfg!(test) { 5 } else { 1_000 };

/// The most rows that one answer looks at, for events of a kind that is rare: some tenths of a second.
const MAX_ROWS: usize = 200_000;

/// A place among the events of a robot: behind an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EventPlace {
    /// Its time.
    pub time: Micros,
    /// The number of its file among those of its day.
    pub part: u32,
    /// Its row.
    pub row: i64,
}

/// What is asked for.
#[derive(Clone, Debug)]
pub struct EventQuestion {
    /// The robot.
    pub robot: RobotName,
    /// The begin of the range.
    pub from: Micros,
    /// Its end, which does not belong to it.
    pub to: Micros,
    /// Only these kinds; all if it is empty.
    pub kinds: Vec<Kind>,
    /// How many events at most.
    pub limit: usize,
    /// Where to read on.
    pub after: Option<EventPlace>,
}

/// What there is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EventAnswer {
    /// The events, with their files and rows.
    pub events: Vec<(Part, i64, Event)>,
    /// Where to read on.
    pub next: Option<EventPlace>,
    /// How many events and files cannot be read.
    pub unreadable: u64,
}

/// Answers a question.
///
/// # Errors
/// [`StoreError`].
pub fn answer<S: HistoryStore>(store: &mut S, question: &EventQuestion) -> Result<EventAnswer, StoreError> {
    let EventQuestion { robot, from, to, kinds, limit, after } = question;
    let mut answer = EventAnswer::default();
    let mut rows = 0;
    let is_wanted = |event: &Event| kinds.is_empty() || kinds.contains(&event.kind());
    let walked = walk(store, robot, (*from, *to), *after, &mut answer.unreadable, |kept| {
        rows += 1;
        if let Some(event) = kept.event.filter(is_wanted) {
            answer.events.push((kept.part, kept.row, event));
        }
        answer.events.len() < *limit && rows < MAX_ROWS
    });
    answer.next = walked?;
    Ok(answer)
}

/// Goes through the events of a robot in the order of time, until `each` says that it is enough. Returns the
/// place of the last event then; `None` if there are no more. Of an event that stands in two files, because a
/// write failed half-way, the first one counts. Events of one poll have one time, so an event is compared
/// with all others of its time.
pub(super) fn walk<S: HistoryStore>(
    store: &mut S,
    robot: &RobotName,
    (from, to): (Micros, Micros),
    after: Option<EventPlace>,
    unreadable: &mut u64,
    mut each: impl FnMut(KeptEvent) -> bool,
) -> Result<Option<EventPlace>, StoreError> {
    let begin = after.map_or(from, |place| place.time.max(from));
    let days = begin.day()..=to.day();
    let parts: Vec<_> = store.parts()?.into_iter().map(|(part, _)| part).collect();
    let parts: Vec<_> = parts.into_iter().filter(|part| days.contains(&part.day)).collect();
    // The events of the time that was reached.
    let mut present = match after.filter(|place| place.time >= from) {
        Some(place) => told(store, robot, place, &parts)?,
        None => Vec::new(),
    };
    for day in parts.chunk_by(|one, next| one.day == next.day) {
        let mut place = after;
        loop {
            let (mut found, mut cut) = (Vec::new(), None::<(Micros, u32)>);
            for part in day {
                let ask = AskEvents { robot, after: behind(from, place, *part), to };
                let rows = unless_gone(store, *part, unreadable, |store| store.events(*part, ask, TOGETHER))?;
                if rows.len() >= TOGETHER {
                    // What the other files have behind this time comes in the next round.
                    let last = rows.last().map(|row| (row.time, row.part.number));
                    cut = [cut, last].into_iter().flatten().min();
                }
                found.extend(rows);
            }
            found.sort_by_key(|kept| (kept.time, kept.part.number, kept.row));
            let mut is_done = true;
            for kept in found {
                if cut.is_some_and(|cut| (kept.time, kept.part.number) > cut) {
                    break;
                }
                is_done = false;
                place = Some(EventPlace { time: kept.time, part: kept.part.number, row: kept.row });
                present.retain(|of: &KeptEvent| of.time == kept.time);
                let is_again = |of: &KeptEvent| of.part != kept.part && of.event == kept.event;
                if kept.event.is_some() && present.iter().any(is_again) {
                    continue;
                }
                *unreadable += u64::from(kept.event.is_none());
                if present.len() < TOGETHER {
                    present.push(kept.clone());
                }
                if !each(kept) {
                    return Ok(place);
                }
            }
            if cut.is_none() || is_done {
                break;
            }
        }
    }
    Ok(None)
}

/// The events of the time of a place up to this place: earlier pages told them. A poll has a dozen at most,
/// so one read of each file has them all.
fn told<S: HistoryStore>(
    store: &mut S,
    robot: &RobotName,
    place: EventPlace,
    parts: &[Part],
) -> Result<Vec<KeptEvent>, StoreError> {
    let ask = AskEvents { robot, after: (place.time, 0), to: Micros(place.time.0.saturating_add(1)) };
    // The walk itself counts files that cannot be read.
    let mut unreadable = 0;
    let mut told = Vec::new();
    for part in parts.iter().filter(|part| part.day == place.time.day() && part.number <= place.part) {
        told.extend(unless_gone(store, *part, &mut unreadable, |store| store.events(*part, ask, TOGETHER))?);
    }
    told.retain(|kept| (kept.part.number, kept.row) <= (place.part, place.row));
    Ok(told)
}

/// What is behind a place in one file.
fn behind(from: Micros, place: Option<EventPlace>, part: Part) -> (Micros, i64) {
    match place {
        Some(EventPlace { time, part: number, row }) if time >= from => match number.cmp(&part.number) {
            Ordering::Less => (time, 0),
            Ordering::Equal => (time, row),
            Ordering::Greater => (time, i64::MAX),
        },
        Some(_) | None => (from, 0),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::core::history::block::Write;
    use crate::core::history::event::Observed;
    use crate::store::history::MemoryDays;

    const DAY: i64 = 86_400_000_000;

    fn robot() -> RobotName {
        RobotName::new("press").unwrap()
    }

    fn question(limit: usize, kinds: &[Kind]) -> EventQuestion {
        let (from, to) = (Micros(DAY), Micros(4 * DAY));
        EventQuestion { robot: robot(), from, to, kinds: kinds.to_vec(), limit, after: None }
    }

    /// All pages, one after the other.
    fn pages(store: &mut MemoryDays, mut question: EventQuestion) -> Vec<Event> {
        let mut all = Vec::new();
        loop {
            let answer = answer(store, &question).unwrap();
            assert!(answer.events.len() <= question.limit && answer.unreadable == 0);
            all.extend(answer.events.into_iter().map(|(_, _, event)| event));
            question.after = answer.next;
            if question.after.is_none() {
                return all;
            }
        }
    }

    proptest! {
        /// Whatever the files are, pages give each event of the range once, in the order of time.
        #[test]
        fn pages_give_each_event_once(
            events in prop::collection::vec((0..5_i64, 0..12_i64, any::<bool>(), any::<bool>()), 0..60),
            limit in 1..9_usize,
        ) {
            let mut store = MemoryDays::default();
            let mut expected = Vec::new();
            for (number, (day, second, is_alarm, begins_part)) in (0_u32..).zip(events) {
                let code = i64::from(number);
                let observed = if is_alarm {
                    Observed::AlarmBegan { code: number }
                } else {
                    Observed::ModeChanged { from: code, to: 0 }
                };
                let event = Event::new(Micros(day * DAY + second), observed);
                if begins_part {
                    store.begin_part(day).unwrap();
                }
                let write = Write { events: vec![event.clone()], ..Write::default() };
                store.write(day, &[(robot(), write)]).unwrap();
                expected.push(event);
            }
            // Events of one time stand as they were written: so do their files and rows.
            expected.sort_by_key(|event| event.time);
            expected.retain(|event| (DAY..4 * DAY).contains(&event.time.0));
            prop_assert_eq!(&pages(&mut store, question(limit, &[])), &expected);
            expected.retain(|event| event.kind() == Kind::AlarmBegan);
            prop_assert_eq!(pages(&mut store, question(limit, &[Kind::AlarmBegan])), expected);
        }
    }

    #[test]
    fn an_event_in_two_files_is_told_once() {
        let mut store = MemoryDays::default();
        let event = Event::new(Micros(DAY), Observed::AlarmBegan { code: 7 });
        for _ in 0..2 {
            let write = Write { events: vec![event.clone()], ..Write::default() };
            store.write(1, &[(robot(), write)]).unwrap();
            store.begin_part(1).unwrap();
        }
        assert_eq!(pages(&mut store, question(9, &[])), [event]);
    }

    #[test]
    fn events_of_one_time_in_two_files_are_told_once_each() {
        let mut store = MemoryDays::default();
        let event = |code| Event::new(Micros(DAY), Observed::AlarmBegan { code });
        let events = vec![event(7), event(8), event(9)];
        for _ in 0..2 {
            let write = Write { events: events.clone(), ..Write::default() };
            store.write(1, &[(robot(), write)]).unwrap();
            store.begin_part(1).unwrap();
        }
        for limit in 1..9 {
            assert_eq!(pages(&mut store, question(limit, &[])), events, "{limit}");
        }
    }
}
