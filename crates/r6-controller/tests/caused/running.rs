//! Commands that start, stop or continue: their effect on a taught program, and on what an operator has done.

use r6_controller::{Key, PanelAction, Profile};
use r6_proto::alarm::AlarmCode;

use crate::common::Cell;
use crate::{count, person, start, step, taught, told, value, with_programs};

crate::cases! { CASES: crate::command_on_each;
    action_stop "actionStop" => |profile| {
        let mut cell = in_its_way(profile);
        told(&mut cell, &["actionStop"]);
        cell.pass(0.078);
        let rest = cell.number("axis-0");
        assert!(rest > 10.0 && rest < 30.0 && value(&mut cell, "isMoving") == "0", "{rest}");
        cell.pass(100.0);
        assert_eq!((cell.number("axis-0"), value(&mut cell, "curMode").as_str()), (rest, "2"));
        // The next start begins at the first step, which counts again.
        start(&mut cell);
        assert_eq!(count(&mut cell, 0), 2);
    };
    action_pause "actionPause" => |profile| {
        let mut cell = in_its_way(profile);
        told(&mut cell, &["actionPause"]);
        cell.pass(0.5);
        let rest = cell.number("axis-0");
        assert!(rest > 10.0 && rest < 40.0 && value(&mut cell, "isMoving") == "0", "{rest}");
        cell.pass(100.0);
        assert_eq!((cell.number("axis-0"), value(&mut cell, "curMode").as_str()), (rest, "2"));
        // The next start continues from there: the first step does not count again.
        start(&mut cell);
        cell.pass(5.0);
        assert_eq!((cell.text("axis-0").as_str(), count(&mut cell, 0)), ("90.000000", 1));
    };
    action_single_cycle "actionSingleCycle" => |profile| {
        let mut cell = taught(profile, &(step::count(0) + &step::turn(9.0, 50.0) + &step::turn(3.0, 50.0)));
        told(&mut cell, &["actionSingleCycle"]);
        assert_eq!((count(&mut cell, 0), value(&mut cell, "curMode").as_str()), (1, "9"));
        cell.pass(60.0);
        assert_eq!((count(&mut cell, 0), value(&mut cell, "curMode").as_str()), (1, "2"));
        assert_eq!(cell.text("axis-0"), "3.000000");
    };
    start_button "startButton" => |profile| {
        let mut cell = taught(profile, &(step::count(0) + &step::turn(9.0, 50.0) + &step::wait_for("X010")));
        // The operator turns the key; it may start only after that.
        person(&mut cell, &PanelAction::TurnKey(Key::Manual));
        assert_ne!(cell.command(&["startButton"]).last().map(String::as_str), Some("ok"));
        cell.pass(5.0);
        assert_eq!((count(&mut cell, 0), cell.text("axis-0").as_str()), (0, "0.000000"));
        person(&mut cell, &PanelAction::TurnKey(Key::Auto));
        told(&mut cell, &["startButton"]);
        cell.pass(5.0);
        assert_eq!((count(&mut cell, 0), cell.text("axis-0").as_str()), (1, "9.000000"));
    };
    stop_button "stopButton" => |profile| {
        let mut cell = in_its_way(profile);
        told(&mut cell, &["stopButton"]);
        cell.pass(100.0);
        // The cycle was finished, and no other began.
        assert_eq!((cell.text("axis-0").as_str(), count(&mut cell, 0)), ("90.000000", 1));
        assert_eq!(value(&mut cell, "curMode"), "2");
        let mut cell = in_its_way(profile);
        told(&mut cell, &["stopButton"]);
        told(&mut cell, &["stopButton"]);
        cell.pass(100.0);
        assert!(cell.number("axis-0") < 30.0, "the second press stops at once");
    };
    switch_mold "switchMold" => |profile| {
        let other = step::output("Y011") + step::REMOTE;
        let mut cell = with_programs(profile, &[("one", &waiting_for_x010()), ("other", &other)]);
        start(&mut cell);
        told(&mut cell, &["switchMold", "other"]);
        assert_eq!((value(&mut cell, "output-0").as_str(), value(&mut cell, "curMode").as_str()), ("2", "7"));
        // The first program's wait no longer matters.
        person(&mut cell, &PanelAction::SetInput { board: 0, point: 0, on: true });
        assert_eq!(value(&mut cell, "output-0"), "2");
    };
    clear_alarm_run_next "clearAlarmRunNext" => |profile| {
        let mut cell = failing(profile);
        told(&mut cell, &["clearAlarmRunNext"]);
        assert_eq!((value(&mut cell, "curAlarm").as_str(), value(&mut cell, "curMode").as_str()), ("0", "7"));
        assert_eq!((count(&mut cell, 0), count(&mut cell, 2)), (1, 1), "on with the step behind it");
    };
    clear_alarm_continue "clearAlarmContinue" => |profile| {
        let mut cell = failing(profile);
        told(&mut cell, &["clearAlarmContinue"]);
        assert_eq!(value(&mut cell, "curAlarm"), "130", "the same step again");
        assert_eq!((count(&mut cell, 0), count(&mut cell, 2)), (1, 0));
        // An alarm that the operator raises in mid-move, without a cause in the program.
        let mut cell = in_its_way(profile);
        person(&mut cell, &PanelAction::RaiseAlarm(AlarmCode(850)));
        cell.pass(10.0);
        assert!(cell.number("axis-0") < 30.0);
        told(&mut cell, &["clearAlarmContinue"]);
        cell.pass(4.0);
        assert_eq!((cell.text("axis-0").as_str(), count(&mut cell, 0)), ("90.000000", 1));
    };
    modify_gspd "modifyGSPD" => |profile| {
        let mut cell = in_its_way(profile);
        // 10 % of 220.8 degrees per second, then a quarter of that, in mid-move.
        assert!((speed_of_j1(&mut cell) - 22.08).abs() < 1e-3);
        told(&mut cell, &["modifyGSPD", "250"]);
        cell.pass(1.0);
        assert!((speed_of_j1(&mut cell) - 5.52).abs() < 1e-3);
        // To 0, and up again.
        told(&mut cell, &["modifyGSPD", "0"]);
        cell.pass(1.0);
        assert_eq!(speed_of_j1(&mut cell), 0.0);
        told(&mut cell, &["modifyGSPD", "1000"]);
        cell.pass(1.0);
        assert!((speed_of_j1(&mut cell) - 22.08).abs() < 1e-3);
    };
    modify_acc_dec "modifyAccDec" => |profile| {
        // The distance at full speed, half of each ramp (0.25 s, then 0.3 and 0.5), and the filter of 0.128
        // s.
        let program = step::turn(90.0, 100.0) + &step::turn(0.0, 100.0);
        let mut cell = taught(profile, &program);
        start(&mut cell);
        cell.pass(4.0);
        let way = 90.0 / 220.8 + 0.128;
        assert!((cell.number("lastCycle") - 2.0 * (way + 0.25)).abs() < 1e-6);
        told(&mut cell, &["modifyAccDec", "300", "500"]);
        cell.pass(10.0);
        assert!((cell.number("lastCycle") - 2.0 * (way + 0.4)).abs() < 1e-6);
    };
    clear_alarm "clearAlarm" => |profile| {
        let mut cell = in_its_way(profile);
        person(&mut cell, &PanelAction::RaiseAlarm(AlarmCode(850)));
        told(&mut cell, &["clearAlarm"]);
        cell.pass(10.0);
        // Nothing starts on its own.
        assert_eq!((value(&mut cell, "curAlarm").as_str(), value(&mut cell, "curMode").as_str()), ("0", "2"));
        assert!(cell.number("axis-0") < 30.0 && value(&mut cell, "isMoving") == "0");
        start(&mut cell);
        assert_eq!(value(&mut cell, "curMode"), "7");
        // A pressed emergency stop is not cleared over the network.
        person(&mut cell, &PanelAction::EmergencyStop);
        assert_ne!(cell.command(&["clearAlarm"]).last().map(String::as_str), Some("ok"));
        assert_eq!(value(&mut cell, "curAlarm"), "7");
    };
}

/// A program that counts, turns J1 to 90 degrees at 22.08 per second and waits there; one second after its
/// start.
fn in_its_way(profile: &Profile) -> Cell {
    let mut cell = taught(profile, &(step::count(0) + &step::turn(90.0, 10.0) + &step::wait(30.0)));
    start(&mut cell);
    cell.pass(1.0);
    let j1 = cell.number("axis-0");
    assert!(j1 > 10.0 && j1 < 30.0 && count(&mut cell, 0) == 1, "{j1}");
    cell
}

fn speed_of_j1(cell: &mut Cell) -> f64 {
    let before = cell.number("axis-0");
    cell.pass(0.1);
    // Six decimals of each: a hundred-thousandth of the compared value.
    (cell.number("axis-0") - before) / 0.1
}

fn waiting_for_x010() -> String {
    step::wait_for("X010") + &step::output("Y010") + step::REMOTE
}

/// A program that counts, fails to turn J1 that far, and counts something else.
fn failing(profile: &Profile) -> Cell {
    let program = step::count(0) + &step::turn(170.0, 50.0) + &step::count(2) + step::REMOTE;
    let mut cell = taught(profile, &program);
    start(&mut cell);
    assert_eq!(value(&mut cell, "curAlarm"), "130");
    cell
}
