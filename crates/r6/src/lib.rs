//! The parts of the command line that read what users write, without a terminal: the files of `r6 run`, and values with their
//! units. The command line itself is `main.rs`.

pub mod program_file;
pub mod units;
