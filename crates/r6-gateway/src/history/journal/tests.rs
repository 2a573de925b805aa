//! What was acknowledged comes back, whatever happens to the process and the disk.

mod averages;
mod kills;
mod limits;
mod model;
#[cfg(unix)]
mod odd_files;
mod removals;
mod size;

use super::*;
use crate::history::query::{Answer, EventAnswer, EventQuestion, Question, answer, events_of};
use crate::store::history::{Ask, AskEvents, MemoryDays};

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
    batch_of(Interval::LONGEST, samples, counts)
}

pub(super) fn batch_of(
    interval: Interval,
    samples: Vec<(Address, Sample)>,
    counts: &Arc<RobotCounts>,
) -> Batch {
    let time = samples.iter().map(|(_, sample)| sample.time).max().unwrap_or_default();
    Batch {
        robot: press(),
        time,
        samples: samples.into_iter().map(|(address, sample)| (address, interval, sample)).collect(),
        events: Vec::new(),
        counts: Arc::clone(counts),
    }
}

pub(super) fn ask(address: Address, from: i64, to: i64) -> Question {
    let (from, to) = (Micros(from), Micros(to));
    Question { robot: press(), address, from, to, bucket: None, limit: usize::MAX, cursor: None }
}

/// Computes the averages of all days that are over.
pub(super) fn average_all<S: HistoryStore>(journal: &mut Journal<S>, time: i64) {
    journal.look_for_days(Micros(time).day());
    while journal.average(Micros(time)).unwrap().is_some() {}
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
fn a_reader_of_small_pages_misses_no_event_that_comes_late() {
    let store = MemoryDays::default();
    let counts = Arc::<RobotCounts>::default();
    let mut journal = journal(store.clone(), settings());
    let midnight = BASE + 360 * SECOND;
    // A link is lost after midnight; the answer that brings it back was asked for before.
    let times = [midnight - SECOND, midnight + SECOND, midnight - 2 * SECOND, midnight + SECOND, midnight];
    let (mut after, mut read) = (None, Vec::new());
    for (code, time) in (1..).zip(times) {
        let events = vec![began(time, code)];
        journal.take(Instant::ORIGIN, Batch { time: Micros(time), events, ..batch(Vec::new(), &counts) });
        journal.flush(Instant::ORIGIN, Micros(time)).unwrap();
        // It reads while the gateway writes, an event a page.
        let question = EventQuestion {
            robot: press(),
            from: Micros(BASE),
            to: Micros(BASE + 86_400 * SECOND),
            kinds: Vec::new(),
            limit: 1,
            after,
        };
        let EventAnswer { events, next, .. } = events_of(&mut store.clone(), &question).unwrap();
        after = next;
        read.extend(events.into_iter().map(|(_, _, event)| event));
    }
    let codes = read.iter().map(|event| match event.observed {
        Observed::AlarmBegan { code } => code,
        _ => 0,
    });
    assert_eq!(codes.collect::<Vec<_>>(), [1, 2, 3, 4, 5], "{read:#?}");
    let own = read.iter().map(|event| event.true_time.unwrap_or(event.time).0);
    assert_eq!(own.collect::<Vec<_>>(), times);
    assert!(read.windows(2).all(|pair| pair[0].time <= pair[1].time));
}

fn began(time: i64, code: u32) -> Event {
    Event::new(Micros(time), Observed::AlarmBegan { code })
}

/// All events in the store.
pub(super) fn all_events<S: HistoryStore>(store: &mut S) -> Vec<Event> {
    let robot = press();
    let ask = AskEvents { robot: &robot, after: (Micros(0), 0), to: Micros(i64::MAX) };
    let parts: Vec<_> = store.parts().unwrap().into_iter().map(|(part, _)| part).collect();
    let kept = parts.into_iter().flat_map(|part| store.events(part, ask, 1_000_000).unwrap());
    kept.map(|kept| kept.event.unwrap()).collect()
}

#[test]
fn a_disk_that_fails_loses_events_beyond_its_memory_and_says_so() {
    for after in [false, true] {
        let store = MemoryDays::default();
        let counts = Arc::<RobotCounts>::default();
        let mut journal = journal(store.clone(), HistorySettings { memory: 20_000, ..settings() });
        let with = |at: i64, events: Vec<Event>| Batch {
            events,
            ..batch(vec![(Address::CurMode, whole(BASE + at, 1))], &counts)
        };
        store.fail(1_000_000, after);
        for at in 0..200 {
            journal.take(Instant::ORIGIN, with(at, vec![began(BASE + at, 1)]));
            assert!(journal.flush(Instant::ORIGIN, Micros(BASE + at)).is_err());
            assert!(journal.events_size <= 20_000 / EVENT_SHARE + 200, "{}", journal.events_size);
        }
        let (kept, lost) = counts.events();
        assert!(kept > 5 && lost > 100 && kept + lost == 200, "{kept} {lost}");
        store.fail(0, false);
        journal.flush(Instant::ORIGIN, Micros(BASE + 200)).unwrap();
        journal.take(Instant::ORIGIN, with(300, vec![began(BASE + 300, 2)]));
        journal.flush(Instant::ORIGIN, Micros(BASE + 300)).unwrap();
        let first_lost = BASE + i64::try_from(kept).unwrap();
        let (from, to, because) = (Some(Micros(first_lost)), Micros(BASE + 300), UnseenBecause::Lost);
        let gap = Event::new(to, Observed::Unseen { from, to, because });
        let mut expected: Vec<_> = (BASE..first_lost).map(|time| began(time, 1)).collect();
        expected.extend([gap, began(BASE + 300, 2)]);
        assert_eq!(all_events(&mut store.clone()), expected, "each once, and the gap");
        assert_eq!(counts.kept_until(), Some(Micros(BASE + 300)));
    }
}

#[test]
fn a_robot_was_read_last_when_its_last_sample_was() {
    let store = MemoryDays::default();
    let counts = Arc::<RobotCounts>::default();
    let mut first = journal(store.clone(), settings());
    let seen =
        |journal: &mut Journal<_>, robot: &RobotName| journal.last_seen(Instant::ORIGIN, Micros(BASE), robot);
    assert_eq!(seen(&mut first, &press()), Before::Never);
    first.take(Instant::ORIGIN, batch(vec![(Address::CurMode, whole(BASE + 7, 1))], &counts));
    assert_eq!(seen(&mut first, &press()), Before::Seen(Some(Micros(BASE + 7))));
    first.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
    drop(first);
    // It was in a tail.
    let mut second = journal(store.clone(), settings());
    assert_eq!(seen(&mut second, &press()), Before::Seen(Some(Micros(BASE + 7))));
    let saw = RobotName::new("saw").unwrap();
    assert_eq!(seen(&mut second, &saw), Before::Never);
    // A robot that is in none of the newest files may be in an older one.
    for day in 1..5 {
        let time = BASE + day * 86_400 * SECOND;
        let write = Write { events: vec![began(time, 1)], ..Write::default() };
        second.store.write(Micros(time).day(), &[(press(), write)]).unwrap();
    }
    let mut third = journal(store, settings());
    assert_eq!(seen(&mut third, &saw), Before::Seen(None));
}

#[test]
fn little_memory_is_no_loss_while_the_disk_works() {
    let mut store = MemoryDays::default();
    let counts = Arc::<RobotCounts>::default();
    let mut journal = journal(store.clone(), HistorySettings { memory: 10_000, ..settings() });
    let signals = [Address::CurMode, Address::IsMoving, Address::Origin, Address::CurAlarm];
    let time = |at: i64| BASE - 86_000 * SECOND + at * 1000;
    for at in 0..5_000 {
        let samples = signals.map(|address| (address, whole(time(at), at % 7)));
        journal.take(Instant::ORIGIN, batch(samples.into(), &counts));
        if at % 25 == 0 {
            journal.flush(Instant::ORIGIN, Micros(time(at))).unwrap();
        }
        assert!(journal.size < 11_000, "{}", journal.size);
    }
    assert_eq!(counts.now(), (20_000, 0));
    let (part, _) = store.parts().unwrap()[0];
    let robot = press();
    let ask = Ask { robot: &robot, address: signals[0], from: Micros(0), to: Micros(i64::MAX) };
    let small = store.clone().entries(part, ask, usize::MAX).unwrap();
    assert!(small.len() > 5_000 / 512 + 1, "blocks were sealed before they were full: {}", small.len());
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
    let write = |replace_tail, tail| [(press(), Write { replace_tail, tail, ..Write::default() })];
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

#[test]
fn samples_of_a_newer_version_are_left_to_it() {
    let mut store = MemoryDays::default();
    let counts = Arc::<RobotCounts>::default();
    let mut first = journal(store.clone(), settings());
    first.take(Instant::ORIGIN, batch(vec![(Address::CurMode, whole(BASE, 1))], &counts));
    first.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
    drop(first);
    let (part, _) = store.parts().unwrap()[0];
    let mut row = store.tails(part).unwrap().remove(0).rows.remove(0);
    row.truncate(row.len() - 4);
    row[0] += 1;
    row.extend(crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(&row).to_le_bytes());
    let newer = Write { replace_tail: true, tail: Some(row.clone()), ..Write::default() };
    store.write_part(part, &[(press(), newer)]).unwrap();
    // Another robot of the same file, as several gateways have it in one database.
    let saw = RobotName::new("saw").unwrap();
    let mut other = journal(store.clone(), settings());
    other.is_recovered = true;
    let of_saw = batch(vec![(Address::CurMode, whole(BASE, 5))], &counts);
    other.take(Instant::ORIGIN, Batch { robot: saw.clone(), ..of_saw });
    other.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
    drop(other);

    let mut second = journal(store.clone(), settings());
    for at in 1..600 {
        second.take(Instant::ORIGIN, batch(vec![(Address::CurMode, whole(BASE + at, at))], &counts));
        second.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
    }
    let left: Vec<_> = store.tails(part).unwrap().into_iter().map(|tail| (tail.robot, tail.rows)).collect();
    assert_eq!(
        left,
        [(press(), vec![row])],
        "a newer r6 can read it, and that of the other robot was packed"
    );
    let ask = Ask { robot: &saw, address: Address::CurMode, from: Micros(0), to: Micros(i64::MAX) };
    assert_eq!(store.entries(part, ask, 9).unwrap().len(), 1);
    let samples = all(&mut store, Address::CurMode, second.open(&press(), Address::CurMode));
    assert_eq!(samples.len(), 599);
}
