//! A motion on its way from the engine to its caller. From its first byte on it has an owner: the handle or a
//! stop.
//!
//! ```text
//!  run ──▶ Begun ──▶ Made ──take──▶ Taken        the handle owns it
//!            │         └──given up or dropped──▶ stopped, its list cleared
//!            └──refused or given up──▶ Nothing
//! ```

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyBaseException, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::PyType;
use r6_client::{Motion, MotionError, MotionHandle, RequestError, Robot, RunOptions, StopReport};
use tokio::sync::{oneshot, watch};

use crate::closing::{Connection, Unowned, stopped};
use crate::convert;
use crate::driver::Driver;
use crate::handle::MotionCore;
use crate::operation::{Operation, STOP_GOES_ON};
use crate::outcome;
use crate::process::{OfThisProcess, Owed, Process};
use crate::raising::raise;

/// The phase of a motion on its way.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// It may become a motion at any moment.
    Begun,
    /// It never becomes a motion.
    Nothing,
    /// It is a motion, and no caller has its handle yet.
    Made,
    /// A caller has taken its handle.
    Taken,
}

/// State that the engine and the caller share.
struct Way {
    phase: watch::Sender<Phase>,
    made: Mutex<Option<MotionHandle>>,
    robot: Robot,
    stop_on_drop: bool,
    connection: Arc<Connection>,
    process: &'static Process,
}

impl Way {
    fn take(&self) -> Option<MotionHandle> {
        let handle = self.made.lock().unwrap_or_else(PoisonError::into_inner).take();
        if handle.is_some() {
            self.phase.send_replace(Phase::Taken);
        }
        handle
    }

    /// Waits until it is known whether there is a motion, and stops it; `None` if there is no motion.
    async fn stop(&self) -> Option<Result<StopReport, RequestError>> {
        let mut phase = self.phase.subscribe();
        // The wait cannot fail: `self` has the sender.
        let phase =
            phase.wait_for(|phase| *phase != Phase::Begun).await.map_or(Phase::Nothing, |phase| *phase);
        match phase {
            Phase::Begun | Phase::Nothing => None,
            Phase::Made | Phase::Taken => Some(match self.take() {
                Some(handle) => handle.stop().await,
                None => self.robot.stop().await,
            }),
        }
    }
}

impl Way {
    /// Stops a motion without a caller. The engine stops it, and the end of the program waits for that.
    fn stop_unowned(&self) {
        if let Some(handle) = self.take() {
            let meanwhile = (Owed::by(self.process), Unowned::over(&self.connection));
            self.process.engine().handle().spawn(async move {
                drop(handle.stop().await);
                drop(meanwhile);
            });
        }
    }
}

impl Drop for Way {
    fn drop(&mut self) {
        self.stop_unowned();
    }
}

/// The engine's part. While it exists, a motion may still begin. Dropping it before that says that no motion
/// begins.
struct Making(Arc<Way>);

impl Drop for Making {
    fn drop(&mut self) {
        self.0.phase.send_if_modified(|phase| {
            let nothing = *phase == Phase::Begun;
            if nothing {
                *phase = Phase::Nothing;
            }
            nothing
        });
    }
}

/// A motion on its way to its handle. From its first byte on it has an owner: the handle or a stop. If
/// this is dropped before ``take``, the arm is stopped.
#[pyclass(frozen, module = "r6._r6")]
pub struct Starting {
    operation: Py<Operation>,
    way: OfThisProcess<Arc<Way>>,
}

impl Starting {
    /// Prepares a motion. Nothing begins before the operation does.
    pub fn new(
        py: Python<'_>,
        robot: Robot,
        motion: Motion,
        options: RunOptions,
        connection: Arc<Connection>,
        driver: &Driver,
    ) -> PyResult<Self> {
        let process = Process::current(py)?;
        let phase = watch::Sender::new(Phase::Begun);
        let (made, robots, stop_on_drop) = (Mutex::default(), robot.clone(), options.stop_on_drop);
        let way = Arc::new(Way { phase, made, robot: robots, stop_on_drop, connection, process });
        let making = Making(Arc::clone(&way));
        let starting = async move {
            // Dropped at the end of this future, in every case.
            let making = making;
            let handle = robot.run(&motion, options).await?;
            *making.0.made.lock().unwrap_or_else(PoisonError::into_inner) = Some(handle);
            making.0.phase.send_replace(Phase::Made);
            Ok(())
        };
        let operation = Operation::new(starting, |py, made| {
            raise::<(), MotionError>(py, made)?;
            py.None().into_bound_py_any(py)
        });
        let unowned = Arc::clone(&way);
        let operation = operation.or_unheard(Box::new(move || unowned.stop_unowned()));
        let operation = match driver {
            Driver::Threads(_) => operation.over(driver),
            Driver::EventLoop(_) | Driver::Engine => operation,
        };
        Ok(Self { operation: Py::new(py, operation)?, way: OfThisProcess::new(way) })
    }

    fn stopping(&self, py: Python<'_>) -> PyResult<Option<Operation>> {
        let way = Arc::clone(self.way.here()?);
        // An operation that has not begun must never begin.
        self.operation.get().never();
        if *way.phase.borrow() == Phase::Nothing {
            return Ok(None);
        }
        let process = Process::current(py)?;
        let meanwhile = (Owed::by(process), Unowned::over(&way.connection));
        let (tell, report) = oneshot::channel();
        // Stops at once, even if no caller waits.
        process.engine().handle().spawn(async move {
            // The caller may no longer wait.
            drop(tell.send(way.stop().await));
            drop(meanwhile);
        });
        let waiting = stopped(async move { report.await.unwrap_or(None) });
        Ok(Some(
            Operation::new(waiting, |py, report| match raise(py, report.transpose())? {
                Some(report) => convert::stop_report(py, &report),
                None => py.None().into_bound_py_any(py),
            })
            .going_on(STOP_GOES_ON),
        ))
    }
}

#[pymethods]
impl Starting {
    /// The note above the result of the stop.
    #[classattr]
    const UNOWNED: &str = UNOWNED;

    /// The operation that makes the motion. Nothing begins before it does.
    #[getter]
    fn operation(&self, py: Python<'_>) -> Py<Operation> {
        self.operation.clone_ref(py)
    }

    /// Takes the motion, once it is made.
    fn take(&self) -> PyResult<MotionCore> {
        let way = self.way.here()?;
        let handle = way
            .take()
            .ok_or_else(|| PyRuntimeError::new_err("this motion was taken already, or was never begun"))?;
        let parts = || MotionCore::parts(way.robot.clone(), handle, way.stop_on_drop);
        Ok(MotionCore::new(way.process.engine().enter(parts)))
    }

    /// Waits until the motion is made, and returns its handle, an object of this class.
    fn hand_over<'py>(&self, py: Python<'py>, handle: &Bound<'py, PyType>) -> PyResult<Bound<'py, PyAny>> {
        self.operation.get().wait(py)?;
        handle.call1((self.take()?,))
    }

    /// Stops the arm if there is a motion, taken or not. The call itself begins the stop. ``None`` if
    /// there is certainly no motion.
    fn give_up(&self, py: Python<'_>) -> PyResult<Option<Operation>> {
        self.stopping(py)
    }

    /// Gives up and waits for the stop through all signals, and adds the result to the exception that kept
    /// the caller from the handle.
    fn given_up(&self, py: Python<'_>, error: &Bound<'_, PyBaseException>) -> PyResult<()> {
        let Some(stopping) = self.stopping(py)? else { return Ok(()) };
        let insisted = stopping.insist(py)?;
        let report = match insisted.outcome {
            Ok(report) if report.is_none() => None,
            report => Some(report),
        };
        if let Some(report) = report {
            outcome::note(error, UNOWNED);
            outcome::tell(None, error, report)?;
        }
        insisted.raised.map_or(Ok(()), Err)
    }
}

const UNOWNED: &str = "the call ended after the motion had begun and before it returned the handle, \
                       so the client tried to stop the motion";
