//! Stops that are under way, for a program that must not end before they have.

use std::time::Duration;

use r6_proto::message::Command;
use tokio::sync::watch;
use tokio::time::timeout;

use crate::error::{OutcomeUnknown, RequestError};
use crate::job::Work;
use crate::robot::Robot;
use crate::stop::{STOP_WITHIN, StopReport, Stopping};

/// The stops over one connection ([`Robot::stops_under_way`]). It does not keep the connection open.
#[derive(Clone, Debug)]
pub struct StopsUnderWay(watch::Receiver<Stopping>);

impl Robot {
    /// The stops over this connection, whoever asked for them: other clones, guards, motions that failed.
    #[must_use]
    pub fn stops_under_way(&self) -> StopsUnderWay {
        StopsUnderWay(self.stopping().subscribe())
    }
}

impl StopsUnderWay {
    /// How long [`Self::over`] waits: 15 s, the longest that a whole stop takes.
    pub const WITHIN: Duration = STOP_WITHIN;

    /// Whether a stop is under way now.
    #[must_use]
    pub fn any(&self) -> bool {
        self.0.borrow().under_way > 0
    }

    /// Whether the connection is gone: no stop will ever be under way over it again.
    #[must_use]
    pub fn are_gone(&self) -> bool {
        self.0.has_changed().is_err()
    }

    /// Waits until no stop is under way, for [`Self::WITHIN`] at most, and tells what became of the last one; `None` if there was
    /// none. Dropping the future stops nothing.
    ///
    /// # Errors
    /// In the report: as [`Robot::stop`], and [`Self::not_confirmed`] if one is still under way.
    pub async fn over(&mut self) -> Option<Result<StopReport, RequestError>> {
        let over = self.0.wait_for(|stopping| stopping.under_way == 0);
        match timeout(Self::WITHIN, over).await {
            Ok(Ok(stopping)) => stopping.last.clone(),
            // The last handle is gone, and with it every stop.
            Ok(Err(_gone)) => None,
            Err(_elapsed) => Some(Err(Self::not_confirmed(Self::WITHIN))),
        }
    }

    /// What to tell of a stop that was waited for so long and is still under way.
    #[must_use]
    pub fn not_confirmed(after: Duration) -> RequestError {
        let request = Work::Command(Command::ActionStop).sent();
        OutcomeUnknown::TimedOut { request, after, heard: None }.into()
    }
}
