//! The kinematics of every model, compared with calculations that are not the crate's own.

mod chains;
mod common;
mod four_axes;
mod lines;
mod round_trip;
