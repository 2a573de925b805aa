//! Brings what survives a power cut to the disk, beside the connections and not in their way.
//!
//! Each change gets a number. One task writes the newest state whenever there is a new number, so changes that come while it writes
//! go to the disk together. A connection whose own request changed something holds its frames back until that number is on
//! the disk: what was acknowledged survives. No other connection waits.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{Notify, Semaphore, watch};
use tracing::{info, warn};

use crate::handle::ControllerHandle;
use crate::state::{StateError, StateFile};

/// After a write that failed, a disk gets this long to have room again. Until then nothing is acknowledged.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// How many files are written at once by all controllers together: a disk does not become faster by more.
const WRITES_AT_ONCE: usize = 8;

/// What the controller and its connections see of the task that writes.
#[derive(Debug)]
pub(crate) struct Keeper {
    file: StateFile,
    changed: Notify,
    durable: watch::Sender<u64>,
    writes: Arc<Semaphore>,
}

/// The number of the last change, and how the state was recognised then.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Changes {
    pub number: u64,
    pub mark: u64,
}

impl Keeper {
    /// As many writes at once as all keepers of a simulation may do.
    pub fn writes() -> Arc<Semaphore> {
        Arc::new(Semaphore::new(WRITES_AT_ONCE))
    }

    pub fn new(file: StateFile, writes: Arc<Semaphore>) -> Self {
        Self { file, changed: Notify::new(), durable: watch::Sender::new(0), writes }
    }

    /// Something has changed.
    pub fn change(&self) {
        self.changed.notify_one();
    }

    /// Waits until this change, and all before it, are on the disk.
    pub async fn durable(&self, number: u64) {
        // The sender lives in `self`.
        let _ = self.durable.subscribe().wait_for(|durable| *durable >= number).await;
    }

    /// Writes whatever changes, for as long as it runs.
    pub async fn run(&self, controller: &ControllerHandle) {
        let mut failing = false;
        loop {
            let (number, state) = controller.saved();
            if *self.durable.borrow() >= number {
                self.changed.notified().await;
                continue;
            }
            let file = self.file.clone();
            let Ok(_permit) = self.writes.acquire().await else { return };
            let written = tokio::task::spawn_blocking(move || file.write(number, &state)).await;
            match written {
                Ok(Ok(())) => {
                    if failing {
                        info!(file = %self.file.path().display(), "the state can be written again");
                    }
                    failing = false;
                    self.durable.send_replace(number);
                }
                Ok(Err(error)) => {
                    if !failing {
                        warn!(%error, "nothing that changes the state is acknowledged until it can be written");
                    }
                    failing = true;
                    tokio::time::sleep(RETRY_AFTER).await;
                }
                // The runtime ends.
                Err(_) => return,
            }
        }
    }

    /// Writes what has changed since the last write: the simulation ends in good order.
    pub fn finish(&self, controller: &ControllerHandle) -> Result<(), StateError> {
        let (number, state) = controller.saved();
        self.file.write(number, &state)
    }
}
