//! Motion programs: instruction lists that can be sent to an arm.

use r6_proto::message::Instruction;

use crate::form::{self, Fields, Found, Table};
use crate::step::{self, ProgramKind};
use crate::{Mistake, Mistakes, json};

/// The largest program file that is read, in bytes. It is far more than any list of instructions needs, and
/// fits in memory.
pub const MAX_FILE_BYTES: usize = 16 * 1024 * 1024;

/// The keys at the top of the file.
const FILE_KEYS: [&str; 3] = ["repeat", "append", INSTRUCTION];

/// The tables of a program.
const INSTRUCTION: &str = "instruction";

/// Instructions that replace a controller's instruction list or are appended to it.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionList {
    /// Whether they replace the list; otherwise they are appended.
    pub replace: bool,
    /// The instructions.
    pub instructions: Vec<Instruction>,
}

/// The content of a file for `r6 run`.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionProgram {
    /// Its lists; at least one.
    pub lists: Vec<MotionList>,
    /// Hints for the reader of the file: unusual spellings, unknown keys.
    pub remarks: Vec<String>,
}

impl MotionProgram {
    /// Reads consecutive AddRCC frames, with `//` comments.
    ///
    /// # Errors
    /// [`Mistakes`]: all wrong frames, and what is valid there.
    pub fn from_json(text: &str) -> Result<Self, Mistakes> {
        json::read(text)
    }

    /// Reads either form. A text that begins with a frame, or with a `//` comment before one, is JSON.
    ///
    /// # Errors
    /// [`Mistakes`]: all wrong places of the text, and what is valid there.
    pub fn read(text: &str) -> Result<Self, Mistakes> {
        let beginning = text.trim_start_matches('\u{feff}').trim_start();
        if beginning.starts_with('{') || beginning.starts_with("//") {
            return Self::from_json(text);
        }
        Self::from_toml(text)
    }

    /// Reads a list of `[[instruction]]` tables.
    ///
    /// # Errors
    /// [`Mistakes`]: all wrong places of the text, and what is valid there.
    pub fn from_toml(text: &str) -> Result<Self, Mistakes> {
        read(text)
    }

    /// Makes a repeating list run only once.
    pub fn run_once(&mut self) {
        let steps = self.lists.iter_mut().flat_map(|list| &mut list.instructions);
        steps.for_each(|step| step.oneshot = true);
    }
}

fn read(text: &str) -> Result<MotionProgram, Mistakes> {
    let (document, mut found) = form::parse(text);
    let fields = Fields::of(&document, &FILE_KEYS, "");
    let repeat = fields.flag("repeat").unwrap_or(false);
    let append = fields.flag("append").unwrap_or(false);
    let steps = fields.tables(INSTRUCTION);
    let is_there = fields.has(INSTRUCTION);
    fields.finish_with(Ok(()), &mut found, elsewhere);
    let instructions = instructions(&steps, !repeat, &mut found);
    let remarks = found.hint().into_iter().collect();
    let program = found.finish(Some(MotionProgram {
        lists: vec![MotionList { replace: !append, instructions }],
        remarks,
    }))?;
    if !is_there || steps.is_empty() {
        let advice = "`r6 run --help` shows how a program is written";
        return Err(Mistake::of_the_file("there is no [[instruction]] in it", Some(advice)).into());
    }
    Ok(program)
}

fn instructions(steps: &[&Table], oneshot: bool, found: &mut Found<'_>) -> Vec<Instruction> {
    let mut instructions = Vec::with_capacity(steps.len());
    for (number, step) in steps.iter().enumerate() {
        let fields = Fields::of(step, &step::KEYS, format!("instruction {}: ", number + 1));
        let action = step::kind(&fields).and_then(|kind| step::action(kind, &fields, ProgramKind::Sent));
        instructions.extend(fields.finish(action, found).map(|action| Instruction { oneshot, action }));
    }
    instructions
}

/// Advice for an unknown key of a file: where it belongs.
fn elsewhere(key: &str) -> Option<String> {
    match key {
        "step" | "stack" | "counter" => Some(
            "a taught program runs on the controller: `r6 sim --program FILE`, `r6 panel load FILE`, or `r6 plot FILE` (docs/PROGRAMS.md)"
                .to_owned(),
        ),
        // It may be the key of an instruction, written above the first instruction.
        _ => step::KEYS.contains(&key).then(|| "it belongs below a line [[instruction]]".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use r6_proto::message::Action;

    use super::*;
    use crate::MAX_MISTAKES;

    #[test]
    fn a_program_of_two_steps() {
        let program = read(
            "[[instruction]]\ndo = \"axis-move\"\nto = [0, 10, -20.5, 0, 30, 0]\nspeed = 20\n\n\
             [[instruction]]\ndo = \"wait\"\nseconds = 0.5\n",
        )
        .unwrap();
        assert_eq!(program.lists.len(), 1);
        let list = &program.lists[0];
        assert!(list.replace);
        let numbers: Vec<_> =
            list.instructions.iter().map(|step| (step.oneshot, step.action.number())).collect();
        assert_eq!(numbers, [(true, 4), (true, 100)]);
        let Action::AxisMove(motion) = list.instructions[0].action else { panic!() };
        assert_eq!(motion.manner.mask.map(r6_proto::AxisMask::bits), Some(0x3F));
        assert_eq!(motion.manner.speed, Some(20.0));
    }

    #[test]
    fn repeat_and_append_are_for_the_whole_list() {
        let program =
            read("repeat = true\nappend = true\n[[instruction]]\ndo = \"workbench\"\nnumber = 1").unwrap();
        assert!(!program.lists[0].replace);
        assert!(!program.lists[0].instructions[0].oneshot);
    }

    /// Line, column, text and advice of each mistake.
    fn mistakes(text: &str) -> Vec<String> {
        let mistakes = read(text).unwrap_err();
        mistakes
            .iter()
            .map(|mistake| match &mistake.advice {
                Some(advice) => format!("{mistake}; {advice}"),
                None => mistake.to_string(),
            })
            .collect()
    }

    #[test]
    fn a_file_with_five_mistakes_gets_five() {
        let text = "repeet = true\n[[instruction]]\ndo = \"axis-move\"\nto = [1, 2]\nsped = 5\nblend = 12\n\
                    [[instruction]]\ndo = \"linear-move\"\nspeed = \"fast\"\n";
        assert_eq!(
            mistakes(text),
            [
                "1:1: there is no key `repeet`; nearest: `repeat`",
                "5:1: instruction 1: there is no key `sped`; nearest: `speed`",
                "6:9: instruction 1: `blend` is 12, but has to be a whole number from 0 to 9",
                "7:1: instruction 2: `to` is missing",
                "9:9: instruction 2: `speed` is the text \"fast\", but has to be a number",
            ]
        );
    }

    #[test]
    fn what_is_no_toml_is_one_mistake_and_the_rest_is_read() {
        let found = mistakes("[[instruction]]\ndo = \"wait\"\nseconds = =\n[[instruction]]\ndo = \"jump\"\n");
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(
            found[0].starts_with("3:") && found[1].starts_with("5:6: instruction 2: `do` is"),
            "{found:?}"
        );
    }

    #[test]
    fn no_more_mistakes_are_listed_than_fit_on_a_screen() {
        let found = read(&"[[instruction]]\ndo = 1\n".repeat(MAX_MISTAKES + 7)).unwrap_err();
        assert_eq!((found.iter().count(), found.more()), (MAX_MISTAKES, 7));
    }

    #[test]
    fn older_spellings_are_read_with_a_hint() {
        let remarks = |text: &str| read(text).unwrap().remarks;
        let old = "[[instruction]]\ndo = \"wait\"\nsource = \"m\"\nboard = 1\npoint = 3\n\
                   [[instruction]]\ndo = \"board-output\"\nkind = \"m\"\nset = [1]\n";
        let hint =
            "5:9: an older spelling, which is still read: point = \"M1.013\", and once more in this file";
        assert_eq!(remarks(old), [hint]);
        let new = "[[instruction]]\ndo = \"wait\"\npoint = \"M1.013\"\n\
                   [[instruction]]\ndo = \"board-output\"\nset = [\"M011\"]\n";
        assert_eq!(remarks(new), [""; 0]);
        assert_eq!(read(old).unwrap().lists, read(new).unwrap().lists);
    }

    #[test]
    fn errors_say_where() {
        assert_eq!(
            mistakes("[[instruction]]\ndo = \"wait\"\nsecond = 0.5"),
            ["3:1: instruction 1: there is no key `second`; nearest: `seconds`"]
        );
        let missing = "\n[[instruction]]\ndo = \"axis-move\"\nspeed = 5";
        assert_eq!(mistakes(missing), ["2:1: instruction 1: `to` is missing"]);
        let jump = mistakes("[[instruction]]\ndo = \"jump\"");
        assert!(jump[0].contains("axis-move"), "{jump:?}");
        assert!(mistakes("")[0].contains("[[instruction]]"));
        assert!(mistakes("a = [")[0].starts_with("1:"));
    }

    #[test]
    fn keys_in_a_wrong_place_are_told() {
        let above = "speed = 5\n[[instruction]]\ndo = \"wait\"\nseconds = 1";
        assert_eq!(
            mistakes(above),
            ["1:1: there is no key `speed`; it belongs below a line [[instruction]]"]
        );
        assert!(mistakes("[instruction]\ndo = \"wait\"")[0].contains("two pairs of brackets"));
        assert_eq!(
            mistakes("instruction = [5]"),
            ["1:16: instruction 1 is 5, but has to be a table [[instruction]]"]
        );
        let what = "2:1: instruction 1: `do` is missing: what it does; such as do = \"axis-move\"";
        assert_eq!(mistakes("\n[[instruction]]\nto = [1]"), [what]);
    }

    #[test]
    fn wrong_values_are_told_in_words() {
        for (kind, line, what) in [
            ("axis-move", "blend = 2.5", "`blend` is 2.5, but has to be a whole number from 0 to 9"),
            ("axis-move", "blend = -1", "`blend` is -1, but has to be a whole number from 0 to 9"),
            ("axis-move", "to = 5", "`to` is 5, but has to be numbers in brackets, such as [10, -20.5]"),
            (
                "axis-move",
                "to = [1, \"2\"]",
                "`to` is a list, but has to be numbers in brackets, such as [10, -20.5]",
            ),
            ("stop-on-signal", "on = 1", "`on` is 1, but has to be true or false"),
            (
                "axis-move",
                "mask = []",
                "`mask` is an empty list, but has to be a mask such as 0x3F or \"0x3F\"",
            ),
            ("axis-move", "mask = 0x1FF", "`mask` is 0x1FF, but has to be a mask such as 0x3F or \"0x3F\""),
            (
                "wait",
                "until = true",
                "`until` is true, but has to be one of \"on\", \"off\", \"rising\", \"falling\"",
            ),
            (
                "wait",
                "source = \"inputs\"",
                "`source` is \"inputs\", but has to be one of \"input\", \"m\", \"eu\"; nearest: \"input\"",
            ),
            (
                "board-output",
                "set = [300]",
                "`set` is a list, but has to be names of points in brackets, such as [\"Y010\", \"Y011\"]",
            ),
            (
                "workbench",
                "number = 2026-01-01",
                "`number` is a date, but has to be a whole number from 0 to 4294967295",
            ),
        ] {
            let found = mistakes(&format!("[[instruction]]\ndo = \"{kind}\"\n{line}\n"));
            assert!(
                found
                    .iter()
                    .any(|one| one.starts_with("3:") && one.ends_with(&format!(": instruction 1: {what}"))),
                "{line}: {found:?}"
            );
        }
    }
}
