//! What a robot shares with the rest of its cell: registers, cameras, targets that move.

use futures_util::future::AbortHandle;
use tokio::sync::{mpsc, oneshot};

use crate::blocking::Robot;
use crate::{
    FollowOptions, Followed, Keep, MotionError, PhotosEnded, RegisterError, RegisterIndex, Shot, Targets,
};

impl Robot {
    /// As [`crate::Robot::read_registers`].
    ///
    /// # Errors
    /// As there.
    pub fn read_registers(&self, first: RegisterIndex, count: usize) -> Result<Vec<i64>, RegisterError> {
        self.block_on(self.as_async().read_registers(first, count))
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
        self.block_on(self.as_async().write_registers(first, values, keep))
    }

    /// As [`crate::Robot::serve_photos`]: it keeps this thread until it cannot go on. `look` runs on it, may take its time and may call
    /// this robot: stops of other threads, heartbeats and motions go on meanwhile.
    pub fn serve_photos(&self, mut look: impl FnMut(i64) -> Shot) -> PhotosEnded {
        let (ask, mut asked) = mpsc::channel::<(i64, oneshot::Sender<Shot>)>(1);
        let robot = self.as_async().clone();
        let (tell, mut ended) = oneshot::channel();
        let serving = Serving {
            errand: self.as_async().abortable_errand(async move {
                let look = |cam_id| {
                    let ask = ask.clone();
                    async move {
                        let (tell, told) = oneshot::channel();
                        // Whoever looked is gone only if this is about to end, too.
                        ask.send((cam_id, tell)).await.ok();
                        told.await.unwrap_or(Shot::NotMine)
                    }
                };
                tell.send(robot.serve(look).await).ok();
            }),
            robot: self,
        };
        loop {
            let next = async {
                tokio::select! {
                    biased;
                    Some(asked) = asked.recv() => Ok(asked),
                    // The errand does not panic; one that is no longer there was given up with the connection.
                    ended = &mut ended => Err(ended.unwrap_or(PhotosEnded::Closed)),
                }
            };
            match self.block_on(self.as_async().drive(next)) {
                // Outside, so that the connection is driven meanwhile.
                Ok((cam_id, tell)) => {
                    tell.send(look(cam_id)).ok();
                    serving.look_after();
                }
                Err(ended) => return ended,
            }
        }
    }

    /// As [`crate::Robot::follow`]: it keeps this thread until the sender is gone; another one sends.
    ///
    /// # Errors
    /// As there.
    #[expect(clippy::result_large_err, reason = "made once a motion")]
    pub fn follow(&self, targets: Targets, options: FollowOptions) -> Result<Followed, MotionError> {
        self.block_on(self.as_async().follow(targets, options))
    }
}

/// The errand that serves; it ends with this, where a `look` panics, too.
struct Serving<'r> {
    errand: AbortHandle,
    robot: &'r Robot,
}

impl Serving<'_> {
    fn look_after(&self) {
        self.robot.runner().look_after();
    }
}

impl Drop for Serving<'_> {
    fn drop(&mut self) {
        self.errand.abort();
        self.look_after();
    }
}
