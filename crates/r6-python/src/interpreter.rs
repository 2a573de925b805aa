//! Letting go of the interpreter, and coming back to it, also while it ends.
//!
//! CPython ends a thread that comes back to an interpreter that is ending, with frames of Rust on its stack; the runtime
//! of C then aborts the process. So once `atexit` has run nobody comes back but the thread that ends it: who would is held
//! until the process is gone.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use pyo3::prelude::*;

use crate::process::Process;

/// How long the end waits for threads that are on their way back. They only have to make a result; in a child of a fork
/// some may be counted that do not exist.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// Threads that are on their way back, or do with the interpreter what must not be cut short.
static ON_THE_WAY: AtomicUsize = AtomicUsize::new(0);

/// Whether the interpreter ends. Set and read in one order with [`ON_THE_WAY`].
static ENDING: AtomicBool = AtomicBool::new(false);

/// The thread that ends it: what it still drops, or does in other calls of `atexit`, may wait as ever.
static ENDED_BY: OnceLock<ThreadId> = OnceLock::new();

/// Held by a thread that is back, until it has done what must not be cut short.
pub struct Back;

impl Drop for Back {
    fn drop(&mut self) {
        ON_THE_WAY.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Does something that waits, without the interpreter.
pub fn released<T: Send>(py: Python<'_>, wait: impl FnOnce() -> T + Send) -> (T, Back) {
    py.detach(|| {
        let waited = wait();
        ON_THE_WAY.fetch_add(1, Ordering::SeqCst);
        if ENDING.load(Ordering::SeqCst) && ENDED_BY.get() != Some(&thread::current().id()) {
            ON_THE_WAY.fetch_sub(1, Ordering::SeqCst);
            loop {
                thread::park();
            }
        }
        (waited, Back)
    })
}

/// The interpreter is about to end: for `atexit`.
#[pyfunction]
pub fn ending(py: Python<'_>) {
    py.detach(|| {
        ENDED_BY.get_or_init(|| thread::current().id());
        ENDING.store(true, Ordering::SeqCst);
        Process::end_telling();
        let until = Instant::now() + LONGEST_WAIT;
        while ON_THE_WAY.load(Ordering::SeqCst) > 0 && Instant::now() < until {
            thread::yield_now();
        }
    });
}

/// Has `ending` called in time.
pub fn watch(py: Python<'_>) -> PyResult<()> {
    let ending = wrap_pyfunction!(ending, py)?;
    py.import("atexit")?.call_method1("register", (ending,))?;
    Ok(())
}
