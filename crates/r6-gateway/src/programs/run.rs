//! Reads a program that is to be run: the steps of all rounds.

use r6_api::Code;
use r6_client::Motion;
use r6_program::check::{AnyProgram, Checked};

use super::check;
use crate::problem::Problem;

/// The most rounds of a run.
pub const MAX_REPEAT: u32 = 1_000;

/// The most steps of all rounds together: as many as the longest program has. They are held in memory.
const MAX_STEPS: usize = 10_000;

/// What to do with a program that only the controller can run.
const TAUGHT: &str = "this is a taught program, with steps that only the controller carries out: put it on the controller \
                      (docs/PROGRAMS.md), select it with the command `switchMold`, and start it at the pendant or with \
                      `startButton`";

/// The steps of a program, `repeat` times one after the other.
///
/// # Errors
/// `bad_program`: it has mistakes, or it cannot be run from here. `bad_value`: it is too long.
pub fn steps(text: &str, repeat: u32) -> Result<Motion, Problem> {
    let bad_program = |message: String| Problem::new(Code::BadProgram, message);
    let Checked { program, .. } = check::read(text);
    let program = match program.map_err(|mistakes| bad_program(mistakes.to_string()))? {
        AnyProgram::Motion(program) => program,
        AnyProgram::Taught(_) => return Err(bad_program(TAUGHT.to_owned())),
    };
    if program.lists.first().is_some_and(|list| !list.replace) {
        let message = "it appends to a list that is there, and a run begins with an empty list: leave out `append`, \
                       or say `\"emptyList\": \"1\"`";
        return Err(bad_program(message.to_owned()));
    }
    let round: Vec<_> = program.lists.into_iter().flat_map(|list| list.instructions).collect();
    if round.is_empty() {
        return Err(bad_program("it has no steps".to_owned()));
    }
    if round.iter().any(|step| !step.oneshot) {
        let message = "it repeats without an end: leave out its `repeat` (`\"oneshot\": \"1\"` in JSON), and give the \
                       request a `repeat`";
        return Err(bad_program(message.to_owned()));
    }
    let rounds = usize::try_from(repeat).unwrap_or(usize::MAX);
    let all = round.len().saturating_mul(rounds);
    if all > MAX_STEPS {
        let message = format!("{repeat} rounds have {all} steps; {MAX_STEPS} are possible");
        return Err(Problem::new(Code::BadValue, message));
    }
    Ok(std::iter::repeat_n(round, rounds).flatten().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const WAIT: &str = "[[instruction]]\ndo = \"wait\"\nseconds = 1\n";

    #[test]
    fn rounds_are_put_one_behind_the_other() {
        assert_eq!(steps(WAIT, 3).unwrap().len(), 3);
        assert_eq!(steps(WAIT, 10_001).unwrap_err().code, Code::BadValue);
    }

    #[test]
    fn what_cannot_be_run_is_refused_with_what_to_do() {
        let wrong = steps("[[instruction]]\ndo = \"wait\"\nsecond = 1\n", 1).unwrap_err();
        assert_eq!(wrong.code, Code::BadProgram);
        assert!(wrong.message.starts_with("3:1: "), "{}", wrong.message);
        for (text, says) in [
            ("[[step]]\ndo = \"label\"\nname = \"again\"\n".to_owned(), "startButton"),
            (format!("repeat = true\n{WAIT}"), "give the request a `repeat`"),
            (format!("append = true\n{WAIT}"), "leave out `append`"),
        ] {
            let problem = steps(&text, 1).unwrap_err();
            assert_eq!(problem.code, Code::BadProgram);
            assert!(problem.message.contains(says), "{}", problem.message);
        }
    }
}
