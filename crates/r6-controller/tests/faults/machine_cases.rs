//! Checks that a fault of the machine was felt, and that the promises of its file hold. They judge by the
//! state of the machine and by its answers. Times are those of the file, in seconds; a stopped arm rests 0.65
//! s later.

use crate::watch::Sight;
use crate::world::World;
use r6_controller::Event;
use r6_proto::RequestType;

/// Whether all of it holds; prints what does not.
fn all(holds: &[(&str, bool)]) -> bool {
    for (what, _) in holds.iter().filter(|(_, holds)| !holds) {
        eprintln!("does not hold: {what}");
    }
    holds.iter().all(|(_, holds)| *holds)
}

pub fn keys(world: &World) -> bool {
    (0..4).all(|round| {
        let after = |seconds: f64| seconds + 7.0 * f64::from(round);
        all(&[
            ("in manual", world.reads(after(7.2), after(7.4), "curMode", "1")),
            ("in stop", world.reads(after(8.4), after(8.5), "curMode", "3")),
            ("in automatic, and nothing runs", world.reads(after(9.0), after(9.5), "curMode", "2")),
            ("rests until the start", world.stands(after(7.85), after(9.5))),
            ("goes on after it", !world.stands(after(10.5), after(12.2))),
        ])
    })
}

pub fn emergency_stops(world: &World) -> bool {
    all(&[
        (
            "alarm 7 while it is pressed",
            world.always(5.1, 7.0, |seen| seen.alarm == 7 && seen.emergency_stop),
        ),
        ("and until it is cleared", world.reads(5.1, 8.0, "curAlarm", "7")),
        ("released and cleared, and nothing runs", world.reads(8.1, 9.0, "curMode", "2")),
        ("no alarm", world.reads(8.1, 9.0, "curAlarm", "0")),
        ("a start moves it, and nothing before", world.goes_on(5.65..9.0, 9.0..13.0)),
        ("released in motion", world.stands(13.65, 15.0)),
        ("alarm 7 on top of another", world.reads(20.6, 23.0, "curAlarm", "7")),
        ("cleared", world.reads(23.1, 24.0, "curAlarm", "0")),
        ("the second start", world.goes_on(20.65..23.5, 24.0..28.0)),
    ])
}

pub fn alarms(world: &World) -> bool {
    all(&[
        ("in motion", world.reads(8.1, 9.0, "curAlarm", "135")),
        ("rests after it", world.goes_on(8.65..9.5, 9.5..12.0)),
        ("the first of many is shown", world.reads(12.1, 18.0, "curAlarm", "840")),
        ("to who stands there too", world.always(12.1, 18.0, |seen| seen.alarm == 840)),
        ("rests in the storm", world.goes_on(12.65..18.5, 18.5..22.0)),
        ("comes and goes", world.edges(22.0, 26.0, |seen| seen.alarm == 15) > 40),
        ("rests while it does", world.goes_on(22.65..26.0, 26.0..29.0)),
    ])
}

pub fn power_cuts(world: &World) -> bool {
    let is_chosen = |name: &'static str| move |seen: &Sight| seen.program == name;
    all(&[
        ("connections", world.client.seen.connections > 4),
        ("each cut ends all of them", world.watch.ended == 4),
        ("no answer comes", world.read(24.01, 35.9, "curMode").is_empty()),
        ("in the middle of a move", world.goes_on(9.0..16.0, 16.0..20.0)),
        ("a blink", world.goes_on(20.0..21.0, 21.0..24.0)),
        ("a long time", world.goes_on(24.0..41.0, 41.0..43.0)),
        ("another program", world.always(24.1, 40.0, is_chosen("palletise"))),
        ("the one before it", world.always(40.1, 50.0, is_chosen("remote"))),
        ("the emergency stop stays", world.always(43.1, 47.0, |seen| seen.emergency_stop)),
        ("and is shown", world.reads(44.6, 48.0, "curAlarm", "7")),
        ("it is not started then", world.stands(43.65, 54.9)),
    ])
}

pub fn counters(world: &World) -> bool {
    let reads = |from, to, counter, value| world.reads(from, to, counter, value);
    all(&[
        ("the last one", reads(5.1, 7.0, "counter-0", "[0,9007199254740992,9007199254740992]")),
        ("the first one", reads(7.1, 9.0, "counter-0", "[0,9007199254740992,-9007199254740992]")),
        ("32 bits", reads(9.1, 15.0, "counter-0", "[0,9007199254740992,4294967295]")),
        ("zero", reads(15.1, 20.0, "counter-0", "[0,0,0]")),
        ("again and again", reads(11.1, 20.0, "counter-2", "[2,0,0]")),
        ("a new one was not there", world.read(0.0, 12.0, "counter-77").is_empty()),
        ("and is", reads(12.1, 20.0, "counter-77", "[77,2,1]")),
    ])
}

pub fn poses(world: &World) -> bool {
    let near = |axis: usize, degrees: f64| move |seen: &Sight| (seen.axes[axis] - degrees).abs() < 1e-6;
    let steps_of_one = |seen: &Sight| (0..6_u8).all(|axis| near(axis.into(), f64::from(axis) + 1.0)(seen));
    all(&[
        ("out of reach", world.read(5.0, 8.0, "curAlarm").contains("200")),
        ("rests until the start", world.goes_on(7.5..8.5, 8.5..10.0)),
        ("through the singularity", world.ever(10.0, 13.0, |seen| seen.axes[3] < -30.0)),
        ("without an alarm", world.reads(8.6, 15.0, "curAlarm", "0")),
        ("beyond a limit", world.reads(16.5, 18.0, "curAlarm", "130")),
        ("and not a step further", world.goes_on(16.5..18.5, 18.5..20.0)),
        ("a point three times", world.ever(20.0, 23.0, steps_of_one)),
        (
            "no number is refused",
            world.told(|event| matches!(event, Event::Refused { request: RequestType::AddRcc, .. })),
        ),
        ("and nothing of it is kept", world.reads(18.6, 40.0, "curAlarm", "0")),
        ("the wrist on one side", world.ever(30.0, 33.0, |seen| seen.axes[4] > 50.0)),
        ("and on the other", world.ever(30.0, 33.0, near(4, -60.0))),
    ])
}

pub fn speeds(world: &World) -> bool {
    let only_j1 = |seen: &Sight| seen.axes[1..].iter().all(|axis| *axis == 0.0);
    all(&[
        ("a tenth", world.ever(5.0, 20.0, |seen| seen.speed == 10.0)),
        ("full", world.ever(5.4, 22.0, |seen| seen.speed == 100.0)),
        ("none", world.ever(9.0, 10.0, |seen| seen.speed == 0.0)),
        ("paused", world.read(6.1, 20.0, "curMode").contains("2")),
        ("no other axis leaves the path", world.always(0.0, 40.0, only_j1)),
        ("goes on", !world.stands(24.0, 28.0)),
    ])
}

pub fn points(world: &World) -> bool {
    let x011 = world.edges(5.0, 16.0, |seen| seen.x(1));
    let y010 = world.edges(5.0, 15.0, |seen| seen.y(0));
    let x010 = world.edges(5.0, 15.0, |seen| seen.x(0));
    all(&[
        // Nine changes, and then eight each time: it is already on.
        ("bounces", x011 == 9 + 19 * 8),
        ("ends as it is told", world.always(16.0, 20.0, |seen| seen.x(1))),
        ("written from all sides", y010 >= 40),
        ("the input follows", x010 >= 20),
        ("the last one decides", world.always(16.01, 20.0, |seen| !seen.y(0))),
        ("and the input ends so", world.always(16.3, 20.0, |seen| !seen.x(0))),
        ("replies go on", world.client.seen.timeouts + world.other.seen.timeouts == 0),
    ])
}

pub fn frozen_values(world: &World) -> bool {
    all(&[
        ("the client believes what it reads", world.stale > 10),
        ("the arm moves", !world.stands(5.1, 13.0)),
        ("nothing shows it", world.read(5.0, 13.0, "axis-0").len() == 1),
        ("then it shows", world.read(13.0, 20.0, "axis-0").len() > 5),
    ])
}

pub fn programs(world: &World) -> bool {
    let own = |seen: &Sight| seen.program == "own";
    let at_three = |seen: &Sight| (seen.axes[0] - 3.0).abs() < 1e-6;
    all(&[
        ("chosen", world.always(7.1, 18.0, own)),
        ("runs", world.reads(8.1, 11.0, "curMode", "7")),
        ("the running program stays as it is", world.stands(8.0, 13.0)),
        ("overwritten, and not started", world.reads(12.6, 13.0, "curMode", "2")),
        ("begins at its first step", world.ever(13.0, 16.0, at_three)),
        ("the one before it", world.always(18.1, 25.0, |seen| seen.program == "remote")),
        ("goes on", world.goes_on(17.0..19.0, 19.0..24.0)),
    ])
}

pub fn two_masters(world: &World) -> bool {
    all(&[
        ("the arm goes where the other wants it", world.visits(5.0) > 0),
        ("an output", world.ever(5.0, 6.0, |seen| seen.y(0))),
        ("the speed", world.ever(6.0, 8.0, |seen| seen.speed == 50.0)),
        ("stopped", world.reads(18.1, 21.0, "curMode", "2")),
        ("rests until somebody starts", world.goes_on(18.65..21.0, 21.0..26.0)),
    ])
}
