//! The decisions of streams of values: what a reader gets next, and whether a reader that comes back missed
//! something.
//!
//! All robots share one count of changes, so one number says how far a reader has read.
//!
//! - [`numbers`]: which values of a robot changed after a number.
//! - [`point`]: the place in a stream, as a text that a client sends back.
//! - [`follower`]: what a reader has, and what it gets of each robot.

pub mod flood;
pub mod follower;
pub mod numbers;
pub mod point;
#[cfg(test)]
mod tests;
