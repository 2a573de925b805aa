//! What a robot shares with the rest of its cell: registers, cameras, targets that move.

use tokio::sync::watch;

use crate::blocking::Robot;
use crate::units::AxisPosition;
use crate::{FollowOptions, Followed, Keep, MotionError, PhotosEnded, RegisterError, RegisterIndex, Shot};

impl Robot {
    /// As [`crate::Robot::read_registers`].
    ///
    /// # Errors
    /// As there.
    pub fn read_registers(&self, first: RegisterIndex, count: usize) -> Result<Vec<i64>, RegisterError> {
        self.engine().block_on(self.as_async().read_registers(first, count))
    }

    /// As [`crate::Robot::write_registers`].
    ///
    /// # Errors
    /// As there.
    pub fn write_registers(
        &self,
        first: RegisterIndex,
        values: &[i32],
        keep: Keep,
    ) -> Result<(), RegisterError> {
        self.engine().block_on(self.as_async().write_registers(first, values, keep))
    }

    /// As [`crate::Robot::serve_photos`]: it keeps this thread until it cannot go on. `look` runs on it, and must not call
    /// this robot.
    pub fn serve_photos(&self, mut look: impl FnMut(i64) -> Shot) -> PhotosEnded {
        self.engine().block_on(self.as_async().serve_photos(|cam_id| std::future::ready(look(cam_id))))
    }

    /// As [`crate::Robot::follow`]: it keeps this thread until the sender is gone; another one sends.
    ///
    /// # Errors
    /// As there.
    #[expect(clippy::result_large_err, reason = "made once a motion")]
    pub fn follow(
        &self,
        targets: watch::Receiver<AxisPosition>,
        options: FollowOptions,
    ) -> Result<Followed, MotionError> {
        self.engine().block_on(self.as_async().follow(targets, options))
    }
}
