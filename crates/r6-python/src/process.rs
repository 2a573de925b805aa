//! What this process runs on: one engine for all robots, and one thread that reports to asyncio.

use std::any::Any;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread::{self, JoinHandle};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::operation::Made;
use r6_client::StopsUnderWay;
use r6_client::blocking::Engine;
use tokio::sync::watch;

/// The services for all robots of one process. They live as long as the process.
pub struct Process {
    engine: Engine,
    errands: mpsc::Sender<Option<Errand>>,
    /// The thread that reports to asyncio, until the interpreter shuts down.
    telling: Mutex<Option<JoinHandle<()>>>,
    /// The number of operations that go on without a caller. The end of the program waits for them.
    owed: watch::Sender<usize>,
    /// The stops of each connection.
    stops: Mutex<Vec<StopsUnderWay>>,
    /// A fork does not copy threads, so whatever belongs to them is useless in the child.
    id: u32,
    here: Here,
}

/// Python objects that the result of an operation needs. They must be dropped with the interpreter held.
/// Otherwise they wait under a lock of `pyo3`, and a child that is forked then would wait for that lock for
/// ever.
pub type Held = Arc<dyn Any + Send + Sync>;

/// Work for the thread that reports to asyncio, with the interpreter held.
pub struct Errand {
    /// Called with an error or `None`, then the value; `None` if there is no caller to inform.
    pub tell: Option<Py<PyAny>>,
    /// The result to report; `None` if the caller gave up.
    pub made: Option<Made>,
    /// Dropped at the end.
    pub held: Held,
    /// What to do if the result cannot be reported, because the event loop is closed.
    pub unheard: Option<Unheard>,
}

/// What to do if no caller gets the result.
pub type Unheard = Box<dyn FnOnce() + Send>;

/// The holder of this lock has the interpreter too, and does not release it while it holds the lock. A fork
/// from Python needs the interpreter, so no child finds this locked.
static CURRENT: Mutex<Option<&'static Process>> = Mutex::new(None);

/// The number of forks from the first process to this one.
static FORKS: AtomicU64 = AtomicU64::new(0);

/// Identifies this process among those that forks have made. Comparing it is cheap and takes no lock.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Here(u64);

impl Here {
    fn now() -> Self {
        Self(FORKS.load(Ordering::Relaxed))
    }
}

/// Notes that this process is the child of a fork: what was made before is useless in it.
pub fn forked() {
    FORKS.fetch_add(1, Ordering::Relaxed);
}

impl Process {
    /// The services of this process. The first call starts them, and so does the first call in a child of a
    /// fork.
    pub fn current(py: Python<'_>) -> PyResult<&'static Self> {
        let mut current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
        match *current {
            Some(process) if process.is_here(py) => Ok(process),
            Some(_) | None => {
                let process: &'static Self = Box::leak(Box::new(Self::start()?));
                *current = Some(process);
                Ok(process)
            }
        }
    }

    /// The services of this process, if they were started.
    pub fn started(py: Python<'_>) -> Option<&'static Self> {
        let current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
        current.filter(|process| process.is_here(py))
    }

    fn start() -> PyResult<Self> {
        let (errands, to_run) = mpsc::channel();
        let telling =
            thread::Builder::new().name("r6 asyncio".to_owned()).spawn(move || tell_asyncio(&to_run))?;
        let telling = Mutex::new(Some(telling));
        let (owed, stops) = (watch::Sender::default(), Mutex::default());
        let (id, here) = (std::process::id(), Here::now());
        Ok(Self { engine: Engine::start()?, errands, telling, owed, stops, id, here })
    }

    /// The engine.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Runs work with the interpreter held: it informs an event loop or drops objects.
    pub fn run(&self, errand: Errand) {
        // The thread ends with the interpreter; after that no caller waits.
        let _ = self.errands.send(Some(errand));
    }

    /// Keeps track of the stops of a connection, until it is gone.
    pub fn connected(&self, stops: StopsUnderWay) {
        let mut known = self.stops.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|stops| !stops.are_gone());
        known.push(stops);
    }

    /// The stops that are under way now.
    pub fn stops_under_way(&self) -> Vec<StopsUnderWay> {
        let known = self.stops.lock().unwrap_or_else(PoisonError::into_inner);
        known.iter().filter(|stops| stops.any()).cloned().collect()
    }

    /// Waits until no operation is owed.
    pub async fn nothing_owed(&self) {
        // The wait cannot fail: `self` has the sender.
        self.owed.subscribe().wait_for(|owed| *owed == 0).await.ok();
    }

    /// Whether an operation is still running that the end of the program waits for.
    pub fn owes(&self) -> bool {
        *self.owed.borrow() > 0
    }

    /// Ends the thread that reports to asyncio, after it has done its work.
    pub fn end_telling(&self) {
        let _ = self.errands.send(None);
        if let Some(thread) = self.telling.lock().unwrap_or_else(PoisonError::into_inner).take() {
            // A panic of that thread was already reported.
            let _ = thread.join();
        }
    }

    /// Whether these are the services of this process. Also notices a fork that did not call
    /// `os.register_at_fork` hooks.
    pub fn is_here(&self, _py: Python<'_>) -> bool {
        if self.here == Here::now() && self.id != std::process::id() {
            forked();
        }
        self.here == Here::now()
    }
}

/// An operation that the end of the program waits for, until this is dropped.
pub struct Owed(&'static Process);

impl Owed {
    /// Counts an operation.
    pub fn by(process: &'static Process) -> Self {
        process.owed.send_modify(|owed| *owed += 1);
        Self(process)
    }
}

impl Drop for Owed {
    fn drop(&mut self) {
        self.0.owed.send_modify(|owed| *owed = owed.saturating_sub(1));
    }
}

/// The number of tasks of the engine: for tests that look for leaks.
#[pyfunction]
pub fn tasks(py: Python<'_>) -> PyResult<usize> {
    Ok(Process::current(py)?.engine().handle().metrics().num_alive_tasks())
}

/// Only this thread enters Python, and none of the engine's threads does. A thread that holds the interpreter
/// for long must not delay heartbeats, polls and paths.
fn tell_asyncio(errands: &mpsc::Receiver<Option<Errand>>) {
    while let Ok(Some(errand)) = errands.recv() {
        if Python::try_attach(|py| run(py, errand)).is_none() {
            return;
        }
    }
}

fn run(py: Python<'_>, Errand { tell, made, held, unheard }: Errand) {
    if let (Some(tell), Some(made)) = (tell, made) {
        let told = match made(py) {
            Ok(value) => tell.call1(py, (py.None(), value)),
            Err(error) => tell.call1(py, (error, py.None())),
        };
        // A closed event loop cannot take the result.
        if told.is_err()
            && let Some(unheard) = unheard
        {
            unheard();
        }
    }
    drop(held);
}

/// A value that belongs to the process that made it. In a child of a fork it is useless, and it is neither
/// locked nor dropped there, because both would wait for threads that the child does not have.
pub struct OfThisProcess<T> {
    here: Here,
    value: Option<T>,
}

impl<T> OfThisProcess<T> {
    /// A value of the present process.
    pub fn new(value: T) -> Self {
        Self { here: Here::now(), value: Some(value) }
    }

    /// The value, in the process that made it.
    pub fn here(&self) -> PyResult<&T> {
        match &self.value {
            Some(value) if self.here == Here::now() => Ok(value),
            Some(_) | None => Err(made_before_the_fork()),
        }
    }
}

/// The error of an object of the parent in the child.
pub fn made_before_the_fork() -> PyErr {
    PyRuntimeError::new_err(
        "this object was made before the process forked: connect again in the child, or start it with `spawn`",
    )
}

impl<T> Drop for OfThisProcess<T> {
    fn drop(&mut self) {
        if self.here != Here::now() {
            std::mem::forget(self.value.take());
        }
    }
}
