//! Where a step ends, as far as its position tells.

use std::fmt;

use r6_proto::axis::{AXES, AxisIndex, AxisMask};
use r6_proto::message::Action;
use r6_proto::message::instruction::{Coordinates, Manner};

use crate::evidence::Sample;
use crate::status::ASKED_AXES;

/// How far an axis may end from its target, degrees. Real arms end within 0.001 (reported, unit A).
const AXIS_TOLERANCE: f64 = 0.05;

/// How far the tool may end from its target, mm. Real arms end within 0.005 (reported, unit B).
const POSITION_TOLERANCE: f64 = 0.1;

/// Where a step ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Place {
    /// These axes at these angles.
    Axes(Coordinates, AxisMask),
    /// The tool at this position. The orientation is not compared, because one orientation has many triples
    /// of angles.
    Position(Coordinates, AxisMask),
    /// The step does not move the arm.
    Same,
    /// The step moves the arm, but its end is not known here, because the position refers to another tool or
    /// work frame.
    Unknown,
}

/// An axis, or a component of the pose, that is not where the motion should have ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Missed {
    /// The axis or component.
    pub axis: AxisIndex,
    /// Whether it is a component of the pose (mm) and not an axis.
    pub of_pose: bool,
    /// The position where it should be.
    pub wanted: f64,
    /// The position where it is; `None` if it could not be read.
    pub found: Option<f64>,
}

impl Missed {
    /// Its name: `J1`, or `X` of the pose.
    #[must_use]
    pub fn name(&self) -> String {
        if self.of_pose { self.axis.world_name().to_owned() } else { self.axis.to_string() }
    }
}

impl fmt::Display for Missed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The protocol does not say whether an axis turns or slides.
        let unit = if self.of_pose { "mm" } else { "deg or mm" };
        let Self { wanted, .. } = self;
        match self.found {
            Some(found) => write!(f, "{} is at {found:.3}, not at {wanted:.3} {unit}", self.name()),
            None => write!(f, "{} should be at {wanted:.3} {unit} and cannot be read", self.name()),
        }
    }
}

impl Place {
    /// Where this step ends.
    pub fn of(action: &Action) -> Self {
        match action {
            Action::AxisMove(step) => Self::Axes(step.target, moved(&step.manner, &step.target)),
            Action::LinearMove(step) => Self::position(&step.manner, step.target),
            Action::CurveMove(curve) => Self::position(&curve.manner, curve.end),
            Action::PathSpeed(_)
            | Action::Wait(_)
            | Action::Output(_)
            | Action::BoardOutput(_)
            | Action::StopOnSignal(_)
            | Action::Workbench(_) => Self::Same,
            Action::Unknown(_) => Self::Unknown,
        }
    }

    fn position(manner: &Manner, end: Coordinates) -> Self {
        if manner.tool.is_some() || manner.coord.is_some() {
            return Self::Unknown;
        }
        Self::Position(end, moved(manner, &end).and(AxisMask::POSITION))
    }

    /// The pairs to compare, axis by axis: the axis, where it should be, where it is.
    fn compared(&self, sample: &Sample) -> impl Iterator<Item = (AxisIndex, f64, Option<f64>)> {
        let (wanted, mask, values) = match self {
            Self::Axes(wanted, mask) => (*wanted, *mask, sample.axes),
            Self::Position(wanted, mask) => (*wanted, *mask, sample.pose),
            Self::Same | Self::Unknown => (Coordinates::default(), AxisMask::NONE, [None; AXES]),
        };
        AxisIndex::ALL.into_iter().take(ASKED_AXES).filter(move |axis| mask.contains(*axis)).filter_map(
            move |axis| Some((axis, wanted.at(axis)?, values.get(axis.index()).copied().flatten())),
        )
    }

    /// The first axis that is not where the step ends, or else the first axis that could not be read. `None`
    /// if the arm is there, or if nothing can be compared.
    pub fn missed(&self, sample: &Sample) -> Option<Missed> {
        let of_pose = matches!(self, Self::Position(..));
        let tolerance = if of_pose { POSITION_TOLERANCE } else { AXIS_TOLERANCE };
        let missed = |(axis, wanted, found)| Missed { axis, of_pose, wanted, found };
        // NaN is not at the wanted position either.
        let is_there =
            |missed: &Missed| missed.found.is_some_and(|found| (found - missed.wanted).abs() <= tolerance);
        let is_known = |missed: &Missed| missed.found.is_some();
        let mut elsewhere = self.compared(sample).map(missed).filter(is_known);
        elsewhere
            .find(|missed| !is_there(missed))
            .or_else(|| self.compared(sample).map(missed).find(|missed| !is_known(missed)))
    }

    /// Whether everything that the step moves can be compared with the values read. Axes beyond the sixth are
    /// not read, and a turn of the tool is not compared.
    pub fn is_compared(&self) -> bool {
        let is_read = |mask: &AxisMask| {
            mask.axes().next().is_some() && mask.axes().all(|axis| axis.index() < ASKED_AXES)
        };
        match self {
            Self::Axes(_, mask) | Self::Position(_, mask) => is_read(mask),
            Self::Same | Self::Unknown => false,
        }
    }

    /// For each coordinate, the end of the step and the present value; `None` if the sample lacks one of
    /// them.
    pub fn beside(&self, sample: &Sample) -> Option<Vec<(AxisIndex, f64, f64)>> {
        let all: Option<Vec<_>> =
            self.compared(sample).map(|(axis, wanted, found)| Some((axis, wanted, found?))).collect();
        all.filter(|all| !all.is_empty())
    }
}

fn moved(manner: &Manner, given: &Coordinates) -> AxisMask {
    manner.mask.unwrap_or(AxisMask::ALL).and(given.given())
}
