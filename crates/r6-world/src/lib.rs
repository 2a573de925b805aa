//! Clients, controllers, cameras and disks in one process on virtual time. A seed decides what breaks, and
//! the promises are checked at every step.
//!
//! Each of them is a host of a simulated network (turmoil) with a clock of its own. `docs/SIMULATION.md`
//! describes the hosts.
#![allow(
    clippy::indexing_slicing,
    reason = "numbers of robots and clients come from the plan that they are numbers of"
)]

mod cabinet;
mod camera;
mod client;
pub mod disk;
pub mod fault;
mod fault_effects;
mod floor;
mod line;
mod pipes;
pub mod plan;
mod pulse;
pub mod record;
pub mod report;
mod saved_registers;
mod shared;
mod wire;
pub mod world;
