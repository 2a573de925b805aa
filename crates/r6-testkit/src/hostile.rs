//! A controller that misbehaves on purpose, as real ones do: for tests of what the client says about an arm.
//!
//! [`Arm`] is the pure core: bytes and times in, bytes and deadlines out. A [`Character`] says in which ways
//! it misbehaves; the default one behaves. [`serve::HostileController`] puts an arm behind streams of tokio,
//! the binary `r6-hostile` behind a TCP port.
//!
//! The machine is a gantry: `world-n` is `axis-n` plus [`WORLD_OFFSET`], so a linear move is as easy to
//! follow as an axis move. It keeps track of where each axis was at any time, so a test can ask whether the
//! arm moved after the client said that it stands.

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

/// Axes of the wire.
pub const AXES: usize = 8;
