//! The handle of a running motion: the state of each of its steps.

use std::fmt;
use std::sync::Arc;

use r6_proto::message::Instruction;
use tokio::sync::{oneshot, watch};

use crate::done::Done;
use crate::drive::{Hand, drive};
use crate::error::RequestError;
pub use crate::progress::{Progress, StepState};
use crate::robot::Robot;
use crate::stop::report::StopReport;
use crate::stream::error::{Cause, MotionError};
use crate::stream::task::{Ended, Wish};

/// A running motion ([`Robot::run`]).
///
/// Dropping it does not end the motion: it is streamed to its end, and [`Robot::wait_until_done`] waits for
/// that. With [`crate::RunOptions::stop_on_drop`] the arm is stopped instead. Both need a runtime that keeps
/// running. If it might not, use [`Self::stop`] or [`Self::finished`].
#[must_use = "if the handle is dropped, only wait_until_done and the next motion report that the motion failed"]
pub struct MotionHandle {
    pub(crate) robot: Robot,
    pub(crate) number: u64,
    pub(crate) progress: watch::Receiver<Progress>,
    /// Sends the owner's wish; dropped with the handle.
    pub(crate) end: Option<oneshot::Sender<Wish>>,
    pub(crate) task: oneshot::Receiver<Ended>,
    /// How the motion ended, once that was received.
    pub(crate) outcome: Option<Ended>,
    pub(crate) steps: Vec<Instruction>,
}

/// Omits the steps, which may be many.
impl fmt::Debug for MotionHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MotionHandle").field("progress", &self.progress()).finish_non_exhaustive()
    }
}

impl MotionHandle {
    /// The number of the motion among those of its robot's handle, counted from 1: [`Done::motion`] has the
    /// same number.
    #[must_use]
    pub fn number(&self) -> u64 {
        self.number
    }

    /// The present progress.
    #[must_use]
    pub fn progress(&self) -> Progress {
        *self.progress.borrow()
    }

    /// A receiver of every change: a stream of progress.
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
        Some(StepHandle { step, progress: self.progress.clone(), hand: Arc::clone(self.robot.hand()) })
    }

    /// Waits until the arm stands at the end of the motion, with nothing left in its list. This is judged by
    /// the state, not by "ok".
    ///
    /// Dropping the future drops the handle; [`Self::wait`] keeps it.
    ///
    /// # Errors
    /// [`MotionError`]: why the motion ended early, and the state of the steps and of the arm.
    pub async fn finished(mut self) -> Result<Done, MotionError> {
        self.wait().await
    }

    /// As [`Self::finished`], but keeps the handle: dropping the future changes nothing, and it may be called
    /// again.
    ///
    /// Use it to wait for something else, too, and then to stop: `select!` between this and a Ctrl-C, then
    /// [`Self::stop`].
    ///
    /// # Errors
    /// As [`Self::finished`].
    pub async fn wait(&mut self) -> Result<Done, MotionError> {
        let robot = self.robot.clone();
        robot.drive(self.ended()).await.result
    }

    async fn ended(&mut self) -> Ended {
        if let Some(ended) = &self.outcome {
            return ended.clone();
        }
        let ended = match (&mut self.task).await {
            Ok(ended) => ended,
            // The task does not panic, but a runtime that shuts down drops it.
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

    /// Ends the streaming: nothing more is sent, and the arm finishes what is in its list. Returns what was
    /// sent until then. If another caller's stop is under way, it waits for that.
    pub async fn release(mut self) -> Progress {
        if let Some(end) = self.end.take() {
            end.send(Wish::Release).ok();
        }
        self.robot.clone().drive(self.ended()).await;
        self.progress()
    }

    /// Ends the streaming, stops the arm, verifies that, and clears its list ([`Robot::stop`]). It also stops
    /// the arm if the motion has already ended.
    ///
    /// # Errors
    /// As [`Robot::stop`].
    pub async fn stop(mut self) -> Result<StopReport, RequestError> {
        if let Some(end) = self.end.take() {
            end.send(Wish::Stop).ok();
        }
        let robot = self.robot.clone();
        match robot.drive(self.ended()).await {
            Ended { result: Err(MotionError { stop: Some(stopped), .. }), stopped_as_asked: true } => {
                *stopped
            }
            // Even if something stopped the arm before, it may have been started again since.
            Ended { .. } => robot.stop().await,
        }
    }
}

/// One step of a running motion. It may outlive the motion's handle, and does not keep the motion running.
#[derive(Clone, Debug)]
pub struct StepHandle {
    step: usize,
    progress: watch::Receiver<Progress>,
    hand: Arc<dyn Hand>,
}

impl StepHandle {
    /// Its number, counted from 1.
    #[must_use]
    pub fn number(&self) -> usize {
        self.step
    }

    /// The state of the step.
    #[must_use]
    pub fn state(&self) -> StepState {
        self.progress.borrow().step(self.step).unwrap_or(StepState::Queued)
    }

    /// Waits until its turn has come; `false` if the motion ended before that was seen.
    pub async fn started(&mut self) -> bool {
        self.wait_for(|state| matches!(state, StepState::Running | StepState::Done)).await
    }

    /// Waits until the step is done; `false` if that was not seen.
    pub async fn done(&mut self) -> bool {
        self.wait_for(|state| state == StepState::Done).await
    }

    async fn wait_for(&mut self, wanted: impl Fn(StepState) -> bool) -> bool {
        let step = self.step;
        let is_there = |progress: &Progress| progress.step(step).is_some_and(&wanted);
        let seen = self.progress.wait_for(|progress| progress.ended || is_there(progress));
        let seen = drive(&*self.hand, seen).await;
        seen.is_ok_and(|progress| is_there(&progress))
    }
}
