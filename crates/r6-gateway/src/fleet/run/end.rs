//! What became of a run: judged from how the motion ended, what cut the run short, and the stop after it.

use r6_api::Code;
use r6_api::gateway::{ActedBy, LeaseEnd, RunEnd, RunProof, RunState};
use r6_client::{
    Cause, Done, DoubtAfterStop, EndProof, ListAfterStop, MotionError, NotSent, OperationMode, Progress,
    RequestError, StopReport, Unmet,
};

use crate::core::seat::{Cut, Left};
use crate::problem::Problem;

/// How the streaming of a run ended.
#[derive(Debug)]
pub enum Outcome {
    /// By itself, or by a stop that somebody else makes.
    Ended(Result<Done, MotionError>),
    /// The run was cut short, and the arm was stopped.
    Halted(Result<Done, MotionError>, Halted),
    /// The run was cut short, and the robot is out of reach: the arm finishes its list.
    Released(Progress),
}

/// What is known of the arm after a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Halted {
    /// It stands at the end of the program, or nothing reached it.
    NotNeeded,
    /// It was stopped, and it is proved that it stands. The list is cleared.
    Stands,
    /// It was stopped, and nothing proves that it stands, or that the list is cleared.
    NotProved,
    /// No stop reached it.
    OutOfReach,
}

impl Halted {
    /// What is known of the arm after a stop.
    pub fn of(report: &StopReport) -> Self {
        let is_clear =
            |list: &ListAfterStop| matches!(list, ListAfterStop::WasEmpty | ListAfterStop::Cleared);
        let no_doubt = |doubt: &DoubtAfterStop| !doubt.still_open && is_clear(&doubt.cleared);
        // The state counts, not the answer.
        let is_empty = is_clear(&report.list) && matches!(report.list_length, None | Some(0));
        if report.confirmed && is_empty && report.doubt.as_ref().is_none_or(no_doubt) {
            Self::Stands
        } else {
            Self::NotProved
        }
    }
}

/// What became of a run.
#[derive(Debug)]
pub struct Ended {
    pub state: RunState,
    pub because: RunEnd,
    /// Who stopped the robot, if that ended the run.
    pub stopped_by: Option<ActedBy>,
    pub proof: Option<RunProof>,
    /// For people.
    pub detail: String,
    /// What it leaves at the robot.
    pub left: Left,
    /// The answer to the request, if nothing was accepted.
    pub problem: Problem,
}

impl Ended {
    /// Judges the end of a run. `stopped_by`: who stopped the robot, if that cut it short.
    pub fn of(outcome: Outcome, cut: Option<Cut>, stopped_by: Option<ActedBy>, halted: Halted) -> Self {
        let left = match halted {
            Halted::NotNeeded | Halted::Stands => Left::Nothing,
            Halted::NotProved => Left::NotStopped,
            Halted::OutOfReach => Left::OutOfReach,
        };
        let (because, detail, is_left, code) = match outcome {
            Outcome::Ended(Ok(done)) | Outcome::Halted(Ok(done), _) => return Self::done(&done, left),
            Outcome::Released(progress) => {
                let because = cut.map_or(RunEnd::LinkLost, of_cut);
                let detail = format!("{}; {progress}", words(because, stopped_by.as_ref()));
                (because, detail, progress.left > 0, Code::NotReady)
            }
            Outcome::Ended(Err(error)) | Outcome::Halted(Err(error), _) => {
                let because = cut.map_or_else(|| of_cause(&error.cause), of_cut);
                let detail = match cut {
                    Some(_) => format!("{}; {}", words(because, stopped_by.as_ref()), told(&error)),
                    None => told(&error),
                };
                (because, detail, !error.nothing_left(), code(&error.cause))
            }
        };
        let detail = match halted {
            Halted::NotNeeded | Halted::Stands => detail,
            Halted::NotProved => {
                format!("{detail}; it is NOT proved that the arm stands and its list is cleared")
            }
            Halted::OutOfReach => format!(
                "{detail}; the robot is out of reach: it may finish its list, and is stopped as soon as it answers"
            ),
        };
        let state = state(because, cut.is_some(), is_left, halted);
        let code = match (state, because) {
            (RunState::Unknown, _) => Code::OutcomeUnknown,
            (_, RunEnd::Stop) => Code::Stopped,
            (_, RunEnd::LeaseExpired | RunEnd::LeaseReleased | RunEnd::LeaseTaken) => Code::NoLease,
            (_, RunEnd::IdentityChanged) => Code::IdentityChanged,
            _ => code,
        };
        let problem = Problem::new(code, detail.clone());
        let stopped_by = stopped_by.filter(|_| matches!(because, RunEnd::Stop | RunEnd::LeaseTaken));
        Self { state, because, stopped_by, proof: None, detail, left, problem }
    }

    fn done(done: &Done, left: Left) -> Self {
        let (proof, detail) = match &done.proof {
            EndProof::Reached => (RunProof::Reached, "the arm stands where the last move ends".to_owned()),
            EndProof::Consumed => {
                (RunProof::Consumed, "the controller was seen to work through its list".to_owned())
            }
            EndProof::CutShort(missed) => {
                (RunProof::CutShort, format!("an input ended the last move early: {missed}"))
            }
            EndProof::AtRest => (RunProof::AtRest, "the arm stands, and the list is empty".to_owned()),
        };
        let (state, because, proof) = (RunState::Done, RunEnd::Finished, Some(proof));
        let problem = Problem::new(Code::NotReady, detail.clone());
        Self { state, because, stopped_by: None, proof, left, problem, detail }
    }
}

fn state(because: RunEnd, is_cut: bool, is_left: bool, halted: Halted) -> RunState {
    match (because, halted) {
        (_, _) if !is_left => RunState::Refused,
        (_, Halted::NotProved | Halted::OutOfReach) => RunState::Unknown,
        (
            RunEnd::OutcomeUnknown
            | RunEnd::LinkLost
            | RunEnd::IdentityChanged
            | RunEnd::NotProved
            | RunEnd::Restarted,
            _,
        ) => RunState::Unknown,
        (_, _) if is_cut => RunState::Stopped,
        (RunEnd::ModeChanged | RunEnd::Stop, _) => RunState::Stopped,
        (_, _) => RunState::Failed,
    }
}

/// Why a run that was cut short ended.
fn of_cut(cut: Cut) -> RunEnd {
    match cut {
        Cut::Stop => RunEnd::Stop,
        Cut::LinkLost => RunEnd::LinkLost,
        Cut::Lease(end) => match end {
            LeaseEnd::Released => RunEnd::LeaseReleased,
            LeaseEnd::Expired => RunEnd::LeaseExpired,
            LeaseEnd::Taken => RunEnd::LeaseTaken,
            LeaseEnd::IdentityChanged => RunEnd::IdentityChanged,
            LeaseEnd::Reconfigured | LeaseEnd::Removed => RunEnd::RobotChanged,
            LeaseEnd::GatewayEnded => RunEnd::GatewayEnded,
            LeaseEnd::OwnerChanged => RunEnd::OwnerChanged,
        },
    }
}

/// Why a run ended that the seat did not cut short.
fn of_cause(cause: &Cause) -> RunEnd {
    match cause {
        Cause::NotReady(_) | Cause::NotCleared(_) | Cause::AnotherRuns | Cause::EarlierFailed(_) => {
            RunEnd::NotReady
        }
        Cause::NotSent(NotSent::AnotherRobot { .. }) => RunEnd::IdentityChanged,
        Cause::NotSent(NotSent::Disconnected | NotSent::Closed) | Cause::Unreadable(_) => RunEnd::LinkLost,
        Cause::Step(_) | Cause::OutsideEnvelope(_) | Cause::Invalid(_) | Cause::NotSent(_) => RunEnd::NotSent,
        Cause::Refused(_) => RunEnd::Refused,
        Cause::OutcomeUnknown(_) => RunEnd::OutcomeUnknown,
        Cause::AlarmRaised { .. } => RunEnd::Alarm,
        Cause::Stopped { .. } => RunEnd::ModeChanged,
        Cause::Restarted(_) => RunEnd::Restarted,
        Cause::StoppedHere => RunEnd::Stop,
        Cause::Dropped | Cause::Released | Cause::Closed | Cause::Abandoned => RunEnd::GatewayEnded,
        Cause::NotSeen | Cause::NotProved(_) => RunEnd::NotProved,
        Cause::AnotherList { .. } => RunEnd::AnotherList,
        Cause::Elsewhere(_) => RunEnd::NotAtTarget,
        Cause::Stalled { .. } => RunEnd::Stalled,
    }
}

/// The code of a request whose program did not begin.
fn code(cause: &Cause) -> Code {
    match cause {
        Cause::NotReady(unmet) if unmet.iter().any(|unmet| matches!(unmet, Unmet::LeftoverList { .. })) => {
            Code::LeftoverList
        }
        Cause::OutsideEnvelope(_) => Code::BeyondLimits,
        Cause::Step(_) | Cause::Invalid(_) => Code::BadProgram,
        Cause::NotSent(error) => Problem::of_request(&RequestError::NotSent(error.clone())).code,
        Cause::Refused(_) => Code::Refused,
        Cause::OutcomeUnknown(_) => Code::OutcomeUnknown,
        Cause::StoppedHere => Code::Stopped,
        _ => Code::NotReady,
    }
}

/// An error for callers of the gateway. What the client advises is for a program that is connected to the
/// robot itself.
fn told(error: &MotionError) -> String {
    let Cause::NotReady(unmet) = &error.cause else { return error.to_string() };
    let told = unmet.iter().map(|unmet| match unmet {
        Unmet::Mode { found: found @ OperationMode::Auto } => format!(
            "the operation mode is {found}, not running (7): start the program of the controller. At the pendant, in \
             Auto, turn Cycle on and press Start; or, with no person near the arm, send the command startButton with \
             the lease. The program must then be at its \"wait for remote commands\" step"
        ),
        unmet => unmet.to_string(),
    });
    format!("nothing was sent: {}", told.collect::<Vec<_>>().join("; "))
}

fn words(because: RunEnd, stopped_by: Option<&ActedBy>) -> String {
    if let Some(ActedBy { by, .. }) = stopped_by {
        match because {
            RunEnd::Stop => return format!("{by} stopped the robot"),
            RunEnd::LeaseTaken => return format!("{by} took the lease"),
            _ => {}
        }
    }
    let words = match because {
        RunEnd::LeaseExpired => "the lease was not renewed",
        RunEnd::LeaseReleased => "the lease was given back",
        RunEnd::LeaseTaken => "an admin took the lease",
        RunEnd::IdentityChanged => "another robot answers",
        RunEnd::LinkLost => "the robot does not answer",
        RunEnd::RobotChanged => "the robot was configured anew or removed",
        RunEnd::GatewayEnded => "the gateway ends",
        RunEnd::OwnerChanged => {
            "the gateway lost the robot: its database did not answer, or another gateway has the robot"
        }
        RunEnd::Stop => "the robot was stopped",
        _ => "the run was cut short",
    };
    words.to_owned()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn error(cause: Cause, left: usize, accepted: usize) -> Outcome {
        let progress = Progress { total: 9, left, accepted, done: 0, ended: true };
        Outcome::Ended(Err(MotionError { cause, progress, stop: None }))
    }

    #[test]
    fn a_run_is_stopped_only_if_the_arm_is_proved_to_stand() {
        let expired = Some(Cut::Lease(LeaseEnd::Expired));
        for (halted, state, left) in [
            (Halted::Stands, RunState::Stopped, Left::Nothing),
            (Halted::NotProved, RunState::Unknown, Left::NotStopped),
            (Halted::OutOfReach, RunState::Unknown, Left::OutOfReach),
        ] {
            let ended = Ended::of(error(Cause::StoppedHere, 5, 5), expired, None, halted);
            assert_eq!((ended.state, ended.left, ended.because), (state, left, RunEnd::LeaseExpired));
        }
    }

    #[test]
    fn a_stop_counts_only_if_its_list_is_cleared_too() {
        let report = StopReport {
            confirmed: true,
            proof: None,
            means: None,
            attempts: 1,
            took: Duration::from_millis(90),
            robot: None,
            connection: 1,
            second: None,
            moving: Some(false),
            mode: None,
            alarm: Some(0),
            list_length: Some(0),
            list: ListAfterStop::Cleared,
            doubt: None,
        };
        let doubt = |still_open, cleared| Some(DoubtAfterStop { still_open, cleared });
        for (report, halted) in [
            (report.clone(), Halted::Stands),
            (
                StopReport { list: ListAfterStop::WasEmpty, list_length: None, ..report.clone() },
                Halted::Stands,
            ),
            (StopReport { doubt: doubt(false, ListAfterStop::Cleared), ..report.clone() }, Halted::Stands),
            (StopReport { confirmed: false, ..report.clone() }, Halted::NotProved),
            (StopReport { list: ListAfterStop::Refused(None), ..report.clone() }, Halted::NotProved),
            (StopReport { list_length: Some(2), ..report.clone() }, Halted::NotProved),
            (StopReport { doubt: doubt(true, ListAfterStop::Cleared), ..report.clone() }, Halted::NotProved),
            (StopReport { doubt: doubt(false, ListAfterStop::Refused(None)), ..report }, Halted::NotProved),
        ] {
            assert_eq!(Halted::of(&report), halted, "{report:?}");
        }
    }

    #[test]
    fn what_never_left_is_refused_and_what_cannot_be_known_is_unknown() {
        let refused = |unmet| error(Cause::NotReady(vec![unmet]), 0, 0);
        let ended = Ended::of(refused(Unmet::LeftoverList { length: 3 }), None, None, Halted::NotNeeded);
        assert_eq!((ended.state, ended.problem.code), (RunState::Refused, Code::LeftoverList));
        let ended = Ended::of(refused(Unmet::Moving), None, None, Halted::NotNeeded);
        assert_eq!((ended.state, ended.problem.code), (RunState::Refused, Code::NotReady));
        assert_eq!(ended.detail, Cause::NotReady(vec![Unmet::Moving]).to_string());
        let ended =
            Ended::of(refused(Unmet::Mode { found: OperationMode::Auto }), None, None, Halted::NotNeeded);
        assert!(ended.detail.contains("send the command startButton with the lease"), "{}", ended.detail);
        assert!(!ended.detail.contains("r6 command"), "{}", ended.detail);
        let alarm = || error(Cause::AlarmRaised { code: 3 }, 5, 5);
        assert_eq!(Ended::of(alarm(), None, None, Halted::Stands).state, RunState::Failed);
        assert_eq!(Ended::of(alarm(), None, None, Halted::NotProved).state, RunState::Unknown);
        let gone = Ended::of(error(Cause::NotSeen, 9, 9), None, None, Halted::Stands);
        assert_eq!((gone.state, gone.because), (RunState::Unknown, RunEnd::NotProved));
        // The first list was refused; some controllers run such lists all the same, so the arm was stopped.
        let reason = r6_client::Refused::InstructionList { reason: None };
        let first = Ended::of(error(Cause::Refused(reason.clone()), 5, 0), None, None, Halted::Stands);
        assert_eq!((first.state, first.problem.code), (RunState::Failed, Code::Refused));
        let later = Ended::of(error(Cause::Refused(reason), 9, 5), None, None, Halted::Stands);
        assert_eq!(later.state, RunState::Failed);
    }
}
