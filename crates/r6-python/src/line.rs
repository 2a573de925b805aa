//! Connects an asyncio event loop to a connection. Calls begin in the loop's thread, and end there when it
//! reads.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::PyCFunction;
use r6_client::callback::{Call, CallbackHand};
use r6_client::{RequestError, Robot, RobotSettings};

use crate::operation::{Made, Work};
use crate::process::{Errand, Held, OfThisProcess, Process, Unheard};
use crate::wire::{self, Socket, Wire};

/// The connection of an `AsyncRobot`.
pub struct Line {
    wire: Arc<Wire>,
    hand: Arc<CallbackHand>,
    ended: Arc<Ended>,
    reader: Mutex<Option<Reader>>,
    /// Whether the event loop cannot watch sockets.
    unwatched: AtomicBool,
    /// The last field, because it must be dropped after the hand.
    _look: Look,
}

/// Wakes the keeper when it is dropped. The keeper ends once it has the only reference to the hand.
struct Look(Arc<Wire>);

impl Drop for Look {
    fn drop(&mut self) {
        self.0.look();
    }
}

/// A socket in the selector of an event loop. The callback in the selector holds the socket too, so the
/// socket is closed only after it was removed from the selector.
struct Reader {
    event_loop: Py<PyAny>,
    socket: Arc<Socket>,
}

/// Calls that have ended and were not reported yet.
#[derive(Default)]
struct Ended(Mutex<Vec<Arc<Record>>>);

/// A call of an asyncio task.
pub struct Record {
    /// `None` once it was reported or cancelled.
    asked: Mutex<Option<Asked>>,
    made: Mutex<Option<Made>>,
    ended: AtomicBool,
}

struct Asked {
    tell: Py<PyAny>,
    future: Py<PyAny>,
    held: Held,
    unheard: Option<Unheard>,
}

/// A call that has begun.
pub struct Calling {
    record: Arc<Record>,
    call: Call,
    line: Arc<Line>,
}

/// Ends a call in every case. Its Python objects are dropped only with the interpreter held.
struct Ending {
    record: Arc<Record>,
    ended: Arc<Ended>,
    wire: Arc<Wire>,
}

impl Drop for Ending {
    fn drop(&mut self) {
        self.wire.disengage();
        self.record.ended.store(true, Ordering::Release);
        locked(&self.ended.0).push(Arc::clone(&self.record));
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Ended {
    fn take(&self) -> Vec<Arc<Record>> {
        std::mem::take(&mut *locked(&self.0))
    }

    /// Passes ended calls to the thread that may take the interpreter. This runs on a thread of the engine.
    fn hand_on(&self, process: &Process) {
        for record in self.take() {
            let made = locked(&record.made).take();
            let asked = locked(&record.asked).take();
            if let Some(Asked { tell, future, held, unheard }) = asked {
                let held: Held = Arc::new(Mutex::new((future, held)));
                process.run(Errand { tell: Some(tell), made, held, unheard });
            }
        }
    }

    /// Reports ended calls. This runs in the thread of the event loop.
    fn settle(&self, py: Python<'_>) {
        for record in self.take() {
            let made = locked(&record.made).take();
            let asked = locked(&record.asked).take();
            if let (Some(asked), Some(made)) = (asked, made)
                && asked.settle(py, made).is_err()
                && let Some(unheard) = asked.unheard
            {
                // The event loop is closed.
                unheard();
            }
        }
    }
}

impl Asked {
    fn settle(&self, py: Python<'_>, made: Made) -> PyResult<()> {
        let future = self.future.bind(py);
        if future.call_method0(intern!(py, "done"))?.is_truthy()? {
            return Ok(());
        }
        match made(py) {
            Ok(value) => future.call_method1(intern!(py, "set_result"), (value,)),
            Err(error) => future.call_method1(intern!(py, "set_exception"), (error,)),
        }
        .map(drop)
    }
}

impl Line {
    /// Connects.
    pub async fn open(
        process: &'static Process,
        address: String,
        settings: RobotSettings,
    ) -> Result<(Arc<Self>, Robot), RequestError> {
        let ended = Arc::<Ended>::default();
        let handed_on = Arc::clone(&ended);
        let (wire, hand, robot) = wire::open(&address, settings, move || handed_on.hand_on(process)).await?;
        let (reader, unwatched) = (Mutex::default(), AtomicBool::new(false));
        let look = Look(Arc::clone(&wire));
        Ok((Arc::new(Self { wire, hand, ended, reader, unwatched, _look: look }), robot))
    }

    /// Lets this event loop read from the present socket. Returns `false` if it cannot, or if another event
    /// loop does.
    pub fn attach(self: &Arc<Self>, py: Python<'_>, event_loop: &Bound<'_, PyAny>) -> PyResult<bool> {
        if self.unwatched.load(Ordering::Relaxed) {
            return Ok(false);
        }
        let Some(socket) = self.wire.socket() else { return Ok(false) };
        let Some(descriptor) = socket.descriptor() else { return Ok(false) };
        let before = {
            let mut reader = locked(&self.reader);
            match &*reader {
                Some(reader) if Arc::ptr_eq(&reader.socket, &socket) && reader.event_loop.is(event_loop) => {
                    return Ok(true);
                }
                Some(_) | None => reader.take(),
            }
        };
        if let Some(before) = before {
            let other = before.event_loop.bind(py);
            let here = other.is(event_loop);
            if !here && !other.call_method0(intern!(py, "is_closed"))?.is_truthy()? {
                *locked(&self.reader) = Some(before);
                return Ok(false);
            }
            if here {
                before.leave(py);
            }
        }
        let kept = OfThisProcess::new((Arc::downgrade(self), Arc::clone(&socket)));
        let read = PyCFunction::new_closure(py, None, None, move |args, _| {
            let (line, socket) = kept.here()?;
            match line.upgrade() {
                Some(line) => line.read(args.py()),
                // The robot was dropped.
                None => {
                    let event_loop = running_loop(args.py())?;
                    event_loop.call_method1(intern!(args.py(), "remove_reader"), (socket.descriptor(),))?;
                }
            }
            Ok::<(), PyErr>(())
        })?;
        if event_loop.call_method1(intern!(py, "add_reader"), (descriptor, read)).is_err() {
            self.unwatched.store(true, Ordering::Relaxed);
            return Ok(false);
        }
        *locked(&self.reader) = Some(Reader { event_loop: event_loop.clone().unbind(), socket });
        Ok(true)
    }

    /// Reads, because the selector says that there are bytes.
    fn read(&self, py: Python<'_>) {
        self.wire.read_here(&self.hand);
        self.ended.settle(py);
        let present = self.wire.socket();
        let old = {
            let mut reader = locked(&self.reader);
            let is_old = |reader: &mut Reader| {
                !present.as_ref().is_some_and(|present| Arc::ptr_eq(present, &reader.socket))
            };
            reader.take_if(is_old)
        };
        if let Some(old) = old {
            old.leave(py);
        }
    }

    /// Begins a call, in the thread of the event loop that reads.
    pub fn begin(
        self: &Arc<Self>,
        py: Python<'_>,
        work: Work,
        tell: Py<PyAny>,
        future: Py<PyAny>,
    ) -> Calling {
        let Work { running, held, owed: _, unheard } = work;
        let asked = Asked { tell, future, held, unheard };
        let record = Arc::new(Record {
            asked: Mutex::new(Some(asked)),
            made: Mutex::default(),
            ended: AtomicBool::new(false),
        });
        self.wire.engage();
        let (ended, wire) = (Arc::clone(&self.ended), Arc::clone(&self.wire));
        let ending = Ending { record: Arc::clone(&record), ended, wire };
        let call = self.hand.call(async move {
            let ending = ending;
            let made = running.await;
            *locked(&ending.record.made) = Some(made);
        });
        self.ended.settle(py);
        Calling { record, call, line: Arc::clone(self) }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        let reader = locked(&self.reader).take();
        if let Some(reader) = reader {
            // While the interpreter shuts down, its selector no longer matters.
            Python::try_attach(|py| reader.leave_from_anywhere(py));
        }
    }
}

impl Reader {
    /// Removes the socket from the selector, in the thread of the event loop.
    fn leave(&self, py: Python<'_>) {
        let event_loop = self.event_loop.bind(py);
        // A closed event loop has removed it already.
        event_loop.call_method1(intern!(py, "remove_reader"), (self.socket.descriptor(),)).ok();
    }

    /// Removes the socket from the selector, in any thread. From another thread, the event loop does it in
    /// its next turn.
    fn leave_from_anywhere(self, py: Python<'_>) {
        // An object may be dropped while an exception is set.
        let on_its_way = PyErr::take(py);
        if running_loop(py).is_ok_and(|running| running.is(&self.event_loop)) {
            self.leave(py);
        } else {
            self.leave_soon(py).ok();
        }
        if let Some(error) = on_its_way {
            error.restore(py);
        }
    }

    /// Schedules the removal on the event loop. An error says that the event loop is closed, and so is its
    /// selector.
    fn leave_soon(self, py: Python<'_>) -> PyResult<()> {
        let event_loop = self.event_loop.clone_ref(py);
        let kept = OfThisProcess::new(self);
        let leave = PyCFunction::new_closure(py, None, None, move |args, _| {
            kept.here()?.leave(args.py());
            Ok::<(), PyErr>(())
        })?;
        event_loop.call_method1(py, intern!(py, "call_soon_threadsafe"), (leave,)).map(drop)
    }
}

/// The event loop that runs in this thread, or Python's `None`.
fn running_loop(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    py.import(intern!(py, "asyncio"))?.call_method0(intern!(py, "_get_running_loop"))
}

impl Calling {
    /// Drops the operation. Does nothing if it has ended.
    pub fn cancel(&self, py: Python<'_>) {
        if self.record.ended.load(Ordering::Acquire) {
            return;
        }
        let asked = locked(&self.record.asked).take();
        self.call.cancel();
        drop(asked);
        self.line.ended.settle(py);
    }
}
