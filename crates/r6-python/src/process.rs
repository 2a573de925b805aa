//! What this process runs on: one engine for all robots, and one thread that tells asyncio.

use std::sync::mpsc;
use std::sync::{Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::operation::Made;
use r6_client::blocking::Engine;

/// What serves the robots of one process. It lives as long as the process.
pub struct Process {
    engine: Engine,
    settled: mpsc::Sender<Option<Settled>>,
    /// The thread that tells asyncio, until the interpreter ends.
    telling: Mutex<Option<JoinHandle<()>>>,
    /// A fork leaves the threads behind: whatever belongs to them is of no use in the child.
    id: u32,
}

/// An operation that asyncio waits for has ended.
pub struct Settled {
    /// Called with an error or `None`, then the value.
    pub tell: Py<PyAny>,
    /// What to tell.
    pub made: Made,
}

static CURRENT: Mutex<Option<&'static Process>> = Mutex::new(None);

impl Process {
    /// The one of this process; the first call starts it, and so does the first call in a child of a fork.
    pub fn current() -> PyResult<&'static Self> {
        let mut current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
        match *current {
            Some(process) if process.is_here() => Ok(process),
            Some(_) | None => {
                let process: &'static Self = Box::leak(Box::new(Self::start()?));
                *current = Some(process);
                Ok(process)
            }
        }
    }

    fn start() -> PyResult<Self> {
        let (settled, settling) = mpsc::channel();
        let telling =
            thread::Builder::new().name("r6 asyncio".to_owned()).spawn(move || tell_asyncio(&settling))?;
        let telling = Mutex::new(Some(telling));
        Ok(Self { engine: Engine::start()?, settled, telling, id: std::process::id() })
    }

    /// The engine.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Has an event loop told.
    pub fn settle(&self, settled: Settled) {
        // The thread ends with the interpreter; then nobody waits any more.
        let _ = self.settled.send(Some(settled));
    }

    /// Ends the thread that tells asyncio: what it was given is told before.
    pub fn end_telling() {
        let Some(process) = *CURRENT.lock().unwrap_or_else(PoisonError::into_inner) else { return };
        if process.is_here() {
            let _ = process.settled.send(None);
            if let Some(thread) = process.telling.lock().unwrap_or_else(PoisonError::into_inner).take() {
                // A panic of that thread was already reported by it.
                let _ = thread.join();
            }
        }
    }

    fn is_here(&self) -> bool {
        self.id == std::process::id()
    }
}

/// Python is entered here and nowhere on the engine's threads: whoever holds the interpreter for long, a busy thread or
/// a slow extension, must not hold up heartbeats, polls and paths.
fn tell_asyncio(settling: &mpsc::Receiver<Option<Settled>>) {
    while let Ok(Some(settled)) = settling.recv() {
        if Python::try_attach(|py| tell(py, settled)).is_none() {
            return;
        }
    }
}

fn tell(py: Python<'_>, Settled { tell, made }: Settled) {
    let told = match made(py) {
        Ok(value) => tell.call1(py, (py.None(), value)),
        Err(error) => tell.call1(py, (error, py.None())),
    };
    // A loop that was closed wants to know nothing.
    drop(told);
}

/// Something that belongs to the process that made it: of no use in a child of a fork, and not dropped there, because
/// dropping it would wait for threads that the child does not have.
pub struct Kept<T> {
    process: &'static Process,
    value: Option<T>,
}

impl<T> Kept<T> {
    /// Of the present process.
    pub fn new(value: T) -> PyResult<Self> {
        Ok(Self { process: Process::current()?, value: Some(value) })
    }

    /// The thing, in the process that made it.
    pub fn here(&self) -> PyResult<&T> {
        match &self.value {
            Some(value) if self.process.is_here() => Ok(value),
            Some(_) | None => Err(PyRuntimeError::new_err(
                "this object was made before the process forked: connect again in the child, or start it with `spawn`",
            )),
        }
    }
}

impl<T> Drop for Kept<T> {
    fn drop(&mut self) {
        if !self.process.is_here() {
            std::mem::forget(self.value.take());
        }
    }
}
