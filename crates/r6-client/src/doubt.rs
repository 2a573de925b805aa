//! Frames that can move the arm and whose outcome is open: a stop may not be called complete while there are any.
//!
//! ```text
//!  left ──▶ unanswered ──(ok or err)──▶ no doubt
//!               │
//!               └─(time-out, or the connection ended)──▶ lost ──(2 s)────▶ no doubt
//! ```
//!
//! A controller that is busy takes a list a second late and runs it.

use std::time::Duration;

use tokio::sync::watch;
use tokio::time::{Instant, timeout_at};

use crate::error::RequestError;

/// How long after the time-out a controller may still take a frame. One was seen to take a list 1 s after it;
/// this is twice that.
const TAKEN_LATE: Duration = Duration::from_secs(2);

/// The frames of one handle whose outcome is open.
#[derive(Debug, Default)]
pub(crate) struct Doubts(watch::Sender<Open>);

#[derive(Clone, Copy, Debug, Default)]
struct Open {
    /// Frames that left and wait for their reply.
    unanswered: usize,
    /// When the last of those was given up that got no reply.
    lost_at: Option<Instant>,
}

/// One frame that left. Whatever becomes of its job, this settles the doubt.
#[derive(Debug)]
pub(crate) struct Doubt {
    open: watch::Sender<Open>,
    settled: bool,
}

impl Doubts {
    /// A frame that can move the arm is handed to the connection.
    pub fn begin(&self) -> Doubt {
        self.0.send_modify(|open| open.unanswered += 1);
        Doubt { open: self.0.clone(), settled: false }
    }

    /// Until when a frame may still be carried out, as far as is known now; `None` without one. A frame that is unanswered has no
    /// time yet.
    pub fn until(&self, now: Instant) -> Option<Option<Instant>> {
        let open = *self.0.borrow();
        if open.unanswered > 0 {
            return Some(None);
        }
        open.lost_at.map(|at| at + TAKEN_LATE).filter(|until| *until > now).map(Some)
    }

    /// Waits for a change, or until this time.
    pub async fn change_until(&self, at: Instant) {
        let mut open = self.0.subscribe();
        timeout_at(at, open.changed()).await.ok();
    }
}

impl Doubt {
    /// The request got its answer, or none.
    pub fn settle<T>(mut self, answer: &Result<T, RequestError>) {
        let lost = match answer {
            // Controllers have run lists that they refused, but at once.
            Ok(_) | Err(RequestError::Refused(_) | RequestError::NotSent(_) | RequestError::Invalid(_)) => {
                false
            }
            Err(RequestError::OutcomeUnknown(_)) => true,
        };
        self.end(lost);
    }

    fn end(&mut self, lost: bool) {
        self.settled = true;
        self.open.send_modify(|open| {
            open.unanswered = open.unanswered.saturating_sub(1);
            if lost {
                open.lost_at = Some(Instant::now());
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
        let request = Work::Query(Vec::new()).sent();
        Err(OutcomeUnknown::TimedOut { request, after: Duration::from_secs(2), heard: None }.into())
    }

    #[tokio::test(start_paused = true)]
    async fn a_frame_is_in_doubt_until_it_is_answered_or_too_old() {
        let doubts = Doubts::default();
        let now = Instant::now();
        assert_eq!(doubts.until(now), None);
        let (first, second) = (doubts.begin(), doubts.begin());
        assert_eq!(doubts.until(now), Some(None));
        first.settle(&Ok(()));
        assert_eq!(doubts.until(now), Some(None), "one more waits");
        second.settle(&timed_out());
        assert_eq!(doubts.until(now), Some(Some(now + TAKEN_LATE)));
        assert_eq!(doubts.until(now + TAKEN_LATE), None);
    }

    #[tokio::test(start_paused = true)]
    async fn what_never_left_is_in_no_doubt_and_what_nobody_settles_is() {
        let doubts = Doubts::default();
        let now = Instant::now();
        doubts.begin().settle::<()>(&Err(NotSent::Disconnected.into()));
        assert_eq!(doubts.until(now), None);
        drop(doubts.begin());
        assert!(doubts.until(now).is_some());
    }
}
