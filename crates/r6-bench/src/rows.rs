//! The rows of the table, in its order.

mod codec;
mod controller;
pub mod echo;
mod engine;
mod fleet;
mod python;
mod round_trip;

use crate::report::Row;

/// A name to choose it by, and what measures it.
type Measured = (&'static str, fn() -> Vec<Row>);

/// All of them.
pub const ALL: &[Measured] = &[
    ("round-trip", round_trip::rows),
    ("handles", round_trip::handles),
    ("python", python::rows),
    ("engine", engine::rows),
    ("codec", codec::rows),
    ("frames", codec::frames),
    ("controller", controller::rows),
    ("simulated", controller::simulated),
    ("fleet", fleet::rows),
];
