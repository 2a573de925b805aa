//! A virtual R6 / HC1 controller as a pure function of bytes and time.
//!
//! [`Controller`] is one cabinet: bytes of its connections and points in time go in, frames and deadlines
//! come out. Behind it is a [`machine::Machine`] whose state is a function of time: it goes from event to
//! event, and positions in between are computed on request. A [`Profile`] describes how one firmware differs
//! from another.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

mod answer;
pub mod controller;
pub mod event;
pub mod fast_clock;
pub mod fault;
pub mod instruction_list;
pub mod io;
pub mod log;
pub mod machine;
pub mod mode;
pub mod panel;
pub mod profile;
pub mod program;
pub mod saved;
pub mod scenario;
pub mod settings;
pub mod snapshot;

pub use controller::{ConnectionId, Controller, FaultInForce};
pub use event::{Event, Level};
pub use fast_clock::FastClock;
pub use log::LogEntry;
pub use mode::{Key, StartState};
pub use panel::{Button, PanelAction, Refused};
pub use profile::Profile;
pub use program::{Library, LibraryError, Program};
pub use r6_motion::robot_model::{AxisMotion, RobotModel};
pub use r6_program::Mistakes;
pub use r6_proto::OperationMode;
pub use saved::{SavedError, SavedState};
pub use scenario::Scenario;
pub use settings::ControllerSettings;
pub use snapshot::{ControllerSnapshot, ProgramStep};
