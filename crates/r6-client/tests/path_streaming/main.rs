//! Paths that are streamed into virtual controllers, over real sockets: without a pause, without a doublet, to their end.
//!
//! Where pauses are looked for, time is tokio's paused clock and the controller runs on it as in the world: it goes as
//! fast as the machine can, and a slow machine changes nothing but how long the test takes.
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests too")]

mod cell;
mod relay;

mod ends;
mod guarded;
mod honest;
mod long;
mod reckoned;
mod stops;
mod unknown;
mod whole;
