//! Why a motion did not reach its end.

use std::fmt;
use std::time::Duration;

use r6_proto::OperationMode;

use crate::error::{Invalid, NotSent, OutcomeUnknown, Refused, RequestError};
use crate::evidence::restart::Restart;
use crate::guard::violation::Violation;
use crate::moves::step_error::StepError;
use crate::path::place::Missed;
use crate::progress::Progress;
use crate::status::{AlarmAdvice, Unmet};
use crate::stop::report::StopReport;

/// A motion that did not reach its end: the cause, what happened to its steps, and what happened to the arm.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionError {
    /// The cause.
    pub cause: Cause,
    /// What happened to its steps; [`Progress::current`] is the step in turn.
    pub progress: Progress,
    /// The result of the stop, if the arm was stopped.
    pub stop: Option<Box<Result<StopReport, RequestError>>>,
}

/// Why a motion did not reach its end.
#[derive(Clone, Debug, PartialEq)]
pub enum Cause {
    /// A step or an option is wrong; nothing was sent.
    Step(StepError),
    /// A step goes beyond the envelope of the guard; nothing was sent.
    OutsideEnvelope(Violation),
    /// The machine is not ready; nothing was sent. Lists the unmet conditions in the order in which the user
    /// should handle them.
    NotReady(Vec<Unmet>),
    /// The old list could not be cleared; nothing of the motion was sent.
    NotCleared(RequestError),
    /// Another motion is being streamed over this connection; nothing was sent.
    AnotherRuns,
    /// The motion before this one did not reach its end, and no caller has asked for its result; nothing was
    /// sent. The client reports this once: check where the arm is, then run this motion again.
    EarlierFailed(Box<MotionError>),
    /// A list could not be sent. The lists before it were sent.
    NotSent(NotSent),
    /// A list cannot be sent as it is: it contains a value that the wire cannot carry, or its frame is too
    /// long. The lists before it were sent.
    Invalid(Invalid),
    /// The controller refused a list.
    Refused(Refused),
    /// A list was sent, and it is not known whether the controller has it. The client did not resend it.
    OutcomeUnknown(OutcomeUnknown),
    /// There is an alarm.
    AlarmRaised {
        /// Its number.
        code: i64,
    },
    /// The program no longer runs: somebody stopped or paused it, or changed the mode.
    Stopped {
        /// The mode the controller is in.
        mode: OperationMode,
    },
    /// The connection was lost, and the controller seems to have been switched off and on.
    Restarted(Restart),
    /// A handle of this connection sent a stop or a pause.
    StoppedHere,
    /// The handle of the motion was dropped, and the options asked for a stop then
    /// ([`crate::RunOptions::stop_on_drop`]).
    Dropped,
    /// The handle of the motion ended the streaming ([`crate::MotionHandle::release`]): the arm may continue
    /// with what is in its list.
    Released,
    /// The robot's handle was closed ([`crate::Robot::close`]) before the whole motion was sent.
    Closed,
    /// The lists were accepted and are gone from the controller's list, but nothing proves that they were
    /// carried out completely: another client may have cleared the list. The arm stands, or steps left the
    /// list faster than the arm can have made them.
    NotSeen,
    /// The appended list was accepted and the arm stands, but nothing proves that the list was carried out.
    NotProved(NotProved),
    /// The controller's list has more instructions than this handle has sent: another client sends
    /// instructions too.
    AnotherList {
        /// `RemoteCmdLen`.
        length: i64,
    },
    /// The lists were accepted and the arm stands, but not where it should.
    Elsewhere(Missed),
    /// The arm stands, and there is no progress.
    Stalled {
        /// For how long.
        after: Duration,
    },
    /// The state cannot be read; the motion may continue. With [`NotSent::Disconnected`]: the whole motion
    /// was sent before the connection was lost, and a later connection does not show whether it reached its
    /// end.
    Unreadable(RequestError),
    /// The runtime ended; the motion may continue.
    Abandoned,
}

/// Why nothing proves that an appended list was carried out. The progress of such a list cannot be seen
/// ([`crate::RunOptions::append`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotProved {
    /// The end of its last move cannot be compared with where the arm stands: the move has another tool or
    /// work frame, turns the tool only, or moves an axis that is not read.
    NoTarget,
    /// The arm stands at the end, but nothing shows that this list moved it there.
    WasThere,
    /// The arm stands elsewhere. The list watches an input that may have cut its last move short.
    MayBeCut(Missed),
}

impl fmt::Display for NotProved {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoTarget => {
                f.write_str("where its last move ends cannot be compared with where the arm stands")
            }
            Self::WasThere => f.write_str(
                "the arm stands at its end, where it was before, and nothing shows that this list moved it",
            ),
            Self::MayBeCut(missed) => {
                write!(f, "{missed}; the input that it watches may have cut the move short")
            }
        }
    }
}

/// How many reads may fail in a row. One lost reply says nothing about the arm. But the client does not feed
/// a motion that it cannot see.
const MAX_FAILED: u32 = 3;

impl Cause {
    /// Whether this program itself ended the motion in this way.
    pub(crate) fn was_asked_for(&self) -> bool {
        matches!(self, Self::StoppedHere | Self::Dropped | Self::Released | Self::Closed)
    }

    /// Decides whether a failed read ends the motion. `in_a_row`: how many reads have failed in a row, this
    /// one included.
    pub(crate) fn of_failed_read(error: RequestError, in_a_row: u32) -> Result<(), Self> {
        if in_a_row >= MAX_FAILED || error == RequestError::NotSent(NotSent::Closed) {
            return Err(Self::Unreadable(error));
        }
        Ok(())
    }
}

impl From<NotSent> for Cause {
    fn from(error: NotSent) -> Self {
        Self::NotSent(error)
    }
}

impl From<Invalid> for Cause {
    fn from(error: Invalid) -> Self {
        match error {
            Invalid::OutsideEnvelope(violation) => Self::OutsideEnvelope(violation),
            Invalid::Step(error) => Self::Step(error),
            Invalid::BadAddress { .. }
            | Invalid::Value(_)
            | Invalid::TooLong { .. }
            | Invalid::NotStopped(_) => Self::Invalid(error),
        }
    }
}

impl From<RequestError> for Cause {
    fn from(error: RequestError) -> Self {
        match error {
            RequestError::Invalid(error) => error.into(),
            RequestError::NotSent(error) => error.into(),
            RequestError::Refused(error) => Self::Refused(error),
            RequestError::OutcomeUnknown(error) => Self::OutcomeUnknown(error),
        }
    }
}

impl MotionError {
    /// Whether nothing of the motion was sent.
    #[must_use]
    pub fn nothing_left(&self) -> bool {
        self.progress.left == 0
    }
}

impl fmt::Display for MotionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let progress = &self.progress;
        // An arm that may still move comes before everything else.
        if let Some(Err(error)) = self.stop.as_deref() {
            write!(f, "{error}; the motion: ")?;
        }
        match &self.cause {
            // The step that goes beyond the envelope was not sent.
            Cause::OutsideEnvelope(violation) if !self.nothing_left() => {
                write!(f, "{violation}; this step was not sent")?;
            }
            cause if !self.nothing_left() => {
                write!(f, "step {} of {}: {cause}", progress.current(), progress.total)?;
            }
            cause => cause.fmt(f)?,
        }
        if !self.nothing_left() {
            let sent = progress.under_way();
            write!(f, "; {} done, {sent} sent and not seen to be done", progress.done)?;
            // A followed target always has one more step, so its number of open steps says nothing.
            let queued = progress.total - progress.left;
            if queued > 0 || !matches!(self.cause, Cause::OutsideEnvelope(_)) {
                write!(f, ", {queued} never sent")?;
            }
        }
        match self.stop.as_deref() {
            Some(Ok(report)) => write!(f, "; {report}"),
            Some(Err(_)) | None => Ok(()),
        }
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Step(error) => write!(f, "nothing was sent: {error}"),
            Self::OutsideEnvelope(violation) => write!(f, "nothing was sent: {violation}"),
            Self::NotReady(unmet) => {
                f.write_str("nothing was sent: ")?;
                for (number, unmet) in unmet.iter().enumerate() {
                    write!(f, "{}{unmet}", if number == 0 { "" } else { "; " })?;
                }
                Ok(())
            }
            Self::NotCleared(error) => {
                write!(f, "nothing of the motion was sent, the list that was left over could not be cleared: {error}")
            }
            Self::AnotherRuns => f.write_str(
                "nothing was sent: another motion is being streamed over this connection; wait for its end, or stop it",
            ),
            Self::EarlierFailed(earlier) => write!(
                f,
                "nothing was sent: the motion before this one did not come to its end, and the program has not asked what became of it \
                 ({earlier}); look where the arm is, then run this one again"
            ),
            Self::NotSent(error) => error.fmt(f),
            Self::Invalid(error) => error.fmt(f),
            Self::Refused(error) => error.fmt(f),
            Self::OutcomeUnknown(error) => error.fmt(f),
            Self::AlarmRaised { code } => AlarmAdvice(*code).fmt(f),
            Self::Stopped { mode } => {
                write!(f, "the program does not run any more, the mode is {mode}")
            }
            Self::Restarted(restart) => restart.fmt(f),
            Self::StoppedHere => f.write_str("a stop or a pause was sent over this connection"),
            Self::Dropped => f.write_str("the handle of the motion was dropped"),
            Self::Released => {
                f.write_str("the streaming was ended here; the arm may go on with what is in its list")
            }
            Self::Closed => f.write_str(
                "the robot's handle was closed before the motion was at its end; unless it was stopped, the arm may go on with what \
                 is in its list",
            ),
            Self::NotSeen => f.write_str(
                "the lists were accepted and are gone from the controller, but nothing proves that all of it was carried out: \
                 somebody else may have cleared the list; look where the arm is",
            ),
            Self::NotProved(why) => {
                write!(f, "the list was accepted, but nothing proves that it was carried out: {why}")
            }
            Self::AnotherList { length } => write!(
                f,
                "there are {length} instructions in the list, more than were sent from here: another program sends some, too; \
                 end it, or stop the arm"
            ),
            Self::Elsewhere(missed) => write!(f, "the lists were accepted and the arm stands, but {missed}"),
            Self::Stalled { after } => {
                write!(f, "nothing has gone on for {after:?}: look at the global speed and at the pendant")
            }
            Self::Unreadable(RequestError::NotSent(NotSent::Disconnected)) => f.write_str(
                "the connection was lost after all of it had left; what another connection shows does not tell whether the \
                 motion came to its end: look where the arm is",
            ),
            Self::Unreadable(error) => write!(f, "the state cannot be read: {error}"),
            Self::Abandoned => f.write_str("the runtime ended, and the motion is no longer watched"),
        }
    }
}

impl std::error::Error for MotionError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.cause)
    }
}

impl std::error::Error for Cause {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Step(error) => Some(error),
            Self::OutsideEnvelope(violation) => Some(violation),
            Self::NotCleared(error) | Self::Unreadable(error) => Some(error),
            Self::EarlierFailed(error) => Some(&**error),
            Self::NotSent(error) => Some(error),
            Self::Invalid(error) => Some(error),
            Self::Refused(error) => Some(error),
            Self::OutcomeUnknown(error) => Some(error),
            Self::NotReady(_)
            | Self::AnotherRuns
            | Self::AlarmRaised { .. }
            | Self::Stopped { .. }
            | Self::Restarted(_)
            | Self::StoppedHere
            | Self::Dropped
            | Self::Released
            | Self::Closed
            | Self::NotSeen
            | Self::NotProved(_)
            | Self::AnotherList { .. }
            | Self::Elsewhere(_)
            | Self::Stalled { .. }
            | Self::Abandoned => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_third_failed_read_in_a_row_ends_a_motion_and_a_closed_handle_does_at_once() {
        let lost = RequestError::NotSent(NotSent::Withdrawn);
        for in_a_row in 1..MAX_FAILED {
            assert_eq!(Cause::of_failed_read(lost.clone(), in_a_row), Ok(()));
        }
        assert_eq!(Cause::of_failed_read(lost.clone(), MAX_FAILED), Err(Cause::Unreadable(lost)));
        let closed = RequestError::NotSent(NotSent::Closed);
        assert_eq!(Cause::of_failed_read(closed.clone(), 1), Err(Cause::Unreadable(closed)));
    }
}
