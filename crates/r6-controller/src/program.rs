//! Taught programs (molds), and the library of those that one controller has.
//!
//! What a program may say is `r6-program`'s; how the controller carries it out is the machine's.

mod library;

pub use r6_program::taught::{
    Change, Compare, Condition, MAX_NAME_BYTES, MAX_STEPS, MAX_TEXT_BYTES, Photo, Program, Step,
};

pub use library::{Library, LibraryError, MAX_LOADED_BYTES, MAX_PROGRAMS};

#[cfg(test)]
mod tests;
