//! Paths: the axes at each position along the way, without time.
//!
//! The length of a path, and every position on it, is measured in seconds at full speed. An axis path takes
//! as long as its slowest axis at its own full speed. A line or curve takes as long as the tool at full line
//! speed, or at full angular speed if turning takes longer. When the arm is at a position is the matter of
//! the [`profile`](super::speed_profile). A path that rounds the corner between two others would be one more
//! variant.

mod axis_path;
mod follower;
mod spline;
mod tool_path;
mod track;

pub use axis_path::AxisPath;
pub use tool_path::{CurvePath, LinearPath, Turning};

use super::axes::{ARM_AXES, Axes};

/// The axes at a position on a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathAxes {
    /// The positions of the axes.
    pub axes: Axes,
    /// Their slopes: degrees per second of J1 to J6 if the path is followed at full speed.
    pub slope: [f64; ARM_AXES],
}

/// A planned path. Queries are cheap and cannot fail.
#[derive(Clone, Debug, PartialEq)]
pub enum Path {
    /// Every axis moves evenly from start to target.
    Axis(AxisPath),
    /// The tool moves on a straight line.
    Linear(LinearPath),
    /// The tool moves on an arc.
    Curve(CurvePath),
}

impl Path {
    /// The length in seconds at full speed.
    #[must_use]
    pub fn length(&self) -> f64 {
        match self {
            Self::Axis(path) => path.length(),
            Self::Linear(path) => path.length(),
            Self::Curve(path) => path.length(),
        }
    }

    /// The largest fraction of full speed at which no axis exceeds its own full speed, at most 1.
    #[must_use]
    pub fn top_speed(&self) -> f64 {
        match self {
            Self::Axis(_) => 1.0,
            Self::Linear(path) => path.top_speed(),
            Self::Curve(path) => path.top_speed(),
        }
    }

    /// The axes at a position on the path: the start before it, exactly the end from its length on.
    #[must_use]
    pub fn at(&self, position: f64) -> PathAxes {
        match self {
            Self::Axis(path) => path.at(position),
            Self::Linear(path) => path.at(position),
            Self::Curve(path) => path.at(position),
        }
    }
}
