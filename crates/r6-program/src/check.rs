//! Checks the text of a program: all mistakes, and where each step can run.

use r6_proto::message::Action;

use crate::form::{self, Fields, Found, Table};
use crate::lines::Forward;
use crate::step::{self, ProgramKind};
use crate::taught::{self, Program};
use crate::{FileKind, Mistake, Mistakes, MotionProgram};

/// Where a step can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepRuns {
    /// A PC can send it, and a taught program can have it.
    Sent,
    /// Only a controller can run it, as a part of a taught program.
    OnController,
}

/// One step of a text, whether the text has mistakes or not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CheckedStep {
    /// Its line, from 1; `None` in a frame of AddRCC.
    pub line: Option<usize>,
    /// Its `do`; for an instruction of a frame, the word that `do` would have. `None` if there is no such
    /// word.
    pub word: Option<String>,
    /// Where it can run; `None` if it has a mistake.
    pub runs: Option<StepRuns>,
}

/// What a program is, once its text has no mistake.
#[derive(Clone, Debug, PartialEq)]
pub enum AnyProgram {
    /// Instructions that a PC sends.
    Motion(MotionProgram),
    /// A taught program.
    Taught(Box<Program>),
}

/// What the text of a program says.
#[derive(Clone, Debug, PartialEq)]
pub struct Checked {
    /// Which kind of program it is.
    pub kind: FileKind,
    /// Its steps, also those with a mistake. Empty if there are AddRCC frames with a mistake in them.
    pub steps: Vec<CheckedStep>,
    /// The program.
    ///
    /// # Errors
    /// All mistakes.
    pub program: Result<AnyProgram, Mistakes>,
    /// Hints for its author: old spellings, unknown keys.
    pub remarks: Vec<String>,
}

/// Checks a text of either kind. `name` is the name of the program if it is a taught one.
///
/// The time grows with the length of the text; the caller limits it.
#[must_use]
pub fn check(name: &str, text: &str) -> Checked {
    let (document, found) = form::parse(text);
    let is_broken = found.finish(Some(())).is_err();
    let kind = match FileKind::of(text) {
        // The reader of broken TOML goes on behind the broken places.
        FileKind::Instructions if is_broken && has_steps_alone(&document) => FileKind::Taught,
        kind => kind,
    };
    match kind {
        FileKind::Instructions => instructions(text, &document),
        FileKind::Taught => taught(name, text, &document),
        FileKind::Neither => {
            let advice = "instructions for `r6 run` are [[instruction]] tables or AddRCC frames; a taught program has [[step]] tables";
            let mistake = Mistake::of_the_file(
                "it has neither instructions nor the steps of a taught program",
                Some(advice),
            );
            Checked { kind, steps: Vec::new(), program: Err(mistake.into()), remarks: Vec::new() }
        }
    }
}

fn has_steps_alone(document: &Table) -> bool {
    document.value("step").is_some() && document.value("instruction").is_none()
}

fn instructions(text: &str, document: &Table) -> Checked {
    let program = MotionProgram::read(text);
    let tables = tables(document, "instruction");
    let steps = match &program {
        Ok(program) if tables.is_empty() => {
            let all = program.lists.iter().flat_map(|list| &list.instructions);
            all.map(|step| of_frame(&step.action)).collect()
        }
        _ => {
            let runs = tables.iter().map(|table| can_be_sent(table).then_some(StepRuns::Sent));
            rows(text, &tables, runs)
        }
    };
    let remarks = program.as_ref().map(|program| program.remarks.clone()).unwrap_or_default();
    Checked { kind: FileKind::Instructions, steps, program: program.map(AnyProgram::Motion), remarks }
}

fn taught(name: &str, text: &str, document: &Table) -> Checked {
    let program = Program::read(name, text);
    let tables = tables(document, "step");
    let steps = if tables.len() <= taught::MAX_STEPS {
        let runs = tables.iter().zip(taught::each_reads(&tables)).map(|(table, reads)| {
            let of_both = || if can_be_sent(table) { StepRuns::Sent } else { StepRuns::OnController };
            reads.then(of_both)
        });
        rows(text, &tables, runs)
    } else {
        // It is refused as a whole.
        Vec::new()
    };
    let remarks = program.as_ref().ok().and_then(Program::hint).map(str::to_owned).into_iter().collect();
    let program = program.map(|program| AnyProgram::Taught(Box::new(program)));
    Checked { kind: FileKind::Taught, steps, program, remarks }
}

fn of_frame(action: &Action) -> CheckedStep {
    let word = step::word_of(action).map(str::to_owned);
    let runs = word.is_some().then_some(StepRuns::Sent);
    CheckedStep { line: None, word, runs }
}

/// The tables of a list, whatever else stands in it.
fn tables<'d>(document: &'d Table, name: &'static str) -> Vec<&'d Table> {
    let fields = Fields::of(document, &[], "");
    fields.tables(name)
}

/// Whether a PC can send a step, with numbers that fit the wire.
fn can_be_sent(table: &Table) -> bool {
    let fields = Fields::of(table, &step::KEYS, "");
    let action = step::kind(&fields).and_then(|kind| step::action(kind, &fields, ProgramKind::Sent));
    fields.finish(action, &mut Found::aside()).is_some()
}

fn rows(text: &str, tables: &[&Table], runs: impl Iterator<Item = Option<StepRuns>>) -> Vec<CheckedStep> {
    // Tables stand in the order of the text. Those of a list in brackets do so too.
    let mut place = Forward::new();
    let mut steps = Vec::with_capacity(tables.len());
    for (table, runs) in tables.iter().zip(runs) {
        let (line, _) = place.to(text, table.offset());
        let word = table.value("do").and_then(|word| word.text());
        let word = word.filter(|word| taught::step_words().any(|known| known == *word)).map(str::to_owned);
        steps.push(CheckedStep { line: Some(line), word, runs });
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> Vec<(Option<usize>, String, Option<StepRuns>)> {
        let steps = check("test", text).steps.into_iter();
        steps.map(|step| (step.line, step.word.unwrap_or_default(), step.runs)).collect()
    }

    #[test]
    fn each_step_of_a_taught_program_says_where_it_can_run() {
        let text = "[[step]]\ndo = \"label\"\nname = \"again\"\n\n\
                    [[step]]\ndo = \"axis-move\"\nto = [1]\nspeed = 5\n\
                    [[step]]\ndo = \"axis-move\"\nto = [1]\nspeed = 5.55\n\
                    [[step]]\ndo = \"wait\"\npoint = \"X010\"\n\
                    [[step]]\ndo = \"wait\"\npoint = \"X010\"\nlimit = 1\nelse = \"again\"\n\
                    [[step]]\ndo = \"output\"\npoint = \"Y1.011\"\non = true\n\
                    [[step]]\ndo = \"photo\"\n[[step]]\ndo = \"jump\"\nto = \"again\"\n";
        assert!(check("test", text).program.is_ok());
        let runs: Vec<_> =
            told(text).into_iter().map(|(line, word, runs)| (line.unwrap(), word, runs)).collect();
        let row = |line, word: &str, runs| (line, word.to_owned(), Some(runs));
        use StepRuns::{OnController, Sent};
        assert_eq!(
            runs,
            [
                row(1, "label", OnController),
                row(5, "axis-move", Sent),
                row(9, "axis-move", OnController),
                row(13, "wait", Sent),
                row(16, "wait", OnController),
                row(21, "output", OnController),
                row(25, "photo", OnController),
                row(27, "jump", OnController),
            ]
        );
    }

    #[test]
    fn a_step_with_a_mistake_is_listed_beside_those_without() {
        let text = "[[instruction]]\ndo = \"wait\"\nseconds = 1\n[[instruction]]\ndo = \"jump\"\n\
                    [[instruction]]\ndo = \"wait\"\nsecond = 1\n[[instruction]]\n";
        let checked = check("test", text);
        assert_eq!(checked.program.unwrap_err().iter().count(), 3);
        let runs: Vec<_> = checked.steps.iter().map(|step| (step.line, step.runs)).collect();
        assert_eq!(
            runs,
            [(Some(1), Some(StepRuns::Sent)), (Some(4), None), (Some(6), None), (Some(9), None)]
        );
        let words: Vec<_> = checked.steps.iter().map(|step| step.word.as_deref()).collect();
        assert_eq!(words, [Some("wait"), Some("jump"), Some("wait"), None]);
    }

    #[test]
    fn a_broken_taught_program_is_not_taken_for_instructions() {
        let checked = check("test", "[[step]]\ndo = \"end\"\n= 5\n[[step]]\ndo = \"return\"\n");
        assert_eq!(checked.kind, FileKind::Taught);
        let mistakes = checked.program.unwrap_err();
        assert_eq!((mistakes.iter().count(), mistakes.first().at.unwrap().0), (1, 3));
        assert_eq!(check("test", "[[stepp]]").kind, FileKind::Neither);
        assert_eq!(check("test", "a = [").kind, FileKind::Instructions);
    }

    #[test]
    fn frames_of_the_manual_have_steps_too() {
        let frame = r#"{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","emptyList":"1",
            "instructions":[{"oneshot":"1","action":"100","type":"100","limit":"1"}]}"#;
        let checked = check("test", frame);
        assert!(checked.program.is_ok(), "{:?}", checked.program);
        assert_eq!(told(frame), [(None, "wait".to_owned(), Some(StepRuns::Sent))]);
        assert!(told("{\"reqType\":\"AddRCC\"").is_empty());
    }
}
