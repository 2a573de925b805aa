//! Traffic of the remote protocol: what was said, what is wrong with it, and what happens to it on its way.
//!
//! - [`recording`] finds the frames in what was captured, and writes transcripts.
//! - [`conversation`] pairs replies with their requests.
//! - [`judge`] says what is wrong with a frame.
//! - [`link`] brings the [`fault`]s of a link about, drawn from a seed ([`random`]).
//!
//! There is no I/O, no clock and no task in this crate: bytes, points in time and seeds come in; frames,
//! findings and bytes go out.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod conversation;
pub mod fault;
pub mod judge;
pub mod link;
pub mod random;
pub mod recording;
