//! A client at work while faults are injected into the link, the replies and the controller. Nothing hangs,
//! nothing is carried out twice, and nothing untrue is shown. As soon as the fault is over, everything works
//! again.
//!
//! Everything runs in one process on a simulated clock, with each driver (`tests/hands`). The seed determines
//! every random choice.
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests too")]

mod cancelled;
mod cases;
mod floor;
#[allow(dead_code, unused_imports, unused_macros, reason = "it has more than these tests need")]
#[path = "../hands/hands.rs"]
mod hands;
mod killed;
mod tap;
mod work;
mod world;

use std::path::{Path, PathBuf};
use std::time::Duration;

use r6_controller::Scenario;
use r6_controller::scenario::Happening;

use cases::{CASES, Case, Text};
use hands::{On, for_every_hand};
use work::Fate;
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

/// The time of the last event.
fn end_of(scenario: &Scenario) -> Duration {
    let entries = scenario.timeline.iter().map(|entry| {
        let lasts = if let Happening::PowerCut { off, .. } = &entry.what { *off } else { Duration::ZERO };
        entry.at + entry.spread + entry.every.unwrap_or_default() * (entry.times.unwrap() - 1) + lasts
    });
    let windows = scenario.faults.iter().map(|window| window.from + window.lasts.unwrap());
    entries.chain(windows).max().unwrap_or_default()
}

/// All firmware profiles. Three of four seeds use the most common one.
const PROFILES: [&str; 8] = ["hc1", "hc1", "legacy", "hc1", "r6-host", "hc1", "r6-pendant", "hc1"];

/// Prints what was run when a check fails.
struct Told(String);

impl Drop for Told {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("in {}", self.0);
        }
    }
}

/// Shifts the scenario, so that the fault begins and ends at another phase of the client's periods.
fn later(mut scenario: Scenario, by: Duration) -> Scenario {
    scenario.timeline.iter_mut().for_each(|entry| entry.at += by);
    scenario.faults.iter_mut().for_each(|window| window.from += by);
    scenario
}

/// Runs a case: each seed with another firmware, and at another time.
fn run(on: On, case: &Case, setup: Setup) -> Outcome {
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
    let _told = Told(format!("{}, {on:?}, {setup:?}", case.name));
    world::run(on, &scenario, &setup)
}

/// The seeds of each case, with each of the two setups. One driver runs all seeds, because the drivers share
/// most of the code; the others run each firmware.
fn seeds(on: On) -> Vec<u64> {
    match on {
        On::Tokio => (0..16).collect(),
        On::Callback | On::Blocking => vec![0, 2, 4, 6],
    }
}

/// How much earlier than due an address may be requested. So the next answer may be this much later than one
/// period.
const RIDES_ALONG: Duration = Duration::from_millis(50);

/// Runs all cases of a fault. A client with short timeouts has an answer again within one period of its
/// subscription. A client with the usual timeouts also waits for the timeouts of the requests that the fault
/// swallowed.
fn holds(on: On, fault: &str) {
    let cases: Vec<_> = CASES.iter().filter(|case| case.fault() == fault).collect();
    assert!(!cases.is_empty(), "no case of {fault}");
    for case in cases {
        for seed in seeds(on) {
            let setup = Setup::prompt(seed);
            let most = setup.every + RIDES_ALONG;
            let seen = run(on, case, setup);
            assert!(
                seen.recovered <= most,
                "{}, seed {seed}: recovered after {:?}",
                case.name,
                seen.recovered
            );
            assert!(
                (case.felt)(&seen),
                "{}, seed {seed}: the fault had no effect: {} {:?}",
                case.name,
                seen.quality,
                seen.notes.runs
            );
            let setup = Setup::usual(seed);
            let most = setup.every + setup.settings.reply_timeout * 2;
            let seen = run(on, case, setup);
            assert!(
                seen.recovered <= most,
                "{}, seed {seed}: recovered after {:?}",
                case.name,
                seen.recovered
            );
        }
    }
}

/// One test per fault and driver, so that they run in parallel and a failure names both.
macro_rules! faults {
    ($($test:ident: $fault:literal;)+) => {
        $(fn $test(on: On) { holds(on, $fault); })+

        for_every_hand! { $($test,)+ }

        const TESTED: &[&str] = &[$($fault),+];
    };
}

faults! {
    t1_a_refused_connection: "T1";
    t2_an_attempt_without_an_answer: "T2";
    t3_a_connection_that_says_nothing: "T3";
    t4_a_reset_within_a_frame: "T4";
    t5_an_end_in_place_of_a_reply: "T5";
    t6_a_connection_that_goes_deaf: "T6";
    t7_pieces_and_several_at_once: "T7";
    t8_latency: "T8";
    t9_a_slow_line: "T9";
    t14_the_second_half_comes_late: "T14";
    p1_bad_json: "P1";
    p2_bad_fields: "P2";
    p3_wrong_repeated_reordered_late: "P3";
    p4_replies_to_another: "P4";
    p5_lists_of_another_length: "P5";
    p6_echoes: "P6";
    p7_what_nobody_asked_for: "P7";
    p8_dialects: "P8";
    p9_codes_that_nobody_knows: "P9";
    p10_the_two_generals: "P10";
    p11_a_list_that_is_full_or_frozen: "P11";
    p12_half_a_list: "P12";
    p13_a_dead_task: "P13";
    p14_two_masters: "P14";
}

/// All faults that the client has to survive, except its own (`cancelled.rs`: K1, `killed.rs`: K2).
#[test]
fn every_fault_has_a_case_and_a_test() {
    let transport = (1..=9).chain([14]).map(|n| format!("T{n}"));
    for fault in transport.chain((1..=14).map(|n| format!("P{n}"))) {
        assert!(CASES.iter().any(|case| case.fault() == fault), "{fault} has no case");
        assert!(TESTED.contains(&fault.as_str()), "{fault} has no test");
    }
    assert!(CASES.iter().all(|case| TESTED.contains(&case.fault())), "a case that no test runs");
}

/// Without a fault, no case reports one. So no case passes because of normal events.
fn without_a_fault_nobody_feels_any(on: On) {
    let nothing = cases::nothing();
    for seed in seeds(on).into_iter().filter(|seed| *seed < 8) {
        for setup in [Setup::prompt(seed), Setup::usual(seed)] {
            let seen = run(on, &nothing, setup);
            let usual = |case: &&Case| (case.felt)(&seen);
            let felt: Vec<_> = CASES.iter().filter(usual).map(|case| case.name).collect();
            // Firmware without numbers never has any.
            let felt: Vec<_> =
                felt.into_iter().filter(|name| !name.starts_with("P8-") || seen.profile == "hc1").collect();
            assert_eq!(felt, Vec::<&str>::new(), "seed {seed}, {}", seen.quality);
            assert_eq!(
                seen.quality.timeouts + seen.quality.lost + seen.quality.strays + seen.quality.garbled,
                0
            );
            assert!(seen.notes.finished() >= 3 && seen.notes.commands(&Fate::Ok) > 20, "it works");
        }
    }
}

/// The same seed gives the same bytes at the same times. A different seed gives different ones.
fn a_seed_says_everything(on: On) {
    for name in ["T4-and-latency", "P1-bad-json", "P3-bad-pack-id", "T9-slow"] {
        let case = CASES.iter().find(|case| case.name == name).unwrap();
        let said = |seed| {
            let seen = run(on, case, Setup::usual(seed));
            (
                seen.line.text(),
                seen.log,
                format!("{:?} {:?} {}", seen.notes.runs, seen.notes.commands, seen.quality),
            )
        };
        assert!(said(3) == said(3), "{name}: the same seed says something else");
        assert!(said(3) != said(5), "{name}: another seed says the same");
    }
}

for_every_hand! {
    without_a_fault_nobody_feels_any,
    a_seed_says_everything,
}
