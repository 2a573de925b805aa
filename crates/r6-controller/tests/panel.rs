//! The operator's actions: what each changes and when it is refused.

mod common;

use common::{Cell, axis_move};
use r6_controller::{Button, Key, PanelAction, Profile, Refused, StartState};
use r6_proto::alarm::AlarmCode;
use r6_proto::{AxisIndex, OperationMode};
use serde_json::json;

fn moved(j1: f64, speed: f64) -> serde_json::Value {
    axis_move([j1, 0.0, 0.0, 0.0, 0.0, 0.0], speed)
}

fn kept(j1: f64, speed: f64) -> serde_json::Value {
    let mut step = moved(j1, speed);
    step["oneshot"] = json!("0");
    step
}

fn operate(cell: &mut Cell, action: &PanelAction) -> Result<(), Refused> {
    cell.controller.operate(cell.now, action)
}

#[track_caller]
fn done(cell: &mut Cell, action: &PanelAction) {
    assert_eq!(operate(cell, action), Ok(()), "{action:?}");
}

fn press(cell: &mut Cell, button: Button) -> Result<(), Refused> {
    operate(cell, &PanelAction::Press(button))
}

fn jog(axis: u8, by: f64, percent: f64) -> PanelAction {
    PanelAction::Jog { axis: AxisIndex::new(axis).unwrap(), by, percent }
}

fn manual() -> Cell {
    Cell::with(Profile::hc1(), StartState::Manual)
}

#[test]
fn an_input_is_seen_by_queries_and_by_what_waits_for_it() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([
        {"oneshot": "1", "action": "100", "type": "1", "point": "8", "io_status": "1", "isUnlimit": "1", "limit": "0"},
        {"oneshot": "1", "action": "100", "type": "8", "point": "3", "io_status": "1", "isUnlimit": "1", "limit": "0"},
    ]));
    done(&mut cell, &PanelAction::SetInput { board: 1, point: 8, on: true });
    assert_eq!(cell.query(&["input-0", "input-1", "RemoteCmdLen"]), [json!("0"), json!("256"), json!("1")]);
    done(&mut cell, &PanelAction::SetEuInput { point: 3, on: true });
    assert_eq!(cell.text("RemoteCmdLen"), "0");
    assert_eq!(cell.controller.snapshot(cell.now).io.eu_inputs, 8);
    done(&mut cell, &PanelAction::SetInput { board: 1, point: 8, on: false });
    done(&mut cell, &PanelAction::SetEuInput { point: 3, on: false });
    let io = cell.controller.snapshot(cell.now).io;
    assert_eq!((io.inputs[1], io.eu_inputs), (0, 0));
}

#[test]
fn an_input_that_is_not_there_is_refused() {
    let mut cell = Cell::new();
    for (board, point) in [(8, 0), (0, 32), (255, 255)] {
        let refused = operate(&mut cell, &PanelAction::SetInput { board, point, on: true });
        assert_eq!(refused, Err(Refused::NoSuchInput { board, point }));
    }
    assert!(operate(&mut cell, &PanelAction::SetEuInput { point: 32, on: true }).is_err());
    assert_eq!(cell.controller.snapshot(cell.now).io, r6_controller::io::Io::default());
}

#[test]
fn buttons_do_what_their_commands_do() {
    let mut cell = Cell::with(Profile::hc1(), StartState::Auto);
    assert_eq!(press(&mut cell, Button::Start), Ok(()));
    assert_eq!(cell.text("curMode"), "7");
    cell.run_ok(&json!([moved(90.0, 10.0)]));
    cell.pass(1.0);
    assert_eq!(press(&mut cell, Button::Pause), Ok(()));
    cell.pass(0.6);
    assert_eq!(cell.query(&["curMode", "isMoving", "RemoteCmdLen"]), [json!("2"), json!("0"), json!("1")]);
    assert_eq!(press(&mut cell, Button::SingleCycle), Ok(()));
    assert_eq!(cell.text("curMode"), "9");
    cell.pass(10.0);
    assert_eq!(cell.query(&["curMode", "axis-0"]), [json!("2"), json!("90.000000")]);

    assert_eq!(press(&mut cell, Button::Start), Ok(()));
    cell.run_ok(&json!([moved(0.0, 10.0)]));
    cell.pass(0.5);
    assert_eq!(press(&mut cell, Button::Stop), Ok(()));
    assert_eq!(cell.text("isMoving"), "1", "the first press ends with the cycle");
    assert_eq!(press(&mut cell, Button::Stop), Ok(()));
    cell.pass(0.1);
    assert_eq!(cell.query(&["curMode", "isMoving"]), [json!("2"), json!("0")]);
}

#[test]
fn a_start_that_is_not_possible_names_why() {
    for (start, homed, refused) in [
        (StartState::Manual, true, Refused::NotAuto { mode: OperationMode::Manual }),
        (StartState::Stopped, true, Refused::NotAuto { mode: OperationMode::Stop }),
        (StartState::Auto, false, Refused::NotHomed),
    ] {
        let model = r6_controller::RobotModel::default();
        let settings = r6_controller::ControllerSettings::new(Profile::hc1(), model);
        let mut cell = Cell::of(r6_controller::ControllerSettings { start, homed, ..settings });
        for button in [Button::Start, Button::SingleCycle, Button::SingleStep] {
            assert_eq!(press(&mut cell, button), Err(refused.clone()), "{start:?} {button:?}");
        }
        assert_eq!(cell.command(&["startButton"])[2], refused.to_string());
    }
    let mut cell = Cell::new();
    done(&mut cell, &PanelAction::RaiseAlarm(AlarmCode(5_000)));
    assert_eq!(press(&mut cell, Button::Start), Err(Refused::Alarm { alarm: AlarmCode(5_000) }));
}

#[test]
fn single_step_runs_one_step_for_each_press() {
    let mut cell = Cell::new();
    cell.pass(0.1);
    done(&mut cell, &PanelAction::TurnKey(Key::Auto));
    assert_eq!(press(&mut cell, Button::Start), Ok(()));
    // Blended and kept: neither a corner nor the end of a pass starts a second step.
    let smooth = |j1| {
        let mut step = kept(j1, 50.0);
        step["smooth"] = json!("9");
        step
    };
    let output = json!({"oneshot": "0", "action": "200", "type": "0", "point": "4", "io_status": "1"});
    cell.run_ok(&json!([
        {"oneshot": "0", "action": "100", "type": "0", "point": "0", "io_status": "1", "isUnlimit": "1", "limit": "0"},
        smooth(20.0), smooth(40.0), output,
    ]));
    assert_eq!(press(&mut cell, Button::SingleStep), Ok(()));
    assert_eq!(cell.text("curMode"), "8");
    done(&mut cell, &PanelAction::SetInput { board: 0, point: 0, on: true });
    let mut seen = vec![];
    for _ in 0..5 {
        let state = cell.query(&["curMode", "axis-0", "output-0"]);
        seen.push(state.iter().map(|value| value.as_str().unwrap().to_owned()).collect::<Vec<_>>().join(" "));
        assert_eq!(press(&mut cell, Button::SingleStep), Ok(()));
        cell.pass(5.0);
    }
    assert_eq!(
        seen,
        ["2 0.000000 0", "2 20.000000 0", "2 40.000000 0", "2 40.000000 16", "2 40.000000 16"],
        "a wait, two moves, an output, and the wait of the next pass"
    );
    // Start continues from where the steps ended.
    assert_eq!(press(&mut cell, Button::Start), Ok(()));
    cell.pass(0.5);
    assert_eq!(cell.query(&["curMode", "isMoving"]), [json!("7"), json!("1")]);
}

#[test]
fn single_step_with_nothing_to_run_ends_at_once_and_ends_a_running_program_with_its_step() {
    let mut cell = Cell::new();
    assert_eq!(press(&mut cell, Button::SingleStep), Ok(()));
    assert_eq!(cell.text("curMode"), "2");
    assert_eq!(press(&mut cell, Button::Start), Ok(()));
    cell.run_ok(&json!([moved(20.0, 50.0), moved(40.0, 50.0)]));
    cell.pass(0.1);
    assert_eq!(press(&mut cell, Button::SingleStep), Ok(()));
    assert_eq!(cell.query(&["curMode", "isMoving"]), [json!("8"), json!("1")]);
    cell.pass(10.0);
    assert_eq!(
        cell.query(&["curMode", "axis-0", "RemoteCmdLen"]),
        [json!("2"), json!("20.000000"), json!("1")]
    );
    // Start during a step lets the program continue.
    assert_eq!(press(&mut cell, Button::SingleStep), Ok(()));
    cell.pass(0.1);
    assert_eq!(press(&mut cell, Button::Start), Ok(()));
    assert_eq!(cell.text("curMode"), "7");
    cell.pass(10.0);
    assert_eq!(cell.query(&["curMode", "axis-0"]), [json!("7"), json!("40.000000")]);
}

#[test]
fn the_key_ends_what_runs() {
    for (key, mode) in [(Key::Manual, "1"), (Key::Stop, "3"), (Key::Auto, "2")] {
        let mut cell = Cell::new();
        cell.run_ok(&json!([kept(90.0, 10.0), kept(0.0, 10.0)]));
        cell.pass(1.0);
        done(&mut cell, &PanelAction::TurnKey(key));
        cell.pass(0.1);
        assert_eq!(cell.query(&["curMode", "isMoving", "curAlarm"]), [json!(mode), json!("0"), json!("0")]);
    }
}

#[test]
fn a_move_by_hand_is_a_motion_like_any_other() {
    let mut cell = manual();
    done(&mut cell, &jog(0, 10.0, 10.0));
    assert_eq!(cell.query(&["isMoving", "curMode", "axis-0"]), [json!("1"), json!("1"), json!("0.000000")]);
    assert_eq!(operate(&mut cell, &jog(1, 1.0, 10.0)), Err(Refused::Moving));
    assert_eq!(operate(&mut cell, &PanelAction::Home), Err(Refused::Moving));
    cell.pass(0.3);
    assert!(cell.number("axis-0") > 1.0 && cell.number("axis-0") < 9.0);
    assert_ne!(cell.text("curSpeed-0"), "0");
    assert_ne!(cell.text("curTorque-1"), "0");
    // 10 degrees at 10 % of 220.8 degrees a second, and the ramps.
    cell.pass(1.0);
    assert_eq!(
        cell.query(&["isMoving", "axis-0", "axis-1", "curTorque-1"]),
        [json!("0"), json!("10.000000"), json!("0.000000"), json!("0")]
    );
    // Half the global speed is half the speed.
    cell.ok(&["modifyGSPD", "500"]);
    done(&mut cell, &jog(0, -10.0, 10.0));
    cell.pass(0.9);
    assert_eq!(cell.text("isMoving"), "1");
    cell.pass(0.5);
    assert_eq!(cell.query(&["isMoving", "axis-0"]), [json!("0"), json!("0.000000")]);
}

#[test]
fn a_move_by_hand_can_be_stopped() {
    type Stop = fn(&mut Cell);
    let stops: [(&str, f64, Stop); 8] = [
        ("stop", 0.08, |cell| assert_eq!(press(cell, Button::Stop), Ok(()))),
        ("pause", 0.51, |cell| assert_eq!(press(cell, Button::Pause), Ok(()))),
        ("key", 0.08, |cell| done(cell, &PanelAction::TurnKey(Key::Stop))),
        ("emergency stop", 0.08, |cell| done(cell, &PanelAction::EmergencyStop)),
        ("alarm", 0.08, |cell| done(cell, &PanelAction::RaiseAlarm(AlarmCode(850)))),
        ("actionStop", 0.08, |cell| cell.ok(&["actionStop"])),
        ("stopButton", 0.08, |cell| cell.ok(&["stopButton"])),
        ("speed 0", 0.51, |cell| cell.ok(&["modifyGSPD", "0"])),
    ];
    for (name, within, stop) in stops {
        let mut cell = manual();
        done(&mut cell, &jog(0, 100.0, 20.0));
        cell.pass(1.0);
        stop(&mut cell);
        assert_eq!(cell.text("isMoving"), "1", "{name}: it takes its time");
        cell.pass(within);
        let rest = cell.number("axis-0");
        assert!(rest > 20.0 && rest < 80.0 && cell.text("isMoving") == "0", "{name}: at {rest}");
        // It does not continue, whatever is pressed.
        done(&mut cell, &PanelAction::ReleaseEmergencyStop);
        done(&mut cell, &PanelAction::ClearAlarm);
        cell.ok(&["modifyGSPD", "1000"]);
        done(&mut cell, &PanelAction::TurnKey(Key::Auto));
        assert_eq!(press(&mut cell, Button::Start), Ok(()), "{name}");
        cell.pass(5.0);
        assert!((cell.number("axis-0") - rest).abs() < 1e-9, "{name}");
        // The next move begins at the present position.
        cell.run_ok(&json!([moved(rest + 10.0, 100.0)]));
        cell.pass(0.01);
        assert!((cell.number("axis-0") - rest).abs() < 1.0, "{name}");
    }
}

#[test]
fn a_program_does_not_start_while_a_move_by_hand_comes_to_rest() {
    let mut cell = manual();
    done(&mut cell, &jog(0, 100.0, 20.0));
    cell.pass(1.0);
    done(&mut cell, &PanelAction::TurnKey(Key::Auto));
    assert_eq!(press(&mut cell, Button::Start), Err(Refused::Moving));
    assert_eq!(cell.command(&["startButton"])[1], "err");
    cell.pass(0.1);
    assert_eq!(press(&mut cell, Button::Start), Ok(()));
}

#[test]
fn soft_limits_hold_for_moves_by_hand() {
    let limits = r6_controller::RobotModel::default().soft_limits();
    for (axis, limit) in (0_u8..).zip(limits) {
        for (by, wanted, alarm) in
            [(1e9, limit.max, 130 + u32::from(axis)), (-1e9, limit.min, 140 + u32::from(axis))]
        {
            let mut cell = manual();
            done(&mut cell, &jog(axis, by, 100.0));
            cell.pass(0.1);
            assert_eq!(cell.query(&["curAlarm", "isMoving"]), [json!("0"), json!("1")]);
            cell.pass(20.0);
            let state = cell.query(&["curAlarm", "isMoving", "curMode"]);
            assert_eq!(state, [json!(alarm.to_string()), json!("0"), json!("1")]);
            assert!((cell.axes()[usize::from(axis)] - wanted).abs() < 1e-6);
            // From there it can only go back, after the alarm is cleared.
            assert_eq!(
                operate(&mut cell, &jog(axis, -by.signum(), 100.0)),
                Err(Refused::Alarm { alarm: AlarmCode(alarm) })
            );
            done(&mut cell, &PanelAction::ClearAlarm);
            done(&mut cell, &jog(axis, by.signum(), 100.0));
            assert_eq!(cell.query(&["curAlarm", "isMoving"]), [json!(alarm.to_string()), json!("0")]);
            done(&mut cell, &PanelAction::ClearAlarm);
            done(&mut cell, &jog(axis, -by.signum(), 100.0));
            cell.pass(5.0);
            assert!((cell.axes()[usize::from(axis)] - (wanted - by.signum())).abs() < 1e-6);
            assert_eq!(cell.text("curAlarm"), "0");
        }
    }
    // A move exactly to the limit is not a fault.
    let mut cell = manual();
    done(&mut cell, &jog(0, limits[0].max, 100.0));
    cell.pass(20.0);
    assert_eq!(cell.text("curAlarm"), "0");
}

#[test]
fn a_move_by_hand_that_is_not_possible_names_why() {
    for (start, mode) in [
        (StartState::Waiting, OperationMode::Running),
        (StartState::Auto, OperationMode::Auto),
        (StartState::Stopped, OperationMode::Stop),
    ] {
        let mut cell = Cell::with(Profile::hc1(), start);
        assert_eq!(operate(&mut cell, &jog(0, 1.0, 10.0)), Err(Refused::NotManual { mode }));
        assert_eq!(operate(&mut cell, &PanelAction::Home), Err(Refused::NotManual { mode }));
    }
    let mut cell = manual();
    let j7 = AxisIndex::new(6).unwrap();
    assert_eq!(operate(&mut cell, &jog(6, 1.0, 10.0)), Err(Refused::NoSuchAxis { axis: j7, axes: 6 }));
    for by in [0.0, f64::NAN, f64::INFINITY] {
        assert_eq!(operate(&mut cell, &jog(0, by, 10.0)), Err(Refused::NoDistance), "{by}");
    }
    for percent in [0.0, -1.0, 100.1, f64::NAN] {
        assert_eq!(operate(&mut cell, &jog(0, 1.0, percent)), Err(Refused::BadSpeed), "{percent}");
    }
    cell.ok(&["modifyGSPD", "0"]);
    assert_eq!(operate(&mut cell, &jog(0, 1.0, 10.0)), Err(Refused::NoGlobalSpeed));
    done(&mut cell, &PanelAction::EmergencyStop);
    assert_eq!(operate(&mut cell, &jog(0, 1.0, 10.0)), Err(Refused::EmergencyStop));
    assert_eq!(operate(&mut cell, &PanelAction::Home), Err(Refused::EmergencyStop));
    cell.pass(5.0);
    assert_eq!(cell.query(&["isMoving", "axis-0"]), [json!("0"), json!("0.000000")]);
}

#[test]
fn homing_moves_to_the_origin_and_counts_only_when_it_arrives() {
    let settings = r6_controller::ControllerSettings::new(Profile::hc1(), Default::default());
    let settings = r6_controller::ControllerSettings { start: StartState::Manual, homed: false, ..settings };
    let mut cell = Cell::of(settings);
    done(&mut cell, &jog(0, 40.0, 100.0));
    cell.pass(5.0);
    assert_eq!(cell.query(&["origin", "axis-0"]), [json!("0"), json!("40.000000")]);
    done(&mut cell, &PanelAction::Home);
    cell.pass(0.5);
    assert_eq!(cell.query(&["origin", "isMoving"]), [json!("0"), json!("1")]);
    assert_eq!(press(&mut cell, Button::Stop), Ok(()));
    cell.pass(5.0);
    assert_eq!(cell.query(&["origin", "isMoving"]), [json!("0"), json!("0")]);
    assert!(cell.number("axis-0") > 1.0);
    done(&mut cell, &PanelAction::Home);
    cell.pass(5.0);
    assert_eq!(cell.query(&["origin", "axis-0"]), [json!("1"), json!("0.000000")]);
    done(&mut cell, &PanelAction::TurnKey(Key::Auto));
    assert_eq!(press(&mut cell, Button::Start), Ok(()));
}

#[test]
fn an_alarm_is_raised_and_cleared() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([kept(90.0, 10.0), kept(0.0, 10.0)]));
    cell.pass(1.0);
    done(&mut cell, &PanelAction::RaiseAlarm(AlarmCode(850)));
    cell.pass(0.1);
    assert_eq!(cell.query(&["curAlarm", "curMode", "isMoving"]), [json!("850"), json!("2"), json!("0")]);
    done(&mut cell, &PanelAction::RaiseAlarm(AlarmCode(900)));
    assert_eq!(cell.text("curAlarm"), "850", "the first one stays");
    done(&mut cell, &PanelAction::ClearAlarm);
    cell.pass(1.0);
    assert_eq!(cell.query(&["curAlarm", "curMode", "isMoving"]), [json!("0"), json!("2"), json!("0")]);
    for alarm in [0, 10_001, u32::MAX].map(AlarmCode) {
        let refused = operate(&mut cell, &PanelAction::RaiseAlarm(alarm));
        assert_eq!(refused, Err(Refused::NoSuchAlarm { alarm }));
    }
}

#[test]
fn another_program_is_loaded_only_at_rest_and_by_its_name() {
    let load = |cell: &mut Cell, name: &str| operate(cell, &PanelAction::SwitchProgram(name.to_owned()));
    let mut cell = Cell::new();
    cell.run_ok(&json!([moved(20.0, 100.0)]));
    assert!(matches!(load(&mut cell, "default"), Err(Refused::Program { .. })));
    cell.pass(5.0);
    let refused = load(&mut cell, "register-mov").unwrap_err();
    assert!(refused.to_string().contains("register-move"), "{refused}");
    assert_eq!(load(&mut cell, "register-move"), Ok(()));
    assert_eq!(cell.controller.snapshot(cell.now).program, "register-move");
}
