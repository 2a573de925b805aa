//! Something that takes time: written once, waited for by a thread or by asyncio.

use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use tokio::task::AbortHandle;
use tokio::time::timeout;

use crate::interpreter;
use crate::process::{Errand, Held, Kept, Process, made_before_the_fork};

/// How often a thread that waits asks whether a signal has come. Ctrl-C is felt within this time, and a reply, which
/// takes a real controller 20 ms, is not disturbed by it.
const SIGNALS_EVERY: Duration = Duration::from_millis(50);

/// Makes the Python object of a result, with the interpreter at hand.
pub type Made = Box<dyn for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, PyAny>> + Send>;

type Running = Pin<Box<dyn Future<Output = Made> + Send>>;

/// Something that takes time and has not begun: `wait` or `start` it, once.
#[pyclass(frozen, module = "r6._r6")]
pub struct Operation {
    work: Kept<Mutex<Option<Work>>>,
    /// Whether it goes on when nobody waits any more.
    goes_on: bool,
}

/// What is to be done, and the Python objects that its result needs.
struct Work {
    running: Running,
    held: Held,
}

impl Operation {
    /// What `future` gives, made into a Python object by `convert`. Only `convert` may have Python objects.
    pub fn new<T, F, C>(future: F, convert: C) -> Self
    where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
        C: for<'py> FnOnce(Python<'py>, T) -> PyResult<Bound<'py, PyAny>> + Send + 'static,
    {
        let convert = Arc::new(Mutex::new(Some(convert)));
        let held: Held = Arc::clone(&convert) as Held;
        let running = async move {
            let value = future.await;
            let made: Made = Box::new(move |py| {
                let convert = convert.lock().unwrap_or_else(PoisonError::into_inner).take();
                convert.ok_or_else(begun)?(py, value)
            });
            made
        };
        let work = Work { running: Box::pin(running), held };
        Self { work: Kept::new(Mutex::new(Some(work))), goes_on: false }
    }

    /// The same, but once begun it goes on to its end, whoever gives up waiting: for what must not be taken back, as a stop.
    #[must_use]
    pub fn going_on(self) -> Self {
        Self { goes_on: true, ..self }
    }

    fn begin(&self) -> PyResult<Work> {
        let work = self.work.here()?.lock().unwrap_or_else(PoisonError::into_inner).take();
        work.ok_or_else(begun)
    }
}

fn begun() -> PyErr {
    PyRuntimeError::new_err("this operation has begun already")
}

#[pymethods]
impl Operation {
    /// Waits with the interpreter released. A signal handler that raises, as Ctrl-C does, ends the waiting.
    fn wait<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.work.here()?;
        let process = Process::current(py)?;
        let mut work = self.begin()?;
        loop {
            let running = &mut work.running;
            let waiting = || process.engine().block_on(async { timeout(SIGNALS_EVERY, running).await });
            // The way back is held open until the result is made: that runs Python code.
            let (waited, _back) = interpreter::released(py, waiting);
            if let Ok(made) = waited {
                return made(py);
            }
            let signalled = py.check_signals();
            if !process.is_here(py) {
                // A signal handler has forked, and this is the child.
                std::mem::forget(work);
                return Err(signalled.err().unwrap_or_else(made_before_the_fork));
            }
            if let Err(raised) = signalled {
                if self.goes_on {
                    process.engine().handle().spawn(Begun { process, tell: None, work: Some(work) });
                }
                return Err(raised);
            }
        }
    }

    /// Begins in the background and calls `tell(error, value)` from another thread once it has ended.
    fn start(&self, py: Python<'_>, tell: Py<PyAny>) -> PyResult<Started> {
        self.work.here()?;
        let process = Process::current(py)?;
        let work = Some(self.begin()?);
        let task = process.engine().handle().spawn(Begun { process, tell: Some(tell), work });
        Ok(Started { task: Kept::new((!self.goes_on).then(|| task.abort_handle())) })
    }
}

/// An operation that goes on without a thread that waits for it.
struct Begun {
    process: &'static Process,
    /// Who wants to know its end.
    tell: Option<Py<PyAny>>,
    /// `None` once it has ended.
    work: Option<Work>,
}

impl Begun {
    /// Hands on what needs the interpreter.
    fn end(&mut self, made: Option<Made>) {
        if let Some(Work { running, held }) = self.work.take() {
            // A request that has not left is taken back by this, and must not wait for the interpreter.
            drop(running);
            self.process.run(Errand { tell: self.tell.take(), made, held });
        }
    }
}

impl Future for Begun {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        if let Some(work) = &mut self.work {
            let made = ready!(work.running.as_mut().poll(context));
            self.end(Some(made));
        }
        Poll::Ready(())
    }
}

impl Drop for Begun {
    fn drop(&mut self) {
        self.end(None);
    }
}

/// An operation that was started.
#[pyclass(frozen, module = "r6._r6")]
pub struct Started {
    /// `None` if it goes on to its end.
    task: Kept<Option<AbortHandle>>,
}

#[pymethods]
impl Started {
    /// Drops what is left of it; nothing if it has ended, or goes on whatever happens.
    fn cancel(&self) {
        // Who cleans up in the child of a fork has nothing to drop there.
        if let Ok(Some(task)) = self.task.here() {
            task.abort();
        }
    }
}
