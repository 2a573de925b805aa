//! Watches that the clock of a world advances. A host that loops without waiting stops the clock, and the
//! world never ends.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::Duration;

/// One step of a world takes a millisecond or less of real time. Even on a busy computer it never takes this
/// long.
const STANDS_STILL: Duration = Duration::from_secs(30);

/// Watches the clock of a world from a separate thread, until this value is dropped.
///
/// A thread that never waits cannot be ended from outside. If the clock stops, the watcher prints the seed
/// and ends the process.
#[derive(Debug)]
pub struct Pulse {
    steps: Arc<AtomicU64>,
    /// Dropping it ends the watcher.
    _over: Sender<()>,
}

impl Pulse {
    /// Watches the world of this seed. `kind`: the other arguments of `make sim`.
    #[must_use]
    pub fn of(seed: u64, kind: String) -> Self {
        let steps = Arc::new(AtomicU64::new(0));
        let (over, ended) = mpsc::channel();
        let seen = Arc::clone(&steps);
        thread::spawn(move || {
            let mut before = None;
            while ended.recv_timeout(STANDS_STILL) == Err(RecvTimeoutError::Timeout) {
                let now = seen.load(Ordering::Relaxed);
                if before.replace(now) == Some(now) {
                    println!("{}", stands(seed, &kind, now));
                    std::process::exit(1);
                }
            }
        });
        Self { steps, _over: over }
    }

    /// The world has advanced by one step.
    pub fn beat(&self) {
        self.steps.fetch_add(1, Ordering::Relaxed);
    }
}

fn stands(seed: u64, kind: &str, millis: u64) -> String {
    format!(
        "seed {seed}{kind}: NoPanic at {millis} ms: the clock of the world stands for {STANDS_STILL:?}; some host never waits\n\
         the whole of it: make sim SEED={seed}{kind}"
    )
}
