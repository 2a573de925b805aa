//! Clients, controllers, cameras, gateways and disks in one process on virtual time. A seed decides what
//! breaks, and the promises are checked at every step.
//!
//! `make sim` runs worlds. `plan.rs` draws one from a seed; `world.rs` runs it as a turmoil simulation, in
//! steps of a millisecond. `docs/SIMULATION.md` describes the hosts, the promises and the faults.
//! `breaks.toml` has a break of each promise and what has to see it; `make breaks` (`tools/breaks`) tries
//! each in a copy.
//!
//! # What breaks what
//!
//! - **turmoil** is the network and the systems: hosts with a clock and a runtime each, packets that take
//!   time, links that are held, hosts that are killed and started again. It replaces the sockets: the
//!   client's `Connect` and the controller's `Wire` are in `wire.rs`.
//! - **The scenario's link** (`r6-traffic/src/link.rs`, as in `r6 sim --scenario`) breaks bytes: silence,
//!   resets within a frame, pieces, slowness, noise. The virtual controller uses the same code, so users can
//!   try what is tested here.
//! - **The disk** (`disk.rs`) takes the steps of `r6-sim/src/state.rs` one by one (`r6_sim::Disk`). At a
//!   power cut it loses what was not safe by then.
//!
//! # What checks what
//!
//! - `line.rs` observes the wires of a client: `line/departure.rs` sent frames, `line/arrival.rs` received
//!   bytes, `line/lenient.rs` a frame read as tolerantly as possible.
//! - `floor.rs` observes a controller: `floor/list.rs` what it executes, `floor/observed.rs` its values over
//!   time.
//! - `client.rs` and the files of `client/` compare what the client's program hears with both.
//! - `saved_registers.rs` compares registers that were acknowledged as saved with the disk.
//! - `fault_effects.rs` finds which faults took effect, from the events of the controller's log.
//! - `hall.rs` observes a gateway: what its callers ask for and hear, what its disk has, and what leaves it
//!   for the robots. `plan/hall.rs` draws its worlds.
//! - `day.rs` runs a gateway for a day, to see what grows (`make day`). It is no world: nothing is drawn
//!   from a seed, and its network is in memory (`day/network.rs`).
//! - `pulse.rs` ends a world whose clock has stopped.
//! - `plan/trap.rs` makes worlds with a single fault, and `client/mishaps.rs` the mishaps of their motions.
//! - `plan/drivers.rs` makes worlds whose calls are dropped or slow while they drive for others
//!   (`client/driving.rs`). `pipes.rs` knows what was written and not read, and `line/driven.rs` judges it.
#![allow(
    clippy::indexing_slicing,
    reason = "numbers of robots and clients come from the plan that they are numbers of"
)]

mod cabinet;
mod camera;
mod client;
pub mod day;
pub mod disk;
pub mod fault;
mod fault_effects;
mod floor;
mod hall;
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
