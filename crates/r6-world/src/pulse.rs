//! Whether the clock of a world still goes: a host that goes round and round without ever waiting keeps it
//! from going, and the world from ending.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::Duration;

/// One step of a world takes a millisecond or less of real time: on no computer, however busy, so many
/// seconds.
const STANDS_STILL: Duration = Duration::from_secs(30);

/// Looks after the clock of a world, from a thread of its own, until this is dropped.
///
/// Nobody can end a thread that never waits: where the clock stands, the seed is told and the process ends.
#[derive(Debug)]
pub struct Pulse {
    steps: Arc<AtomicU64>,
    /// Its end is told by dropping it.
    _over: Sender<()>,
}

impl Pulse {
    /// Looks after the world of this seed; `kind`: what `make sim` is told besides.
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

    /// The world has gone on by one step.
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
