//! The connection of an `AsyncRobot`: one socket that two threads serve, whichever comes first.
//!
//! ```text
//!  thread of the event loop:  begins a call and writes its request at once; reads when its selector says so
//!  the engine's keeper:       timeouts, heartbeats, stops, streams, a new connection; it also reads bytes
//!                             that the event loop has left for 2 ms
//! ```
//!
//! So a query needs one thread. A program that holds the interpreter, or has closed its event loop, delays
//! nothing.

use std::future::{Future, pending};
use std::io::{self, ErrorKind, Read as _, Write as _};
use std::mem::replace;
use std::net::{Shutdown, TcpStream};
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use r6_client::callback::{Another, CallbackHand, EventLoop, host_and_port, open_socket};
use r6_client::{LostReason, NotSent, RequestError, Robot, RobotSettings};
use tokio::io::Interest;
use tokio::runtime::Handle;
use tokio::sync::Notify;
use tokio::task::yield_now;
use tokio::time::{sleep_until, timeout};

/// How long bytes may wait for an event loop, before the keeper reads them. A real controller takes ten times
/// as long to answer.
const GRACE: Duration = Duration::from_millis(2);

/// The size of a read. Replies are below 4 KiB; a longer reply is read in pieces.
const READ_BUFFER: usize = 4096;

/// The most reads in one call. So a peer that floods the connection takes a limited part of each turn of the
/// event loop, which holds the interpreter in that time.
const MOST_READS: usize = 4;

/// One socket. The keeper has another descriptor of it, on which the engine waits.
pub struct Socket {
    stream: TcpStream,
}

/// State that the hand, the event loop and the keeper share.
pub struct Wire {
    begun: Instant,
    target: (String, u16),
    /// Wakes the keeper.
    nudge: Notify,
    state: Mutex<State>,
    /// Held while bytes are read and passed on, so that they stay in order. Also held while the next
    /// connection is announced, so that no bytes of this connection count as bytes of the next one.
    reading: Mutex<()>,
    /// Whether an event loop reads in time.
    engaged: AtomicBool,
    /// The number of waiting calls of event loops.
    calls: AtomicUsize,
    /// How often an event loop has read.
    reads: AtomicU64,
    /// Whether the last call of [`Wire::read`] left bytes behind. The keeper's descriptor does not report
    /// them again.
    more: AtomicBool,
    runtime: Handle,
    /// Called after the keeper has driven the hand. It passes on results.
    carried: Box<dyn Fn() + Send + Sync>,
}

#[derive(Default)]
struct State {
    socket: Option<Arc<Socket>>,
    /// Counts the sockets and attempts, so that the keeper can tell that its socket is old.
    number: u64,
    connecting: bool,
    call_at: Option<Duration>,
    full: bool,
    broken: Option<ErrorKind>,
}

type Connecting = Pin<Box<dyn Future<Output = io::Result<tokio::net::TcpStream>> + Send>>;

impl Socket {
    fn of(stream: &tokio::net::TcpStream) -> io::Result<Arc<Self>> {
        #[cfg(unix)]
        let stream = std::os::fd::AsFd::as_fd(stream).try_clone_to_owned()?;
        #[cfg(windows)]
        let stream = std::os::windows::io::AsSocket::as_socket(stream).try_clone_to_owned()?;
        let stream = TcpStream::from(stream);
        Ok(Arc::new(Self { stream }))
    }

    /// The descriptor that an event loop watches; `None` on systems where event loops do not watch sockets
    /// this way.
    pub fn descriptor(&self) -> Option<i32> {
        #[cfg(unix)]
        return Some(std::os::fd::AsRawFd::as_raw_fd(&self.stream));
        #[cfg(not(unix))]
        return None;
    }
}

/// Connects, and starts the keeper on this runtime. `carried` is called after the keeper has driven the hand.
pub async fn open(
    address: &str,
    settings: RobotSettings,
    carried: impl Fn() + Send + Sync + 'static,
) -> Result<(Arc<Wire>, Arc<CallbackHand>, Robot), RequestError> {
    let target = host_and_port(address)?;
    let name = match &target {
        (host, port) if host.contains(':') => format!("[{host}]:{port}"),
        (host, port) => format!("{host}:{port}"),
    };
    let within = settings.connect_timeout;
    let unreachable = |error: io::Error| NotSent::Unreachable {
        address: name.clone(),
        kind: error.kind(),
        detail: error.to_string(),
    };
    let stream = match timeout(within, open_socket(&target.0, target.1)).await {
        Ok(made) => made.map_err(unreachable)?,
        Err(_elapsed) => return Err(NotSent::ConnectTimedOut { address: name, after: within }.into()),
    };
    let wire = Wire::over(target, Instant::now(), Socket::of(&stream).map_err(unreachable)?, carried);
    let (hand, robot) = CallbackHand::start(&name, settings, Arc::clone(&wire) as Arc<dyn EventLoop>);
    let hand = Arc::new(hand);
    tokio::spawn(Keeper::over(Arc::clone(&wire), Arc::clone(&hand), stream).keep());
    Ok((wire, hand, robot))
}

impl Wire {
    fn over(
        target: (String, u16),
        begun: Instant,
        socket: Arc<Socket>,
        carried: impl Fn() + Send + Sync + 'static,
    ) -> Arc<Self> {
        let state = State { socket: Some(socket), ..State::default() };
        Arc::new(Self {
            begun,
            target,
            nudge: Notify::new(),
            state: Mutex::new(state),
            reading: Mutex::default(),
            engaged: AtomicBool::new(false),
            calls: AtomicUsize::new(0),
            reads: AtomicU64::new(0),
            more: AtomicBool::new(false),
            runtime: Handle::current(),
            carried: Box::new(carried),
        })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn reading(&self) -> MutexGuard<'_, ()> {
        self.reading.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The present socket.
    pub fn socket(&self) -> Option<Arc<Socket>> {
        self.state().socket.clone()
    }

    /// Wakes the keeper.
    pub fn look(&self) {
        self.nudge.notify_one();
    }

    /// Notes that a call of an event loop waits. The keeper then leaves incoming bytes to the event loop.
    pub fn engage(&self) {
        self.calls.fetch_add(1, Ordering::Relaxed);
        self.engaged.store(true, Ordering::Relaxed);
    }

    /// Notes that the call has ended.
    pub fn disengage(&self) {
        self.calls.fetch_sub(1, Ordering::Relaxed);
    }

    /// Reads in an event loop, because there are bytes.
    pub fn read_here(&self, hand: &CallbackHand) {
        self.reads.fetch_add(1, Ordering::Relaxed);
        self.read(hand);
        if self.more.load(Ordering::Relaxed) {
            // The selector tells the event loop again. If the event loop does not read, the keeper reads the
            // rest.
            self.nudge.notify_one();
        }
    }

    /// Reads available bytes, [`MOST_READS`] times at most.
    fn read(&self, hand: &CallbackHand) {
        let _in_order = self.reading();
        self.more.store(false, Ordering::Relaxed);
        let Some(socket) = self.socket() else { return };
        let mut buffer = [0; READ_BUFFER];
        for _ in 0..MOST_READS {
            let reason = match (&socket.stream).read(&mut buffer) {
                Ok(0) => LostReason::ClosedByPeer,
                Ok(count) => {
                    hand.received(buffer.get(..count).unwrap_or_default());
                    // Does not end at a short read: if the connection ended with these bytes, the keeper gets
                    // no further notice.
                    if !self.is_present(&socket) {
                        return;
                    }
                    continue;
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => LostReason::Io(error.kind()),
            };
            if self.is_present(&socket) {
                self.drop_socket();
                hand.lost(reason);
            }
            return;
        }
        self.more.store(true, Ordering::Relaxed);
    }

    fn is_present(&self, socket: &Arc<Socket>) -> bool {
        self.state().socket.as_ref().is_some_and(|present| Arc::ptr_eq(present, socket))
    }

    /// Ends the connection now, even if other descriptors exist: an event loop may still have to remove its
    /// descriptor from its selector.
    fn drop_socket(&self) {
        let socket = {
            let mut state = self.state();
            (state.number, state.full, state.broken) = (state.number + 1, false, None);
            state.socket.take()
        };
        if let Some(socket) = socket {
            // The connection may have ended before.
            socket.stream.shutdown(Shutdown::Both).ok();
            self.nudge.notify_one();
        }
    }
}

impl EventLoop for Wire {
    fn now(&self) -> Duration {
        self.begun.elapsed()
    }

    fn soon(&self) {
        self.nudge.notify_one();
    }

    fn write(&self, bytes: &[u8]) -> usize {
        let Some(socket) = self.socket() else { return 0 };
        let written = match (&socket.stream).write(bytes) {
            Ok(count) => count,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => 0,
            Err(error) => {
                self.state().broken = Some(error.kind());
                self.nudge.notify_one();
                return 0;
            }
        };
        if written < bytes.len() && !replace(&mut self.state().full, true) {
            // Only once: the keeper writes again when it is woken, and would wake itself without end.
            self.nudge.notify_one();
        }
        written
    }

    fn connect(&self) {
        let mut state = self.state();
        (state.connecting, state.number) = (true, state.number + 1);
        drop(state);
        self.nudge.notify_one();
    }

    fn end(&self) {
        if let Some(socket) = self.socket() {
            // A failure means that the other side has ended the connection before.
            socket.stream.shutdown(Shutdown::Write).ok();
        }
    }

    fn let_go(&self) {
        self.state().connecting = false;
        self.drop_socket();
        self.nudge.notify_one();
    }

    fn call_at(&self, at: Duration) {
        self.state().call_at = Some(at);
        self.nudge.notify_one();
    }

    fn another(&self, another: Another) {
        let (target, begun) = (self.target.clone(), self.begun);
        // The caller is the keeper of this connection or the thread of an event loop. Neither of them may
        // wait.
        self.runtime.spawn(async move {
            let made = open_socket(&target.0, target.1).await;
            match made.and_then(|stream| Ok((Socket::of(&stream)?, stream))) {
                Ok((socket, stream)) => {
                    let wire = Self::over(target, begun, socket, || ());
                    if let Some(hand) = another.connected(Arc::clone(&wire) as Arc<dyn EventLoop>) {
                        // The keeper ends once it has the only reference to the hand.
                        let keeper = Keeper::over(wire, Arc::new(hand), stream);
                        keeper.keep().await;
                    }
                }
                Err(error) => another.not_connected(&error),
            }
        });
    }
}

/// Serves the connection whenever no event loop does.
struct Keeper {
    wire: Arc<Wire>,
    hand: Arc<CallbackHand>,
    /// The present socket for the engine; `number` belongs to it.
    stream: Option<tokio::net::TcpStream>,
    connecting: Option<Connecting>,
    number: u64,
    /// Until when incoming bytes are left to the event loop, and how often it had read before.
    grace: Option<(tokio::time::Instant, u64)>,
    /// How often the event loop had read when the last such time ended.
    seen: u64,
}

/// What woke the keeper.
enum Woken {
    Nudged,
    Due,
    Readable,
    GraceOver,
    Writable,
    Connected(io::Result<tokio::net::TcpStream>),
}

impl Keeper {
    fn over(wire: Arc<Wire>, hand: Arc<CallbackHand>, stream: tokio::net::TcpStream) -> Self {
        Self { wire, hand, stream: Some(stream), connecting: None, number: 0, grace: None, seen: 0 }
    }

    async fn keep(mut self) {
        loop {
            match self.woken().await {
                Woken::Nudged => self.hand.run(),
                Woken::Due => {
                    self.wire.state().call_at = None;
                    self.hand.due();
                }
                Woken::Readable => self.readable(),
                Woken::GraceOver => self.grace_over(),
                Woken::Writable => {
                    // Writes bypass tokio. Without this, tokio would never notice that the socket is full.
                    self.forget(Interest::WRITABLE);
                    self.wire.state().full = false;
                    self.hand.writable();
                }
                Woken::Connected(made) => self.connected(made),
            }
            let broken = self.wire.state().broken.take();
            if let Some(kind) = broken {
                self.wire.drop_socket();
                self.hand.lost(LostReason::Io(kind));
            }
            self.follow();
            (self.wire.carried)();
            if Arc::strong_count(&self.hand) == 1 && self.hand.is_over() {
                return;
            }
        }
    }

    /// Waits until something happens.
    async fn woken(&mut self) -> Woken {
        let (call_at, full) = {
            let state = self.wire.state();
            (state.call_at.map(|at| tokio::time::Instant::from_std(self.wire.begun + at)), state.full)
        };
        let grace = self.grace.map(|(until, _)| until);
        let stream = self.stream.as_ref();
        let ready = |interest: Interest, wanted: bool| async move {
            match stream.filter(|_| wanted) {
                // An error appears again at the next read or write.
                Some(stream) => drop(stream.ready(interest).await),
                None => pending().await,
            }
        };
        let more = self.wire.more.load(Ordering::Relaxed);
        let connecting = async {
            match &mut self.connecting {
                Some(connecting) => connecting.await,
                None => pending().await,
            }
        };
        tokio::select! {
            () = self.wire.nudge.notified() => Woken::Nudged,
            made = connecting => Woken::Connected(made),
            () = at(call_at) => Woken::Due,
            () = at(grace) => Woken::GraceOver,
            () = again(more && grace.is_none()) => Woken::Readable,
            () = ready(Interest::READABLE, grace.is_none()) => Woken::Readable,
            () = ready(Interest::WRITABLE, full) => Woken::Writable,
        }
    }

    /// Makes tokio forget that the socket is ready for this, so that it reports the next change.
    fn forget(&self, interest: Interest) {
        if let Some(stream) = &self.stream {
            let not_ready = || Err::<(), _>(io::Error::from(ErrorKind::WouldBlock));
            stream.try_io(interest, not_ready).ok();
        }
    }

    /// Handles incoming bytes: leaves them to an active event loop, else reads them.
    fn readable(&mut self) {
        // The bytes that are there now are read after this.
        self.forget(Interest::READABLE);
        let reads = self.wire.reads.load(Ordering::Relaxed);
        let active = self.wire.calls.load(Ordering::Relaxed) > 0 || reads != self.seen;
        if active && self.wire.engaged.load(Ordering::Relaxed) {
            let until = tokio::time::Instant::now() + GRACE;
            self.grace = Some((until, reads));
        } else {
            self.wire.read(&self.hand);
        }
    }

    fn grace_over(&mut self) {
        let Some((_, reads)) = self.grace.take() else { return };
        self.seen = self.wire.reads.load(Ordering::Relaxed);
        if self.seen == reads {
            self.wire.engaged.store(false, Ordering::Relaxed);
            self.wire.read(&self.hand);
        }
    }

    fn connected(&mut self, made: io::Result<tokio::net::TcpStream>) {
        self.connecting = None;
        match made.and_then(|stream| Ok((Socket::of(&stream)?, stream))) {
            Ok((socket, stream)) => {
                let _in_order = self.wire.reading();
                let mut state = self.wire.state();
                if !state.connecting || state.number != self.number {
                    return;
                }
                (state.connecting, state.socket) = (false, Some(socket));
                drop(state);
                self.stream = Some(stream);
                self.hand.connected();
            }
            Err(error) => {
                let mut state = self.wire.state();
                if !state.connecting || state.number != self.number {
                    return;
                }
                state.connecting = false;
                drop(state);
                self.hand.not_connected(error);
            }
        }
    }

    /// Does what the hand has asked for in the meantime.
    fn follow(&mut self) {
        let state = self.wire.state();
        if state.number == self.number {
            return;
        }
        self.number = state.number;
        let connecting = state.connecting;
        drop(state);
        (self.stream, self.grace, self.connecting) = (None, None, None);
        if connecting {
            let (host, port) = self.wire.target.clone();
            self.connecting = Some(Box::pin(async move { open_socket(&host, port).await }));
        }
    }
}

async fn at(time: Option<tokio::time::Instant>) {
    match time {
        Some(time) => sleep_until(time).await,
        None => pending().await,
    }
}

/// Yields once to the other tasks of this thread, then returns. Never returns if `wanted` is false.
async fn again(wanted: bool) {
    if wanted {
        yield_now().await;
    } else {
        pending().await
    }
}
