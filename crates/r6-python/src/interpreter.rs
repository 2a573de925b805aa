//! Letting go of the interpreter, and coming back to it, also while it ends.
//!
//! CPython ends a thread that comes back to an interpreter that is ending, with frames of Rust on its stack; the runtime
//! of C then aborts the process. So once `atexit` has run nobody comes back but the thread that ends it: who would is held
//! until the process is gone.

use std::cell::Cell;
use std::io::{self, Write as _};
use std::pin::pin;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use r6_client::StopsUnderWay;
use tokio::time::timeout;

use crate::operation::SIGNALS_EVERY;
use crate::process::{self, Process};

/// How long the end waits for threads that are on their way back. They only have to make a result.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// Threads that are on their way back, or do with the interpreter what must not be cut short.
static ON_THE_WAY: AtomicUsize = AtomicUsize::new(0);

/// Whether the interpreter ends. Set and read in one order with [`ON_THE_WAY`].
static ENDING: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// Whether this thread ends it: what it still drops, or does in other calls of `atexit`, may wait as ever.
    static ENDS_IT: Cell<bool> = const { Cell::new(false) };
}

/// Held by a thread that is back, until it has done what must not be cut short.
pub struct Back;

impl Drop for Back {
    fn drop(&mut self) {
        // In a child that a signal handler forked meanwhile, nobody is counted any more.
        let _ = ON_THE_WAY.try_update(Ordering::SeqCst, Ordering::SeqCst, |count| count.checked_sub(1));
    }
}

/// Does something that waits, without the interpreter.
pub fn released<T: Send>(py: Python<'_>, wait: impl FnOnce() -> T + Send) -> (T, Back) {
    py.detach(|| {
        let waited = wait();
        ON_THE_WAY.fetch_add(1, Ordering::SeqCst);
        if ENDING.load(Ordering::SeqCst) && !ENDS_IT.get() {
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
    let process = Process::started(py);
    if let Some(process) = process {
        wait_for_stops(py, process);
    }
    py.detach(|| {
        ENDS_IT.set(true);
        ENDING.store(true, Ordering::SeqCst);
        if let Some(process) = process {
            process.end_telling();
        }
        let until = Instant::now() + LONGEST_WAIT;
        while ON_THE_WAY.load(Ordering::SeqCst) > 0 && Instant::now() < until {
            thread::yield_now();
        }
    });
}

/// Waits until no stop is under way any more, and says of each that was not confirmed that it was not. A signal ends the waiting.
fn wait_for_stops(py: Python<'_>, process: &Process) {
    let stops = process.stops_under_way();
    if stops.is_empty() && !process.owes() {
        return;
    }
    let over = async {
        let mut reports = Vec::new();
        for mut stops in stops {
            reports.extend(stops.over().await);
        }
        // What was asked for and has not begun to stop yet, and the connections that are closed after it.
        timeout(StopsUnderWay::WITHIN, process.nothing_owed()).await.ok();
        reports
    };
    let mut over = pin!(over);
    let begun = Instant::now();
    loop {
        let waiting = || process.engine().block_on(async { timeout(SIGNALS_EVERY, over.as_mut()).await });
        match py.detach(waiting) {
            Ok(reports) => {
                let failed = reports.iter().filter_map(|report| match report {
                    Ok(report) if report.confirmed => None,
                    Ok(report) => Some(report.to_string()),
                    Err(error) => Some(error.to_string()),
                });
                return failed.for_each(|failed| say(&failed));
            }
            Err(_elapsed) if py.check_signals().is_err() => {
                let not_confirmed = StopsUnderWay::not_confirmed(begun.elapsed());
                return say(&not_confirmed.to_string());
            }
            Err(_elapsed) => {}
        }
    }
}

/// A last line. Where nothing can be written any more, nobody reads it.
fn say(text: &str) {
    writeln!(io::stderr(), "r6: the program ends: {text}").ok();
}

/// This is the child of a fork, with one thread: for `os.register_at_fork`.
#[pyfunction]
pub fn forked() {
    process::forked();
    ON_THE_WAY.store(0, Ordering::SeqCst);
    ENDING.store(false, Ordering::SeqCst);
}

/// Has `ending` and `forked` called in time.
pub fn watch(py: Python<'_>) -> PyResult<()> {
    let ending = wrap_pyfunction!(ending, py)?;
    py.import("atexit")?.call_method1("register", (ending,))?;
    let os = py.import("os")?;
    // Where processes do not fork there is none.
    if os.hasattr("register_at_fork")? {
        let hook = PyDict::new(py);
        hook.set_item("after_in_child", wrap_pyfunction!(forked, py)?)?;
        os.call_method("register_at_fork", (), Some(&hook))?;
    }
    Ok(())
}
