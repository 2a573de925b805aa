//! The state of a machine at a glance, and what keeps it from taking instructions.

use std::fmt;

use r6_proto::OperationMode;
use r6_proto::address::Address;
use r6_proto::alarm::AlarmCode;
use r6_proto::axis::{AXES, AxisIndex};
use r6_proto::message::instruction::{Action, Instruction};

use crate::evidence::Sample;
use crate::moves::step_error::StepError;
use crate::query::result::QueryResult;

/// Axes and pose components that are asked for: the arms of this protocol have six at most, external axes apart.
pub(crate) const ASKED_AXES: usize = 6;

/// The state of a machine. `None` where the controller has no such value or sent one that cannot be read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Status {
    /// `version`.
    pub firmware: Option<String>,
    /// `machineName`.
    pub machine_name: Option<String>,
    /// `curMold`: the program; only the pendant's port tells.
    pub program: Option<String>,
    /// `curMode`.
    pub mode: Option<OperationMode>,
    /// `curAlarm`: 0 for none.
    pub alarm: Option<i64>,
    /// `origin`.
    pub homed: Option<bool>,
    /// `isMoving`.
    pub moving: Option<bool>,
    /// `axisNum`.
    pub axis_count: Option<i64>,
    /// `axis-0` to `axis-5`, degrees; the last two are never asked for.
    pub axes: [Option<f64>; AXES],
    /// `world-0` to `world-5`: X, Y, Z in mm, U, V, W in degrees; the last two are never asked for.
    pub pose: [Option<f64>; AXES],
    /// `RemoteCmdLen`: instructions left in the instruction list (from 207beta25 on).
    pub list_length: Option<i64>,
    /// `curCycle`, seconds.
    pub cycle: Option<f64>,
    /// `lastCycle`, seconds.
    pub last_cycle: Option<f64>,
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

impl Status {
    /// What a query says of it.
    pub(crate) fn of(read: &QueryResult) -> Self {
        let text = |address| read.text(address).map(str::to_owned);
        Self {
            firmware: text(Address::Version),
            machine_name: text(Address::MachineName),
            program: text(Address::CurMold),
            mode: read.integer(Address::CurMode).map(OperationMode::of_number),
            alarm: read.integer(Address::CurAlarm),
            homed: read.flag(Address::Origin),
            moving: read.flag(Address::IsMoving),
            axis_count: read.integer(Address::AxisNum),
            axes: components(read, Address::Axis),
            pose: components(read, Address::World),
            list_length: read.integer(Address::RemoteCmdLen),
            cycle: read.decimal(Address::CurCycle),
            last_cycle: read.decimal(Address::LastCycle),
        }
    }

    /// What keeps the machine from taking instructions, the most telling first; empty if nothing does.
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

    /// What no value tells, where nothing is unmet.
    ///
    /// `remote_program` names a program of which the caller knows that it does nothing but wait for remote commands. Where the
    /// controller tells its program (`curMold`, on the pendant's port), mode 7 and this name together prove the step.
    #[must_use]
    pub fn unproved(&self, remote_program: Option<&str>) -> Vec<Unproved> {
        let waits = remote_program.is_some() && self.program.as_deref() == remote_program;
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

    /// The first axis move that takes an axis somewhere which this robot does not have by its `axisNum`: nobody could see it arrive.
    /// Zeros are let through, for people write all eight.
    pub(crate) fn step_beyond_axes(&self, steps: &[Instruction]) -> Option<StepError> {
        const FIELDS: [&str; AXES] = ["m0", "m1", "m2", "m3", "m4", "m5", "m6", "m7"];
        let count = usize::try_from(self.axis_count.filter(|count| *count > 0)?).ok()?;
        steps.iter().zip(1..).find_map(|(step, number)| {
            let Action::AxisMove(motion) = &step.action else { return None };
            let goes = |axis: AxisIndex| {
                motion.target.at(axis).is_some_and(|place| place != 0.0)
                    && motion.manner.mask.is_none_or(|mask| mask.contains(axis))
            };
            let (_, field) =
                AxisIndex::ALL.into_iter().zip(FIELDS).skip(count).find(|(axis, _)| goes(*axis))?;
            let wanted = "left out: by its axisNum this robot has fewer axes";
            Some(StepError { step: number, field, wanted, nearest: None })
        })
    }

    /// What it tells about motion.
    pub(crate) fn sample(&self) -> Sample {
        Sample {
            moving: self.moving,
            alarm: self.alarm,
            mode: self.mode,
            list_length: self.list_length,
            axes: self.axes,
            pose: self.pose,
        }
    }

    /// Whether nothing that can be read keeps the machine from taking instructions. It is no proof that it takes them
    /// ([`Self::readiness`]): where the program is at another step, they fail or wait.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.unmet().is_empty()
    }
}

/// The first six of `axis-n` or `world-n`.
pub(crate) fn components(
    result: &QueryResult,
    address: impl Fn(AxisIndex) -> Address,
) -> [Option<f64>; AXES] {
    AxisIndex::ALL.map(|axis| result.decimal(address(axis)))
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
pub(crate) struct AlarmAdvice(pub i64);

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
