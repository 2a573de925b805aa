//! What a handle remembers of its motions: the last one, how it ended, and where the last list was accepted.
//!
//! ```text
//!  Told ──begin──▶ Streamed ──end──▶ Ended ──its owner got the result, or a later list was accepted──▶ Told
//! ```
//!
//! `wait_until_done` waits for the motion that is streamed, and reports a motion that did not complete.

use std::sync::{Mutex, PoisonError};

use tokio::sync::watch;

use crate::done::Done;
use crate::evidence::About;
use crate::stream::error::{Cause, MotionError};
use crate::stream::turn::Turn;

/// How a motion ended.
pub(crate) type End = Result<Done, MotionError>;

/// The motions over one handle and its clones.
#[derive(Debug, Default)]
pub(crate) struct Motions {
    last: watch::Sender<Last>,
    /// The robot and connection that last accepted a request that can move the arm.
    sent_on: Mutex<Option<About>>,
}

/// The last motion.
#[derive(Debug, Default)]
struct Last {
    /// Counted from 1; 0 before the first.
    number: u64,
    state: State,
}

#[derive(Debug, Default)]
enum State {
    /// There is nothing to report: no motion yet, or its result was reported.
    #[default]
    Told,
    Streamed,
    /// `told`: a waiting caller got the result.
    Ended {
        end: Box<End>,
        told: bool,
    },
}

impl Motions {
    /// A motion begins; returns its number.
    pub fn begin(&self) -> u64 {
        let mut number = 0;
        self.last.send_modify(|last| {
            last.number += 1;
            last.state = State::Streamed;
            number = last.number;
        });
        number
    }

    /// The motion has ended. Its turn is released at the moment this becomes visible, and not before.
    pub fn end(&self, number: u64, end: &End, turn: Turn) {
        if end.is_ok() {
            self.forget_sent_on();
        }
        self.last.send_if_modified(|last| {
            let this = last.number == number;
            if this {
                last.state = State::Ended { end: Box::new(end.clone()), told: false };
            }
            drop(turn);
            this
        });
    }

    /// The owner got the result of this motion.
    pub fn told(&self, number: u64) {
        self.quietly(|last| {
            if last.number == number && matches!(last.state, State::Ended { .. }) {
                last.state = State::Told;
            }
        });
    }

    /// The error of a motion that the closing of its handle ended, if it was not reported before.
    pub fn cut_by_close(&self) -> Option<Box<MotionError>> {
        self.tell(|error, _told| error.cause == Cause::Closed)
    }

    /// The error of the last motion, if no caller has got it and none asked for that end. It then counts as
    /// reported.
    pub fn untold_failure(&self) -> Option<Box<MotionError>> {
        self.tell(|error, told| !told && !error.cause.was_asked_for())
    }

    /// The error of the last motion, if `is_told` selects it. It then counts as reported.
    fn tell(&self, is_told: impl FnOnce(&MotionError, bool) -> bool) -> Option<Box<MotionError>> {
        self.quietly(|last| {
            let State::Ended { end, told } = &last.state else { return None };
            let error = end.as_ref().as_ref().err().filter(|error| is_told(error, *told)).cloned()?;
            last.state = State::Told;
            Some(Box::new(error))
        })
    }

    /// Changes what is known of the last motion, without waking waiting tasks.
    fn quietly<R: Default>(&self, change: impl FnOnce(&mut Last) -> R) -> R {
        let mut result = R::default();
        self.last.send_if_modified(|last| {
            result = change(last);
            false
        });
        result
    }

    /// Waits for the end of the motion under way, and returns the result of the last motion. `None` if it was
    /// reported before this call. All callers that wait at the same time get it.
    pub async fn end_of_last(&self) -> Option<End> {
        let mut last = self.last.subscribe();
        if matches!(last.borrow().state, State::Ended { told: true, .. }) {
            return None;
        }
        // The sender lives as long as the handle that asks.
        last.wait_for(|last| !matches!(last.state, State::Streamed)).await.ok()?;
        self.quietly(|last| {
            let State::Ended { end, told } = &mut last.state else { return None };
            let end = (**end).clone();
            *told = true;
            Some(end)
        })
    }

    /// A request that can move the arm was accepted. A list drops the result of the motion before it: from
    /// now on, callers wait for the list.
    pub fn accepted(&self, about: About, is_list: bool) {
        *self.sent_on.lock().unwrap_or_else(PoisonError::into_inner) = Some(about);
        if !is_list {
            return;
        }
        self.quietly(|last| {
            if matches!(last.state, State::Ended { .. }) {
                last.state = State::Told;
            }
        });
    }

    /// Where a request that can move the arm was last accepted.
    pub fn sent_on(&self) -> Option<About> {
        self.sent_on.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Forgets it: nothing is under way any more, or the caller knows that its end cannot be seen.
    pub fn forget_sent_on(&self) {
        *self.sent_on.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

#[cfg(test)]
mod tests {
    use std::pin::pin;
    use std::sync::Arc;
    use std::task::{Context, Wake, Waker};
    use std::time::Duration;

    use super::*;
    use crate::stream::turn::Turns;

    /// A waker that takes the next turn at once, while it is being woken.
    struct Next {
        turns: Turns,
        had_a_turn: Mutex<Vec<bool>>,
    }

    impl Wake for Next {
        fn wake(self: Arc<Self>) {
            let turn = self.turns.take(0).is_ok();
            self.had_a_turn.lock().unwrap().push(turn);
        }
    }

    #[test]
    fn who_is_told_of_the_end_may_begin_the_next_motion_at_once() {
        let turns = Turns::default();
        let turn = turns.take(0).unwrap();
        let motions = Motions::default();
        let number = motions.begin();
        let next = Arc::new(Next { turns, had_a_turn: Mutex::default() });
        let waker = Waker::from(Arc::clone(&next));
        let mut waits = pin!(motions.end_of_last());
        assert!(waits.as_mut().poll(&mut Context::from_waker(&waker)).is_pending());
        let cause = Cause::Stalled { after: Duration::from_secs(1) };
        let error = MotionError { cause, progress: crate::Progress::default(), stop: None };
        motions.end(number, &Err(error), turn);
        assert_eq!(*next.had_a_turn.lock().unwrap(), [true]);
        assert!(waits.as_mut().poll(&mut Context::from_waker(&waker)).is_ready());
    }
}
