//! What drives the connection of a robot while a call waits for it.

use std::sync::Arc;

use r6_client::blocking;

use crate::line::Line;

/// What drives a connection.
#[derive(Clone)]
pub enum Driver {
    /// The threads that call, for a `Robot`. Whatever waits for more than this connection waits on the engine.
    Threads(blocking::Driver),
    /// The event loop whose tasks call, for an `AsyncRobot`.
    EventLoop(Arc<Line>),
    /// The engine of the process, for a controller that dials.
    Engine,
}

impl Driver {
    /// Something was begun that no call waits for.
    pub fn look_after(&self) {
        match self {
            Self::Threads(driver) => driver.look_after(),
            // The engine is always there.
            Self::EventLoop(_) | Self::Engine => {}
        }
    }
}
