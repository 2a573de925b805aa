//! A target that the arm follows.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use r6_client::{Cause, FollowOptions, Followed, MotionError, Progress, Robot, TargetSender};
use tokio::sync::watch;

use crate::closing::stopping;
use crate::convert;
use crate::handle::Streaming;
use crate::operation::Operation;
use crate::process::{OfThisProcess, Process};
use crate::raising::raise;
use crate::units::{AxisPosition, Given};

type Outcome = Result<Followed, MotionError>;

struct Parts {
    robot: Robot,
    /// `None` once no other target is accepted.
    target: Mutex<Option<TargetSender>>,
    outcome: watch::Receiver<Option<Outcome>>,
    streaming: Streaming,
}

/// The common part of ``Following`` and ``AsyncFollowing``.
#[pyclass(frozen, module = "r6._r6")]
pub struct FollowCore {
    parts: OfThisProcess<Parts>,
    /// Whether its owner asked for a stop.
    stop_asked: AtomicBool,
}

impl FollowCore {
    /// Begins to follow. Nothing moves before the first target.
    pub fn new(py: Python<'_>, robot: Robot, options: FollowOptions) -> PyResult<Self> {
        let (target, targets) = TargetSender::new();
        let (tell, outcome) = watch::channel(None);
        let following = robot.clone();
        let task = Process::current(py)?.engine().handle().spawn(async move {
            let result = following.follow(targets, options).await;
            tell.send_replace(Some(result));
        });
        let (target, streaming) = (Mutex::new(Some(target)), Streaming(task.abort_handle()));
        Ok(Self {
            parts: OfThisProcess::new(Parts { robot, target, outcome, streaming }),
            stop_asked: AtomicBool::new(false),
        })
    }
}

#[pymethods]
impl FollowCore {
    /// Sets the target. Raises the reason if it is no longer followed.
    fn target(&self, py: Python<'_>, to: Given<AxisPosition>) -> PyResult<()> {
        let parts = self.parts.here()?;
        let outcome = parts.outcome.borrow().clone();
        let ended = || PyRuntimeError::new_err("following has ended: no other target is taken");
        match outcome {
            Some(outcome) => {
                raise(py, outcome)?;
                Err(ended())
            }
            None => {
                let target = parts.target.lock().unwrap_or_else(PoisonError::into_inner);
                target.as_ref().ok_or_else(ended)?.send(to.0);
                Ok(())
            }
        }
    }

    /// Accepts no other target, and waits until the arm stands.
    pub fn finished(&self) -> PyResult<Operation> {
        let parts = self.parts.here()?;
        parts.target.lock().unwrap_or_else(PoisonError::into_inner).take();
        let mut outcome = parts.outcome.clone();
        let waiting = async move {
            match outcome.wait_for(Option::is_some).await.map(|outcome| outcome.clone()) {
                Ok(Some(outcome)) => outcome,
                // The following was dropped during this wait.
                Ok(None) | Err(_) => {
                    let progress = Progress { ended: true, ..Progress::default() };
                    Err(MotionError { cause: Cause::Dropped, progress, stop: None })
                }
            }
        };
        Ok(Operation::new(waiting, |py, followed| convert::followed(py, &raise(py, followed)?)))
    }

    /// Ends it and stops the arm. The stop goes on if the caller gives up waiting.
    pub fn stop(&self) -> PyResult<Operation> {
        self.stop_asked.store(true, Ordering::Relaxed);
        Ok(stopping(self.parts.here()?.robot.clone()))
    }

    /// Whether its owner asked for a stop.
    #[getter]
    pub fn stop_asked(&self) -> bool {
        self.stop_asked.load(Ordering::Relaxed)
    }

    /// Ends it. The arm finishes the step or two in its list.
    fn release(&self) -> PyResult<()> {
        self.parts.here()?.streaming.end();
        Ok(())
    }
}
