//! The kinematics of every model against arithmetic that is not the crate's own.

mod chains;
mod common;
mod four_axes;
mod lines;
mod round_trip;
