//! Why a move cannot be planned.

use std::fmt;

use super::axes::AxisNumber;

/// The error of a coordinate that is not finite, or far beyond the reach of any arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotFinite;

impl fmt::Display for NotFinite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number is not finite or beyond all reach")
    }
}

impl std::error::Error for NotFinite {}

/// One end of an axis' range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitSide {
    /// The end with the larger angle.
    Plus,
    /// The end with the smaller angle.
    Minus,
}

/// Why a move cannot be planned. Nothing has moved then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanError {
    /// An axis would leave its soft limits, at the target or on the way to it.
    OutsideLimits {
        /// The axis.
        axis: AxisNumber,
        /// The end of its range.
        side: LimitSide,
    },
    /// No axis positions put the tool there, at the target or on the way to it.
    Unreachable,
    /// On the way, this axis would have to turn faster than it can, even at a very low path speed: a wrist,
    /// elbow or shoulder singularity.
    Singular {
        /// The axis that would have to turn.
        axis: AxisNumber,
    },
    /// Start, middle and end of a curve do not define a circle. Either the end is the start, or all three lie
    /// on one line with the middle outside.
    CurvePoints,
    /// The speed or the global speed is not above zero, not finite, or so small that the move would not end.
    Speed,
    /// A coordinate, frame or delay is not finite or beyond all reach.
    NotFinite,
}

impl From<NotFinite> for PlanError {
    fn from(_: NotFinite) -> Self {
        Self::NotFinite
    }
}

impl fmt::Display for PlanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutsideLimits { axis, side: LimitSide::Plus } => {
                write!(f, "{axis} above its upper soft limit")
            }
            Self::OutsideLimits { axis, side: LimitSide::Minus } => {
                write!(f, "{axis} below its lower soft limit")
            }
            Self::Unreachable => f.write_str("out of reach"),
            Self::Singular { axis } => write!(f, "singular: {axis} cannot follow"),
            Self::CurvePoints => f.write_str("the three points of the curve give no circle"),
            Self::Speed => f.write_str("the speed is not above zero"),
            Self::NotFinite => NotFinite.fmt(f),
        }
    }
}

impl std::error::Error for PlanError {}
