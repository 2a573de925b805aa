//! Reads motion programs, and provides the strict reader for all other files of the product.
//!
//! [`form`] reads a TOML document with the place of every key and value. It reports all mistakes of the
//! document, not only the first. [`MotionProgram`] is the input of `r6 run` and `r6 plot`: steps in TOML, or
//! the AddRCC frames of the manual. The crate does no I/O: texts come in as arguments.
//!
//! # A file
//!
//! `r6 sim --program cell.toml`:
//!
//! 1. `r6/src/cmd/sim/given.rs` reads the text.
//! 2. `taught/read.rs` reads the steps: it asks the tables of the document (`form.rs`; JSON by
//!    `form/json.rs`) for their fields (`form/fields.rs`). Steps that can also be sent are read by `step.rs`
//!    and `step/signals.rs`, as in the files of `r6 run`.
//! 3. A mistake is noted with its place (`mistakes.rs`), and reading continues. So `Failure::in_file`
//!    (`r6/src/exit.rs`) prints a line for each mistake.
//!
//! The same reader serves scenarios (`r6-controller/src/scenario/file.rs`, `fault/file.rs`), profiles
//! (`profile/file.rs`), the limits of `--guard` (`r6/src/cmd/job/guard/file.rs`) and models
//! (`r6-motion/src/robot_model/file.rs`). The lists that `r6 run` sends are in `run.rs` and `json.rs`.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod check;
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
