//! Every command (manual 4.2.1 and clearAlarm) and its effect.

mod common;

use common::{Cell, assert_near, axis_move, linear_move};
use r6_controller::{Key, Profile, StartState};
use serde_json::{Value, json};

fn long_move() -> Value {
    // 90 degrees of J1 at 10 % of 220.8 deg/s: about 4.3 s.
    axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0)
}

fn moving_cell() -> Cell {
    let mut cell = Cell::new();
    cell.run_ok(&json!([long_move()]));
    cell.pass(1.0);
    cell
}

#[test]
fn command_action_stop() {
    let mut cell = moving_cell();
    let before = cell.number("axis-0");
    cell.ok(&["actionStop"]);
    assert_eq!(cell.text("isMoving"), "1", "it still slows down");
    cell.pass(0.078);
    assert_eq!(cell.query(&["isMoving", "curMode", "curAlarm"]), [json!("0"), json!("2"), json!("0")]);
    let rest = cell.number("axis-0");
    // From 22.08 deg/s to rest within 0.078 s: at most 22.08 × 0.078 degrees.
    assert!(rest > before && rest - before < 22.08 * 0.078, "{before} to {rest}");
    cell.pass(60.0);
    assert_eq!(cell.number("axis-0"), rest);
    // The start button starts the left-over list again from its first step.
    assert_eq!(cell.text("RemoteCmdLen"), "1");
    cell.ok(&["startButton"]);
    cell.pass(10.0);
    assert_eq!(cell.text("axis-0"), "90.000000");
}

#[test]
fn command_action_pause() {
    let mut cell = moving_cell();
    cell.ok(&["actionPause"]);
    cell.pass(0.5);
    assert_eq!(cell.query(&["isMoving", "curMode", "curAlarm"]), [json!("0"), json!("2"), json!("0")]);
    let rest = cell.number("axis-0");
    assert!(rest > 10.0 && rest < 80.0, "{rest}");
    cell.pass(60.0);
    assert_eq!(cell.number("axis-0"), rest);
    cell.ok(&["startButton"]);
    assert_eq!(cell.query(&["isMoving", "curMode"]), [json!("1"), json!("7")]);
    cell.pass(10.0);
    assert_eq!(cell.query(&["axis-0", "RemoteCmdLen"]), [json!("90.000000"), json!("0")]);
}

#[test]
fn command_action_single_cycle() {
    let mut cell = Cell::new();
    let mut there = axis_move([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0);
    let mut back = axis_move([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0);
    there["oneshot"] = json!("0");
    back["oneshot"] = json!("0");
    cell.run_ok(&json!([there, back]));
    cell.pass(0.01);
    cell.ok(&["actionSingleCycle"]);
    assert_eq!(cell.text("curMode"), "9");
    cell.pass(20.0);
    // The pass is over. The list keeps its steps, but does not begin again.
    assert_eq!(
        cell.query(&["curMode", "isMoving", "RemoteCmdLen", "axis-0"]),
        [json!("2"), json!("0"), json!("2"), json!("0.000000")]
    );
}

#[test]
fn command_start_button() {
    for (start, mode) in [(StartState::Manual, "1"), (StartState::Stopped, "3")] {
        let mut cell = Cell::with(Profile::hc1(), start);
        assert_eq!(cell.text("curMode"), mode);
        let reply = cell.command(&["startButton"]);
        assert_eq!(&reply[..2], ["startButton", "err"]);
        assert!(reply[2].contains("automatic"), "{reply:?}");
        assert_eq!(cell.text("curMode"), mode);
        // The operator turns the key, and then it starts.
        cell.controller.turn_key(cell.now, Key::Auto);
        assert_eq!(cell.text("curMode"), "2");
        cell.ok(&["startButton"]);
        assert_eq!(cell.text("curMode"), "7");
    }
    let mut cell = Cell::with(Profile::hc1(), StartState::Auto);
    assert_eq!(cell.text("curMode"), "2");
    cell.ok(&["startButton"]);
    assert_eq!(cell.text("curMode"), "7");
}

#[test]
fn command_stop_button() {
    let mut cell = moving_cell();
    cell.ok(&["stopButton"]);
    // The first press does not stop the running instruction (reported, unit B); the cycle is finished (unit
    // C).
    cell.pass(0.5);
    assert_eq!(cell.query(&["isMoving", "curMode"]), [json!("1"), json!("7")]);
    cell.pass(10.0);
    assert_eq!(cell.query(&["isMoving", "curMode", "axis-0"]), [json!("0"), json!("2"), json!("90.000000")]);

    let mut cell = moving_cell();
    cell.ok(&["stopButton"]);
    cell.ok(&["stopButton"]);
    cell.pass(0.1);
    assert_eq!(cell.query(&["isMoving", "curMode"]), [json!("0"), json!("2")]);
    assert!(cell.number("axis-0") < 80.0);
}

#[test]
fn command_switch_mold() {
    let mut cell = Cell::new();
    cell.ok(&["switchMold", "default"]);
    // The other program does not wait for remote commands.
    assert_eq!(cell.run(&json!([long_move()])), ["AddRCC", "err"]);
    cell.ok(&["switchMold", "remote"]);
    cell.run_ok(&json!([long_move()]));
    assert_eq!(cell.text("isMoving"), "1");
    let reply = cell.command(&["switchMold", "remot"]);
    assert_eq!(
        (reply[1].as_str(), reply[2].as_str()),
        ("err", "there is no program `remot`; nearest: `remote`")
    );
    let reply = cell.command(&["switchMold", "default"]);
    assert_eq!((reply[1].as_str(), reply[2].as_str()), ("err", "the machine is moving"));
    assert_eq!(
        Cell::with_profile("r6-host").command(&["switchMold", "default"])[1],
        "err",
        "not on this port"
    );
}

#[test]
fn command_modify_counter() {
    let mut cell = Cell::new();
    cell.ok(&["modifyCounter", "0", "5", "100"]);
    cell.ok(&["modifyCounter", "0", "-1", "200"]);
    cell.ok(&["modifyCounter", "0", "6", "-1"]);
    assert_eq!(cell.value("counter-0"), json!([0, 200, 6]));
    // Captured, unit C: a counter that does not exist is answered ok nevertheless.
    cell.ok(&["modifyCounter", "3", "1", "1"]);
    assert_eq!(cell.value("counterList"), json!(["0", "2", "5"]));
    let mut host = Cell::with_profile("r6-host");
    assert_eq!(
        host.command(&["modifyCounter", "0", "1", "9"])[1],
        "err",
        "the target is not writable on this port"
    );
    assert_eq!(host.command(&["modifyCounter", "3", "1", "-1"])[1], "err");
}

#[test]
fn command_modify_output() {
    let mut cell = Cell::new();
    cell.ok(&["modifyOutput", "0", "0", "1"]);
    cell.ok(&["modifyOutput", "3", "31", "1"]);
    cell.ok(&["modifyOutput", "6", "4", "1"]);
    cell.ok(&["modifyOutput", "7", "2", "1"]);
    assert_eq!(cell.query(&["output-0", "output-3", "M-2"]), [json!("1"), json!("2147483648"), json!("16")]);
    let eu = r6_controller::io::OutputPoint::Eu(2);
    assert!(cell.controller.output(cell.now, eu));
    let mut pendant = Cell::with_profile("r6-pendant");
    assert_eq!(pendant.command(&["modifyOutput", "4", "0", "1"])[1], "err", "M is not on the pendant's port");
    assert_eq!(pendant.command(&["modifyOutput", "9", "0", "1"])[1], "err");
}

/// A list whose second step raises alarm 135.
fn alarmed_cell() -> Cell {
    let mut cell = Cell::new();
    cell.run_ok(&json!([
        axis_move([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0),
        axis_move([0.0, 0.0, 0.0, 0.0, 0.0, 350.0], 100.0),
        axis_move([15.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0),
    ]));
    cell.pass(10.0);
    assert_eq!(
        cell.query(&["curAlarm", "curMode", "isMoving", "axis-0", "RemoteCmdLen"]),
        [json!("135"), json!("2"), json!("0"), json!("5.000000"), json!("2")]
    );
    cell
}

#[test]
fn command_clear_alarm_run_next() {
    let mut cell = alarmed_cell();
    cell.ok(&["clearAlarmRunNext"]);
    cell.pass(10.0);
    assert_eq!(
        cell.query(&["curAlarm", "curMode", "axis-0", "RemoteCmdLen"]),
        [json!("0"), json!("7"), json!("15.000000"), json!("0")]
    );
}

#[test]
fn command_clear_alarm_continue() {
    // It continues with the same step: the alarm comes again.
    let mut cell = alarmed_cell();
    cell.ok(&["clearAlarmContinue"]);
    cell.pass(10.0);
    assert_eq!(cell.query(&["curAlarm", "RemoteCmdLen"]), [json!("135"), json!("2")]);
    // An alarm without a lasting cause: the program continues.
    let mut cell = moving_cell();
    cell.send(r#"{"reqType":"heartbreak"}"#);
    cell.pass(10.0);
    assert_eq!(cell.query(&["curAlarm", "curMode"]), [json!("9"), json!("2")]);
    cell.ok(&["clearAlarmContinue"]);
    assert_eq!(cell.query(&["curAlarm", "curMode"]), [json!("0"), json!("7")]);
}

#[test]
fn command_clear_alarm() {
    let mut cell = alarmed_cell();
    cell.ok(&["clearAlarm"]);
    cell.pass(10.0);
    // Nothing starts on its own: the mode stays, and so does the list.
    assert_eq!(
        cell.query(&["curAlarm", "curMode", "isMoving", "RemoteCmdLen"]),
        [json!("0"), json!("2"), json!("0"), json!("2")]
    );
    assert_eq!(Cell::with_profile("r6-host").command(&["clearAlarm"])[1], "err", "unknown to manual V6.0");
}

#[test]
fn command_clear_alarm_takes_the_arguments_of_the_newest_manual() {
    // Unit B sends two arguments, unit H sends one; no manual has them.
    for arguments in [&["1", "1"][..], &["0", "1"], &["0"]] {
        let mut cell = alarmed_cell();
        cell.ok(&[&["clearAlarm"], arguments].concat());
        cell.pass(10.0);
        assert_eq!(
            cell.query(&["curAlarm", "curMode", "isMoving", "RemoteCmdLen"]),
            [json!("0"), json!("2"), json!("0"), json!("2")],
            "{arguments:?}"
        );
    }
}

#[test]
fn command_modify_stack_data() {
    let mut cell = Cell::new();
    cell.ok(&["modifyStackData", "1", "100", "50.5", "20", "4", "3", "2"]);
    let stack = cell.controller.machine().stacks()[&1];
    assert_eq!((stack.spacing, stack.count), ([100.0, 50.5, 20.0], [4, 3, 2]));
    assert_eq!(
        Cell::with_profile("r6-host").command(&["modifyStackData", "1", "1", "1", "1", "1", "1", "1"])[1],
        "err"
    );
}

#[test]
fn command_modify_gspd() {
    let mut cell = Cell::new();
    // Percent × 10: "50" is 5 %. J1 then goes at 10 % of 5 % of 220.8 deg/s.
    cell.ok(&["modifyGSPD", "50"]);
    cell.run_ok(&json!([long_move()]));
    cell.pass(1.0);
    let first = cell.number("axis-0");
    cell.pass(1.0);
    let speed = cell.number("axis-0") - first;
    assert!((speed - 1.104).abs() < 1e-3, "{speed} deg/s");
    // In mid-move it takes the new speed.
    cell.ok(&["modifyGSPD", "1000"]);
    cell.pass(1.0);
    let first = cell.number("axis-0");
    cell.pass(0.5);
    let speed = (cell.number("axis-0") - first) / 0.5;
    assert!((speed - 22.08).abs() < 1e-3, "{speed} deg/s");
}

#[test]
fn command_rewrite_data() {
    let mut cell = Cell::new();
    cell.ok(&["rewriteData", "850", "-123456", "1"]);
    assert_eq!(cell.text("Addr-850"), "-123456");
    // Captured, unit C: an invalid value is answered ok, and nothing is checked.
    let reply = cell.ask(
        r#"{"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "command", "packID": "1000", "cmdData": ["rewriteData", "800", "-456,754,826,179,0,-89", "0"]}"#,
    );
    assert_eq!(
        reply,
        r#"{"cmdReply":["rewriteData","ok"],"dsID":"www.hc-system.com.RemoteMonitor","packID":"1000","reqType":"command"}"#
    );
    assert!(cell.log().contains("rewriteData argument 2 (value)"));
    let reply = Cell::with_profile("r6-host").command(&["rewriteData", "799", "1", "0"]);
    assert!(reply[1] == "err" && reply[2].contains("800 to 900"), "{reply:?}");
}

#[test]
fn command_rewrite_data_list() {
    let mut cell = Cell::new();
    cell.ok(&["rewriteDataList", "898", "3", "0", "1", "-2", "3"]);
    assert_eq!(cell.query(&["Addr-898", "Addr-899", "Addr-900"]), [json!("1"), json!("-2"), json!("3")]);
    let mut host = Cell::with_profile("r6-host");
    for wrong in
        [&["rewriteDataList", "899", "3", "0", "1", "2", "3"][..], &["rewriteDataList", "800", "2", "0", "1"]]
    {
        assert_eq!(host.command(wrong)[1], "err", "{wrong:?}");
    }
}

#[test]
fn command_modify_acc_dec() {
    let time_of_move = |times: Option<[&str; 2]>| {
        let mut cell = Cell::new();
        if let Some([acc, dec]) = times {
            cell.ok(&["modifyAccDec", acc, dec]);
        }
        cell.run_ok(&json!([axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0)]));
        cell.pass(60.0);
        cell.number("lastCycle")
    };
    // The distance at full speed, half of each ramp, and the filter of 0.128 s.
    let cruise = 90.0 / 220.8;
    assert!((time_of_move(None) - (cruise + 0.25 + 0.128)).abs() < 1e-6);
    let slow = time_of_move(Some(["300", "400"]));
    assert!((slow - (cruise + 0.35 + 0.128)).abs() < 1e-6, "{slow}");
}

#[test]
fn command_switch_tool() {
    let mut cell = Cell::new();
    let flange = cell.world();
    cell.ok(&["modifyTool", "1", "0", "0", "100000", "0", "0", "0"]);
    assert_near(cell.world(), flange, 1e-9);
    cell.ok(&["switchTool", "1"]);
    let tip = cell.world();
    let length = (0..3).map(|n| (tip[n] - flange[n]).powi(2)).sum::<f64>().sqrt();
    assert!((length - 100.0).abs() < 1e-5, "{length}");
    cell.ok(&["switchTool", "0"]);
    assert_near(cell.world(), flange, 1e-9);
}

#[test]
fn command_modify_tool() {
    let mut cell = Cell::new();
    cell.ok(&["switchTool", "2"]);
    let before = cell.world();
    // × 1000: 10.5 mm. The tool in use changes at once.
    cell.ok(&["modifyTool", "2", "10500", "0", "0", "0", "0", "0"]);
    let after = cell.world();
    let length = (0..3).map(|n| (after[n] - before[n]).powi(2)).sum::<f64>().sqrt();
    assert!((length - 10.5).abs() < 1e-5, "{length}");
    assert_eq!(
        Cell::with_profile("r6-host").command(&["modifyTool", "2", "x", "0", "0", "0", "0", "0"])[1],
        "err"
    );
}

#[test]
fn command_switch_coordinate() {
    let mut cell = Cell::new();
    cell.ok(&["switchCoordinate", "1"]);
    assert_eq!(cell.value("toolCoord"), json!(["0", "1", "0"]));
    let mut host = Cell::with_profile("r6-host");
    assert_eq!(host.command(&["switchCoordinate", "99"])[1], "err");
}

#[test]
fn an_unknown_command_gets_a_reason_and_the_nearest_word() {
    let mut cell = Cell::new();
    let reply = cell.command(&["actoinStop"]);
    assert_eq!(reply, ["actoinStop", "err", "unknown command `actoinStop`; nearest: `actionStop`"]);
    let reply = cell.command(&["heartbreak"]);
    assert!(reply[1] == "err" && reply[2].contains("reqType"), "{reply:?}");
}

#[test]
fn a_stopped_line_leaves_the_tool_on_its_line() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([axis_move([0.0, 0.0, 0.0, 0.0, 30.0, 0.0], 100.0)]));
    cell.pass(5.0);
    let start = cell.world();
    let mut end = start;
    end[1] += 100.0;
    cell.run_ok(&json!([linear_move(end, 2.0)]));
    cell.pass(1.0);
    cell.ok(&["actionStop"]);
    cell.pass(1.0);
    let rest = cell.world();
    assert!(rest[1] > start[1] + 1.0 && rest[1] < end[1], "{rest:?}");
    assert!((rest[0] - start[0]).abs() < 0.01 && (rest[2] - start[2]).abs() < 0.01, "{rest:?}");
}
