//! Traffic of the remote protocol: its content, its problems, and the faults of its links.
//!
//! - [`recording`] finds the frames in a capture, and writes transcripts.
//! - [`conversation`] pairs replies with their requests.
//! - [`judge`] finds the problems of a frame.
//! - [`link`] applies the [`fault`]s of a link, drawn from a seed ([`random`]).
//!
//! This crate has no I/O, no clock and no task: bytes, points in time and seeds come in; frames, findings and
//! bytes go out.
//!
//! # A capture
//!
//! `r6 inspect capture.txt`:
//!
//! 1. `r6/src/cmd/inspect.rs` reads the file, and prints what was found.
//! 2. [`recording`] finds the frames in its bytes: in a transcript (`recording/transcript.rs`, which also
//!    writes them), or in raw bytes or a log (`recording/log.rs`).
//! 3. [`judge`] takes the frames in their order. It decodes each, and asks [`conversation`] for the request
//!    that a reply answers.
//! 4. `judge/checks.rs` looks for problems. `judge/problem.rs` has a variant for each `Problem`, and its
//!    English sentence.
//!
//! Live traffic can take the same way without [`recording`]: its frames come from a `FrameBuffer`.
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
