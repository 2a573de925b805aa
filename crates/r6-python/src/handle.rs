//! A running motion.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use r6_client::{Cause, Done, MotionError, MotionHandle, Robot, StepState};
use tokio::sync::watch;
use tokio::task::AbortHandle;
use tokio::time::timeout;

use crate::closing::stopping;
use crate::convert::{self, seconds};
use crate::operation::Operation;
use crate::pickling::Reduced;
use crate::process::OfThisProcess;
use crate::raising::raise;

/// The progress of a motion, from the controller's state. Its steps are done in order.
#[pyclass(frozen, module = "r6._r6", eq)]
#[derive(Clone, Copy, PartialEq)]
pub struct Progress(pub r6_client::Progress);

#[pymethods]
impl Progress {
    /// Steps of the motion.
    #[getter]
    fn total(&self) -> usize {
        self.0.total
    }

    /// Steps that were sent: the accepted ones, and those of a frame whose answer has not come.
    #[getter]
    fn left(&self) -> usize {
        self.0.left
    }

    /// Steps that were accepted.
    #[getter]
    fn accepted(&self) -> usize {
        self.0.accepted
    }

    /// Steps that are over.
    #[getter]
    fn done(&self) -> usize {
        self.0.done
    }

    /// Whether nothing more is sent and the state is no longer read.
    #[getter]
    fn ended(&self) -> bool {
        self.0.ended
    }

    /// The present step, counted from 1; the last step if all are over.
    #[getter]
    fn current(&self) -> usize {
        self.0.current()
    }

    /// Steps that were sent and not seen to be over.
    #[getter]
    fn under_way(&self) -> usize {
        self.0.under_way()
    }

    /// The state of a step, counted from 1; ``IndexError`` if there is no such step.
    fn step(&self, step: usize) -> PyResult<&'static str> {
        self.0.step(step).map(state_word).ok_or_else(|| no_such_step(step, self.0.total))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> Reduced<'py> {
        self.reduced(py)
    }

    fn __repr__(&self) -> String {
        let progress = &self.0;
        format!(
            "<Progress {} of {} done, {} under way{}>",
            progress.done,
            progress.total,
            progress.under_way(),
            if progress.ended { ", ended" } else { "" }
        )
    }
}

fn state_word(state: StepState) -> &'static str {
    match state {
        StepState::Queued => "queued",
        StepState::Sent => "sent",
        StepState::Running => "running",
        StepState::Done => "done",
        StepState::Lost => "lost",
    }
}

fn no_such_step(step: usize, total: usize) -> PyErr {
    PyIndexError::new_err(format!("there is no step {step}: they are counted from 1 to {total}"))
}

type Outcome = Result<Done, MotionError>;

/// The parts of a handle.
pub struct Parts {
    robot: Robot,
    number: u64,
    stop_on_drop: bool,
    progress: watch::Receiver<r6_client::Progress>,
    outcome: watch::Receiver<Option<Outcome>>,
    /// How many callers wait for the end.
    asked: Arc<watch::Sender<usize>>,
    owner: Streaming,
}

/// The task that holds the client's handle, or that follows a target. Dropping this drops the handle and ends
/// the following.
pub struct Streaming(pub AbortHandle);

impl Streaming {
    /// Ends it now.
    pub fn end(&self) {
        self.0.abort();
    }
}

impl Drop for Streaming {
    fn drop(&mut self) {
        self.0.abort();
    }
}

/// A caller that waits for the end of the motion. It is counted until it gives up.
struct Asking(Arc<watch::Sender<usize>>);

impl Asking {
    fn at(asked: Arc<watch::Sender<usize>>) -> Self {
        asked.send_modify(|count| *count += 1);
        Self(asked)
    }
}

impl Drop for Asking {
    fn drop(&mut self) {
        self.0.send_modify(|count| *count = count.saturating_sub(1));
    }
}

/// Holds the client's handle. It waits for the end only while a caller does, because the client reports the
/// end once: to the handle, to `wait_until_done` or to `close`.
async fn own(
    mut handle: MotionHandle,
    mut asked: watch::Receiver<usize>,
    tell: watch::Sender<Option<Outcome>>,
) {
    // The wait fails once the caller's handle, which has the sender, is dropped.
    while asked.wait_for(|count| *count > 0).await.is_ok() {
        tokio::select! {
            outcome = handle.wait() => {
                tell.send_replace(Some(outcome));
                return;
            }
            _given_up = asked.wait_for(|count| *count == 0) => {}
        }
    }
}

/// The common part of ``MotionHandle`` and ``AsyncMotionHandle``.
#[pyclass(frozen, module = "r6._r6")]
pub struct MotionCore {
    parts: OfThisProcess<Parts>,
    /// The progress that `next_progress` returned last.
    told: Mutex<Option<r6_client::Progress>>,
    /// Whether its handle asked for a stop.
    stop_asked: AtomicBool,
}

impl MotionCore {
    /// Keeps the client's handle in a task of the engine. With `stop_on_drop` the arm is stopped when that
    /// task ends.
    pub fn parts(robot: Robot, handle: MotionHandle, stop_on_drop: bool) -> Parts {
        let (number, progress) = (handle.number(), handle.watch());
        let (tell, outcome) = watch::channel(None);
        let (asked, asks) = watch::channel(0);
        let owner = Streaming(tokio::spawn(own(handle, asks, tell)).abort_handle());
        Parts { robot, number, stop_on_drop, progress, outcome, asked: Arc::new(asked), owner }
    }

    /// The handle.
    pub fn new(parts: Parts) -> Self {
        Self { parts: OfThisProcess::new(parts), told: Mutex::new(None), stop_asked: AtomicBool::new(false) }
    }

    /// Waits until a step is in the wanted state. Returns `false` if it will not be, as far as is known.
    fn step_is(&self, step: usize, wanted: fn(StepState) -> bool) -> PyResult<Operation> {
        self.step_state(step)?;
        let mut progress = self.parts.here()?.progress.clone();
        let is_there = move |progress: &r6_client::Progress| progress.step(step).is_some_and(wanted);
        let waiting = async move {
            let seen = progress.wait_for(|progress| progress.ended || is_there(progress)).await;
            seen.is_ok_and(|progress| is_there(&progress))
        };
        Ok(Operation::new(waiting, |py, seen| seen.into_bound_py_any(py)))
    }
}

#[pymethods]
impl MotionCore {
    #[getter]
    fn number(&self) -> PyResult<u64> {
        Ok(self.parts.here()?.number)
    }

    fn progress(&self) -> PyResult<Progress> {
        Ok(Progress(*self.parts.here()?.progress.borrow()))
    }

    /// Waits for progress that it did not return yet; `None` after the last progress of an ended motion.
    fn next_progress(slf: &Bound<'_, Self>) -> PyResult<Operation> {
        let core = slf.clone().unbind();
        let parts = slf.get().parts.here()?;
        let mut progress = parts.progress.clone();
        let told = *slf.get().told.lock().unwrap_or_else(PoisonError::into_inner);
        let waiting = async move {
            if told.is_some_and(|told| told.ended) {
                return None;
            }
            // The sender is dropped with the task; the last value stays.
            let changed = progress.wait_for(|progress| Some(*progress) != told).await.map(|now| *now);
            changed.ok()
        };
        Ok(Operation::new(waiting, move |py, progress| {
            if let Some(progress) = progress {
                *core.get().told.lock().unwrap_or_else(PoisonError::into_inner) = Some(progress);
            }
            progress.map(Progress).into_bound_py_any(py)
        }))
    }

    fn step_state(&self, step: usize) -> PyResult<&'static str> {
        self.progress()?.step(step)
    }

    fn step_started(&self, step: usize) -> PyResult<Operation> {
        self.step_is(step, |state| matches!(state, StepState::Running | StepState::Done))
    }

    fn step_done(&self, step: usize) -> PyResult<Operation> {
        self.step_is(step, |state| state == StepState::Done)
    }

    pub fn finished(&self) -> PyResult<Operation> {
        let parts = self.parts.here()?;
        let (mut outcome, mut progress) = (parts.outcome.clone(), parts.progress.clone());
        let asked = Arc::clone(&parts.asked);
        let waiting = async move {
            let _asking = Asking::at(asked);
            if let Ok(Some(outcome)) = outcome.wait_for(Option::is_some).await.map(|outcome| outcome.clone())
            {
                return outcome;
            }
            // The client's handle was dropped, so the client stops the arm. The sender is dropped when the
            // stop has ended.
            over(&mut progress).await;
            let progress = *progress.borrow();
            Err(MotionError { cause: Cause::Dropped, progress, stop: None })
        };
        Ok(Operation::new(waiting, |py, done| convert::done(py, &raise(py, done)?)))
    }

    /// Waits for the end at most this long, seconds. Returns whether the motion ended.
    fn ended_within(&self, time: f64) -> PyResult<Operation> {
        let mut progress = self.parts.here()?.progress.clone();
        let time = seconds("time", time)?;
        let waiting = async move { timeout(time, over(&mut progress)).await.is_ok() };
        Ok(Operation::new(waiting, |py, ended| ended.into_bound_py_any(py)))
    }

    /// Whether its handle asked for a stop.
    #[getter]
    pub fn stop_asked(&self) -> bool {
        self.stop_asked.load(Ordering::Relaxed)
    }

    /// Ends the streaming and stops the arm. The stop goes on if the caller gives up waiting.
    pub fn stop(&self) -> PyResult<Operation> {
        self.stop_asked.store(true, Ordering::Relaxed);
        Ok(stopping(self.parts.here()?.robot.clone()))
    }

    /// Does what dropping the handle does: with `stop_on_drop` it stops the arm, else the motion goes on to
    /// its end.
    fn release(&self) -> PyResult<()> {
        let parts = self.parts.here()?;
        if parts.stop_on_drop {
            parts.owner.end();
        }
        Ok(())
    }
}

/// Waits for the end of the motion and of a stop after it: the sender of the progress is dropped then.
async fn over(progress: &mut watch::Receiver<r6_client::Progress>) {
    while progress.changed().await.is_ok() {}
}
