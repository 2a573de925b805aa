//! Reads motion programs, and provides the strict reader for all other files of the product.
//!
//! [`form`] reads a TOML document with the place of every key and value. It reports all mistakes of the
//! document, not only the first. [`MotionProgram`] is the input of `r6 run` and `r6 plot`: steps in TOML, or
//! the AddRCC frames of the manual. The crate does no I/O: texts come in as arguments.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod form;
mod json;
mod kind;
mod lines;
mod mistakes;
mod run;
mod step;
pub mod taught;

pub use kind::FileKind;
pub use mistakes::{MAX_MISTAKES, Mistake, Mistakes};
pub use r6_proto::nearest;
pub use run::{MAX_FILE_BYTES, MotionList, MotionProgram};
pub use step::{axis_mask, eight, first_axes};
