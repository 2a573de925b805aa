//! The handle of a motion that runs, without `async`.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use r6_proto::message::Instruction;
use tokio::sync::watch;

use super::Connection;
use crate::error::RequestError;
use crate::handle::{Progress, StepState};
use crate::{Done, MotionError, StopReport};

/// As [`crate::MotionHandle`]. Dropping it does not end the motion: it is streamed on to its end in the background.
#[must_use = "if the handle is dropped, only wait_until_done reports that the motion failed"]
pub struct MotionHandle {
    handle: crate::MotionHandle,
    connection: Attentive,
}

/// Looks, when it is dropped, at once at what that ends: a handle that stops the arm does not wait for the keeper.
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

    /// As [`crate::MotionHandle::number`].
    #[must_use]
    pub fn number(&self) -> u64 {
        self.handle.number()
    }

    /// As [`crate::MotionHandle::progress`].
    #[must_use]
    pub fn progress(&self) -> Progress {
        self.handle.progress()
    }

    /// As [`crate::MotionHandle::steps`].
    #[must_use]
    pub fn steps(&self) -> &[Instruction] {
        self.handle.steps()
    }

    /// Waits so long at most; whether the motion has ended, well or not. For a loop that shows the progress.
    #[must_use]
    pub fn ended_within(&self, time: Duration) -> bool {
        let mut progress = self.handle.watch();
        let ended = self.connection.0.robot.within(time, progress.wait_for(|progress| progress.ended));
        // A sender that is gone has nothing more to tell.
        self.connection.0.runner.block_on(ended).is_ok()
    }

    /// As [`crate::MotionHandle::step`].
    #[must_use]
    pub fn step(&self, step: usize) -> Option<StepHandle> {
        let step = self.handle.step(step)?;
        Some(StepHandle { step, connection: Arc::clone(&self.connection.0) })
    }

    /// As [`crate::MotionHandle::watch`], one value after the other: how far the motion is now, then each change, the end last. Between two
    /// calls of `next` changes are left out, and only the latest is told.
    #[must_use]
    pub fn watch(&self) -> ProgressWatch {
        let mut progress = self.handle.watch();
        progress.mark_changed();
        ProgressWatch { progress, ended: false, connection: Arc::clone(&self.connection.0) }
    }

    /// As [`crate::MotionHandle::finished`].
    ///
    /// # Errors
    /// As there.
    #[expect(clippy::result_large_err, reason = "made once a motion")]
    pub fn finished(self) -> Result<Done, MotionError> {
        self.connection.0.runner.block_on(self.handle.finished())
    }

    /// As [`crate::MotionHandle::wait`]: the handle stays, and may be asked again.
    ///
    /// # Errors
    /// As there.
    #[expect(clippy::result_large_err, reason = "made once a motion")]
    pub fn wait(&mut self) -> Result<Done, MotionError> {
        self.connection.0.runner.block_on(self.handle.wait())
    }

    /// As [`crate::MotionHandle::release`].
    pub fn release(self) -> Progress {
        self.connection.0.runner.block_on(self.handle.release())
    }

    /// As [`crate::MotionHandle::stop`].
    ///
    /// # Errors
    /// As there.
    pub fn stop(self) -> Result<StopReport, RequestError> {
        self.connection.0.runner.block_on(self.handle.stop())
    }
}

/// The progress of a motion, as it changes ([`MotionHandle::watch`]). It ends behind the value that has `ended`.
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
        // A sender that is gone has nothing more to tell.
        self.connection.runner.block_on(self.progress.changed()).ok()?;
        let progress = *self.progress.borrow_and_update();
        self.ended = progress.ended;
        Some(progress)
    }
}

/// As [`crate::StepHandle`].
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
    /// As [`crate::StepHandle::number`].
    #[must_use]
    pub fn number(&self) -> usize {
        self.step.number()
    }

    /// As [`crate::StepHandle::state`].
    #[must_use]
    pub fn state(&self) -> StepState {
        self.step.state()
    }

    /// As [`crate::StepHandle::started`].
    pub fn started(&mut self) -> bool {
        self.connection.runner.block_on(self.step.started())
    }

    /// As [`crate::StepHandle::done`].
    pub fn done(&mut self) -> bool {
        self.connection.runner.block_on(self.step.done())
    }
}
