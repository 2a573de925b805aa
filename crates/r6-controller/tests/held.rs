//! Moves by hand that last as long as a button is held, and faults that a person gives.

mod common;

use std::time::Duration;

use common::Cell;
use r6_controller::fault::{Fault, LinkFault, TaskFault};
use r6_controller::{PanelAction, Profile, Refused, StartState};
use r6_proto::AxisIndex;
use r6_proto::alarm::AlarmCode;

const J1: AxisIndex = AxisIndex::ALL[0];

fn manual() -> Cell {
    Cell::with(Profile::hc1(), StartState::Manual)
}

fn hold(cell: &mut Cell, up: bool, percent: f64) -> Result<(), Refused> {
    cell.controller.operate(cell.now, &PanelAction::HoldJog { axis: J1, up, percent })
}

fn keep(cell: &mut Cell) -> Result<(), Refused> {
    cell.controller.operate(cell.now, &PanelAction::KeepJog)
}

fn j1(cell: &mut Cell) -> f64 {
    cell.controller.snapshot(cell.now).axes[0]
}

fn moves(cell: &mut Cell) -> bool {
    cell.controller.snapshot(cell.now).moving
}

/// Lets time pass, and tells every 60 ms that the button is held.
fn held_for(cell: &mut Cell, seconds: f64) {
    let mut passed = 0.0;
    while passed < seconds {
        cell.pass(0.06);
        passed += 0.06;
        keep(cell).unwrap();
    }
}

#[test]
fn an_axis_moves_as_long_as_its_button_is_held() {
    for up in [true, false] {
        let mut cell = manual();
        hold(&mut cell, up, 10.0).unwrap();
        held_for(&mut cell, 1.5);
        let on_the_way = j1(&mut cell);
        assert!(moves(&mut cell) && (on_the_way > 1.0) == up && on_the_way.abs() > 1.0, "{on_the_way}");
        cell.controller.operate(cell.now, &PanelAction::EndJog).unwrap();
        cell.pass(1.0);
        assert!(!moves(&mut cell));
        let rests = j1(&mut cell);
        assert!((rests - on_the_way).abs() < 10.0, "{on_the_way} {rests}");
        cell.pass(5.0);
        assert!((j1(&mut cell) - rests).abs() < 1e-9);
        // What is late begins nothing again.
        assert_eq!(keep(&mut cell), Err(Refused::NotHeld));
        cell.pass(1.0);
        assert!((j1(&mut cell) - rests).abs() < 1e-9);
        assert_eq!(cell.controller.snapshot(cell.now).alarm, AlarmCode::NONE);
    }
}

#[test]
fn without_a_word_the_arm_slows_down_after_a_fifth_of_a_second() {
    let mut cell = manual();
    hold(&mut cell, true, 100.0).unwrap();
    held_for(&mut cell, 0.6);
    cell.pass(0.199);
    // Its speed from here on: it still has it just before the time is up, and less after.
    let before = [j1(&mut cell), {
        cell.pass(0.000_5);
        j1(&mut cell)
    }];
    cell.pass(0.1);
    let after = [j1(&mut cell), {
        cell.pass(0.000_5);
        j1(&mut cell)
    }];
    let speed = |of: [f64; 2]| of[1] - of[0];
    assert!(speed(after) < 0.9 * speed(before), "{before:?} {after:?}");
    cell.pass(1.0);
    assert!(!moves(&mut cell));
    assert_eq!(keep(&mut cell), Err(Refused::NotHeld));
}

#[test]
fn whatever_ends_a_move_by_hand_ends_a_held_one_and_no_later_word_brings_it_back() {
    let stop = |cell: &mut Cell| cell.command(&["actionStop"]).concat();
    let estop = |cell: &mut Cell| {
        cell.controller.operate(cell.now, &PanelAction::EmergencyStop).unwrap();
        String::new()
    };
    let key = |cell: &mut Cell| {
        cell.controller.turn_key(cell.now, r6_controller::Key::Auto);
        String::new()
    };
    for end in [&stop as &dyn Fn(&mut Cell) -> String, &estop, &key] {
        let mut cell = manual();
        hold(&mut cell, true, 20.0).unwrap();
        held_for(&mut cell, 0.5);
        let answer = end(&mut cell);
        assert_eq!(keep(&mut cell), Err(Refused::NotHeld), "{answer}");
        cell.pass(2.0);
        assert!(!moves(&mut cell));
    }
}

#[test]
fn a_soft_limit_holds_however_long_the_button_is_pressed() {
    let mut cell = manual();
    let highest = cell.controller.snapshot(cell.now).axis_limits[0].1;
    hold(&mut cell, true, 100.0).unwrap();
    while moves(&mut cell) {
        cell.pass(0.05);
        assert!(j1(&mut cell) <= highest + 1e-9);
        let _ = keep(&mut cell);
    }
    assert!((j1(&mut cell) - highest).abs() < 1e-6);
    assert_eq!(cell.controller.snapshot(cell.now).alarm, AlarmCode::positive_limit(J1));
    // From the limit it goes back, and not on.
    cell.controller.operate(cell.now, &PanelAction::ClearAlarm).unwrap();
    hold(&mut cell, true, 100.0).unwrap();
    assert!((j1(&mut cell) - highest).abs() < 1e-6);
    cell.controller.operate(cell.now, &PanelAction::ClearAlarm).unwrap();
    hold(&mut cell, false, 10.0).unwrap();
    held_for(&mut cell, 0.5);
    assert!(j1(&mut cell) < highest);
}

#[test]
fn a_held_move_needs_manual_a_speed_and_an_axis() {
    let mut auto = Cell::new();
    assert!(matches!(hold(&mut auto, true, 10.0), Err(Refused::NotManual { .. })));
    let mut cell = manual();
    for percent in [0.0, -1.0, 101.0, f64::NAN] {
        assert_eq!(hold(&mut cell, true, percent), Err(Refused::BadSpeed));
    }
    let j8 = PanelAction::HoldJog { axis: AxisIndex::ALL[7], up: true, percent: 10.0 };
    assert!(matches!(cell.controller.operate(cell.now, &j8), Err(Refused::NoSuchAxis { .. })));
    assert_eq!(keep(&mut cell), Err(Refused::NotHeld));
    cell.controller.operate(cell.now, &PanelAction::EndJog).unwrap();
    // The end of a held move ends no other move.
    let jog = PanelAction::Jog { axis: J1, by: 20.0, percent: 20.0 };
    cell.controller.operate(cell.now, &jog).unwrap();
    assert_eq!(keep(&mut cell), Err(Refused::NotHeld));
    cell.controller.operate(cell.now, &PanelAction::EndJog).unwrap();
    cell.pass(10.0);
    assert!((j1(&mut cell) - 20.0).abs() < 1e-6);
}

#[test]
fn a_fault_is_in_force_from_its_begin_to_its_end() {
    let mut cell = Cell::new();
    assert!(cell.controller.faults(cell.now).is_empty());
    cell.ok(&["modifyGSPD", "500"]);
    let not_executed = Fault::Task(TaskFault::NotExecuted);
    let number = cell.controller.begin_fault(cell.now, not_executed.clone(), 1.0, None).unwrap();
    cell.pass(1.0);
    let now = cell.controller.faults(cell.now);
    assert_eq!(
        now.iter().map(|one| (one.number, &one.fault, one.left)).collect::<Vec<_>>(),
        [(number, &not_executed, None)]
    );
    let speed = |cell: &mut Cell| cell.controller.snapshot(cell.now).global_speed_percent;
    cell.command(&["modifyGSPD", "300"]);
    assert!((speed(&mut cell) - 50.0).abs() < 1e-9, "it is answered and not carried out");
    cell.controller.end_fault(cell.now, number);
    cell.controller.end_fault(cell.now, number);
    cell.controller.end_fault(cell.now, 77);
    assert!(cell.controller.faults(cell.now).is_empty());
    cell.command(&["modifyGSPD", "300"]);
    assert!((speed(&mut cell) - 30.0).abs() < 1e-9);
}

#[test]
fn a_fault_ends_by_itself_and_link_faults_are_handed_on() {
    let mut cell = Cell::new();
    let refuse = Fault::Link(LinkFault::Refuse);
    let lasts = Some(Duration::from_secs(2));
    let first = cell.controller.begin_fault(cell.now, refuse.clone(), 1.0, lasts).unwrap();
    assert_eq!(cell.controller.link_faults().len(), 1);
    cell.pass(1.5);
    assert_eq!(cell.controller.faults(cell.now)[0].left, Some(Duration::from_millis(500)));
    let second = cell.controller.begin_fault(cell.now, refuse, 1.0, None).unwrap();
    assert_ne!(first, second);
    cell.pass(0.5);
    assert_eq!(cell.controller.faults(cell.now).iter().map(|one| one.number).collect::<Vec<_>>(), [second]);
    cell.controller.end_fault(cell.now, second);
    assert!(cell.controller.link_faults().is_empty());
}

#[test]
fn a_fault_of_the_scenario_can_be_ended_too_and_there_is_room_for_forty() {
    let scenario = r6_controller::Scenario::read("[[fault]]\nfault = \"echo\"").unwrap();
    let model = r6_controller::RobotModel::named("BRTIRUS0707A").unwrap().clone();
    let mut cell = Cell::of(r6_controller::ControllerSettings {
        scenario: Some(std::sync::Arc::new(scenario)),
        ..r6_controller::ControllerSettings::new(Profile::hc1(), model)
    });
    let fault = || Fault::Task(TaskFault::ListFull);
    for _ in 0..40 {
        cell.controller.begin_fault(cell.now, fault(), 1.0, None).unwrap();
    }
    assert!(matches!(cell.controller.begin_fault(cell.now, fault(), 1.0, None), Err(Refused::NoRoom { .. })));
    let all: Vec<_> = cell.controller.faults(cell.now).iter().map(|one| one.number).collect();
    assert_eq!(all, (0..=40).collect::<Vec<_>>());
    all.into_iter().for_each(|number| cell.controller.end_fault(cell.now, number));
    assert!(cell.controller.faults(cell.now).is_empty());
    let next = cell.controller.begin_fault(cell.now, fault(), 1.0, None).unwrap();
    assert_eq!(next, 41, "numbers are not used again");
}

#[test]
fn the_power_of_any_controller_can_be_cut() {
    let mut cell = Cell::new();
    cell.ok(&["modifyGSPD", "500"]);
    cell.controller.cut_power(cell.now, Duration::from_secs(3));
    assert!(cell.controller.snapshot(cell.now).power_off);
    let clear = cell.controller.operate(cell.now, &PanelAction::ClearAlarm);
    assert_eq!(clear, Err(Refused::PowerOff));
    cell.pass(3.0);
    let back = cell.controller.snapshot(cell.now);
    assert!(!back.power_off && (back.axes[0] - 0.0).abs() < 1e-9);
}
