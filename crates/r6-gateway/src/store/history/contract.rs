//! What every store of the history does: one suite for all.

use r6_proto::Address;

use super::{
    Ask, AskAverages, AskEvents, AverageFile, AverageRow, DayState, Days, HistoryStore, MemoryDays, Part,
};
use crate::core::history::averages::Step;
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

fn row(robot: &str, address: Address, bytes: &[u8]) -> AverageRow {
    AverageRow { robot: RobotName::new(robot).unwrap(), address, bytes: bytes.to_vec() }
}

/// The averages of the mode of the press in the file of a day.
fn averages(store: &mut dyn HistoryStore, step: Step, day: i64, from: i64, to: i64) -> Vec<(i64, Vec<u8>)> {
    let robot = press();
    let ask = AskAverages { robot: &robot, address: MODE, from, to };
    store.averages().unwrap().read(AverageFile::of(step, day), ask).unwrap()
}

#[test]
fn averages_are_found_by_signal_and_day_and_take_the_place_of_older_ones() {
    on_each(|store| {
        // The database keeps none.
        let Some(of) = store.averages() else { return };
        assert_eq!(of.files(), Ok(vec![]));
        let (first, last) = (20_758, 20_787);
        for (day, text) in [(first, "one"), (first + 3, "two"), (last, "three"), (last + 1, "next month")] {
            let all = [row("press", MODE, text.as_bytes()), row("press", Address::Origin, b"other")];
            of.write(Step::Hour, day, &all).unwrap();
            of.write(Step::Minute, day, &all[..1]).unwrap();
        }
        of.write(Step::Hour, first, &[row("saw", MODE, b"saw"), row("press", MODE, b"anew")]).unwrap();
        let of_month = [(first, b"anew".to_vec()), (first + 3, b"two".to_vec()), (last, b"three".to_vec())];
        assert_eq!(averages(store, Step::Hour, last, 0, 99_999), of_month);
        assert_eq!(averages(store, Step::Hour, first, first + 1, first + 3), of_month[1..2]);
        assert_eq!(averages(store, Step::Minute, first, 0, 99_999), [(first, b"one".to_vec())]);
        assert_eq!(averages(store, Step::Minute, first + 1, 0, 99_999), [], "there is no such file");
        assert_eq!(store.parts(), Ok(vec![]), "they are no values");

        let of = store.averages().unwrap();
        let files = of.files().unwrap();
        assert!(files.iter().all(|(_, bytes)| *bytes > 0) && files.is_sorted());
        let days: Vec<_> = files.iter().map(|(file, _)| (file.step, file.first)).collect();
        let minutes = [first, first + 3, last, last + 1].map(|day| (Step::Minute, day));
        assert_eq!(days, [&minutes[..], &[(Step::Hour, first), (Step::Hour, last + 1)]].concat());
        of.remove(files[0].0).unwrap();
        of.remove(files[0].0).unwrap();
        assert_eq!(of.files().unwrap().len(), files.len() - 1);
        assert_eq!(averages(store, Step::Minute, first, 0, 99_999), []);
    });
}

#[test]
fn each_day_has_a_state_that_changes() {
    on_each(|store| {
        let Some(of) = store.averages() else { return };
        let all = [
            (20_782, DayState::Finished.whole()),
            (20_783, DayState::Cut.lacking()),
            (20_788, DayState::Reopened.whole()),
            (20_789, DayState::Pending.lacking()),
        ];
        all.into_iter().for_each(|(day, note)| of.set_state(day, note).unwrap());
        assert_eq!(of.states(0..=99_999).unwrap(), all.into());
        assert_eq!(of.states(20_783..=20_787).unwrap(), [all[1]].into());
        of.set_state(20_782, DayState::Cut.whole()).unwrap();
        assert_eq!(of.states(20_782..=20_782).unwrap(), [(20_782, DayState::Cut.whole())].into());
    });
}

#[test]
fn a_part_names_its_signals_to_the_one_that_averages() {
    on_each(|store| {
        store.write(0, &with(&[chunk(1, 3)], false, Some(b"tail"))).unwrap();
        let Some(mut reader) = store.to_average() else { return };
        assert_eq!(reader.signals(part(0, 1)), Ok(vec![(press(), MODE)]));
        assert_eq!(firsts(&mut *reader, part(0, 1), 0, 9, 9), [1]);
        store.write(0, &with(&[chunk(4, 3)], false, None)).unwrap();
        assert_eq!(firsts(&mut *reader, part(0, 1), 0, 9, 9), [1, 4]);
    });
}

#[test]
fn averages_stay_in_the_folder_and_an_older_gateway_sees_its_own_files_alone() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = Days::to_write(folder.path(), 1 << 30);
    store.write(20_782, &with(&[chunk(20_782 * DAY, 1)], false, None)).unwrap();
    let of = store.averages().unwrap();
    of.write(Step::Minute, 20_782, &[row("press", MODE, b"minutes")]).unwrap();
    of.write(Step::Hour, 20_782, &[row("press", MODE, b"hours")]).unwrap();
    of.set_state(20_782, DayState::Finished.whole()).unwrap();
    drop(store);
    let names = super::file_names(folder.path()).unwrap();
    assert_eq!(names, ["2026-11-25.db", "hours-2026-11.db", "minutes-2026-11-25.db"]);
    assert!(names.iter().all(|name| super::is_file_name(name)));
    let mut reader = Days::to_read(folder.path());
    assert_eq!(averages(&mut reader, Step::Minute, 20_782, 0, 99_999), [(20_782, b"minutes".to_vec())]);
    assert_eq!(averages(&mut reader, Step::Hour, 20_782, 0, 99_999), [(20_782, b"hours".to_vec())]);
    let of = reader.averages().unwrap();
    assert_eq!(of.states(0..=99_999).unwrap().len(), 1);
    assert!(of.write(Step::Hour, 20_782, &[row("press", MODE, b"more")]).is_err(), "a reader never writes");
    // Bytes that are no file of SQLite.
    std::fs::write(folder.path().join("hours-2026-12.db"), vec![7; 9_000]).unwrap();
    let of = reader.averages().unwrap();
    assert_eq!(of.states(0..=99_999).unwrap().len(), 1, "it is passed over");
    let robot = press();
    let ask = AskAverages { robot: &robot, address: MODE, from: 0, to: 99_999 };
    let broken = of.read(AverageFile::of(Step::Hour, 20_790), ask);
    assert!(matches!(broken, Err(crate::store::StoreError::Unreadable(_))), "{broken:?}");
}
