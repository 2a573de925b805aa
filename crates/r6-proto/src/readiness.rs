//! Whether a machine takes instructions: the conditions, and what its values tell of them.

use std::fmt;

use crate::address::Address;
use crate::alarm::AlarmCode;
use crate::mode::OperationMode;

/// The values that tell whether a machine takes instructions. `None` where the controller has no such value or sent one that cannot
/// be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadinessFacts<'s> {
    /// `curMold`: the program; only the pendant's port tells.
    pub program: Option<&'s str>,
    /// `curMode`.
    pub mode: Option<OperationMode>,
    /// `curAlarm`: 0 for none.
    pub alarm: Option<i64>,
    /// `origin`.
    pub homed: Option<bool>,
    /// `isMoving`.
    pub moving: Option<bool>,
    /// `RemoteCmdLen`: instructions left in the instruction list (from 207beta25 on).
    pub list_length: Option<i64>,
}

/// A condition that has to hold before instructions are sent, and does not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unmet {
    /// The mode is not 7.
    Mode {
        /// The mode it has.
        found: OperationMode,
    },
    /// There is an alarm.
    Alarm {
        /// Its number.
        code: i64,
    },
    /// The machine does not know its origin.
    NotHomed,
    /// The machine moves.
    Moving,
    /// Instructions are left from before.
    LeftoverList {
        /// How many.
        length: i64,
    },
    /// A value that has to be known is not.
    Unknown {
        /// Its address.
        address: Address,
    },
}

/// A condition that has to hold before instructions are sent, and of which no value tells whether it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unproved {
    /// Whether the program sits in its step that waits for remote commands (action 1004). No address tells the step, on any firmware:
    /// mode 7 says that some program runs, and an empty list, an arm that stands and an answer `ok` go with every step.
    RemoteStep,
    /// How many instructions are left in the list: `RemoteCmdLen` cannot be read (before 207beta25).
    ListLength,
}

/// Whether a machine takes instructions, as far as its values prove it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Readiness {
    /// Every condition is met, and a value proves each.
    Ready,
    /// These conditions are not met.
    NotReady(Vec<Unmet>),
    /// Every condition that can be read is met. Of these no value tells.
    Unknown(Vec<Unproved>),
}

impl ReadinessFacts<'_> {
    /// What keeps the machine from taking instructions, in the order in which they are to be dealt with; empty if nothing does.
    ///
    /// A value that is not known counts against it, the length of the list apart: older firmware cannot tell it.
    /// Empty does not mean ready: see [`Self::readiness`].
    #[must_use]
    pub fn unmet(&self) -> Vec<Unmet> {
        let unknown = |address| Some(Unmet::Unknown { address });
        let alarm = match self.alarm {
            Some(0) => None,
            Some(code) => Some(Unmet::Alarm { code }),
            None => unknown(Address::CurAlarm),
        };
        let mode = match self.mode {
            Some(OperationMode::Running) => None,
            Some(found) => Some(Unmet::Mode { found }),
            None => unknown(Address::CurMode),
        };
        let homed = match self.homed {
            Some(true) => None,
            Some(false) => Some(Unmet::NotHomed),
            None => unknown(Address::Origin),
        };
        let moving = match self.moving {
            Some(false) => None,
            Some(true) => Some(Unmet::Moving),
            None => unknown(Address::IsMoving),
        };
        let list =
            self.list_length.filter(|length| *length != 0).map(|length| Unmet::LeftoverList { length });
        // In the order in which they are to be dealt with: a list that is left over starts with the next start.
        [moving, list, alarm, homed, mode].into_iter().flatten().collect()
    }

    /// The conditions of which no value tells, whatever else is unmet.
    ///
    /// `remote_program` names a program of which the caller knows that it does nothing but wait for remote commands. Where the
    /// controller tells its program (`curMold`, on the pendant's port), mode 7 and this name together prove the step.
    #[must_use]
    pub fn unproved(&self, remote_program: Option<&str>) -> Vec<Unproved> {
        let waits = remote_program.is_some() && self.program == remote_program;
        let step = (!waits).then_some(Unproved::RemoteStep);
        let list = self.list_length.is_none().then_some(Unproved::ListLength);
        step.into_iter().chain(list).collect()
    }

    /// Whether the machine takes instructions, as far as its values prove it; `remote_program` as for [`Self::unproved`].
    #[must_use]
    pub fn readiness(&self, remote_program: Option<&str>) -> Readiness {
        let (unmet, unproved) = (self.unmet(), self.unproved(remote_program));
        match (unmet.is_empty(), unproved.is_empty()) {
            (false, _) => Readiness::NotReady(unmet),
            (true, false) => Readiness::Unknown(unproved),
            (true, true) => Readiness::Ready,
        }
    }
}

impl fmt::Display for Unmet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mode { found: found @ OperationMode::Auto } => write!(
                f,
                "the operation mode is {found}, not running (7): in Auto turn Cycle on at the pendant and press Start, or, with \
                 nobody near the arm, send the command startButton; the program must wait in its \"wait for remote commands\" step"
            ),
            Self::Mode { found } => write!(
                f,
                "the operation mode is {found}, not running (7): on the pendant switch to Auto, turn Cycle on and press \
                 Start; the program must wait in its \"wait for remote commands\" step"
            ),
            Self::Alarm { code } => write!(f, "{}", AlarmAdvice(*code)),
            Self::NotHomed => f.write_str(
                "the machine is not homed: establish the origin on the pendant, with the way to it clear",
            ),
            Self::Moving => f.write_str("the machine moves: wait until it stands, or stop it"),
            Self::LeftoverList { length } => write!(
                f,
                "{length} {} left in the list and would run first: clear the list, or wait until it is done",
                if *length == 1 { "instruction is" } else { "instructions are" }
            ),
            Self::Unknown { address } => write!(
                f,
                "`{address}` cannot be read, and it has to be known first: look at the pendant, and at the raw reply"
            ),
        }
    }
}

impl fmt::Display for Unproved {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::RemoteStep => "whether the program sits in its \"wait for remote commands\" step",
            Self::ListLength => "whether instructions are left in the list",
        })
    }
}

/// An alarm's number with what it means and what to do about it.
#[derive(Clone, Copy, Debug)]
pub struct AlarmAdvice(pub i64);

impl fmt::Display for AlarmAdvice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match u32::try_from(self.0) {
            Ok(code) => {
                let alarm = AlarmCode(code).decode();
                write!(f, "{alarm}: {}", alarm.remedy)
            }
            Err(_negative) => {
                write!(f, "alarm {}, which is no alarm's number: read the pendant's display", self.0)
            }
        }
    }
}
