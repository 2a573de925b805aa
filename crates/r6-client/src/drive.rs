//! What drives a client: a hand carries bytes and time between the pure parts and the world.
//!
//! A call that waits for an answer drives the connection for all calls. While no call waits, the hand's keeper drives it, when something
//! is due.
//!
//! ```text
//!  a call:  polls its own operation ──▶ carries bytes as far as it goes ──▶ waits, seated
//!  an event (bytes, time, an errand): wakes the one who drove last; the keeper, if nobody is seated or others depend on it
//!  a call that ends or is dropped:  leaves its seat; an event that it was woken by and did not see goes to the next
//! ```

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
    /// Nothing of what is in it: that is all that is known of a robot, and who prints a handle wants none of it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SharedConnection").finish_non_exhaustive()
    }
}

impl SharedConnection {
    /// For a connection that is there. `expected`: who has to be at its other end, where that is known; `now`: the time at which it
    /// begins; `seed`: draws the waits before it is made anew, where the settings do not.
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

    /// The connection; nobody holds this across an await, and nothing that holds it can panic halfway.
    pub fn connection(&self) -> MutexGuard<'_, Connection> {
        self.connection.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A connection that is there, and what drives it.
#[derive(Clone, Debug)]
pub(crate) struct Driven {
    pub shared: Arc<SharedConnection>,
    pub hand: Arc<dyn Hand>,
}

/// A second connection that is being made.
pub(crate) type Second<'h> = Pin<Box<dyn Future<Output = Result<Driven, NotSent>> + Send + 'h>>;

/// Carries bytes and time.
pub(crate) trait Hand: fmt::Debug + Send + Sync {
    /// Says what time it is.
    fn tell_time(&self);

    /// Carries bytes, times and errands as far as it goes without waiting; whether anything came in. Wakes who is seated here, or the
    /// keeper, when there is more.
    fn carry(&self, seat: &mut Seat, cx: &mut Context<'_>) -> bool;

    /// The call is over, or given up.
    fn leave(&self, seat: &mut Seat);

    /// There is something to do for which nobody waits.
    fn nudge(&self);

    /// Makes a second connection to the same address, which is not made anew; `expected`: who has to be at its other end, where that
    /// is known.
    fn second(&self, settings: RobotSettings, expected: Option<Identity>) -> Second<'_>;
}

/// So often a call looks after its operation in one turn, because something came in.
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
            // What came in may be the answer.
            if !hand.carry(&mut seated.seat, cx) {
                return Poll::Pending;
            }
        }
        // Bytes that keep coming must not keep other tasks from their turn.
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
