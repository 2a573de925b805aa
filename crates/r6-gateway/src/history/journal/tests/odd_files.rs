//! What has the name of a file of the history, and is none of ours.

use std::os::unix::fs::symlink;
use std::path::Path;

use rusqlite::Connection;

use super::*;
use crate::store::history::Days;

/// Makes what stands where a file of a day would be.
type Make = fn(&Path);

const KINDS: [(&str, Make); 7] = [
    ("a folder", |path| std::fs::create_dir(path).unwrap()),
    ("a link to itself", |path| symlink(path, path).unwrap()),
    ("a pipe", |path| {
        let made = std::process::Command::new("mkfifo").arg(path).status().unwrap();
        assert!(made.success());
    }),
    ("garbage", |path| std::fs::write(path, "no database").unwrap()),
    ("of a newer version", |path| {
        Connection::open(path).unwrap().pragma_update(None, "user_version", 7).unwrap();
    }),
    ("without its tables", |path| {
        Connection::open(path).unwrap().pragma_update(None, "user_version", 1).unwrap();
    }),
    ("with a broken page", |path| {
        let folder = tempfile::tempdir().unwrap();
        let mut store = Days::to_write(folder.path(), 1 << 30);
        let counts = Arc::<RobotCounts>::default();
        let mut first = journal(Days::to_write(folder.path(), 1 << 30), settings());
        first.take(Instant::ORIGIN, batch(vec![(Address::CurMode, whole(BASE, 1))], &counts));
        first.seal_all();
        first.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
        drop(first);
        let (part, _) = store.parts().unwrap()[0];
        drop(store);
        assert_eq!(part.number, 1);
        let file =
            std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).min().unwrap();
        let mut bytes = std::fs::read(file).unwrap();
        // All pages behind the first, which has the list of the tables.
        bytes[16 * 1024..].fill(0xA5);
        std::fs::write(path, bytes).unwrap();
    }),
];

#[test]
fn an_odd_file_is_left_alone_and_the_history_goes_on() {
    for (what, make) in KINDS {
        for name in ["2026-11-25.db", "2026-11-20.db", "2020-01-01.db"] {
            let folder = tempfile::tempdir().unwrap();
            make(&folder.path().join(name));
            let counts = Arc::<RobotCounts>::default();
            let mut running = journal(Days::to_write(folder.path(), 1 << 30), settings());
            running.take(Instant::ORIGIN, batch(vec![(Address::CurMode, whole(BASE, 5))], &counts));
            // The first attempt may find that the file is broken.
            let first = running.flush(Instant::ORIGIN, Micros(BASE));
            let second = running.flush(Instant::ORIGIN, Micros(BASE));
            assert_eq!(second.as_ref().ok(), Some(&()), "{what}, {name}: {first:?}, {second:?}");
            assert_eq!(counts.kept_until(), Some(Micros(BASE)), "{what}, {name}");
            running.seal_all();
            running.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
            let question = ask(Address::CurMode, BASE - 86_400 * SECOND, BASE + SECOND);
            let found = answer(&mut Days::to_read(folder.path()), &question, Vec::new()).unwrap();
            let found: Vec<_> = found.samples.iter().filter(|sample| sample.state.gap().is_none()).collect();
            assert_eq!(found, [&whole(BASE, 5)], "{what}, {name}");
        }
    }
}

#[test]
fn days_that_are_not_yet_go_first_and_today_last() {
    let folder = tempfile::tempdir().unwrap();
    let max_bytes = 4 * 1024 * 1024;
    std::fs::write(folder.path().join("2027-01-01.db"), vec![0; 3 * 1024 * 1024]).unwrap();
    let counts = Arc::<RobotCounts>::default();
    let mut running =
        journal(Days::to_write(folder.path(), max_bytes), HistorySettings { max_bytes, ..settings() });
    let (mut time, mut seed) = (BASE, 1_u64);
    for _ in 0..40 {
        let samples = (0..2_000).map(|_| {
            time += 2_000;
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (Address::CurMode, whole(time, (seed ^ seed >> 29).cast_signed()))
        });
        running.take(Instant::ORIGIN, batch(samples.collect(), &counts));
        running.flush(Instant::ORIGIN, Micros(time)).unwrap();
    }
    let names: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".db"))
        .collect();
    assert!(!names.contains(&"2027-01-01.db".to_owned()), "{names:?}");
    assert!(names.len() > 1 && names.iter().all(|name| name.starts_with("2026-11-25")), "{names:?}");
}
