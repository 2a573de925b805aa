//! Brings what survives a power cut to the disk, beside the connections and not in their way.
//!
//! Each change gets a number. One task writes the newest state whenever there is a new number, so changes that come while it writes
//! go to the disk together. A connection whose own request changed something holds its frames back until that number is on
//! the disk: what was acknowledged survives. No other connection waits.

use std::path::Path;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use r6_controller::event::{Detail, ShellEvent};
use tokio::sync::{Notify, Semaphore};

use crate::handle::ControllerHandle;
use crate::state::{StateError, StateFile};

/// After a write that failed, a disk gets this long to have room again. Until then nothing is acknowledged.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// How long a write may take before that is told: until then nothing that changes the state is acknowledged.
const SLOW_WRITE: Duration = Duration::from_secs(2);

/// How long after it was told that the state cannot be written it is told again, while that lasts.
const TOLD_AGAIN_AFTER: Duration = Duration::from_secs(60);

/// How long the last write may take, at the end. A disk that does not answer must not keep the program from ending, and saying so.
pub(crate) const FINISH_TIME: Duration = Duration::from_secs(10);

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

    /// The file.
    pub fn path(&self) -> &Path {
        self.file.path()
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

    /// Writes what has changed since the last write: the simulation ends in good order.
    pub fn finish(&self, controller: &ControllerHandle) -> Result<(), StateError> {
        let (number, state) = controller.saved();
        self.file.write(number, &state)
    }
}

/// What the log was told of a state that cannot be written.
#[derive(Debug, Default)]
struct Trouble {
    /// When it was told last; `None` while there is none.
    told: Option<tokio::time::Instant>,
}

impl Trouble {
    /// Waits for a write, and tells of one that does not end.
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

    /// Tells why the state cannot be written, unless that was told a little while ago.
    fn tell(&mut self, controller: &ControllerHandle, why: &dyn std::fmt::Display) {
        if self.told.is_none_or(|told| told.elapsed() >= TOLD_AGAIN_AFTER) {
            self.told = Some(tokio::time::Instant::now());
            controller.tell(None, ShellEvent::StateNotWritten { why: Detail::of(why) });
        }
    }

    /// The state was written.
    fn is_over(&mut self, controller: &ControllerHandle, file: &StateFile) {
        if self.told.take().is_some() {
            controller.tell(None, ShellEvent::StateWritten { path: Detail::of(file.path().display()) });
        }
    }
}
