//! Something that takes time: written once, waited for by a thread or by asyncio.

use std::future::Future;
use std::pin::Pin;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use tokio::task::AbortHandle;
use tokio::time::timeout;

use crate::interpreter;
use crate::process::{Process, Settled};

/// How often a thread that waits asks whether a signal has come. Ctrl-C is felt within this time, and a reply, which
/// takes a real controller 20 ms, is not disturbed by it.
const SIGNALS_EVERY: Duration = Duration::from_millis(50);

/// Makes the Python object of a result, with the interpreter at hand.
pub type Made = Box<dyn for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, PyAny>> + Send>;

type Running = Pin<Box<dyn Future<Output = Made> + Send>>;

/// Something that takes time and has not begun: `wait` or `start` it, once.
#[pyclass(frozen, module = "r6._r6")]
pub struct Operation {
    future: Mutex<Option<Running>>,
    /// Whether it goes on when nobody waits any more.
    goes_on: bool,
}

impl Operation {
    /// What `future` gives, made into a Python object by `convert`.
    pub fn new<T, F, C>(future: F, convert: C) -> Self
    where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
        C: for<'py> FnOnce(Python<'py>, T) -> PyResult<Bound<'py, PyAny>> + Send + 'static,
    {
        let running = async move {
            let value = future.await;
            let made: Made = Box::new(move |py| convert(py, value));
            made
        };
        Self { future: Mutex::new(Some(Box::pin(running))), goes_on: false }
    }

    /// The same, but once begun it goes on to its end, whoever gives up waiting: for what must not be taken back, as a stop.
    #[must_use]
    pub fn going_on(self) -> Self {
        Self { goes_on: true, ..self }
    }

    fn begin(&self) -> PyResult<Running> {
        let future = self.future.lock().unwrap_or_else(PoisonError::into_inner).take();
        future.ok_or_else(|| PyRuntimeError::new_err("this operation has begun already"))
    }
}

#[pymethods]
impl Operation {
    /// Waits with the interpreter released. A signal handler that raises, as Ctrl-C does, ends the waiting.
    fn wait<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let engine = Process::current()?.engine();
        let mut future = self.begin()?;
        loop {
            let waiting = || engine.block_on(async { timeout(SIGNALS_EVERY, &mut future).await });
            // The way back is held open until the result is made: that runs Python code.
            let (waited, _back) = interpreter::released(py, waiting);
            match waited {
                Ok(made) => return made(py),
                Err(_elapsed) => {
                    if let Err(raised) = py.check_signals() {
                        if self.goes_on {
                            engine.handle().spawn(async move { drop(future.await) });
                        }
                        return Err(raised);
                    }
                }
            }
        }
    }

    /// Begins in the background and calls `tell(error, value)` from another thread once it has ended.
    fn start(&self, tell: Py<PyAny>) -> PyResult<Started> {
        let process = Process::current()?;
        let future = self.begin()?;
        let task = process.engine().handle().spawn(async move {
            let made = future.await;
            process.settle(Settled { tell, made });
        });
        Ok(Started { task: (!self.goes_on).then(|| task.abort_handle()) })
    }
}

/// An operation that was started.
#[pyclass(frozen, module = "r6._r6")]
pub struct Started {
    /// `None` if it goes on to its end.
    task: Option<AbortHandle>,
}

#[pymethods]
impl Started {
    /// Drops what is left of it; nothing if it has ended, or goes on whatever happens.
    fn cancel(&self) {
        if let Some(task) = &self.task {
            task.abort();
        }
    }
}
