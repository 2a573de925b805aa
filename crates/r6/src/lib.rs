//! The part of the command line that reads values with their units, without a terminal. The command line
//! itself is `main.rs`.

pub mod units;
