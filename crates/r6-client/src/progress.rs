//! How far a motion is, and the state of each of its steps.
//!
//! ```text
//!  Queued ──sent──▶ Sent ──its turn──▶ Running ──▶ Done
//!                    └──────────────────┴──the streaming ended before the step was seen to be done──▶ Lost
//! ```

use std::fmt;

/// The state of one step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepState {
    /// It was not sent. If the motion has ended, it never will be.
    Queued,
    /// It is in the controller's list.
    Sent,
    /// Its turn has come.
    Running,
    /// It is done.
    Done,
    /// Unknown: it was sent, and was not seen to be done when the streaming ended.
    Lost,
}

/// How far a motion is, judged by the controller's state: steps are done in order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Steps of the motion.
    pub total: usize,
    /// Steps that were sent: accepted ones, and those of a frame without an answer yet.
    pub left: usize,
    /// Steps that were accepted.
    pub accepted: usize,
    /// Steps that are done.
    pub done: usize,
    /// Whether sending and watching have ended.
    pub ended: bool,
}

impl Progress {
    /// The state of a step, counted from 1; `None` if there is no such step.
    #[must_use]
    pub fn step(&self, step: usize) -> Option<StepState> {
        if step == 0 || step > self.total {
            return None;
        }
        Some(if step <= self.done {
            StepState::Done
        } else if step > self.left {
            StepState::Queued
        } else if self.ended {
            StepState::Lost
        } else if step == self.done + 1 && step <= self.accepted {
            StepState::Running
        } else {
            StepState::Sent
        })
    }

    /// The step whose turn it is, counted from 1; the last one if all are done.
    #[must_use]
    pub fn current(&self) -> usize {
        (self.done + 1).min(self.total)
    }

    /// Steps that were sent and not seen to be done.
    #[must_use]
    pub fn under_way(&self) -> usize {
        self.left.saturating_sub(self.done)
    }
}

/// `3 of 12 steps done, 8 sent and not seen to be done, 1 not sent`.
impl fmt::Display for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { total, left, done, .. } = *self;
        let (sent, queued) = (self.under_way(), total.saturating_sub(left));
        write!(f, "{done} of {total} steps done, {sent} sent and not seen to be done, {queued} not sent")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_from_queued_to_done_or_are_lost() {
        let mut progress = Progress { total: 5, left: 4, accepted: 3, done: 1, ended: false };
        let states =
            |progress: &Progress| (1..=5).map(|step| progress.step(step).unwrap()).collect::<Vec<_>>();
        use StepState::{Done, Lost, Queued, Running, Sent};
        assert_eq!(states(&progress), [Done, Running, Sent, Sent, Queued]);
        assert_eq!((progress.current(), progress.under_way()), (2, 3));
        assert_eq!(progress.to_string(), "1 of 5 steps done, 3 sent and not seen to be done, 1 not sent");
        progress.ended = true;
        assert_eq!(states(&progress), [Done, Lost, Lost, Lost, Queued]);
        assert_eq!((progress.step(0), progress.step(6)), (None, None));
    }
}
