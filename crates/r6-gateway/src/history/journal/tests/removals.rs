//! What is removed, comes late or fails while averages are computed, and what they are said to be then.

use super::averages::{FIRST, HOUR, MINUTE, MODE, at, fill, question, read};
use super::*;
use crate::core::history::averages::Step;
use crate::history::query::Used;
use crate::store::history::{DayNote, DayState, Days};

const PART: Part = Part { day: FIRST, number: 1 };

/// When the first day is averaged.
const NOW: i64 = ((FIRST + 1) * 24 + 4) * HOUR;

/// A value of both signals in another part of the first day.
fn late<S: HistoryStore>(journal: &mut Journal<S>, second: i64, now: i64) {
    let counts = Arc::<RobotCounts>::default();
    let sample = whole(at(FIRST, second), 5);
    let samples = vec![(MODE, sample.clone()), (Address::Origin, sample)];
    journal.store.begin_part(FIRST).unwrap();
    journal.take(Instant::ORIGIN, batch(samples, &counts));
    journal.seal_all();
    journal.flush(Instant::ORIGIN, Micros(now)).unwrap();
}

fn remove<S: HistoryStore>(journal: &mut Journal<S>) {
    journal.note_removal(PART, FIRST + 1);
    journal.store.remove(PART).unwrap();
}

/// The first pieces of the averages of the first day.
fn pieces<S: HistoryStore>(journal: &mut Journal<S>, count: usize) {
    journal.look_for_days(FIRST + 1);
    for _ in 0..count {
        assert!(journal.average(Micros(NOW)).unwrap().is_some());
    }
}

/// What the hour from 21:00 to 22:00 has of both signals, and how it was made.
fn of_hour<S: HistoryStore>(store: &mut S) -> [(u64, Option<Used>); 2] {
    let whole = question(at(FIRST, 21 * 3_600), at(FIRST, 22 * 3_600), Some(HOUR));
    [MODE, Address::Origin].map(|address| {
        let answer = read(store, &Question { address, ..whole.clone() });
        (answer.buckets[0].samples, answer.averages.first().map(|told| told.used))
    })
}

fn note<S: HistoryStore>(journal: &mut Journal<S>) -> Option<DayNote> {
    let kept = journal.store.averages().unwrap().states(FIRST..=FIRST).unwrap();
    assert_eq!(kept.get(&FIRST), journal.averages.states.get(&FIRST));
    kept.get(&FIRST).copied()
}

#[test]
fn a_part_that_goes_while_its_day_is_computed_anew_spoils_no_averages() {
    let mut journal = journal(MemoryDays::default(), settings());
    fill(&mut journal);
    average_all(&mut journal, NOW);
    late(&mut journal, 10 * 3_600, NOW);
    assert_eq!(note(&mut journal), Some(DayState::Reopened.whole()));
    pieces(&mut journal, 2);
    remove(&mut journal);
    average_all(&mut journal, NOW);
    assert_eq!(note(&mut journal), Some(DayState::Cut.lacking()));
    assert_eq!(of_hour(&mut journal.store), [(514, Some(Used::Incomplete)); 2]);
}

#[test]
fn a_day_that_comes_late_and_goes_before_it_is_computed_anew_is_incomplete() {
    let mut journal = journal(MemoryDays::default(), settings());
    fill(&mut journal);
    average_all(&mut journal, NOW);
    assert_eq!(of_hour(&mut journal.store), [(514, None); 2]);
    late(&mut journal, 10 * 3_600, NOW);
    remove(&mut journal);
    assert_eq!(note(&mut journal), Some(DayState::Cut.lacking()));
    assert_eq!(of_hour(&mut journal.store)[1], (514, Some(Used::Incomplete)));
}

#[test]
fn what_was_averaged_before_a_part_went_is_not_hidden_by_the_rest() {
    let mut journal = journal(MemoryDays::default(), settings());
    fill(&mut journal);
    late(&mut journal, 10 * 3_600, NOW);
    // All pieces of the first signal.
    pieces(&mut journal, 1 + 12);
    remove(&mut journal);
    // What comes now does not spoil it either.
    late(&mut journal, 10 * 3_600 + 60, NOW);
    average_all(&mut journal, NOW);
    assert_eq!(note(&mut journal), Some(DayState::Cut.lacking()));
    let seen = of_hour(&mut journal.store);
    assert!(seen.iter().any(|(samples, used)| *samples > 500 && *used == Some(Used::Incomplete)), "{seen:?}");
}

#[test]
fn a_day_of_which_a_part_went_before_it_is_averaged_is_incomplete() {
    let store = MemoryDays::default();
    let mut running = journal(store.clone(), settings());
    fill(&mut running);
    late(&mut running, 21 * 3_600 + 60, NOW);
    remove(&mut running);
    drop(running);
    // The next process knows it.
    let mut running = journal(store, settings());
    running.flush(Instant::ORIGIN, Micros(NOW)).unwrap();
    average_all(&mut running, NOW);
    assert_eq!(note(&mut running), Some(DayState::Finished.lacking()));
    running.store.remove(Part { day: FIRST, number: 2 }).unwrap();
    assert_eq!(of_hour(&mut running.store), [(1, Some(Used::Incomplete)); 2]);
}

#[test]
fn chunks_that_cannot_be_read_make_averages_incomplete() {
    let folder = tempfile::tempdir().unwrap();
    let mut journal = journal(Days::to_write(folder.path(), 1 << 30), settings());
    fill(&mut journal);
    let file = rusqlite::Connection::open(folder.path().join("2026-11-25.db")).unwrap();
    let spoil = "UPDATE chunk SET bytes = x'07' WHERE rowid = (SELECT min(rowid) FROM chunk)";
    assert_eq!(file.execute(spoil, []).unwrap(), 1);
    drop(file);
    average_all(&mut journal, NOW);
    assert_eq!(note(&mut journal), Some(DayState::Finished.lacking()));
    remove(&mut journal);
    assert_eq!(of_hour(&mut journal.store)[1].1, Some(Used::Incomplete));
}

/// A file that is open keeps its room when it is removed.
#[test]
#[cfg(target_os = "linux")]
fn a_file_that_is_removed_is_not_held_open_for_averages() {
    let folder = tempfile::tempdir().unwrap();
    let mut journal = journal(Days::to_write(folder.path(), 1 << 30), settings());
    fill(&mut journal);
    pieces(&mut journal, 2);
    let open = || {
        let links = std::fs::read_dir("/proc/self/fd").unwrap().flatten();
        let links = links.filter_map(|entry| std::fs::read_link(entry.path()).ok());
        let name = folder.path().join("2026-11-25.db").display().to_string();
        links.filter(|link| link.display().to_string().starts_with(&name)).count()
    };
    assert!(open() > 0);
    remove(&mut journal);
    assert_eq!(open(), 0);
    assert!(journal.average(Micros(NOW)).unwrap().is_some());
    assert_eq!(open(), 0);
}

#[test]
fn days_that_became_too_old_while_nothing_ran_wait_for_their_averages() {
    let limits = HistorySettings { keep_days: 1, ..settings() };
    let store = MemoryDays::default();
    let mut running = journal(store.clone(), limits.clone());
    fill(&mut running);
    drop(running);
    let start = at(FIRST + 10, 3_600);
    let mut running = journal(store.clone(), limits.clone());
    running.flush(Instant::ORIGIN, Micros(start)).unwrap();
    running.look_at_limits(Micros(start)).unwrap();
    assert_eq!(running.store.parts().unwrap().len(), 2);
    average_all(&mut running, start);
    running.look_at_limits(Micros(start)).unwrap();
    assert_eq!(running.store.parts().unwrap().len(), 0);
    assert_eq!(running.counts.removed_unaveraged.load(Ordering::Relaxed), 0);
    assert_eq!(note(&mut running), Some(DayState::Cut.whole()));
    // The size comes first.
    fill(&mut running);
    let mut small = journal(store, HistorySettings { max_bytes: 800, ..limits });
    small.flush(Instant::ORIGIN, Micros(start)).unwrap();
    assert_eq!(small.store.parts().unwrap().len(), 0);
}

#[test]
fn a_day_that_goes_on_after_the_clock_was_set_back_shows_its_values() {
    let store = MemoryDays::default();
    let mut running = journal(store.clone(), settings());
    fill(&mut running);
    average_all(&mut running, NOW);
    remove(&mut running);
    running.store.remove(Part { day: FIRST + 1, number: 1 }).unwrap();
    let back = at(FIRST, 21 * 3_600 + 60);
    late(&mut running, 21 * 3_600 + 60, back);
    assert_eq!(note(&mut running), Some(DayState::Reopened.lacking()));
    assert_eq!(of_hour(&mut running.store), [(1, None); 2]);
    // Not even a state from before hides what comes.
    running.store.averages().unwrap().set_state(FIRST, DayState::Cut.whole()).unwrap();
    assert_eq!(of_hour(&mut running.store), [(1, None); 2]);
    // The next process knows of days that its clock has not reached.
    let mut again = journal(store, settings());
    again.flush(Instant::ORIGIN, Micros(at(FIRST - 9, 0))).unwrap();
    assert_eq!(note(&mut again), Some(DayState::Cut.whole()));
}

#[test]
fn averages_are_computed_in_small_pieces() {
    let mut journal = journal(MemoryDays::default(), settings());
    fill(&mut journal);
    journal.look_for_days(FIRST + 1);
    let mut pieces = 0;
    while journal.average(Micros(NOW)).unwrap().is_some() {
        pieces += 1;
    }
    assert_eq!(pieces, 1 + 2 * 12 + 1);
    let answer = answer(&mut journal.store, &question(at(FIRST, 0), NOW, Some(MINUTE)), Vec::new()).unwrap();
    assert!(answer.next.is_none());
}

#[test]
fn a_day_that_fails_again_and_again_holds_up_no_other() {
    let mut journal = journal(MemoryDays::default(), settings());
    fill(&mut journal);
    let begin = at(FIRST + 2, 3_600);
    journal.store.fail(4, false);
    // The disk may fail for ten minutes, however often the day is tried meanwhile.
    for (second, is_given_up) in [(0, false), (1, false), (599, false), (600, true)] {
        journal.look_for_days(FIRST + 2);
        let now = Micros(begin + second * 1_000_000);
        assert!((0..60).any(|_| journal.average(now).is_err()));
        assert_eq!(!journal.averages.given_up.is_empty(), is_given_up, "after {second} s");
    }
    let now = Micros(begin + 600_000_000);
    average_all(&mut journal, now.0);
    assert_eq!(journal.averages.states, BTreeMap::from([(FIRST + 1, DayState::Finished.whole())]));
    assert_eq!(journal.counts.given_up_days.load(Ordering::Relaxed), 1);
}

#[test]
fn a_file_that_is_too_old_turns_no_averages_off() {
    let limits = HistorySettings { keep_minutes_days: 2, keep_hours_days: 40, ..settings() };
    let mut journal = journal(MemoryDays::default(), limits);
    fill(&mut journal);
    journal.store.averages().unwrap().set_state(FIRST - 1, DayState::Finished.whole()).unwrap();
    pieces(&mut journal, 2);
    // 40 days after the last day of the month.
    journal.look_at_limits(Micros(at(20_787 + 40, 3_600))).unwrap();
    assert!(journal.store.averages().unwrap().files().unwrap().is_empty());
    assert!(!journal.averages.is_off);
}

#[test]
fn a_part_older_than_all_averages_leaves_no_trace() {
    let limits = HistorySettings { keep_hours_days: 40, ..settings() };
    let mut journal = journal(MemoryDays::default(), limits);
    fill(&mut journal);
    journal.note_removal(PART, FIRST + 40);
    assert!(journal.store.averages().unwrap().files().unwrap().is_empty());
    assert_eq!(journal.counts.removed_unaveraged.load(Ordering::Relaxed), 0);
    journal.note_removal(PART, FIRST + 39);
    assert_eq!(journal.store.averages().unwrap().files().unwrap()[0].0.step, Step::Hour);
    assert_eq!(journal.counts.removed_unaveraged.load(Ordering::Relaxed), 1);
}
