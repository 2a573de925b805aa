//! What each command changes of what a taught program does, or a person has done.

use r6_controller::{ControllerSettings, Key, PanelAction, Profile, SavedState, StartState};
use r6_proto::message::CommandName;

use crate::common::{Cell, assert_near};
use crate::{arm, count, person, profiles, start, step, taught, told, value, with_programs};

/// Runs a case on every profile that has the command; the others refuse it.
fn on_each(word: &str, case: fn(&Profile)) {
    let name = CommandName::exact(word.as_bytes()).unwrap();
    let mut ran = 0;
    for profile in profiles() {
        if profile.has_command(name) {
            case(&profile);
            ran += 1;
        } else {
            // The right number of arguments, so that only the word can be what is refused.
            let words: Vec<_> = [word].into_iter().chain(name.info().arguments.iter().map(|_| "1")).collect();
            let reply = Cell::with(profile.clone(), StartState::Waiting).command(&words);
            // Old firmware refuses with an empty text.
            assert_ne!(reply.last().map(String::as_str), Some("ok"), "{}: {reply:?}", profile.name);
        }
    }
    assert!(ran > 0, "{word}: no profile has it");
}

crate::cases! { CASES: on_each;
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
        // The next start goes on from there: the first step does not count again.
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
        // A person turns the key, and only then it may start.
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
        // What the first program waited for no longer matters.
        person(&mut cell, &PanelAction::SetInput { board: 0, point: 0, on: true });
        assert_eq!(value(&mut cell, "output-0"), "2");
    };
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
        // The program counts on from there, and reaches its target.
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
            "eu" => u32::from(cell.controller.output(cell.now, r6_controller::io::OutputPoint::Eu(0))).to_string(),
            word => value(&mut cell, word),
        });
        assert_eq!([y.as_str(), &far, &eu], ["1", "2147483648", "1"]);
        // What the program has set is off again.
        told(&mut cell, &["modifyOutput", "0", "0", "0"]);
        told(&mut cell, &["modifyOutput", "3", "31", "0"]);
        told(&mut cell, &["modifyOutput", "7", "0", "0"]);
        assert_eq!((value(&mut cell, "output-0").as_str(), value(&mut cell, "output-3").as_str()), ("0", "0"));
        assert!(!cell.controller.output(cell.now, r6_controller::io::OutputPoint::Eu(0)));
        // And what it waits for has come: board 6 is the third of M.
        let reply = cell.command(&["modifyOutput", "6", "1", "1"]);
        let goes_on = value(&mut cell, "output-0") == "2";
        assert_eq!(goes_on, profile.m_output_writable, "{reply:?}");
        assert_eq!(reply.last().is_some_and(|word| word == "ok"), profile.m_output_writable);
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
        // An alarm that a person raises in mid-move, and that has no cause in the program.
        let mut cell = in_its_way(profile);
        person(&mut cell, &PanelAction::RaiseAlarm(850));
        cell.pass(10.0);
        assert!(cell.number("axis-0") < 30.0);
        told(&mut cell, &["clearAlarmContinue"]);
        cell.pass(4.0);
        assert_eq!((cell.text("axis-0").as_str(), count(&mut cell, 0)), ("90.000000", 1));
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
        // While the program runs: the fourth place is of the new pattern.
        told(&mut cell, &["modifyStackData", "3", "20", "25", "30", "2", "2", "1"]);
        cell.pass(1.0);
        for on in [true, false] {
            person(&mut cell, &PanelAction::SetInput { board: 0, point: 0, on });
        }
        cell.pass(30.0);
        assert_eq!(value(&mut cell, "curAlarm"), "10", "four places are all there are");
    };
    modify_gspd "modifyGSPD" => |profile| {
        let mut cell = in_its_way(profile);
        // 10 % of 220.8 degrees per second, then a quarter of that, in mid-move.
        assert!((speed_of_j1(&mut cell) - 22.08).abs() < 1e-3);
        told(&mut cell, &["modifyGSPD", "250"]);
        cell.pass(1.0);
        assert!((speed_of_j1(&mut cell) - 5.52).abs() < 1e-3);
        // Nothing at all, and on again.
        told(&mut cell, &["modifyGSPD", "0"]);
        cell.pass(1.0);
        assert_eq!(speed_of_j1(&mut cell), 0.0);
        told(&mut cell, &["modifyGSPD", "1000"]);
        cell.pass(1.0);
        assert!((speed_of_j1(&mut cell) - 22.08).abs() < 1e-3);
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
    modify_acc_dec "modifyAccDec" => |profile| {
        // The way at full speed, half of each ramp (0.25 s, then 0.3 and 0.5), and the filter of 0.128 s.
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
    switch_tool "switchTool" => |profile| {
        let mut cell = tool_in_use(profile);
        let tip = cell.world();
        told(&mut cell, &["switchTool", "0"]);
        assert_near(cell.world(), FLANGE.with(&mut cell), 1e-6);
        assert!(apart(tip, cell.world()) > 99.999);
        // The program, which goes on, takes its own tool again.
        person(&mut cell, &PanelAction::SetInput { board: 0, point: 0, on: true });
        assert_near(cell.world(), tip, 1e-6);
    };
    modify_tool "modifyTool" => |profile| {
        let mut cell = tool_in_use(profile);
        let tip = cell.world();
        // The tool that the program has chosen becomes longer by 10.5 mm, at once.
        told(&mut cell, &["modifyTool", "3", "0", "0", "110500", "0", "0", "0"]);
        let longer = cell.world();
        assert!((apart(tip, longer) - 10.5).abs() < 1e-5, "{}", apart(tip, longer));
        assert!((apart(FLANGE.with(&mut cell), longer) - 110.5).abs() < 1e-5);
    };
    switch_coordinate "switchCoordinate" => |profile| {
        // A workbench is taught at the pendant; here a controller comes back with two of them.
        let mut cell = on_benches(profile);
        start(&mut cell);
        cell.pass(5.0);
        let [x, y, z, ..] = cell.world();
        assert_near([x, y, z, 0.0, 0.0, 0.0], [400.0, 0.0, 450.0, 0.0, 0.0, 0.0], 2e-6);
        // On the other one, which lies 30 mm further back and 20 to the right, the arm is elsewhere, and goes elsewhere.
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
    clear_alarm "clearAlarm" => |profile| {
        let mut cell = in_its_way(profile);
        person(&mut cell, &PanelAction::RaiseAlarm(850));
        told(&mut cell, &["clearAlarm"]);
        cell.pass(10.0);
        // Nothing runs by itself.
        assert_eq!((value(&mut cell, "curAlarm").as_str(), value(&mut cell, "curMode").as_str()), ("0", "2"));
        assert!(cell.number("axis-0") < 30.0 && value(&mut cell, "isMoving") == "0");
        start(&mut cell);
        assert_eq!(value(&mut cell, "curMode"), "7");
        // An emergency stop that is pressed is not cleared from afar.
        person(&mut cell, &PanelAction::EmergencyStop);
        assert_ne!(cell.command(&["clearAlarm"]).last().map(String::as_str), Some("ok"));
        assert_eq!(value(&mut cell, "curAlarm"), "7");
    };
}

const TOOL_DOWN: [f64; 6] = [0.0, 10.0, -20.0, 0.0, -80.0, 0.0];

/// A program that counts, turns J1 to 90 degrees at 22.08 per second and waits there; a second after its start.
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
    // Six decimals of each: a hundred-thousandth of what is compared.
    (cell.number("axis-0") - before) / 0.1
}

fn waiting_for_x010() -> String {
    step::wait_for("X010") + &step::output("Y010") + step::REMOTE
}

/// A program that counts, cannot turn J1 so far, and counts something else.
fn failing(profile: &Profile) -> Cell {
    let program = step::count(0) + &step::turn(170.0, 50.0) + &step::count(2) + step::REMOTE;
    let mut cell = taught(profile, &program);
    start(&mut cell);
    assert_eq!(value(&mut cell, "curAlarm"), "130");
    cell
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

/// Where the flange of an arm that was not moved is: a controller of the same kind that has no tool tells.
struct Flange;
const FLANGE: Flange = Flange;

impl Flange {
    fn with(&self, cell: &mut Cell) -> [f64; 6] {
        Cell::with(cell.controller.profile().clone(), StartState::Auto).world()
    }
}

fn apart(one: [f64; 6], other: [f64; 6]) -> f64 {
    (0..3).map(|n| (one[n] - other[n]).powi(2)).sum::<f64>().sqrt()
}

/// Comes back from a power cut with workbenches 1 and 2, and with a program that goes to a place on the one in use.
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
