//! The rows of the table, in its order.

mod allocations;
pub mod at_rest;
mod codec;
mod controller;
pub mod echo;
mod engine;
mod fleet;
pub mod gateway;
mod load;
mod memory;
pub mod modbus;
mod python;
mod redis;
mod round_trip;

pub use self::python::PYTHON;
use crate::report::Row;

/// A name to choose it by, and the function that measures it.
type Measured = (&'static str, fn() -> Vec<Row>);

/// All of them.
pub const ALL: &[Measured] = &[
    ("round-trip", round_trip::rows),
    ("handles", round_trip::handles),
    ("modbus", modbus::rows),
    ("python", python::rows),
    ("engine", engine::rows),
    ("codec", codec::rows),
    ("frames", codec::frames),
    ("allocations", allocations::rows),
    ("controller", controller::rows),
    ("redis", redis::rows),
    ("at-rest", at_rest::rows),
    ("simulated", controller::simulated),
    ("fleet", fleet::rows),
    ("gateway", gateway::rows),
    ("history", gateway::day::rows),
];
