//! Checks `docs/PROFILES.md` against the code.

mod common;

use std::collections::BTreeSet;

use common::Cell;
use r6_controller::{Profile, StartState};

const PAGE: &str = include_str!("../../../docs/PROFILES.md");

/// The rows of the table of settings, without the quotes of their cells.
fn rows() -> Vec<Vec<String>> {
    let table = PAGE.split("## Settings").nth(1).unwrap().split("\n## ").next().unwrap();
    table
        .lines()
        .filter(|line| line.starts_with("| `"))
        .map(|line| line.trim_matches('|').split('|').map(|cell| cell.trim().replace('`', "")).collect())
        .collect()
}

/// The settings that a file may have, from the reader's own error message.
fn settings() -> BTreeSet<String> {
    let error = Profile::from_toml("no_such_setting = 1").unwrap_err().to_string();
    let (_, list) = error.split_once("there are: ").unwrap();
    list.split(", ").map(str::to_owned).collect()
}

#[test]
fn every_setting_has_a_row_and_every_row_is_a_setting() {
    let documented: BTreeSet<String> = rows().into_iter().map(|row| row[0].clone()).collect();
    assert_eq!(documented, settings());
}

#[test]
fn the_documented_values_are_those_of_the_profiles() {
    let listed = ["base", "name", "unsupported_addresses", "unsupported_commands", "unsupported_actions"];
    for row in rows().iter().filter(|row| !listed.contains(&row[0].as_str())) {
        for (name, value) in Profile::names().into_iter().zip(&row[2..6]) {
            let plain = value == "true" || value == "false" || value.chars().all(|c| c.is_ascii_digit());
            let toml_value = if plain { value.clone() } else { format!("\"{value}\"") };
            let file = format!("base = \"{name}\"\n{} = {toml_value}", row[0]);
            let read = Profile::from_toml(&file).unwrap_or_else(|error| panic!("{file}: {error}"));
            assert_eq!(Some(read), Profile::named(name), "{file}");
        }
    }
}

#[test]
fn the_example_of_the_page_works() {
    let example = PAGE.split("```toml").nth(1).unwrap().split("```").next().unwrap();
    let profile = Profile::from_toml(example).unwrap();
    assert_eq!(
        (profile.name.as_str(), profile.max_connections, profile.action_stop_alarm.0),
        ("my-cell", 2, 42)
    );
}

/// The page's other examples: the reports of unit B, and the replies that the manual prints for old firmware.
#[test]
fn the_other_examples_of_the_page_work() {
    let examples: Vec<_> = PAGE
        .split("```toml")
        .skip(2)
        .map(|rest| Profile::from_toml(rest.split("```").next().unwrap()).unwrap())
        .collect();
    let [unit_b, manual] = &examples[..] else { panic!("{} examples", examples.len()) };
    assert_eq!((unit_b.name.as_str(), unit_b.action_stop_alarm.0), ("unit-b", 42));
    let mut cell = Cell::with(manual.clone(), StartState::Waiting);
    for (word, reply) in [("actionStop", r#"["ok"]"#), ("actionStopp", r#"[""]"#)] {
        let asked = format!(r#"{{"dsID":"HCRemoteMonitor","cmdType":"command","cmdData":["{word}"]}}"#);
        let replied = format!(r#"{{"dsID":"HCRemoteMonitor","cmdType":"command","cmdReply":{reply}}}"#);
        assert_eq!(cell.ask(asked), replied);
    }
}

/// Replies say that no real controller sent them only if the profile asks for it.
#[test]
fn replies_say_that_they_are_virtual() {
    for base in Profile::names() {
        let ask = r#"{"reqType":"query","packID":"5","queryAddr":["version"]}"#;
        let marked = Profile::from_toml(&format!("base = \"{base}\"\nsays_virtual = true")).unwrap();
        let plain = Cell::with_profile(base).ask(ask);
        let said = Cell::with(marked, StartState::Waiting).ask(ask);
        assert!(!plain.contains("virtual"), "{plain}");
        assert_eq!(said, plain.replace('}', r#","virtual":true}"#));
    }
}
