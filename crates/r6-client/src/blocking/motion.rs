//! The handle of a running motion, without `async`.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use r6_proto::message::Instruction;
use tokio::sync::watch;

use super::Connection;
use crate::error::RequestError;
use crate::handle::{Progress, StepState};
use crate::{Done, MotionError, StopReport};

/// The blocking form of [`crate::MotionHandle`]. Dropping it does not end the motion: the client streams it
/// to its end in the background.
#[must_use = "if the handle is dropped, only wait_until_done reports that the motion failed"]
pub struct MotionHandle {
    handle: crate::MotionHandle,
    connection: Attentive,
}

/// On drop, handles at once what the drop ends, so that a handle that stops the arm does not wait for the
/// keeper.
struct Attentive(Arc<Connection>);

impl Drop for Attentive {
    fn drop(&mut self) {
        self.0.runner.look_after();
    }
}

impl fmt::Debug for MotionHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.handle.fmt(f)
    }
}

impl MotionHandle {
    pub(super) fn new(handle: crate::MotionHandle, connection: Arc<Connection>) -> Self {
        Self { handle, connection: Attentive(connection) }
    }

    /// The blocking form of [`crate::MotionHandle::number`].
    #[must_use]
    pub fn number(&self) -> u64 {
        self.handle.number()
    }

    /// The blocking form of [`crate::MotionHandle::progress`].
    #[must_use]
    pub fn progress(&self) -> Progress {
        self.handle.progress()
    }

    /// The blocking form of [`crate::MotionHandle::steps`].
    #[must_use]
    pub fn steps(&self) -> &[Instruction] {
        self.handle.steps()
    }

    /// Waits at most this long. Returns whether the motion has ended, well or not. For a loop that shows the
    /// progress.
    #[must_use]
    pub fn ended_within(&self, time: Duration) -> bool {
        let mut progress = self.handle.watch();
        let ended = self.connection.0.robot.within(time, progress.wait_for(|progress| progress.ended));
        // If the sender is gone, no more progress will come.
        self.connection.0.runner.block_on(ended).is_ok()
    }

    /// The blocking form of [`crate::MotionHandle::step`].
    #[must_use]
    pub fn step(&self, step: usize) -> Option<StepHandle> {
        let step = self.handle.step(step)?;
        Some(StepHandle { step, connection: Arc::clone(&self.connection.0) })
    }

    /// The blocking form of [`crate::MotionHandle::watch`]: an iterator over the present progress, then each
    /// change, and the end last. It skips the changes between two calls of `next` and returns only the
    /// latest.
    #[must_use]
    pub fn watch(&self) -> ProgressWatch {
        let mut progress = self.handle.watch();
        progress.mark_changed();
        ProgressWatch { progress, ended: false, connection: Arc::clone(&self.connection.0) }
    }

    /// The blocking form of [`crate::MotionHandle::finished`].
    ///
    /// # Errors
    /// The same errors.
    #[expect(clippy::result_large_err, reason = "made once a motion")]
    pub fn finished(self) -> Result<Done, MotionError> {
        self.connection.0.runner.block_on(self.handle.finished())
    }

    /// The blocking form of [`crate::MotionHandle::wait`]. The handle stays valid and may be used again.
    ///
    /// # Errors
    /// The same errors.
    #[expect(clippy::result_large_err, reason = "made once a motion")]
    pub fn wait(&mut self) -> Result<Done, MotionError> {
        self.connection.0.runner.block_on(self.handle.wait())
    }

    /// The blocking form of [`crate::MotionHandle::release`].
    pub fn release(self) -> Progress {
        self.connection.0.runner.block_on(self.handle.release())
    }

    /// The blocking form of [`crate::MotionHandle::stop`].
    ///
    /// # Errors
    /// The same errors.
    pub fn stop(self) -> Result<StopReport, RequestError> {
        self.connection.0.runner.block_on(self.handle.stop())
    }
}

/// The progress of a motion as it changes ([`MotionHandle::watch`]). The iterator ends after the value that
/// has `ended`.
pub struct ProgressWatch {
    progress: watch::Receiver<Progress>,
    ended: bool,
    connection: Arc<Connection>,
}

impl fmt::Debug for ProgressWatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("ProgressWatch").field(&*self.progress.borrow()).finish()
    }
}

impl Iterator for ProgressWatch {
    type Item = Progress;

    fn next(&mut self) -> Option<Progress> {
        if self.ended {
            return None;
        }
        // If the sender is gone, no more progress will come.
        self.connection.runner.block_on(self.progress.changed()).ok()?;
        let progress = *self.progress.borrow_and_update();
        self.ended = progress.ended;
        Some(progress)
    }
}

/// The blocking form of [`crate::StepHandle`].
pub struct StepHandle {
    step: crate::StepHandle,
    connection: Arc<Connection>,
}

impl fmt::Debug for StepHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.step.fmt(f)
    }
}

impl StepHandle {
    /// The blocking form of [`crate::StepHandle::number`].
    #[must_use]
    pub fn number(&self) -> usize {
        self.step.number()
    }

    /// The blocking form of [`crate::StepHandle::state`].
    #[must_use]
    pub fn state(&self) -> StepState {
        self.step.state()
    }

    /// The blocking form of [`crate::StepHandle::started`].
    pub fn started(&mut self) -> bool {
        self.connection.runner.block_on(self.step.started())
    }

    /// The blocking form of [`crate::StepHandle::done`].
    pub fn done(&mut self) -> bool {
        self.connection.runner.block_on(self.step.done())
    }
}
