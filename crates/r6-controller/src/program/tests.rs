use proptest::prelude::*;
use r6_proto::message::instruction::{WaitCondition, WaitSource};

use super::*;

fn read(text: &str) -> Result<Program, String> {
    Program::read("p", text).map_err(|error| error.to_string())
}

fn step(text: &str) -> Result<Step, String> {
    let text = format!("[[step]]\n{text}\n[[step]]\ndo = \"label\"\nname = \"here\"\n");
    read(&text).map(|program| program.steps()[0].clone())
}

#[test]
fn every_shipped_program_is_in_the_library() {
    let library = Library::default();
    let shipped: Vec<_> = Library::shipped().map(|(name, _)| name).collect();
    for (name, text) in Library::shipped() {
        Program::read(name, text).unwrap_or_else(|error| panic!("{error}"));
    }
    assert_eq!(library.names().collect::<Vec<_>>(), shipped);
    assert_eq!(library.programs().find_map(|program| library.missing_call(program)), None);
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
        Ok(Step::Set { point: OutputPoint::Y(1, 0), on: true })
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
    let wrong = |text: &str, complaint: &str| assert_eq!(step(text).unwrap_err(), complaint, "{text}");
    wrong("do=\"jmp\"", "program `p`, step 1: `do = \"jmp\"` is not known; nearest: `jump`");
    wrong("point=\"X010\"", "program `p`, step 1: `do` is missing: the kind of step");
    wrong(
        "do=\"jump\"\nto=\"there\"",
        "program `p`, step 1 (jump): there is no label `there`; nearest: `here`",
    );
    wrong(
        "do=\"axis-move\"\nto=[1]\nsped=5",
        "program `p`, step 1 (axis-move): `speed` is missing: percent, from 0.1 to 100",
    );
    wrong(
        "do=\"axis-move\"\nto=[1]\nspeed=5\nblendd=1",
        "program `p`, step 1 (axis-move): `blendd` means nothing here; nearest: `blend`",
    );
    wrong(
        "do=\"axis-move\"\nto=[1]\nspeed=500",
        "program `p`, step 1 (axis-move): `speed` has to be percent, from 0.1 to 100, not 500",
    );
    wrong(
        "do=\"axis-move\"\nto=[1,2]\nspeed=5\nmask=4",
        "program `p`, step 1 (axis-move): `mask` names J3, for which there is no number",
    );
    wrong(
        "do=\"linear-move\"\nto=[1,2]\nspeed=5",
        "program `p`, step 1 (linear-move): `to` has to be 3 or 6 finite numbers, not [1, 2]",
    );
    wrong(
        "do=\"linear-move\"\nto=[1,2,nan]\nspeed=5",
        "program `p`, step 1 (linear-move): `to` has to be 3 or 6 finite numbers, not [1, 2, nan]",
    );
    wrong(
        "do=\"wait\"\npoint=\"Y010\"",
        "program `p`, step 1 (wait): `point` has to be a point as the pendant names it, X or M or EUX and octal 010 to 047, not \"Y010\"",
    );
    wrong(
        "do=\"move-to-registers\"\nfirst=899\nspeed=5",
        "program `p`, step 1 (move-to-registers): `first` has to be a register with five more behind it, 800 to 895",
    );
    wrong(
        "do=\"counter\"\nnumber=1\nto=1\nby=1",
        "program `p`, step 1 (counter): either `to` or `by` has to say how it changes",
    );
    wrong(
        "do=\"if\"\npoint=\"X010\"\nregister=800\nto=\"here\"",
        "program `p`, step 1 (if): it asks one thing: `point`, `counter`, `register`, `points`, or `stack` with `counter`",
    );
    wrong(
        "do=\"alarm\"\nnumber=99999",
        "program `p`, step 1 (alarm): `number` has to be an alarm, 1 to 10000; those of users begin at 5000, not 99999",
    );
    assert_eq!(read("[[stepp]]").unwrap_err(), "program `p`: `stepp` means nothing here; nearest: `step`");
    assert_eq!(read("a = [\n").unwrap_err().split(':').nth(1), Some(" no TOML"));
    assert!(read("{\"step\": [}").unwrap_err().contains("no JSON"));
    let twice = "[[step]]\ndo=\"label\"\nname=\"a\"\n[[step]]\ndo=\"label\"\nname=\"a\"";
    assert_eq!(read(twice).unwrap_err(), "program `p`, step 2 (label): there is a label `a` already");
    let many = "[[step]]\ndo=\"remote\"\n".repeat(MAX_STEPS + 1);
    assert_eq!(read(&many).unwrap_err(), "program `p`: it has 1001 steps; 1000 are possible");
    assert!(read(&"#".repeat(MAX_TEXT_BYTES + 1)).unwrap_err().contains("longer than"));
    assert!(Program::read("", "").is_err() && Program::read("a\nb", "").is_err());
    let stack = "[[stack]]\nspacing=[1,2,3]\ncount=[1,0,1]";
    assert_eq!(
        read(stack).unwrap_err(),
        "program `p`: stack 0: `count` has to be three whole numbers, 1 to 10000"
    );
}

#[test]
fn a_library_is_bounded_and_knows_what_is_missing() {
    let mut library = Library::empty();
    let program = Program::read("a", "[[step]]\ndo=\"call\"\nprogram=\"remot\"").unwrap();
    library.load("remote", "[[step]]\ndo=\"remote\"").unwrap();
    assert_eq!(
        library.missing_call(&program).as_deref(),
        Some("it calls `remot`, which is not there; nearest: `remote`")
    );
    for n in 1..library::MAX_PROGRAMS {
        library.load(&format!("p{n}"), "").unwrap();
    }
    assert_eq!(library.load("one-more", ""), Err(LibraryError::Full));
    library.load("p1", "[[step]]\ndo=\"end\"").unwrap();
    assert_eq!(library.named("p1").unwrap().steps(), [Step::End], "in place of the one of that name");
}

const PAGE: &str = include_str!("../../../../docs/PROGRAMS.md");

/// docs/PROGRAMS.md has a row for every kind of step and every shipped program, and no other.
#[test]
fn the_page_tells_every_step() {
    let column = |heading: &str| -> Vec<&str> {
        let (_, rest) = PAGE.split_once(heading).unwrap();
        let rows = rest.lines().skip_while(|line| !line.starts_with("|---")).skip(1);
        rows.take_while(|line| line.starts_with('|')).map(|line| line.split('`').nth(1).unwrap()).collect()
    };
    assert_eq!(column("## Steps"), file::KINDS);
    let mut shipped = column("## Those that come");
    shipped.sort_unstable();
    assert_eq!(shipped, Library::shipped().map(|(name, _)| name).collect::<Vec<_>>());
    let (_, example) = PAGE.split_once("```toml\n").unwrap();
    assert_eq!(read(example.split_once("```").unwrap().0).unwrap().steps().len(), 4);
}

proptest! {
    #[test]
    fn no_text_breaks_the_reader(text in "\\PC{0,200}", which in 0..6_usize, at in 0..600_usize) {
        let _ = Program::read("p", &text);
        let (name, shipped) = Library::shipped().nth(which).unwrap();
        let at = (0..=at.min(shipped.len())).rev().find(|at| shipped.is_char_boundary(*at)).unwrap();
        let _ = Program::read(name, &format!("{}{text}{}", &shipped[..at], &shipped[at..]));
    }

    /// Every field of every step with a value of every kind.
    #[test]
    fn no_field_breaks_the_reader(kind in 0..26_usize, field in 0..35_usize, value in any_value()) {
        let fields = ["to", "through", "speed", "blend", "delay", "mask", "tool", "work_frame", "seconds", "point", "until",
            "limit", "on", "pulse", "set", "clear", "mm_per_s", "number", "first", "count", "pose", "stack", "counter",
            "above", "camera", "model", "tries", "alarm", "else", "name", "program", "by", "full", "at_least", "equals"];
        let kind = file::KINDS[kind];
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
