//! Releases the interpreter and takes it back, also while it shuts down.
//!
//! If a thread takes back an interpreter that is shutting down, CPython ends the thread. If Rust frames are
//! on its stack, the C runtime then aborts the process. So after `atexit` has run, only the thread that shuts
//! down takes it back. Other threads are parked until the process has ended.

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

/// How long the shutdown waits for threads that are taking back the interpreter. They only have to make a
/// result.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// Threads that are taking back the interpreter, or that do something with it that must not be interrupted.
static ON_THE_WAY: AtomicUsize = AtomicUsize::new(0);

/// Whether the interpreter is shutting down. Its order with [`ON_THE_WAY`] is sequentially consistent.
static ENDING: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// Whether this thread shuts the interpreter down. Other `atexit` calls and drops on this thread may wait
    /// as usual.
    static ENDS_IT: Cell<bool> = const { Cell::new(false) };
}

/// Held by a thread that has the interpreter again, while its work must not be interrupted.
pub struct Back;

impl Drop for Back {
    fn drop(&mut self) {
        // In a child that a signal handler forked in the meantime, the count has started again at 0.
        let _ = ON_THE_WAY.try_update(Ordering::SeqCst, Ordering::SeqCst, |count| count.checked_sub(1));
    }
}

/// Runs a waiting function without the interpreter.
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

/// Prepares the shutdown of the interpreter; called by `atexit`.
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

/// Waits until no stop is under way, and reports each stop that was not confirmed. A signal ends the wait.
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
        // Also waits for operations that have not begun to stop yet, and for connections that are closed
        // after that.
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

/// Prints a last line. Ignores a failure, because there is no other place to report it.
fn say(text: &str) {
    writeln!(io::stderr(), "r6: the program ends: {text}").ok();
}

/// Notes that this is the child of a fork, with one thread; called by `os.register_at_fork`.
#[pyfunction]
pub fn forked() {
    process::forked();
    ON_THE_WAY.store(0, Ordering::SeqCst);
    ENDING.store(false, Ordering::SeqCst);
}

/// Registers `ending` and `forked` with Python.
pub fn watch(py: Python<'_>) -> PyResult<()> {
    let ending = wrap_pyfunction!(ending, py)?;
    py.import("atexit")?.call_method1("register", (ending,))?;
    let os = py.import("os")?;
    // Systems without fork do not have this function.
    if os.hasattr("register_at_fork")? {
        let hook = PyDict::new(py);
        hook.set_item("after_in_child", wrap_pyfunction!(forked, py)?)?;
        os.call_method("register_at_fork", (), Some(&hook))?;
    }
    Ok(())
}
