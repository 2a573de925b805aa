//! Traffic of the remote protocol: its content, its problems, and the faults of its links.
//!
//! - [`recording`] finds the frames in a capture, and writes transcripts.
//! - [`conversation`] pairs replies with their requests.
//! - [`judge`] finds the problems of a frame.
//! - [`link`] applies the [`fault`]s of a link, drawn from a seed ([`random`]).
//!
//! This crate has no I/O, no clock and no task: bytes, points in time and seeds come in; frames, findings and
//! bytes go out.
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
