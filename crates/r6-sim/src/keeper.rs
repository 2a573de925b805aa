//! Brings what survives a power cut to the disk, beside the connections and not in their way.
//!
//! Each change gets a number. One task writes the newest state whenever there is a new number, so changes that come while it writes
//! go to the disk together. A connection whose own request changed something holds its frames back until that number is on
//! the disk: what was acknowledged survives. No other connection waits.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use tokio::sync::{Notify, Semaphore};
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
    /// The number of the last change that is on the disk, and who waits for a later one: in their order, where the waiters of a
    /// `watch` would be woken in any.
    durable: AtomicU64,
    written: Notify,
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
        Self { file, changed: Notify::new(), durable: AtomicU64::new(0), written: Notify::new(), writes }
    }

    /// Something has changed.
    pub fn change(&self) {
        self.changed.notify_one();
    }

    /// Waits until this change, and all before it, are on the disk.
    pub async fn durable(&self, number: u64) {
        loop {
            // It counts from here on, not from when it is waited for.
            let written = self.written.notified();
            if self.durable.load(Ordering::Acquire) >= number {
                return;
            }
            written.await;
        }
    }

    /// Writes whatever changes, for as long as it runs.
    pub async fn run(&self, controller: &ControllerHandle) {
        let mut failing = false;
        loop {
            let (number, state) = controller.saved();
            if self.durable.load(Ordering::Acquire) >= number {
                self.changed.notified().await;
                continue;
            }
            let Ok(_permit) = self.writes.acquire().await else { return };
            match self.file.write_beside(number, state).await {
                Some(Ok(())) => {
                    if failing {
                        info!(file = %self.file.path().display(), "the state can be written again");
                    }
                    failing = false;
                    self.durable.store(number, Ordering::Release);
                    self.written.notify_waiters();
                }
                Some(Err(error)) => {
                    if !failing {
                        warn!(%error, "nothing that changes the state is acknowledged until it can be written");
                    }
                    failing = true;
                    tokio::time::sleep(RETRY_AFTER).await;
                }
                // The runtime ends.
                None => return,
            }
        }
    }

    /// Writes what has changed since the last write: the simulation ends in good order.
    pub fn finish(&self, controller: &ControllerHandle) -> Result<(), StateError> {
        let (number, state) = controller.saved();
        self.file.write(number, &state)
    }
}
