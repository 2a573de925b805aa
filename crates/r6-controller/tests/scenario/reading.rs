//! From a text to a scenario, and what is said of a text that is none.

use std::time::Duration;

use proptest::prelude::*;
use r6_controller::fault::file::FAULTS;
use r6_controller::scenario::{HAPPENINGS, MAX_ENTRIES, MAX_TEXT_BYTES, Scenario};

use crate::read;

fn wrong(text: &str) -> String {
    Scenario::read(text).expect_err(text).to_string()
}

/// The fields that a happening cannot do without.
fn fields_of(happening: &str) -> &'static str {
    match happening {
        "input" | "bounce" => "point = \"X010\"\non = true",
        "output" => "point = \"Y010\"\non = false",
        "button" => "button = \"start\"",
        "key" => "to = \"auto\"",
        "alarm" => "number = 5000",
        "program" => "name = \"remote\"",
        "counter" => "number = 1\ncurrent = 2",
        "command" => "words = [\"startButton\"]",
        "request" => "frame = '{}'",
        "emergency-stop" | "release-emergency-stop" | "clear-alarm" | "photo" | "power-cut" => "",
        other => panic!("{other} is new"),
    }
}

#[test]
fn every_happening_is_read_and_named() {
    for word in HAPPENINGS {
        let text = format!("[[at]]\ntime = 1\ndo = \"{word}\"\n{}", fields_of(word));
        assert_eq!(read(&text).timeline.len(), 1);
        let error = wrong(&format!("{text}\ntimme = 3"));
        assert_eq!(error, format!("[[at]] 1 ({word}): `timme` means nothing here; nearest: `time`"));
    }
}

#[test]
fn every_fault_is_read_and_says_its_word() {
    for (word, _) in FAULTS {
        let kind = match word {
            "bad-json" => "kind = \"nul\"",
            "bad-field" => "kind = \"missing\"",
            "bad-pack-id" => "kind = \"wrong\"",
            "bad-list" => "kind = \"short\"",
            "stop-ignored" => "kind = \"every\"",
            _ => "",
        };
        let scenario = read(&format!("[[fault]]\nfault = \"{word}\"\n{kind}"));
        assert_eq!(scenario.faults[0].fault.word(), word);
        let shown = scenario.faults[0].fault.to_string();
        assert_eq!(shown.contains('('), !kind.is_empty(), "{shown}");
        assert!(shown.starts_with(word));
    }
}

#[test]
fn the_same_in_json() {
    let toml = "seed = 3\n[[at]]\ntime = 1.5\ndo = \"input\"\npoint = \"X1.010\"\non = true\n[[react]]\nwhen = \"Y010\"\nthen = \"EUX010\"\n[[fault]]\nfault = \"slow\"\nfrom = 2\nfor = 1";
    let json = r#"{"seed": 3, "at": [{"time": 1.5, "do": "input", "point": "X1.010", "on": true}],
        "react": [{"when": "Y010", "then": "EUX010"}], "fault": [{"fault": "slow", "from": 2, "for": 1}]}"#;
    assert_eq!(read(toml), read(json));
    assert_eq!(read(""), Scenario::default());
    assert_eq!(read(toml).faults[0].from, Duration::from_secs(2));
}

#[test]
fn what_is_wrong_is_named_with_its_place() {
    for (text, error) in [
        (
            "[[at]]\ntime = 1\ndo = \"inputt\"",
            "[[at]] 1 (inputt): `do = \"inputt\"` is not known; nearest: `input`",
        ),
        (
            "[[fault]]\nfault = \"bad-jason\"",
            "[[fault]] 1 (bad-jason): `fault = \"bad-jason\"` is not known; nearest: `bad-json`",
        ),
        (
            "[[fault]]\nfault = \"bad-json\"",
            "[[fault]] 1 (bad-json): `kind` is missing: truncated, oversized, deep, duplicate-keys, byte-order-mark, bad-utf8, nul, huge-number, not-a-number",
        ),
        (
            "[[fault]]\nfault = \"bad-json\"\nkind = \"truncate\"",
            "[[fault]] 1 (bad-json): `kind = \"truncate\"` is not known; nearest: `truncated`",
        ),
        ("[[at]]\ntime = 1", "[[at]] 1: `do` is missing: what happens"),
        ("[[at]]\ndo = \"photo\"", "[[at]] 1 (photo): `time` is missing: seconds, 0 to 31536000"),
        (
            "[[at]]\ntime = \"1\"\ndo = \"photo\"",
            "[[at]] 1 (photo): `time` has to be seconds, 0 to 31536000, not \"1\"",
        ),
        (
            "[[at]]\ntime = -1\ndo = \"photo\"",
            "[[at]] 1 (photo): `time` has to be seconds, 0 to 31536000, not -1",
        ),
        (
            "[[at]]\ntime = nan\ndo = \"photo\"",
            "[[at]] 1 (photo): `time` has to be seconds, 0 to 31536000, not nan",
        ),
        (
            "[[at]]\ntime = 1\ntimes = 3\ndo = \"photo\"",
            "[[at]] 1 (photo): `every` is missing: how long until it happens again, seconds",
        ),
        (
            "[[at]]\ntime = 1\nevery = 0\ndo = \"photo\"",
            "[[at]] 1 (photo): `every` has to be seconds, 0.001 to 31536000, not 0",
        ),
        (
            "[[at]]\ntime = 1\ndo = \"photo\"\n[[at]]\ntime = 1\ndo = \"input\"\npoint = \"Y010\"\non = true",
            "[[at]] 2 (input): `point` has to be a point as the pendant names it, X or EUX and octal 010 to 047, not \"Y010\"",
        ),
        (
            "[[at]]\ntime = 1\ndo = \"input\"\npoint = \"X010\"",
            "[[at]] 1 (input): `on` is missing: true or false",
        ),
        (
            "[[at]]\ntime = 1\ndo = \"alarm\"\nnumber = 0",
            "[[at]] 1 (alarm): `number` has to be an alarm, 1 to 10000, not 0",
        ),
        (
            "[[at]]\ntime = 1\ndo = \"command\"\nwords = [1]",
            "[[at]] 1 (command): `words` has to be a list of texts: the command and its arguments, not [1]",
        ),
        (
            "[[at]]\ntime = 1\ndo = \"bounce\"\npoint = \"X010\"\non = true\nchanges = 1001",
            "[[at]] 1 (bounce): `changes` has to be how often, 1 to 1000, not 1001",
        ),
        (
            "[[react]]\nthen = \"X010\"",
            "[[react]] 1: `when` is missing: an output such as Y010, M010 or EUY010",
        ),
        (
            "[[react]]\nwhen = \"Y010\"\nthen = \"X010\"\nis = \"open\"",
            "[[react]] 1 (Y010): `is = \"open\"` is not known; there are: on, off",
        ),
        (
            "[[fault]]\nfault = \"noise\"\nchance = 2",
            "[[fault]] 1 (noise): `chance` has to be a part, 0 to 1, not 2",
        ),
        ("[[faults]]\nfault = \"noise\"", "`faults` means nothing here; nearest: `fault`"),
        ("at = 3", "`at` has to be a list of [[at]] tables, not 3"),
        ("seed = -1", "`seed` has to be a whole number from 0, not -1"),
        ("seed = 1\n\n[[at]\n", "no TOML: line 3: "),
        ("seed = 1\nseed = 2\n", "no TOML: line 2: "),
        ("seed = 1\n= 2\n", "no TOML: line 2: "),
        ("{\"at\": [}", "no JSON: "),
    ] {
        let found = wrong(text);
        let fits = if error.ends_with(": ") { found.starts_with(error) } else { found == error };
        assert!(fits, "{text}\n  is {found}\n  not {error}");
    }
}

#[test]
fn a_program_in_it_is_checked_at_once() {
    let error =
        wrong("[[at]]\ntime = 1\ndo = \"program\"\nname = \"own\"\ntext = \"[[step]]\\ndo = 'axis-mov'\"");
    assert!(error.starts_with("[[at]] 1 (program): ") && error.contains("axis-move"), "{error}");
}

#[test]
fn what_is_too_long_is_said_to_be() {
    let many = "[[at]]\ntime = 1\ndo = \"photo\"\n".repeat(MAX_ENTRIES);
    assert_eq!(read(&many).timeline.len(), MAX_ENTRIES);
    let one_more = format!("{many}[[at]]\ntime = 1\ndo = \"photo\"\n");
    assert_eq!(wrong(&one_more), format!("there are 1001 entries in [[at]]; {MAX_ENTRIES} are possible"));
    let long = "#".repeat(MAX_TEXT_BYTES);
    assert_eq!(read(&long), Scenario::default());
    assert_eq!(wrong(&(long + "#")), format!("its text is longer than {MAX_TEXT_BYTES} bytes"));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_text_panics(text in any::<String>()) {
        let _ = Scenario::read(&text);
    }

    #[test]
    fn no_text_that_is_nearly_right_panics(
        words in prop::collection::vec(prop::sample::select(vec!["[[at]]\n", "[[react]]\n", "[[fault]]\n", "do = ", "fault = ", "kind = ", "time = ", "every = ", "from = ", "for = ", "when = ", "then = ",
            "point = ", "chance = ", "\"X010\"\n", "\"Y010\"\n", "\"noise\"\n", "\"bounce\"\n", "1\n", "-1\n", "1e400\n", "nan\n", "true\n", "[]\n", "{}\n", "9223372036854775807\n", "\"\n", "'''"]), 0..24)
    ) {
        if let Err(error) = Scenario::read(&words.concat()) {
            prop_assert!(!error.to_string().is_empty() && error.to_string().len() < 600, "{}", error);
        }
    }

    #[test]
    fn whatever_is_read_runs(seed in any::<u64>(), at in 0.0..100.0_f64, every in 0.001..10.0_f64, spread in 0.0..10.0_f64, pick in prop::sample::select(HAPPENINGS.to_vec())) {
        let text = format!("[[at]]\ntime = {at:?}\nevery = {every:?}\nspread = {spread:?}\ntimes = 200\ndo = \"{pick}\"\n{}\n[[react]]\nwhen = \"Y010\"\nthen = \"X010\"\nspread = {spread:?}", fields_of(pick));
        let mut cell = crate::seeded(&text, seed);
        cell.pass(200.0);
        prop_assert!(cell.controller.snapshot(cell.now).connections <= 1);
    }
}

#[test]
fn a_timeline_is_no_faster_than_a_cell() {
    let entry = "[[at]]\ntime = 0\nevery = 0.001\ndo = \"clear-alarm\"\n";
    assert!(Scenario::read(entry).is_ok());
    let error = Scenario::read(&entry.repeat(2)).unwrap_err().to_string();
    assert_eq!(error, "the entries of [[at]] happen 2000 times a second in all; 1000 are possible");
}
