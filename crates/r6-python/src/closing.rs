//! Closing a connection without losing a stop that was asked for (`stop_on_drop`): what is closed can stop nobody.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use r6_client::{Progress, Robot};
use tokio::sync::watch;
use tokio::time::timeout;

/// How long closing waits for the arm to be stopped: a stop is tried for 5 s; the rest is for the list that it clears.
const STOPPED_WITHIN: Duration = Duration::from_secs(10);

/// Motions of one connection that are to be stopped when nobody holds them any more.
#[derive(Default)]
pub struct StopOnDrop {
    /// The sender goes once a motion, and the stop that may follow it, is over. One runs at a time: there are few.
    living: Mutex<Vec<watch::Receiver<Progress>>>,
}

impl StopOnDrop {
    /// Keeps a motion in mind until it is over.
    pub fn add(&self, motion: watch::Receiver<Progress>) {
        let mut living = self.living.lock().unwrap_or_else(PoisonError::into_inner);
        living.retain(lives);
        living.push(motion);
    }

    /// Stops the arm if one of them lives, and closes the connection.
    pub async fn close(&self, robot: Robot) {
        let mut living = std::mem::take(&mut *self.living.lock().unwrap_or_else(PoisonError::into_inner));
        living.retain(lives);
        // Out of time, or a stop that failed: the connection ends all the same, as who closes it wants.
        let _ = timeout(STOPPED_WITHIN, async {
            // One that has ended and still lives is being stopped.
            if living.iter().any(|motion| !motion.borrow().ended) {
                let _ = robot.stop().await;
            }
            for mut motion in living {
                while motion.changed().await.is_ok() {}
            }
        })
        .await;
        robot.close().await;
    }
}

fn lives(motion: &watch::Receiver<Progress>) -> bool {
    motion.has_changed().is_ok()
}
