//! The handle of a motion that runs: what has become of each of its steps.

use std::fmt;

use r6_proto::message::Instruction;
use tokio::sync::{oneshot, watch};
use tokio::task::JoinHandle;

use crate::error::RequestError;
use crate::motion::Done;
use crate::robot::Robot;
use crate::stop::StopReport;
use crate::stream::{Cause, Ended, MotionError};

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

/// What the owner of a motion wishes before it has come to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wish {
    /// The arm stops.
    Stop,
    /// Nothing more is sent.
    Release,
}

/// A motion that runs ([`Robot::run`]).
///
/// Dropping it does not end the motion: it is streamed on to its end, and [`Robot::wait_until_done`] waits for that. With
/// [`crate::RunOptions::stop_on_drop`] the arm is stopped instead. Both take a runtime that lives on; use [`Self::stop`] or
/// [`Self::finished`] where it might not.
#[must_use = "if the handle is dropped, only wait_until_done and the next motion report that the motion failed"]
pub struct MotionHandle {
    pub(crate) robot: Robot,
    pub(crate) number: u64,
    pub(crate) progress: watch::Receiver<Progress>,
    /// Tells what the owner wishes; dropped with the handle.
    pub(crate) end: Option<oneshot::Sender<Wish>>,
    pub(crate) task: JoinHandle<Ended>,
    /// How it ended, once that was seen.
    pub(crate) outcome: Option<Ended>,
    pub(crate) steps: Vec<Instruction>,
}

/// Without its steps, which may be many.
impl fmt::Debug for MotionHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MotionHandle").field("progress", &self.progress()).finish_non_exhaustive()
    }
}

impl MotionHandle {
    /// The number of the motion among those of its robot's handle, counted from 1: [`Done::motion`] names it.
    #[must_use]
    pub fn number(&self) -> u64 {
        self.number
    }

    /// How far it is now.
    #[must_use]
    pub fn progress(&self) -> Progress {
        *self.progress.borrow()
    }

    /// A receiver that is told of every change: a stream of progress.
    #[must_use]
    pub fn watch(&self) -> watch::Receiver<Progress> {
        self.progress.clone()
    }

    /// The steps.
    #[must_use]
    pub fn steps(&self) -> &[Instruction] {
        &self.steps
    }

    /// The handle of one step, counted from 1; `None` if there is no such step.
    #[must_use]
    pub fn step(&self, step: usize) -> Option<StepHandle> {
        self.progress().step(step)?;
        Some(StepHandle { step, progress: self.progress.clone() })
    }

    /// Waits until the arm stands at the end of the motion, with nothing left in its list: judged by state, not by "ok".
    ///
    /// Dropping the future drops the handle; [`Self::wait`] leaves it.
    ///
    /// # Errors
    /// [`MotionError`]: why it ended before, what became of the steps, and what became of the arm.
    pub async fn finished(mut self) -> Result<Done, MotionError> {
        self.wait().await
    }

    /// As [`Self::finished`], without giving the handle away: dropping the future changes nothing, and it may be asked again.
    ///
    /// For whoever waits for something else, too, and then stops: `select!` between this and a Ctrl-C, then [`Self::stop`].
    ///
    /// # Errors
    /// As [`Self::finished`].
    pub async fn wait(&mut self) -> Result<Done, MotionError> {
        self.ended().await.result
    }

    async fn ended(&mut self) -> Ended {
        if let Some(ended) = &self.outcome {
            return ended.clone();
        }
        let ended = match (&mut self.task).await {
            Ok(ended) => ended,
            // The task does not panic; a runtime that was shut down ends it.
            Err(_gone) => {
                let progress = Progress { ended: true, ..self.progress() };
                let result = Err(MotionError { cause: Cause::Abandoned, progress, stop: None });
                Ended { result, stopped_as_asked: false }
            }
        };
        self.robot.motions().told(self.number);
        self.outcome = Some(ended.clone());
        ended
    }

    /// Ends the streaming: nothing more is sent, and the arm finishes what is in its list. Tells what had left by then. A stop of
    /// somebody else that is under way is waited for.
    pub async fn release(mut self) -> Progress {
        if let Some(end) = self.end.take() {
            end.send(Wish::Release).ok();
        }
        self.ended().await;
        self.progress()
    }

    /// Ends the streaming and stops the arm, verified, its list cleared ([`Robot::stop`]). A motion that has ended is stopped
    /// all the same.
    ///
    /// # Errors
    /// As [`Robot::stop`].
    pub async fn stop(mut self) -> Result<StopReport, RequestError> {
        if let Some(end) = self.end.take() {
            end.send(Wish::Stop).ok();
        }
        match self.ended().await {
            Ended { result: Err(MotionError { stop: Some(stopped), .. }), stopped_as_asked: true } => {
                *stopped
            }
            // Whatever stopped it before, the arm may have been started again since.
            Ended { .. } => self.robot.stop().await,
        }
    }
}

/// One step of a motion that runs. It outlives the motion's handle, and does not keep the motion running.
#[derive(Clone, Debug)]
pub struct StepHandle {
    step: usize,
    progress: watch::Receiver<Progress>,
}

impl StepHandle {
    /// Its number, counted from 1.
    #[must_use]
    pub fn number(&self) -> usize {
        self.step
    }

    /// What has become of it.
    #[must_use]
    pub fn state(&self) -> StepState {
        self.progress.borrow().step(self.step).unwrap_or(StepState::Queued)
    }

    /// Waits until its turn has come; `false` if it never will, as far as is known.
    pub async fn started(&mut self) -> bool {
        self.wait_for(|state| matches!(state, StepState::Running | StepState::Done)).await
    }

    /// Waits until it is over; `false` if that was not seen.
    pub async fn done(&mut self) -> bool {
        self.wait_for(|state| state == StepState::Done).await
    }

    async fn wait_for(&mut self, wanted: impl Fn(StepState) -> bool) -> bool {
        let step = self.step;
        let is_there = |progress: &Progress| progress.step(step).is_some_and(&wanted);
        let seen = self.progress.wait_for(|progress| progress.ended || is_there(progress)).await;
        seen.is_ok_and(|progress| is_there(&progress))
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
