//! What a robot shares with the rest of its cell: registers, cameras and moving targets.

use futures_util::future::AbortHandle;
use tokio::sync::{mpsc, oneshot};

use crate::blocking::Robot;
use crate::{
    FollowOptions, Followed, Keep, MotionError, PhotosEnded, RegisterError, RegisterIndex, Shot, Targets,
};

impl Robot {
    /// The blocking form of [`crate::Robot::read_registers`].
    ///
    /// # Errors
    /// The same errors.
    pub fn read_registers(&self, first: RegisterIndex, count: usize) -> Result<Vec<i64>, RegisterError> {
        self.block_on(self.as_async().read_registers(first, count))
    }

    /// The blocking form of [`crate::Robot::write_registers`].
    ///
    /// # Errors
    /// The same errors.
    pub fn write_registers(
        &self,
        first: RegisterIndex,
        values: &[i32],
        keep: Keep,
    ) -> Result<(), RegisterError> {
        self.block_on(self.as_async().write_registers(first, values, keep))
    }

    /// The blocking form of [`crate::Robot::serve_photos`]. It blocks this thread until the service ends.
    /// `look` runs on this thread. It may take its time and may call this robot: meanwhile stops of other
    /// threads, heartbeats and motions continue.
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
                        // The receiver is gone only when this service is ending too.
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
                    // The errand does not panic. If it is gone, it was given up together with the connection.
                    ended = &mut ended => Err(ended.unwrap_or(PhotosEnded::Closed)),
                }
            };
            match self.block_on(self.as_async().drive(next)) {
                // `look` runs outside the future, so that the connection is driven meanwhile.
                Ok((cam_id, tell)) => {
                    tell.send(look(cam_id)).ok();
                    serving.look_after();
                }
                Err(ended) => return ended,
            }
        }
    }

    /// The blocking form of [`crate::Robot::follow`]. It blocks this thread until the sender is dropped;
    /// another thread sends the targets.
    ///
    /// # Errors
    /// The same errors.
    #[expect(clippy::result_large_err, reason = "made once a motion")]
    pub fn follow(&self, targets: Targets, options: FollowOptions) -> Result<Followed, MotionError> {
        self.block_on(self.as_async().follow(targets, options))
    }
}

/// The errand that serves photos. Dropping this ends it, also when `look` panics.
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
