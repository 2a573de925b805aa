//! Interruptions: loops that take no time, pauses, stops at the edge of a move, a speed of 0, new lists.

mod common;

use std::sync::Arc;

use common::{Cell, axis_move};
use r6_controller::{ControllerSettings, Profile, RobotModel, Scenario};
use serde_json::{Value, json};

fn moved(j1: f64, speed: f64) -> Value {
    axis_move([j1, 0.0, 0.0, 0.0, 0.0, 0.0], speed)
}

#[test]
fn kept_steps_of_a_nanosecond_do_not_hang_the_controller() {
    let steps = [
        json!({"oneshot": "0", "action": "100", "type": "100", "limit": "0.000000001"}),
        json!({"oneshot": "0", "action": "200", "type": "0", "point": "1", "io_status": "1", "delay": "0.000000001"}),
        json!({"oneshot": "0", "action": "200", "type": "100", "point": "1", "io_status": "1", "delay": "0.000000001"}),
        json!({"oneshot": "0", "action": "4", "m0": "0", "speed": "100", "delay": "0.00000001"}),
        json!({"oneshot": "0", "action": "4", "m0": "0.000000001", "speed": "100"}),
    ];
    for step in steps {
        let mut cell = Cell::new();
        cell.run_ok(&json!([step]));
        cell.pass(1.0);
        let completed = cell.controller.machine().list().completed();
        assert!((1..=2_000).contains(&completed), "{completed} in a second: {step}");
        cell.ok(&["actionStop"]);
    }
}

#[test]
fn a_paused_controller_does_nothing_until_it_is_started() {
    // An output that waits for its delay.
    let mut cell = Cell::new();
    cell.run_ok(&json!([{"oneshot": "1", "action": "200", "type": "0", "point": "3", "io_status": "1", "delay": "1"}]));
    cell.ok(&["actionPause"]);
    cell.pass(60.0);
    assert_eq!(cell.query(&["output-0", "curMode"]), [json!("0"), json!("2")]);
    cell.ok(&["startButton"]);
    cell.pass(0.9);
    assert_eq!(cell.text("output-0"), "0", "what is left of its time has to pass");
    cell.pass(0.1);
    assert_eq!(cell.text("output-0"), "8");

    // A wait with a limit; its signal comes during the pause.
    let mut cell = Cell::new();
    cell.run_ok(&json!([{"oneshot": "1", "action": "100", "type": "0", "point": "3", "io_status": "1", "limit": "1"}]));
    cell.ok(&["actionPause"]);
    cell.pass(60.0);
    assert_eq!(cell.query(&["curAlarm", "RemoteCmdLen"]), [json!("0"), json!("1")]);
    cell.controller.set_input(cell.now, 0, 3, true);
    cell.pass(1.0);
    assert_eq!(cell.text("RemoteCmdLen"), "1", "the signal is seen only once it runs again");
    cell.ok(&["startButton"]);
    assert_eq!(cell.query(&["curAlarm", "RemoteCmdLen", "curMode"]), [json!("0"), json!("0"), json!("7")]);
}

#[test]
fn global_speed_0_and_back_goes_on() {
    for back_after in [0.1, 2.0] {
        let mut cell = Cell::new();
        cell.run_ok(&json!([moved(90.0, 10.0)]));
        cell.pass(1.0);
        cell.ok(&["modifyGSPD", "0"]);
        cell.pass(back_after);
        cell.ok(&["modifyGSPD", "1000"]);
        cell.pass(10.0);
        assert_eq!(
            cell.query(&["axis-0", "RemoteCmdLen"]),
            [json!("90.000000"), json!("0")],
            "{back_after} s"
        );
    }
    // A move that begins at speed 0 waits for a speed.
    let mut cell = Cell::new();
    cell.ok(&["modifyGSPD", "0"]);
    cell.run_ok(&json!([moved(10.0, 100.0)]));
    cell.pass(5.0);
    assert_eq!(
        cell.query(&["axis-0", "curAlarm", "RemoteCmdLen"]),
        [json!("0.000000"), json!("0"), json!("1")]
    );
    cell.ok(&["modifyGSPD", "500"]);
    cell.pass(5.0);
    assert_eq!(cell.query(&["axis-0", "RemoteCmdLen"]), [json!("10.000000"), json!("0")]);
}

#[test]
fn a_list_that_replaces_one_stopped_by_a_signal_begins_at_its_first_step() {
    let profile = Profile::from_toml("replace_in_motion = \"take-over\"").unwrap();
    let mut cell = Cell::with(profile, Default::default());
    cell.run_ok(&json!([
        {"oneshot": "1", "action": "52", "isUse": "1", "ioNumber": "3", "io_status": "1"},
        moved(90.0, 10.0),
    ]));
    cell.pass(1.0);
    cell.controller.set_input(cell.now, 0, 3, true);
    cell.pass(0.02);
    cell.run_ok(&json!([{"oneshot": "1", "action": "800", "cnt_id": "9"}]));
    cell.pass(1.0);
    assert_eq!(cell.value("toolCoord"), json!(["0", "9", "0"]));
}

#[test]
fn a_stop_at_the_very_end_of_a_move_finishes_that_move_and_no_other() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([{"oneshot": "0", "action": "800", "cnt_id": "1"}, moved(5.0, 100.0)]));
    // The move takes about 0.4 s; stop in its last hundredths, too late to rest before the end.
    let mut left = 0.0;
    while cell.number("axis-0") < 4.999 {
        cell.pass(0.002);
        left += 0.002;
        assert!(left < 2.0);
    }
    cell.ok(&["actionStop"]);
    cell.pass(1.0);
    assert_eq!(cell.query(&["axis-0", "RemoteCmdLen"]), [json!("5.000000"), json!("1")]);
    assert_eq!(cell.controller.machine().list().position(), 0, "the next start begins with the first step");
}

#[test]
fn the_list_can_be_cleared_right_behind_a_stop() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([moved(90.0, 10.0)]));
    cell.pass(1.0);
    cell.ok(&["actionStop"]);
    assert_eq!(cell.text("isMoving"), "1", "it still slows down");
    assert_eq!(cell.run(&json!([])), ["AddRCC", "ok"]);
    cell.pass(1.0);
    assert_eq!(cell.query(&["curAlarm", "isMoving", "RemoteCmdLen"]), [json!("0"), json!("0"), json!("0")]);
}

#[test]
fn a_stop_button_pressed_twice_ends_the_cycle() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([moved(90.0, 10.0)]));
    cell.pass(0.5);
    cell.ok(&["stopButton"]);
    cell.ok(&["stopButton"]);
    cell.pass(5.0);
    assert_eq!(cell.number("curCycle"), 0.0);
}

#[test]
fn what_is_refused_changes_nothing() {
    let mut host = Cell::with_profile("r6-host");
    assert_eq!(host.command(&["modifyCounter", "0", "7", "9"])[1], "err");
    assert_eq!(host.value("counter-0"), json!(["0", "0", "0"]));
    let mut cell = Cell::with(Profile::hc1(), r6_controller::StartState::Manual);
    cell.controller.set_input(cell.now, 0, 0, true);
    cell.send(r#"{"reqType":"heartbreak"}"#);
    cell.pass(11.0);
    assert_eq!(cell.text("curAlarm"), "9");
    assert_eq!(cell.command(&["clearAlarmContinue"])[1], "err");
    assert_eq!(cell.text("curAlarm"), "9", "refused, so it is still there");
}

#[test]
fn a_heartbreak_sent_as_a_command_can_be_accepted() {
    let profile = Profile::from_toml("accepts_heartbreak_command = true").unwrap();
    let mut cell = Cell::with(profile, Default::default());
    cell.ok(&["heartbreak"]);
    cell.pass(9.0);
    cell.ok(&["heartbreak"]);
    cell.pass(9.0);
    assert_eq!(cell.text("curAlarm"), "0");
    cell.pass(2.0);
    assert_eq!(cell.text("curAlarm"), "9");
}

#[test]
fn turning_the_key_stops_the_motion_and_nothing_starts_by_itself() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([moved(90.0, 10.0)]));
    cell.pass(1.0);
    cell.controller.turn_key(cell.now, r6_controller::Key::Manual);
    cell.pass(1.0);
    let rest = cell.number("axis-0");
    cell.controller.turn_key(cell.now, r6_controller::Key::Auto);
    cell.pass(10.0);
    assert_eq!(cell.query(&["isMoving", "curMode", "RemoteCmdLen"]), [json!("0"), json!("2"), json!("1")]);
    assert!(cell.number("axis-0") == rest && rest < 80.0);
}

#[test]
fn a_lost_connection_keeps_its_place_until_the_mains_fail() {
    let scenario = Scenario::read("[[at]]\ntime = 60\ndo = \"power-cut\"\nfor = 5\n").unwrap();
    let model = RobotModel::default();
    let mut settings = ControllerSettings::new(Profile::from_toml("max_connections = 2").unwrap(), model);
    settings.scenario = Some(Arc::new(scenario));
    let mut cell = Cell::of(settings);
    let query = br#"{"reqType":"query","queryAddr":["curMode"]}"#;
    let is_served = |cell: &mut Cell, id| {
        cell.controller.handle_input(cell.now, id, query);
        cell.controller.poll_transmit(cell.now, id).is_some()
    };
    let (first, second) = (cell.id, cell.controller.connect(cell.now));
    assert!(is_served(&mut cell, first) && is_served(&mut cell, second));
    // In the middle of a frame, and with a delayed reply: neither may continue.
    cell.controller.handle_input(
        cell.now,
        first,
        br#"{"reqType":"AddRCC","emptyList":"1","instructions":[]}{"#,
    );
    cell.controller.lose(first);
    assert_eq!((cell.controller.next_transmit(first), cell.controller.is_over(first)), (None, false));
    cell.controller.request_photo(cell.now, 1);
    assert!(cell.controller.poll_transmit(cell.now, first).is_none());
    assert!(cell.controller.poll_transmit(cell.now, second).is_some(), "the photo request");
    let ignored = cell.controller.connect(cell.now);
    assert!(!is_served(&mut cell, ignored) && is_served(&mut cell, second));
    // A lost connection that was never served takes no place from the others.
    cell.controller.lose(ignored);
    assert!(cell.controller.is_over(ignored));
    assert_eq!(cell.controller.snapshot(cell.now).connections, 2);
    cell.pass(70.0);
    assert!(cell.controller.is_over(first) && cell.controller.is_over(second));
    cell.controller.disconnect(second);
    assert_eq!(cell.controller.snapshot(cell.now).connections, 0);
    for _ in 0..2 {
        let id = cell.controller.connect(cell.now);
        assert!(is_served(&mut cell, id));
    }
}
