//! Programs in TOML: one `[[instruction]]` table for each step, in the words of the glossary.

mod form;
mod step;

use ::toml::Spanned;
use serde::Deserialize;

use super::{Batch, FileError, ProgramFile, lines};

/// A file as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    /// The list starts over, for ever.
    #[serde(default)]
    repeat: bool,
    /// The instructions are appended to the list; else they replace it.
    #[serde(default)]
    append: bool,
    #[serde(default)]
    instruction: Vec<Spanned<step::Step>>,
}

/// Reads a file.
pub fn read(text: &str) -> Result<ProgramFile, FileError> {
    form::check(text)?;
    let file: File = ::toml::from_str(text).map_err(|error| syntax(text, &error))?;
    if file.instruction.is_empty() {
        return Err(FileError {
            at: None,
            what: "there is no [[instruction]] in it".to_owned(),
            advice: Some("`r6 run --help` shows how a program is written".to_owned()),
        });
    }
    let mut instructions = Vec::new();
    for (number, step) in file.instruction.iter().enumerate() {
        let action = step.get_ref().action().map_err(|what| FileError {
            at: Some(lines::position(text, step.span().start)),
            what: format!("instruction {}: {what}", number + 1),
            advice: None,
        })?;
        instructions.push(r6_proto::message::Instruction { oneshot: !file.repeat, action });
    }
    Ok(ProgramFile { batches: vec![Batch { replace: !file.append, instructions }], remarks: Vec::new() })
}

/// A text that is no TOML, or that passed the check of its form and cannot be read all the same.
fn syntax(text: &str, error: &::toml::de::Error) -> FileError {
    let what = error.message().lines().collect::<Vec<_>>().join(" ");
    FileError { at: error.span().map(|span| lines::position(text, span.start)), advice: None, what }
}

#[cfg(test)]
mod tests {
    use r6_proto::message::Action;

    use super::*;

    #[test]
    fn a_program_of_two_steps() {
        let program = read(
            "[[instruction]]\ndo = \"axis-move\"\nto = [0, 10, -20.5, 0, 30, 0]\nspeed = 20\n\n\
             [[instruction]]\ndo = \"wait\"\nseconds = 0.5\n",
        )
        .unwrap();
        assert_eq!(program.batches.len(), 1);
        let batch = &program.batches[0];
        assert!(batch.replace);
        let numbers: Vec<_> =
            batch.instructions.iter().map(|step| (step.oneshot, step.action.number())).collect();
        assert_eq!(numbers, [(true, 4), (true, 100)]);
        let Action::AxisMove(motion) = batch.instructions[0].action else { panic!() };
        assert_eq!(motion.manner.mask.map(r6_proto::AxisMask::bits), Some(0x3F));
        assert_eq!(motion.manner.speed, Some(20.0));
    }

    #[test]
    fn repeat_and_append_are_for_the_whole_list() {
        let program =
            read("repeat = true\nappend = true\n[[instruction]]\ndo = \"workbench\"\nnumber = 1").unwrap();
        assert!(!program.batches[0].replace);
        assert!(!program.batches[0].instructions[0].oneshot);
    }

    #[test]
    fn errors_say_where() {
        let error = read("[[instruction]]\ndo = \"wait\"\nsecond = 0.5").unwrap_err();
        assert_eq!(error.at.map(|(line, _)| line), Some(3));
        assert_eq!(error.advice.as_deref(), Some("nearest: `seconds`"));
        let error = read("\n[[instruction]]\ndo = \"axis-move\"").unwrap_err();
        assert_eq!(error.at.map(|(line, _)| line), Some(2));
        assert_eq!(error.what, "instruction 1: `to` is missing");
        let error = read("[[instruction]]\ndo = \"jump\"").unwrap_err();
        assert!(error.what.contains("axis-move"), "{}", error.what);
        assert!(read("").unwrap_err().what.contains("[[instruction]]"));
        assert_eq!(read("a = [").unwrap_err().at.map(|(line, _)| line), Some(1));
    }
}
