//! Whether this gateway owns the robots now.
//!
//! [`Ownership`] is of one term: from when the gateway became the owner, or began to wait, to when that ends.
//! Whatever was permitted in one term is void in the next. `core/owner.rs` has the times.

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

/// Whether the gateway owns the robots in this term. Clones are of the same term.
#[derive(Clone, Debug)]
pub struct Ownership(Arc<Term>);

#[derive(Debug)]
struct Term {
    standing: Mutex<Standing>,
    changed: Notify,
}

#[derive(Debug)]
enum Standing {
    /// The store is this gateway's alone.
    Alone,
    /// It owns the robots of a store that others share.
    Owns(Reign),
    /// It does not: this gateway does, if its name is known.
    Other(String),
}

impl Ownership {
    /// The store is this gateway's alone.
    #[must_use]
    pub fn alone() -> Self {
        Self::of(Standing::Alone)
    }

    /// The gateway owns the robots.
    #[must_use]
    pub fn owns(reign: Reign) -> Self {
        Self::of(Standing::Owns(reign))
    }

    /// Another gateway owns the robots. Its name may be empty.
    #[must_use]
    pub fn other(name: String) -> Self {
        Self::of(Standing::Other(name))
    }

    fn of(standing: Standing) -> Self {
        Self(Arc::new(Term { standing: Mutex::new(standing), changed: Notify::new() }))
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
            Standing::Other(_) => Phase::Over,
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

    /// Whether anything may leave for a robot now, a stop or a query too. It is asked in the call that
    /// writes.
    #[must_use]
    pub fn may_send(&self) -> bool {
        self.phase() < Phase::Over
    }

    /// Whether another gateway owns the robots, as far as this one knows.
    #[must_use]
    pub fn is_other(&self) -> bool {
        matches!(&*self.standing(), Standing::Other(_))
    }

    /// Refuses what only the owner does.
    ///
    /// # Errors
    /// `no_owner`.
    pub fn check(&self) -> Result<(), Problem> {
        let message = match &*self.standing() {
            Standing::Alone => return Ok(()),
            Standing::Owns(reign) => match reign.phase(clock::now()) {
                Phase::Owns => return Ok(()),
                Phase::NoMoves | Phase::StopLists | Phase::Over => {
                    "the store has not answered this gateway for a second, so it changes and moves nothing: ask again, \
                     or ask another gateway"
                        .to_owned()
                }
            },
            Standing::Other(name) if name.is_empty() => {
                "no gateway owns the robots at the moment: ask again".to_owned()
            }
            Standing::Other(name) => format!("another gateway owns the robots: {name}. Ask there"),
        };
        Err(Problem::new(Code::NoOwner, message))
    }

    /// The store took the beat that was sent at this time.
    pub fn beaten(&self, sent: Instant) {
        if let Standing::Owns(reign) = &mut *self.standing() {
            reign.beaten(sent, clock::now());
        }
    }

    /// The store has another fence.
    pub fn refused(&self) {
        if let Standing::Owns(reign) = &mut *self.standing() {
            reign.refused();
        }
        self.0.changed.notify_waiters();
    }

    /// Another gateway owns the robots. An owner owns them no more, for good.
    pub fn set_other(&self, name: String) {
        *self.standing() = Standing::Other(name);
        self.0.changed.notify_waiters();
    }

    /// Waits until the gateway has to stop its lists.
    pub async fn until_lost(&self) {
        loop {
            let changed = self.0.changed.notified();
            let now = clock::now();
            if self.phase_at(now) >= Phase::StopLists {
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
    #[must_use]
    pub fn left(&self, now: Instant) -> Option<Duration> {
        match &*self.standing() {
            Standing::Owns(reign) => reign.left(now),
            Standing::Alone | Standing::Other(_) => None,
        }
    }

    fn standing(&self) -> MutexGuard<'_, Standing> {
        self.0.standing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
