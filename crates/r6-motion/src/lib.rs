//! What an arm can do: its geometry, its limits, and where every axis is at any instant of a move.
//!
//! Everything here is a pure function of its arguments. Nothing ticks: a planned [`Movement`] is asked for
//! the state at a time and answers it at once, whatever was asked before.
//!
//! Three parts that know nothing of one another, and one that joins them: [`path`] is geometry without time,
//! [`profile`] is time along one number without geometry, [`kinematics`] turns axes into poses and back;
//! [`movement`] puts a path under a profile.
//!
//! Units everywhere: degrees, millimetres, seconds.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod axes;
pub mod drive;
pub mod error;
pub mod kinematics;
pub mod movement;
pub mod path;
pub mod pose;
pub mod profile;
pub mod robot_model;

pub use axes::{ARM_AXES, AXES, Axes, AxisNumber, MoveMask};
pub use drive::AxisMotions;
pub use error::{LimitSide, NotFinite, PlanError};
pub use kinematics::{Frames, InverseError};
pub use movement::{Blend, Conditions, MotionState, Move, MoveSpeed, MoveTarget, Movement};
pub use path::Turning;
pub use pose::{Frame, Pose};
pub use profile::Ramps;
pub use robot_model::{Geometry, Masses, RobotModel};
