//! Paths: where the axes are at each point of the way, without time.
//!
//! The length of a path, and every place on it, is counted in seconds at full speed: an axis path is as long
//! as its slowest axis takes at its own full speed, a line or curve as long as the tool takes at full line
//! speed, or at full angular speed if turning takes longer. A place on the path says nothing of when the arm
//! is there: that is the [`profile`](super::profile)'s part. A path that rounds the corner between two others
//! would be one more variant.

mod axis_path;
mod follower;
mod spline;
mod tool_path;
mod track;

pub use axis_path::AxisPath;
pub use tool_path::{CurvePath, LinearPath, Turning};

use super::axes::{ARM_AXES, Axes};

/// A place on a path, as the axes see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathAxes {
    /// Where the axes are.
    pub axes: Axes,
    /// Where they are heading: degrees per second of J1 to J6 if the path is followed at full speed.
    pub slope: [f64; ARM_AXES],
}

/// A planned path. Cheap to ask, cannot fail.
#[derive(Clone, Debug, PartialEq)]
pub enum Path {
    /// Every axis evenly from start to target.
    Axis(AxisPath),
    /// The tool on a straight line.
    Linear(LinearPath),
    /// The tool on an arc.
    Curve(CurvePath),
}

impl Path {
    /// How long it is, seconds at full speed.
    #[must_use]
    pub fn length(&self) -> f64 {
        match self {
            Self::Axis(path) => path.length(),
            Self::Linear(path) => path.length(),
            Self::Curve(path) => path.length(),
        }
    }

    /// The largest fraction of full speed at which no axis exceeds its own full speed, 1 at most.
    #[must_use]
    pub fn top_speed(&self) -> f64 {
        match self {
            Self::Axis(_) => 1.0,
            Self::Linear(path) => path.top_speed(),
            Self::Curve(path) => path.top_speed(),
        }
    }

    /// The axes at a place on the path: the start before it, exactly the end from its length on.
    #[must_use]
    pub fn at(&self, position: f64) -> PathAxes {
        match self {
            Self::Axis(path) => path.at(position),
            Self::Linear(path) => path.at(position),
            Self::Curve(path) => path.at(position),
        }
    }
}
