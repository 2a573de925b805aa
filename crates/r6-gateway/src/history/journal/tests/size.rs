//! Bytes for each sample, beside plain rows of SQLite. To see the numbers:
//! `cargo nextest run -p r6-gateway -E 'test(bytes_per_sample)' --no-capture`.

use rusqlite::{Connection, params};

use super::*;
use crate::core::history::change::ChangeOnly;
use crate::store::history::Days;

/// Readings of an arm as a controller prints them: six axes and six parts of a pose, six decimals. It is read
/// ten times a second, at times that jitter by a millisecond. It moves for 3 s, and stands for `rest`
/// seconds.
fn arm(seconds: i64, rest: i64) -> Vec<(Address, Sample)> {
    let signals: Vec<Address> = (0..6)
        .flat_map(|at| [format!("axis-{at}"), format!("world-{at}")])
        .map(|name| Address::parse(&name).unwrap())
        .collect();
    let mut filters: Vec<_> = signals
        .iter()
        .map(|address| ChangeOnly::new(Interval::USUAL, HistorySettings::usual_deadband(*address)))
        .collect();
    let mut seed = 88_172_645_463_325_252_u64;
    let mut kept = Vec::new();
    for poll in 0..seconds * 10 {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        let jitter = i64::try_from(seed % 2_000).unwrap() - 1_000;
        let time = poll * 100_000 + jitter;
        let cycle = 3 + rest;
        let (turn, within) = (time.div_euclid(cycle * SECOND), time.rem_euclid(cycle * SECOND) as f64 / 1e6);
        // A move without a jump of speed or acceleration.
        let part = (within / 3.0).min(1.0);
        let smooth = part * part * part * (10.0 - 15.0 * part + 6.0 * part * part);
        for (number, address) in signals.iter().enumerate() {
            let at = |turn: i64| {
                let place = (turn * 7 + number as i64 * 3).rem_euclid(11) as f64;
                if number % 2 == 0 { place * 12.0 - 60.0 } else { place * 60.0 - 300.0 }
            };
            let value = at(turn) + (at(turn + 1) - at(turn)) * smooth;
            let printed: f64 = format!("{value:.6}").parse().unwrap();
            let kept_time = Micros(BASE - 86_000 * SECOND + time).kept();
            let sample = filters[number].take(kept_time, State::Decimal(printed));
            kept.extend(sample.map(|sample| (*address, sample)));
        }
    }
    kept
}

fn in_chunks(samples: &[(Address, Sample)]) -> u64 {
    let folder = tempfile::tempdir().unwrap();
    let counts = Arc::<RobotCounts>::default();
    let mut running = journal(Days::to_write(folder.path(), 1 << 30), settings());
    let polls = samples.chunk_by(|(_, one), (_, next)| one.time == next.time);
    for (number, poll) in polls.enumerate() {
        running.take(Instant::ORIGIN, batch_of(Interval::USUAL, poll.to_vec(), &counts));
        if number % 25 == 0 {
            running.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
        }
    }
    running.seal_all();
    running.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
    drop(running);
    size_of_folder(folder.path())
}

fn in_rows(samples: &[(Address, Sample)]) -> u64 {
    let folder = tempfile::tempdir().unwrap();
    let mut plain = Connection::open(folder.path().join("plain.db")).unwrap();
    plain
        .execute_batch("CREATE TABLE sample (robot INTEGER, signal INTEGER, time INTEGER, value REAL)")
        .unwrap();
    let transaction = plain.transaction().unwrap();
    let mut insert = transaction.prepare("INSERT INTO sample VALUES (1, ?1, ?2, ?3)").unwrap();
    for (address, sample) in samples {
        let signal = address.to_string().len();
        insert.execute(params![signal, sample.time.0, sample.state.number()]).unwrap();
    }
    drop(insert);
    transaction.commit().unwrap();
    drop(plain);
    size_of_folder(folder.path())
}

fn size_of_folder(folder: &std::path::Path) -> u64 {
    std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().metadata().unwrap().len()).sum()
}

#[test]
fn bytes_per_sample_beside_plain_rows() {
    for (what, rest, limit) in
        [("an arm that moves all the time", 0, 4.0), ("an arm that stands 2 s of 5", 2, 4.2)]
    {
        let samples = arm(1_800, rest);
        let count = samples.len() as f64;
        let (chunks, rows) = (in_chunks(&samples) as f64 / count, in_rows(&samples) as f64 / count);
        let polled = 1_800.0 * 10.0 * 12.0;
        println!(
            "{what}: {chunks:.2} B a sample in chunks, {rows:.2} B in plain rows: {:.1} times less; {:.2} B a reading",
            rows / chunks,
            chunks * count / polled
        );
        assert!(chunks <= limit, "{what}: {chunks:.2} B a sample");
        assert!(rows / chunks > 5.0, "{what}: {rows:.2} / {chunks:.2}");
    }
}
