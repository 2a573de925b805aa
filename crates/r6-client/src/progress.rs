//! How far a motion is, and what has become of each of its steps.
//!
//! ```text
//!  Queued ──left──▶ Sent ──its turn──▶ Running ──▶ Done
//!                    └──────────────────┴──the streaming ended before it was seen to be over──▶ Lost
//! ```

use std::fmt;

/// What has become of one step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepState {
    /// It has not left; where the motion has ended, it never will.
    Queued,
    /// It is in the controller's list.
    Sent,
    /// Its turn has come.
    Running,
    /// It is over.
    Done,
    /// Nobody knows: it left, and was not seen to be over when the streaming ended.
    Lost,
}

/// How far a motion is, as the controller's state tells: its steps are done in their order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Steps of the motion.
    pub total: usize,
    /// Steps that left: those that were accepted, and those of a frame whose answer is not there.
    pub left: usize,
    /// Steps that were accepted.
    pub accepted: usize,
    /// Steps that are over.
    pub done: usize,
    /// Whether nothing more is sent and nobody looks any more.
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

    /// The step whose turn it is, counted from 1; the last one where all are over.
    #[must_use]
    pub fn current(&self) -> usize {
        (self.done + 1).min(self.total)
    }

    /// Steps that left and were not seen to be over.
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
