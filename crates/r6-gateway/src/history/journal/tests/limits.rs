//! The bounds of the files, and a disk without room.

use std::path::Path;

use super::*;
use crate::core::history::averages::Step;
use crate::store::history::Days;

fn size(folder: &Path) -> u64 {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    entries.map(|entry| entry.unwrap().metadata().map_or(0, |file| file.len())).sum()
}

/// Numbers that no codec makes smaller.
fn noise(seed: &mut u64) -> i64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed ^ *seed >> 29).cast_signed()
}

#[test]
fn all_files_together_never_take_more_than_they_may() {
    let folder = tempfile::tempdir().unwrap();
    let max_bytes = 6 * 1024 * 1024;
    let counts = Arc::<RobotCounts>::default();
    let mut running =
        journal(Days::to_write(folder.path(), max_bytes), HistorySettings { max_bytes, ..settings() });
    let (mut time, mut largest, mut seed) = (BASE, 0, 1);
    let begun = BASE;
    for _ in 0..250 {
        let samples = (0..5_000).map(|_| {
            time += 20_000;
            (Address::CurMode, whole(time, noise(&mut seed)))
        });
        running.take(Instant::ORIGIN, batch(samples.collect(), &counts));
        running.flush(Instant::ORIGIN, Micros(time)).unwrap();
        let size = size(folder.path());
        largest = largest.max(size);
        assert!(size <= max_bytes, "{size}");
    }
    assert!(largest > max_bytes / 2, "{largest}: the room is used");
    assert!(running.counts.removed.load(Ordering::Relaxed) > 3);
    let seen = answer(&mut running.store, &ask(Address::CurMode, begun, time + 1), Vec::new()).unwrap();
    // The end is there, the begin is not.
    let Question { from, to, .. } = ask(Address::CurMode, time - 100 * SECOND, time + 1);
    let open = running.open(&press(), Address::CurMode);
    let question = Question { from, to, ..ask(Address::CurMode, 0, 0) };
    let end = answer(&mut running.store, &question, open).unwrap();
    assert!(end.samples.len() >= 5_000, "{}", end.samples.len());
    assert!(seen.samples.first().is_none_or(|first| first.time.0 > begun + 1_000 * SECOND));
}

#[test]
fn days_beyond_the_limit_are_removed_and_today_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let counts = Arc::<RobotCounts>::default();
    let limits = HistorySettings { keep_days: 3, ..settings() };
    let mut running = journal(Days::to_write(folder.path(), limits.max_bytes), limits);
    let mode = Address::CurMode;
    for day in 0..6 {
        let time = BASE + day * 86_400 * SECOND;
        running.take(Instant::ORIGIN, batch(vec![(mode, whole(time, day))], &counts));
        running.flush(Instant::ORIGIN, Micros(time)).unwrap();
        average_all(&mut running, time);
        running.look_at_limits(Micros(time)).unwrap();
    }
    let days: Vec<_> = running.store.parts().unwrap().into_iter().map(|(part, _)| part.day).collect();
    let today = Micros(BASE).day() + 5;
    assert_eq!(days, [today - 2, today - 1, today]);
    assert_eq!(running.counts.oldest_day.load(Ordering::Relaxed), today - 2);
    // Something comes for a day that is over: it is not kept for longer than the others.
    running.take(Instant::ORIGIN, batch(vec![(mode, whole(BASE, 0))], &counts));
    running.flush(Instant::ORIGIN, Micros(BASE + 5 * 86_400 * SECOND)).unwrap();
    running.look_at_limits(Micros(BASE + 5 * 86_400 * SECOND)).unwrap();
    assert_eq!(running.store.parts().unwrap().len(), 3);
}

#[test]
fn a_disk_with_too_little_room_is_left_to_the_audit_log() {
    let folder = tempfile::tempdir().unwrap();
    let counts = Arc::<RobotCounts>::default();
    let limits = HistorySettings { min_free: u64::MAX, ..settings() };
    let mut running = journal(Days::to_write(folder.path(), limits.max_bytes), limits);
    for at in 0..3 {
        running.take(Instant::ORIGIN, batch(vec![(Address::CurMode, whole(BASE + at, at))], &counts));
        let error = running.flush(Instant::ORIGIN, Micros(BASE)).unwrap_err();
        assert!(error.to_string().contains("bytes are free"), "{error}");
        assert_eq!(size(folder.path()), 0);
    }
    running.settings.min_free = 0;
    running.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
    assert_eq!(
        all(
            &mut running.store,
            Address::CurMode,
            running.robots[&press()].blocks.samples(Address::CurMode).unwrap()
        )
        .len(),
        3
    );
}

#[test]
fn a_full_file_loses_nothing_that_fits_into_memory() {
    let folder = tempfile::tempdir().unwrap();
    let counts = Arc::<RobotCounts>::default();
    let mut store = Days::to_write(folder.path(), 1 << 30);
    store.max_pages = Some(10);
    let mut running = journal(store, settings());
    let (mut time, mut seed, mut failed) = (BASE - 86_000 * SECOND, 7, 0);
    let mut sent = Vec::new();
    for round in 0..200 {
        let samples: Vec<_> = (0..100)
            .map(|_| {
                time += 1_000;
                (Address::CurMode, whole(time, noise(&mut seed)))
            })
            .collect();
        sent.extend(samples.iter().map(|(_, sample)| sample.clone()));
        running.take(Instant::ORIGIN, batch(samples, &counts));
        failed += u32::from(running.flush(Instant::ORIGIN, Micros(time)).is_err());
        if round == 150 {
            assert!(failed > 50, "{failed}");
            // Somebody makes room.
            running.store.max_pages = Some(1_000_000);
            running.flush(Instant::ORIGIN, Micros(time)).unwrap();
            failed = 0;
        }
    }
    assert_eq!((failed, counts.now().1), (0, 0));
    assert_eq!(counts.kept_until(), Some(Micros(time)));
    drop(running);
    // What was acknowledged is there after a new start.
    let mut again = journal(Days::to_write(folder.path(), 1 << 30), settings());
    again.flush(Instant::ORIGIN, Micros(time)).unwrap();
    assert_eq!(all(&mut again.store, Address::CurMode, Vec::new()), sent);
}

#[test]
fn a_file_that_cannot_be_read_does_not_stop_the_history() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("2026-11-25.db"), vec![7; 9_000]).unwrap();
    let counts = Arc::<RobotCounts>::default();
    let mut running = journal(Days::to_write(folder.path(), 1 << 30), settings());
    running.take(Instant::ORIGIN, batch(vec![(Address::CurMode, whole(BASE, 1))], &counts));
    running.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
    assert!(folder.path().join("2026-11-25-2.db").exists());
}

/// Days of numbers that no codec makes smaller, once a minute, and their averages. Returns the files of
/// minutes and of hours that are left.
fn days_of_noise(signals: u32, days: i64, max_bytes: u64) -> (usize, usize, Arc<HistoryCounts>) {
    let folder = tempfile::tempdir().unwrap();
    let counts = Arc::<RobotCounts>::default();
    let limits = HistorySettings { max_bytes, ..settings() };
    let mut running = journal(Days::to_write(folder.path(), max_bytes), limits);
    let signals: Vec<_> =
        (0..signals).map(|at| Address::parse(&format!("Addr-{}", 800 + at)).unwrap()).collect();
    let begun = BASE - BASE.rem_euclid(86_400 * SECOND);
    let mut seed = 1;
    for hour in 0..days * 24 {
        let begun = begun + hour * 3_600 * SECOND;
        for time in (0..60).map(|minute| begun + minute * 60 * SECOND) {
            let samples = signals.iter().map(|address| (*address, whole(time, noise(&mut seed) >> 1)));
            running.take(Instant::ORIGIN, batch_of(Interval::USUAL, samples.collect(), &counts));
        }
        let now = Micros(begun + 3_600 * SECOND);
        running.flush(Instant::ORIGIN, now).unwrap();
        running.look_at_limits(now).unwrap();
        while running.average(now).unwrap().is_some() {
            running.flush(Instant::ORIGIN, now).unwrap();
            let size = size(folder.path());
            assert!(size <= max_bytes, "{size}");
        }
    }
    let files = running.store.averages().unwrap().files().unwrap();
    let bytes: u64 = files.iter().map(|(_, bytes)| bytes).sum();
    assert!(bytes < max_bytes / 2, "{bytes}: values have the rest");
    let minutes = files.iter().filter(|(file, _)| file.step == Step::Minute).count();
    (minutes, files.len() - minutes, Arc::clone(&running.counts))
}

#[test]
fn averages_take_their_share_and_all_files_together_no_more_than_they_may() {
    let (minutes, hours, counts) = days_of_noise(10, 9, 8 * 1024 * 1024);
    assert!((1..=3).contains(&minutes) && hours > 0, "{minutes} {hours}");
    let of = |count: &std::sync::atomic::AtomicU64| count.load(Ordering::Relaxed);
    assert!(of(&counts.removed_averages) >= 4);
    assert!(of(&counts.average_bytes) > 0 && of(&counts.average_bytes) <= 2 * 1024 * 1024);
    assert!(of(&counts.averaged_days) >= 7);
    assert_eq!(of(&counts.removed_unaveraged), 0);
}

#[test]
fn minutes_of_a_day_that_are_more_than_the_share_are_given_up_and_hours_are_kept() {
    let (minutes, hours, counts) = days_of_noise(50, 4, 8 * 1024 * 1024);
    assert_eq!(minutes, 0);
    assert!(hours > 0);
    assert!(counts.averaged_days.load(Ordering::Relaxed) >= 2);
}
