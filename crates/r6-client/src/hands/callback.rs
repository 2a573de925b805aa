//! The hand of other event loops: a loop that is not tokio's owns the socket and the clock, and calls [`CallbackHand`].
//!
//! ```text
//!  the loop calls:  connected, not_connected, received, lost, writable, due, run ──▶ CallbackHand
//!  the hand calls:  connect, write, end, let_go, call_at, soon, another          ──▶ EventLoop
//! ```
//!
//! Each call of the loop carries as far as it goes: what came in, what can leave, the operations, the next deadline. No thread is
//! started, and no lock is held while [`EventLoop`] is called, so it may call back at once: that is seen before the outer call returns.
//!
//! The robot's methods are futures like any other. [`CallbackHand::call`] has the loop itself run one: a query then costs two turns of
//! the loop and no other thread.

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
use crate::identity::Identity;
use crate::pushed::LostReason;
use crate::robot::Robot;
use crate::seats::Seat;
use crate::settings::RobotSettings;

/// So often one call looks again before the loop has its turn.
const MOST_LOOKS: usize = 64;

/// What an event loop does for one connection.
///
/// Only [`Self::now`] and [`Self::soon`] are called from any thread. The others are called from within the methods of
/// [`CallbackHand`].
pub trait EventLoop: Send + Sync + 'static {
    /// The time since an origin of the loop's choice. It never goes back.
    fn now(&self) -> Duration;

    /// Has [`CallbackHand::run`] called soon, from the loop. It does nothing else: the caller may hold locks of the client.
    fn soon(&self);

    /// Writes as many of these bytes as there is room for, and tells how many. After fewer than all, the loop calls
    /// [`CallbackHand::writable`] once there is room.
    ///
    /// Bytes that were taken cannot be called back, and a stop waits behind them: a loop with a buffer of its own takes none while that
    /// buffer is not empty.
    fn write(&self, bytes: &[u8]) -> usize;

    /// Begins to make a connection, which ends in [`CallbackHand::connected`] or [`CallbackHand::not_connected`], or by
    /// [`Self::let_go`]: that comes at the latest after [`RobotSettings::connect_timeout`].
    fn connect(&self);

    /// Ends this side of the connection once what was written has left. The other side's end, [`CallbackHand::lost`], is waited for.
    fn end(&self);

    /// Lets go of the connection, or of the attempt to make one, at once. What comes of it later must not be told.
    fn let_go(&self);

    /// Has [`CallbackHand::due`] called at this time of [`Self::now`], and at no other that was asked for before.
    fn call_at(&self, at: Duration);

    /// Begins to make a second connection beside this one: a stop wants it where nothing comes back over the first. A loop that
    /// makes none drops the request.
    fn another(&self, another: Another) {
        drop(another);
    }
}

/// Drives a client for an [`EventLoop`]. Dropping it lets go of the connection, and all who wait are told.
///
/// Its methods belong to the loop: it calls them one after the other, in whatever thread it runs.
pub struct CallbackHand(Arc<Inner>);

/// An operation that the loop runs. Dropping this changes nothing: the operation goes on.
pub struct Call {
    abort: AbortHandle,
    inner: Arc<Inner>,
}

/// A second connection that is wanted. Dropping this says that it is not made.
pub struct Another {
    target: String,
    settings: RobotSettings,
    expected: Option<Identity>,
    answer: oneshot::Sender<Result<Driven, NotSent>>,
}

/// What the hand, the robot's handles and the operations share.
struct Inner {
    event_loop: Arc<dyn EventLoop>,
    shared: Arc<SharedConnection>,
    connect_timeout: Duration,
    /// A second connection is not made anew.
    only_once: bool,
    turn: Arc<Turn>,
    /// Of the turn: what errands wake.
    waker: Waker,
    /// What the loop told while somebody carried already.
    came_in: Mutex<Vec<Came>>,
    /// Second connections that were asked for.
    others: Mutex<Vec<Another>>,
    /// Only who carries has it; empty meanwhile.
    io: Mutex<Io>,
}

/// What only the one who carries has.
#[derive(Default)]
struct Io {
    wire: Wire,
    errands: Errands,
    /// When the loop calls [`CallbackHand::due`]. It is told anew only for an earlier deadline: a request whose reply came leaves the
    /// loop's timer as it is.
    call_at: Option<Instant>,
    output: Vec<u8>,
}

/// The connection, as the loop has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Wire {
    #[default]
    None,
    /// An attempt to connect is under way, and is given up at that time.
    Attempt(Instant),
    There,
    /// Our side of it was ended.
    Ended,
}

/// What the loop told.
enum Came {
    Connected,
    NotConnected(io::Error),
    Bytes(Vec<u8>),
    Lost(LostReason),
    Due,
}

impl CallbackHand {
    /// Drives a connection that is there from now on. The robot is `address` in messages.
    ///
    /// [`EventLoop::soon`] is called by this.
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
        // A heartbeat may have to leave.
        inner.turn.happened();
        (Self(Arc::clone(&inner)), Driven { shared, hand: inner })
    }

    /// The connection that was wanted is there.
    pub fn connected(&self) {
        self.0.take_in(Came::Connected);
    }

    /// The connection that was wanted could not be made.
    pub fn not_connected(&self, error: io::Error) {
        self.0.take_in(Came::NotConnected(error));
    }

    /// These bytes came over the connection.
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

    /// The connection has ended: [`LostReason::ClosedByPeer`], or what the operating system said.
    pub fn lost(&self, reason: LostReason) {
        self.0.take_in(Came::Lost(reason));
    }

    /// There is room to write again.
    pub fn writable(&self) {
        self.run();
    }

    /// The time of [`EventLoop::call_at`] has come.
    pub fn due(&self) {
        self.0.take_in(Came::Due);
    }

    /// Carries what there is to carry.
    pub fn run(&self) {
        if let Some(mut carrying) = self.0.begin() {
            carrying.carry_all();
        }
    }

    /// Has the loop run an operation to its end, from within these methods: it begins now, and what it sends leaves now.
    pub fn call(&self, operation: impl Future<Output = ()> + Send + 'static) -> Call {
        let abort = self.0.shared.errands.give_abortable(operation);
        self.run();
        Call { abort, inner: Arc::clone(&self.0) }
    }

    /// Whether the client was closed, and nothing is under way any more: this may be dropped.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.0.shared.connection().is_closed() && self.0.turn.is_idle() && !self.0.io().errands.any()
    }
}

impl Drop for CallbackHand {
    fn drop(&mut self) {
        self.0.turn.loop_left();
        // Who carries sees it before it ends.
        self.run();
    }
}

impl fmt::Debug for CallbackHand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("CallbackHand").field(&self.0).finish()
    }
}

impl Call {
    /// Drops the operation, as dropping its future does; nothing if it has ended. A request that has not left is taken back. This
    /// belongs to the loop, as the methods of [`CallbackHand`] do.
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
    /// Whether it is still wanted.
    #[must_use]
    pub fn is_wanted(&self) -> bool {
        !self.answer.is_closed()
    }

    /// It is there. The clock of its loop is that of the first connection, with the same origin. `None`: nobody wants it any more.
    #[must_use]
    pub fn connected(self, event_loop: Arc<dyn EventLoop>) -> Option<CallbackHand> {
        if !self.is_wanted() {
            return None;
        }
        let (hand, driven) = CallbackHand::over(self.target, &self.settings, self.expected, true, event_loop);
        self.answer.send(Ok(driven)).ok().map(|()| hand)
    }

    /// It could not be made.
    pub fn not_connected(self, error: &io::Error) {
        self.answer.send(Err(unreachable(&self.target, error))).ok();
    }
}

impl fmt::Debug for Another {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Another").field("target", &self.target).finish_non_exhaustive()
    }
}

/// Host and port of an address as [`Robot::connect`] takes it.
///
/// # Errors
/// [`Invalid::BadAddress`] if the text is no address.
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

    /// The right to carry; `None` if somebody does already, and looks again before ending.
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
        // The operation is woken by its own reply. Here it may have given a request, or wait for a time.
        self.nudge();
        false
    }

    fn leave(&self, _seat: &mut Seat) {}

    fn nudge(&self) {
        if !self.turn.loop_is_gone() {
            self.turn.happened();
        } else if let Some(mut carrying) = self.begin() {
            // Nobody else does it any more: whoever begins something now is told so.
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

/// The one who carries.
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
    /// Carries until nothing more can be done without waiting.
    fn carry_all(&mut self) {
        for _ in 0..MOST_LOOKS {
            self.carry();
            // Put back before the end, for the next one begins right after it.
            *self.inner.io() = mem::take(&mut self.io);
            if self.inner.turn.end() {
                self.over = true;
                return;
            }
            self.io = mem::take(&mut *self.inner.io());
        }
    }

    /// Once: what came in, what leaves, the errands, the deadline.
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
        // Errands begin what leaves next time: that they went on brings that about.
        self.io.errands.drive(&inner.shared.errands, &mut Context::from_waker(&inner.waker));
        let others = mem::take(&mut *inner.others.lock().unwrap_or_else(PoisonError::into_inner));
        for another in others.into_iter().filter(|_| !inner.only_once) {
            inner.event_loop.another(another);
        }
        self.call_in_time();
    }

    /// Takes in what the loop told. Each call of the loop brings the time.
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
            // It was let go before it came.
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

    /// Has an attempt to connect made, and ends one that takes too long.
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
                // A stop wants the next connection as soon as the one before is lost.
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

    /// Has the loop call in time for the next deadline.
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

    /// The loop is gone. Whoever waits is told.
    fn abandon(&mut self) {
        let inner = self.inner;
        inner.tell_time();
        self.let_go();
        if !inner.shared.connection().is_closed() {
            let errands = mem::take(&mut self.io.errands);
            inner.shared.connection().abandoned();
            drop(errands);
        }
        // What begins now hears that it is closed.
        self.io.errands.drive(&inner.shared.errands, &mut Context::from_waker(&inner.waker));
        inner.others.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}
