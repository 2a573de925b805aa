//! Programs that an operator loads at the machine, and buttons that need the arm at rest.

mod common;

use common::{Cell, axis_move};
use r6_controller::program::{MAX_LOADED_BYTES, MAX_PROGRAMS, MAX_TEXT_BYTES};
use r6_controller::{Button, ControllerSettings, Key, PanelAction, Profile, Refused, RobotModel, SavedState};
use r6_proto::alarm::AlarmCode;
use serde_json::json;

const COUNT: &str = "[[step]]\ndo=\"counter\"\nnumber=0\nby=1\n[[step]]\ndo=\"wait\"\nseconds=1\n";
const COUNT_TENS: &str = "[[step]]\ndo=\"counter\"\nnumber=0\nby=10\n[[step]]\ndo=\"wait\"\nseconds=1\n";
const CALLS_PART: &str = "[[step]]\ndo=\"call\"\nprogram=\"part\"\n[[step]]\ndo=\"wait\"\nseconds=1\n";

fn settings() -> ControllerSettings {
    ControllerSettings::new(Profile::hc1(), RobotModel::named("BRTIRUS0707A").unwrap().clone())
}

fn operate(cell: &mut Cell, action: &PanelAction) -> Result<(), Refused> {
    cell.controller.operate(cell.now, action)
}

fn load(cell: &mut Cell, name: &str, text: &str) -> Result<(), Refused> {
    operate(cell, &PanelAction::LoadProgram { name: name.to_owned(), text: text.to_owned() })
}

fn press(cell: &mut Cell, button: Button) -> Result<(), Refused> {
    operate(cell, &PanelAction::Press(button))
}

fn in_use(cell: &mut Cell) -> String {
    cell.controller.snapshot(cell.now).program
}

fn count(cell: &mut Cell) -> i64 {
    cell.value("counter-0")[2].as_i64().unwrap()
}

#[test]
fn a_program_that_was_loaded_is_listed_chosen_and_run() {
    let mut cell = Cell::new();
    load(&mut cell, "cell", COUNT).unwrap();
    assert!(cell.value("moldList").as_array().unwrap().contains(&json!("cell")));
    assert!(cell.log().contains("program `cell` was loaded: 2 steps"));
    cell.ok(&["switchMold", "cell"]);
    cell.pass(2.5);
    assert_eq!((in_use(&mut cell), count(&mut cell)), ("cell".to_owned(), 3));
    // As JSON it is the same.
    load(
        &mut cell,
        "other",
        r#"{"step": [{"do": "counter", "number": 0, "by": 100}, {"do": "wait", "seconds": 9}]}"#,
    )
    .unwrap();
    operate(&mut cell, &PanelAction::SwitchProgram("other".to_owned())).unwrap();
    assert_eq!(count(&mut cell), 103);
}

#[test]
fn what_is_wrong_is_told_with_the_program_and_the_step() {
    let mut cell = Cell::new();
    let before: Vec<_> = cell.value("moldList").as_array().unwrap().clone();
    let long = "#".repeat(MAX_TEXT_BYTES + 1);
    for (name, text, parts) in [
        (
            "cell",
            "[[step]]\ndo=\"remote\"\n[[step]]\ndo=\"wiat\"\nseconds=1",
            &["`cell`: 4:4: step 2", "\"wait\""][..],
        ),
        ("cell", "[[step]]\ndo=\"wait\"\nseconds=-1", &["`cell`: 3:9: step 1 (wait)", "seconds"]),
        (
            "cell",
            "[[step]]\ndo=\"call\"\nprogram=\"remot\"",
            &["`cell`: it calls `remot`", "`remote`", "first"],
        ),
        ("cell", "{\"step\":", &["`cell`: 1:8: this is no JSON"]),
        ("cell", long.as_str(), &["`cell`", "longer than"]),
        ("", "", &["1 to 64 bytes"]),
        ("a\nb", "", &["control characters"]),
    ] {
        let refused = load(&mut cell, name, text).unwrap_err();
        assert!(matches!(refused, Refused::BadProgram { .. }), "{name:?} {text:.40}: {refused}");
        for part in parts {
            assert!(refused.to_string().contains(part), "{part}: {refused}");
        }
    }
    assert_eq!(*cell.value("moldList").as_array().unwrap(), before, "nothing of it is there");
}

#[test]
fn a_program_that_runs_is_not_replaced_nor_one_that_it_may_call() {
    let mut cell = Cell::new();
    load(&mut cell, "part", COUNT).unwrap();
    load(&mut cell, "middle", CALLS_PART).unwrap();
    load(&mut cell, "whole", "[[step]]\ndo=\"call\"\nprogram=\"middle\"").unwrap();
    cell.ok(&["switchMold", "whole"]);
    for name in ["whole", "middle", "part"] {
        let refused = load(&mut cell, name, COUNT_TENS).unwrap_err();
        assert_eq!(refused, Refused::ProgramRuns { name: name.to_owned() });
        assert!(refused.to_string().contains(name) && refused.to_string().contains("stop it first"));
    }
    load(&mut cell, "other", COUNT_TENS).unwrap();
    cell.pass(0.5);
    assert_eq!(count(&mut cell), 1);
    // A paused program can be replaced. It begins again with the new text and does not continue in the middle
    // of the old one.
    press(&mut cell, Button::Pause).unwrap();
    load(&mut cell, "part", COUNT_TENS).unwrap();
    press(&mut cell, Button::Start).unwrap();
    assert_eq!(count(&mut cell), 11);
    // A program that calls itself, directly or in a circle, is detected too.
    cell.ok(&["switchMold", "remote"]);
    load(&mut cell, "part", "[[step]]\ndo=\"call\"\nprogram=\"whole\"").unwrap();
    load(&mut cell, "own", "[[step]]\ndo=\"call\"\nprogram=\"own\"").unwrap();
    let refused = load(&mut cell, "remote", COUNT).unwrap_err();
    assert!(matches!(refused, Refused::ProgramRuns { .. }), "{refused}");
}

#[test]
fn a_program_of_an_arm_that_still_moves_is_not_replaced() {
    let mut cell = Cell::new();
    cell.run_ok(&json!([axis_move([50.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0)]));
    cell.pass(0.5);
    operate(&mut cell, &PanelAction::TurnKey(Key::Stop)).unwrap();
    assert_eq!(load(&mut cell, "remote", COUNT), Err(Refused::Moving));
    cell.pass(1.0);
    load(&mut cell, "remote", COUNT).unwrap();
}

#[test]
fn there_is_room_for_so_much() {
    let mut cell = Cell::new();
    let shipped = cell.value("moldList").as_array().unwrap().len();
    for n in shipped..MAX_PROGRAMS {
        load(&mut cell, &format!("p{n}"), COUNT).unwrap();
    }
    let refused = load(&mut cell, "one-more", COUNT).unwrap_err();
    assert!(
        matches!(refused, Refused::NoRoom { .. }) && refused.to_string().contains("200 programs"),
        "{refused}"
    );
    load(&mut cell, "p100", COUNT_TENS).unwrap();

    let mut cell = Cell::new();
    let long = "#".repeat(MAX_TEXT_BYTES);
    let fitting = MAX_LOADED_BYTES / MAX_TEXT_BYTES;
    for n in 0..fitting {
        load(&mut cell, &format!("long{n}"), &long).unwrap();
    }
    let refused = load(&mut cell, "one-more", COUNT).unwrap_err();
    assert!(matches!(refused, Refused::NoRoom { .. }) && refused.to_string().contains("bytes"), "{refused}");
    load(&mut cell, "long0", COUNT).unwrap();
    load(&mut cell, "one-more", COUNT).unwrap();
    // Everything that can be loaded can be read again.
    let saved = cell.controller.machine().saved();
    assert_eq!(SavedState::from_json(&saved.to_json()), Ok(saved));
}

#[test]
fn it_survives_a_power_cut() {
    let mut cell = Cell::new();
    let mark = cell.controller.machine().saved_mark();
    load(&mut cell, "part", COUNT).unwrap();
    assert_ne!(cell.controller.machine().saved_mark(), mark);
    load(&mut cell, "cell", CALLS_PART).unwrap();
    // A shipped program can be replaced.
    load(&mut cell, "palletise", COUNT_TENS).unwrap();
    cell.ok(&["switchMold", "cell"]);
    let text = cell.controller.machine().saved().to_json();
    let mut after = Cell::restored(settings(), &SavedState::from_json(&text).unwrap());
    assert_eq!(in_use(&mut after), "cell");
    assert_eq!(after.value("moldList"), cell.value("moldList"));
    let before = count(&mut after);
    after.ok(&["startButton"]);
    assert_eq!(count(&mut after), before + 1);
    after.ok(&["switchMold", "palletise"]);
    assert_eq!(count(&mut after), before + 11);
    assert_eq!(after.controller.machine().saved().to_json().matches("do=").count(), 6);
}

#[test]
fn a_program_that_is_given_at_the_start_counts_and_the_loaded_one_is_kept() {
    let mut cell = Cell::new();
    load(&mut cell, "cell", COUNT).unwrap();
    let saved = cell.controller.machine().saved();
    let given = |text: &str| {
        let mut settings = settings();
        settings.library.load("cell", text).unwrap();
        settings
    };
    let mut other = Cell::restored(given(COUNT_TENS), &saved);
    let _ = other.query(&["curMode"]);
    assert!(other.log().contains("program `cell` was given at the start"));
    other.ok(&["switchMold", "cell"]);
    other.ok(&["startButton"]);
    assert_eq!(count(&mut other), 10);
    // Without it, the loaded program is there again.
    let mut without = Cell::restored(settings(), &other.controller.machine().saved());
    without.ok(&["startButton"]);
    assert_eq!(count(&mut without), 11);
    assert!(!without.log().contains("given at the start"));
    let mut same = Cell::restored(given(COUNT), &saved);
    let _ = same.query(&["curMode"]);
    assert!(!same.log().contains("given at the start"), "nothing to tell");
}

/// At the panel, start and clear need the arm at rest. Over the wire both are accepted at once and begin at
/// rest.
#[test]
fn buttons_wait_for_an_arm_that_slows_down() {
    let moving = || {
        let mut cell = Cell::new();
        cell.run_ok(&json!([axis_move([80.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0)]));
        cell.pass(0.5);
        cell
    };
    let starts = [Button::Start, Button::SingleCycle, Button::SingleStep];
    let mut cell = moving();
    cell.ok(&["actionStop"]);
    for button in starts {
        assert_eq!(press(&mut cell, button), Err(Refused::Moving), "{button:?}");
    }
    assert_eq!((cell.text("curMode"), cell.text("isMoving")), ("2".to_owned(), "1".to_owned()));
    cell.pass(0.2);
    press(&mut cell, Button::Start).unwrap();

    let mut cell = moving();
    operate(&mut cell, &PanelAction::RaiseAlarm(AlarmCode(850))).unwrap();
    assert_eq!(operate(&mut cell, &PanelAction::ClearAlarm), Err(Refused::Moving));
    // The reason that has to be dealt with first comes first.
    assert_eq!(press(&mut cell, Button::Start), Err(Refused::Alarm { alarm: AlarmCode(850) }));
    cell.pass(0.2);
    operate(&mut cell, &PanelAction::ClearAlarm).unwrap();

    // After a pause, start continues, even while the arm still slows down.
    let mut cell = moving();
    press(&mut cell, Button::Pause).unwrap();
    press(&mut cell, Button::Start).unwrap();
    cell.pass(5.0);
    assert_eq!(cell.axes()[0], 80.0);

    let mut cell = moving();
    cell.ok(&["actionStop"]);
    cell.ok(&["clearAlarm"]);
    cell.ok(&["startButton"]);
    assert_eq!(cell.text("curMode"), "7");
}
