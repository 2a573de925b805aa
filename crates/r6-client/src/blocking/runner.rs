//! The runtime or thread that runs the calls of a blocking robot.

use std::future::Future;
use std::sync::Arc;

use super::Engine;
use crate::hands::blocking::StdHand;

/// Drives the connection while a call waits.
pub(super) enum Runner {
    /// The calling thread.
    Own(Arc<StdHand>),
    /// A tokio runtime inside this client.
    Engine(Engine),
}

impl Runner {
    /// Runs a future of the robot to its end on this thread.
    pub fn block_on<F: Future>(&self, future: F) -> F::Output {
        match self {
            Self::Own(hand) => hand.block_on(future),
            Self::Engine(engine) => engine.block_on(future),
        }
    }

    /// Handles at once what was started or given up outside of [`Self::block_on`].
    pub fn look_after(&self) {
        match self {
            Self::Own(hand) => hand.look_after(),
            // The engine's thread is woken by the change.
            Self::Engine(_) => {}
        }
    }

    /// Closes the connection once no motion is streamed over it any more.
    pub fn close_later(&self, robot: &crate::Robot) {
        let closing = robot.clone();
        match self {
            Self::Own(hand) => {
                robot.errand(async move {
                    closing.nothing_streams().await;
                    closing.close_now().await;
                });
                hand.look_after();
            }
            Self::Engine(engine) => {
                let kept = engine.clone();
                engine.handle().spawn(async move {
                    closing.nothing_streams().await;
                    closing.close().await;
                    drop(kept);
                });
            }
        }
    }

    pub fn engine(&self) -> Option<&Engine> {
        match self {
            Self::Own(_) => None,
            Self::Engine(engine) => Some(engine),
        }
    }
}
