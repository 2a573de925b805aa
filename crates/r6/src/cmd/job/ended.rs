//! A job that failed: the exit code, and what became of the steps and the arm.

use std::fmt;
use std::time::Duration;

use r6_client::{Cause, Missed, MotionError, NotSent, Progress, RequestError, Robot, StopReport, WaitError};

use crate::cmd::job::guard;
use crate::cmd::stop::start_again;
use crate::exit::{Exit, Failure, after_a_part_left, is_another_robot, restarted, why_not};
use crate::hint;
use crate::output::alarm;
use crate::output::problem::Code;
use crate::robot;

/// What else to do if the controller refused the motion: the same program would refuse it again.
const ANOTHER_PROGRAM: &str = "If it does not wait for remote commands, choose a program that does: at the \
    pendant, or on a virtual controller with `r6 panel program remote`";

/// Advice for the case that the arm stands elsewhere.
fn elsewhere() -> String {
    let status = hint::r6("status");
    format!("look at the arm and at `{status}`; a curve wants a move before it, and masks leave axes out")
}

/// A job that did not do what was asked for.
#[derive(Debug)]
pub struct Ended {
    /// The text and the exit code.
    pub failure: Failure,
    /// What became of the steps, if they were streamed.
    pub progress: Option<Progress>,
    /// What became of the arm, if it was stopped.
    pub stop: Option<StopReport>,
}

impl From<Failure> for Ended {
    fn from(failure: Failure) -> Self {
        Self { failure, progress: None, stop: None }
    }
}

impl From<MotionError> for Ended {
    fn from(MotionError { cause, progress, stop }: MotionError) -> Self {
        let failure = of_cause(&cause, &progress, stop.as_deref());
        let failure =
            if progress.left > 0 && progress.total > 1 { failure.add(steps(&progress)) } else { failure };
        let ended = match stop {
            Some(stop) => Self::stopped(failure, *stop),
            None => failure.into(),
        };
        Self { progress: Some(progress), ..ended }
    }
}

impl Ended {
    /// A job that ended with a stop, and the result of the stop. If the arm was not seen to stand, the
    /// outcome is unknown.
    pub fn stopped(failure: Failure, stop: Result<StopReport, RequestError>) -> Self {
        let (failure, stop) = match stop {
            Ok(report) if report.confirmed => (failure.add(format_args!("stopped: {report}")), Some(report)),
            Ok(report) => {
                (failure.add(&report).with_exit(Exit::Unknown).with_code(Code::NotStopped), Some(report))
            }
            // An arm that may still move is the most important news and comes first.
            Err(error) => {
                let code = if is_another_robot(&error) { Code::AnotherRobot } else { Code::NotStopped };
                let first = not_stopped(&error, failure.code());
                (failure.lead(first).with_exit(Exit::Unknown).with_code(code), None)
            }
        };
        let was_refused = failure.code() == Code::Refused;
        let failure = match stop.as_ref().and_then(start_again) {
            Some(advice) if failure.advice().is_none() && was_refused => {
                failure.advise(format!("{advice}. {ANOTHER_PROGRAM}"))
            }
            Some(advice) if failure.advice().is_none() => failure.advise(advice),
            Some(_) | None => failure,
        };
        Self { failure, progress: None, stop }
    }

    /// Adds what to do if the controller never answered anything.
    pub fn told_of(self, robot: &Robot) -> Self {
        Self { failure: robot::told_of(robot, self.failure), ..self }
    }

    /// A motion that r6 gave up and stopped.
    pub fn given_up(
        why: GivenUp,
        progress: Option<Progress>,
        stop: Result<StopReport, RequestError>,
    ) -> Self {
        let failure = Failure::refused(why).with_code(why.code());
        // The caller does not learn from stdout what was seen of the arm.
        let failure = if why == GivenUp::Untold { failure.with_exit(Exit::Unknown) } else { failure };
        let failure = match &progress {
            Some(progress) if progress.total > 1 => failure.add(steps(progress)),
            Some(_) | None => failure,
        };
        Self { progress, ..Self::stopped(failure, stop) }
    }
}

/// Why r6 no longer waits for a running motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GivenUp {
    /// The user pressed Ctrl-C.
    Interrupted,
    /// The time of `--timeout` is over.
    TimedOut(Duration),
    /// The output about the motion cannot be written.
    Untold,
}

impl GivenUp {
    /// The code for programs.
    pub fn code(self) -> Code {
        match self {
            Self::Interrupted | Self::Untold => Code::Interrupted,
            Self::TimedOut(_) => Code::TimedOut,
        }
    }
}

impl fmt::Display for GivenUp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Interrupted => f.write_str("interrupted"),
            Self::TimedOut(after) => write!(f, "not done within {after:?}"),
            Self::Untold => f.write_str("stdout cannot be written"),
        }
    }
}

/// What became of the steps of a motion that ended.
fn steps(progress: &Progress) -> String {
    let Progress { total, left, done, .. } = *progress;
    format!(
        "{done} of {total} steps done, {} sent and not seen to be done, {} never sent",
        progress.under_way(),
        total.saturating_sub(left)
    )
}

/// The first words about a stop that failed, and why it failed. `told`: the code of the motion's failure,
/// which is not repeated. If the stop was not sent, the error says that nothing was sent. This is true of the
/// stop alone, because steps of the motion were sent.
fn not_stopped(error: &RequestError, told: Code) -> String {
    let RequestError::NotSent(NotSent::NotStopped(_)) = error else { return error.to_string() };
    let first = NotSent::NOT_STOPPED;
    if is_another_robot(error) && told == Code::AnotherRobot {
        return first.to_owned();
    }
    format!("{first}; the stop could not be sent: {}", why_not(error))
}

/// The failure for a cause. `stop`: what became of the arm, if it was stopped afterwards.
fn of_cause(cause: &Cause, progress: &Progress, stop: Option<&Result<StopReport, RequestError>>) -> Failure {
    let some_left = progress.left > 0;
    let stopped = matches!(stop, Some(Ok(report)) if report.confirmed);
    match cause {
        // In this case the rest of the instructions stays in the list.
        Cause::AlarmRaised { code } if some_left && stop.is_none() => {
            WaitError::AlarmRaised { code: *code }.into()
        }
        Cause::Stopped { mode } if some_left && stop.is_none() => WaitError::Stopped { mode: *mode }.into(),
        Cause::Step(_) => Failure::usage(cause),
        Cause::OutsideEnvelope(violation) => guard::beyond(violation),
        Cause::NotReady(_) => Failure::refused(cause).with_code(Code::NotReady),
        Cause::AnotherRuns | Cause::EarlierFailed(_) => Failure::refused(cause).with_code(Code::Busy),
        Cause::NotCleared(error) => Failure::from(error.clone()),
        // Exit code 3 would say that nothing of the job was carried out.
        Cause::NotSent(error) if some_left => {
            after_a_part_left("the rest could not be sent", &error.clone().into())
        }
        Cause::NotSent(error) => Failure::from(RequestError::from(error.clone())),
        Cause::Invalid(error) if some_left => Failure::unknown(format!("the rest cannot be sent: {error}")),
        Cause::Invalid(error) => Failure::from(RequestError::from(error.clone())),
        Cause::Refused(error) => {
            let failure = Failure::from(RequestError::from(error.clone()));
            if progress.accepted > 0 { failure.with_exit(Exit::Unknown) } else { failure }
        }
        Cause::OutcomeUnknown(error) => Failure::from(RequestError::from(error.clone())),
        Cause::AlarmRaised { code } => {
            Failure::refused(format!("the motion ended with alarm {}", alarm::short(*code)))
                .with_code(Code::Alarm)
                .advise(alarm::advice(*code))
        }
        Cause::Stopped { mode } => {
            Failure::refused(format!("the motion was stopped: the operation mode is now {mode}"))
                .with_code(Code::Stopped)
                .advise("somebody stopped or paused it, or turned the key: look at the machine first")
        }
        Cause::Restarted(restart) => restarted(restart),
        Cause::Elsewhere(missed @ Missed { found: Some(_), .. }) => {
            Failure::refused(format!("the list was accepted, but {missed}"))
                .with_code(Code::NotAtTarget)
                .advise(elsewhere())
        }
        Cause::Elsewhere(missed) => {
            Failure::unknown(format!("the list was accepted and the arm stands, but {missed}"))
                .advise(format!("look at the arm and at `{}`", hint::r6("status")))
        }
        Cause::Stalled { after } => {
            Failure::refused(format!("nothing has gone on for {:.1} s", after.as_secs_f64()))
                .with_code(Code::Stalled)
                .advise("look at the global speed, at the pendant, and at what the list waits for")
        }
        Cause::Unreadable(error) if some_left => {
            after_a_part_left("the list was sent, then the state could not be read", error)
        }
        Cause::Unreadable(error) => Failure::from(error.clone()),
        Cause::NotSeen if stopped => Failure::unknown(cause)
            .advise(format!("look at the arm and at `{}` before the next motion", hint::r6("status"))),
        Cause::NotSeen => Failure::unknown(cause).advise(format!(
            "look at the arm and at `{}`; `{}` stops it",
            hint::r6("status"),
            hint::r6("stop")
        )),
        Cause::NotProved(_) => Failure::unknown(cause).advise(format!(
            "look at the arm and at `{}`; without --append it is seen how far a list is",
            hint::r6("status")
        )),
        Cause::AnotherList { .. } => Failure::unknown(cause),
        Cause::StoppedHere | Cause::Dropped | Cause::Released | Cause::Closed | Cause::Abandoned => {
            Failure::unknown(cause)
        }
    }
}

#[cfg(test)]
mod tests {
    use r6_client::{Invalid, ListAfterStop, NotSent, OperationMode, Refused};

    use super::*;

    fn progress(left: usize, accepted: usize) -> Progress {
        Progress { total: 100, left, accepted, done: accepted / 2, ended: true }
    }

    fn report(confirmed: bool) -> StopReport {
        StopReport {
            confirmed,
            proof: confirmed.then_some(r6_client::StandProof::NotRunning(OperationMode::Stop)),
            means: Some(r6_client::StopMeans::ActionStop),
            robot: None,
            connection: 0,
            second: None,
            doubt: None,
            attempts: 1,
            took: Duration::from_millis(120),
            moving: Some(!confirmed),
            mode: Some(OperationMode::Stop),
            alarm: Some(0),
            list_length: Some(0),
            list: ListAfterStop::WasEmpty,
        }
    }

    fn ended(cause: Cause, progress: Progress, stop: Option<Result<StopReport, RequestError>>) -> Failure {
        Ended::from(MotionError { cause, progress, stop: stop.map(Box::new) }).failure
    }

    #[test]
    fn each_cause_has_its_exit_code() {
        let refused = Refused::InstructionList { reason: None };
        let confirmed = || Some(Ok(report(true)));
        for (cause, progress, exit) in [
            (Cause::AlarmRaised { code: 130 }, progress(24, 24), Exit::Refused),
            (Cause::Stopped { mode: OperationMode::Stop }, progress(24, 24), Exit::Refused),
            (Cause::Stalled { after: Duration::from_secs(5) }, progress(24, 24), Exit::Refused),
            (Cause::Refused(refused.clone()), progress(8, 0), Exit::Refused),
            (Cause::Refused(refused), progress(32, 24), Exit::Unknown),
            (Cause::NotSent(NotSent::Disconnected), progress(0, 0), Exit::NoReply),
            (Cause::NotSent(NotSent::Disconnected), progress(24, 24), Exit::Unknown),
            (Cause::Invalid(Invalid::TooLong { bytes: 3000, limit: 2048 }), progress(0, 0), Exit::Usage),
            (Cause::Invalid(Invalid::TooLong { bytes: 3000, limit: 2048 }), progress(24, 24), Exit::Unknown),
            (Cause::Unreadable(NotSent::Disconnected.into()), progress(0, 0), Exit::NoReply),
            (Cause::Unreadable(NotSent::Disconnected.into()), progress(24, 24), Exit::Unknown),
            (Cause::Abandoned, progress(24, 24), Exit::Unknown),
        ] {
            assert_eq!(ended(cause.clone(), progress, confirmed()).exit(), exit, "{cause:?} {progress:?}");
        }
    }

    #[test]
    fn an_arm_that_was_not_seen_to_stand_leaves_the_outcome_unknown() {
        let cause = || Cause::AlarmRaised { code: 130 };
        let not_sent = NotSent::NotStopped(Box::new(NotSent::Disconnected));
        for stop in [Ok(report(false)), Err(not_sent.into())] {
            let failure = ended(cause(), progress(24, 24), Some(stop));
            assert_eq!(failure.exit(), Exit::Unknown);
            assert!(failure.what().contains("emergency stop"), "{failure}");
        }
        let failure = ended(cause(), progress(24, 24), Some(Ok(report(true))));
        let wanted =
            "; 12 of 100 steps done, 12 sent and not seen to be done, 76 never sent; stopped: the arm stands";
        assert!(failure.what().contains(wanted), "{failure}");
    }
}
