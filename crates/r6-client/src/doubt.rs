//! Frames that can move the arm and have an open outcome: while there are any, a stop is not complete.
//!
//! ```text
//!  left ──▶ unanswered ──(ok or err)──▶ no doubt
//!               │
//!               └─(time-out, or the connection ended)──▶ lost ──(2 s)────▶ no doubt
//! ```
//!
//! A busy controller may take a list a second late and run it.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_proto::time::Instant;
use tokio::sync::Notify;

use crate::error::RequestError;
use crate::time::Time;

/// How long after the timeout a controller may still take a frame. A controller was seen to take a list 1 s
/// after it; this is twice that.
const TAKEN_LATE: Duration = Duration::from_secs(2);

/// The frames of one handle with an open outcome.
#[derive(Debug)]
pub(crate) struct Doubts {
    shared: Arc<Shared>,
    time: Arc<Time>,
}

#[derive(Debug, Default)]
struct Shared {
    open: Mutex<Open>,
    /// Wakes the waiting tasks in the order in which they began to wait. A simulation relies on this order if
    /// two stops end together.
    changed: Notify,
}

impl Shared {
    fn open(&self) -> MutexGuard<'_, Open> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Open)) {
        change(&mut self.open());
        self.changed.notify_waiters();
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Open {
    /// Frames that were sent and wait for their reply.
    unanswered: usize,
    /// When the last frame without a reply was given up.
    lost_at: Option<Instant>,
}

/// One frame that was sent. This settles the doubt however its job ends.
#[derive(Debug)]
pub(crate) struct Doubt {
    shared: Arc<Shared>,
    time: Arc<Time>,
    settled: bool,
}

impl Doubts {
    pub fn new(time: Arc<Time>) -> Self {
        Self { shared: Arc::default(), time }
    }

    /// Notes a frame that can move the arm, as it is handed to the connection.
    pub fn begin(&self) -> Doubt {
        self.shared.change(|open| open.unanswered += 1);
        Doubt { shared: Arc::clone(&self.shared), time: Arc::clone(&self.time), settled: false }
    }

    /// Until when a frame may still be carried out, as far as is known now; outer `None` without such a
    /// frame. Inner `None` while a frame is unanswered.
    pub fn until(&self, now: Instant) -> Option<Option<Instant>> {
        let open = *self.shared.open();
        if open.unanswered > 0 {
            return Some(None);
        }
        open.lost_at.map(|at| at + TAKEN_LATE).filter(|until| *until > now).map(Some)
    }

    /// Waits for a change, or until this time.
    pub async fn change_until(&self, at: Instant) {
        let changed = self.shared.changed.notified();
        self.time.timeout_at(at, changed).await.ok();
    }
}

impl Doubt {
    /// Settles the doubt, with the answer or with the error in its place.
    pub fn settle<T>(mut self, answer: &Result<T, RequestError>) {
        // Controllers have run lists that they refused, but they did so at once.
        self.end(matches!(answer, Err(RequestError::OutcomeUnknown(_))));
    }

    fn end(&mut self, lost: bool) {
        self.settled = true;
        self.shared.change(|open| {
            open.unanswered = open.unanswered.saturating_sub(1);
            if lost {
                open.lost_at = Some(self.time.now());
            }
        });
    }
}

impl Drop for Doubt {
    fn drop(&mut self) {
        if !self.settled {
            self.end(true);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::{NotSent, OutcomeUnknown};
    use crate::job::Work;

    fn timed_out() -> Result<(), RequestError> {
        let request = Work::Query([].into()).sent();
        Err(OutcomeUnknown::TimedOut { request, after: Duration::from_secs(2), heard: None }.into())
    }

    #[test]
    fn a_frame_is_in_doubt_until_it_is_answered_or_too_old() {
        let doubts = Doubts::new(Arc::default());
        let now = Instant::ORIGIN;
        assert_eq!(doubts.until(now), None);
        let (first, second) = (doubts.begin(), doubts.begin());
        assert_eq!(doubts.until(now), Some(None));
        first.settle(&Ok(()));
        assert_eq!(doubts.until(now), Some(None), "one more waits");
        second.settle(&timed_out());
        assert_eq!(doubts.until(now), Some(Some(now + TAKEN_LATE)));
        assert_eq!(doubts.until(now + TAKEN_LATE), None);
    }

    #[test]
    fn what_never_left_is_in_no_doubt_and_what_nobody_settles_is() {
        let doubts = Doubts::new(Arc::default());
        let now = Instant::ORIGIN;
        doubts.begin().settle::<()>(&Err(NotSent::Disconnected.into()));
        assert_eq!(doubts.until(now), None);
        drop(doubts.begin());
        assert!(doubts.until(now).is_some());
    }
}
