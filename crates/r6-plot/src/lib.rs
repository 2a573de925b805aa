//! Plays a motion or a taught program on a virtual controller, and draws what the arm did.
//!
//! [`play::motion`] and [`play::program`] run on a virtual clock and return a [`Recording`]. [`svg`] draws
//! it: axis positions and speeds over time, the points that changed, and the path of the tool. [`words`] puts
//! it into English. The crate opens no file, reads no clock and prints nothing. The same input gives the same
//! bytes.
//!
//! `playback.rs` plays, `recording.rs` and `points.rs` record the arm and the points, `drawing.rs` draws. Of
//! `r6-client` this crate uses only how a motion is cut into frames.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

mod drawing;
mod error;
mod playback;
mod points;
mod recording;
pub mod words;

pub use drawing::{Picture, svg};
pub use error::PlayError;
pub use points::PointTrack;
pub use recording::{Alarm, AxisSummary, Ending, Played, Recording, Sample, Step, Turn};

/// Plays a motion or one pass of a taught program.
pub mod play {
    pub use crate::playback::{Cell, InputChange, LONGEST, Limits, MAX_INSTRUCTIONS, motion, program};
}
