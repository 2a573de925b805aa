//! Power cuts.

use r6_controller::{Button, Key, PanelAction, Refused};
use serde_json::json;

use crate::cell;
use crate::common::{Cell, axis_move};

const CUT: &str = "[[at]]\ntime = 2\ndo = \"power-cut\"\nfor = 3\n";

fn reconnect(cell: &mut Cell) {
    assert!(cell.controller.is_over(cell.id), "the old connection is over");
    cell.controller.disconnect(cell.id);
    cell.id = cell.controller.connect(cell.now);
}

#[test]
fn nobody_is_answered_and_then_the_connections_are_over() {
    let mut cell = cell(CUT);
    cell.pass(1.99);
    cell.add_rcc("1", &json!([axis_move([10.0; 6], 10.0)]));
    cell.pass(0.02);
    assert_eq!(cell.frame(), None, "what was on its way is lost");
    cell.send(br#"{"reqType":"query","queryAddr":["version"]}"#);
    cell.pass(2.9);
    assert_eq!(cell.frame(), None);
    assert!(!cell.controller.is_over(cell.id), "it was told nothing");
    cell.pass(0.1);
    reconnect(&mut cell);
    assert_eq!(cell.text("curMode"), "2");
    let log = cell.log();
    let words = ["scenario: the mains fail for 3 s\n", "scenario: the mains are back\n"];
    assert!(words.iter().all(|words| log.contains(words)), "{log}");
    assert!(!log.contains("version"));
}

#[test]
fn the_arm_stays_where_it_was_and_nothing_moves_by_itself() {
    let mut cell = cell(CUT);
    cell.run_ok(&json!([axis_move([100.0, 10.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    cell.pass(1.981_999);
    let before = cell.axes();
    assert!(before[0] > 20.0 && before[0] < 90.0, "{before:?}");
    cell.pass(0.000_001);
    let cut = cell.controller.snapshot(cell.now).axes;
    assert!((cut[0] - before[0]).abs() < 1e-3, "{cut:?}, {before:?}");
    cell.pass(3.0);
    reconnect(&mut cell);
    for _ in 0..20 {
        let now = cell.controller.snapshot(cell.now);
        assert_eq!((now.axes, now.moving, now.list_length), (cut, false, 0));
        cell.pass(0.5);
    }
    cell.ok(&["startButton"]);
    cell.run_ok(&json!([axis_move([30.0, 0.0, 0.0, 0.0, 0.0, 0.0], 90.0)]));
    cell.pass(5.0);
    assert!((cell.number("axis-0") - 30.0).abs() < 1e-6);
}

#[test]
fn what_is_saved_survives_and_the_rest_does_not() {
    let mut cell = cell(CUT);
    cell.ok(&["rewriteDataList", "800", "2", "1", "5", "6"]);
    cell.ok(&["rewriteDataList", "810", "1", "0", "7"]);
    cell.ok(&["modifyCounter", "2", "44", "50"]);
    cell.ok(&["modifyOutput", "0", "3", "1"]);
    cell.ok(&["modifyGSPD", "300"]);
    cell.controller.set_input(cell.now, 0, 5, true);
    cell.pass(5.0);
    reconnect(&mut cell);
    assert_eq!(cell.query(&["Addr-800", "Addr-801", "Addr-810"]), [json!("5"), json!("6"), json!("0")]);
    assert_eq!(cell.value("counter-2"), json!([2, 50, 44]));
    assert_eq!(cell.text("output-0"), "0");
    let seen = cell.controller.snapshot(cell.now);
    assert_eq!(seen.global_speed_percent, 100.0);
    assert!(seen.io.input(5), "the cell's sensor needs no mains of the cabinet");
}

#[test]
fn a_person_can_do_nothing_meanwhile() {
    let mut cell = cell(&format!(
        "{CUT}[[at]]\ntime = 3\ndo = \"button\"\nbutton = \"start\"\n[[at]]\ntime = 3\ndo = \"command\"\nwords = [\"startButton\"]\n\
         [[at]]\ntime = 3\ndo = \"photo\"\ncamera = 0\n[[at]]\ntime = 3\ndo = \"output\"\npoint = \"Y010\"\non = true\n\
         [[at]]\ntime = 3.5\ndo = \"input\"\npoint = \"X010\"\non = true"
    ));
    cell.pass(4.0);
    let refused = cell.controller.operate(cell.now, &PanelAction::ClearAlarm).unwrap_err();
    assert_eq!(refused, Refused::PowerOff);
    cell.controller.request_photo(cell.now, 0);
    cell.pass(2.0);
    assert_eq!(cell.frame(), None);
    reconnect(&mut cell);
    assert_eq!(
        (cell.text("curMode"), cell.text("output-0"), cell.text("input-0")),
        ("2".into(), "0".into(), "1".into())
    );
    let log = cell.log();
    assert_eq!(log.matches("the mains have failed: wait until they are back").count(), 4, "{log}");
}

/// Actions without mains work at the panel, too: a stop that was pressed then stays pressed afterwards.
#[test]
fn a_stop_is_pressed_without_mains() {
    let mut cell = cell(CUT);
    cell.pass(3.0);
    let do_now = |cell: &mut Cell, action: PanelAction| cell.controller.operate(cell.now, &action);
    let input = PanelAction::SetInput { board: 0, point: 2, on: true };
    for action in [PanelAction::EmergencyStop, PanelAction::TurnKey(Key::Manual), input] {
        assert_eq!(do_now(&mut cell, action.clone()), Ok(()), "{action:?}");
    }
    cell.pass(20.0);
    assert_eq!(do_now(&mut cell, PanelAction::Press(Button::Start)), Err(Refused::EmergencyStop));
    reconnect(&mut cell);
    assert_eq!(
        (cell.text("curMode"), cell.text("curAlarm"), cell.text("input-0")),
        ("1".into(), "7".into(), "4".into())
    );
}

#[test]
fn an_emergency_stop_stays_pressed() {
    let mut cell = cell(&format!("{CUT}[[at]]\ntime = 1\ndo = \"emergency-stop\"\n"));
    cell.pass(6.0);
    reconnect(&mut cell);
    assert_eq!(cell.text("curAlarm"), "7");
    assert_eq!(cell.command(&["startButton"])[1], "err");
}

#[test]
fn one_that_is_pressed_meanwhile_is_pressed_afterwards() {
    let mut cell = cell(&format!("{CUT}[[at]]\ntime = 3\ndo = \"emergency-stop\"\n"));
    cell.pass(6.0);
    reconnect(&mut cell);
    assert_eq!(cell.text("curAlarm"), "7");
}

#[test]
fn another_program_afterwards() {
    let mut cell = cell(
        "[[at]]\ntime = 1\ndo = \"power-cut\"\nfor = 1\nprogram = \"palletise\"\n[[at]]\ntime = 5\ndo = \"power-cut\"\nfor = 1\nprogram = \"paletise\"",
    );
    cell.pass(3.0);
    reconnect(&mut cell);
    assert_eq!(
        (cell.controller.snapshot(cell.now).program, cell.text("curMode")),
        ("palletise".to_owned(), "2".to_owned())
    );
    cell.pass(5.0);
    reconnect(&mut cell);
    assert_eq!(cell.controller.snapshot(cell.now).program, "palletise");
    assert!(cell.log().contains("paletise"));
}

#[test]
fn the_longest_of_several_cuts_counts() {
    let mut cell = cell(
        "[[at]]\ntime = 1\ndo = \"power-cut\"\nfor = 10\n[[at]]\ntime = 3\ndo = \"power-cut\"\nfor = 1\n[[at]]\ntime = 2\nevery = 0.001\ntimes = 1000\ndo = \"power-cut\"\nfor = 9.5\n",
    );
    cell.pass(12.4);
    assert!(!cell.controller.is_over(cell.id));
    assert_eq!(cell.controller.operate(cell.now, &PanelAction::ClearAlarm), Err(Refused::PowerOff));
    cell.pass(0.1);
    assert!(cell.controller.is_over(cell.id));
    assert_eq!(cell.log().matches("the mains are back").count(), 1);
}

#[test]
fn a_cut_of_no_time_ends_connections_too() {
    let mut cell = cell("[[at]]\ntime = 1\ndo = \"power-cut\"\nfor = 0");
    cell.pass(1.0);
    reconnect(&mut cell);
    assert_eq!(cell.text("curMode"), "2");
}

#[test]
fn the_shell_sees_that_there_is_something_to_save() {
    let mut cell = cell("[[at]]\ntime = 1\ndo = \"power-cut\"\nfor = 1");
    cell.ok(&["modifyCounter", "2", "1", "5"]);
    let mark = cell.controller.machine().saved_mark();
    cell.pass(3.0);
    assert_ne!(
        cell.controller.machine().saved_mark(),
        mark,
        "counted anew, it could be the same number by chance"
    );
    assert_eq!(cell.controller.machine().saved().to_json().matches("\"current\": 1").count(), 1);
}
