//! Checks the text of a program.

use r6_api::Code;
use r6_api::gateway::{ProgramChecked, ProgramProblem, ProgramStep, ProgramType, StepRuns};
use r6_client::Motion;
use r6_program::check::{self as reader, AnyProgram, Checked, CheckedStep};
use r6_program::{FileKind, Mistake, Mistakes, MotionProgram};

use crate::core::library::MAX_TEXT;
use crate::problem::Problem;

/// What a taught program without a name is called.
pub const NO_NAME: &str = "program";

/// The most steps of a program. Far more than the longest known program has; the steps of the longest text
/// would make an answer of megabytes.
const MAX_STEPS: usize = 10_000;

/// The most hints of an answer: a frame can have thousands of unknown keys.
const MAX_REMARKS: usize = 20;

/// Refuses a text that is too long.
///
/// # Errors
/// `bad_value`.
pub fn check_length(text: &str) -> Result<(), Problem> {
    if text.len() <= MAX_TEXT {
        return Ok(());
    }
    let message = format!("a program has at most {MAX_TEXT} bytes, and this one has {}", text.len());
    Err(Problem::new(Code::BadValue, message))
}

/// Reads a text, and checks what sending it would check. A program of too many steps has none.
#[must_use]
pub fn read(text: &str) -> Checked {
    let mut checked = reader::check(NO_NAME, text);
    let remarks = checked.remarks.len();
    if remarks > MAX_REMARKS {
        checked.remarks.truncate(MAX_REMARKS);
        checked.remarks.push(format!("and {} more hints", remarks - MAX_REMARKS));
    }
    let steps = checked.steps.len();
    if steps > MAX_STEPS {
        let what = format!("it has {steps} steps; {MAX_STEPS} are possible");
        let program = Err(Mistake::of_the_file(what, None).into());
        return Checked { steps: Vec::new(), program, ..checked };
    }
    let program = checked.program.and_then(|program| match &program {
        AnyProgram::Motion(motion) => match in_frames(motion).instructions() {
            Ok(_) => Ok(program),
            Err(error) => Err(Mistake::of_the_file(error.to_string(), None).into()),
        },
        AnyProgram::Taught(_) => Ok(program),
    });
    Checked { program, ..checked }
}

/// The steps of a program; each list begins a new frame.
#[must_use]
pub fn in_frames(program: &MotionProgram) -> Motion {
    program.lists.iter().fold(Motion::new(), |motion, list| {
        motion.begin_frame().extend(&Motion::of_list(list.instructions.iter().copied()))
    })
}

/// Everything that a check found, as the contract has it.
#[must_use]
pub fn report(text: &str) -> ProgramChecked {
    let Checked { kind, steps, program, remarks } = read(text);
    let mistakes = program.err();
    let problems = mistakes.iter().flat_map(Mistakes::iter).map(problem).collect();
    ProgramChecked {
        ok: mistakes.is_none(),
        kind: self::kind(kind),
        steps: (1..).zip(steps).map(|(number, step)| self::step(number, step)).collect(),
        problems,
        more_problems: mistakes.as_ref().map_or(0, Mistakes::more),
        remarks,
    }
}

/// The kind as the contract has it.
#[must_use]
pub fn kind(of: FileKind) -> ProgramType {
    match of {
        FileKind::Instructions => ProgramType::Instructions,
        FileKind::Taught => ProgramType::Taught,
        FileKind::Neither => ProgramType::Neither,
    }
}

fn step(number: usize, step: CheckedStep) -> ProgramStep {
    let CheckedStep { line, word, runs } = step;
    let runs = runs.map(|runs| match runs {
        reader::StepRuns::Sent => StepRuns::Sent,
        reader::StepRuns::OnController => StepRuns::OnController,
    });
    ProgramStep { number, line, r#do: word, runs }
}

fn problem(mistake: &Mistake) -> ProgramProblem {
    let Mistake { at, what, advice } = mistake;
    ProgramProblem {
        line: at.map(|(line, _)| line),
        column: at.map(|(_, column)| column),
        message: what.clone(),
        advice: advice.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_of_too_many_steps_and_too_many_hints_are_cut() {
        let step = "{do=\"wait\",seconds=1},";
        let of = |count: usize| report(&format!("instruction=[{}]", step.repeat(count)));
        let most = of(MAX_STEPS);
        assert_eq!((most.ok, most.steps.len()), (true, MAX_STEPS));
        let more = of(MAX_STEPS + 1);
        assert_eq!((more.ok, more.steps.len(), more.problems.len()), (false, 0, 1));

        let keys: String = (0..30).map(|number| format!(",\"zzzz{number}\":1")).collect();
        let frame = format!(
            r#"{{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","emptyList":"1","instructions":[
            {{"oneshot":"1","action":"100","type":"100","limit":"1"}}]{keys}}}"#
        );
        let hints = report(&frame);
        assert!(hints.ok, "{:?}", hints.problems);
        assert_eq!((hints.remarks.len(), hints.remarks.last().unwrap().as_str()), (21, "and 10 more hints"));
    }

    #[test]
    fn many_frames_take_one_pass_over_the_text() {
        // Counted anew for each frame, their places would take half a minute.
        let begun = std::time::Instant::now();
        let report = report(&"{}".repeat(MAX_TEXT / 2));
        assert_eq!(report.problems.len() + report.more_problems, MAX_TEXT / 2);
        assert!(begun.elapsed() < std::time::Duration::from_secs(10), "{:?}", begun.elapsed());
    }
}
