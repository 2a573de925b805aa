//! Whether a machine accepts instructions: the conditions, and what its values show about them.

use std::fmt;

use crate::address::Address;
use crate::alarm::AlarmCode;
use crate::mode::OperationMode;

/// The values that show whether a machine accepts instructions. `None` if the controller has no such value,
/// or if the value cannot be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadinessFacts<'s> {
    /// `curMold`: the program. Only the pendant's port reports it.
    pub program: Option<&'s str>,
    /// `curMode`.
    pub mode: Option<OperationMode>,
    /// `curAlarm`: 0 means no alarm.
    pub alarm: Option<i64>,
    /// `origin`.
    pub homed: Option<bool>,
    /// `isMoving`.
    pub moving: Option<bool>,
    /// `RemoteCmdLen`: instructions left in the instruction list (from 207beta25 on).
    pub list_length: Option<i64>,
    /// Whether a `RemoteCmdLen` came that cannot be read. This is not firmware without it.
    pub list_is_unreadable: bool,
}

/// A condition for sending instructions that does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unmet {
    /// The mode is not 7.
    Mode {
        /// The current mode.
        found: OperationMode,
    },
    /// There is an alarm.
    Alarm {
        /// Its number.
        code: i64,
    },
    /// The machine is not homed.
    NotHomed,
    /// The machine moves.
    Moving,
    /// Old instructions are left in the list.
    LeftoverList {
        /// How many.
        length: i64,
    },
    /// The caller named a program, and the controller runs another one.
    OtherProgram,
    /// A required value is not known.
    Unknown {
        /// Its address.
        address: Address,
    },
}

/// A condition for sending instructions that no value proves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unproved {
    /// Whether the program is in the step that waits for remote commands (action 1004). No firmware has an
    /// address for the step. Mode 7 only shows that some program runs. An empty list, a standing arm and the
    /// answer `ok` occur in every step.
    RemoteStep,
    /// How many instructions are left in the list. `RemoteCmdLen` cannot be read (before 207beta25).
    ListLength,
}

/// Whether a machine accepts instructions, as far as its values prove it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Readiness {
    /// Every condition holds, and a value proves each of them.
    Ready,
    /// These conditions are not met.
    NotReady(Vec<Unmet>),
    /// Every readable condition holds. No value proves these conditions.
    Unknown(Vec<Unproved>),
}

impl ReadinessFacts<'_> {
    /// The conditions that do not hold, in the order in which to deal with them; empty if all hold.
    ///
    /// An unknown value counts as not holding, except a length of the list that did not come, because older
    /// firmware cannot report it. Empty does not mean ready: see [`Self::readiness`].
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
        let list = match self.list_length {
            _ if self.list_is_unreadable => unknown(Address::RemoteCmdLen),
            None | Some(0) => None,
            Some(length) => Some(Unmet::LeftoverList { length }),
        };
        // The order in which to deal with them: a leftover list would run at the next start.
        [moving, list, alarm, homed, mode].into_iter().flatten().collect()
    }

    /// The conditions that no value proves, independent of [`Self::unmet`].
    ///
    /// `remote_program` is the name of a program that only waits for remote commands, as the caller knows. If
    /// the controller reports its program (`curMold`, on the pendant's port), mode 7 and this name together
    /// prove the step.
    #[must_use]
    pub fn unproved(&self, remote_program: Option<&str>) -> Vec<Unproved> {
        let waits = remote_program.is_some() && self.program == remote_program;
        let step = (!waits).then_some(Unproved::RemoteStep);
        let list_is_untold = self.list_length.is_none() && !self.list_is_unreadable;
        let list = list_is_untold.then_some(Unproved::ListLength);
        step.into_iter().chain(list).collect()
    }

    /// [`Self::unmet`], and whether the controller reports another program than `remote_program`.
    #[must_use]
    pub fn unmet_with(&self, remote_program: Option<&str>) -> Vec<Unmet> {
        let other = self.program.is_some() && remote_program.is_some() && self.program != remote_program;
        self.unmet().into_iter().chain(other.then_some(Unmet::OtherProgram)).collect()
    }

    /// Whether the machine accepts instructions, as far as its values prove it. For `remote_program` see
    /// [`Self::unproved`]. If the controller reports another program, the machine is not ready.
    #[must_use]
    pub fn readiness(&self, remote_program: Option<&str>) -> Readiness {
        let (unmet, unproved) = (self.unmet_with(remote_program), self.unproved(remote_program));
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
                "the operation mode is {found}, not running (7): start the program. At the pendant, in Auto, turn Cycle on and press \
                 Start; or, with no person near the arm, send startButton (`r6 command startButton`, `robot.start()`). The program \
                 must then be at its \"wait for remote commands\" step"
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
            Self::OtherProgram => f.write_str("the controller runs another program than the one named"),
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

/// Displays an alarm's number with its meaning and remedy.
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
