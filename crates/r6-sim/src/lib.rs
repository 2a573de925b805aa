//! Virtual R6 / HC1 controllers on TCP ports.
//!
//! This is the shell around [`r6_controller::Controller`]: listeners, one task per connection, one task for
//! the timers of each controller, and the [`panel`] over HTTP. It holds no robot logic. Controllers can also
//! be reached in memory without a network ([`Simulation::start_in_memory`]), or over any other [`Wire`]
//! ([`ControllerHandle::serve`]).
//!
//! ```
//! # tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap().block_on(async {
//! let simulation = r6_sim::Simulation::start(r6_sim::SimSettings::default()).await?;
//! println!("listening on {}", simulation.controllers()[0].address());
//! simulation.shutdown().await?;
//! # Ok::<(), Box<dyn std::error::Error>>(()) }).unwrap();
//! ```

mod camera;
mod clock;
mod connection;
mod disk;
mod door;
mod handle;
mod keeper;
mod memory;
pub mod panel;
mod settings;
mod simulation;
mod state;
mod virtual_controller;
mod wire;

pub use camera::{BadCamera, Camera, MAX_CAMERAS};
pub use clock::{BadClock, Clock};
pub use disk::{Disk, DiskStep};
pub use handle::ControllerHandle;
pub use memory::{MEMORY_BYTES, MemoryStream};
pub use settings::{SimError, SimSettings};
pub use simulation::Simulation;
pub use state::StateError;
pub use virtual_controller::{Builder, VirtualController};
pub use wire::Wire;
