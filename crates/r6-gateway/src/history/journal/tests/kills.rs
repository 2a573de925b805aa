//! A process that acknowledges samples is killed at random moments. `R6_KILLS` says how often.

use std::io::{BufRead, BufReader, Write as _};
use std::process::{Command, Stdio};
use std::time::Duration;

use super::*;
use crate::core::history::averages::Step;
use crate::history::query::answer_with_averages;
use crate::store::history::{AskAverages, AverageFile, DayState, Days};

const SIGNALS: [Address; 3] = [Address::CurMode, Address::IsMoving, Address::Origin];

/// How often it is killed, if nothing else is said.
const KILLS: u32 = 20;

/// After this number of kills the test begins with an empty folder. All samples of the folder are read after
/// each kill, so a folder of a thousand kills would take an hour.
const KILLS_OF_A_FOLDER: u32 = 50;

/// The sample of a number: about every fifth one of a signal that changes seldom.
fn samples(number: i64) -> Vec<(Address, Sample)> {
    let sample = |(at, address): (usize, Address)| {
        let is_due = [true, number % 5 == 0, number % 97 == 0].get(at).copied().unwrap_or(false);
        is_due.then(|| (address, whole(BASE + number * 20_000, number.wrapping_mul(0x9E37_79B9) % 1_000_003)))
    };
    SIGNALS.into_iter().enumerate().filter_map(sample).collect()
}

/// The event of a number: about every third one has one.
fn event(number: i64) -> Option<Event> {
    let time = Micros(BASE + number * 20_000);
    (number % 3 == 0).then_some(Event::new(time, Observed::ModeChanged { from: number, to: 0 }))
}

/// The process that is killed. It does nothing unless the test below starts it.
#[test]
fn child() {
    let (Ok(folder), Ok(first)) = (std::env::var("R6_HISTORY_OF_CHILD"), std::env::var("R6_HISTORY_FROM"))
    else {
        return;
    };
    let mut number: i64 = first.parse().unwrap();
    let counts = Arc::<RobotCounts>::default();
    let mut running = journal(Days::to_write(folder.as_ref(), 1 << 30), settings());
    let mut out = std::io::stdout();
    // It ends by itself if it is not killed.
    for round in 0..20_000_u64 {
        for _ in 0..(round * 7 % 40) {
            let events = event(number).into_iter().collect();
            running.take(Instant::ORIGIN, Batch { events, ..batch(samples(number), &counts) });
            number += 1;
        }
        running.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
        writeln!(out, "kept {number}").unwrap();
    }
}

#[test]
fn no_acknowledged_sample_or_event_is_lost_when_the_process_is_killed() {
    let kills = std::env::var("R6_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(KILLS);
    let mut folder = tempfile::tempdir().unwrap();
    let (mut expected, mut seed): (Vec<Vec<Sample>>, u64) = (vec![Vec::new(); 3], 0x2545_F491);
    let (mut first, mut kept_in_all) = (0_i64, 0);
    for kill in 0..kills {
        if kill > 0 && kill % KILLS_OF_A_FOLDER == 0 {
            folder = tempfile::tempdir().unwrap();
            expected.iter_mut().for_each(Vec::clear);
            first = 0;
        }
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "history::journal::tests::kills::child", "--nocapture"])
            .env("R6_HISTORY_OF_CHILD", folder.path())
            .env("R6_HISTORY_FROM", first.to_string())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let kept = |line: String| line.strip_prefix("kept ").and_then(|number| number.parse::<i64>().ok());
        // It works, and is killed some time within the next 60 ms.
        let mut acknowledged = lines.by_ref().find_map(|line| kept(line.unwrap())).unwrap();
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        std::thread::sleep(Duration::from_micros((seed >> 33) % 60_000));
        child.kill().unwrap();
        child.wait().unwrap();
        for line in lines {
            acknowledged = kept(line.unwrap_or_default()).unwrap_or(acknowledged);
        }
        let mut again = journal(Days::to_write(folder.path(), 1 << 30), settings());
        again.flush(Instant::ORIGIN, Micros(BASE)).unwrap();
        let seen = SIGNALS.map(|address| all(&mut again.store, address, Vec::new()));
        // A number that was not acknowledged may be there as well, but only whole.
        let last = seen[0].last().map_or(first, |sample| (sample.time.0 - BASE) / 20_000 + 1);
        assert!(last >= acknowledged, "kill {kill}: {last} of {acknowledged}");
        for (address, sample) in (first..last).flat_map(samples) {
            let at = SIGNALS.iter().position(|signal| *signal == address).unwrap();
            expected[at].push(sample);
        }
        for (seen, expected) in seen.iter().zip(&expected) {
            assert_eq!(seen.len(), expected.len(), "kill {kill}");
            assert!(seen == expected, "kill {kill}");
        }
        let events = all_events(&mut again.store);
        assert!(events == (0..last).filter_map(event).collect::<Vec<_>>(), "kill {kill}");
        kept_in_all += last - first;
        first = last;
    }
    assert!(kept_in_all > i64::from(kills) * 10, "{kept_in_all}: it got somewhere before it was killed");
}

/// The day whose averages are computed by a process that is killed.
const DAY: i64 = 20_782;

/// The signals of that day. Their averages do not fit into one transaction.
fn signals_of_day() -> Vec<Address> {
    (0..24).map(|at| Address::parse(&format!("Addr-{}", 800 + at)).unwrap()).collect()
}

fn averaging(folder: &std::path::Path) -> Journal<Days> {
    let mut running = journal(Days::to_write(folder, 1 << 30), settings());
    running.flush(Instant::ORIGIN, after_day()).unwrap();
    running.look_for_days(DAY + 2);
    running
}

fn after_day() -> Micros {
    Micros((DAY + 2) * 86_400 * SECOND + 3_600 * SECOND)
}

/// It computes a piece of averages for each line that it is sent, and does nothing unless the test below
/// starts it.
#[test]
fn child_that_averages() {
    let Ok(folder) = std::env::var("R6_AVERAGES_OF_CHILD") else { return };
    let mut running = averaging(folder.as_ref());
    let mut out = std::io::stdout();
    while running.average(after_day()).unwrap().is_some() {
        writeln!(out, "piece").unwrap();
        let mut line = String::new();
        if std::io::stdin().read_line(&mut line).unwrap() == 0 {
            return;
        }
    }
}

#[test]
fn averages_are_whole_or_computed_anew_when_the_process_is_killed() {
    let folder = tempfile::tempdir().unwrap();
    let counts = Arc::<RobotCounts>::default();
    let mut running = journal(Days::to_write(folder.path(), 1 << 30), settings());
    // From 18:00 on, and over midnight.
    for number in 0..2_200 {
        let time = (DAY * 86_400 + 18 * 3_600) * SECOND + number * 11 * SECOND;
        let samples = signals_of_day().into_iter().zip(1..);
        let samples = samples.map(|(address, at)| (address, whole(time, number * at % 10_007)));
        running.take(Instant::ORIGIN, batch_of(Interval::USUAL, samples.collect(), &counts));
    }
    running.seal_all();
    running.flush(Instant::ORIGIN, after_day()).unwrap();
    let question = |address| {
        let (from, to) = (DAY * 86_400 * SECOND, (DAY + 2) * 86_400 * SECOND);
        Question { bucket: Some(60 * SECOND), ..ask(address, from, to) }
    };
    let of_values = signals_of_day()
        .into_iter()
        .map(|address| answer(&mut running.store, &question(address), Vec::new()).unwrap().buckets);
    let of_values: Vec<_> = of_values.collect();
    drop(running);
    let (mut seed, mut seen, mut unfinished) = (0x2545_F491_u64, 0, 0);
    for kill in 0..KILLS {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "history::journal::tests::kills::child_that_averages", "--nocapture"])
            .env("R6_AVERAGES_OF_CHILD", folder.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut input = child.stdin.take().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        // It is killed while it computes the piece behind this one, whichever of both processes is faster.
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let in_the_first_day = usize::try_from((seed >> 33) % 280).unwrap();
        // The first day has 290 pieces. The last process ends in the middle of the second day.
        let pieces = if kill + 1 < KILLS { in_the_first_day } else { 400 };
        for _ in lines.filter(|line| line.as_ref().is_ok_and(|line| line == "piece")).take(pieces) {
            seen += 1;
            // It may have ended with its last piece.
            let _ = input.write_all(b"\n");
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let mut again = averaging(folder.path());
        let states = again.store.averages().unwrap().states(DAY..=DAY).unwrap();
        let (robot, address) = (press(), signals_of_day()[0]);
        let of_day = AskAverages { robot: &robot, address, from: DAY, to: DAY };
        let averages = again.store.averages().unwrap();
        let rows = averages.read(AverageFile::of(Step::Minute, DAY), of_day).unwrap();
        unfinished += u32::from(states.is_empty() && !rows.is_empty());
        if kill + 1 < KILLS {
            assert!(states.is_empty(), "kill {kill}: {states:?}");
            continue;
        }
        assert_eq!(states.get(&DAY), Some(&DayState::Finished.whole()));
        // Once a day is finished, its averages are those of its values. The last ones of the day before
        // count on behind midnight.
        while again.average(after_day()).unwrap().is_some() {}
        for day in [DAY, DAY + 1] {
            again.store.remove(Part { day, number: 1 }).unwrap();
        }
        for (address, of_values) in signals_of_day().into_iter().zip(&of_values) {
            let answer = answer_with_averages(&mut again.store, &question(address), Vec::new()).unwrap();
            assert!(answer.buckets == *of_values, "kill {kill}: {address}");
        }
    }
    assert!(seen > 20, "{seen}: it computed something before it was killed");
    assert!(unfinished > 0, "it was killed behind a write and before the end");
}
