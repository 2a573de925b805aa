//! Runs worlds: `make sim SEEDS=1000`, or one of them with everything that happens in it: `make sim SEED=7`.

use std::io::Write;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use r6_world::fault::Promise;
use r6_world::record::{Tally, Violation};
use r6_world::report::{self, Course};
use r6_world::world::{self, Outcome};

/// Each tenth seed runs twice, and has to be the same both times.
const TWICE_EVERY: u64 = 10;

/// So many seeds show every fault and every promise.
const ENOUGH_SEEDS: u64 = 1000;

/// So many failures are told.
const MOST_FAILURES: usize = 5;

const USAGE: &str = "usage: r6-world [--seeds N] [--from N] [--seed N] [--jobs N] [--markdown] [--quiet]";

struct Wanted {
    seeds: u64,
    from: u64,
    one: Option<u64>,
    jobs: usize,
    aloud: bool,
    markdown: bool,
}

fn read_arguments() -> Option<Wanted> {
    let jobs = std::thread::available_parallelism().map_or(1, usize::from);
    let mut wanted = Wanted { seeds: ENOUGH_SEEDS, from: 1, one: None, jobs, aloud: true, markdown: false };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--quiet" => {
                wanted.aloud = false;
                continue;
            }
            // The section of docs/SIMULATION.md about the last full run.
            "--markdown" => {
                wanted.markdown = true;
                continue;
            }
            _ => {}
        }
        let number: u64 = words.next()?.parse().ok()?;
        match word.as_str() {
            "--seeds" => wanted.seeds = number,
            "--from" => wanted.from = number,
            "--seed" => wanted.one = Some(number),
            "--jobs" => wanted.jobs = usize::try_from(number).ok()?.clamp(1, 64),
            _ => return None,
        }
    }
    Some(wanted)
}

fn main() -> ExitCode {
    let Some(wanted) = read_arguments() else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    world::catch_panics();
    match wanted.one {
        Some(seed) => one(seed, wanted.aloud),
        None => many(&wanted),
    }
}

fn one(seed: u64, aloud: bool) -> ExitCode {
    let outcome = world::run(seed, aloud);
    match report::failure(&outcome) {
        Some(told) => {
            println!("{told}");
            ExitCode::FAILURE
        }
        None => {
            println!("{}", report::table(1, &outcome.tally));
            println!("seed {seed} holds; the sum of all that happened is {:016x}", outcome.sum);
            ExitCode::SUCCESS
        }
    }
}

/// Runs a seed, and some twice.
fn run(seed: u64) -> Outcome {
    let mut outcome = world::run(seed, false);
    if seed.is_multiple_of(TWICE_EVERY) && outcome.violation.is_none() {
        let again = world::run(seed, false);
        outcome.tally.checks[Promise::I9.index()] += 1;
        if (again.sum, &again.violation) != (outcome.sum, &None) {
            let text = format!("{:016x}, then {:016x}: {:?}", outcome.sum, again.sum, again.violation);
            outcome.violation = Some(Violation { promise: Promise::I9, at: Duration::ZERO, text });
        }
    }
    outcome
}

fn many(wanted: &Wanted) -> ExitCode {
    let begun = Instant::now();
    let next = AtomicU64::new(wanted.from);
    let end = wanted.from + wanted.seeds;
    let (tell, told) = mpsc::channel();
    let (mut tally, mut failures, mut done) = (Tally::default(), Vec::new(), 0_u64);
    std::thread::scope(|scope| {
        for _ in 0..wanted.jobs {
            let (next, tell) = (&next, tell.clone());
            scope.spawn(move || {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= end || tell.send(run(seed)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(tell);
        let mut shown = Instant::now();
        for outcome in told {
            done += 1;
            tally.add(&outcome.tally);
            if let Some(failure) = report::failure(&outcome) {
                println!("{failure}");
                failures.push(outcome.seed);
                if failures.len() >= MOST_FAILURES {
                    next.store(end, Ordering::Relaxed);
                }
            }
            if shown.elapsed() > Duration::from_secs(1) {
                shown = Instant::now();
                eprint!(
                    "\r{done} of {} seeds, {} s, {} failed ",
                    wanted.seeds,
                    begun.elapsed().as_secs(),
                    failures.len()
                );
                let _ = std::io::stderr().flush();
            }
        }
    });
    eprintln!();
    if wanted.markdown {
        let course = Course {
            from: wanted.from,
            wanted: wanted.seeds,
            done,
            failed: failures.clone(),
            jobs: wanted.jobs,
            took: begun.elapsed(),
        };
        println!("{}", report::section(&course, &tally));
    } else {
        println!("{}", report::table(done, &tally));
    }
    let never = world::never_seen(&tally);
    let incomplete = wanted.seeds >= ENOUGH_SEEDS && failures.is_empty() && !never.is_empty();
    if incomplete {
        println!("never seen in {done} seeds: {}", never.join(", "));
    }
    if failures.is_empty() && !incomplete {
        println!("{done} seeds hold, in {} s", begun.elapsed().as_secs());
        return ExitCode::SUCCESS;
    }
    println!(
        "failed: {}",
        failures.iter().map(|seed| format!("make sim SEED={seed}")).collect::<Vec<_>>().join(", ")
    );
    ExitCode::FAILURE
}
