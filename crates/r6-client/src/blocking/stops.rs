//! The stops of a connection, without `async`.

use std::sync::{Arc, Weak};

use super::{Connection, Robot};
use crate::{RequestError, StopReport};

/// The blocking form of [`crate::StopsUnderWay`]. It does not keep the connection open.
pub struct StopsUnderWay {
    stops: crate::StopsUnderWay,
    connection: Weak<Connection>,
}

impl std::fmt::Debug for StopsUnderWay {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("StopsUnderWay").field("any", &self.any()).finish_non_exhaustive()
    }
}

impl Robot {
    /// The blocking form of [`crate::Robot::stops_under_way`].
    #[must_use]
    pub fn stops_under_way(&self) -> StopsUnderWay {
        StopsUnderWay { stops: self.robot.stops_under_way(), connection: Arc::downgrade(&self.connection) }
    }
}

impl StopsUnderWay {
    /// The blocking form of [`crate::StopsUnderWay::any`].
    #[must_use]
    pub fn any(&self) -> bool {
        self.stops.any()
    }

    /// The blocking form of [`crate::StopsUnderWay::are_gone`].
    #[must_use]
    pub fn are_gone(&self) -> bool {
        self.stops.are_gone()
    }

    /// The blocking form of [`crate::StopsUnderWay::over`]. Also returns `None` if the last handle of the
    /// connection is gone: that handle has waited for its stops.
    ///
    /// # Errors
    /// The same errors.
    pub fn over(&mut self) -> Option<Result<StopReport, RequestError>> {
        let connection = self.connection.upgrade()?;
        connection.runner.block_on(self.stops.over())
    }
}
