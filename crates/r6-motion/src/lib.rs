//! The motion of an arm: its geometry, its limits, and the position of every axis at any instant of a move.
//!
//! Everything here is a pure function of its arguments. There are no ticks: a planned [`Movement`] computes
//! its state at any time directly, independent of earlier calls.
//!
//! Three parts are independent: [`path`] is geometry without time, [`speed_profile`] is time along one number
//! without geometry, [`kinematics`] converts axes to poses and back. [`movement`] combines them: a path with
//! a profile.
//!
//! Units everywhere: degrees, millimetres, seconds.
//!
//! # How the arithmetic is checked
//!
//! `README.md` of this crate lists its properties and their tests. The stage `oracles` of `make check`
//! compares it with two libraries that share no code with it. `tools/oracles/kinematics` builds every model
//! as a chain of ikpy. `tools/oracles/trajectories` lets ruckig plan the moves that `examples/moves.rs`
//! prints. Both are tools of these checks only; nothing that ships uses them.
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
pub mod robot_model;
pub mod speed_profile;

pub use axes::{ARM_AXES, AXES, Axes, AxisNumber, MoveMask};
pub use drive::AxisMotions;
pub use error::{LimitSide, NotFinite, PlanError};
pub use kinematics::{Frames, InverseError};
pub use movement::{Blend, Conditions, MotionState, Move, MoveSpeed, MoveTarget, Movement};
pub use path::Turning;
pub use pose::{Frame, Pose};
pub use robot_model::{Geometry, Masses, RobotModel};
pub use speed_profile::Ramps;
