//! The socket of a blocking connection, and the attempts to reconnect.

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

/// The longest time that a thread reads without returning. Only when it returns does it see what another
/// thread does for it meanwhile, such as giving a lock back. Setting the timeout costs a system call, so it
/// is made shorter only for a nearer deadline.
const LONGEST_READ: Duration = Duration::from_millis(50);

/// A write that waits longer than this is given up and retried later, because it blocks the other threads.
/// Systems round this up by some milliseconds.
const LONGEST_WRITE: Duration = Duration::from_millis(2);

/// The client retries writing this long after a peer accepted nothing.
const WRITE_AGAIN: Duration = Duration::from_millis(20);

/// How a wait for bytes ended.
pub(super) enum Came {
    /// This many bytes came, or the connection has ended.
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
    /// The read timeout as set on the socket, in milliseconds.
    read_ms: AtomicU64,
    /// Whether the last read ended by its timeout.
    was_idle: AtomicBool,
}

impl Socket {
    /// The time until which the next read may wait. `latest`: when the reading thread wants to be back.
    pub fn reads_until(&self, now: Now, latest: Option<Instant>) -> Instant {
        let until = now.at + Duration::from_millis(self.next_ms(now, latest));
        now.due.map_or(until, |due| due.min(until))
    }

    /// Sets the timeout of the next read accordingly.
    pub fn set_time_out(&self, now: Now, latest: Option<Instant>) {
        let ms = self.next_ms(now, latest);
        if ms != self.read_ms.load(Ordering::Relaxed) {
            // If the system refuses, the old timeout stays: the thread returns later.
            self.stream.set_read_timeout(Duration::from_millis(ms)).ok();
            self.read_ms.store(ms, Ordering::Relaxed);
        }
    }

    /// Calculates the next read timeout, in milliseconds. Between quick replies the timeout is shortened in a
    /// few big steps and never lengthened. After a read that brought nothing, it is set exactly.
    fn next_ms(&self, now: Now, latest: Option<Instant>) -> u64 {
        let left = now.due.map_or(LONGEST_READ, |due| due.since(now.at));
        // If no reply is due, the thread returns before the deadline and waits for it by parking, which keeps
        // the deadline exactly.
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
            // Not retried here: the system would wait for the whole time once more.
            Err(error) if error.kind() == ErrorKind::Interrupted => Came::Signal,
            Err(error) if is_time_out(&error) => Came::Nothing,
            read => Came::Read(read),
        };
        self.was_idle.store(matches!(came, Came::Nothing), Ordering::Relaxed);
        came
    }

    /// Reads the bytes that are there; `None` if there are none.
    fn read_now(&self, buffer: &mut [u8]) -> Option<io::Result<usize>> {
        unless_nothing_came(|| self.stream.read_now(buffer))
    }
}

/// Converts to milliseconds, at least one, because zero would mean "wait for ever".
fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_micros().div_ceil(1000)).unwrap_or(u64::MAX).max(1)
}

/// Reads, and returns `None` if nothing came.
fn unless_nothing_came(mut read: impl FnMut() -> io::Result<usize>) -> Option<io::Result<usize>> {
    loop {
        match read() {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if is_time_out(&error) => return None,
            other => return Some(other),
        }
    }
}

/// Whether our own timeout ended the call. On other systems than Windows, `TimedOut` means that the peer is
/// gone.
fn is_time_out(error: &io::Error) -> bool {
    error.kind() == ErrorKind::WouldBlock || (cfg!(windows) && error.kind() == ErrorKind::TimedOut)
}

/// Why a connection ended that can no longer be read or written.
pub(super) fn reason(ended: io::Result<usize>) -> LostReason {
    ended.map_or_else(|error| LostReason::Io(error.kind()), |_none| LostReason::ClosedByPeer)
}

/// Carries the bytes of one connection across all its reconnections. Lock order: the connection first, then
/// the line.
#[derive(Debug)]
pub(super) struct Line {
    target: Tcp,
    system: Arc<dyn System>,
    connect_timeout: Duration,
    /// Set for a second connection, which is never reconnected.
    only_once: bool,
    socket: Option<Arc<Socket>>,
    /// Whether our side of the connection was shut down.
    shut: bool,
    /// When to retry writing to a peer that accepted nothing.
    again_at: Option<Instant>,
    /// The time at which the attempt to connect is given up.
    attempt: Option<Instant>,
    /// The result of the thread that connects. The name lookup may block that thread longer than its attempt;
    /// then the next attempt takes its result.
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

    /// Reads the bytes that are there. No thread may be reading.
    pub fn glance(&self, buffer: &mut [u8]) -> Option<(Arc<Socket>, io::Result<usize>)> {
        let socket = self.socket.as_ref()?;
        Some((Arc::clone(socket), socket.read_now(buffer)?))
    }

    /// The time at which the line needs attention.
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

    /// Closes the socket. This makes a reading thread return.
    pub fn close(&mut self) {
        if let Some(socket) = self.socket.take() {
            socket.stream.shutdown(Shutdown::Both).ok();
        }
        (self.shut, self.again_at) = (false, None);
    }

    /// Writes what waits. Returns whether the connection changed to another phase.
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
                    // The peer accepted a part in time.
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

    /// Continues an attempt to connect, or starts one. Returns its result once there is one. The connecting
    /// thread calls `done` at its end.
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

    /// Gives up connecting. A connection that is made nevertheless is closed.
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

/// Connects within this time. A name is looked up on another thread, because the lookup can take longer.
pub(super) fn dial_within(system: &Arc<dyn System>, target: &Tcp, within: Duration) -> Made {
    if target.host().parse::<IpAddr>().is_ok() {
        return dial(&**system, target, within);
    }
    let (tell, told) = mpsc::sync_channel(1);
    let (looking_up, on) = (target.clone(), Arc::clone(system));
    spawn(&**system, "r6-connect", move || {
        // If the receiver is gone, the connection came too late and is closed.
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
