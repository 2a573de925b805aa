//! The other way to move: a PC writes registers, and a program moves there (half of the known clients need
//! it).

mod common;

use common::{Cell, assert_near};
use r6_controller::Profile;
use serde_json::json;

const PHOTO: &str = r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0}"#;

fn register_cell(profile: Profile) -> Cell {
    let mut cell = Cell::with(profile, Default::default());
    cell.ok(&["switchMold", "register-move"]);
    cell
}

fn write_target(cell: &mut Cell, values: [&str; 6]) {
    let [a, b, c, d, e, f] = values;
    cell.ok(&["rewriteDataList", "800", "6", "0", a, b, c, d, e, f]);
}

/// Pulses M011: board 4, point 1.
fn pulse(cell: &mut Cell) {
    cell.ok(&["modifyOutput", "4", "1", "1"]);
    cell.ok(&["modifyOutput", "4", "1", "0"]);
}

#[test]
fn a_pulse_of_m011_moves_to_the_registers_and_asks_for_a_photo() {
    let mut cell = register_cell(Profile::hc1());
    write_target(&mut cell, ["10123", "-20000", "3500", "45000", "30987", "40678"]);
    cell.pass(5.0);
    assert_eq!(
        cell.query(&["isMoving", "axis-0", "RemoteCmdLen"]),
        [json!("0"), json!("0.000000"), json!("0")]
    );
    pulse(&mut cell);
    assert_eq!(cell.text("isMoving"), "1");
    cell.pass(10.0);
    assert_eq!(cell.frame().as_deref(), Some(PHOTO));
    assert_near(cell.axes(), [10.123, -20.0, 3.5, 45.0, 30.987, 40.678], 1e-6);
    assert_eq!(cell.value("counter-0"), json!([0, 0, 1]));
    // Without another pulse it stays; with one it moves to the new register values.
    write_target(&mut cell, ["0", "0", "0", "0", "0", "0"]);
    cell.pass(10.0);
    assert_eq!(cell.text("isMoving"), "0");
    pulse(&mut cell);
    cell.pass(10.0);
    assert_eq!(cell.frame().as_deref(), Some(PHOTO));
    assert_near(cell.axes(), [0.0; 6], 1e-6);
}

#[test]
fn a_single_cycle_needs_no_pulse_and_ends_by_itself() {
    let mut cell = register_cell(Profile::hc1());
    write_target(&mut cell, ["5000", "0", "0", "0", "0", "0"]);
    cell.ok(&["actionSingleCycle"]);
    assert_eq!(cell.query(&["curMode", "isMoving"]), [json!("9"), json!("1")]);
    cell.pass(10.0);
    assert_eq!(cell.frame().as_deref(), Some(PHOTO));
    assert_eq!(cell.query(&["curMode", "axis-0"]), [json!("2"), json!("5.000000")]);
    // The same again, from automatic.
    write_target(&mut cell, ["0", "0", "0", "0", "0", "0"]);
    cell.ok(&["actionSingleCycle"]);
    cell.pass(10.0);
    assert_eq!(cell.frame().as_deref(), Some(PHOTO));
    assert_eq!(cell.query(&["curMode", "axis-0", "curAlarm"]), [json!("2"), json!("0.000000"), json!("0")]);
}

#[test]
fn a_hundred_cycles_in_a_row() {
    let mut cell = register_cell(Profile::hc1());
    for n in 1..=100 {
        let target = (f64::from(n % 7) * 1000.0).to_string();
        write_target(&mut cell, [&target, "0", "0", "0", "0", "0"]);
        pulse(&mut cell);
        cell.pass(3.0);
        assert_eq!(cell.frame().as_deref(), Some(PHOTO), "cycle {n}");
        assert_eq!(cell.number("axis-0"), f64::from(n % 7));
    }
    assert_eq!(cell.value("counter-0"), json!([0, 0, 100]));
}

#[test]
fn a_target_beyond_a_limit_is_an_alarm_and_remote_lists_are_refused() {
    let mut cell = register_cell(Profile::hc1());
    write_target(&mut cell, ["0", "0", "0", "0", "0", "350000"]);
    pulse(&mut cell);
    assert_eq!(cell.query(&["curAlarm", "isMoving"]), [json!("135"), json!("0")]);
    cell.ok(&["clearAlarm"]);
    cell.ok(&["startButton"]);
    assert_eq!(cell.run(&json!([{"oneshot": "1", "action": "800", "cnt_id": "1"}])), ["AddRCC", "err"]);
    assert!(cell.log().contains("another program than `remote`"));
    // With the first program in use again, lists are accepted.
    cell.ok(&["switchMold", "remote"]);
    cell.run_ok(&json!([{"oneshot": "1", "action": "800", "cnt_id": "1"}]));
}

#[test]
fn a_free_running_program_follows_what_is_written() {
    let mut cell = Cell::new();
    cell.ok(&["switchMold", "register-follow"]);
    cell.ok(&["rewriteDataList", "800", "6", "0", "9000", "0", "0", "0", "0", "0"]);
    assert_eq!(cell.text("isMoving"), "0", "other registers mean nothing to it");
    cell.ok(&["rewriteDataList", "850", "6", "0", "10000", "-5000", "0", "0", "30000", "0"]);
    assert_eq!(cell.query(&["isMoving", "RemoteCmdLen", "curMode"]), [json!("1"), json!("0"), json!("7")]);
    cell.pass(0.2);
    // The newest target is used once the arm has arrived.
    cell.ok(&["rewriteData", "850", "20000", "0"]);
    cell.ok(&["rewriteData", "850", "15000", "0"]);
    cell.pass(10.0);
    assert_near(cell.axes(), [15.0, -5.0, 0.0, 0.0, 30.0, 0.0], 1e-6);
    assert_eq!(cell.query(&["isMoving", "curAlarm"]), [json!("0"), json!("0")]);
    // While stopped, it follows nothing; after a start it waits for the next write.
    cell.ok(&["actionStop"]);
    cell.ok(&["rewriteData", "850", "0", "0"]);
    cell.pass(5.0);
    cell.ok(&["startButton"]);
    cell.pass(5.0);
    assert_eq!(cell.text("axis-0"), "15.000000");
    cell.ok(&["rewriteData", "851", "0", "0"]);
    cell.pass(5.0);
    assert_near(cell.axes(), [0.0, 0.0, 0.0, 0.0, 30.0, 0.0], 1e-6);
}
