//! A system for the blocking driver on tokio's paused clock: it uses real threads, and one of them runs at a
//! time.
//!
//! ```text
//!  a thread:   runs ──▶ parks, reads, sleeps or connects: gives the turn back, and waits for
//!              bytes, a call or a time
//!  the pump:   gives the turn to the next thread that can continue, and waits for it; meanwhile the runtime
//!              stands still
//!  no thread can continue:  the runtime's other tasks run; if none can either, its clock jumps to the next
//!              deadline
//! ```
//!
//! The same test makes the same turns each time, and hours of its clock pass at once.

use std::any::Any;
use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::future::poll_fn;
use std::io;
use std::net::Shutdown;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::{Pin, pin};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::task::{Context, Poll, Wake, Waker};
use std::time::Duration;

use r6_client::blocking::simulated::{Parked, Stream, System};
use tokio::io::{AsyncRead as _, AsyncWrite as _, ReadBuf};
use tokio::runtime::Handle;
use tokio::time::{Instant, sleep_until};

use super::dial::{Carrier, Dial};

/// A thread that neither waits nor ends for this long, in real time, waits for something that this system
/// does not control: a lock.
const STUCK: Duration = Duration::from_secs(60);

/// Stands for "no deadline".
const FAR: Duration = Duration::from_secs(86_400);

/// What a thread waits for, besides a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum For {
    /// A call of another thread.
    Call,
    /// Its socket, or its attempt to connect.
    Bytes,
    Nothing,
}

struct Thread {
    name: String,
    /// What it waits for, and until when.
    waits: Option<(For, Option<Instant>)>,
    called: bool,
    has_bytes: bool,
    go: Arc<Condvar>,
}

#[derive(Default)]
struct Inner {
    threads: BTreeMap<usize, Thread>,
    made: usize,
    /// The threads that can continue.
    ready: VecDeque<usize>,
    running: Option<usize>,
    pump: Option<Waker>,
    panicked: Option<Box<dyn Any + Send>>,
    diallers: Vec<Arc<dyn Dial>>,
}

/// The threads of one test.
pub struct Lockstep {
    runtime: Handle,
    begun: Instant,
    inner: Mutex<Inner>,
    turn_over: Condvar,
}

thread_local! {
    /// The number of this thread within its system.
    static ME: RefCell<Option<(Arc<Lockstep>, usize)>> = const { RefCell::new(None) };
}

/// This thread and its system. The thread must belong to a lockstep.
fn me() -> (Arc<Lockstep>, usize) {
    ME.with_borrow(|me| me.clone().expect("only threads of the system wait in it"))
}

impl Inner {
    fn make_ready(&mut self, id: usize, why: For) {
        let Some(thread) = self.threads.get_mut(&id) else { return };
        match why {
            For::Call => thread.called = true,
            For::Bytes => thread.has_bytes = true,
            For::Nothing => {}
        }
        if thread.waits.is_some_and(|(what, _)| what == why) && !self.ready.contains(&id) {
            self.ready.push_back(id);
            self.wake_pump();
        }
    }

    fn wake_pump(&self) {
        if let Some(pump) = &self.pump {
            pump.wake_by_ref();
        }
    }

    /// Threads whose time is over can continue.
    fn end_waits(&mut self, now: Instant) {
        let until = |thread: &Thread| thread.waits.and_then(|(_, until)| until);
        let due = self.threads.iter().filter_map(|(id, thread)| Some((until(thread)?, *id)));
        let mut due: Vec<_> = due.filter(|(at, id)| *at <= now && !self.ready.contains(id)).collect();
        due.sort_unstable();
        self.ready.extend(due.into_iter().map(|(_, id)| id));
    }

    fn next_deadline(&self) -> Option<Instant> {
        self.threads.values().filter_map(|thread| thread.waits?.1).min()
    }
}

impl Lockstep {
    /// Creates a system without threads, on the present runtime.
    pub fn new(runtime: Handle) -> Arc<Self> {
        let begun = {
            let _inside = runtime.enter();
            Instant::now()
        };
        Arc::new(Self { runtime, begun, inner: Mutex::default(), turn_over: Condvar::new() })
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap()
    }

    /// The number of threads.
    pub fn threads(&self) -> usize {
        self.inner().threads.len()
    }

    pub fn names(&self) -> Vec<String> {
        self.inner().threads.values().map(|thread| thread.name.clone()).collect()
    }

    /// The address that represents this dialler.
    pub fn address_of(&self, dialler: Arc<dyn Dial>) -> String {
        let mut inner = self.inner();
        inner.diallers.push(dialler);
        format!("10.0.0.1:{}", inner.diallers.len())
    }

    pub fn start(self: &Arc<Self>, name: &str, what: Box<dyn FnOnce() + Send>) {
        let go = Arc::new(Condvar::new());
        let id = {
            let mut inner = self.inner();
            let id = inner.made;
            inner.made += 1;
            let thread = Thread {
                name: name.to_owned(),
                waits: None,
                called: false,
                has_bytes: false,
                go: Arc::clone(&go),
            };
            inner.threads.insert(id, thread);
            inner.ready.push_back(id);
            inner.wake_pump();
            id
        };
        let system = Arc::clone(self);
        let spawned = std::thread::Builder::new().name(name.to_owned()).spawn(move || {
            drop(system.wait_for_turn(system.inner(), id, &go));
            ME.set(Some((Arc::clone(&system), id)));
            let inside = system.runtime.enter();
            let ended = catch_unwind(AssertUnwindSafe(what));
            drop(inside);
            let mut inner = system.inner();
            inner.threads.remove(&id);
            if let Err(panic) = ended {
                inner.panicked.get_or_insert(panic);
            }
            inner.running = None;
            system.turn_over.notify_one();
        });
        spawned.unwrap();
    }

    fn wait_for_turn<'s>(
        &self,
        mut inner: MutexGuard<'s, Inner>,
        id: usize,
        go: &Condvar,
    ) -> MutexGuard<'s, Inner> {
        while inner.running != Some(id) {
            inner = go.wait(inner).unwrap();
        }
        inner
    }

    /// Gives back the turn of the calling thread until this happens.
    fn wait(&self, what: For, until: Option<Instant>) {
        let (_, id) = me();
        let mut inner = self.inner();
        let thread = inner.threads.get_mut(&id).unwrap();
        let came = match what {
            For::Call => std::mem::take(&mut thread.called),
            For::Bytes => std::mem::take(&mut thread.has_bytes),
            For::Nothing => false,
        };
        if came {
            return;
        }
        thread.waits = Some((what, until));
        let go = Arc::clone(&thread.go);
        inner.running = None;
        self.turn_over.notify_one();
        let mut inner = self.wait_for_turn(inner, id, &go);
        let thread = inner.threads.get_mut(&id).unwrap();
        thread.waits = None;
        match what {
            For::Call => thread.called = false,
            For::Bytes => thread.has_bytes = false,
            For::Nothing => {}
        }
    }

    /// Lets the next thread that can continue run until it waits. Returns `false` if none can.
    fn turn(&self) -> bool {
        let mut inner = self.inner();
        inner.end_waits(Instant::now());
        let Some(id) = inner.ready.pop_front() else { return false };
        inner.running = Some(id);
        inner.threads[&id].go.notify_one();
        while inner.running.is_some() {
            let (guard, waited) = self.turn_over.wait_timeout(inner, STUCK).unwrap();
            inner = guard;
            if waited.timed_out() && inner.running.is_some() {
                let name = inner.threads[&id].name.clone();
                drop(inner);
                panic!("the thread {name} neither waits nor ends");
            }
        }
        true
    }

    /// Runs the threads until all of them wait and this condition holds.
    pub async fn pump(&self, mut over: impl FnMut() -> bool) -> Result<(), Box<dyn Any + Send>> {
        let mut timer = pin!(sleep_until(Instant::now() + FAR));
        poll_fn(|cx| {
            self.inner().pump = Some(cx.waker().clone());
            // The runtime's tasks run between two threads.
            if self.turn() {
                cx.waker().wake_by_ref();
                return Poll::Pending;
            }
            if let Some(panic) = self.inner().panicked.take() {
                return Poll::Ready(Err(panic));
            }
            if over() {
                return Poll::Ready(Ok(()));
            }
            if let Some(next) = self.inner().next_deadline() {
                timer.as_mut().reset(next);
                if timer.as_mut().poll(cx).is_ready() {
                    cx.waker().wake_by_ref();
                }
            }
            Poll::Pending
        })
        .await
    }

    /// A waker for the calling thread while it waits for this.
    fn waker(self: &Arc<Self>, why: For) -> Waker {
        let (system, id) = me();
        Waker::from(Arc::new(Wakes { system, id, why }))
    }

    /// Runs a future of the calling thread, which drives nothing meanwhile.
    pub fn block_on<F: Future>(self: &Arc<Self>, future: F) -> F::Output {
        let mut future = pin!(future);
        let waker = self.waker(For::Bytes);
        loop {
            if let Poll::Ready(output) = future.as_mut().poll(&mut Context::from_waker(&waker)) {
                return output;
            }
            self.wait(For::Bytes, None);
        }
    }
}

impl fmt::Debug for Lockstep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Lockstep")
    }
}

/// Wakes one thread.
#[derive(Debug)]
struct Wakes {
    system: Arc<Lockstep>,
    id: usize,
    why: For,
}

impl Wake for Wakes {
    fn wake(self: Arc<Self>) {
        self.system.inner().make_ready(self.id, self.why);
    }
}

impl Parked for Wakes {
    fn park(&self, within: Option<Duration>) {
        self.system.wait(For::Call, within.map(|time| Instant::now() + time));
    }

    fn unpark(&self) {
        self.system.inner().make_ready(self.id, self.why);
    }
}

/// The system in the form that the driver uses.
#[derive(Debug)]
pub struct Its(pub Arc<Lockstep>);

impl System for Its {
    fn now(&self) -> Duration {
        let _inside = self.0.runtime.enter();
        self.0.begun.elapsed()
    }

    fn sleep(&self, time: Duration) {
        self.0.wait(For::Nothing, Some(Instant::now() + time));
    }

    fn this_thread(&self) -> Arc<dyn Parked> {
        let (system, id) = me();
        Arc::new(Wakes { system, id, why: For::Call })
    }

    fn spawn(&self, name: &str, what: Box<dyn FnOnce() + Send>) -> io::Result<()> {
        self.0.start(name, what);
        Ok(())
    }

    fn connect(&self, _host: &str, port: u16, within: Duration) -> io::Result<Box<dyn Stream>> {
        let dialler = Arc::clone(&self.0.inner().diallers[usize::from(port) - 1]);
        let until = Instant::now() + within;
        let mut attempt = dialler.dial();
        let waker = self.0.waker(For::Bytes);
        loop {
            match attempt.as_mut().poll(&mut Context::from_waker(&waker)) {
                Poll::Ready(made) => {
                    let stream = Mutex::new(Some(made?));
                    let (system, reader) = (Arc::clone(&self.0), Mutex::default());
                    let within = Mutex::new(FAR);
                    return Ok(Box::new(Socket { system, stream, reader, within }));
                }
                Poll::Pending if Instant::now() >= until => return Err(io::ErrorKind::TimedOut.into()),
                Poll::Pending => self.0.wait(For::Bytes, Some(until)),
            }
        }
    }
}

/// A stream in memory that threads read.
struct Socket {
    system: Arc<Lockstep>,
    stream: Mutex<Option<Box<dyn Carrier>>>,
    /// The waker of the reading thread.
    reader: Mutex<Option<Waker>>,
    /// The read timeout.
    within: Mutex<Duration>,
}

impl fmt::Debug for Socket {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Socket")
    }
}

impl Socket {
    fn poll_read(&self, cx: &mut Context<'_>, buffer: &mut [u8]) -> Poll<io::Result<usize>> {
        let mut stream = self.stream.lock().unwrap();
        // The stream was shut down.
        let Some(stream) = &mut *stream else { return Poll::Ready(Ok(0)) };
        let mut buffer = ReadBuf::new(buffer);
        let read = Pin::new(stream).poll_read(cx, &mut buffer);
        read.map_ok(|()| buffer.filled().len())
    }
}

fn would_block() -> io::Error {
    io::ErrorKind::WouldBlock.into()
}

impl Stream for Socket {
    fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        let until = Instant::now() + *self.within.lock().unwrap();
        let waker = self.system.waker(For::Bytes);
        *self.reader.lock().unwrap() = Some(waker.clone());
        loop {
            match self.poll_read(&mut Context::from_waker(&waker), buffer) {
                Poll::Ready(read) => return read,
                Poll::Pending if Instant::now() >= until => return Err(would_block()),
                Poll::Pending => self.system.wait(For::Bytes, Some(until)),
            }
        }
    }

    fn read_now(&self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.poll_read(&mut Context::from_waker(Waker::noop()), buffer) {
            Poll::Ready(read) => read,
            Poll::Pending => Err(would_block()),
        }
    }

    fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        let mut stream = self.stream.lock().unwrap();
        let Some(stream) = &mut *stream else { return Err(io::ErrorKind::BrokenPipe.into()) };
        match Pin::new(stream).poll_write(&mut Context::from_waker(Waker::noop()), bytes) {
            Poll::Ready(written) => written,
            // The write timeout counts as over at once.
            Poll::Pending => Err(would_block()),
        }
    }

    fn set_read_timeout(&self, within: Duration) -> io::Result<()> {
        *self.within.lock().unwrap() = within;
        Ok(())
    }

    fn set_write_timeout(&self, _within: Duration) -> io::Result<()> {
        Ok(())
    }

    fn shutdown(&self, how: Shutdown) -> io::Result<()> {
        if how == Shutdown::Write {
            let mut stream = self.stream.lock().unwrap();
            let Some(stream) = &mut *stream else { return Err(io::ErrorKind::NotConnected.into()) };
            return match Pin::new(stream).poll_shutdown(&mut Context::from_waker(Waker::noop())) {
                Poll::Ready(ended) => ended,
                Poll::Pending => panic!("a stream in memory ends at once"),
            };
        }
        let stream = self.stream.lock().unwrap().take();
        drop(stream);
        if let Some(reader) = self.reader.lock().unwrap().take() {
            reader.wake();
        }
        Ok(())
    }
}
