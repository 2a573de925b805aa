//! The addresses of the arm: they report what a taught program or an operator at the panel did.

use r6_controller::{Button, ControllerSettings, Key, PanelAction, Profile, RobotModel};
use r6_motion::drive::torques;
use r6_motion::{Axes, AxisMotions};
use r6_proto::AxisIndex;
use serde_json::json;

use crate::common::{Cell, assert_near};
use crate::{TOOL_DOWN, arm, changes, person, press, settings, start, step, taught};

crate::cases! { CASES: crate::address_on_each;
    axis_num "axisNum" => |profile| {
        for (model, axes) in [("BRTIRUS0707A", "6"), ("GENERIC-SCARA", "4")] {
            let model = RobotModel::named(model).unwrap().clone();
            assert_eq!(Cell::of(ControllerSettings { model, ..settings(profile) }).text("axisNum"), axes);
        }
    };
    axis_n "axis-n" => |profile| {
        let mut cell = taught(profile, &(step::axes(&TARGET, 50.0) + step::REMOTE));
        let before: Vec<_> = (0..8).map(|n| cell.text(&format!("axis-{n}"))).collect();
        assert!(before.iter().all(|axis| axis == "0.000000"), "{before:?}");
        start(&mut cell);
        cell.pass(5.0);
        for (n, target) in TARGET.into_iter().chain([0.0; 2]).enumerate() {
            assert_eq!(cell.text(&format!("axis-{n}")), format!("{target:.6}"), "axis-{n}");
        }
        // Then the operator moves each of them by hand.
        person(&mut cell, &PanelAction::TurnKey(Key::Manual));
        for (axis, from) in AxisIndex::ALL.into_iter().zip(TARGET) {
            person(&mut cell, &PanelAction::Jog { axis, by: -2.5, percent: 100.0 });
            cell.pass(3.0);
            assert_eq!(cell.text(&format!("axis-{}", axis.number())), format!("{:.6}", from - 2.5));
        }
    };
    world_n "world-n" => |profile| {
        let way = "[[step]]\ndo = \"linear-move\"\nto = [400, -30, 450, 180, 0, 90]\nspeed = 20\n";
        let mut cell = taught(profile, &(step::axes(&TOOL_DOWN, 50.0) + way + step::REMOTE));
        let before = cell.world();
        assert!((before[0] - 531.3).abs() < 0.4 && before[1].abs() < 1e-9, "{before:?}");
        start(&mut cell);
        cell.pass(10.0);
        let [x, y, z, u, v, w] = cell.world();
        assert_near([x, y, z, u.abs(), v, w], [400.0, -30.0, 450.0, 180.0, 0.0, 90.0], 2e-6);
        // An arm of six axes has no seventh and eighth.
        assert_eq!(cell.query(&["world-6", "world-7"]), [json!("0.000000"), json!("0.000000")]);
    };
    cur_torque_n "curTorque-n" => torque;
    cur_speed_n "curSpeed-n" => |profile| {
        for (n, axis) in arm().axes.into_iter().enumerate() {
            let mut cell = turning(profile, n);
            // A quarter of full speed; 6 degrees per second are one turn per minute.
            let rpm = -(axis.max_speed * 0.25 * axis.gear_ratio / 6.0).round();
            let run = |cell: &mut Cell| {
                start(cell);
                cell.pass(0.42);
            };
            changes(&mut cell, &format!("curSpeed-{n}"), "0", run, &format!("{rpm}"));
            let pause = |cell: &mut Cell| {
                press(cell, Button::Pause);
                cell.pass(1.0);
            };
            changes(&mut cell, &format!("curSpeed-{n}"), &format!("{rpm}"), pause, "0");
        }
        assert_eq!(Cell::of(settings(profile)).query(&["curSpeed-6", "curSpeed-7"]), [json!("0"), json!("0")]);
    };
    origin "origin" => |profile| {
        let mut cell = Cell::of(ControllerSettings { homed: false, ..settings(profile) });
        let home = |cell: &mut Cell| {
            person(cell, &PanelAction::TurnKey(Key::Manual));
            person(cell, &PanelAction::Home);
            cell.pass(1.0);
        };
        changes(&mut cell, "origin", "0", home, "1");
    };
    is_moving "isMoving" => |profile| {
        let mut cell = taught(profile, &(step::turn(20.0, 50.0) + step::REMOTE));
        changes(&mut cell, "isMoving", "0", start, "1");
        changes(&mut cell, "isMoving", "1", |cell| cell.pass(2.0), "0");
        person(&mut cell, &PanelAction::TurnKey(Key::Manual));
        let jog = PanelAction::Jog { axis: AxisIndex::ALL[0], by: 5.0, percent: 10.0 };
        changes(&mut cell, "isMoving", "0", |cell| person(cell, &jog), "1");
    };
    tool_coord "toolCoord" => |profile| {
        let program = step::numbered("tool", 3) + &step::numbered("workbench", 2) + step::REMOTE;
        // Nothing changes the third text, a collaborative dispatcher: no manual names a way to choose one.
        changes(&mut taught(profile, &program), "toolCoord", r#"["0","0","0"]"#, start, r#"["3","2","0"]"#);
    };
    faxis_n "faxis-n" => |profile| {
        // Undocumented; taken for the filtered position, which is the position of the arm.
        let mut cell = taught(profile, &(step::axes(&TARGET, 50.0) + step::REMOTE));
        assert_eq!(cell.text("faxis-0"), "0.000000");
        start(&mut cell);
        cell.pass(0.1);
        for n in 0..8 {
            assert_eq!(cell.text(&format!("faxis-{n}")), cell.text(&format!("axis-{n}")));
        }
        cell.pass(5.0);
        for (n, target) in TARGET.into_iter().enumerate() {
            assert_eq!(cell.text(&format!("faxis-{n}")), format!("{target:.6}"));
        }
    };
}

/// A different position for every axis.
const TARGET: [f64; 6] = [12.5, -20.25, 30.125, 5.5, 40.75, -90.0];

/// A program that turns one axis, backwards, at a quarter of its full speed.
fn turning(profile: &Profile, axis: usize) -> Cell {
    let mut to = [0.0; 6];
    to[axis] = -44.0;
    taught(profile, &(step::axes(&to, 25.0) + step::REMOTE))
}

/// The torque while an axis turns evenly: it follows from the position and speed, which other addresses
/// report.
fn torque(profile: &Profile) {
    let model = arm();
    let expected = |cell: &mut Cell, axis: usize, speed: f64| {
        let axes = Axes::of_arm(cell.axes()).unwrap();
        let mut speeds = [0.0; 8];
        speeds[axis] = speed;
        let motion = AxisMotions { axes, speeds, accelerations: [0.0; 8] };
        let share = torques(&model, &motion)[axis];
        format!("{}", (share * 2580.0).round())
    };
    for (n, axis) in model.axes.iter().enumerate() {
        let mut cell = turning(profile, n);
        let address = format!("curTorque-{n}");
        assert_eq!(cell.text(&address), "0", "the brakes hold it");
        start(&mut cell);
        cell.pass(0.42);
        let turning = expected(&mut cell, n, -axis.max_speed * 0.25);
        assert_eq!(cell.text(&address), turning, "{address}");
        press(&mut cell, Button::Pause);
        cell.pass(1.0);
        assert_eq!(cell.text(&address), "0");
    }
    // J1 by hand: gravity does not turn it, and friction takes 20 % of 2580 at full speed.
    let mut cell = turning(profile, 0);
    start(&mut cell);
    cell.pass(0.42);
    assert_eq!(cell.text("curTorque-0"), "-129");
    assert_eq!(cell.query(&["curTorque-6", "curTorque-7"]), [json!("0"), json!("0")]);
}
