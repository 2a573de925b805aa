//! Driving a client: a hand carries bytes and time between the pure parts and the world.
//!
//! A call that waits for an answer drives the connection for all calls. While no call waits, the hand's
//! keeper drives it whenever something is due.
//!
//! ```text
//!  a call:    polls its own operation ──▶ carries bytes until it would block ──▶ waits, seated
//!  an event:  (bytes, time, an errand) wakes the call that drove last; also the keeper, if no call is seated
//!             or others depend on it
//!  a call that ends or is dropped:
//!             leaves its seat; an event that woke it and that it did not handle goes to the next call
//! ```
//!
//! # Who drives
//!
//! 1. A call polls its own operation, then carries bytes until it would block, then waits (this file).
//! 2. `seats.rs` decides who is woken when something happens: the call that drove last, or the keeper. The
//!    keeper belongs to the hand and drives while no call waits.
//! 3. `errands.rs` has the work that continues whether or not a caller waits: a stop, a motion that is
//!    streamed, the poller.
//! 4. All of them wait for times in `time.rs` alone. `hub.rs` keeps what is known of the robot.
//!
//! Three hands carry bytes and time: `hands/tokio.rs`; `hands/blocking.rs`, for threads over a blocking
//! socket; `hands/callback.rs`, for an event loop that calls back. Everything but `hands/` and `blocking/` is
//! pure: no clock, socket, task or thread (`r6-testkit/tests/layers.rs` checks it).

use std::fmt;
use std::future::{Future, poll_fn};
use std::pin::{Pin, pin};
use std::sync::Mutex;
use std::sync::{Arc, MutexGuard, PoisonError};
use std::task::{Context, Poll};

use r6_proto::time::Instant;

use crate::backoff::Backoff;
use crate::connection::Connection;
use crate::errands::Given;
use crate::error::NotSent;
use crate::hub::Hub;
use crate::identity::Identity;
use crate::seats::Seat;
use crate::settings::RobotSettings;

/// What the operations of a handle and its hand share.
pub(crate) struct SharedConnection {
    connection: Mutex<Connection>,
    pub errands: Given,
    pub hub: Arc<Hub>,
}

impl fmt::Debug for SharedConnection {
    /// Prints no fields: they hold everything known of a robot, too much for a printed handle.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SharedConnection").finish_non_exhaustive()
    }
}

impl SharedConnection {
    /// Wraps an existing connection.
    ///
    /// - `expected`: the robot that has to be at its other end, if that is known.
    /// - `now`: the time at which the connection begins.
    /// - `seed`: draws the waits before reconnects, if the settings have no seed.
    pub fn open(
        target: (String, bool),
        settings: &RobotSettings,
        expected: Option<Identity>,
        now: Instant,
        seed: impl FnOnce() -> u64,
    ) -> Arc<Self> {
        let hub = Arc::<Hub>::default();
        hub.known().expected = expected;
        hub.time.pass(now);
        let backoff = Backoff::new(settings.reconnect, seed);
        let connection = Connection::new(target, settings.clone(), Arc::clone(&hub), backoff);
        Arc::new(Self { connection: Mutex::new(connection), errands: Given::default(), hub })
    }

    /// The connection. No caller holds this guard across an await, and nothing can panic while holding it.
    pub fn connection(&self) -> MutexGuard<'_, Connection> {
        self.connection.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An existing connection, and the hand that drives it.
#[derive(Clone, Debug)]
pub(crate) struct Driven {
    pub shared: Arc<SharedConnection>,
    pub hand: Arc<dyn Hand>,
}

/// A second connection that is being made.
pub(crate) type Second<'h> = Pin<Box<dyn Future<Output = Result<Driven, NotSent>> + Send + 'h>>;

/// Carries bytes and time.
pub(crate) trait Hand: fmt::Debug + Send + Sync {
    /// Updates the time.
    fn tell_time(&self);

    /// Carries bytes, time and errands until it would block. Returns whether anything came in. When there is
    /// more, it wakes the calls seated here, or the keeper.
    fn carry(&self, seat: &mut Seat, cx: &mut Context<'_>) -> bool;

    /// The call is over, or given up.
    fn leave(&self, seat: &mut Seat);

    /// There is work that no call waits for.
    fn nudge(&self);

    /// Opens a second connection to the same address, without reconnects. `expected`: the robot that has to
    /// be at its other end, if that is known.
    fn second(&self, settings: RobotSettings, expected: Option<Identity>) -> Second<'_>;
}

/// How often a call polls its operation in one turn because something came in.
const MOST_TURNS: usize = 8;

/// Drives the connection while this operation waits.
pub(crate) async fn drive<F: Future>(hand: &dyn Hand, operation: F) -> F::Output {
    let mut operation = pin!(operation);
    let mut seated = Seated { hand, seat: Seat::default() };
    poll_fn(|cx| {
        hand.tell_time();
        for _ in 0..MOST_TURNS {
            if let Poll::Ready(output) = operation.as_mut().poll(cx) {
                return Poll::Ready(output);
            }
            // The input may be the answer.
            if !hand.carry(&mut seated.seat, cx) {
                return Poll::Pending;
            }
        }
        // Bytes that keep coming must not block other tasks.
        cx.waker().wake_by_ref();
        Poll::Pending
    })
    .await
}

/// A call's seat, until this is dropped.
struct Seated<'h> {
    hand: &'h dyn Hand,
    seat: Seat,
}

impl Drop for Seated<'_> {
    fn drop(&mut self) {
        self.hand.leave(&mut self.seat);
    }
}
