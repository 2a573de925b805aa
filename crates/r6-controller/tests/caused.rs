//! Every address of the manual reports, and every command changes, something that a program or a person caused.
//!
//! One case for each address and each command of the code's tables; each runs on every profile that has it, and on the
//! others it is shown that they have not. What nobody causes is listed by name: [`addresses::BY_NOBODY`].

#[path = "caused/addresses.rs"]
mod addresses;
#[path = "caused/commands.rs"]
mod commands;
mod common;

use common::Cell;
use r6_controller::{Button, ControllerSettings, PanelAction, Profile, RobotModel, StartState};
use r6_proto::address::ADDRESSES;
use r6_proto::message::command::COMMANDS;
use serde_json::Value;

/// What a case does, on a profile that has its address or command.
type Case = (&'static str, fn(&Profile));

/// Defines the cases of a table and a test for each of them.
macro_rules! cases {
    ($table:ident: $on_each:path; $($name:ident $word:literal => $case:expr;)+) => {
        pub const $table: &[crate::Case] = &[$(($word, $case)),+];
        $(#[test] fn $name() { $on_each($word, $case); })+
    };
}
pub(crate) use cases;

fn names(cases: &[Case]) -> Vec<&'static str> {
    let mut names: Vec<_> = cases.iter().map(|(name, _)| *name).collect();
    names.sort_unstable();
    names
}

fn sorted(names: impl IntoIterator<Item = &'static str>) -> Vec<&'static str> {
    let mut names: Vec<_> = names.into_iter().collect();
    names.sort_unstable();
    names
}

#[test]
fn every_address_of_the_table_has_its_case() {
    assert_eq!(names(addresses::CASES), sorted(ADDRESSES.iter().map(|row| row.name)));
    let nobody = sorted(addresses::BY_NOBODY.iter().map(|(name, _)| *name));
    assert!(nobody.iter().all(|name| ADDRESSES.iter().any(|row| row.name == *name)), "{nobody:?}");
}

#[test]
fn every_command_of_the_table_has_its_case() {
    assert_eq!(names(commands::CASES), sorted(COMMANDS.iter().map(|row| row.word)));
}

fn profiles() -> impl Iterator<Item = Profile> {
    Profile::names().into_iter().map(|name| Profile::named(name).unwrap())
}

fn arm() -> RobotModel {
    RobotModel::named("BRTIRUS0707A").unwrap().clone()
}

/// A controller in automatic on which this program is in use, and does not run yet.
fn taught(profile: &Profile, program: &str) -> Cell {
    with_programs(profile, &[("taught", program)])
}

/// The same with several programs, the first of them in use.
fn with_programs(profile: &Profile, programs: &[(&str, &str)]) -> Cell {
    let mut settings =
        ControllerSettings { start: StartState::Auto, ..ControllerSettings::new(profile.clone(), arm()) };
    for (name, text) in programs {
        settings.library.load(name, text).unwrap_or_else(|error| panic!("{name}: {error}"));
    }
    programs[0].0.clone_into(&mut settings.mold);
    Cell::of(settings)
}

/// A person does this at the machine.
#[track_caller]
fn person(cell: &mut Cell, action: &PanelAction) {
    assert_eq!(cell.controller.operate(cell.now, action), Ok(()), "{action:?}");
}

#[track_caller]
fn press(cell: &mut Cell, button: Button) {
    person(cell, &PanelAction::Press(button));
}

/// A person presses start, and the taught program runs.
#[track_caller]
fn start(cell: &mut Cell) {
    press(cell, Button::Start);
}

/// The PC sends a command, which is answered ok in whatever form.
#[track_caller]
fn told(cell: &mut Cell, words: &[&str]) {
    let reply = cell.command(words);
    assert_eq!(reply.last().map(String::as_str), Some("ok"), "{words:?}: {reply:?}");
}

/// The value of an address, as the text it is or as JSON.
fn value(cell: &mut Cell, address: &str) -> String {
    match cell.value(address) {
        Value::String(text) => text,
        value => value.to_string(),
    }
}

/// The address has a value, something happens, and it has the other.
#[track_caller]
fn changes(cell: &mut Cell, address: &str, before: &str, cause: impl FnOnce(&mut Cell), after: &str) {
    assert_eq!(value(cell, address), before, "{address} before");
    cause(cell);
    assert_eq!(value(cell, address), after, "{address} after");
}

/// How far a counter has counted; on old firmware it is one text.
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

    /// The program waits here for ever (or for what AddRCC sends).
    pub const REMOTE: &str = "[[step]]\ndo = \"remote\"\n";
}
