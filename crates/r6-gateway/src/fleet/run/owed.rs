//! Stops that are owed: a list that may still run at a robot out of reach is stopped as soon as the robot
//! answers again.

use std::time::Duration;

use r6_api::gateway::Deed;
use r6_client::Robot;
use tokio::time::timeout;

use super::end::Halted;
use super::{By, Station};
use crate::problem::Problem;

/// How often to look whether an owed stop can be made, if nothing wakes the task before.
const LOOK_EVERY: Duration = Duration::from_millis(500);

impl Station {
    /// Stops the list of an earlier run whenever that is owed and the robot answers. Never ends.
    pub(in crate::fleet) async fn make_owed_stops(&self, robot: &Robot) {
        let mut link = self.link.subscribe();
        loop {
            if self.seat(|seat, _| seat.can_make_owed_stop()) {
                let halted = self.stop_list(robot).await;
                if halted != Halted::OutOfReach {
                    self.seat(|seat, _| seat.owed_stop_made(halted == Halted::Stands));
                    self.forget_owed().await;
                }
            }
            // The sender lives as long as this.
            let _ = timeout(LOOK_EVERY, link.changed()).await;
        }
    }

    /// Forgets a stop that is owed, because the arm is gone.
    ///
    /// # Errors
    /// `not_ready`: nothing is owed, no stop holds, or a robot answers; `store_unavailable`: nothing changed.
    pub async fn forget_owed_stop(&self, by: &By, because: String) -> Result<(), Problem> {
        self.seat(|seat, _| seat.forget_owed_stop())?;
        // What happened before stands before it in the audit log.
        let record = self.record(by, Deed::OwedStopForgotten { because });
        if let Err(error) = self.append(record).await {
            self.seat(|seat, _| seat.owe_stop());
            return Err(error.into());
        }
        self.forget_owed().await;
        Ok(())
    }

    /// Keeps that no stop is owed any more, if that is so. A stop that holds is on the disk before. If the
    /// disk fails, the next start makes one more stop.
    pub(in crate::fleet) async fn forget_owed(&self) {
        let forgotten = async {
            self.save().await?;
            if self.seat(|seat, _| seat.owes_stop()) {
                return Ok(());
            }
            self.term.keeper.forget_owed_stop(self.robot_name().clone()).await
        };
        if let Err(error) = forgotten.await {
            tracing::error!(robot = self.name(), %error, "it was not kept that a list was stopped");
        }
    }
}
