//! Why the mode changed, an alarm was raised, a list was not taken, or an event of a scenario did not happen.

use r6_proto::OperationMode;
use serde::Serialize;

use super::{AtStep, Detail, Reason, as_text};
use crate::panel::Refused;

/// Why the mode changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ModeReason {
    /// The program was started.
    Started,
    /// The key was turned.
    KeyTurned,
    /// `actionStop`.
    ActionStop,
    /// `actionPause`.
    ActionPause,
    /// The stop button.
    StopButton,
    /// An alarm.
    Alarm,
    /// A single step has ended.
    SingleStep,
    /// A single step had no step to run.
    SingleStepWithoutStep,
    /// The program has ended.
    ProgramEnded,
    /// The program has nothing to run.
    ProgramIsEmpty,
}

/// Why an alarm was raised.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "cause", rename_all = "snake_case")]
pub enum AlarmCause {
    /// No heartbreak came in time.
    NoHeartbreak {
        /// How long none came, in seconds.
        seconds: f64,
    },
    /// An operator raised it at the panel.
    Panel,
    /// The scenario raised it.
    Scenario,
    /// A list was replaced while the arm moved.
    ListReplacedInMotion,
    /// The arm was moved by hand to its soft limit.
    MovedToLimit,
    /// This firmware raises it after `actionStop`.
    ActionStop,
    /// The emergency stop was pressed.
    EmergencyStop {
        /// The mode that the machine is in now.
        #[serde(serialize_with = "as_text")]
        mode: OperationMode,
    },
    /// A step waited longer than its limit.
    WaitedTooLong {
        /// The limit in seconds.
        limit: f64,
        /// What the alarm means.
        meaning: Detail,
    },
    /// A step could not be carried out.
    Step {
        /// The step; `None` if the arm passes through several without stopping.
        step: Option<AtStep>,
        /// Why.
        why: Reason,
    },
    /// Something else.
    Other {
        /// What it is.
        why: Detail,
    },
}

/// Why an event of a scenario did not happen.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "because", rename_all = "snake_case")]
pub enum DidNot {
    /// The machine refused it.
    Refused {
        /// Why.
        #[serde(serialize_with = "as_text")]
        why: Refused,
    },
    /// Too many input changes are pending.
    TooManyInputs,
    /// There are already too many counters.
    TooManyCounters {
        /// The limit.
        limit: usize,
    },
}

/// Why a list is not taken.
#[derive(Clone, Debug, PartialEq)]
pub enum ListRefusal {
    /// No such action is known.
    UnknownAction(i64),
    /// This firmware does not know one of the actions.
    UnsupportedAction,
    /// The list has more instructions than the instruction list can still take.
    NoRoom,
    /// It would have replaced the list while the arm moves: alarm 200.
    InMotion,
    /// No program waits for remote commands.
    NotArmed,
    /// The program that would take it could not be started.
    NotStarted(Refused),
    /// The list is full: a fault.
    ListFull,
    /// An instruction in the middle was not taken: a fault.
    InTheMiddle,
}
