//! Reads a scenario from a text, and the errors for a wrong text.

use std::collections::BTreeSet;
use std::time::Duration;

use proptest::prelude::*;
use r6_controller::fault::file::{FAULTS, kinds, numbers};
use r6_controller::scenario::{HAPPENINGS, MAX_ENTRIES, MAX_TEXT_BYTES, Scenario};

use crate::read;

fn wrong(text: &str) -> String {
    Scenario::read(text).expect_err(text).to_string()
}

/// The required fields of a happening.
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
        let line = text.matches('\n').count() + 2;
        assert_eq!(error, format!("{line}:1: [[at]] 1 ({word}): there is no key `timme`; nearest: `time`"));
    }
}

#[test]
fn every_fault_is_read_and_says_its_word() {
    for (word, _) in FAULTS {
        let kind = kinds(word).last().map(|kind| format!("kind = \"{kind}\"")).unwrap_or_default();
        let scenario = read(&format!("[[fault]]\nfault = \"{word}\"\n{kind}"));
        assert_eq!(scenario.faults[0].fault.word(), word);
        let shown = scenario.faults[0].fault.to_string();
        assert_eq!(shown.contains('('), !kind.is_empty(), "{shown}");
        assert!(shown.starts_with(word));
    }
}

#[test]
fn a_fault_has_the_kinds_and_the_numbers_that_are_told_of_it() {
    let names: BTreeSet<_> = FAULTS.iter().flat_map(|(word, _)| numbers(word)).collect();
    assert!(names.contains(&"bytes_per_second"), "{names:?}");
    for (word, _) in FAULTS {
        let first = kinds(word).first().map(|kind| format!("kind = \"{kind}\"\n")).unwrap_or_default();
        for kind in kinds(word) {
            let text = format!("[[fault]]\nfault = \"{word}\"\nkind = \"{kind}\"");
            assert_eq!(read(&text).faults[0].fault.kind(), Some(kind));
        }
        for name in &names {
            let text = format!("[[fault]]\nfault = \"{word}\"\n{first}{name} = 2");
            assert_eq!(Scenario::read(&text).is_ok(), numbers(word).contains(name), "{word} {name}");
        }
        let missing = Scenario::read(&format!("[[fault]]\nfault = \"{word}\"")).is_err();
        assert_eq!(missing, !kinds(word).is_empty(), "{word}");
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
            "3:6: [[at]] 1 (inputt): `do` is \"inputt\", which means nothing here; nearest: \"input\"",
        ),
        (
            "[[fault]]\nfault = \"bad-jason\"",
            "2:9: [[fault]] 1 (bad-jason): `fault` is \"bad-jason\", which means nothing here; nearest: \"bad-json\"",
        ),
        (
            "[[fault]]\nfault = \"bad-json\"",
            "1:1: [[fault]] 1 (bad-json): `kind` is missing: one of \"truncated\", \"oversized\"",
        ),
        (
            "[[fault]]\nfault = \"bad-json\"\nkind = \"truncate\"",
            "3:8: [[fault]] 1 (bad-json): `kind` is \"truncate\", but",
        ),
        ("[[at]]\ntime = 1", "1:1: [[at]] 1: `do` is missing: what happens"),
        ("[[at]]\ndo = \"photo\"", "1:1: [[at]] 1 (photo): `time` is missing: seconds, 0 to 31536000"),
        (
            "[[at]]\ntime = \"1\"\ndo = \"photo\"",
            "2:8: [[at]] 1 (photo): `time` is the text \"1\", but has to be seconds, 0 to 31536000",
        ),
        (
            "[[at]]\ntime = -1\ndo = \"photo\"",
            "2:8: [[at]] 1 (photo): `time` is -1, but has to be seconds, 0 to 31536000",
        ),
        (
            "[[at]]\ntime = nan\ndo = \"photo\"",
            "2:8: [[at]] 1 (photo): `time` is nan, but has to be seconds, 0 to 31536000",
        ),
        (
            "[[at]]\ntime = 1\ntimes = 3\ndo = \"photo\"",
            "3:9: [[at]] 1 (photo): `every` is missing: how long until it happens again, seconds",
        ),
        (
            "[[at]]\ntime = 1\nevery = 0\ndo = \"photo\"",
            "3:9: [[at]] 1 (photo): `every` is 0, but has to be seconds, 0.001 to 31536000",
        ),
        (
            "[[at]]\ntime = 1\ndo = \"photo\"\n[[at]]\ntime = 1\ndo = \"input\"\npoint = \"Y010\"\non = true",
            "7:9: [[at]] 2 (input): `point` is the text \"Y010\", but has to be an input X010 or EUX010, as the pendant",
        ),
        (
            "[[at]]\ntime = 1\ndo = \"input\"\npoint = \"X010\"",
            "1:1: [[at]] 1 (input): `on` is missing: true or false",
        ),
        (
            "[[at]]\ntime = 1\ndo = \"alarm\"\nnumber = 0",
            "4:10: [[at]] 1 (alarm): `number` is 0, but has to be an alarm, 1 to 10000",
        ),
        (
            "[[at]]\ntime = 1\ndo = \"command\"\nwords = [1]",
            "4:9: [[at]] 1 (command): `words` is a list, but has to be a list of texts: the command and its arguments",
        ),
        (
            "[[at]]\ntime = 1\ndo = \"bounce\"\npoint = \"X010\"\non = true\nchanges = 1001",
            "6:11: [[at]] 1 (bounce): `changes` is 1001, but has to be how often, 1 to 1000",
        ),
        (
            "[[fault]]\nfault = \"refuse\"\nfor = 1\ntimes = 2",
            "4:9: [[fault]] 1 (refuse): `every` is missing: how long until it begins again, seconds",
        ),
        (
            "[[fault]]\nfault = \"refuse\"\nfor = 1\nevery = 2",
            "4:9: [[fault]] 1 (refuse): `times` is missing: how often the fault begins, 1 to 1000",
        ),
        (
            "[[fault]]\nfault = \"refuse\"\nfor = 2\nevery = 2\ntimes = 2",
            "4:9: [[fault]] 1 (refuse): the fault has to end before it begins again: `for` is less than `every`",
        ),
        (
            "[[fault]]\nfault = \"refuse\"\nfor = 1\nevery = 2\ntimes = 1000\n[[fault]]\nfault = \"echo\"",
            "the faults of [[fault]] begin 1001 times; 1000 are possible",
        ),
        ("[[react]]\nthen = \"X010\"", "1:1: [[react]] 1: `when` is missing: an output Y010, M010 or EUY010"),
        (
            "[[react]]\nwhen = \"Y010\"\nthen = \"X010\"\nis = \"open\"",
            "4:6: [[react]] 1 (Y010): `is` is \"open\", but has to be one of \"on\", \"off\"",
        ),
        (
            "[[fault]]\nfault = \"noise\"\nchance = 2",
            "3:10: [[fault]] 1 (noise): `chance` is 2, but has to be a part, 0 to 1",
        ),
        ("[[faults]]\nfault = \"noise\"", "1:3: there is no key `faults`; nearest: `fault`"),
        ("at = 3", "1:6: `at` is written as [[at]], in two pairs of brackets"),
        ("seed = -1", "1:8: `seed` is -1, but has to be a whole number from 0 to"),
        ("seed = 1\n\n[[at]\n", "3:"),
        ("seed = 1\nseed = 2\n", "2:"),
        ("seed = 1\n= 2\n", "2:"),
        ("{\"at\": [}", "1:9: this is no JSON: "),
    ] {
        let found = wrong(text);
        assert!(
            found.starts_with(error) && found.lines().count() == 1,
            "{text}\n  is {found}\n  not {error}"
        );
    }
}

/// Five mistakes; the reader reports no others that only follow from them.
#[test]
fn all_mistakes_are_told_in_toml_and_in_json() {
    let toml = "[[at]]\ntime = 1\ndo = \"alarm\"\nnumber = 0\n[[at]]\ntime = -1\ndo = \"fhoto\"\n\
                [[react]]\nwhen = \"X010\"\nthen = \"Y010\"\n";
    let json = r#"{"at": [{"time": 1, "do": "alarm", "number": 0},
        {"time": -1, "do": "fhoto"}],
        "react": [{"when": "X010", "then": "Y010"}]}"#;
    let places = |text: &str| {
        let mistakes = Scenario::read(text).unwrap_err();
        mistakes.iter().map(|mistake| mistake.at.unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(places(toml), [(4, 10), (6, 8), (7, 6), (9, 8), (10, 8)]);
    assert_eq!(places(json), [(1, 46), (2, 18), (2, 28), (3, 28), (3, 44)]);
}

#[test]
fn a_program_in_it_is_checked_at_once() {
    let error =
        wrong("[[at]]\ntime = 1\ndo = \"program\"\nname = \"own\"\ntext = \"[[step]]\\ndo = 'axis-mov'\"");
    assert!(
        error.starts_with("5:8: [[at]] 1 (program): program `own`: 2:6: step 1: ")
            && error.contains("axis-move"),
        "{error}"
    );
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
            prop_assert!(error.iter().all(|mistake| !mistake.what.is_empty() && mistake.what.len() < 600), "{}", error);
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
