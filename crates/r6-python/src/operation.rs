//! An operation that takes time: written once, and waited for by a thread or by asyncio.

use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use tokio::task::AbortHandle;
use tokio::time::timeout;

use crate::driver::Driver;
use crate::interpreter::{self, Back};
use crate::line::Calling;
use crate::outcome;
use crate::process::{Errand, Held, OfThisProcess, Owed, Process, Unheard, made_before_the_fork};

/// How often a waiting thread checks for signals. Ctrl-C takes effect within this time. A reply of a real
/// controller, which takes 20 ms, is not delayed by the check.
pub const SIGNALS_EVERY: Duration = Duration::from_millis(50);

/// The same for a thread that reads from a socket. The system may be late by a tick or two, usually 4 ms
/// each.
const SIGNALS_EVERY_READ: Duration = Duration::from_millis(40);

/// Makes the Python object of a result, with the interpreter held.
pub type Made = Box<dyn for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, PyAny>> + Send>;

/// The work itself, without Python objects.
pub type Running = Pin<Box<dyn Future<Output = Made> + Send>>;

/// An operation that takes time and has not begun: ``wait`` or ``start`` it, once.
#[pyclass(frozen, module = "r6._r6")]
pub struct Operation {
    work: OfThisProcess<Mutex<Option<Work>>>,
    /// The note for a caller that gives up waiting, if the operation continues then.
    goes_on: Option<&'static str>,
    /// The driver of the operation, if it is not the engine.
    driver: Option<OfThisProcess<Driver>>,
}

/// The note for a caller that gave up waiting for a stop.
pub const STOP_GOES_ON: &str = "the stop goes on and was not confirmed before this: closing the robot, and the end of the program, wait for it";

/// The work, and the Python objects that its result needs.
pub struct Work {
    pub running: Running,
    pub held: Held,
    /// Held until the work has ended, if the end of the program waits for it.
    pub owed: Option<Owed>,
    pub unheard: Option<Unheard>,
}

/// How a wait for an operation ended.
pub enum Waited<'py> {
    /// The operation ended with this result or error.
    Made(PyResult<Bound<'py, PyAny>>),
    /// A signal handler raised this.
    Raised(PyErr),
}

/// The result of an operation that was waited for through all signals.
pub struct Insisted<'py> {
    /// The result of the operation, or its error.
    pub outcome: PyResult<Bound<'py, PyAny>>,
    /// What the handler of the last signal raised during the wait.
    pub raised: Option<PyErr>,
}

impl Operation {
    /// An operation that awaits `future` and makes a Python object of the result with `convert`. Only
    /// `convert` may have Python objects.
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
        let work = Work { running: Box::pin(running), held, owed: None, unheard: None };
        Self { work: OfThisProcess::new(Mutex::new(Some(work))), goes_on: None, driver: None }
    }

    /// Sets the driver. The operation waits for that connection alone, and needs no runtime around it.
    #[must_use]
    pub fn over(self, driver: &Driver) -> Self {
        Self { driver: Some(OfThisProcess::new(driver.clone())), ..self }
    }

    /// Lets the operation go on to its end even if the caller gives up waiting. The end of the program waits
    /// for it. This is for operations that must not be undone, such as a stop. `told` is the note for a
    /// caller that gives up waiting.
    #[must_use]
    pub fn going_on(self, told: &'static str) -> Self {
        Self { goes_on: Some(told), ..self }
    }

    /// Sets what to do if the end cannot be reported because an event loop was closed.
    #[must_use]
    pub fn or_unheard(self, unheard: Unheard) -> Self {
        if let Ok(work) = self.work.here()
            && let Some(work) = work.lock().unwrap_or_else(PoisonError::into_inner).as_mut()
        {
            work.unheard = Some(unheard);
        }
        self
    }

    fn begin(&self, process: &'static Process) -> PyResult<Work> {
        let work = self.work.here()?.lock().unwrap_or_else(PoisonError::into_inner).take();
        let work = work.ok_or_else(begun)?;
        Ok(Work { owed: self.goes_on.map(|_| Owed::by(process)), ..work })
    }

    /// Makes sure that an operation that has not begun never begins.
    pub fn never(&self) {
        if let Ok(work) = self.work.here() {
            drop(work.lock().unwrap_or_else(PoisonError::into_inner).take());
        }
    }

    /// Waits with the interpreter released, until the operation has ended or a signal handler raises (Ctrl-C
    /// does).
    pub fn waited<'py>(&self, py: Python<'py>) -> PyResult<Waited<'py>> {
        self.work.here()?;
        let process = Process::current(py)?;
        let driver = self.driver.as_ref().map(OfThisProcess::here).transpose()?;
        let mut work = self.begin(process)?;
        loop {
            if let Some((made, _back)) = work.some_time(py, process, driver) {
                return Ok(Waited::Made(made(py)));
            }
            let signalled = py.check_signals();
            if !process.is_here(py) {
                // A signal handler has forked, and this is the child.
                std::mem::forget(work);
                return Ok(Waited::Raised(signalled.err().unwrap_or_else(made_before_the_fork)));
            }
            if let Err(raised) = signalled {
                if let Some(told) = self.goes_on {
                    outcome::note(raised.value(py), told);
                    process.engine().handle().spawn(Begun { process, tell: None, work: Some(work) });
                }
                return Ok(Waited::Raised(raised));
            }
        }
    }

    /// Waits to the end, through all signals: for a stop, which takes [`r6_client::StopsUnderWay::WITHIN`] at
    /// most.
    pub fn insist<'py>(&self, py: Python<'py>) -> PyResult<Insisted<'py>> {
        self.work.here()?;
        let process = Process::current(py)?;
        let driver = self.driver.as_ref().map(OfThisProcess::here).transpose()?;
        let mut work = self.begin(process)?;
        let mut raised: Option<PyErr> = None;
        loop {
            let made = work.some_time(py, process, driver);
            // Also after the end: else a pending signal would interrupt the Python code that makes the
            // result.
            let signalled = py.check_signals();
            if !process.is_here(py) {
                std::mem::forget(work);
                return Err(signalled.err().unwrap_or_else(made_before_the_fork));
            }
            if let Err(error) = signalled {
                if let Some(before) = &raised {
                    outcome::in_the_course_of(py, &error, before.value(py))?;
                }
                raised = Some(error);
            }
            if let Some((made, _back)) = made {
                return Ok(Insisted { outcome: made(py), raised });
            }
        }
    }
}

impl Work {
    /// Waits until the operation has ended, but no longer than signals may wait. The caller holds the
    /// [`Back`] until the result is made, because that runs Python code.
    fn some_time(
        &mut self,
        py: Python<'_>,
        process: &Process,
        driver: Option<&Driver>,
    ) -> Option<(Made, Back)> {
        let running = &mut self.running;
        let waiting = || match driver {
            Some(Driver::Threads(driver)) => driver.block_on_for(SIGNALS_EVERY_READ, running.as_mut()),
            Some(Driver::EventLoop(_) | Driver::Engine) | None => {
                process.engine().block_on(async { timeout(SIGNALS_EVERY, running).await.ok() })
            }
        };
        let (waited, back) = interpreter::released(py, waiting);
        waited.map(|made| (made, back))
    }
}

fn begun() -> PyErr {
    PyRuntimeError::new_err("this operation has begun already")
}

#[pymethods]
impl Operation {
    /// Waits with the interpreter released. A signal handler that raises, as Ctrl-C does, ends the wait
    /// within 50 ms.
    pub fn wait<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match self.waited(py)? {
            Waited::Made(made) => made,
            Waited::Raised(raised) => Err(raised),
        }
    }

    /// Begins the operation, and sets the result of ``future``, which belongs to ``event_loop``. Call it
    /// in the thread of the event loop. Work that the event loop does not do itself runs in the
    /// background, and another thread calls ``tell(error, value)`` at its end.
    #[pyo3(signature = (tell, event_loop=None, future=None))]
    fn start(
        &self,
        py: Python<'_>,
        tell: Py<PyAny>,
        event_loop: Option<&Bound<'_, PyAny>>,
        future: Option<Py<PyAny>>,
    ) -> PyResult<Started> {
        self.work.here()?;
        let process = Process::current(py)?;
        if self.goes_on.is_none()
            && let (Some(event_loop), Some(future)) = (event_loop, future)
            && let Some(driver) = &self.driver
            && let Driver::EventLoop(line) = driver.here()?
            && line.attach(py, event_loop)?
        {
            let calling = line.begin(py, self.begin(process)?, tell, future);
            return Ok(Started { task: OfThisProcess::new(Task::Here(calling)), goes_on: None });
        }
        let work = Some(self.begin(process)?);
        let task = process.engine().handle().spawn(Begun { process, tell: Some(tell), work });
        let task = if self.goes_on.is_none() { Task::OfTheEngine(task.abort_handle()) } else { Task::GoesOn };
        Ok(Started { task: OfThisProcess::new(task), goes_on: self.goes_on })
    }
}

/// An operation that goes on without a waiting thread.
struct Begun {
    process: &'static Process,
    /// The function to call at its end.
    tell: Option<Py<PyAny>>,
    /// `None` once it has ended.
    work: Option<Work>,
}

impl Begun {
    /// Passes on the work that needs the interpreter.
    fn end(&mut self, made: Option<Made>) {
        if let Some(Work { running, held, owed, unheard }) = self.work.take() {
            // Dropping this withdraws a request that has not left. That must not wait for the interpreter.
            drop(running);
            drop(owed);
            self.process.run(Errand { tell: self.tell.take(), made, held, unheard });
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

/// A started operation.
enum Task {
    OfTheEngine(AbortHandle),
    Here(Calling),
    /// It goes on to its end and cannot be cancelled.
    GoesOn,
}

/// A started operation.
#[pyclass(frozen, module = "r6._r6")]
pub struct Started {
    task: OfThisProcess<Task>,
    /// The note for a caller that gives up waiting, if the operation continues then.
    #[pyo3(get)]
    goes_on: Option<&'static str>,
}

#[pymethods]
impl Started {
    /// Drops the rest of the operation. Does nothing if it has ended or cannot be cancelled, as a stop.
    fn cancel(&self, py: Python<'_>) {
        // Cleanup code in the child of a fork has nothing to drop.
        match self.task.here() {
            Ok(Task::OfTheEngine(task)) => task.abort(),
            Ok(Task::Here(calling)) => calling.cancel(py),
            Ok(Task::GoesOn) | Err(_) => {}
        }
    }
}
