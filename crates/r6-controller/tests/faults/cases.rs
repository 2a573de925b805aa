//! All scenarios, and how the effect of each is recognised.

use r6_controller::Event;

use crate::machine_cases as cases;
use crate::world::World;

/// Whether the effect of a scenario was seen, after its end.
pub type Felt = fn(&World) -> bool;

/// Each scenario with the check that its fault was felt.
pub const CASES: [(&str, Felt); 40] = [
    ("C1-keys", cases::keys),
    ("C2-emergency-stop", cases::emergency_stops),
    ("C3-alarms", cases::alarms),
    ("C4-power-cut", cases::power_cuts),
    ("C5-counter", cases::counters),
    ("C6-poses", cases::poses),
    ("C7-speed", cases::speeds),
    ("C8-io", cases::points),
    ("C9-frozen-values", cases::frozen_values),
    ("C10-program-overwritten", cases::programs),
    ("E1-stop-ignored", |world| world.told(|event| matches!(event, Event::StopIgnored { .. }))),
    ("E2-dwell", |world| world.told(|event| matches!(event, Event::Dwells { .. }))),
    ("E4-late-list", |world| {
        world.told(|event| matches!(event, Event::LateListTaken { .. }))
            && world.client.motions.iter().any(|one| one.verdict.is_none() && world.visits(one.target) == 1)
    }),
    ("P1-bad-json", |world| world.client.seen.broken > 10),
    ("P2-bad-field", |world| world.client.seen.rejected > 3),
    ("P3-bad-pack-id", |world| world.client.seen.strays("unknown packID") > 10),
    ("P3-late-reply", |world| {
        world.client.seen.timeouts > 5 && world.client.seen.strays("unknown packID") > 5
    }),
    ("P4-crossed-reply", |world| world.other.seen.strays("unknown packID") > 20),
    ("P5-bad-list", |world| world.client.seen.mismatches > 10),
    ("P6-echo", |world| world.client.seen.strays("echo") > 10 && world.client.seen.timeouts > 10),
    ("P7-unsolicited", |world| world.client.seen.photos > 5 && world.client.seen.strays("no reply") > 3),
    ("P10-not-executed", |world| {
        world.client.motions.iter().any(|one| one.verdict == Some(true) && world.visits(one.target) == 0)
    }),
    ("P10-not-acknowledged", |world| {
        world.client.motions.iter().any(|one| one.verdict.is_none() && world.visits(one.target) == 1)
    }),
    ("P11-list-full", |world| {
        let mut refused = world.client.motions.iter().filter(|one| one.verdict == Some(false)).peekable();
        refused.peek().is_some()
            && refused.all(|one| world.visits(one.target) == 0 && world.visits(one.half) == 0)
    }),
    ("P11-list-frozen", |world| world.client.seen.longest_list == 2),
    ("P12-rejected-mid-batch", |world| {
        world.client.motions.iter().any(|one| one.verdict == Some(false) && world.visits(one.half) == 1)
    }),
    ("P13-task-dead", |world| world.client.seen.timeouts > 20 && world.client.seen.connections > 3),
    ("P14-two-masters", cases::two_masters),
    ("T1-refuse", |world| world.client.seen.refused > 50 && world.client.seen.lost > 0),
    ("T2-black-hole", |world| world.client.seen.unanswered > 50),
    ("T3-silence", |world| world.client.seen.connections > 4 && world.client.seen.timeouts > 20),
    ("T4-reset-mid-frame", |world| world.client.seen.connections > 5 && world.client.seen.broken > 3),
    ("T5-close-before-reply", |world| world.client.seen.connections > 5 && world.client.seen.lost > 3),
    ("T6-half-open", |world| world.client.seen.connections == 2 && world.client.seen.timeouts > 5),
    ("T7-pieces", |world| world.client.seen.parts > 1000 && world.client.seen.timeouts == 0),
    ("T7-coalesce", |world| world.client.seen.together > 10 && world.client.seen.timeouts == 0),
    ("T8-latency", |world| world.client.seen.late > 20 && world.client.seen.timeouts > 5),
    ("T9-slow", |world| world.client.seen.timeouts > 5 && world.client.seen.connections > 1),
    ("T11-noise", |world| world.client.seen.broken + world.client.seen.rejected > 1),
    ("T14-stall", |world| world.client.seen.parts > 50 && world.client.seen.timeouts == 0),
];
