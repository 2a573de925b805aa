//! What survives a power cut, and what does not.

mod common;

use common::{Cell, axis_move};
use proptest::prelude::*;
use r6_controller::{
    Controller, ControllerSettings, Key, PanelAction, Profile, RobotModel, SavedError, SavedState,
};
use r6_proto::time::Instant;
use serde_json::{Value, json};

fn settings() -> ControllerSettings {
    ControllerSettings::new(Profile::hc1(), RobotModel::named("BRTIRUS0707A").unwrap().clone())
}

/// The cell after a power cut, restored from the text on the disk.
fn power_cut(cell: &Cell) -> Cell {
    let text = cell.controller.machine().saved().to_json();
    Cell::restored(settings(), &SavedState::from_json(&text).unwrap())
}

/// A program that counts, moves, sets an output and defines a stack runs as soon as the power is on.
#[test]
fn what_a_program_did_before_the_cut_does_not_happen_again_by_itself() {
    let busy = "[[stack]]\nnumber=4\nspacing=[1,2,3]\ncount=[1,2,3]\n\
                [[step]]\ndo=\"counter\"\nnumber=0\nby=1\n[[step]]\ndo=\"output\"\npoint=\"Y010\"\non=true\n\
                [[step]]\ndo=\"axis-move\"\nto=[20]\nspeed=10\n[[step]]\ndo=\"alarm\"\nnumber=5000\n";
    let with_program = || {
        let mut settings = settings();
        settings.library.load("busy", busy).unwrap();
        "busy".clone_into(&mut settings.mold);
        settings
    };
    let mut cell = Cell::of(with_program());
    cell.ok(&["modifyStackData", "4", "9", "9", "9", "1", "1", "1"]);
    cell.pass(0.5);
    let saved = cell.controller.machine().saved();
    let mut after = Cell::restored(with_program(), &saved);
    after.pass(5.0);
    assert_eq!(
        after.query(&["curMode", "isMoving", "output-0", "curAlarm", "axis-0"]),
        [json!("2"), json!("0"), json!("0"), json!("0"), json!("0.000000")]
    );
    assert_eq!(after.value("counter-0"), json!([0, 0, 1]));
    assert_eq!(after.controller.machine().stacks()[&4].spacing, [9.0; 3]);
    // After a start it runs from its first step; a stack that was not saved is the program's own.
    after.ok(&["startButton"]);
    assert_eq!(after.value("counter-0"), json!([0, 0, 2]));
    let nothing = Cell::new().controller.machine().saved();
    assert_eq!(
        Cell::restored(with_program(), &nothing).controller.machine().stacks().len(),
        0,
        "`remote` has none"
    );
}

/// A state as JSON, to be damaged.
fn state() -> Value {
    let mut cell = Cell::new();
    cell.ok(&["modifyTool", "2", "1000", "2000", "3000", "0", "0", "90000"]);
    cell.ok(&["modifyStackData", "3", "10.5", "20", "30", "2", "3", "4"]);
    cell.ok(&["rewriteData", "800", "7", "1"]);
    serde_json::from_str(&cell.controller.machine().saved().to_json()).unwrap()
}

#[test]
fn what_is_savable_comes_back() {
    let mut cell = Cell::new();
    cell.ok(&["modifyCounter", "2", "17", "40"]);
    cell.ok(&["rewriteDataList", "810", "2", "1", "-5", "123456"]);
    cell.ok(&["rewriteData", "820", "9", "0"]);
    cell.ok(&["modifyTool", "2", "1000", "2000", "3333", "100", "200", "90001"]);
    cell.ok(&["switchTool", "2"]);
    cell.ok(&["switchCoordinate", "5"]);
    cell.ok(&["modifyStackData", "3", "10.5", "20", "0.1", "2", "3", "4"]);
    cell.ok(&["switchMold", "register-move"]);
    cell.ok(&["modifyOutput", "0", "3", "1"]);
    cell.ok(&["modifyGSPD", "500"]);
    let world = cell.world();

    let mut after = power_cut(&cell);
    assert_eq!(after.value("counter-2"), json!([2, 40, 17]));
    assert_eq!(
        ["Addr-810", "Addr-811", "Addr-820"].map(|register| after.text(register)),
        ["-5", "123456", "0"]
    );
    assert_eq!(after.value("toolCoord"), json!(["2", "5", "0"]));
    assert_eq!(after.world(), world);
    assert_eq!(after.controller.machine().stacks(), cell.controller.machine().stacks());
    assert_eq!(after.text("output-0"), "0");
    assert_eq!(after.controller.snapshot(after.now).global_speed_percent, 100.0);
    assert_eq!(after.controller.machine().saved(), {
        // It ran, and starts in automatic: the same state.
        cell.controller.machine().saved()
    });
    // The program is the one in use before.
    after.ok(&["startButton"]);
    after.ok(&["rewriteData", "800", "9000", "0"]);
    after.ok(&["modifyOutput", "4", "1", "1"]);
    assert_eq!(after.text("isMoving"), "1");
}

#[test]
fn a_register_that_was_saved_has_its_saved_value_again() {
    let mut cell = Cell::new();
    cell.ok(&["rewriteData", "800", "1", "1"]);
    cell.ok(&["rewriteData", "800", "2", "0"]);
    assert_eq!(cell.text("Addr-800"), "2");
    assert_eq!(power_cut(&cell).text("Addr-800"), "1");
}

#[test]
fn nothing_moves_by_itself_after_a_power_cut() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([axis_move([50.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    cell.pass(0.5);
    assert_eq!(cell.text("isMoving"), "1");
    let mut after = power_cut(&cell);
    assert_eq!((after.text("curMode"), after.text("isMoving")), ("2".to_owned(), "0".to_owned()));
    assert_eq!(after.text("RemoteCmdLen"), "0");
    after.pass(60.0);
    assert_eq!(after.axes(), [0.0; 6]);
    after.ok(&["startButton"]);
    assert_eq!(after.text("curMode"), "7");

    for (key, mode) in [(Key::Manual, "1"), (Key::Stop, "3"), (Key::Auto, "2")] {
        cell.controller.turn_key(cell.now, key);
        assert_eq!(power_cut(&cell).text("curMode"), mode);
    }
}

#[test]
fn what_may_have_changed_has_another_mark() {
    let mut cell = Cell::new();
    let mut before = cell.controller.machine().saved_mark();
    let changes: [&[&str]; 8] = [
        &["modifyCounter", "0", "1", "-1"],
        &["rewriteData", "800", "1", "1"],
        &["modifyTool", "1", "1", "0", "0", "0", "0", "0"],
        &["switchTool", "1"],
        &["switchCoordinate", "1"],
        &["modifyStackData", "0", "1", "1", "1", "1", "1", "1"],
        &["switchMold", "default"],
        &["modifyCounter", "0", "2", "5"],
    ];
    for words in changes {
        cell.ok(words);
        let after = cell.controller.machine().saved_mark();
        assert_ne!(after, before, "{words:?}");
        before = after;
    }
    cell.controller.turn_key(cell.now, Key::Manual);
    assert_ne!(cell.controller.machine().saved_mark(), before);
    before = cell.controller.machine().saved_mark();
    // State that does not survive a power cut is no reason to write.
    let others: [&[&str]; 4] = [
        &["rewriteData", "800", "7", "0"],
        &["modifyOutput", "0", "1", "1"],
        &["modifyGSPD", "100"],
        &["actionStop"],
    ];
    for words in others {
        cell.ok(words);
    }
    assert_eq!(cell.controller.machine().saved_mark(), before);
}

#[test]
fn a_damaged_state_names_the_field_the_value_and_what_it_has_to_be() {
    let cases: [(&str, Value, &[&str]); 17] = [
        ("/counters/0/current", json!("x"), &["`counters.0.current`", "\"x\"", "i64"]),
        ("/counters/0/current", json!(i64::MAX), &["`counters.0.current`", "9223372036854775807", "a count"]),
        ("/counters/0", json!({"target": 1}), &["`counters.0`", "current"]),
        ("/registers", json!({"799": 1}), &["`registers`", "799", "800 to 900"]),
        ("/tools", json!({"32": [0, 0, 0, 0, 0, 0]}), &["`tools`", "32", "0 to 31"]),
        ("/tools/2", json!([0, 0, 0, 0, 0, 1e300]), &["`tools.2`", "1e300", "finite"]),
        ("/tools/2", json!([0, 0, 0]), &["`tools.2`", "length 3"]),
        ("/tool", json!(32), &["`tool`", "32", "0 to 31"]),
        ("/bench", json!(u32::MAX), &["`bench`", "4294967295", "0 to 31"]),
        ("/stacks", json!({"40": {"spacing": [1, 1, 1], "count": [1, 1, 1]}}), &["`stacks`", "40"]),
        ("/stacks/3/count", json!([1, -1, 1]), &["`stacks.3.count[1]`", "-1"]),
        ("/mode", json!("running"), &["`mode`", "running", "auto"]),
        ("/mold", json!("m".repeat(300)), &["`mold`", "300 bytes"]),
        ("/version", json!(0), &["`version`", "0", "1"]),
        (
            "/programs",
            json!({"cell": "[[step]]\ndo=\"wiat\""}),
            &["`programs.cell`", "2:4: step 1", "\"wait\""],
        ),
        ("/programs", json!({"": ""}), &["`programs.`", "1 to 64 bytes"]),
        ("/programs", json!([]), &["`programs`"]),
    ];
    for (place, value, wanted) in cases {
        let mut state = state();
        state["programs"] = json!({});
        *state.pointer_mut(place).unwrap() = value;
        let error = SavedState::from_json(&state.to_string()).unwrap_err().to_string();
        for part in wanted {
            assert!(error.contains(part), "{place}: {error}");
        }
    }
    let mut unknown = state();
    unknown["speling"] = json!(1);
    let error = SavedState::from_json(&unknown.to_string()).unwrap_err().to_string();
    assert!(error.contains("speling"), "{error}");
}

#[test]
fn a_newer_state_is_told_apart_from_a_damaged_one() {
    let newer = json!({"version": 3, "whatever": "comes"}).to_string();
    let error = SavedState::from_json(&newer).unwrap_err();
    assert_eq!(error, SavedError::Newer { version: 3 });
}

/// A state of an older version is read. A state without newer parts is written so that an older release can
/// read it.
#[test]
fn only_a_state_that_needs_it_says_that_it_is_newer() {
    let old = state();
    assert_eq!((&old["version"], old.get("programs")), (&json!(1), None));
    assert!(SavedState::from_json(&old.to_string()).is_ok());
    let mut cell = Cell::new();
    load(&mut cell, "cell", "[[step]]\ndo=\"remote\"\n");
    let new: Value = serde_json::from_str(&cell.controller.machine().saved().to_json()).unwrap();
    assert_eq!(new["version"], json!(2));
    assert_eq!(new["programs"], json!({"cell": "[[step]]\ndo=\"remote\"\n"}));
}

fn load(cell: &mut Cell, name: &str, text: &str) {
    let action = PanelAction::LoadProgram { name: name.to_owned(), text: text.to_owned() };
    // A refused action changes no state.
    let _ = cell.controller.operate(cell.now, &action);
}

#[test]
fn a_state_that_is_cut_off_anywhere_is_refused() {
    let text = state().to_string();
    for end in 0..text.len() {
        assert!(SavedState::from_json(&text[..end]).is_err(), "{end}");
    }
    assert!(SavedState::from_json(&text).is_ok());
    assert!(SavedState::from_json(&format!("{text}x")).is_err());
}

/// A number in a form that a peer may send.
fn number() -> impl Strategy<Value = String> {
    prop_oneof![
        (-5_i64..40).prop_map(|number| number.to_string()),
        any::<i64>().prop_map(|number| number.to_string()),
        (-1e6..1e6).prop_map(|number: f64| number.to_string()),
        any::<f64>().prop_map(|number| number.to_string()),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn whatever_peers_say_what_is_written_can_be_read(
        commands in prop::collection::vec(
            (prop::sample::select(vec![
                "modifyCounter", "rewriteData", "rewriteDataList", "modifyTool", "switchTool", "switchCoordinate",
                "modifyStackData", "startButton", "switchMold",
            ]), prop::collection::vec(number(), 0..8)),
            1..40,
        ),
        bench in any::<u32>(),
        programs in prop::collection::vec(
            (
                prop::sample::select(vec!["cell", "part", "remote", "\u{7528}\u{6237} \"1\"", "", "a/b"]),
                prop_oneof![
                    "\\PC*".prop_map(|text| text),
                    (0_u32..900).prop_map(|number| format!("[[step]]\ndo=\"alarm\"\nnumber={number} # \"\u{e9}\"\n")),
                    prop::sample::select(vec!["cell", "part", "nothing"])
                        .prop_map(|name| format!("{{\"step\":[{{\"do\":\"call\",\"program\":\"{name}\"}}]}}")),
                ],
            ),
            0..8,
        ),
    ) {
        let mut cell = Cell::new();
        for (name, text) in &programs {
            load(&mut cell, name, text);
        }
        for (word, arguments) in &commands {
            let words: Vec<&str> =
                std::iter::once(*word).chain(arguments.iter().map(String::as_str)).collect();
            cell.command(&words);
        }
        cell.add_rcc("1", &json!([{"oneshot": "1", "action": "800", "cnt_id": bench.to_string()}]));
        let saved = cell.controller.machine().saved();
        prop_assert_eq!(SavedState::from_json(&saved.to_json()), Ok(saved.clone()));
        let mut again = Controller::restored(settings(), &saved, Instant::ORIGIN);
        let programs = cell.controller.snapshot(cell.now).programs;
        prop_assert_eq!(again.snapshot(Instant::ORIGIN).programs, programs);
        prop_assert_eq!(again.machine().saved(), saved);
    }

    #[test]
    fn no_text_makes_it_panic(text in "\\PC*") {
        prop_assert!(SavedState::from_json(&text).is_err());
    }
}
