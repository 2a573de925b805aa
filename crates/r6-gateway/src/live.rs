//! What changes: the values of the robots, and what happens to them.
//!
//! No reader has a queue of its own. A reader of values gets what changed since it looked last, a reader of
//! events what is behind its last one in a log of bounded length. So a slow reader costs no memory, and
//! delays no other.

pub mod board;
pub mod far;
pub mod happened;
pub mod news;
