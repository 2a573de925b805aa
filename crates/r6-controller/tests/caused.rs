//! Every address of the manual reports, and every command changes, something that a program or an operator
//! caused.
//!
//! There is one case for each address and each command of the code's tables. It runs on every profile that
//! has it; on the others the test shows that they lack it. Values that nothing causes are listed by name:
//! [`cabinet::BY_NOBODY`].

#[path = "caused/arm.rs"]
mod arm;
#[path = "caused/cabinet.rs"]
mod cabinet;
mod common;
#[path = "caused/running.rs"]
mod running;
#[path = "caused/values.rs"]
mod values;

use common::Cell;
use r6_controller::{Button, ControllerSettings, PanelAction, Profile, RobotModel, StartState};
use r6_proto::address::{ADDRESSES, Address};
use r6_proto::message::CommandName;
use r6_proto::message::command::COMMANDS;
use serde_json::Value;

/// Tool 0 looks down.
const TOOL_DOWN: [f64; 6] = [0.0, 10.0, -20.0, 0.0, -80.0, 0.0];

/// The action of a case, on a profile that has its address or command.
type Case = (&'static str, fn(&Profile));

/// Defines the cases of a table and a test for each of them.
macro_rules! cases {
    ($table:ident: $on_each:path; $($name:ident $word:literal => $case:expr;)+) => {
        pub const $table: &[crate::Case] = &[$(($word, $case)),+];
        $(#[test] fn $name() { $on_each($word, $case); })+
    };
}
pub(crate) use cases;

fn sorted(names: impl IntoIterator<Item = &'static str>) -> Vec<&'static str> {
    let mut names: Vec<_> = names.into_iter().collect();
    names.sort_unstable();
    names
}

fn of_both(one: &'static [Case], other: &'static [Case]) -> Vec<&'static str> {
    sorted(one.iter().chain(other).map(|(name, _)| *name))
}

#[test]
fn every_address_of_the_table_has_its_case() {
    let names = sorted(ADDRESSES.iter().map(|row| row.name));
    assert_eq!(of_both(arm::CASES, cabinet::CASES), names);
    assert!(cabinet::BY_NOBODY.iter().all(|(name, _)| names.contains(name)));
}

#[test]
fn every_command_of_the_table_has_its_case() {
    assert_eq!(of_both(running::CASES, values::CASES), sorted(COMMANDS.iter().map(|row| row.word)));
}

/// Runs the case of an address on every profile that has it; the others leave its value out.
fn address_on_each(name: &str, case: fn(&Profile)) {
    let mut ran = 0;
    for profile in profiles() {
        let address = name.replace("-n", if name == "Addr-n" { "-800" } else { "-0" });
        let answers = profile.answers(Address::parse(&address).unwrap());
        let values = Cell::with(profile.clone(), StartState::Auto).query(&[&address]);
        assert_eq!(values.len(), usize::from(answers), "{name} on {}", profile.name);
        if answers {
            case(&profile);
            ran += 1;
        }
    }
    assert!(ran > 0, "{name}: no profile has it");
}

/// Runs the case of a command on every profile that has it; the others refuse it.
fn command_on_each(word: &str, case: fn(&Profile)) {
    let name = CommandName::exact(word.as_bytes()).unwrap();
    let mut ran = 0;
    for profile in profiles() {
        if profile.has_command(name) {
            case(&profile);
            ran += 1;
        } else {
            // The right number of arguments, so that only the word can be refused.
            let words: Vec<_> = [word].into_iter().chain(name.info().arguments.iter().map(|_| "1")).collect();
            let reply = Cell::with(profile.clone(), StartState::Waiting).command(&words);
            // Old firmware refuses with an empty text.
            assert_ne!(reply.last().map(String::as_str), Some("ok"), "{}: {reply:?}", profile.name);
        }
    }
    assert!(ran > 0, "{word}: no profile has it");
}

fn profiles() -> impl Iterator<Item = Profile> {
    Profile::names().into_iter().map(|name| Profile::named(name).unwrap())
}

fn arm() -> RobotModel {
    RobotModel::named("BRTIRUS0707A").unwrap().clone()
}

fn settings(profile: &Profile) -> ControllerSettings {
    ControllerSettings { start: StartState::Auto, ..ControllerSettings::new(profile.clone(), arm()) }
}

/// A controller in automatic with this program in use, not running yet.
fn taught(profile: &Profile, program: &str) -> Cell {
    with_programs(profile, &[("taught", program)])
}

/// The same with several programs; the first is in use.
fn with_programs(profile: &Profile, programs: &[(&str, &str)]) -> Cell {
    let mut settings = settings(profile);
    for (name, text) in programs {
        settings.library.load(name, text).unwrap_or_else(|error| panic!("{name}: {error}"));
    }
    programs[0].0.clone_into(&mut settings.mold);
    Cell::of(settings)
}

/// Does this as the operator.
#[track_caller]
fn person(cell: &mut Cell, action: &PanelAction) {
    assert_eq!(cell.controller.operate(cell.now, action), Ok(()), "{action:?}");
}

#[track_caller]
fn press(cell: &mut Cell, button: Button) {
    person(cell, &PanelAction::Press(button));
}

/// Presses start, and the taught program runs.
#[track_caller]
fn start(cell: &mut Cell) {
    press(cell, Button::Start);
}

/// Sends a command from the PC. The answer has to be ok, in any form.
#[track_caller]
fn told(cell: &mut Cell, words: &[&str]) {
    let reply = cell.command(words);
    assert_eq!(reply.last().map(String::as_str), Some("ok"), "{words:?}: {reply:?}");
}

/// The value of an address: a text as it is, anything else as JSON.
fn value(cell: &mut Cell, address: &str) -> String {
    match cell.value(address) {
        Value::String(text) => text,
        value => value.to_string(),
    }
}

/// Checks that the cause changes the value of the address from `before` to `after`.
#[track_caller]
fn changes(cell: &mut Cell, address: &str, before: &str, cause: impl FnOnce(&mut Cell), after: &str) {
    assert_eq!(value(cell, address), before, "{address} before");
    cause(cell);
    assert_eq!(value(cell, address), after, "{address} after");
}

/// The count of a counter; on old firmware the counter is one text.
fn count(cell: &mut Cell, id: u32) -> i64 {
    let value = cell.value(&format!("counter-{id}"));
    let text = match &value {
        Value::Array(counter) => counter[2].to_string(),
        value => value.as_str().unwrap().split_once("[C:").unwrap().1.to_owned(),
    };
    text.trim_matches(['"', ']']).parse().unwrap_or_else(|_| panic!("{value}"))
}

/// Texts of program steps.
mod step {
    /// An axis move of J1.
    pub fn turn(j1: f64, speed: f64) -> String {
        axes(&[j1], speed)
    }

    /// An axis move.
    pub fn axes(to: &[f64], speed: f64) -> String {
        format!("[[step]]\ndo = \"axis-move\"\nto = {to:?}\nspeed = {speed}\n")
    }

    pub fn wait(seconds: f64) -> String {
        format!("[[step]]\ndo = \"wait\"\nseconds = {seconds}\n")
    }

    pub fn wait_for(point: &str) -> String {
        format!("[[step]]\ndo = \"wait\"\npoint = \"{point}\"\n")
    }

    pub fn output(point: &str) -> String {
        format!("[[step]]\ndo = \"output\"\npoint = \"{point}\"\non = true\n")
    }

    pub fn count(id: u32) -> String {
        format!("[[step]]\ndo = \"counter\"\nnumber = {id}\nby = 1\n")
    }

    pub fn alarm(number: u32) -> String {
        format!("[[step]]\ndo = \"alarm\"\nnumber = {number}\n")
    }

    pub fn numbered(what: &str, number: u32) -> String {
        format!("[[step]]\ndo = \"{what}\"\nnumber = {number}\n")
    }

    /// The program waits here without end (or for instructions of AddRCC).
    pub const REMOTE: &str = "[[step]]\ndo = \"remote\"\n";
}
