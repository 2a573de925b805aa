//! What was acknowledged comes back, whatever happens to the process and the disk.

mod kills;
mod limits;
mod model;
#[cfg(unix)]
mod odd_files;
mod size;

use super::*;
use crate::history::query::{Answer, Question, answer};
use crate::store::history::MemoryDays;

pub(super) const SECOND: i64 = 1_000_000;
/// Six minutes before a midnight.
pub(super) const BASE: i64 = 20_782 * 86_400 * SECOND + 86_040 * SECOND;

pub(super) fn press() -> RobotName {
    RobotName::new("press").unwrap()
}

pub(super) fn settings() -> HistorySettings {
    HistorySettings { min_free: 0, ..HistorySettings::default() }
}

pub(super) fn journal<S: HistoryStore>(store: S, settings: HistorySettings) -> Journal<S> {
    Journal::new(store, settings, Arc::default())
}

pub(super) fn whole(time: i64, number: i64) -> Sample {
    Sample { time: Micros(time), state: State::Integer(number) }
}

pub(super) fn batch(samples: Vec<(Address, Sample)>, counts: &Arc<RobotCounts>) -> Batch {
    let time = samples.iter().map(|(_, sample)| sample.time).max().unwrap_or_default();
    Batch { robot: press(), time, interval: Interval::LONGEST, samples, counts: Arc::clone(counts) }
}

pub(super) fn ask(address: Address, from: i64, to: i64) -> Question {
    let (from, to) = (Micros(from), Micros(to));
    Question { robot: press(), address, from, to, bucket: None, limit: usize::MAX, cursor: None }
}

/// All samples of a signal, without the marks that the query adds.
pub(super) fn all<S: HistoryStore>(
    store: &mut S,
    address: Address,
    open: Vec<(Interval, Vec<Sample>)>,
) -> Vec<Sample> {
    let mut question = ask(address, BASE - 86_400 * SECOND, BASE + 3 * 86_400 * SECOND);
    let mut all = Vec::new();
    loop {
        let Answer { samples, unreadable, next, .. } = answer(store, &question, open.clone()).unwrap();
        assert_eq!(unreadable, 0);
        all.extend(samples);
        question.cursor = next;
        if next.is_none() {
            break;
        }
    }
    all.into_iter().filter(|sample| sample.state.gap() != Some(Gap::NoData)).collect()
}

#[test]
fn a_disk_that_fails_loses_nothing_while_memory_lasts_and_then_says_what() {
    for after in [false, true] {
        let store = MemoryDays::default();
        let counts = Arc::<RobotCounts>::default();
        let mut journal = journal(store.clone(), HistorySettings { memory: 20_000, ..settings() });
        let mode = Address::CurMode;
        let now = Instant::ORIGIN;
        let time = |at: i64| BASE - 86_000 * SECOND + at * 1000;
        store.fail(1_000_000, after);
        let (mut kept, mut lost) = (0, 0);
        for at in 0..20_000_i64 {
            // Numbers that do not get small.
            let number = at.wrapping_mul(0x5851_F42D_4C95_7F2D);
            let number = (number ^ (number >> 29)).wrapping_mul(0x2545_F491_4F6C_DD1D);
            journal.take(now, batch(vec![(mode, whole(time(at), number))], &counts));
            if at % 50 == 0 {
                assert!(journal.flush(now, Micros(time(at))).is_err());
                assert!(journal.counts.paused.load(Ordering::Relaxed));
                assert_eq!(counts.kept_until(), None, "nothing is said to be kept");
            }
            assert!(journal.size < 25_000, "{}", journal.size);
            (kept, lost) = counts.now();
        }
        assert!(kept > 500 && lost > 10_000, "{kept} {lost}");
        assert_eq!(kept + lost, 20_000);
        store.fail(0, false);
        journal.flush(now, Micros(time(20_000))).unwrap();
        assert!(!journal.counts.paused.load(Ordering::Relaxed));
        // The next sample comes with the gap before it.
        journal.take(now, batch(vec![(mode, whole(time(20_000), 1))], &counts));
        journal.flush(now, Micros(time(20_001))).unwrap();
        assert_eq!(counts.kept_until(), Some(Micros(time(20_000))));
        let samples = all(&mut store.clone(), mode, journal.open(&press(), mode));
        let gaps: Vec<_> = samples.iter().filter(|sample| sample.state.gap().is_some()).collect();
        assert_eq!((gaps.len(), gaps[0].state.gap()), (1, Some(Gap::Lost)));
        assert_eq!(
            gaps[0].time.0,
            time(i64::try_from(kept).unwrap()),
            "it begins with the first lost sample"
        );
        assert_eq!(samples.len() as u64, kept + 2);
    }
}

#[test]
fn little_memory_is_no_loss_while_the_disk_works() {
    let store = MemoryDays::default();
    let counts = Arc::<RobotCounts>::default();
    let mut journal = journal(store.clone(), HistorySettings { memory: 50_000, ..settings() });
    let signals = [Address::CurMode, Address::IsMoving, Address::Origin, Address::CurAlarm];
    let time = |at: i64| BASE - 86_000 * SECOND + at * 1000;
    for at in 0..5_000 {
        let samples = signals.map(|address| (address, whole(time(at), at % 7)));
        journal.take(Instant::ORIGIN, batch(samples.into(), &counts));
        if at % 25 == 0 {
            journal.flush(Instant::ORIGIN, Micros(time(at))).unwrap();
        }
        assert!(journal.size < 60_000, "{}", journal.size);
    }
    assert_eq!(counts.now(), (20_000, 0));
    for address in signals {
        let samples = all(&mut store.clone(), address, journal.open(&press(), address));
        assert_eq!(samples.len(), 5_000, "{address}");
    }
}

#[test]
fn a_row_that_was_changed_costs_what_is_in_it_and_nothing_else() {
    let mut store = MemoryDays::default();
    let counts = Arc::<RobotCounts>::default();
    let mut first = journal(store.clone(), settings());
    for at in 0..3 {
        first.take(Instant::ORIGIN, batch(vec![(Address::CurMode, whole(BASE + at, at))], &counts));
        first.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
    }
    drop(first);
    let (part, _) = store.parts().unwrap()[0];
    let mut rows = store.tails(part).unwrap().remove(0).rows;
    rows[1][3] ^= 1;
    let write = |replace_tail, tail| [(press(), Write { chunks: Vec::new(), replace_tail, tail })];
    store.write_part(part, &write(true, None)).unwrap();
    for row in rows {
        store.write_part(part, &write(false, Some(row))).unwrap();
    }
    let mut second = journal(store.clone(), settings());
    second.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
    assert_eq!(second.counts.unreadable.load(Ordering::Relaxed), 1);
    let samples = all(&mut store, Address::CurMode, Vec::new());
    assert_eq!(samples, [whole(BASE, 0), whole(BASE + 2, 2)]);
}
