//! What drives the connection of a robot while a call waits.

use std::sync::Arc;

use r6_client::blocking;

use crate::line::Line;

/// What drives a connection.
#[derive(Clone)]
pub enum Driver {
    /// The calling threads, for a `Robot`. A call that waits for more than this connection waits on the
    /// engine.
    Threads(blocking::Driver),
    /// The event loop of the calling tasks, for an `AsyncRobot`.
    EventLoop(Arc<Line>),
    /// The engine of the process, for a controller that connects to this program.
    Engine,
}

impl Driver {
    /// Makes sure that work is driven that no call waits for.
    pub fn look_after(&self) {
        match self {
            Self::Threads(driver) => driver.look_after(),
            // The engine always runs.
            Self::EventLoop(_) | Self::Engine => {}
        }
    }
}
