//! Every scenario of `examples/scenarios`, run on a virtual clock against a small client. The promises hold
//! after every step, the fault was felt, and after the fault everything works again.

#[path = "faults/cases.rs"]
mod cases;
#[path = "faults/client.rs"]
mod client;
#[path = "faults/holds.rs"]
mod holds;
#[path = "faults/machine_cases.rs"]
mod machine_cases;
#[path = "faults/session_events.rs"]
mod session_events;
#[path = "faults/watch.rs"]
mod watch;
#[path = "faults/world.rs"]
mod world;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Duration;

use proptest::prelude::*;
use r6_controller::fault::file::FAULTS;
use r6_controller::fault::{Fault, LinkFault};
use r6_controller::scenario::Scenario;
use r6_proto::time::Instant;

use cases::CASES;
use client::Motion;
use watch::Sight;
use world::{World, end_of};

const SEEDS: [u64; 3] = [0, 1, 77];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/scenarios")
}

/// The distance that J1 has to go from rest to rest, through the points on the way.
fn way(world: &World) -> f64 {
    let pairs = world.rests.windows(2);
    pairs
        .map(|pair| {
            let motion = world.client.motions.iter().find(|motion| (motion.target - pair[1]).abs() < 1e-6);
            motion.map_or((pair[1] - pair[0]).abs(), |Motion { half, target, .. }| {
                (half - pair[0]).abs() + (target - half).abs()
            })
        })
        .sum()
}

#[expect(clippy::disallowed_methods, reason = "a test reads the files that users copy")]
fn scenario(name: &str) -> Scenario {
    let path = folder().join(format!("{name}.toml"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    Scenario::read(&text).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Prints the scenario and seed if a check fails.
struct Run(String);

impl Drop for Run {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("in {}", self.0);
        }
    }
}

/// Runs a scenario to its end, makes the machine ready as an operator does, and checks that everything works
/// then.
fn run(name: &str, seed: u64) -> World {
    let _told = Run(format!("{name}, seed {seed}"));
    let scenario = scenario(name);
    let end = Instant::ORIGIN + end_of(&scenario);
    let mut world = World::new(scenario, seed);
    if name.starts_with('C') || name == "P14-two-masters" {
        world.watch();
    }
    // A shifted list has the right length, so a client cannot see the fault.
    let shifted = name == "P5-bad-list";
    // The same goes for a changed byte within a text or a number.
    let noisy = name == "T11-noise";
    (world.client.trusts_bytes, world.other.trusts_bytes) = (!noisy, !noisy);
    let trusted = !shifted && !noisy;
    (world.client.trusts_values, world.other.trusts_values) = (trusted, trusted);
    world.client.blends = name != "E2-dwell";
    world.run_to(end + Duration::from_secs(7));
    (world.client.trusts_values, world.other.trusts_values) = (true, true);
    world.make_ready();
    world.run_to(world.now + Duration::from_secs(2));
    let (motions, timeouts) =
        (world.client.motions.len(), world.client.seen.timeouts + world.other.seen.timeouts);
    world.run_to(world.now + Duration::from_secs(8));
    let since = &world.client.motions[motions..];
    assert!(since.len() >= 3, "only {} motions were sent when all was over", since.len());
    for motion in &since[..since.len() - 1] {
        assert_eq!(motion.verdict, Some(true));
        assert_eq!(world.visits(motion.target), 1, "{motion:?} in {:?}", world.rests);
    }
    let later = world.client.seen.timeouts + world.other.seen.timeouts;
    assert_eq!(later, timeouts, "a request is not answered although all is over");
    for motion in &world.client.motions {
        assert!(
            world.visits(motion.target) <= 1 && world.visits(motion.half) <= 1,
            "twice: {motion:?}, rests {:?}",
            world.rests
        );
    }
    // A list that runs twice moves back and forth.
    let further = world.travel_to_rest - way(&world);
    assert!(
        further < 0.01 || !name.starts_with("P10"),
        "J1 went {further} degrees too far: {:?}",
        world.rests
    );
    let frozen = name == "C9-frozen-values";
    assert!(world.stale == 0 || frozen || !trusted, "the client believes in {} wrong places", world.stale);
    let growth = world.growth();
    assert!(growth < 100_000, "{growth} letters more than at the beginning");
    world
}

/// One test for each class, so that they run in parallel and a failure names its class.
macro_rules! classes {
    ($($test:ident: $($name:literal),+;)+) => {
        $(#[test] fn $test() { for name in [$($name),+] { holds(name); } })+

        #[test]
        fn every_file_is_run() {
            let run: BTreeSet<&str> = [$($($name),+),+].into();
            let there: BTreeSet<String> = std::fs::read_dir(folder())
                .unwrap()
                .map(|file| file.unwrap().file_name().into_string().unwrap())
                .map(|name| name.strip_suffix(".toml").expect("a scenario").to_owned())
                .filter(|name| name != "cell")
                .collect();
            assert_eq!(there.iter().map(String::as_str).collect::<BTreeSet<_>>(), run);
            assert_eq!(CASES.iter().map(|(name, _)| *name).collect::<BTreeSet<_>>(), run);
        }
    };
}

classes! {
    keys: "C1-keys";
    emergency_stops: "C2-emergency-stop";
    alarms: "C3-alarms";
    power_cuts: "C4-power-cut";
    counters: "C5-counter";
    poses: "C6-poses";
    speeds: "C7-speed";
    points: "C8-io";
    frozen_values: "C9-frozen-values";
    programs: "C10-program-overwritten";
    ignored_stops: "E1-stop-ignored";
    dwells: "E2-dwell";
    late_lists: "E4-late-list";
    bad_json: "P1-bad-json";
    bad_fields: "P2-bad-field";
    pack_ids: "P3-bad-pack-id", "P3-late-reply";
    crossed_replies: "P4-crossed-reply";
    bad_lists: "P5-bad-list";
    echoes: "P6-echo";
    unsolicited: "P7-unsolicited";
    two_generals: "P10-not-executed", "P10-not-acknowledged";
    lists: "P11-list-full", "P11-list-frozen";
    batches: "P12-rejected-mid-batch";
    dead_tasks: "P13-task-dead";
    two_masters: "P14-two-masters";
    refused_connections: "T1-refuse";
    unanswered_connections: "T2-black-hole";
    silent_connections: "T3-silence";
    resets: "T4-reset-mid-frame";
    closed_connections: "T5-close-before-reply";
    half_open_connections: "T6-half-open";
    pieces: "T7-pieces", "T7-coalesce";
    latencies: "T8-latency";
    slow_links: "T9-slow";
    noise: "T11-noise";
    stalls: "T14-stall";
}

/// The promises hold with every seed. The same seed gives the same bytes; another seed gives other bytes if
/// anything is random.
fn holds(name: &str) {
    let (_, felt) = CASES.iter().find(|(case, _)| *case == name).expect("a case");
    let mut conversations = BTreeSet::new();
    for seed in SEEDS {
        let world = run(name, seed);
        assert!(
            felt(&world),
            "{name}, seed {seed}: the fault had no effect: {:?} {:?} {:?}",
            world.client.seen,
            world.client.motions,
            world.all_read()
        );
        assert_eq!(run(name, seed).conversation(), world.conversation(), "{name}, seed {seed}: other bytes");
        conversations.insert(world.conversation());
    }
    let wanted = if draws(&scenario(name)) { SEEDS.len() } else { 1 };
    assert_eq!(conversations.len(), wanted, "{name}: conversations with {} seeds", SEEDS.len());
}

/// Whether any part of it depends on the seed.
fn draws(scenario: &Scenario) -> bool {
    let unsure = |chance: f64| chance > 0.0 && chance < 1.0;
    scenario.timeline.iter().any(|entry| !entry.spread.is_zero())
        || scenario.reactions.iter().any(|reaction| !reaction.spread.is_zero())
        || scenario.faults.iter().any(|window| unsure(window.chance) || spreads(&window.fault))
}

fn spreads(fault: &Fault) -> bool {
    match fault {
        Fault::Link(LinkFault::Latency { spread, .. }) => !spread.is_zero(),
        Fault::Link(LinkFault::ResetMidFrame { after }) => after.is_none(),
        _ => false,
    }
}

#[test]
fn every_fault_has_a_scenario_of_its_class() {
    for (word, class) in FAULTS {
        let found = CASES.iter().any(|(name, _)| {
            name.split('-').next() == Some(class)
                && scenario(name).faults.iter().any(|window| window.fault.word() == word)
        });
        assert!(found, "no scenario of class {class} has the fault {word}");
    }
}

#[test]
fn every_class_that_a_controller_can_cause_has_a_scenario() {
    let transport = [1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 14].map(|n| format!("T{n}-"));
    let protocol = [1, 2, 3, 4, 5, 6, 7, 10, 11, 12, 13, 14].map(|n| format!("P{n}-"));
    let controller = (1..=10).map(|n| format!("C{n}-"));
    for class in transport.into_iter().chain(protocol).chain(controller) {
        assert!(CASES.iter().any(|(name, _)| name.starts_with(&class)), "{class}");
    }
}

#[test]
fn what_is_wrong_with_the_link_is_told_in_its_time() {
    for (name, _) in CASES.iter().filter(|(name, _)| name.starts_with('T')) {
        let scenario = scenario(name);
        let windows = scenario.faults.clone();
        let mut world = World::new(scenario, 0);
        world.distrust();
        let tick = Duration::from_nanos(1);
        let edges = windows.iter().flat_map(|window| [window.from, window.from + window.lasts.unwrap()]);
        let mut edges: Vec<_> = edges.flat_map(|edge| [edge - tick, edge]).collect();
        edges.sort();
        for at in edges {
            world.run_to(Instant::ORIGIN + at);
            let told = world.controller.link_faults();
            let told: Vec<_> = told.iter().map(|now| (Fault::Link(now.fault), now.chance)).collect();
            let in_force = windows.iter().filter(|window| window.is_in_force(at));
            let wanted: Vec<_> = in_force.map(|window| (window.fault.clone(), window.chance)).collect();
            assert_eq!(told, wanted, "{name} {at:?}");
        }
    }
}

#[test]
fn a_day_in_the_cell() {
    for seed in SEEDS {
        let _told = Run(format!("cell, seed {seed}"));
        let mut world = World::with(scenario("cell"), seed, "palletise", false);
        world.run_to(Instant::ORIGIN + Duration::from_secs(400));
        // A part is there, the gripper has closed on it, a pallet has come: the program waits for these.
        let changes = |what: fn(&Sight) -> bool| world.edges(0.0, 400.0, what);
        assert!(changes(|seen| seen.x(0)) > 80, "{} parts", changes(|seen| seen.x(0)));
        assert!(changes(|seen| seen.eu_inputs & 1 == 1) > 40, "the gripper did not close and open");
        assert!(changes(|seen| seen.x(1)) > 1, "no pallet was changed");
        assert!(changes(|seen| seen.x(2)) >= 7, "no contact bounced");
        assert!(world.ever(45.0, 60.0, |seen| seen.alarm == 5001), "nothing jammed");
        assert!(world.goes_on(56.0..60.0, 68.0..80.0), "it does not rest until somebody starts it");
        assert_eq!(world.client.seen.timeouts + world.client.seen.broken, 0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    /// Two scenarios at once, with any seed: the arm keeps its limits, no reply is paired wrongly, nothing
    /// panics.
    #[test]
    fn faults_that_meet(one in 0..CASES.len(), two in 0..CASES.len(), seed in any::<u64>()) {
        let _told = Run(format!("{} with {}, seed {seed}", CASES[one].0, CASES[two].0));
        let (mut both, other) = (scenario(CASES[one].0), scenario(CASES[two].0));
        both.timeline.extend(other.timeline);
        both.reactions.extend(other.reactions);
        both.faults.extend(other.faults);
        let end = end_of(&both);
        let mut world = World::new(both, seed);
        world.distrust();
        world.run_to(Instant::ORIGIN + end);
        prop_assert!(world.growth() < 200_000);
    }
}
