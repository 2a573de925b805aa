//! Looking at a robot: its state at a glance, and the values that show whether it moves.

use std::time::Duration;

use r6_proto::OperationMode;
use r6_proto::address::Address;
use r6_proto::axis::AxisIndex;
use r6_proto::time::Instant;

use crate::error::{NotSent, RequestError};
use crate::evidence::restart::Restart;
use crate::evidence::{About, Observation, Sample};
use crate::link::Lane;
use crate::robot::Robot;
use crate::status::{ASKED_AXES, Status, components};

/// The addresses asked for besides the position; some firmware lacks the last two.
const ASKED: [Address; 11] = [
    Address::Version,
    Address::MachineName,
    Address::CurMode,
    Address::CurAlarm,
    Address::Origin,
    Address::IsMoving,
    Address::AxisNum,
    Address::CurCycle,
    Address::LastCycle,
    Address::RemoteCmdLen,
    Address::CurMold,
];

/// The addresses of the first six of `axis-n`, then of `world-n`.
pub(crate) fn position_addresses() -> impl Iterator<Item = Address> {
    let asked = || AxisIndex::ALL.into_iter().take(ASKED_AXES);
    asked().map(Address::Axis).chain(asked().map(Address::World))
}

/// The longest time between a look and the list that it permits, besides the time of a reply if a firmware
/// needs two queries.
const RECENT: Duration = Duration::from_secs(1);

/// How often a slow call looks. If it never takes its replies in time, it sends nothing.
pub(crate) const MOST_LOOKS: u32 = 3;

impl Robot {
    /// Reads the state of the machine, in one query if the firmware has all of it.
    ///
    /// After a reconnect this also unlocks commands.
    ///
    /// # Errors
    /// [`RequestError`] of the query.
    pub async fn status(&self) -> Result<Status, RequestError> {
        Ok(self.drive(self.status_seen()).await?.0)
    }

    /// Like [`Self::status`]; also returns the robot and connection that all of it was read from.
    pub(crate) async fn status_seen(&self) -> Result<(Status, About), RequestError> {
        let (status, about, _asked_at) = self.status_timed().await?;
        Ok((status, about))
    }

    /// Like [`Self::status_seen`]; also returns when the oldest value was asked for.
    pub(crate) async fn status_timed(&self) -> Result<(Status, About, Instant), RequestError> {
        let asked: Vec<Address> = ASKED.into_iter().chain(position_addresses()).collect();
        let (read, connection, asked_at) = self.query_on_one_connection(Lane::Ordinary, &asked).await?;
        let robot = self.hub().identity_on(connection);
        Ok((Status::of(&read), About { connection, robot }, asked_at))
    }

    /// The present connection and its robot, as far as known.
    pub(crate) fn about(&self) -> About {
        let known = self.hub().known();
        About { connection: known.connection, robot: known.present.clone() }
    }

    /// Reads the values that show motion.
    pub(crate) async fn observe(&self, lane: Lane) -> Result<Observation, RequestError> {
        let asked: Vec<Address> =
            [Address::IsMoving, Address::CurAlarm, Address::CurMode, Address::RemoteCmdLen]
                .into_iter()
                .chain(position_addresses())
                .collect();
        let (read, connection, asked_at) = self.query_on_one_connection(lane, &asked).await?;
        let values = Sample {
            moving: read.flag(Address::IsMoving),
            alarm: read.integer(Address::CurAlarm),
            mode: read.integer(Address::CurMode).map(OperationMode::of_number),
            list_length: read.integer(Address::RemoteCmdLen),
            axes: components(&read, Address::Axis),
            pose: components(&read, Address::World),
        };
        let robot = self.hub().identity_on(connection);
        Ok(Observation { robot, connection, asked_at, values })
    }

    /// Like [`Self::observe`], but recent: a call that is slow to take the reply looks again.
    pub(crate) async fn observe_lately(&self) -> Result<Observation, RequestError> {
        let mut last = self.hub().time.now();
        for _ in 0..MOST_LOOKS {
            let seen = self.observe(Lane::Ordinary).await?;
            if self.is_recent(seen.asked_at) {
                return Ok(seen);
            }
            last = seen.asked_at;
        }
        Err(self.too_slow(last))
    }

    /// Whether a look asked for at that time is recent enough to send a list. The call that looked may have
    /// been slow to take the reply.
    pub(crate) fn is_recent(&self, asked_at: Instant) -> bool {
        self.hub().time.now() - asked_at <= self.settings().reply_timeout * 2 + RECENT
    }

    /// The error of a call that is too slow for each of its looks and therefore sends nothing.
    pub(crate) fn too_slow(&self, asked_at: Instant) -> RequestError {
        NotSent::Busy { waited: self.hub().time.now() - asked_at }.into()
    }

    /// Whether the controller was restarted, when it answers over another connection than the motion was sent
    /// on. Asks it for its state.
    pub(crate) async fn restart_since(
        &self,
        sent_on: &About,
        seen: &Observation,
        idle_mode: OperationMode,
    ) -> Option<Restart> {
        let same_robot = sent_on.robot.is_some() && sent_on.robot == seen.robot;
        if !same_robot || seen.connection == sent_on.connection {
            return None;
        }
        let (status, about) = self.status_seen().await.ok()?;
        if seen.is_about(&about) { Restart::of(&status, idle_mode) } else { None }
    }
}
