//! What this process runs on: one engine for all robots, and one thread that tells asyncio.

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

/// What serves the robots of one process. It lives as long as the process.
pub struct Process {
    engine: Engine,
    errands: mpsc::Sender<Option<Errand>>,
    /// The thread that tells asyncio, until the interpreter ends.
    telling: Mutex<Option<JoinHandle<()>>>,
    /// Operations that go on whoever gives up waiting, and that the end of the program waits for.
    owed: watch::Sender<usize>,
    /// The stops of each connection that was made.
    stops: Mutex<Vec<StopsUnderWay>>,
    /// A fork leaves the threads behind: whatever belongs to them is of no use in the child.
    id: u32,
    here: Here,
}

/// Python objects that an operation needs for its result. They are only dropped with the interpreter at hand: what else drops
/// them waits its turn under a lock of `pyo3`, and a child that is forked meanwhile would wait for that lock for ever.
pub type Held = Arc<dyn Any + Send + Sync>;

/// What the thread that tells asyncio does with the interpreter at hand.
pub struct Errand {
    /// Called with an error or `None`, then the value; `None` if nobody wants to know.
    pub tell: Option<Py<PyAny>>,
    /// What to tell; `None` if it was given up.
    pub made: Option<Made>,
    /// What is dropped then.
    pub held: Held,
    /// What is done if it cannot be told: the event loop is closed.
    pub unheard: Option<Unheard>,
}

/// What is done where nobody hears of a result.
pub type Unheard = Box<dyn FnOnce() + Send>;

/// Whoever has this has the interpreter too, and does not let it go meanwhile. A fork from Python needs the interpreter, so that no
/// child finds it locked.
static CURRENT: Mutex<Option<&'static Process>> = Mutex::new(None);

/// The forks that led from the first process to this one.
static FORKS: AtomicU64 = AtomicU64::new(0);

/// Which process of those that forks made of the first one. To look costs nothing and takes no lock.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Here(u64);

impl Here {
    fn now() -> Self {
        Self(FORKS.load(Ordering::Relaxed))
    }
}

/// This process is the child of a fork: what was made before is of no use in it.
pub fn forked() {
    FORKS.fetch_add(1, Ordering::Relaxed);
}

impl Process {
    /// The one of this process; the first call starts it, and so does the first call in a child of a fork.
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

    /// The one of this process, if it was started.
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

    /// Has something done with the interpreter at hand: an event loop told, objects dropped.
    pub fn run(&self, errand: Errand) {
        // The thread ends with the interpreter; then nobody waits any more.
        let _ = self.errands.send(Some(errand));
    }

    /// Keeps the stops of a connection in mind, until it is gone.
    pub fn connected(&self, stops: StopsUnderWay) {
        let mut known = self.stops.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|stops| !stops.are_gone());
        known.push(stops);
    }

    /// The stops that are under way now, whoever asked for them.
    pub fn stops_under_way(&self) -> Vec<StopsUnderWay> {
        let known = self.stops.lock().unwrap_or_else(PoisonError::into_inner);
        known.iter().filter(|stops| stops.any()).cloned().collect()
    }

    /// Ends once nothing is owed any more.
    pub async fn nothing_owed(&self) {
        // The sender is here.
        self.owed.subscribe().wait_for(|owed| *owed == 0).await.ok();
    }

    /// Whether something goes on that the end of the program waits for.
    pub fn owes(&self) -> bool {
        *self.owed.borrow() > 0
    }

    /// Ends the thread that tells asyncio: what it was given is told before.
    pub fn end_telling(&self) {
        let _ = self.errands.send(None);
        if let Some(thread) = self.telling.lock().unwrap_or_else(PoisonError::into_inner).take() {
            // A panic of that thread was already reported by it.
            let _ = thread.join();
        }
    }

    /// Whether it is the one of this process. A fork that Python was not told of (`os.register_at_fork`) is noticed here.
    pub fn is_here(&self, _py: Python<'_>) -> bool {
        if self.here == Here::now() && self.id != std::process::id() {
            forked();
        }
        self.here == Here::now()
    }
}

/// Something that the end of the program waits for; over when this is dropped.
pub struct Owed(&'static Process);

impl Owed {
    /// By this process.
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

/// How many tasks the engine has: for tests that look for leaks.
#[pyfunction]
pub fn tasks(py: Python<'_>) -> PyResult<usize> {
    Ok(Process::current(py)?.engine().handle().metrics().num_alive_tasks())
}

/// Python is entered here and nowhere on the engine's threads: whoever holds the interpreter for long, a busy thread or
/// a slow extension, must not hold up heartbeats, polls and paths.
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
        // A loop that was closed wants to know nothing.
        if told.is_err()
            && let Some(unheard) = unheard
        {
            unheard();
        }
    }
    drop(held);
}

/// Something that belongs to the process that made it: of no use in a child of a fork, and neither locked nor dropped there. Both
/// would wait for threads that the child does not have.
pub struct OfThisProcess<T> {
    here: Here,
    value: Option<T>,
}

impl<T> OfThisProcess<T> {
    /// Of the present process.
    pub fn new(value: T) -> Self {
        Self { here: Here::now(), value: Some(value) }
    }

    /// The thing, in the process that made it.
    pub fn here(&self) -> PyResult<&T> {
        match &self.value {
            Some(value) if self.here == Here::now() => Ok(value),
            Some(_) | None => Err(made_before_the_fork()),
        }
    }
}

/// What an object of the parent raises in the child.
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
