//! The state of a machine at a glance, and the reasons why it does not take instructions.

use r6_proto::address::Address;
use r6_proto::axis::{AXES, AxisIndex};
use r6_proto::message::instruction::{Action, Instruction};
pub(crate) use r6_proto::readiness::AlarmAdvice;
use r6_proto::readiness::ReadinessFacts;
pub use r6_proto::readiness::{Readiness, Unmet, Unproved};
use r6_proto::{OperationMode, Reading};

use crate::evidence::Sample;
use crate::moves::step_error::StepError;
use crate::query::result::QueryResult;

/// How many axes and pose components are asked for: the arms of this protocol have at most six, without
/// external axes.
pub(crate) const ASKED_AXES: usize = 6;

/// The state of a machine. `None` if the controller has no such value or sent an unreadable one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Status {
    /// `version`.
    pub firmware: Option<String>,
    /// `machineName`.
    pub machine_name: Option<String>,
    /// `curMold`: the program; only the pendant's port reports it.
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
    /// `axis-0` to `axis-5`: J1 is `axes[0]`. Degrees, or mm if an axis slides, which no address reports. The
    /// last two are never asked for.
    pub axes: [Option<f64>; AXES],
    /// `world-0` to `world-5`: X, Y, Z in mm, U, V, W in degrees; the last two are never asked for.
    pub pose: [Option<f64>; AXES],
    /// `RemoteCmdLen`: instructions left in the instruction list (from 207beta25 on).
    pub list_length: Option<i64>,
    /// Whether a `RemoteCmdLen` came that cannot be read: the list may have instructions.
    pub list_is_unreadable: bool,
    /// `curCycle`, seconds.
    pub cycle: Option<f64>,
    /// `lastCycle`, seconds.
    pub last_cycle: Option<f64>,
}

impl Status {
    /// The status from a query.
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
            list_is_unreadable: read.left_in_list().is_err(),
            cycle: read.decimal(Address::CurCycle),
            last_cycle: read.decimal(Address::LastCycle),
        }
    }

    /// The value of one of the addresses above, if it is known.
    #[must_use]
    pub fn reading(&self, address: Address) -> Option<Reading> {
        let component =
            |values: &[Option<f64>; AXES], axis: AxisIndex| values.get(axis.index()).copied().flatten();
        match address {
            Address::Version => self.firmware.clone().map(Reading::Text),
            Address::MachineName => self.machine_name.clone().map(Reading::Text),
            Address::CurMold => self.program.clone().map(Reading::Text),
            Address::CurMode => self.mode.map(|mode| Reading::Integer(mode.number())),
            Address::CurAlarm => self.alarm.map(Reading::Integer),
            Address::Origin => self.homed.map(Reading::Flag),
            Address::IsMoving => self.moving.map(Reading::Flag),
            Address::AxisNum => self.axis_count.map(Reading::Integer),
            Address::Axis(axis) => component(&self.axes, axis).map(Reading::Decimal),
            Address::World(axis) => component(&self.pose, axis).map(Reading::Decimal),
            Address::RemoteCmdLen => self.list_length.map(Reading::Integer),
            Address::CurCycle => self.cycle.map(Reading::Decimal),
            Address::LastCycle => self.last_cycle.map(Reading::Decimal),
            // The status has no other addresses.
            _ => None,
        }
    }

    /// The facts that decide whether the machine takes instructions.
    fn facts(&self) -> ReadinessFacts<'_> {
        ReadinessFacts {
            program: self.program.as_deref(),
            mode: self.mode,
            alarm: self.alarm,
            homed: self.homed,
            moving: self.moving,
            list_length: self.list_length,
            list_is_unreadable: self.list_is_unreadable,
        }
    }

    /// [`ReadinessFacts::unmet`] of this state.
    #[must_use]
    pub fn unmet(&self) -> Vec<Unmet> {
        self.facts().unmet()
    }

    /// [`ReadinessFacts::unproved`] of this state.
    #[must_use]
    pub fn unproved(&self, remote_program: Option<&str>) -> Vec<Unproved> {
        self.facts().unproved(remote_program)
    }

    /// [`ReadinessFacts::readiness`] of this state.
    #[must_use]
    pub fn readiness(&self, remote_program: Option<&str>) -> Readiness {
        self.facts().readiness(remote_program)
    }

    /// The first axis move that moves an axis which this robot lacks by its `axisNum`: its arrival could not
    /// be seen. Zeros are allowed, because people write all eight.
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

    /// The values about motion.
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

    /// Whether no readable value keeps the machine from taking instructions. This does not prove that it
    /// takes them ([`Self::readiness`]): if the program is at another step, instructions fail or wait.
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
