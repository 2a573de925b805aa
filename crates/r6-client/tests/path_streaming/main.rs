//! Paths that are streamed into virtual controllers, over real sockets: no pause, no step twice, and to the
//! end.
//!
//! Tests that look for pauses use tokio's paused clock, and the controller runs on that clock as in real
//! life. It advances as fast as the machine can compute, so a slow machine only makes the test take longer.
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests too")]

mod cell;
mod relay;

mod ends;
mod gated;
mod guarded;
mod honest;
mod long;
mod reckoned;
mod stops;
mod unknown;
mod whole;
