//! Taught programs (molds), and the library of programs of one controller.
//!
//! `r6-program` defines the language of programs; the machine carries them out.

mod library;

pub use r6_program::taught::{
    Change, Compare, Condition, MAX_NAME_BYTES, MAX_STEPS, MAX_TEXT_BYTES, Photo, Program, Step,
};

pub use library::{Library, LibraryError, MAX_LOADED_BYTES, MAX_PROGRAMS};

#[cfg(test)]
mod tests;
