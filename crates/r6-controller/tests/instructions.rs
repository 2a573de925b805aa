//! The effect of each instruction in the list (manual 6.1 and later).

mod common;

use common::{Cell, assert_near, axis_move, linear_move};
use r6_controller::{ControllerSettings, Profile, RobotModel, SavedState};
use serde_json::{Value, json};

fn wait(seconds: &str) -> Value {
    json!({"oneshot": "1", "action": "100", "type": "100", "limit": seconds})
}

#[test]
fn instruction_4_moves_the_axes_together() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([axis_move([40.0, -20.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    cell.pass(0.9);
    let [j1, j2, ..] = cell.axes();
    assert!(j1 > 1.0 && j1 < 39.0, "{j1}");
    assert!((j2 / j1 + 0.5).abs() < 1e-6, "both are equally far: {j1}, {j2}");
    cell.pass(10.0);
    assert_near(cell.axes(), [40.0, -20.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
}

#[test]
fn instruction_4_keeps_axes_outside_the_mask() {
    let mut cell = Cell::new();
    let mut step = axis_move([10.0, 20.0, 30.0, 0.0, 0.0, 0.0], 50.0);
    step["ckStatus"] = json!("0x05");
    cell.run_ok(&json!([step]));
    cell.pass(10.0);
    assert_near(cell.axes(), [10.0, 0.0, 30.0, 0.0, 0.0, 0.0], 1e-6);
}

#[test]
fn instruction_4_goes_at_speed_times_global_speed() {
    // field figures, unit B's law with the 0707A's own maximum: 10 % of 10 % of 220.8 deg/s.
    let mut cell = Cell::new();
    cell.ok(&["modifyGSPD", "100"]);
    cell.run_ok(&json!([axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    cell.pass(1.0);
    let before = cell.number("axis-0");
    cell.pass(1.0);
    assert!((cell.number("axis-0") - before - 2.208).abs() < 1e-4);
}

#[test]
fn instruction_4_waits_for_its_delay() {
    let mut cell = Cell::new();
    let mut step = axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0);
    step["delay"] = json!("1.0");
    cell.run_ok(&json!([step]));
    cell.pass(0.98);
    assert_eq!(
        cell.query(&["axis-0", "isMoving", "RemoteCmdLen"]),
        [json!("0.000000"), json!("0"), json!("1")]
    );
    cell.pass(10.0);
    assert_eq!(cell.text("axis-0"), "10.000000");
}

#[test]
fn instruction_4_without_a_speed_raises_219() {
    let mut cell = Cell::new();
    let mut step = axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0);
    step.as_object_mut().unwrap().remove("speed");
    cell.run_ok(&json!([step]));
    assert_eq!(
        cell.query(&["curAlarm", "isMoving", "axis-0"]),
        [json!("219"), json!("0"), json!("0.000000")]
    );
}

#[test]
fn instruction_10_goes_straight() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 0.0], 100.0)]));
    cell.pass(5.0);
    let start = cell.world();
    let mut end = start;
    end[0] += 60.0;
    end[1] += 80.0;
    // 5 % of 2000 mm/s at 10 %: 10 mm/s for 100 mm.
    cell.ok(&["modifyGSPD", "100"]);
    cell.run_ok(&json!([linear_move(end, 5.0)]));
    // Half of the distance, and half of the ramp and its filter.
    cell.pass(5.0 + 0.189 - 0.018);
    let middle = cell.world();
    assert!((middle[0] - start[0] - 30.0).abs() < 1.0, "{middle:?}");
    let off = ((middle[1] - start[1]) * 60.0 - (middle[0] - start[0]) * 80.0).abs() / 100.0;
    assert!(off < 0.01 && (middle[2] - start[2]).abs() < 0.01, "{off} mm off the line");
    cell.pass(10.0);
    assert_near(cell.world(), end, 1e-4);
}

#[test]
fn instruction_10_speed_is_a_share_of_2000_mm_per_second() {
    // Reported, unit B, at global speed 5 %: 5, 10 and 20 % give 5, 10 and 20 mm/s.
    for percent in [5.0, 10.0, 20.0] {
        let mut cell = Cell::new();
        cell.run_ok(&json!([axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 0.0], 100.0)]));
        cell.pass(5.0);
        let mut end = cell.world();
        end[1] += 150.0;
        cell.ok(&["modifyGSPD", "50"]);
        cell.run_ok(&json!([linear_move(end, percent)]));
        cell.pass(1.0);
        let before = cell.number("world-1");
        cell.pass(1.0);
        let speed = cell.number("world-1") - before;
        assert!((speed - percent).abs() < 0.01, "{percent} %: {speed} mm/s");
    }
}

#[test]
fn instruction_10_out_of_reach_raises_200() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([linear_move([5000.0, 0.0, 500.0, 180.0, 0.0, 0.0], 5.0)]));
    assert_eq!(cell.query(&["curAlarm", "curMode", "isMoving"]), [json!("200"), json!("2"), json!("0")]);
}

#[test]
fn instruction_17_goes_through_the_middle() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 0.0], 100.0)]));
    cell.pass(5.0);
    let start = cell.world();
    let mut step = linear_move(start, 5.0);
    step["action"] = json!("17");
    // Half a circle of radius 50 around (start.x, start.y + 50).
    step["m0"] = json!(format!("{:.6}", start[0] + 50.0));
    step["m1"] = json!(format!("{:.6}", start[1] + 50.0));
    for (n, value) in start.into_iter().enumerate() {
        let offset = if n == 1 { 100.0 } else { 0.0 };
        step[format!("m{n}_p")] = json!(format!("{:.6}", value + offset));
    }
    cell.ok(&["modifyGSPD", "100"]);
    // A curve needs a line before it in its list: here a line to the present position of the tool.
    cell.run_ok(&json!([linear_move(start, 5.0), step]));
    let mut farthest: f64 = 0.0;
    for _ in 0..180 {
        cell.pass(0.1);
        let here = cell.world();
        let radius = ((here[0] - start[0]).powi(2) + (here[1] - start[1] - 50.0).powi(2)).sqrt();
        assert!((radius - 50.0).abs() < 0.02, "{radius}");
        farthest = farthest.max(here[0] - start[0]);
    }
    assert!((farthest - 50.0).abs() < 0.5, "{farthest}");
    assert!((cell.number("world-1") - start[1] - 100.0).abs() < 1e-3);
}

#[test]
fn instruction_51_gives_lines_a_speed_in_mm_per_second() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 0.0], 100.0)]));
    cell.pass(5.0);
    let mut end = cell.world();
    end[1] += 100.0;
    let mut line = linear_move(end, 5.0);
    line.as_object_mut().unwrap().remove("speed");
    cell.run_ok(&json!([{"oneshot": "1", "action": "51", "isUse": "1", "speed": "20"}, line]));
    cell.pass(1.0);
    let before = cell.number("world-1");
    cell.pass(1.0);
    assert!((cell.number("world-1") - before - 20.0).abs() < 0.01);
    // A fraction raised alarm 219 (reported, unit B).
    let mut cell = Cell::new();
    cell.run_ok(&json!([{"oneshot": "1", "action": "51", "isUse": "1", "speed": "0.05"}]));
    assert_eq!(cell.text("curAlarm"), "219");
    let log = cell.log();
    assert!(log.contains("the path speed 0.05 is no whole number of mm/s from 1"), "{log}");
}

#[test]
fn instruction_52_stops_the_move_at_the_signal() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([
        {"oneshot": "1", "action": "52", "isUse": "1", "ioNumber": "3", "io_status": "1"},
        axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0),
        {"oneshot": "1", "action": "52", "isUse": "0", "ioNumber": "3", "io_status": "1"},
        axis_move([0.0, 5.0, 0.0, 0.0, 0.0, 0.0], 100.0),
    ]));
    cell.pass(1.0);
    let at_signal = cell.number("axis-0");
    cell.controller.set_input(cell.now, 0, 3, true);
    cell.pass(0.078);
    let rest = cell.number("axis-0");
    assert!(rest > at_signal && rest - at_signal < 22.08 * 0.078, "{at_signal} to {rest}");
    cell.pass(10.0);
    // The next instructions follow. The watch has ended, so the signal no longer stops anything.
    assert_eq!(
        cell.query(&["axis-1", "curAlarm", "RemoteCmdLen"]),
        [json!("5.000000"), json!("0"), json!("0")]
    );
}

#[test]
fn instruction_100_waits_for_its_signal() {
    let cases = [
        (json!({"type": "0", "point": "4", "io_status": "1"}), vec![true]),
        (json!({"type": "0", "point": "4", "io_status": "2"}), vec![true]),
        (json!({"type": "0", "point": "4", "io_status": "3"}), vec![true, false]),
    ];
    for (mut step, levels) in cases {
        let mut cell = Cell::new();
        step["oneshot"] = json!("1");
        step["action"] = json!("100");
        step["limit"] = json!("0");
        step["isUnlimit"] = json!("1");
        cell.run_ok(&json!([step, {"oneshot": "1", "action": "200", "type": "0", "point": "1", "io_status": "1", "delay": "0"}]));
        for level in levels {
            cell.pass(60.0);
            assert_eq!(
                cell.query(&["RemoteCmdLen", "output-0", "isMoving"]),
                [json!("2"), json!("0"), json!("0")]
            );
            cell.controller.set_input(cell.now, 0, 4, level);
        }
        assert_eq!(cell.query(&["RemoteCmdLen", "output-0"]), [json!("0"), json!("2")], "{step}");
    }
}

#[test]
fn instruction_100_watches_m_points() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([{"oneshot": "1", "action": "100", "type": "5", "point": "1", "io_status": "1", "limit": "5", "isUnlimit": "0"}]));
    cell.pass(1.0);
    assert_eq!(cell.text("RemoteCmdLen"), "1");
    cell.ok(&["modifyOutput", "4", "1", "1"]);
    assert_eq!(cell.query(&["RemoteCmdLen", "curAlarm"]), [json!("0"), json!("0")]);
}

#[test]
fn instruction_100_raises_an_alarm_when_it_runs_out() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([{"oneshot": "1", "action": "100", "type": "2", "point": "5", "io_status": "1", "limit": "0.5", "isUnlimit": "0"}]));
    cell.pass(0.4);
    assert_eq!(cell.text("curAlarm"), "0");
    cell.pass(0.2);
    // 2048 + class 0 (input), board 2, point 5.
    assert_eq!(cell.text("curAlarm"), (2048 + (2 << 5) + 5).to_string());
}

#[test]
fn instruction_100_type_100_lets_time_pass() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([wait("2.5"), axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0)]));
    cell.pass(2.4);
    assert_eq!(cell.query(&["isMoving", "RemoteCmdLen"]), [json!("0"), json!("2")]);
    cell.pass(0.2);
    assert_eq!(cell.query(&["isMoving", "RemoteCmdLen"]), [json!("1"), json!("1")]);
}

#[test]
fn instruction_200_sets_outputs() {
    let output = |kind: &str, point: &str, delay: &str| json!({"oneshot": "1", "action": "200", "type": kind, "io_status": "1", "point": point, "delay": delay});
    let mut cell = Cell::new();
    cell.run_ok(&json!([
        output("0", "0", "0"),
        output("5", "3", "0"),
        output("7", "2", "0"),
        output("0", "32", "0")
    ]));
    assert_eq!(cell.query(&["output-0", "M-0", "output-1"]), [json!("1"), json!("8"), json!("1")]);
    assert!(cell.controller.output(cell.now, r6_controller::io::OutputPoint::Eu(2)));
    // A delay comes before the output.
    cell.run_ok(&json!([output("0", "4", "1")]));
    cell.pass(0.9);
    assert_eq!(cell.text("output-0"), "1");
    cell.pass(0.2);
    assert_eq!(cell.text("output-0"), "17");
    // A timed output goes back on its own, and the list does not wait for it.
    cell.run_ok(&json!([output("100", "8", "2")]));
    assert_eq!(cell.query(&["output-0", "RemoteCmdLen"]), [json!("273"), json!("0")]);
    cell.pass(2.0);
    assert_eq!(cell.text("output-0"), "17");
}

#[test]
fn instruction_204_sets_a_whole_board() {
    // The later manual's examples: Y010, Y012, Y020, Y025 on, Y013, Y021, Y024 off; Y030, Y040 on, Y031, Y041
    // off.
    let mut cell = Cell::new();
    cell.ok(&["modifyOutput", "0", "3", "1"]);
    cell.ok(&["modifyOutput", "0", "4", "1"]);
    cell.run_ok(
        &json!([{"oneshot": "1", "action": "204", "type": "0", "point": "151388258", "point2": "393222"}]),
    );
    let on = 1 << 0 | 1 << 2 | 1 << 8 | 1 << 13 | 1 << 16 | 1 << 24;
    let untouched = 1 << 4;
    assert_eq!(cell.text("output-0"), (on | untouched).to_string());
    cell.run_ok(&json!([{"oneshot": "1", "action": "204", "type": "6", "point": "10"}]));
    assert_eq!(cell.text("M-1"), "3");
}

#[test]
fn instruction_800_changes_the_workbench() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([{"oneshot": "1", "action": "800", "cnt_id": "3"}]));
    assert_eq!(cell.value("toolCoord"), json!(["0", "3", "0"]));
}

#[test]
fn an_unknown_action_is_refused_and_nothing_runs() {
    let mut cell = Cell::new();
    let steps = json!([axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0), {"oneshot": "1", "action": "14", "m0": "1"}]);
    assert_eq!(cell.run(&steps), ["AddRCC", "err"]);
    assert_eq!(cell.query(&["isMoving", "RemoteCmdLen"]), [json!("0"), json!("0")]);
    assert!(cell.log().contains("action 14 is not known"));
}

#[test]
fn kept_steps_run_again_and_again_until_stopped() {
    let mut cell = Cell::new();
    let mut there = axis_move([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0);
    let mut back = axis_move([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0);
    there["oneshot"] = json!("0");
    back["oneshot"] = json!("0");
    cell.run_ok(&json!([there, back]));
    cell.pass(100.0);
    assert_eq!(cell.query(&["isMoving", "RemoteCmdLen"]), [json!("1"), json!("2")]);
    assert!(cell.controller.machine().list().completed() > 100);
    cell.ok(&["actionStop"]);
    cell.pass(1.0);
    assert_eq!(cell.text("isMoving"), "0");
}

#[test]
fn kept_steps_that_take_no_time_do_not_hang_the_controller() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([{"oneshot": "0", "action": "800", "cnt_id": "1"}, {"oneshot": "0", "action": "800", "cnt_id": "2"}]));
    cell.pass(1.0);
    let completed = cell.controller.machine().list().completed();
    assert!((500..=5_000).contains(&completed), "{completed} in a second");
}

#[test]
fn empty_list_0_at_rest_runs_exactly_once() {
    // Reported, unit A, experiment E2.
    let mut cell = Cell::new();
    cell.append_ok(&json!([axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]));
    cell.pass(20.0);
    assert_eq!(cell.query(&["axis-0", "RemoteCmdLen"]), [json!("10.000000"), json!("0")]);
    assert_eq!(cell.controller.machine().list().completed(), 1);
}

#[test]
fn empty_list_0_while_moving_runs_behind() {
    // Reported, unit A, experiment E3.
    let mut cell = Cell::new();
    cell.run_ok(&json!([axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    cell.append_ok(&json!([axis_move([10.0, 10.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    assert_eq!(cell.text("RemoteCmdLen"), "2");
    cell.pass(20.0);
    assert_near(cell.axes(), [10.0, 10.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
    assert_eq!(cell.text("curAlarm"), "0");
}

#[test]
fn empty_list_1_while_moving_raises_200_on_hc1() {
    // Reported, unit A.
    let mut cell = Cell::new();
    cell.run_ok(&json!([axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    cell.pass(1.0);
    assert_eq!(cell.run(&json!([axis_move([0.0; 6], 10.0)])), ["AddRCC", "err"]);
    cell.pass(1.0);
    assert_eq!(cell.query(&["curAlarm", "isMoving", "RemoteCmdLen"]), [json!("200"), json!("0"), json!("0")]);
}

#[test]
fn empty_list_1_while_moving_takes_over_without_a_stop_where_the_profile_says_so() {
    let profile = Profile::from_toml("replace_in_motion = \"take-over\"").unwrap();
    let mut cell = Cell::with(profile, Default::default());
    cell.run_ok(&json!([axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    cell.pass(1.0);
    let speed = cell.number("curSpeed-0");
    // An output before the move is set at once.
    cell.run_ok(&json!([
        {"oneshot": "1", "action": "200", "type": "0", "io_status": "1", "point": "3"},
        axis_move([40.0, 5.0, 0.0, 0.0, 0.0, 0.0], 10.0),
        axis_move([0.0, 5.0, 0.0, 0.0, 0.0, 0.0], 10.0),
    ]));
    assert_eq!(cell.query(&["output-0", "RemoteCmdLen"]), [json!("8"), json!("2")]);
    for _ in 0..50 {
        cell.pass(0.01);
        assert_eq!(cell.text("isMoving"), "1");
        assert!(cell.number("curSpeed-0") >= speed - 1.0, "J1 goes on as it went");
    }
    cell.pass(30.0);
    assert_near(cell.axes(), [0.0, 5.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
    assert_eq!(cell.query(&["curAlarm", "RemoteCmdLen"]), [json!("0"), json!("0")]);
}

/// Twenty targets a second, each replacing the one before: the arm follows and never rests.
#[test]
fn a_target_that_moves_on_is_followed() {
    let profile = Profile::from_toml("replace_in_motion = \"take-over\"\nadd_rcc_ack_ms = 0").unwrap();
    let mut cell = Cell::with(profile, Default::default());
    for n in 1..=100 {
        let target = 0.5 * f64::from(n);
        cell.run_ok(&json!([axis_move([target, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]));
        cell.pass(0.05);
        if n > 20 {
            let (place, rpm) = (cell.number("axis-0"), cell.number("curSpeed-0"));
            assert!(rpm > 50.0, "10 degrees a second is 167 RPM, at target {target}: {rpm}");
            assert!((target - 12.0..target).contains(&place), "{place} of {target}");
        }
    }
    cell.pass(2.0);
    assert_near(cell.axes(), [50.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
}

/// If a target cannot be reached in mid-move, the arm stops first, and then raises its alarm.
#[test]
fn a_list_that_cannot_take_over_stops_the_arm_first() {
    let profile = Profile::from_toml("replace_in_motion = \"take-over\"").unwrap();
    for (next, alarm) in [
        (axis_move([156.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0), "130"),
        (json!({"oneshot": "1", "action": "100", "type": "100", "limit": "5"}), "0"),
    ] {
        let mut cell = Cell::with(profile.clone(), Default::default());
        cell.run_ok(&json!([axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
        cell.pass(1.0);
        cell.run_ok(&json!([next]));
        cell.pass(0.1);
        assert_eq!(cell.query(&["isMoving", "curAlarm"]), [json!("0"), json!(alarm)]);
    }
}

#[test]
fn an_empty_list_clears_what_is_left() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    cell.ok(&["actionStop"]);
    cell.pass(1.0);
    assert_eq!(cell.text("RemoteCmdLen"), "1");
    // Allowed although the mode is no longer 7, because it moves nothing.
    cell.run_ok(&json!([]));
    assert_eq!(cell.text("RemoteCmdLen"), "0");
    cell.ok(&["startButton"]);
    cell.pass(1.0);
    assert_eq!(cell.text("isMoving"), "0");
}

#[test]
fn a_list_is_refused_while_no_program_waits() {
    let steps = json!([axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]);
    let mut cell = Cell::with(Profile::hc1(), r6_controller::StartState::Auto);
    assert_eq!(cell.run(&steps), ["AddRCC", "err"]);
    assert!(cell.log().contains("no program waits for remote commands"));
    let silent = Profile::from_toml("add_rcc_unarmed = \"silent\"").unwrap();
    let mut cell = Cell::with(silent, r6_controller::StartState::Auto);
    cell.add_rcc("1", &steps);
    cell.pass(8.0);
    assert_eq!(cell.frame(), None);
    assert_eq!(cell.query(&["isMoving", "RemoteCmdLen"]), [json!("0"), json!("0")]);
    // On a later unit AddRCC changes the mode from 2 to 7 (reported, unit B).
    let arm = Profile::from_toml("add_rcc_unarmed = \"arm\"").unwrap();
    let mut cell = Cell::with(arm, r6_controller::StartState::Auto);
    cell.run_ok(&steps);
    assert_eq!(cell.query(&["isMoving", "curMode"]), [json!("1"), json!("7")]);
}

#[test]
fn the_manuals_own_list_runs() {
    let mut cell = Cell::new();
    cell.send(include_str!("../../../examples/programs/manual-6-1-1-axis-move.json"));
    cell.pass(0.018);
    assert!(cell.frame().unwrap().contains(r#""cmdReply":["AddRCC","ok"]"#));
    cell.pass(30.0);
    assert_near(cell.axes(), [0.0, 0.0, 0.0, 0.0, -90.0, 0.0], 1e-6);
}

#[test]
fn instruction_10_uses_its_own_tool() {
    let mut cell = Cell::new();
    cell.ok(&["modifyTool", "1", "0", "0", "100000", "0", "0", "0"]);
    cell.run_ok(&json!([axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 0.0], 100.0)]));
    cell.pass(5.0);
    let flange = cell.world();
    cell.ok(&["switchTool", "1"]);
    let tip = cell.world();
    cell.ok(&["switchTool", "0"]);
    // Tool 1 is already at `tip`: for a move there with tool 1 the arm stays; with tool 0 it moves.
    let mut step = linear_move(tip, 5.0);
    step["tool"] = json!("1");
    cell.run_ok(&json!([step]));
    cell.pass(20.0);
    assert_near(cell.world(), flange, 1e-3);
    cell.run_ok(&json!([linear_move(tip, 5.0)]));
    cell.pass(20.0);
    assert_near(cell.world(), tip, 1e-3);
}

/// Workbench 2 comes from a saved state, because no command defines one.
#[test]
fn a_step_is_told_in_its_own_workbench() {
    let bench = [100.0, 50.0, -20.0];
    let mut saved: serde_json::Value =
        serde_json::from_str(&Cell::new().controller.machine().saved().to_json()).unwrap();
    saved["benches"] = json!({"2": [bench[0], bench[1], bench[2], 0.0, 0.0, 0.0]});
    let saved = SavedState::from_json(&saved.to_string()).unwrap();
    let model = RobotModel::named("BRTIRUS0707A").unwrap().clone();
    for action in ["10", "17", "4"] {
        let mut cell = Cell::restored(ControllerSettings::new(Profile::hc1(), model.clone()), &saved);
        cell.ok(&["startButton"]);
        cell.run_ok(&json!([axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 0.0], 100.0)]));
        cell.pass(5.0);
        let from = cell.world();
        if action == "17" {
            // A curve needs a line before it in its list.
            cell.run_ok(&json!([linear_move(from, 5.0)]));
            cell.pass(5.0);
        }
        let on_bench: [f64; 6] =
            std::array::from_fn(|n| from[n] - bench.get(n).unwrap_or(&0.0) + if n == 1 { 30.0 } else { 0.0 });
        let mut step = linear_move(on_bench, 5.0);
        step["coord"] = json!("2");
        if action == "17" {
            let middle: [f64; 6] = std::array::from_fn(|n| {
                on_bench[n]
                    - match n {
                        1 => 15.0,
                        2 => -10.0,
                        _ => 0.0,
                    }
            });
            step = linear_move(middle, 5.0);
            step["action"] = json!("17");
            step["coord"] = json!("2");
            for (n, value) in on_bench.iter().enumerate() {
                step[format!("m{n}_p")] = json!(format!("{value:.6}"));
            }
        }
        if action == "4" {
            // Axis positions do not depend on the workbench.
            step = axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 5.0], 50.0);
            step["coord"] = json!("2");
        }
        cell.append_ok(&json!([step]));
        cell.pass(20.0);
        if action == "4" {
            assert_near(cell.axes(), [0.0, -20.0, 10.0, 0.0, 40.0, 5.0], 1e-6);
        } else {
            let [x, y, z, ..] = from;
            let [to_x, to_y, to_z, ..] = cell.world();
            assert_near([to_x, to_y, to_z, 0.0, 0.0, 0.0], [x, y + 30.0, z, 0.0, 0.0, 0.0], 1e-3);
        }
        assert_eq!(cell.text("curAlarm"), "0", "action {action}");
    }
}

#[test]
fn every_example_program_runs_without_an_alarm() {
    let programs = [
        include_str!("../../../examples/programs/blend-j1.json"),
        include_str!("../../../examples/programs/io-and-wait.json"),
        include_str!("../../../examples/programs/square-linear.json"),
        include_str!("../../../examples/programs/tool-and-bench.json"),
    ];
    for program in programs {
        let mut cell = Cell::new();
        cell.send(program);
        cell.pass(0.018);
        assert!(cell.frame().unwrap().contains(r#""cmdReply":["AddRCC","ok"]"#), "{program}");
        cell.pass(600.0);
        assert_eq!(
            cell.query(&["curAlarm", "isMoving", "RemoteCmdLen", "curMode"]),
            [json!("0"), json!("0"), json!("0"), json!("7")],
            "{program}"
        );
    }
}
