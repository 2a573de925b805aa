//! The socket of a blocking connection, and the attempts to make a new one.

use std::io::{self, ErrorKind};
use std::net::{IpAddr, Shutdown};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::Duration;

use r6_proto::time::Instant;

use super::system::{Stream, System};
use super::turns::{Now, READ_SLACK};
use crate::connection::{Connection, Wants};
use crate::error::NotSent;
use crate::hands::connect::Tcp;
use crate::pushed::LostReason;

/// The longest that a thread reads without coming back: what another thread does for it meanwhile, such as giving a lock back, it sees
/// only then. Setting it costs a system call, so it is made shorter only for a nearer deadline.
const LONGEST_READ: Duration = Duration::from_millis(50);

/// A write that waits for longer is given up and tried again: it holds up the other threads. Systems round it up by some milliseconds.
const LONGEST_WRITE: Duration = Duration::from_millis(2);

/// So long after a peer took nothing it is tried again.
const WRITE_AGAIN: Duration = Duration::from_millis(20);

/// How waiting for bytes ended.
pub(super) enum Came {
    /// So many bytes came, or the connection has ended.
    Read(io::Result<usize>),
    /// Nothing came in time.
    Nothing,
    /// A signal came to this thread.
    Signal,
}

/// A connected socket.
#[derive(Debug)]
pub(super) struct Socket {
    stream: Box<dyn Stream>,
    /// The time-out of a read as it is set, milliseconds.
    read_ms: AtomicU64,
    /// Whether the last read ended by it.
    was_idle: AtomicBool,
}

impl Socket {
    /// Until when the next read may wait. `latest`: when the thread that reads wants to be back.
    pub fn reads_until(&self, now: Now, latest: Option<Instant>) -> Instant {
        let until = now.at + Duration::from_millis(self.next_ms(now, latest));
        now.due.map_or(until, |due| due.min(until))
    }

    /// Sets the time-out of the next read to that.
    pub fn set_time_out(&self, now: Now, latest: Option<Instant>) {
        let ms = self.next_ms(now, latest);
        if ms != self.read_ms.load(Ordering::Relaxed) {
            // If that is refused, it stays as it was: the thread comes back later.
            self.stream.set_read_timeout(Duration::from_millis(ms)).ok();
            self.read_ms.store(ms, Ordering::Relaxed);
        }
    }

    /// Between quick replies it is made shorter in a few big steps, and never longer; exactly as long as it may be once nothing comes.
    fn next_ms(&self, now: Now, latest: Option<Instant>) -> u64 {
        let left = now.due.map_or(LONGEST_READ, |due| due.since(now.at));
        // Where no answer is due, the thread is back before the deadline and waits for it in a way that keeps it.
        let left = if now.awaits { left } else { left.saturating_sub(READ_SLACK) };
        let left = latest.map_or(left, |latest| latest.since(now.at).min(left));
        let left = millis(left.min(LONGEST_READ));
        let is_set = self.read_ms.load(Ordering::Relaxed);
        match self.was_idle.load(Ordering::Relaxed) {
            true => left,
            false if is_set > left => 1 << left.ilog2(),
            false => is_set,
        }
    }

    /// Waits for bytes.
    pub fn read(&self, buffer: &mut [u8]) -> Came {
        let came = match self.stream.read(buffer) {
            // Not tried again here: the system would wait for the whole time once more.
            Err(error) if error.kind() == ErrorKind::Interrupted => Came::Signal,
            Err(error) if is_time_out(&error) => Came::Nothing,
            read => Came::Read(read),
        };
        self.was_idle.store(matches!(came, Came::Nothing), Ordering::Relaxed);
        came
    }

    /// Reads what is there; `None`: nothing is.
    fn read_now(&self, buffer: &mut [u8]) -> Option<io::Result<usize>> {
        unless_nothing_came(|| self.stream.read_now(buffer))
    }
}

/// At least one: none would mean for ever.
fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_micros().div_ceil(1000)).unwrap_or(u64::MAX).max(1)
}

/// What came of reading; `None`: nothing came.
fn unless_nothing_came(mut read: impl FnMut() -> io::Result<usize>) -> Option<io::Result<usize>> {
    loop {
        match read() {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if is_time_out(&error) => return None,
            other => return Some(other),
        }
    }
}

/// Whether our own time-out ended it. Elsewhere than on Windows the other word means that the peer is gone.
fn is_time_out(error: &io::Error) -> bool {
    error.kind() == ErrorKind::WouldBlock || (cfg!(windows) && error.kind() == ErrorKind::TimedOut)
}

/// How a connection ended that takes or gives nothing any more.
pub(super) fn reason(ended: io::Result<usize>) -> LostReason {
    ended.map_or_else(|error| LostReason::Io(error.kind()), |_none| LostReason::ClosedByPeer)
}

/// What carries the bytes of one connection through all its lives. It is locked behind the connection, never before.
#[derive(Debug)]
pub(super) struct Line {
    target: Tcp,
    system: Arc<dyn System>,
    connect_timeout: Duration,
    /// A second connection is not made anew.
    only_once: bool,
    socket: Option<Arc<Socket>>,
    /// Whether our side of the connection was ended.
    shut: bool,
    /// When a peer that took nothing is tried again.
    again_at: Option<Instant>,
    /// Until when an attempt to connect may take.
    attempt: Option<Instant>,
    /// The thread that tries. It may hang in the name lookup for longer than its attempt; the next attempt takes what it brings.
    trying: Option<Arc<Mutex<Option<Made>>>>,
}

pub(super) type Made = Result<Box<dyn Stream>, NotSent>;

impl Line {
    pub fn new(
        target: Tcp,
        system: Arc<dyn System>,
        stream: Box<dyn Stream>,
        connect_timeout: Duration,
        only_once: bool,
    ) -> Self {
        let mut this = Self {
            target,
            system,
            connect_timeout,
            only_once,
            socket: None,
            shut: false,
            again_at: None,
            attempt: None,
            trying: None,
        };
        this.open(stream);
        this
    }

    pub fn socket(&self) -> Option<&Arc<Socket>> {
        self.socket.as_ref()
    }

    pub fn is(&self, socket: &Arc<Socket>) -> bool {
        self.socket.as_ref().is_some_and(|own| Arc::ptr_eq(own, socket))
    }

    /// Reads what is there. Nobody may be reading.
    pub fn glance(&self, buffer: &mut [u8]) -> Option<(Arc<Socket>, io::Result<usize>)> {
        let socket = self.socket.as_ref()?;
        Some((Arc::clone(socket), socket.read_now(buffer)?))
    }

    /// When it has to be looked after.
    pub fn deadline(&self) -> Option<Instant> {
        [self.again_at, self.attempt].into_iter().flatten().min()
    }

    pub fn open(&mut self, stream: Box<dyn Stream>) {
        let set = stream.set_read_timeout(LONGEST_READ);
        set.and(stream.set_write_timeout(LONGEST_WRITE)).ok();
        let read_ms = AtomicU64::new(millis(LONGEST_READ));
        self.socket = Some(Arc::new(Socket { stream, read_ms, was_idle: AtomicBool::new(false) }));
        (self.shut, self.again_at, self.attempt) = (false, None, None);
    }

    /// Lets go of the socket. A thread that reads comes back by that.
    pub fn close(&mut self) {
        if let Some(socket) = self.socket.take() {
            socket.stream.shutdown(Shutdown::Both).ok();
        }
        (self.shut, self.again_at) = (false, None);
    }

    /// Writes what waits; whether the connection went on to another phase.
    pub fn write(&mut self, connection: &mut Connection, wants: Wants, now: Instant) -> bool {
        let ended = loop {
            let Some(socket) = &self.socket else { break Ok(0) };
            let output = connection.output(now);
            if output.is_empty() {
                self.again_at = None;
                if wants == Wants::Carry || self.shut {
                    return false;
                }
                self.shut = true;
                match socket.stream.shutdown(Shutdown::Write) {
                    Ok(()) => return false,
                    Err(error) => break Err(error),
                }
            }
            if self.again_at.is_some_and(|at| at > now) {
                return false;
            }
            let length = output.len();
            match socket.stream.write(output) {
                Ok(bytes) if bytes > 0 => {
                    connection.written(bytes);
                    // The peer took a part in time.
                    self.again_at = (bytes < length).then(|| now + WRITE_AGAIN);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if is_time_out(&error) => {
                    self.again_at = Some(now + WRITE_AGAIN);
                    return false;
                }
                ended => break ended,
            }
            connection.go_on(now);
            if connection.wants() != wants {
                return true;
            }
        };
        self.close();
        connection.lost(reason(ended), now);
        true
    }

    /// Goes on with an attempt to connect; what came of it. `done`: called by the thread that tries, at its end.
    pub fn connect(&mut self, now: Instant, done: impl FnOnce() + Send + 'static) -> Option<Made> {
        if self.only_once {
            let once = io::Error::new(ErrorKind::NotConnected, "this connection is not made anew");
            return Some(Err(unreachable(&self.target, &once)));
        }
        let until = *self.attempt.get_or_insert(now + self.connect_timeout);
        if self.trying.is_none() {
            let made = Arc::<Mutex<Option<Made>>>::default();
            let (target, within, told) = (self.target.clone(), self.connect_timeout, Arc::clone(&made));
            let system = Arc::clone(&self.system);
            let spawned = spawn(&*self.system, "r6-connect", move || {
                let result = dial(&*system, &target, within);
                *told.lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
                done();
            });
            if let Err(error) = spawned {
                self.attempt = None;
                return Some(Err(error));
            }
            self.trying = Some(made);
        }
        let made = self.tried().or_else(|| {
            let over =
                NotSent::ConnectTimedOut { address: self.target.to_string(), after: self.connect_timeout };
            (until <= now).then_some(Err(over))
        })?;
        self.attempt = None;
        Some(made)
    }

    /// No connection is wanted: one that is made nevertheless is closed.
    pub fn give_up(&mut self) {
        self.attempt = None;
        if self.trying.is_some() {
            drop(self.tried());
        }
    }

    fn tried(&mut self) -> Option<Made> {
        let made = self.trying.as_ref()?.lock().unwrap_or_else(PoisonError::into_inner).take()?;
        self.trying = None;
        Some(made)
    }
}

/// Starts a thread of a blocking connection.
pub(super) fn spawn(
    system: &dyn System,
    name: &str,
    what: impl FnOnce() + Send + 'static,
) -> Result<(), NotSent> {
    let spawned = system.spawn(name, Box::new(what));
    spawned.map_err(|error| NotSent::NoEngine { detail: error.to_string() })
}

/// Connects within this time. A name is looked up on another thread, because that can take longer.
pub(super) fn dial_within(system: &Arc<dyn System>, target: &Tcp, within: Duration) -> Made {
    if target.host().parse::<IpAddr>().is_ok() {
        return dial(&**system, target, within);
    }
    let (tell, told) = mpsc::sync_channel(1);
    let (looking_up, on) = (target.clone(), Arc::clone(system));
    spawn(&**system, "r6-connect", move || {
        // Too late, it is closed.
        tell.send(dial(&*on, &looking_up, within)).ok();
    })?;
    let over = NotSent::ConnectTimedOut { address: target.to_string(), after: within };
    told.recv_timeout(within).unwrap_or(Err(over))
}

/// Connects to the first of the target's addresses that answers.
pub(super) fn dial(system: &dyn System, target: &Tcp, within: Duration) -> Made {
    let begun = system.now();
    system.connect(target.host(), target.port(), within).map_err(|error| {
        if system.now().saturating_sub(begun) >= within {
            NotSent::ConnectTimedOut { address: target.to_string(), after: within }
        } else {
            unreachable(target, &error)
        }
    })
}

fn unreachable(target: &Tcp, error: &io::Error) -> NotSent {
    NotSent::Unreachable { address: target.to_string(), kind: error.kind(), detail: error.to_string() }
}
