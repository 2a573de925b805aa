//! A client at work while the link, the replies and the controller are broken on purpose: nothing hangs, nothing is carried out
//! twice, nothing is shown that is not true, and all is well again as soon as the fault is over.
//!
//! Everything runs in one process on a clock that nobody waits for; the seed says everything that is drawn.
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests too")]

mod cases;
mod floor;
mod tap;
mod work;
mod world;

use std::path::{Path, PathBuf};
use std::time::Duration;

use r6_controller::Scenario;
use r6_controller::scenario::Happening;

use cases::{CASES, Case, Text};
use world::{Outcome, Setup, ms};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/scenarios")
}

fn scenario(case: &Case) -> Scenario {
    let text = match case.text {
        Text::File => std::fs::read_to_string(folder().join(format!("{}.toml", case.name))).unwrap(),
        Text::Own(text) => text.to_owned(),
    };
    Scenario::read(&text).unwrap_or_else(|error| panic!("{}: {error}", case.name))
}

/// When the last thing has happened.
fn end_of(scenario: &Scenario) -> Duration {
    let entries = scenario.timeline.iter().map(|entry| {
        let lasts = if let Happening::PowerCut { off, .. } = &entry.what { *off } else { Duration::ZERO };
        entry.at + entry.spread + entry.every.unwrap_or_default() * (entry.times.unwrap() - 1) + lasts
    });
    let windows = scenario.faults.iter().map(|window| window.from + window.lasts.unwrap());
    entries.chain(windows).max().unwrap_or_default()
}

/// Every firmware that there is; three of four seeds meet the one that is met most.
const PROFILES: [&str; 8] = ["hc1", "hc1", "legacy", "hc1", "r6-host", "hc1", "r6-pendant", "hc1"];

/// Says what was run where a check fails.
struct Told(String);

impl Drop for Told {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("in {}", self.0);
        }
    }
}

/// The same somewhat later, so that it begins and ends at another time of the client's own periods.
fn later(mut scenario: Scenario, by: Duration) -> Scenario {
    scenario.timeline.iter_mut().for_each(|entry| entry.at += by);
    scenario.faults.iter_mut().for_each(|window| window.from += by);
    scenario
}

/// Runs a case: each seed on another firmware, and at another time.
fn run(case: &Case, setup: Setup) -> Outcome {
    let scenario = later(scenario(case), ms(setup.seed * 377 % 1000));
    let turn = usize::try_from(setup.seed).unwrap() % PROFILES.len();
    let setup = Setup {
        profile: case.profile.unwrap_or(PROFILES[turn]),
        over: end_of(&scenario) + ms(case.held_up),
        trusts_values: case.name != "P5-bad-list",
        alone: !(case.another || case.name.starts_with("P14")),
        executes: case.name != "P10-not-executed",
        another: case.another,
        rewrite: case.rewrite,
        ..setup
    };
    let _told = Told(format!("{}, {setup:?}", case.name));
    world::run(&scenario, &setup)
}

#[test]
fn trial() {
    let wanted = std::env::var("CASE").unwrap_or_default();
    let seeds: u64 = std::env::var("SEEDS").map_or(20, |seeds| seeds.parse().unwrap());
    for case in CASES.iter().filter(|case| case.name.starts_with(&wanted)) {
        for (name, setup) in [("prompt", Setup::prompt as fn(u64) -> Setup), ("usual", Setup::usual)] {
            let begun = std::time::Instant::now();
            let mut recovered = Vec::new();
            let mut not_felt = 0;
            let mut failed = Vec::new();
            let mut last = None;
            for seed in 0..seeds {
                match std::panic::catch_unwind(|| run(case, setup(seed))) {
                    Ok(seen) => {
                        if seen.recovered > ms(1000) && name == "prompt" { println!("SLOW {} seed {seed} {:?}", case.name, seen.recovered); for line in seen.log.iter().rev().take(0) { println!("{line}"); } println!("{:?}", seen.notes.trace); }
                        recovered.push(seen.recovered);
                        not_felt += u64::from(!(case.felt)(&seen));
                        last = Some(seen);
                    }
                    Err(_) => failed.push(seed),
                }
            }
            let max = recovered.iter().max();
            println!("### {} {name}: {:?} max {max:?} not felt {not_felt} failed {failed:?}", case.name, begun.elapsed() / 20);
            if let Some(seen) = last {
                println!("{} runs {} finished {} stops, taken {} failures {} nf {} {}", seen.notes.runs.len(), seen.notes.finished(), seen.notes.stops.len(), seen.taken, seen.notes.failures, seen.notes.not_fresh, seen.quality);
            }
        }
    }
}
