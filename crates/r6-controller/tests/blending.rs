//! Corners between two moves: what begins and what stops at a corner, and interruptions within it.

mod common;

use common::{Cell, assert_near, axis_move};
use proptest::prelude::*;
use serde_json::{Value, json};

/// A ramp of 0.25 s and its filter.
const CHANGE: f64 = 0.378;

/// How long `to_j1(30.0)` takes from 0: 30 degrees at 20 % of 220.8 deg/s, and one change of speed.
const FIRST: f64 = 30.0 / 44.16 + CHANGE;

/// How long `to_j2(20.0)` takes from 0, likewise.
const SECOND: f64 = 20.0 / 54.0 + CHANGE;

fn smooth(mut step: Value, blend: u8) -> Value {
    step["smooth"] = json!(blend.to_string());
    step
}

fn to_j1(degrees: f64) -> Value {
    axis_move([degrees, 0.0, 0.0, 0.0, 0.0, 0.0], 20.0)
}

fn to_j2(degrees: f64) -> Value {
    axis_move([30.0, degrees, 0.0, 0.0, 0.0, 0.0], 20.0)
}

fn output_on(point: &str) -> Value {
    json!({"oneshot": "1", "action": "200", "type": "0", "io_status": "1", "point": point, "delay": "0"})
}

/// J1 to 30 degrees, then J2 to 20; the acknowledgement has just come.
fn corner_cell(blend: u8) -> Cell {
    let mut cell = Cell::new();
    cell.run_ok(&json!([smooth(to_j1(30.0), blend), to_j2(20.0)]));
    cell
}

/// Lets time pass until this many seconds after the list was sent.
fn until(cell: &mut Cell, seconds: f64) {
    let now = cell.now.since(r6_proto::time::Instant::ORIGIN).as_secs_f64();
    cell.pass(seconds - now);
}

#[test]
fn the_next_move_begins_at_the_corner() {
    for (blend, begins) in [(0, FIRST), (1, FIRST - 0.595 * CHANGE), (9, FIRST - 0.955 * CHANGE)] {
        let mut cell = corner_cell(blend);
        until(&mut cell, begins - 0.002);
        assert_eq!(cell.number("axis-1"), 0.0, "level {blend}");
        until(&mut cell, begins + 0.06);
        assert!(cell.number("axis-1") > 0.0, "level {blend}");
        // The first move counts as finished at its own end, not at the corner.
        if blend > 0 {
            assert!(cell.number("axis-0") < 30.0);
            until(&mut cell, FIRST - 0.001);
            assert_eq!(cell.text("RemoteCmdLen"), "2");
            until(&mut cell, FIRST + 0.001);
        }
        assert_eq!(cell.query(&["RemoteCmdLen", "axis-0"]), [json!("1"), json!("30.000000")]);
        cell.pass(5.0);
        assert_near(cell.axes(), [30.0, 20.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
        assert_eq!(
            cell.query(&["RemoteCmdLen", "isMoving", "curAlarm"]),
            [json!("0"), json!("0"), json!("0")]
        );
        assert_eq!(cell.controller.machine().list().completed(), 2);
    }
}

#[test]
fn steps_between_are_carried_out_at_the_corner() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([
        smooth(to_j1(30.0), 9),
        output_on("3"),
        {"oneshot": "1", "action": "800", "cnt_id": "2"},
        {"oneshot": "1", "action": "51", "isUse": "1", "speed": "20"},
        to_j2(20.0),
    ]));
    let corner = FIRST - 0.955 * CHANGE;
    until(&mut cell, corner - 0.001);
    assert_eq!(cell.text("output-0"), "0");
    until(&mut cell, corner + 0.001);
    assert_eq!(cell.query(&["output-0", "RemoteCmdLen"]), [json!("8"), json!("5")]);
    assert_eq!(cell.value("toolCoord"), json!(["0", "2", "0"]));
    // An output that was switched back in between is not switched on again when the first move ends.
    cell.ok(&["modifyOutput", "0", "3", "0"]);
    until(&mut cell, FIRST + 0.001);
    assert_eq!(cell.query(&["output-0", "RemoteCmdLen"]), [json!("0"), json!("1")]);
    cell.pass(5.0);
    assert_eq!(cell.controller.machine().list().completed(), 5);
    assert_near(cell.axes(), [30.0, 20.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
}

#[test]
fn the_arm_stops_before_what_takes_time() {
    let mut delayed = to_j2(20.0);
    delayed["delay"] = json!("0.1");
    let wait = json!({"oneshot": "1", "action": "100", "type": "100", "limit": "0.1"});
    let mut slow_output = output_on("3");
    slow_output["delay"] = json!("0.1");
    for rest in [vec![delayed], vec![wait, to_j2(20.0)], vec![slow_output, to_j2(20.0)]] {
        let mut cell = Cell::new();
        let mut list = vec![smooth(to_j1(30.0), 9)];
        list.extend(rest);
        cell.run_ok(&list.into());
        until(&mut cell, FIRST + 0.05);
        assert_near(cell.axes(), [30.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-9);
        cell.pass(5.0);
        assert_near(cell.axes(), [30.0, 20.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
    }
}

#[test]
fn what_is_appended_in_time_joins() {
    for sent in [0.1, FIRST - 0.1] {
        let mut cell = Cell::new();
        cell.run_ok(&json!([smooth(to_j1(30.0), 9)]));
        until(&mut cell, sent);
        cell.append_ok(&json!([to_j2(20.0)]));
        let begins = sent.max(FIRST - 0.955 * CHANGE);
        until(&mut cell, begins + CHANGE / 2.0);
        let [_, j2, ..] = cell.axes();
        assert!(j2 > 1.0, "sent at {sent}: {j2}");
        cell.pass(5.0);
        assert_near(cell.axes(), [30.0, 20.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
        let cycle = cell.number("lastCycle");
        assert!((cycle - (begins + SECOND)).abs() < 0.001, "{cycle}");
    }
}

#[test]
fn a_next_move_that_cannot_be_raises_its_alarm_with_the_arm_at_the_point() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([
        smooth(to_j1(30.0), 9),
        output_on("3"),
        axis_move([0.0, 0.0, 0.0, 0.0, 0.0, 350.0], 50.0),
    ]));
    until(&mut cell, FIRST - 0.01);
    assert_eq!(cell.query(&["curAlarm", "isMoving", "output-0"]), [json!("0"), json!("1"), json!("0")]);
    cell.pass(1.0);
    assert_eq!(cell.query(&["curAlarm", "RemoteCmdLen", "output-0"]), [json!("135"), json!("1"), json!("8")]);
    assert_near(cell.axes(), [30.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-9);
}

/// A cell in the middle of the corner of level 9.
fn in_the_corner() -> Cell {
    let mut cell = corner_cell(9);
    until(&mut cell, FIRST - 0.2);
    let [j1, j2, ..] = cell.axes();
    assert!(j1 < 30.0 && j2 > 0.0, "{j1} {j2}");
    cell
}

#[test]
fn a_pause_in_the_corner_goes_on_through_it() {
    let mut cell = in_the_corner();
    let before = cell.axes();
    cell.ok(&["actionPause"]);
    cell.pass(0.5);
    assert_eq!(cell.query(&["isMoving", "curMode", "RemoteCmdLen"]), [json!("0"), json!("2"), json!("2")]);
    let rest = cell.axes();
    assert!(rest[0] >= before[0] && rest[1] > before[1] && rest[1] < 20.0, "{before:?} {rest:?}");
    cell.pass(60.0);
    assert_near(cell.axes(), rest, 1e-9);
    cell.ok(&["startButton"]);
    cell.pass(5.0);
    assert_near(cell.axes(), [30.0, 20.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
    assert_eq!(cell.query(&["RemoteCmdLen", "curMode", "isMoving"]), [json!("0"), json!("7"), json!("0")]);
    assert_eq!(cell.controller.machine().list().completed(), 2);
}

#[test]
fn a_stop_in_the_corner_leaves_the_second_move_to_do() {
    let mut cell = in_the_corner();
    cell.ok(&["actionStop"]);
    assert_eq!(cell.text("isMoving"), "1");
    cell.pass(0.078);
    assert_eq!(cell.query(&["isMoving", "curMode", "RemoteCmdLen"]), [json!("0"), json!("2"), json!("1")]);
    let rest = cell.axes();
    assert!(rest[0] < 30.0 && rest[1] > 0.0, "{rest:?}");
    cell.pass(60.0);
    assert_near(cell.axes(), rest, 1e-9);
    // It does not go back to the point that it has left.
    cell.ok(&["startButton"]);
    cell.pass(5.0);
    assert_near(cell.axes(), [30.0, 20.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
    assert_eq!(cell.text("RemoteCmdLen"), "0");
}

#[test]
fn an_alarm_in_the_corner_stops_there() {
    let mut cell = corner_cell(0);
    cell.pass(5.0);
    cell.send(r#"{"reqType":"heartbreak"}"#);
    // The watchdog bites after 10 s, in the corner of a second list.
    let before_end = 0.15;
    cell.pass(10.0 - (SECOND - before_end));
    cell.run_ok(&json!([smooth(to_j2(0.0), 9), to_j1(0.0)]));
    cell.pass(SECOND - before_end - 0.019);
    assert_eq!(cell.query(&["curAlarm", "RemoteCmdLen"]), [json!("0"), json!("2")]);
    cell.pass(0.001 + 0.078);
    assert_eq!(
        cell.query(&["curAlarm", "isMoving", "curMode", "RemoteCmdLen"]),
        [json!("9"), json!("0"), json!("2"), json!("1")]
    );
    let [j1, j2, ..] = cell.axes();
    assert!(j1 < 30.0 && j2 > 0.0, "{j1} {j2}");
    cell.ok(&["clearAlarmContinue"]);
    cell.pass(5.0);
    assert_eq!(cell.query(&["curAlarm", "RemoteCmdLen", "curMode"]), [json!("0"), json!("0"), json!("7")]);
    assert_near(cell.axes(), [0.0; 6], 1e-6);
}

#[test]
fn the_stop_signal_in_the_corner_ends_both_moves() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([
        smooth(to_j1(30.0), 9),
        {"oneshot": "1", "action": "52", "isUse": "1", "ioNumber": "3", "io_status": "1"},
        to_j2(20.0),
        {"oneshot": "1", "action": "52", "isUse": "0", "ioNumber": "3", "io_status": "1"},
        output_on("1"),
    ]));
    until(&mut cell, FIRST - 0.2);
    cell.controller.set_input(cell.now, 0, 3, true);
    cell.pass(0.078);
    let rest = cell.axes();
    assert!(rest[0] < 30.0 && rest[1] > 0.0, "{rest:?}");
    cell.pass(1.0);
    assert_near(cell.axes(), rest, 1e-9);
    assert_eq!(cell.query(&["RemoteCmdLen", "output-0", "curAlarm"]), [json!("0"), json!("2"), json!("0")]);
}

#[test]
fn a_signal_that_is_there_already_stops_the_next_move_at_the_corner() {
    let mut cell = Cell::new();
    cell.controller.set_input(cell.now, 0, 3, true);
    cell.run_ok(&json!([
        smooth(to_j1(30.0), 9),
        {"oneshot": "1", "action": "52", "isUse": "1", "ioNumber": "3", "io_status": "1"},
        output_on("1"),
        to_j2(20.0),
        {"oneshot": "1", "action": "52", "isUse": "0", "ioNumber": "3", "io_status": "1"},
        output_on("2"),
    ]));
    cell.pass(5.0);
    assert_eq!(cell.query(&["RemoteCmdLen", "output-0", "curAlarm"]), [json!("0"), json!("6"), json!("0")]);
    assert!(cell.number("axis-1") < 0.1 && cell.number("axis-0") < 30.0);
    assert_eq!(cell.controller.machine().list().completed(), 6);
}

#[test]
fn global_speed_0_in_the_corner_rests_there() {
    let mut cell = in_the_corner();
    cell.ok(&["modifyGSPD", "0"]);
    cell.pass(1.0);
    let rest = cell.axes();
    cell.pass(60.0);
    assert_near(cell.axes(), rest, 1e-9);
    cell.ok(&["modifyGSPD", "500"]);
    cell.pass(5.0);
    assert_near(cell.axes(), [30.0, 20.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
    assert_eq!(cell.text("RemoteCmdLen"), "0");
}

#[test]
fn kept_steps_round_their_corners_pass_after_pass() {
    let mut list: Vec<Value> = [[10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [0.0, 0.0]]
        .map(|[j1, j2]| smooth(axis_move([j1, j2, 0.0, 0.0, 0.0, 0.0], 50.0), 5))
        .into();
    list.iter_mut().for_each(|step| step["oneshot"] = json!("0"));
    let mut cell = Cell::new();
    cell.run_ok(&list.into());
    cell.pass(60.0);
    assert_eq!(cell.query(&["isMoving", "RemoteCmdLen", "curAlarm"]), [json!("1"), json!("4"), json!("0")]);
    let completed = cell.controller.machine().list().completed();
    assert!(completed > 150, "{completed}");
    cell.ok(&["stopButton"]);
    cell.pass(5.0);
    assert_eq!(
        cell.query(&["isMoving", "axis-0", "axis-1"]),
        [json!("0"), json!("0.000000"), json!("0.000000")]
    );
}

/// An event during a running list.
#[derive(Clone, Debug)]
enum Event {
    Pause,
    Stop,
    Start,
    Global(u32),
    Append(f64, f64, u8),
    ClearAlarm,
}

fn any_event() -> impl Strategy<Value = (f64, Event)> {
    let event = prop_oneof![
        2 => Just(Event::Pause),
        1 => Just(Event::Stop),
        4 => Just(Event::Start),
        3 => (0_u32..=1000).prop_map(Event::Global),
        6 => (-40.0..40.0, -40.0..40.0, 0_u8..=9).prop_map(|(j1, j2, blend)| Event::Append(j1, j2, blend)),
        1 => Just(Event::ClearAlarm),
    ];
    (0.0..0.5, event)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// With any input, the axes never jump in position or speed, and the rest of the list is executed.
    #[test]
    fn no_interruption_makes_the_arm_jump(events in prop::collection::vec(any_event(), 1..20)) {
        let mut cell = Cell::new();
        let step = 0.002;
        let start: Vec<Value> = [[30.0, 0.0], [30.0, 20.0], [-10.0, 5.0]]
            .map(|[j1, j2]| smooth(axis_move([j1, j2, 0.0, 0.0, 0.0, 0.0], 100.0), 7))
            .into();
        cell.run_ok(&start.into());
        let mut before = [cell.axes(); 2];
        let (mut goal, mut taken) = ([-10.0, 5.0], 3);
        for (wait, event) in events {
            for _ in 0..(wait / step) as usize {
                cell.pass(step);
                let here = cell.axes();
                for axis in 0..2 {
                    let (last, now) = (before[1][axis] - before[0][axis], here[axis] - before[1][axis]);
                    prop_assert!(now.abs() <= 270.0 * step + 1e-5, "place jumps: {last} {now}");
                    // A stop within 0.078 s is the hardest: 1.5 × 270 / 0.078 deg/s² on top of two full
                    // ramps.
                    let hardest = 270.0 * (1.5 / 0.078 + 2.0 / 0.175);
                    prop_assert!((now - last).abs() <= hardest * step * step + 1e-5, "speed jumps: {last} {now}");
                }
                before = [before[1], here];
            }
            match event {
                Event::Pause => drop(cell.command(&["actionPause"])),
                Event::Stop => drop(cell.command(&["actionStop"])),
                Event::Start => drop(cell.command(&["startButton"])),
                Event::Global(permille) => drop(cell.command(&["modifyGSPD", &permille.to_string()])),
                Event::ClearAlarm => drop(cell.command(&["clearAlarm"])),
                Event::Append(j1, j2, blend) => {
                    cell.add_rcc("0", &json!([smooth(axis_move([j1, j2, 0.0, 0.0, 0.0, 0.0], 100.0), blend)]));
                    cell.pass(0.018);
                    let reply = cell.frame().unwrap();
                    if reply.contains(r#""ok""#) {
                        goal = [j1, j2];
                        taken += 1;
                    }
                    before = [cell.axes(); 2];
                    // The position 2 ms ago is unknown: the next difference counts from here.
                    cell.pass(step);
                    before[1] = cell.axes();
                }
            }
        }
        cell.command(&["clearAlarm"]);
        cell.command(&["modifyGSPD", "1000"]);
        cell.pass(1.0);
        cell.command(&["startButton"]);
        cell.pass(120.0);
        let seen = cell.query(&["RemoteCmdLen", "isMoving", "curAlarm"]);
        prop_assert_eq!(seen, vec![json!("0"), json!("0"), json!("0")]);
        prop_assert_eq!(cell.controller.machine().list().completed(), taken, "each step ends once");
        assert_near(cell.axes(), [goal[0], goal[1], 0.0, 0.0, 0.0, 0.0], 1e-5);
    }
}
