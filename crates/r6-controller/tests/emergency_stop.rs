//! The emergency stop: it acts at once, and lasts until someone starts again, in any order of pressing its
//! buttons.

mod common;

use common::{Cell, STOPS_AND_STARTS, axis_move};
use proptest::prelude::*;
use r6_controller::{Button, Key, PanelAction, Profile, Refused, StartState};
use r6_proto::AxisIndex;
use r6_proto::alarm::AlarmCode;
use serde_json::{Value, json};

fn kept(j1: f64, speed: f64) -> Value {
    let mut step = axis_move([j1, 0.0, 0.0, 0.0, 0.0, 0.0], speed);
    step["oneshot"] = json!("0");
    step
}

/// A cell with a list that moves to and fro without end, slowly.
fn running(profile: &str) -> Cell {
    let mut cell = Cell::with_profile(profile);
    cell.add_rcc("1", &json!([kept(100.0, 5.0), kept(0.0, 5.0)]));
    cell.pass(1.0);
    while cell.frame().is_some() {}
    assert_eq!(cell.text("isMoving"), "1");
    cell
}

fn operate(cell: &mut Cell, action: &PanelAction) -> Result<(), Refused> {
    cell.controller.operate(cell.now, action)
}

#[test]
fn it_stops_the_arm_within_the_time_of_action_stop() {
    for profile in Profile::names() {
        let mut cell = running(profile);
        operate(&mut cell, &PanelAction::EmergencyStop).unwrap();
        assert_eq!(cell.text("curAlarm"), "7", "at once");
        assert_eq!(cell.text("curMode"), "2");
        cell.pass(0.078);
        assert_eq!(cell.text("isMoving"), "0", "{profile}");
        assert_eq!(cell.text("origin"), "1", "it is still homed");
        assert_eq!(cell.controller.machine().list().len(), 2, "the list stays");
        if profile == "hc1" {
            let torques: Vec<_> = (0..6).map(|axis| cell.text(&format!("curTorque-{axis}"))).collect();
            assert_eq!(torques, ["0"; 6], "the drives are off");
        }
        assert!(cell.controller.snapshot(cell.now).emergency_stop);
    }
}

#[test]
fn it_does_not_wait_for_a_gentler_stop_that_is_under_way() {
    let mut cell = running("hc1");
    cell.ok(&["actionPause"]);
    cell.pass(0.1);
    operate(&mut cell, &PanelAction::EmergencyStop).unwrap();
    assert_eq!(cell.text("isMoving"), "1");
    cell.pass(0.078);
    assert_eq!(cell.text("isMoving"), "0");
}

#[test]
fn the_mode_after_it_is_that_of_the_profile_and_a_machine_that_did_not_run_keeps_its_own() {
    let unit_b = Profile::from_toml("action_stop_mode = \"stop\"\naction_stop_alarm = 42").unwrap();
    for (start, mode) in [(StartState::Waiting, "3"), (StartState::Manual, "1"), (StartState::Auto, "2")] {
        let mut cell = Cell::with(unit_b.clone(), start);
        operate(&mut cell, &PanelAction::EmergencyStop).unwrap();
        assert_eq!(cell.query(&["curAlarm", "curMode"]), [json!("7"), json!(mode)]);
    }
}

#[test]
fn another_alarm_does_not_hide_it() {
    let mut cell = Cell::new();
    operate(&mut cell, &PanelAction::RaiseAlarm(AlarmCode(850))).unwrap();
    operate(&mut cell, &PanelAction::EmergencyStop).unwrap();
    operate(&mut cell, &PanelAction::RaiseAlarm(AlarmCode(900))).unwrap();
    assert_eq!(cell.text("curAlarm"), "7");
}

#[test]
fn what_was_paused_begins_anew() {
    let mut cell = running("hc1");
    cell.pass(11.0);
    cell.ok(&["actionPause"]);
    cell.pass(1.0);
    assert_eq!(cell.controller.machine().list().position(), 1);
    operate(&mut cell, &PanelAction::EmergencyStop).unwrap();
    operate(&mut cell, &PanelAction::ReleaseEmergencyStop).unwrap();
    // `clearAlarmRunNext` does not skip a step either.
    cell.ok(&["clearAlarmRunNext"]);
    assert_eq!(cell.controller.machine().list().position(), 0);
    let before = cell.number("axis-0");
    cell.pass(0.5);
    assert!(cell.number("axis-0") > before, "its first step goes to 100");
}

#[test]
fn a_program_of_its_own_begins_anew_too() {
    let mut cell = Cell::with(Profile::named("r6-pendant").unwrap(), StartState::Auto);
    cell.ok(&["switchMold", "register-move"]);
    operate(&mut cell, &PanelAction::Press(Button::Start)).unwrap();
    cell.ok(&["rewriteData", "800", "90000", "0"]);
    cell.pass(0.1);
    cell.controller.operate(cell.now, &PanelAction::Press(Button::SingleCycle)).unwrap();
    cell.pass(0.2);
    assert_eq!(cell.text("isMoving"), "1");
    operate(&mut cell, &PanelAction::EmergencyStop).unwrap();
    operate(&mut cell, &PanelAction::ReleaseEmergencyStop).unwrap();
    // While the arm is still coming to rest, a PC may clear and start; the operator may not.
    assert_eq!(operate(&mut cell, &PanelAction::ClearAlarm), Err(Refused::Moving));
    cell.ok(&["clearAlarmContinue"]);
    cell.pass(5.0);
    assert_eq!(cell.query(&["curMode", "isMoving"]), [json!("7"), json!("0")], "it waits for its trigger");
    assert!(cell.number("axis-0") < 80.0);
}

const ORDERS: [PanelAction; 4] = [
    PanelAction::EmergencyStop,
    PanelAction::ReleaseEmergencyStop,
    PanelAction::ClearAlarm,
    PanelAction::Press(Button::Start),
];

/// The expected result of the four buttons.
struct Expected {
    pressed: bool,
    alarm: bool,
    runs: bool,
    /// The arm still slows down: the operator can neither clear nor start.
    slows_down: bool,
}

impl Expected {
    /// Whether the action is carried out.
    fn take(&mut self, action: &PanelAction) -> bool {
        match action {
            PanelAction::EmergencyStop => {
                *self = Self {
                    pressed: true,
                    alarm: true,
                    runs: false,
                    slows_down: self.runs || self.slows_down,
                };
                true
            }
            PanelAction::ReleaseEmergencyStop => {
                self.pressed = false;
                true
            }
            PanelAction::ClearAlarm => {
                let done = !(self.pressed || self.alarm && self.slows_down);
                self.alarm &= !done;
                done
            }
            _ => {
                self.runs |= !self.alarm;
                !self.alarm
            }
        }
    }
}

#[test]
fn every_order_of_its_buttons_ends_where_it_has_to() {
    // All sequences of five presses, each shortly after the other or after the arm has come to rest.
    for sequence in 0..4_usize.pow(5) {
        for pause in [0.0, 0.2] {
            let mut cell = running("hc1");
            let mut expected = Expected { pressed: false, alarm: false, runs: true, slows_down: false };
            for place in 0..5 {
                let action = &ORDERS[sequence / 4_usize.pow(place) % 4];
                let did = operate(&mut cell, action).is_ok();
                assert_eq!(did, expected.take(action), "{sequence} {place} {action:?}");
                cell.pass(pause);
                expected.slows_down &= pause == 0.0;
                let state = cell.query(&["curAlarm", "curMode"]);
                let wanted = [if expected.alarm { "7" } else { "0" }, if expected.runs { "7" } else { "2" }];
                assert_eq!(state, wanted, "{sequence} {place} {action:?}");
                if pause > 0.0 || expected.runs {
                    let moving = if expected.runs { "1" } else { "0" };
                    assert_eq!(cell.text("isMoving"), moving, "{sequence} {place} {action:?}");
                }
                let first = cell.controller.machine().list().position() == 0;
                assert!(first, "{sequence} {place}: the program is in its first step");
            }
        }
    }
}

/// An event at a stopped machine.
#[derive(Clone, Debug)]
enum Event {
    Panel(PanelAction),
    Command(&'static [&'static str]),
    List(bool, f64),
    Pass(f64),
}

/// Commands that could move the arm through a program.
const PROGRAM_COMMANDS: [&[&str]; 7] = [
    &["switchMold", "register-follow"],
    &["switchMold", "register-move"],
    &["switchMold", "remote"],
    &["rewriteDataList", "850", "6", "0", "30000", "0", "0", "0", "0", "0"],
    &["rewriteDataList", "850", "6", "0", "0", "0", "0", "0", "0", "0"],
    &["modifyOutput", "4", "1", "1"],
    &["modifyOutput", "4", "1", "0"],
];

fn panel_action() -> impl Strategy<Value = PanelAction> {
    let key = prop::sample::select(vec![Key::Manual, Key::Auto, Key::Stop]);
    let button = prop::sample::select(vec![
        Button::Start,
        Button::Stop,
        Button::Pause,
        Button::SingleCycle,
        Button::SingleStep,
    ]);
    prop_oneof![
        1 => Just(PanelAction::EmergencyStop),
        2 => Just(PanelAction::ReleaseEmergencyStop),
        2 => Just(PanelAction::ClearAlarm),
        1 => Just(PanelAction::RaiseAlarm(AlarmCode(850))),
        1 => Just(PanelAction::Home),
        3 => button.prop_map(PanelAction::Press),
        3 => key.prop_map(PanelAction::TurnKey),
        1 => (0..32_u8, any::<bool>()).prop_map(|(point, on)| PanelAction::SetInput { board: 0, point, on }),
        1 => (0..6_u8, -50.0..50.0_f64).prop_map(|(axis, by)| {
            PanelAction::Jog { axis: AxisIndex::new(axis).unwrap(), by, percent: 50.0 }
        }),
        1 => prop::sample::select(vec!["remote", "register-move", "register-follow"])
            .prop_map(|name| PanelAction::SwitchProgram(name.to_owned())),
    ]
}

fn event() -> impl Strategy<Value = Event> {
    prop_oneof![
        4 => panel_action().prop_map(Event::Panel),
        3 => prop::sample::select([&STOPS_AND_STARTS[..], &PROGRAM_COMMANDS].concat()).prop_map(Event::Command),
        2 => (any::<bool>(), -90.0..90.0_f64).prop_map(|(replace, j1)| Event::List(replace, j1)),
        3 => (0.0..1.0_f64).prop_map(Event::Pass),
    ]
}

/// Whether this event is an operator or a peer starting the arm.
fn is_start(event: &Event) -> bool {
    match event {
        Event::Panel(
            PanelAction::Press(Button::Start | Button::SingleCycle | Button::SingleStep)
            | PanelAction::Home
            | PanelAction::Jog { .. },
        ) => true,
        Event::Command([word, ..]) => {
            ["startButton", "actionSingleCycle", "clearAlarmRunNext", "clearAlarmContinue"].contains(word)
        }
        Event::Panel(_) | Event::Command(_) | Event::List(..) | Event::Pass(_) => false,
    }
}

fn apply(cell: &mut Cell, event: &Event) {
    match event {
        Event::Panel(action) => drop(operate(cell, action)),
        Event::Command(words) => {
            cell.send(json!({"reqType": "command", "cmdData": words}).to_string());
        }
        Event::List(replace, j1) => {
            cell.add_rcc(if *replace { "1" } else { "0" }, &json!([kept(*j1, 20.0)]));
        }
        Event::Pass(seconds) => cell.pass(*seconds),
    }
    while cell.frame().is_some() {}
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nothing_moves_until_it_is_released_and_cleared_and_somebody_starts(
        before in prop::collection::vec(event(), 0..12),
        after in prop::collection::vec(event(), 1..40),
        profile in 0..5_usize,
    ) {
        // With the last one, AddRCC starts the program.
        let arms = || Profile::from_toml("add_rcc_unarmed = \"arm\"").unwrap();
        let profile = Profile::names().get(profile).map_or_else(arms, |name| Profile::named(name).unwrap());
        let mut cell = Cell::with(profile, StartState::Waiting);
        for event in &before {
            apply(&mut cell, event);
        }
        operate(&mut cell, &PanelAction::EmergencyStop).unwrap();
        cell.pass(0.078);
        let stands = *cell.controller.machine().motion().axes.degrees();
        for event in &after {
            let state = cell.controller.snapshot(cell.now);
            let clears = matches!(event, Event::Command(["clearAlarmRunNext" | "clearAlarmContinue"]));
            apply(&mut cell, event);
            if is_start(event) && !state.emergency_stop && (state.alarm == 0 || clears) {
                // From here on it may move: the test has shown what it has to.
                return Ok(());
            }
            prop_assert!(!cell.controller.machine().is_moving(), "after {event:?}");
            prop_assert_eq!(*cell.controller.machine().motion().axes.degrees(), stands, "after {:?}", event);
            let state = cell.controller.snapshot(cell.now);
            prop_assert!(!state.emergency_stop || state.alarm == 7, "{:?}", event);
            prop_assert!(!state.mode.may_run(), "{:?}", event);
        }
    }
}
