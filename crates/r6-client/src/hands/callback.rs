//! The driver ("hand") for other event loops: a loop other than tokio's owns the socket and the clock, and
//! calls [`CallbackHand`].
//!
//! ```text
//!  the loop calls:  connected, not_connected, received, lost, writable, due, run ──▶ CallbackHand
//!  the hand calls:  connect, write, end, let_go, call_at, soon, another          ──▶ EventLoop
//! ```
//!
//! Each call of the loop does all that can be done now: it takes in bytes, sends, runs the operations, and
//! sets the next deadline. No thread is started. No lock is held while [`EventLoop`] is called, so
//! [`EventLoop`] may call back at once; the outer call handles that before it returns.
//!
//! The robot's methods are ordinary futures. [`CallbackHand::call`] makes the loop itself run one: a query
//! then costs two turns of the loop and no other thread.

mod turn;

use std::fmt;
use std::future::Future;
use std::hash::{BuildHasher as _, RandomState};
use std::io;
use std::mem;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Waker};
use std::time::Duration;

use futures_util::future::AbortHandle;
use r6_proto::time::Instant;
use tokio::sync::oneshot;

use crate::connection::Wants;
use crate::drive::{Driven, Hand, Second, SharedConnection};
use crate::errands::Errands;
use crate::error::{Invalid, NotSent};
use crate::hands::callback::turn::Turn;
use crate::hands::connect::Tcp;
pub use crate::hands::connect::open_socket;
use crate::identity::Identity;
use crate::pushed::LostReason;
use crate::robot::Robot;
use crate::seats::Seat;
use crate::settings::RobotSettings;

/// One call looks again at most this often before it returns to the loop.
const MOST_LOOKS: usize = 64;

/// What an event loop does for one connection.
///
/// Any thread may call [`Self::now`] and [`Self::soon`]. The other methods are called only from within the
/// methods of [`CallbackHand`].
pub trait EventLoop: Send + Sync + 'static {
    /// The time since an origin that the loop chooses. It never goes back.
    fn now(&self) -> Duration;

    /// Schedules a call of [`CallbackHand::run`] from the loop. It must do nothing else, because the caller
    /// may hold locks of the client.
    fn soon(&self);

    /// Writes as many of these bytes as there is room for, and returns how many. After a partial write, the
    /// loop calls [`CallbackHand::writable`] once there is room.
    ///
    /// Accepted bytes cannot be taken back, and a stop waits behind them. So a loop with its own buffer
    /// accepts no bytes while that buffer is not empty.
    fn write(&self, bytes: &[u8]) -> usize;

    /// Begins to connect. The attempt ends with [`CallbackHand::connected`] or
    /// [`CallbackHand::not_connected`], or with [`Self::let_go`], which is called after
    /// [`RobotSettings::connect_timeout`] at the latest.
    fn connect(&self);

    /// Shuts down this side of the connection once everything written has been sent. The client then waits
    /// for the other side to end, which is reported by [`CallbackHand::lost`].
    fn end(&self);

    /// Drops the connection, or the attempt to connect, at once. The loop must not report any later result of
    /// it.
    fn let_go(&self);

    /// Schedules a call of [`CallbackHand::due`] at this time of [`Self::now`]. It replaces the time that was
    /// set before.
    fn call_at(&self, at: Duration);

    /// Begins to open a second connection beside this one. A stop wants it when nothing comes back over the
    /// first connection. A loop that does not support this drops the request.
    fn another(&self, another: Another) {
        drop(another);
    }
}

/// Drives a client for an [`EventLoop`]. Dropping it drops the connection and wakes all waiting calls with an
/// error.
///
/// Its methods belong to the loop: the loop calls them one after the other, in any thread.
pub struct CallbackHand(Arc<Inner>);

/// An operation that the loop runs. Dropping this handle does not end the operation.
pub struct Call {
    abort: AbortHandle,
    inner: Arc<Inner>,
}

/// A request for a second connection. Dropping it reports that the connection is not made.
pub struct Another {
    target: String,
    settings: RobotSettings,
    expected: Option<Identity>,
    answer: oneshot::Sender<Result<Driven, NotSent>>,
}

/// The state shared by the driver, the robot's handles and the operations.
struct Inner {
    event_loop: Arc<dyn EventLoop>,
    shared: Arc<SharedConnection>,
    connect_timeout: Duration,
    /// Set for a second connection, which is never reconnected.
    only_once: bool,
    turn: Arc<Turn>,
    /// The waker of the turn, for the errands.
    waker: Waker,
    /// What the loop reported while a call was already at work.
    came_in: Mutex<Vec<Came>>,
    /// Second connections that were requested.
    others: Mutex<Vec<Another>>,
    /// Owned by the call that is at work; empty meanwhile.
    io: Mutex<Io>,
}

/// The state that only the call at work has.
#[derive(Default)]
struct Io {
    wire: Wire,
    errands: Errands,
    /// When the loop calls [`CallbackHand::due`]. It is set again only for an earlier deadline: a reply that
    /// arrived leaves the loop's timer unchanged.
    call_at: Option<Instant>,
    output: Vec<u8>,
}

/// The state of the connection in the loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Wire {
    #[default]
    None,
    /// An attempt to connect is under way. It is given up at this time.
    Attempt(Instant),
    There,
    /// Our side was shut down.
    Ended,
}

/// What the loop reported.
enum Came {
    Connected,
    NotConnected(io::Error),
    Bytes(Vec<u8>),
    Lost(LostReason),
    Due,
}

impl CallbackHand {
    /// Starts to drive a connection that already exists. Messages call the robot `address`.
    ///
    /// This calls [`EventLoop::soon`].
    #[must_use]
    pub fn start(address: &str, settings: RobotSettings, event_loop: Arc<dyn EventLoop>) -> (Self, Robot) {
        let (this, driven) = Self::over(address.to_owned(), &settings, None, false, event_loop);
        (this, Robot::on(driven, settings))
    }

    fn over(
        address: String,
        settings: &RobotSettings,
        expected: Option<Identity>,
        only_once: bool,
        event_loop: Arc<dyn EventLoop>,
    ) -> (Self, Driven) {
        let seed = || RandomState::new().hash_one(0);
        let now = Instant::ORIGIN + event_loop.now();
        let shared = SharedConnection::open((address, false), settings, expected, now, seed);
        let turn = Arc::new(Turn::of(Arc::clone(&event_loop)));
        let inner = Arc::new(Inner {
            event_loop,
            shared: Arc::clone(&shared),
            connect_timeout: settings.connect_timeout,
            only_once,
            waker: Waker::from(Arc::clone(&turn)),
            turn,
            came_in: Mutex::default(),
            others: Mutex::default(),
            io: Mutex::new(Io { wire: Wire::There, ..Io::default() }),
        });
        // A heartbeat may be due.
        inner.turn.happened();
        (Self(Arc::clone(&inner)), Driven { shared, hand: inner })
    }

    /// Reports that the requested connection is open.
    pub fn connected(&self) {
        self.0.take_in(Came::Connected);
    }

    /// Reports that the requested connection could not be opened.
    pub fn not_connected(&self, error: io::Error) {
        self.0.take_in(Came::NotConnected(error));
    }

    /// Reports bytes that came over the connection.
    pub fn received(&self, bytes: &[u8]) {
        match self.0.begin() {
            Some(mut carrying) => {
                carrying.take_in_all();
                carrying.received(bytes);
                carrying.carry_all();
            }
            None => self.0.take_in(Came::Bytes(bytes.to_vec())),
        }
    }

    /// Reports that the connection has ended: with [`LostReason::ClosedByPeer`], or with the error of the
    /// operating system.
    pub fn lost(&self, reason: LostReason) {
        self.0.take_in(Came::Lost(reason));
    }

    /// Reports that there is room to write again.
    pub fn writable(&self) {
        self.run();
    }

    /// Reports that the time of [`EventLoop::call_at`] has come.
    pub fn due(&self) {
        self.0.take_in(Came::Due);
    }

    /// Does all that can be done now.
    pub fn run(&self) {
        if let Some(mut carrying) = self.0.begin() {
            carrying.carry_all();
        }
    }

    /// Makes the loop run an operation to its end, within these methods. The operation begins now, and what
    /// it sends is sent now.
    pub fn call(&self, operation: impl Future<Output = ()> + Send + 'static) -> Call {
        let abort = self.0.shared.errands.give_abortable(operation);
        self.run();
        Call { abort, inner: Arc::clone(&self.0) }
    }

    /// Whether the client is closed and nothing is under way any more: this may then be dropped.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.0.shared.connection().is_closed() && self.0.turn.is_idle() && !self.0.io().errands.any()
    }
}

impl Drop for CallbackHand {
    fn drop(&mut self) {
        self.0.turn.loop_left();
        // A call that is at work sees this before it ends.
        self.run();
    }
}

impl fmt::Debug for CallbackHand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("CallbackHand").field(&self.0).finish()
    }
}

impl Call {
    /// Drops the operation, which has the same effect as dropping its future. Does nothing if the operation
    /// has ended. A request that was not sent yet is taken back. Like the methods of [`CallbackHand`], this
    /// must be called by the loop.
    pub fn cancel(&self) {
        match self.inner.begin() {
            Some(mut carrying) => {
                self.abort.abort();
                carrying.carry_all();
            }
            None => self.abort.abort(),
        }
    }
}

impl fmt::Debug for Call {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Call").field("cancelled", &self.abort.is_aborted()).finish_non_exhaustive()
    }
}

impl Another {
    /// Whether the connection is still wanted.
    #[must_use]
    pub fn is_wanted(&self) -> bool {
        !self.answer.is_closed()
    }

    /// Reports that the connection is open. Its loop has the clock of the first connection, with the same
    /// origin. Returns `None` if the connection is no longer wanted.
    #[must_use]
    pub fn connected(self, event_loop: Arc<dyn EventLoop>) -> Option<CallbackHand> {
        if !self.is_wanted() {
            return None;
        }
        let (hand, driven) = CallbackHand::over(self.target, &self.settings, self.expected, true, event_loop);
        self.answer.send(Ok(driven)).ok().map(|()| hand)
    }

    /// Reports that the connection could not be opened.
    pub fn not_connected(self, error: &io::Error) {
        self.answer.send(Err(unreachable(&self.target, error))).ok();
    }
}

impl fmt::Debug for Another {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Another").field("target", &self.target).finish_non_exhaustive()
    }
}

/// Splits an address into host and port, in the form that [`Robot::connect`] takes.
///
/// # Errors
/// [`Invalid::BadAddress`] if the text is not an address.
pub fn host_and_port(address: &str) -> Result<(String, u16), Invalid> {
    Tcp::parse(address).map(|tcp| (tcp.host().to_owned(), tcp.port()))
}

fn unreachable(address: &str, error: &io::Error) -> NotSent {
    NotSent::Unreachable { address: address.to_owned(), kind: error.kind(), detail: error.to_string() }
}

impl fmt::Debug for Inner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Inner").field("shared", &self.shared).finish_non_exhaustive()
    }
}

impl Inner {
    fn io(&self) -> MutexGuard<'_, Io> {
        self.io.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the right to work on the connection. Returns `None` if another call has it; that call looks
    /// again before it ends.
    fn begin(&self) -> Option<Carrying<'_>> {
        if !self.turn.begin() {
            return None;
        }
        let io = mem::take(&mut *self.io());
        Some(Carrying { inner: self, io, over: false })
    }

    fn take_in(&self, came: Came) {
        self.came_in.lock().unwrap_or_else(PoisonError::into_inner).push(came);
        if let Some(mut carrying) = self.begin() {
            carrying.carry_all();
        }
    }
}

impl Hand for Inner {
    fn tell_time(&self) {
        self.shared.hub.time.pass(Instant::ORIGIN + self.event_loop.now());
    }

    fn carry(&self, _seat: &mut Seat, _cx: &mut Context<'_>) -> bool {
        // The operation is woken by its own reply. Here it may have given a request, or it may wait for a
        // time.
        self.nudge();
        false
    }

    fn leave(&self, _seat: &mut Seat) {}

    fn nudge(&self) {
        if !self.turn.loop_is_gone() {
            self.turn.happened();
        } else if let Some(mut carrying) = self.begin() {
            // The loop is gone, so this call does the work. An operation that begins now gets the error.
            carrying.carry_all();
        }
    }

    fn second(&self, settings: RobotSettings, expected: Option<Identity>) -> Second<'_> {
        Box::pin(async move {
            let (answer, told) = oneshot::channel();
            let within = settings.connect_timeout;
            let target = self.shared.connection().name().to_owned();
            let another = Another { target: target.clone(), settings, expected, answer };
            self.others.lock().unwrap_or_else(PoisonError::into_inner).push(another);
            self.nudge();
            match self.shared.hub.time.timeout(within, told).await {
                Ok(Ok(made)) => made,
                Ok(Err(_dropped)) => {
                    let none = io::Error::new(io::ErrorKind::Unsupported, "no second connection was made");
                    Err(unreachable(&target, &none))
                }
                Err(_elapsed) => Err(NotSent::ConnectTimedOut { address: target, after: within }),
            }
        })
    }
}

/// The call that is at work.
struct Carrying<'i> {
    inner: &'i Inner,
    io: Io,
    over: bool,
}

impl Drop for Carrying<'_> {
    fn drop(&mut self) {
        if !self.over {
            *self.inner.io() = mem::take(&mut self.io);
            self.inner.turn.interrupt();
        }
    }
}

impl Carrying<'_> {
    /// Works until nothing more can be done without waiting.
    fn carry_all(&mut self) {
        for _ in 0..MOST_LOOKS {
            self.carry();
            // Put back before the end, because the next call may begin right after it.
            *self.inner.io() = mem::take(&mut self.io);
            if self.inner.turn.end() {
                self.over = true;
                return;
            }
            self.io = mem::take(&mut *self.inner.io());
        }
    }

    /// Does one round: takes in what was reported, sends, runs the errands, sets the deadline.
    fn carry(&mut self) {
        let inner = self.inner;
        if inner.turn.loop_is_gone() {
            return self.abandon();
        }
        self.take_in_all();
        let wants = self.go_on();
        match wants {
            Wants::Carry | Wants::Goodbye => self.write(wants),
            Wants::Connect => self.connect(),
            Wants::Nothing => self.let_go(),
        }
        // Errands may start something to send. The turn notices that, and the next round sends it.
        self.io.errands.drive(&inner.shared.errands, &mut Context::from_waker(&inner.waker));
        let others = mem::take(&mut *inner.others.lock().unwrap_or_else(PoisonError::into_inner));
        for another in others.into_iter().filter(|_| !inner.only_once) {
            inner.event_loop.another(another);
        }
        self.call_in_time();
    }

    /// Takes in what the loop reported. Also updates the time.
    fn take_in_all(&mut self) {
        self.inner.tell_time();
        let came_in = mem::take(&mut *self.inner.came_in.lock().unwrap_or_else(PoisonError::into_inner));
        for came in came_in {
            self.take_in(came);
        }
    }

    fn take_in(&mut self, came: Came) {
        let inner = self.inner;
        let now = inner.shared.hub.time.now();
        match (came, self.io.wire) {
            (Came::Due, _) => self.io.call_at = None,
            (Came::Bytes(bytes), _) => self.received(&bytes),
            (Came::Connected, Wire::Attempt(_)) => {
                let mut connection = inner.shared.connection();
                if connection.wants() == Wants::Connect {
                    self.io.wire = Wire::There;
                    connection.connected(now);
                }
            }
            (Came::NotConnected(error), Wire::Attempt(_)) => {
                self.io.wire = Wire::None;
                self.not_connected(|address| unreachable(address, &error));
            }
            (Came::Lost(reason), Wire::There | Wire::Ended) => {
                self.io.wire = Wire::None;
                inner.shared.connection().lost(reason, now);
            }
            // The connection was dropped before this was reported.
            (Came::Connected | Came::NotConnected(_) | Came::Lost(_), _) => {}
        }
    }

    fn received(&mut self, bytes: &[u8]) {
        if matches!(self.io.wire, Wire::There | Wire::Ended) {
            let now = self.inner.shared.hub.time.now();
            self.inner.shared.connection().received(bytes, now);
        }
    }

    fn not_connected(&self, error: impl FnOnce(&str) -> NotSent) {
        let mut connection = self.inner.shared.connection();
        if connection.wants() == Wants::Connect {
            let error = error(connection.name());
            connection.not_connected(&error);
        }
    }

    fn go_on(&self) -> Wants {
        let mut connection = self.inner.shared.connection();
        let now = self.inner.shared.hub.time.now();
        connection.tick(now);
        connection.go_on(now);
        connection.wants()
    }

    /// Begins an attempt to connect, or ends the attempt that takes too long.
    fn connect(&mut self) {
        let inner = self.inner;
        let now = inner.shared.hub.time.now();
        match self.io.wire {
            Wire::Attempt(until) if until > now => {}
            Wire::Attempt(_) => {
                self.let_go();
                let after = inner.connect_timeout;
                self.not_connected(|address| NotSent::ConnectTimedOut { address: address.to_owned(), after });
                inner.turn.happened();
            }
            Wire::None if inner.only_once => {
                let once = io::Error::new(io::ErrorKind::NotConnected, "this connection is not made anew");
                self.not_connected(|address| unreachable(address, &once));
                inner.turn.happened();
            }
            Wire::None | Wire::There | Wire::Ended => {
                // A stop requests the next connection as soon as the one before is lost.
                self.let_go();
                self.io.wire = Wire::Attempt(now + inner.connect_timeout);
                inner.event_loop.connect();
            }
        }
    }

    fn let_go(&mut self) {
        if mem::take(&mut self.io.wire) != Wire::None {
            self.inner.event_loop.let_go();
        }
    }

    /// Writes what waits, as far as there is room.
    fn write(&mut self, wants: Wants) {
        let inner = self.inner;
        let now = inner.shared.hub.time.now();
        loop {
            let wait = {
                let mut connection = inner.shared.connection();
                if connection.wants() != wants {
                    drop(connection);
                    return inner.turn.happened();
                }
                let output = connection.output(now);
                self.io.output.clear();
                self.io.output.extend_from_slice(output);
                output.len()
            };
            if wait == 0 {
                if wants == Wants::Goodbye && self.io.wire == Wire::There {
                    self.io.wire = Wire::Ended;
                    inner.event_loop.end();
                }
                return;
            }
            let taken = inner.event_loop.write(&self.io.output).min(wait);
            let mut connection = inner.shared.connection();
            if taken > 0 {
                connection.written(taken);
            }
            if taken < wait {
                return;
            }
            connection.go_on(now);
        }
    }

    /// Schedules a call of the loop for the next deadline.
    fn call_in_time(&mut self) {
        let inner = self.inner;
        let time = &inner.shared.hub.time;
        let attempt = match self.io.wire {
            Wire::Attempt(until) => Some(until),
            Wire::None | Wire::There | Wire::Ended => None,
        };
        let connection = inner.shared.connection().deadline();
        let Some(deadline) = [connection, time.deadline(), attempt].into_iter().flatten().min() else {
            return;
        };
        if deadline <= time.now() {
            return inner.turn.happened();
        }
        if self.io.call_at.is_none_or(|at| deadline < at) {
            self.io.call_at = Some(deadline);
            inner.event_loop.call_at(deadline.since(Instant::ORIGIN));
        }
    }

    /// Ends everything after the loop has gone. All waiting calls get an error.
    fn abandon(&mut self) {
        let inner = self.inner;
        inner.tell_time();
        self.let_go();
        if !inner.shared.connection().is_closed() {
            let errands = mem::take(&mut self.io.errands);
            inner.shared.connection().abandoned();
            drop(errands);
        }
        // Operations that begin now get the error that the connection is closed.
        self.io.errands.drive(&inner.shared.errands, &mut Context::from_waker(&inner.waker));
        inner.others.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}
