//! How to wait for the end of a motion, what proves that end, and why it may not come.

use std::fmt;
use std::time::Duration;

use r6_proto::OperationMode;
use r6_proto::axis::AXES;

use crate::error::{NotSent, RequestError};
use crate::evidence::restart::Restart;
use crate::evidence::{Interrupted, Sample};
use crate::path::place::Missed;
use crate::status::AlarmAdvice;
use crate::stream::error::{Cause, MotionError};

/// How to wait until a motion has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaitOptions {
    /// The pause between the answer to one read of the state and the next read. Default 50 ms, which real
    /// controllers tolerate for hours. There is no minimum: with 0 the state is read as fast as answers come.
    pub interval: Duration,
    /// How long to wait at most. Default 60 s.
    pub timeout: Duration,
    /// How long the arm has to stand if the controller cannot tell the length of its list. Default 500 ms,
    /// because arms stand up to a third of a second in a corner that is not blended.
    pub settle: Duration,
    /// If no motion was seen within this time, there was no motion, or it was shorter than the interval.
    /// Default 1 s. Make it longer than the longest delay or wait before the first move.
    pub start_within: Duration,
    /// The mode in which this controller waits for instructions. Default running (7). Some controllers switch
    /// between auto (2) and running on their own (reported, unit B).
    pub idle_mode: OperationMode,
}

impl Default for WaitOptions {
    fn default() -> Self {
        Self {
            interval: Duration::from_millis(50),
            timeout: Duration::from_secs(60),
            settle: Duration::from_millis(500),
            start_within: Duration::from_secs(1),
            idle_mode: OperationMode::Running,
        }
    }
}

/// A motion has ended: the arm stands, without alarm, and as far as the controller tells, its list is done.
///
/// [`Self::proof`] says what was observed. All of it was read over the connection that the motion was sent
/// on.
#[derive(Clone, Debug, PartialEq)]
pub struct Done {
    /// The motion, as numbered by [`crate::MotionHandle::number`]; `None` if
    /// [`crate::Robot::wait_until_done`] watched a motion that no [`crate::Robot::run`] of this handle had
    /// sent.
    pub motion: Option<u64>,
    /// What proves the end.
    pub proof: EndProof,
    /// `axis-0` to `axis-5`: J1 is `axes[0]`. Degrees, or mm if an axis slides; `None` where not known.
    pub axes: [Option<f64>; AXES],
    /// `world-0` to `world-5`, mm and degrees; `None` where not known.
    pub pose: [Option<f64>; AXES],
    /// The operation mode.
    pub mode: Option<OperationMode>,
    /// Whether a look saw the arm move, or a list that was not empty.
    pub moved: bool,
    /// How long it took from the first read on.
    pub took: Duration,
}

impl Done {
    /// From the last look at a motion. `took`: the time since the first read.
    pub(crate) fn of(
        motion: Option<u64>,
        proof: EndProof,
        seen: &Sample,
        moved: bool,
        took: Duration,
    ) -> Self {
        let Sample { axes, pose, mode, .. } = *seen;
        Self { motion, proof, axes, pose, mode, moved, took }
    }
}

/// What proves that a motion has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EndProof {
    /// The arm stands where the last move ends, and it moved, or was elsewhere before. Exception: if the
    /// motion leads to where the arm already stands, [`Done::moved`] may be false.
    Reached,
    /// The end of the last move cannot be compared (another tool or work frame), but the controller was seen
    /// to work through its list step by step, down to the last one.
    Consumed,
    /// The arm stands short of the end of the last move, which an input may cut short
    /// ([`crate::Motion::stop_on_input`]).
    CutShort(Missed),
    /// The arm stands with an empty list, as far as the controller tells. Where the motion should have ended
    /// is unknown or does not apply. A motion without a move ends like this, and so does any motion that
    /// [`crate::Robot::wait_until_done`] watches.
    AtRest,
}

impl EndProof {
    /// Its word, for programs.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Reached => "reached",
            Self::Consumed => "consumed",
            Self::CutShort(_) => "cut_short",
            Self::AtRest => "at_rest",
        }
    }

    /// Where the last move should have ended and where the arm stands, if an input cut that move short.
    #[must_use]
    pub const fn cut_short(&self) -> Option<&Missed> {
        match self {
            Self::CutShort(missed) => Some(missed),
            Self::Reached | Self::Consumed | Self::AtRest => None,
        }
    }
}

/// Why waiting ended without the motion having ended as it should.
#[derive(Clone, Debug, PartialEq)]
pub enum WaitError {
    /// There is an alarm.
    AlarmRaised {
        /// Its number.
        code: i64,
    },
    /// The program does not run (any more): it was stopped, paused, or never started.
    Stopped {
        /// The mode the controller is in.
        mode: OperationMode,
    },
    /// The connection was lost, and the controller seems to have been switched off and on.
    Restarted(Restart),
    /// The motion had not ended when the time was up.
    TimedOut {
        /// The time limit.
        after: Duration,
        /// Instructions left in the list, if the controller tells.
        list_length: Option<i64>,
    },
    /// The state cannot be read; the motion may continue.
    Request(RequestError),
    /// The connection that the motion was sent on is lost, or another robot answers. The present state does
    /// not show whether the motion came to its end.
    AnotherConnection,
    /// The awaited motion of this handle did not come to its end.
    Motion(Box<MotionError>),
}

impl fmt::Display for WaitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AlarmRaised { code } => {
                write!(
                    f,
                    "{}; clear the list too, or the rest of it may run at the next start",
                    AlarmAdvice(*code)
                )
            }
            Self::Stopped { mode } => write!(
                f,
                "the program does not run, the mode is {mode}: clear the list, or the rest of it may run at the next start; \
                 then press Start on the pendant"
            ),
            Self::Restarted(restart) => restart.fmt(f),
            Self::TimedOut { after, list_length } => {
                write!(f, "the motion has not ended within {after:?}")?;
                if let Some(length) = list_length {
                    let are = if *length == 1 { "instruction is" } else { "instructions are" };
                    write!(f, ", {length} {are} left")?;
                }
                f.write_str("; wait longer or stop it (instructions that are not one-shot never end)")
            }
            Self::Request(error) => write!(f, "the state cannot be read, the motion may go on: {error}"),
            Self::AnotherConnection => f.write_str(
                "the connection that the motion was sent on is lost; what another one shows does not tell whether the \
                 motion came to its end: look at the arm",
            ),
            Self::Motion(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for WaitError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Request(error) => Some(error),
            Self::Motion(error) => Some(&**error),
            Self::AlarmRaised { .. }
            | Self::Stopped { .. }
            | Self::Restarted(_)
            | Self::TimedOut { .. }
            | Self::AnotherConnection => None,
        }
    }
}

impl From<Interrupted> for WaitError {
    fn from(interrupted: Interrupted) -> Self {
        match interrupted {
            Interrupted::ByAlarm { code } => Self::AlarmRaised { code },
            Interrupted::ByMode { mode } => Self::Stopped { mode },
        }
    }
}

impl From<Interrupted> for Cause {
    fn from(interrupted: Interrupted) -> Self {
        WaitError::from(interrupted).into()
    }
}

impl From<WaitError> for Cause {
    fn from(error: WaitError) -> Self {
        match error {
            WaitError::AlarmRaised { code } => Self::AlarmRaised { code },
            WaitError::Stopped { mode } => Self::Stopped { mode },
            WaitError::Restarted(restart) => Self::Restarted(restart),
            WaitError::TimedOut { after, .. } => Self::Stalled { after },
            WaitError::Request(error) => Self::Unreadable(error),
            WaitError::AnotherConnection => Self::Unreadable(NotSent::Disconnected.into()),
            WaitError::Motion(error) => error.cause,
        }
    }
}
