//! Whether this gateway owns a robot now.
//!
//! [`Ownership`] is of one term: from when the gateway took the robot, or the hall, to when it has it no
//! more. Whatever was permitted in one term is void in the next. `core/owner.rs` has the times. [`owners`]
//! knows who has what.

pub mod owners;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_api::Code;
use r6_proto::time::Instant;
use tokio::sync::Notify;

use crate::clock;
use crate::core::owner::{Phase, Reign};
use crate::problem::Problem;

/// The longest time between two looks at the clock. The clock of the beats goes on while the machine sleeps,
/// and that of tasks does not.
const LOOK: Duration = Duration::from_millis(100);

/// Whether the gateway owns a robot in this term. Clones are of the same term.
#[derive(Clone, Debug)]
pub struct Ownership(Arc<Held>);

#[derive(Debug)]
struct Held {
    standing: Mutex<Standing>,
    changed: Notify,
}

#[derive(Clone, Copy, Debug)]
enum Standing {
    /// The store is this gateway's alone.
    Alone,
    /// It owns the robot, in a store that others share.
    Owns(Reign),
    /// It has let go of it.
    Over,
}

impl Ownership {
    /// The store is this gateway's alone.
    #[must_use]
    pub fn alone() -> Self {
        Self::of(Standing::Alone)
    }

    /// The gateway owns the robot.
    #[must_use]
    pub fn owns(reign: Reign) -> Self {
        Self::of(Standing::Owns(reign))
    }

    fn of(standing: Standing) -> Self {
        Self(Arc::new(Held { standing: Mutex::new(standing), changed: Notify::new() }))
    }

    /// What the gateway may do now.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phase_at(clock::now())
    }

    fn phase_at(&self, now: Instant) -> Phase {
        match &*self.standing() {
            Standing::Alone => Phase::Owns,
            Standing::Owns(reign) => reign.phase(now),
            Standing::Over => Phase::Over,
        }
    }

    /// Whether a command or a list may leave now. It is asked in the call that writes the first byte.
    #[must_use]
    pub fn may_move(&self) -> bool {
        self.phase() == Phase::Owns
    }

    /// Whether the store is this gateway's alone.
    #[must_use]
    pub fn is_alone(&self) -> bool {
        matches!(&*self.standing(), Standing::Alone)
    }

    /// Whether anything may leave for the robot now, a stop or a query too. It is asked in the call that
    /// writes.
    #[must_use]
    pub fn may_send(&self) -> bool {
        self.phase() < Phase::Over
    }

    /// Refuses what only the owner does.
    ///
    /// # Errors
    /// `no_owner`.
    pub fn check(&self) -> Result<(), Problem> {
        let message = match self.phase() {
            Phase::Owns => return Ok(()),
            Phase::NoMoves | Phase::StopLists => {
                "the store has not answered this gateway for a second, so it changes and moves nothing: ask again, \
                 or ask another gateway"
            }
            Phase::Over => "this gateway has just let go of it: ask again, or ask another gateway",
        };
        Err(Problem::new(Code::NoOwner, message))
    }

    /// The store took the beat that was sent at this time, and says that the gateway owns the robot.
    pub fn beaten(&self, sent: Instant) {
        if let Standing::Owns(reign) = &mut *self.standing() {
            reign.beaten(sent, clock::now());
        }
    }

    /// The store has another owner, or another fence.
    pub fn refused(&self) {
        if let Standing::Owns(reign) = &mut *self.standing() {
            reign.refused();
        }
        self.0.changed.notify_waiters();
    }

    /// The gateway has let go of the robot, for good.
    pub fn end(&self) {
        *self.standing() = Standing::Over;
        self.0.changed.notify_waiters();
    }

    /// Waits until the gateway has to stop its lists.
    pub async fn until_lost(&self) {
        self.until(Phase::StopLists).await;
    }

    /// Waits until the gateway may have no connection to the robot any more.
    pub async fn until_over(&self) {
        self.until(Phase::Over).await;
    }

    async fn until(&self, phase: Phase) {
        loop {
            let changed = self.0.changed.notified();
            let now = clock::now();
            if self.phase_at(now) >= phase {
                return;
            }
            let wait = self.left(now).unwrap_or(LOOK).min(LOOK);
            tokio::select! {
                () = tokio::time::sleep(wait) => {}
                () = changed => {}
            }
        }
    }

    /// How long this phase lasts at least.
    fn left(&self, now: Instant) -> Option<Duration> {
        match &*self.standing() {
            Standing::Owns(reign) => reign.left(now),
            Standing::Alone | Standing::Over => None,
        }
    }

    fn standing(&self) -> MutexGuard<'_, Standing> {
        self.0.standing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
