//! A controller that misbehaves on purpose, in the ways of real controllers. It tests what the client says
//! about an arm.
//!
//! [`Arm`] is the pure core: bytes and times in, bytes and deadlines out. A [`Character`] describes how it
//! misbehaves; the default character behaves. [`serve::HostileController`] serves an arm over tokio streams.
//! The binary `r6-hostile` serves it on a TCP port.
//!
//! The machine is a gantry: `world-n` is `axis-n` plus [`WORLD_OFFSET`], so a linear move is as easy to
//! follow as an axis move. It records where each axis was at any time, so a test can check whether the arm
//! moved after the client said that it stands.

mod agenda;
mod arm;
mod body;
mod character;
mod log;
mod request;
pub mod serve;
mod step;
mod track;

pub use arm::{Arm, Outgoing};
pub use character::{
    Cabinet, Character, Deaf, Delays, Effect, Foreign, Kind, Late, Links, ListLength, Lost, NeverExecuted,
    Program, Reaction, Reboot, Stops, Swap, SwapWhen,
};
pub use log::{Carried, Did, Entry};
pub use track::WORLD_OFFSET;

/// Number of axes on the wire.
pub const AXES: usize = 8;
