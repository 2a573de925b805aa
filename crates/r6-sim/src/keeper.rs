//! Saves the state that survives a power cut on the disk, in parallel with the connections.
//!
//! Each change gets a number. One task writes the newest state whenever there is a new number, so changes
//! during a write go to the disk together. If a request of a connection changed something, the frames of that
//! connection wait until that number is on the disk: acknowledged changes survive. No other connection waits.
//!
//! # What survives a power cut
//!
//! - `r6-controller/src/saved.rs` is the state that survives. Its fields are `Persistent`
//!   (`machine/persistent.rs`), which notices every mutable borrow.
//! - This file is the task that writes, and `state.rs` the file that it writes.
//! - `connection.rs` holds frames back until their changes are on the disk.

use std::path::Path;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use r6_controller::event::{Detail, ShellEvent};
use tokio::sync::{Notify, Semaphore};

use crate::handle::ControllerHandle;
use crate::state::{StateError, StateFile};

/// How long to wait after a failed write, for the disk to have room again. Until then no change is
/// acknowledged.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// How long a write may take before the log says so. Until it ends, nothing that changes the state is
/// acknowledged.
const SLOW_WRITE: Duration = Duration::from_secs(2);

/// How often the log repeats that the state cannot be written, while that lasts.
const TOLD_AGAIN_AFTER: Duration = Duration::from_secs(60);

/// How long the last write may take at the end. A disk that does not answer must not keep the program from
/// ending with an error.
pub(crate) const FINISH_TIME: Duration = Duration::from_secs(10);

/// How many files all controllers together write at once: more do not make a disk faster.
const WRITES_AT_ONCE: usize = 8;

/// The part of the writing task that the controller and its connections share.
#[derive(Debug)]
pub(crate) struct Keeper {
    file: StateFile,
    changed: Notify,
    /// The number of the last change on the disk, and the notification for tasks that wait for a later one.
    /// `Notify` wakes them in order; a `watch` would wake them in any order.
    durable: AtomicU64,
    written: Notify,
    writes: Arc<Semaphore>,
}

/// The number of the last change, and the mark of the state at that time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Changes {
    pub number: u64,
    pub mark: u64,
}

impl Keeper {
    /// The limit of concurrent writes for all keepers of a simulation.
    pub fn writes() -> Arc<Semaphore> {
        Arc::new(Semaphore::new(WRITES_AT_ONCE))
    }

    pub fn new(file: StateFile, writes: Arc<Semaphore>) -> Self {
        Self { file, changed: Notify::new(), durable: AtomicU64::new(0), written: Notify::new(), writes }
    }

    /// The path of the file.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Says that the state has changed.
    pub fn change(&self) {
        self.changed.notify_one();
    }

    /// Waits until this change, and all before it, are on the disk.
    pub async fn durable(&self, number: u64) {
        loop {
            // Created before the check, so that a notification in between is not lost.
            let written = self.written.notified();
            if self.durable.load(Ordering::Acquire) >= number {
                return;
            }
            written.await;
        }
    }

    /// Writes all changes while this runs.
    pub async fn run(&self, controller: &ControllerHandle) {
        let mut trouble = Trouble::default();
        loop {
            let (number, state) = controller.saved();
            if self.durable.load(Ordering::Acquire) >= number {
                self.changed.notified().await;
                continue;
            }
            let Ok(_permit) = self.writes.acquire().await else { return };
            let write = pin!(self.file.write_beside(number, state));
            match trouble.watch(controller, &self.file, write).await {
                Some(Ok(())) => {
                    trouble.is_over(controller, &self.file);
                    self.durable.store(number, Ordering::Release);
                    self.written.notify_waiters();
                }
                Some(Err(error)) => {
                    trouble.tell(controller, &error);
                    tokio::time::sleep(RETRY_AFTER).await;
                }
                // The runtime ends.
                None => return,
            }
        }
    }

    /// Writes the changes since the last write, when the simulation ends in good order.
    pub fn finish(&self, controller: &ControllerHandle) -> Result<(), StateError> {
        let (number, state) = controller.saved();
        self.file.write(number, &state)
    }
}

/// What the log says about a state that cannot be written.
#[derive(Debug, Default)]
struct Trouble {
    /// When the log last said so; `None` without trouble.
    told: Option<tokio::time::Instant>,
}

impl Trouble {
    /// Waits for a write, and logs a write that does not end.
    async fn watch<T>(
        &mut self,
        controller: &ControllerHandle,
        file: &StateFile,
        mut write: Pin<&mut impl Future<Output = T>>,
    ) -> T {
        let begun = tokio::time::Instant::now();
        loop {
            tokio::select! {
                biased;
                written = &mut write => return written,
                () = tokio::time::sleep(SLOW_WRITE) => {
                    let seconds = begun.elapsed().as_secs();
                    let path = file.path().display();
                    self.tell(controller, &format_args!("{path} has not been written for {seconds} s: the disk does not answer"));
                }
            }
        }
    }

    /// Logs why the state cannot be written, unless it did so a short time ago.
    fn tell(&mut self, controller: &ControllerHandle, why: &dyn std::fmt::Display) {
        if self.told.is_none_or(|told| told.elapsed() >= TOLD_AGAIN_AFTER) {
            self.told = Some(tokio::time::Instant::now());
            controller.tell(None, ShellEvent::StateNotWritten { why: Detail::of(why) });
        }
    }

    /// Logs that the state was written, if there was trouble before.
    fn is_over(&mut self, controller: &ControllerHandle, file: &StateFile) {
        if self.told.take().is_some() {
            controller.tell(None, ShellEvent::StateWritten { path: Detail::of(file.path().display()) });
        }
    }
}
