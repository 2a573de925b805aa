//! Commands that change a value: what a taught program, or an operator, finds afterwards.

use r6_controller::io::OutputPoint;
use r6_controller::{ControllerSettings, PanelAction, Profile, SavedState, StartState};

use crate::common::{Cell, assert_near};
use crate::{TOOL_DOWN, arm, count, person, start, step, taught, told, value};

crate::cases! { CASES: crate::command_on_each;
    modify_counter "modifyCounter" => |profile| {
        let program = step::count(2)
            + "[[step]]\ndo = \"if\"\ncounter = 2\nreached = true\nto = \"full\"\n"
            + &step::wait(1.0)
            + "[[step]]\ndo = \"jump\"\nto = \"again\"\n[[step]]\ndo = \"label\"\nname = \"full\"\n"
            + &step::output("Y013")
            + step::REMOTE;
        let program = format!("[[step]]\ndo = \"label\"\nname = \"again\"\n{program}");
        let mut settings = ControllerSettings {
            start: StartState::Auto,
            mold: "taught".to_owned(),
            ..ControllerSettings::new(profile.clone(), arm())
        };
        settings.library.load("taught", &program).unwrap();
        settings.counters.insert(2, (50, 0));
        let mut cell = Cell::of(settings);
        start(&mut cell);
        cell.pass(3.5);
        assert_eq!((count(&mut cell, 2), value(&mut cell, "output-0").as_str()), (4, "0"));
        // The program continues counting from there, and reaches its target.
        told(&mut cell, &["modifyCounter", "2", "48", "-1"]);
        cell.pass(1.0);
        assert_eq!((count(&mut cell, 2), value(&mut cell, "output-0").as_str()), (49, "0"));
        if profile.counter_target_writable {
            told(&mut cell, &["modifyCounter", "2", "-1", "51"]);
            cell.pass(1.0);
            assert_eq!((count(&mut cell, 2), value(&mut cell, "output-0").as_str()), (50, "0"));
        }
        cell.pass(1.0);
        assert_eq!(value(&mut cell, "output-0"), "8");
    };
    modify_output "modifyOutput" => |profile| {
        let program = "[[step]]\ndo = \"output\"\npoint = \"EUY010\"\non = true\n".to_owned()
            + &step::output("Y010")
            + &step::output("Y3.047")
            + &step::wait_for("M2.011")
            + &step::output("Y011")
            + step::REMOTE;
        let mut cell = taught(profile, &program);
        start(&mut cell);
        let [y, far, eu] = ["output-0", "output-3", "eu"].map(|word| match word {
            "eu" => u32::from(cell.controller.output(cell.now, OutputPoint::Eu(0))).to_string(),
            word => value(&mut cell, word),
        });
        assert_eq!([y.as_str(), &far, &eu], ["1", "2147483648", "1"]);
        // The outputs that the program has set are off again.
        told(&mut cell, &["modifyOutput", "0", "0", "0"]);
        told(&mut cell, &["modifyOutput", "3", "31", "0"]);
        told(&mut cell, &["modifyOutput", "7", "0", "0"]);
        assert_eq!((value(&mut cell, "output-0").as_str(), value(&mut cell, "output-3").as_str()), ("0", "0"));
        assert!(!cell.controller.output(cell.now, OutputPoint::Eu(0)));
        // Its wait is over, too: board 6 is the third of M.
        let reply = cell.command(&["modifyOutput", "6", "1", "1"]);
        let goes_on = value(&mut cell, "output-0") == "2";
        assert_eq!(goes_on, profile.m_output_writable, "{reply:?}");
        assert_eq!(reply.last().is_some_and(|word| word == "ok"), profile.m_output_writable);
    };
    modify_stack_data "modifyStackData" => |profile| {
        let pattern = "[[stack]]\nnumber = 3\nspacing = [40, 40, 30]\ncount = [3, 3, 2]\n";
        let place = "[[step]]\ndo = \"move-to-stack\"\nstack = 3\ncounter = 0\nfirst = [340, -20, 440]\nspeed = 40\n";
        let program = pattern.to_owned() + &step::axes(&TOOL_DOWN, 80.0) + place + &step::wait_for("X010")
            + &step::count(0);
        let mut cell = taught(profile, &program);
        // Two in a row, further apart: the second place is one step in X, the third one in Y.
        told(&mut cell, &["modifyStackData", "3", "55.5", "60", "30", "2", "2", "1"]);
        start(&mut cell);
        for there in [[340.0, -20.0, 440.0], [395.5, -20.0, 440.0], [340.0, 40.0, 440.0]] {
            cell.pass(10.0);
            let [x, y, z, ..] = cell.world();
            assert_near([x, y, z, 0.0, 0.0, 0.0], [there[0], there[1], there[2], 0.0, 0.0, 0.0], 2e-6);
            for on in [true, false] {
                person(&mut cell, &PanelAction::SetInput { board: 0, point: 0, on });
            }
        }
        // While the program runs: the fourth place follows the new pattern.
        told(&mut cell, &["modifyStackData", "3", "20", "25", "30", "2", "2", "1"]);
        cell.pass(1.0);
        for on in [true, false] {
            person(&mut cell, &PanelAction::SetInput { board: 0, point: 0, on });
        }
        cell.pass(30.0);
        assert_eq!(value(&mut cell, "curAlarm"), "10", "four places are all there are");
    };
    rewrite_data "rewriteData" => |profile| {
        let program = "[[step]]\ndo = \"wait-for-registers\"\nfirst = 820\n".to_owned()
            + "[[step]]\ndo = \"if\"\nregister = 820\nat_least = 7\nto = \"enough\"\n"
            + &step::count(0)
            + "[[step]]\ndo = \"end\"\n[[step]]\ndo = \"label\"\nname = \"enough\"\n"
            + &step::count(2);
        let mut cell = taught(profile, &program);
        start(&mut cell);
        told(&mut cell, &["rewriteData", "820", "6", "0"]);
        told(&mut cell, &["rewriteData", "821", "9", "0"]);
        assert_eq!((count(&mut cell, 0), count(&mut cell, 2)), (1, 0));
        told(&mut cell, &["rewriteData", "820", "7", "1"]);
        assert_eq!((count(&mut cell, 0), count(&mut cell, 2)), (1, 1));
    };
    rewrite_data_list "rewriteDataList" => |profile| {
        let program = "[[step]]\ndo = \"wait-for-registers\"\nfirst = 895\ncount = 6\n\
                       [[step]]\ndo = \"move-to-registers\"\nfirst = 895\nspeed = 50\n";
        let mut cell = taught(profile, program);
        start(&mut cell);
        told(&mut cell, &["rewriteDataList", "895", "6", "0", "1000", "-2500", "3000", "4001", "5000", "-6000"]);
        cell.pass(5.0);
        assert_near(cell.axes(), [1.0, -2.5, 3.0, 4.001, 5.0, -6.0], 0.0);
    };
    switch_tool "switchTool" => |profile| {
        let mut cell = tool_in_use(profile);
        let tip = cell.world();
        told(&mut cell, &["switchTool", "0"]);
        assert_near(cell.world(), flange(&cell), 1e-6);
        assert!(apart(tip, cell.world()) > 99.999);
        // The program continues, and chooses its own tool again.
        person(&mut cell, &PanelAction::SetInput { board: 0, point: 0, on: true });
        assert_near(cell.world(), tip, 1e-6);
    };
    modify_tool "modifyTool" => |profile| {
        let mut cell = tool_in_use(profile);
        let tip = cell.world();
        // The tool chosen by the program becomes longer by 10.5 mm, at once.
        told(&mut cell, &["modifyTool", "3", "0", "0", "110500", "0", "0", "0"]);
        let longer = cell.world();
        assert!((apart(tip, longer) - 10.5).abs() < 1e-5, "{}", apart(tip, longer));
        assert!((apart(flange(&cell), longer) - 110.5).abs() < 1e-5);
    };
    switch_coordinate "switchCoordinate" => |profile| {
        // A workbench is taught at the pendant; here a controller starts with two of them saved.
        let mut cell = on_benches(profile);
        start(&mut cell);
        cell.pass(5.0);
        let [x, y, z, ..] = cell.world();
        assert_near([x, y, z, 0.0, 0.0, 0.0], [400.0, 0.0, 450.0, 0.0, 0.0, 0.0], 2e-6);
        // The other workbench lies 30 mm further back and 20 to the right, so the arm has other coordinates
        // and another target there.
        told(&mut cell, &["switchCoordinate", "2"]);
        let [x, y, z, ..] = cell.world();
        assert_near([x, y, z, 0.0, 0.0, 0.0], [430.0, 20.0, 450.0, 0.0, 0.0, 0.0], 2e-6);
        let from = cell.axes();
        person(&mut cell, &PanelAction::SetInput { board: 0, point: 0, on: true });
        cell.pass(5.0);
        let [x, y, z, ..] = cell.world();
        assert_near([x, y, z, 0.0, 0.0, 0.0], [400.0, 0.0, 450.0, 0.0, 0.0, 0.0], 2e-6);
        assert!((cell.axes()[0] - from[0]).abs() > 1.0, "the arm has moved");
    };
}

/// A program that has chosen tool 3, 100 mm long, and waits for X010 to choose it again.
fn tool_in_use(profile: &Profile) -> Cell {
    let program = step::numbered("tool", 3) + &step::wait_for("X010");
    let mut cell = taught(profile, &program);
    told(&mut cell, &["modifyTool", "3", "0", "0", "100000", "0", "0", "0"]);
    let flange = cell.world();
    start(&mut cell);
    assert!((apart(flange, cell.world()) - 100.0).abs() < 1e-5);
    cell
}

/// The pose of the flange of an arm that was not moved: a controller of the same kind without a tool reports
/// it.
fn flange(cell: &Cell) -> [f64; 6] {
    Cell::with(cell.controller.profile().clone(), StartState::Auto).world()
}

fn apart(one: [f64; 6], other: [f64; 6]) -> f64 {
    (0..3).map(|n| (one[n] - other[n]).powi(2)).sum::<f64>().sqrt()
}

/// Restores a controller after a power cut with workbenches 1 and 2, and with a program that moves to a place
/// on the one in use.
fn on_benches(profile: &Profile) -> Cell {
    let place = "[[step]]\ndo = \"linear-move\"\nto = [400, 0, 450]\nspeed = 40\n";
    let program = step::axes(&TOOL_DOWN, 80.0) + place + &step::wait_for("X010") + place + step::REMOTE;
    let settings = || {
        let mut settings = ControllerSettings {
            start: StartState::Auto,
            mold: "taught".to_owned(),
            ..ControllerSettings::new(profile.clone(), arm())
        };
        settings.library.load("taught", &program).unwrap();
        settings
    };
    let saved = Cell::of(settings()).controller.machine().saved().to_json();
    let mut saved: serde_json::Value = serde_json::from_str(&saved).unwrap();
    saved["benches"] = serde_json::json!({"1": [0, 0, 0, 0, 0, 0], "2": [-30, -20, 0, 0, 0, 0]});
    saved["bench"] = serde_json::json!(1);
    Cell::restored(settings(), &SavedState::from_json(&saved.to_string()).unwrap())
}
