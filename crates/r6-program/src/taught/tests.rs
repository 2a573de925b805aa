use proptest::prelude::*;
use r6_proto::message::instruction::{WaitCondition, WaitSource};

use super::*;

const PALLETISE: &str = include_str!("../../../r6-controller/programs/palletise.toml");

fn read(text: &str) -> Result<Program, String> {
    Program::read("p", text).map_err(|error| error.to_string())
}

fn step(text: &str) -> Result<Step, String> {
    let text = format!("[[step]]\n{text}\n[[step]]\ndo = \"label\"\nname = \"here\"\n");
    read(&text).map(|program| program.steps()[0].clone())
}

#[test]
fn json_says_the_same() {
    let toml = read("[[step]]\ndo = \"wait\"\nseconds = 2\n[[step]]\ndo = \"remote\"").unwrap();
    let json = read(r#" {"step": [{"do": "wait", "seconds": 2}, {"do": "remote"}]}"#).unwrap();
    assert_eq!(toml.steps(), json.steps());
    assert_eq!(toml.steps().len(), 2);
}

#[test]
fn steps_are_what_they_say() {
    let register = RegisterIndex::new(850).unwrap();
    let found = step("do=\"wait\"\npoint=\"M1.011\"\nuntil=\"falling\"\nlimit=3\nelse=\"here\"").unwrap();
    let Step::Wait { wait, or_else: Some(1), .. } = found else { panic!("{found:?}") };
    assert_eq!(wait.source, WaitSource::M { board: 1, point: 1 });
    assert_eq!((wait.condition, wait.limit, wait.unlimited), (WaitCondition::FallingEdge, 3.0, false));
    assert_eq!(step("do=\"jump\"\nto=\"here\""), Ok(Step::Jump(1)));
    assert_eq!(
        step("do=\"if\"\nregister=850\nat_least=7\nto=\"here\""),
        Ok(Step::If { condition: Condition::Register(register, Compare::AtLeast(7)), to: 1 })
    );
    assert_eq!(step("do=\"counter\"\nnumber=2\nby=-1"), Ok(Step::Counter { id: 2, change: Change::By(-1) }));
    assert_eq!(
        step("do=\"output\"\npoint=\"Y1.010\"\non=true"),
        Ok(Step::Set { point: "Y1.010".parse().unwrap(), on: true })
    );
    let Ok(Step::Instruction(Action::BoardOutput(board))) = step(
        "do=\"board-output\"\nset=[\"Y010\",\"Y012\",\"Y020\",\"Y025\",\"Y030\",\"Y040\"]\nclear=[\"Y013\",\"Y021\",\"Y024\",\"Y031\",\"Y041\"]",
    ) else {
        panic!()
    };
    assert_eq!((board.low.bits(), board.high.bits()), (151_388_258, 393_222), "the later manual's example");
}

#[test]
fn a_wrong_program_says_where_and_what() {
    for (text, mistakes) in [
        ("do=\"jmp\"", &["2:4: step 1: `do` is \"jmp\", which means nothing here; nearest: \"jump\""][..]),
        ("point=\"X010\"", &["1:1: step 1: `do` is missing: the kind of step"]),
        ("do=\"jump\"\nto=\"there\"", &["3:4: step 1 (jump): there is no label `there`; nearest: `here`"]),
        ("do=\"jump\"", &["1:1: step 1 (jump): `to` is missing: the name of a label"]),
        (
            "do=\"axis-move\"\nto=[1]\nsped=5\nblend=10",
            &[
                "4:1: step 1 (axis-move): there is no key `sped`; nearest: `speed`",
                "5:7: step 1 (axis-move): `blend` is 10, but has to be a whole number from 0 to 9",
            ],
        ),
        (
            "do=\"axis-move\"\nto=[1]\nspeed=500",
            &["4:7: step 1 (axis-move): `speed` is 500: it has to be percent from 0.1 to 100"],
        ),
        (
            "do=\"axis-move\"\nto=[1,2]\nspeed=5\nmask=4",
            &["5:6: step 1 (axis-move): mask 0x04 names J3, for which there is no number"],
        ),
        (
            "do=\"linear-move\"\nto=[1,2]\nspeed=5",
            &["3:4: step 1 (linear-move): `to` has 2 numbers, but needs 3 or 6"],
        ),
        (
            "do=\"linear-move\"\nto=[1,2,nan]\nspeed=5",
            &["3:4: step 1 (linear-move): `to` is a list, but has to be numbers"],
        ),
        (
            "do=\"wait\"\npoint=\"Y010\"",
            &["3:7: step 1 (wait): Y010 is an output: a wait is for X, M or EUX"],
        ),
        (
            "do=\"if\"\npoint=\"Y010\"\nto=\"here\"",
            &["3:7: step 1 (if): `point` is the text \"Y010\", but has to be a point X010, M010 or EUX010"],
        ),
        (
            "do=\"move-to-registers\"\nfirst=899\nspeed=5",
            &[
                "3:7: step 1 (move-to-registers): `first` has to be a register with five more behind it, 800 to 895",
            ],
        ),
        (
            "do=\"counter\"\nnumber=1\nto=1\nby=1",
            &["1:1: step 1 (counter): either `to` or `by` has to say how it changes"],
        ),
        (
            "do=\"if\"\npoint=\"X010\"\nregister=800\nto=\"here\"",
            &[
                "1:1: step 1 (if): it asks one thing: `point`, `counter`, `register`, `points`, or `stack` with `counter`",
            ],
        ),
        (
            "do=\"alarm\"\nnumber=99999",
            &[
                "3:8: step 1 (alarm): `number` is 99999, but has to be an alarm, 1 to 10000; those of users begin at 5000",
            ],
        ),
        (
            "do=\"tool\"\nnumber=32",
            &["3:8: step 1 (tool): `number` is 32, but has to be a whole number from 0 to 31"],
        ),
        (
            "do=\"output\"\npoint=\"Y1.010\"\non=true\npulse=1",
            &["5:7: step 1 (output): `delay` and `pulse` are for points of board 0"],
        ),
        ("do=\"remote\"\nspeed=5", &["3:1: step 1 (remote): `speed` has no meaning here"]),
    ] {
        let found = step(text).unwrap_err();
        assert!(mistakes.iter().all(|mistake| found.contains(mistake)), "{text}:\n{found}");
    }
    for (text, mistake) in [
        ("[[stepp]]", "1:3: there is no key `stepp`; nearest: `step`"),
        ("do = \"remote\"", "1:1: there is no key `do`; it belongs below a line [[step]]"),
        (
            "[[instruction]]\ndo = \"wait\"",
            "1:3: there is no key `instruction`; this is a list of instructions for a PC",
        ),
        ("a = [\n", "1:"),
        ("{\"step\": [}", "1:11: this is no JSON: expected value"),
        (
            "[[stack]]\nspacing=[1,2,3]\ncount=[1,0,1]",
            "3:7: [[stack]] 1: `count` is a list, but has to be three whole numbers",
        ),
        ("[[counter]]\ntarget=1", "1:1: [[counter]] 1: `number` is missing: the number of a counter"),
    ] {
        let found = read(text).unwrap_err();
        assert!(found.starts_with(mistake), "{text}:\n{found}");
    }
    let twice = "[[step]]\ndo=\"label\"\nname=\"a\"\n[[step]]\ndo=\"label\"\nname=\"a\"";
    assert_eq!(read(twice).unwrap_err(), "6:6: step 2 (label): there is a label `a` already");
    let many = "[[step]]\ndo=\"remote\"\n".repeat(MAX_STEPS + 1);
    assert_eq!(read(&many).unwrap_err(), "it has 1001 steps; 1000 are possible");
    assert!(read(&"#".repeat(MAX_TEXT_BYTES + 1)).unwrap_err().contains("longer than"));
    assert!(Program::read("", "").is_err() && Program::read("a\nb", "").is_err());
}

#[test]
fn a_program_with_five_mistakes_gets_five_in_toml_and_in_json() {
    let toml = "[[step]]\ndo = \"axis-move\"\nto = [1]\nspeed = 0\n[[step]]\ndo = \"wait\"\npoint = \"X10\"\n\
                [[step]]\ndo = \"jmp\"\n[[step]]\ndo = \"jump\"\nto = \"no\"\n[[step]]\ndo = \"photo\"\ntrys = 2\n";
    let json = r#"{"step": [
        {"do": "axis-move", "to": [1], "speed": 0},
        {"do": "wait", "point": "X10"},
        {"do": "jmp"},
        {"do": "jump", "to": "no"},
        {"do": "photo", "trys": 2}
    ]}"#;
    let places = |text: &str| {
        let mistakes = Program::read("p", text).unwrap_err();
        assert_eq!(mistakes.more(), 0);
        mistakes.iter().map(|mistake| mistake.at.unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(places(toml), [(4, 9), (7, 9), (9, 6), (12, 6), (15, 1)]);
    assert_eq!(places(json), [(2, 49), (3, 33), (4, 16), (5, 30), (6, 25)]);
}

#[test]
fn what_is_odd_in_json_is_told_with_its_place() {
    for (text, mistake) in [
        (r#"{"step": [{"do": "end", "do": "end"}]}"#, "1:25: the key `do` is there twice"),
        ("{\"step\": [\n{\"do\": null}]}", "2:8: step 1: `do` is null, but has to be one of"),
        (r#"{"step": 5}"#, "1:10: `step` is written as [[step]]"),
        (r#"{"step": []} {}"#, "1:14: this is no JSON: trailing characters"),
        (&format!("{{\"step\": {}", "[".repeat(100_000)), "1:"),
    ] {
        let found = read(text).unwrap_err();
        assert!(found.starts_with(mistake), "{text:.60}:\n{found}");
    }
}

#[test]
fn spellings_of_lists_that_are_sent_are_read_with_a_hint() {
    let hint = |text: &str| Program::read("p", text).unwrap().hint().map(str::to_owned);
    let old =
        "[[step]]\ndo = \"output\"\nkind = \"m\"\npoint = 3\non = true\n[[step]]\ndo = \"stop-on-signal\"";
    let said = "4:9: an older spelling, which is still read: point = \"M013\", and once more in this file";
    assert_eq!(hint(old).as_deref(), Some(said));
    let new = "[[step]]\ndo = \"output\"\npoint = \"M013\"\non = true\n[[step]]\ndo = \"stop-on-signal\"\nwatch = false";
    assert_eq!(hint(new), None);
    assert_eq!(Program::read("p", old).unwrap().steps(), Program::read("p", new).unwrap().steps());
}

/// Checks that docs/PROGRAMS.md has exactly one row for each kind of step.
#[test]
fn the_page_tells_every_step() {
    let page = include_str!("../../../../docs/PROGRAMS.md");
    let (_, rest) = page.split_once("## Steps").unwrap();
    let rows = rest.lines().skip_while(|line| !line.starts_with("|---")).skip(1);
    let words = rows.take_while(|line| line.starts_with('|')).map(|line| line.split('`').nth(1).unwrap());
    assert_eq!(words.collect::<Vec<_>>(), step_words().collect::<Vec<_>>());
    let (_, example) = page.split_once("```toml\n").unwrap();
    assert_eq!(read(example.split_once("```").unwrap().0).unwrap().steps().len(), 4);
}

proptest! {
    #[test]
    fn no_text_breaks_the_reader(text in "\\PC{0,200}", at in 0..1200_usize) {
        let _ = Program::read("p", &text);
        let at = (0..=at.min(PALLETISE.len())).rev().find(|at| PALLETISE.is_char_boundary(*at)).unwrap();
        let _ = Program::read("p", &format!("{}{text}{}", &PALLETISE[..at], &PALLETISE[at..]));
    }

    /// Tries every field of every step with a value of every kind.
    #[test]
    fn no_field_breaks_the_reader(kind in 0..26_usize, field in 0..35_usize, value in any_value()) {
        let fields = ["to", "through", "speed", "blend", "delay", "mask", "tool", "work_frame", "seconds", "point", "until",
            "limit", "on", "pulse", "set", "clear", "mm_per_s", "number", "first", "count", "pose", "stack", "counter",
            "above", "camera", "model", "tries", "alarm", "else", "name", "program", "by", "full", "at_least", "equals"];
        let kind = step_words().nth(kind).unwrap();
        let text = format!("[[step]]\ndo = \"{kind}\"\n{} = {value}\n", fields[field]);
        let _ = Program::read("p", &text);
    }
}

fn any_value() -> impl Strategy<Value = String> {
    prop_oneof![
        any::<i64>().prop_map(|n| n.to_string()),
        (-10_i64..10_000).prop_map(|n| n.to_string()),
        (-1e9..1e9).prop_map(|n| format!("{n:.3}")),
        Just("nan".to_owned()),
        Just("inf".to_owned()),
        Just("true".to_owned()),
        Just("\"X010\"".to_owned()),
        Just("[\"Y010\", \"Y047\", \"M010\"]".to_owned()),
        Just("[1.0, 2, 3]".to_owned()),
        Just("{ a = 1 }".to_owned()),
        Just("1979-05-27".to_owned()),
    ]
}
