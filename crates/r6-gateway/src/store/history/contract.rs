//! What every store of the history does: one suite for all.

use r6_proto::Address;

use super::{Ask, AskEvents, Days, HistoryStore, MemoryDays, Part};
use crate::core::history::block::{Chunk, Write, chunks};
use crate::core::history::codec::Times;
use crate::core::history::event::{Event, Observed};
use crate::core::history::sample::{Interval, Micros, Sample, State};
use crate::core::name::RobotName;
use crate::store::contract::on_postgres;
use crate::store::postgres::Postgres;
use crate::store::postgres::history::PostgresDays;
use crate::store::postgres::session::Hand;

const DAY: i64 = 86_400_000_000;
const MODE: Address = Address::CurMode;

fn on_each(test: impl Fn(&mut dyn HistoryStore)) {
    test(&mut MemoryDays::default());
    let folder = tempfile::tempdir().unwrap();
    test(&mut Days::to_write(&folder.path().join("history"), 1 << 30));
    on_postgres(|database| {
        drop(Postgres::open(database, Hand::Shell).unwrap());
        test(&mut PostgresDays::new(database, Hand::Shell).unwrap());
    });
}

fn press() -> RobotName {
    RobotName::new("press").unwrap()
}

fn chunk(first: i64, count: i64) -> Chunk {
    let samples: Vec<_> =
        (0..count).map(|at| Sample { time: Micros(first + at), state: State::Integer(at) }).collect();
    chunks(&mut Times::default(), Interval::USUAL, &samples).remove(0)
}

fn with(chunks: &[Chunk], replace_tail: bool, tail: Option<&[u8]>) -> Vec<(RobotName, Write)> {
    let chunks = chunks.iter().map(|chunk| (MODE, chunk.clone())).collect();
    vec![(press(), Write { chunks, replace_tail, tail: tail.map(<[u8]>::to_vec), events: Vec::new() })]
}

fn part(day: i64, number: u32) -> Part {
    Part { day, number }
}

fn firsts(store: &mut dyn HistoryStore, part: Part, from: i64, to: i64, most: usize) -> Vec<i64> {
    let robot = press();
    let ask = Ask { robot: &robot, address: MODE, from: Micros(from), to: Micros(to) };
    let entries = store.entries(part, ask, most).unwrap();
    entries.into_iter().map(|entry| entry.summary.first.0).collect()
}

#[test]
fn chunks_are_found_by_signal_and_begin() {
    on_each(|store| {
        assert_eq!(store.parts(), Ok(vec![]));
        let all = [chunk(50, 3), chunk(10, 5), chunk(30, 1)];
        store.write(0, &with(&all, false, None)).unwrap();
        let day = part(0, 1);
        assert_eq!(firsts(store, day, 0, 100, 10), [10, 30, 50]);
        assert_eq!(firsts(store, day, 10, 50, 10), [10, 30]);
        assert_eq!(firsts(store, day, 0, 100, 2), [10, 30]);
        let (robot, other) = (press(), RobotName::new("saw").unwrap());
        let ask = |robot, address| Ask { robot, address, from: Micros(0), to: Micros(50) };
        assert_eq!(store.entries(day, ask(&other, MODE), 9), Ok(vec![]));
        assert_eq!(store.entries(day, ask(&robot, Address::Origin), 9), Ok(vec![]));
        let last = store.last_entry(day, ask(&robot, MODE)).unwrap().unwrap();
        assert_eq!(last.summary, all[2].summary);
        let entries = store.entries(day, ask(&robot, MODE), 9).unwrap();
        let bytes = store.bytes(day, &[last.row, 99, entries[0].row]).unwrap();
        assert_eq!(bytes, [Some(all[2].bytes.clone()), None, Some(all[1].bytes.clone())]);
    });
}

#[test]
fn a_chunk_that_is_written_again_stays_once() {
    on_each(|store| {
        store.write(0, &with(&[chunk(1, 3)], false, None)).unwrap();
        store.write(0, &with(&[chunk(1, 3), chunk(1, 4)], false, None)).unwrap();
        assert_eq!(firsts(store, part(0, 1), 0, 9, 9), [1, 1]);
    });
}

#[test]
fn tails_grow_and_are_replaced() {
    on_each(|store| {
        let day = part(3, 1);
        store.write(3, &with(&[], false, Some(b"one"))).unwrap();
        store.write(3, &with(&[], false, Some(b"two"))).unwrap();
        let tails = store.tails(day).unwrap();
        assert_eq!((tails.len(), &tails[0].rows), (1, &vec![b"one".to_vec(), b"two".to_vec()]));
        store.write_part(day, &with(&[chunk(3 * DAY, 1)], true, Some(b"three"))).unwrap();
        assert_eq!(store.tails(day).unwrap()[0].rows, [b"three".to_vec()]);
        store.write_part(day, &with(&[], true, None)).unwrap();
        assert_eq!(store.tails(day), Ok(vec![]));
        assert_eq!(firsts(store, day, 0, i64::MAX, 9), [3 * DAY]);
    });
}

fn began(time: i64, code: u32) -> Event {
    Event::new(Micros(time), Observed::AlarmBegan { code })
}

fn with_events(events: &[Event]) -> Vec<(RobotName, Write)> {
    vec![(press(), Write { events: events.to_vec(), ..Write::default() })]
}

/// Times and codes of events behind a place.
fn codes(store: &mut dyn HistoryStore, after: (i64, i64), to: i64, most: usize) -> Vec<(i64, u32)> {
    let robot = press();
    let ask = AskEvents { robot: &robot, after: (Micros(after.0), after.1), to: Micros(to) };
    let kept = store.events(part(0, 1), ask, most).unwrap();
    let code = |event: Event| match event.observed {
        Observed::AlarmBegan { code } => code,
        other => panic!("{other:?}"),
    };
    kept.into_iter().map(|kept| (kept.time.0, code(kept.event.unwrap()))).collect()
}

#[test]
fn events_are_found_by_robot_and_time_and_stay_once() {
    on_each(|store| {
        store.write(0, &with_events(&[began(20, 1), began(10, 2)])).unwrap();
        // Two of the same time, and an event that was written before.
        store.write(0, &with_events(&[began(20, 3), began(20, 1), began(30, 4)])).unwrap();
        let all = [(10, 2), (20, 1), (20, 3), (30, 4)];
        assert_eq!(codes(store, (0, 0), 99, 9), all);
        assert_eq!(codes(store, (0, 0), 30, 9), all[..3]);
        assert_eq!(codes(store, (0, 0), 99, 2), all[..2]);
        assert_eq!(codes(store, (10, 0), 99, 9), all, "from this time on");
        assert_eq!(codes(store, (10, i64::MAX), 99, 9), all[1..], "behind all of this time");
        let robot = press();
        let ask = AskEvents { robot: &robot, after: (Micros(0), 0), to: Micros(99) };
        let second = store.events(part(0, 1), ask, 9).unwrap().remove(1);
        assert_eq!(codes(store, (20, second.row), 99, 9), all[2..], "behind this event");
        let saw = RobotName::new("saw").unwrap();
        assert_eq!(store.events(part(0, 1), AskEvents { robot: &saw, ..ask }, 9), Ok(vec![]));
        assert!(store.parts().unwrap()[0].1 > 0);
        store.remove(part(0, 1)).unwrap();
        assert_eq!(store.parts(), Ok(vec![]));
    });
}

#[test]
fn each_robot_has_the_time_of_its_last_sample() {
    on_each(|store| {
        store.write(0, &with(&[chunk(10, 5), chunk(30, 3)], false, None)).unwrap();
        store
            .write(0, &[(RobotName::new("saw").unwrap(), with(&[chunk(7, 1)], false, None).remove(0).1)])
            .unwrap();
        let mut seen = store.last_seen(part(0, 1)).unwrap();
        seen.sort();
        assert_eq!(seen, [(press(), Micros(32)), (RobotName::new("saw").unwrap(), Micros(7))]);
    });
}

#[test]
fn a_file_without_events_gets_them_and_keeps_its_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = Days::to_write(folder.path(), 1 << 30);
    store.write(0, &with(&[chunk(1, 3)], false, None)).unwrap();
    let mut reader = Days::to_read(folder.path());
    assert_eq!(codes(&mut reader, (0, 0), 99, 9), []);
    store.write(0, &with_events(&[began(5, 42)])).unwrap();
    assert_eq!(codes(&mut reader, (0, 0), 99, 9), [(5, 42)], "the reader need not open it again");
    assert_eq!(firsts(&mut reader, part(0, 1), 0, 100, 9), [1]);
}

#[test]
fn an_event_that_was_changed_is_told_as_unreadable() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = Days::to_write(folder.path(), 1 << 30);
    store.write(0, &with_events(&[began(5, 42), began(6, 43)])).unwrap();
    let connection = rusqlite::Connection::open(folder.path().join("1970-01-01.db")).unwrap();
    connection.execute("UPDATE event SET text = replace(text, '42', '41')", []).unwrap();
    let robot = press();
    let ask = AskEvents { robot: &robot, after: (Micros(0), 0), to: Micros(99) };
    let read: Vec<_> = store.events(part(0, 1), ask, 9).unwrap().into_iter().map(|kept| kept.event).collect();
    assert_eq!(read, [None, Some(began(6, 43))]);
}

#[test]
fn days_have_files_and_large_ones_have_parts() {
    on_each(|store| {
        store.write(5, &with(&[chunk(5 * DAY, 1)], false, None)).unwrap();
        store.write(4, &with(&[chunk(4 * DAY, 1)], false, None)).unwrap();
        store.begin_part(5).unwrap();
        store.write(5, &with(&[chunk(5 * DAY + 9, 1)], false, None)).unwrap();
        store.write(4, &with(&[chunk(4 * DAY + 9, 1)], false, None)).unwrap();
        let parts = store.parts().unwrap();
        assert_eq!(
            parts.iter().map(|(part, _)| *part).collect::<Vec<_>>(),
            [part(4, 1), part(5, 1), part(5, 2)]
        );
        assert!(parts.iter().all(|(_, size)| *size > 0));
        assert_eq!(firsts(store, part(5, 2), 0, i64::MAX, 9), [5 * DAY + 9]);
        assert_eq!(firsts(store, part(4, 1), 0, i64::MAX, 9).len(), 2);
        store.remove(part(5, 1)).unwrap();
        store.remove(part(5, 1)).unwrap();
        store.write(5, &with(&[chunk(5 * DAY + 10, 1)], false, None)).unwrap();
        let parts = store.parts().unwrap();
        assert_eq!(parts.iter().map(|(part, _)| *part).collect::<Vec<_>>(), [part(4, 1), part(5, 2)]);
        assert_eq!(firsts(store, part(5, 2), 0, i64::MAX, 9).len(), 2);
    });
}

#[test]
fn a_reader_sees_what_was_written_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut reader = Days::to_read(folder.path());
    assert_eq!(reader.parts(), Ok(vec![]));
    let mut store = Days::to_write(folder.path(), 1 << 30);
    for at in 0..20 {
        store.write(0, &with(&[chunk(at, 1)], false, None)).unwrap();
        assert_eq!(firsts(&mut reader, part(0, 1), 0, 100, 99).len() as i64, at + 1);
    }
    assert!(reader.write(0, &with(&[chunk(100, 1)], false, None)).is_err());
    // The file goes away under the reader, and comes again.
    store.remove(part(0, 1)).unwrap();
    store.write(0, &with(&[chunk(7, 1)], false, None)).unwrap();
    let mut reader = Days::to_read(folder.path());
    assert_eq!(firsts(&mut reader, part(0, 1), 0, 100, 99), [7]);
    #[cfg(unix)]
    for entry in std::fs::read_dir(folder.path()).unwrap() {
        use std::os::unix::fs::PermissionsExt;
        let entry = entry.unwrap();
        let mode = entry.metadata().unwrap().permissions().mode();
        assert_eq!(mode & 0o077, 0, "{:?} is for its owner alone", entry.path());
    }
}

#[test]
fn files_of_a_removed_part_are_not_taken_for_those_of_a_new_one() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = Days::to_write(folder.path(), 1 << 30);
    store.write(0, &with(&[chunk(1, 3)], false, None)).unwrap();
    let log = folder.path().join("1970-01-01.db-wal");
    let kept = std::fs::read(&log).unwrap();
    assert!(!kept.is_empty());
    store.remove(part(0, 1)).unwrap();
    // As if the process had ended before it removed the log.
    std::fs::write(&log, kept).unwrap();
    let mut store = Days::to_write(folder.path(), 1 << 30);
    store.write(0, &with(&[chunk(2, 3)], false, None)).unwrap();
    assert_eq!(firsts(&mut store, part(0, 1), 0, 100, 9), [2]);
}

#[test]
fn many_days_are_open_one_after_the_other() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = Days::to_write(folder.path(), 1 << 30);
    for _ in 0..2 {
        for day in 0..5 {
            store.write(day, &with(&[chunk(day * DAY, 1)], true, Some(b"tail"))).unwrap();
        }
    }
    for day in 0..5 {
        assert_eq!(firsts(&mut store, part(day, 1), 0, i64::MAX, 9), [day * DAY]);
    }
    let logs = std::fs::read_dir(folder.path())
        .unwrap()
        .filter(|entry| entry.as_ref().unwrap().file_name().to_string_lossy().ends_with("-wal"));
    assert!(logs.count() <= 2, "days that are over have no log");
}
