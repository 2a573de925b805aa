//! Everything that the poller reads, for a program that must not miss a value.
//!
//! A subscription has the latest values. A recording has the values of each poll, in their order.

use std::time::Duration;

use r6_proto::Reading;
use r6_proto::address::Address;
use tokio::sync::mpsc;

use crate::robot::Robot;
use crate::tap::{Poll, Polled, Tap};

/// The values of each poll: [`Robot::record`]. Dropping it ends that.
#[derive(Debug)]
pub struct Recording {
    robot: Robot,
    polls: mpsc::Receiver<Poll>,
    lost: u64,
}

/// A value that a poll has read.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// The address.
    pub address: Address,
    /// The value; `None` if the controller does not have it, or sent something that cannot be read.
    pub reading: Option<Reading>,
    /// The time since it was asked for; the value is no older.
    pub age: Duration,
    /// The number of the connection over which it came: [`Robot::connection`]. Numbers only grow.
    pub connection: u64,
}

impl Robot {
    /// Records all values that subscriptions of this robot and its clones read from now on. It asks for
    /// nothing itself. `None` if the handle is closed, or if there are eight recordings already.
    #[must_use]
    pub fn record(&self) -> Option<Recording> {
        let (tap, polls) = Tap::new();
        self.hub().board.tap(tap).then(|| Recording { robot: self.clone(), polls, lost: 0 })
    }
}

impl Recording {
    /// Waits for the values of the next poll; `None` once the handle is closed. Dropping the future loses
    /// nothing.
    ///
    /// 1024 polls wait for a late reader. Then values are lost and counted: [`Self::lost`].
    pub async fn next(&mut self) -> Option<Vec<Recorded>> {
        let Poll { values, lost } = self.polls.recv().await?;
        self.lost = lost;
        let now = self.robot.now();
        let recorded = |Polled { address, reading, at, connection }| Recorded {
            address,
            reading,
            age: now.since(at),
            connection,
        };
        Some(values.into_iter().map(recorded).collect())
    }

    /// How many values were lost because the reader was late, up to the poll that [`Self::next`] gave last.
    /// If it grows with a poll, the values that were lost came just before it.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost
    }
}
