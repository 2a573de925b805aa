//! How to communicate with a robot.

use std::time::Duration;

use r6_proto::dialect::{Addressing, DsIdForm};
use r6_proto::message::TypeKey;
use r6_proto::request::LONGEST_ADD_RCC;

use crate::conditions::Permission;

/// The longest possible `packID`, in digits; frame lengths are computed with it.
pub(crate) const LONGEST_PACK_ID: &str = "18446744073709551615";

/// How to communicate with a robot; the default suits all known firmware.
#[derive(Clone, Debug)]
pub struct RobotSettings {
    /// How long a reply may take, and also how long sending a frame may take. Default 2 s: real controllers
    /// answer within 26 ms.
    pub reply_timeout: Duration,
    /// How long a connection attempt may take, name lookup included. Default 3 s.
    pub connect_timeout: Duration,
    /// The longest frame that is sent, in bytes. Default 2 048: controllers neither answer nor execute a
    /// longer AddRCC.
    pub max_frame_bytes: usize,
    /// How to reconnect after a loss of the connection.
    pub reconnect: Reconnect,
    /// Whether the controller's watchdog is armed and fed.
    pub heartbeat: Heartbeat,
    /// After how much silence values and connection count as suspect, then as dead.
    pub liveness: Liveness,
    /// The key of a request's type: `cmdType` for the oldest firmware.
    pub type_key: TypeKey,
    /// The form of `dsID`.
    pub ds_id: DsIdForm,
    /// Whether this controller stays in mode 7 after a stop that it carried out. Default `false`: no known
    /// controller does. If `true`, a rest of 2 s with an empty list also proves the standstill after a stop
    /// ([`crate::StandProof::EmptyList`]). A taught program that waits for longer then counts as standing,
    /// and moves the arm later.
    pub stays_in_mode_7: bool,
    /// Only while this permission stands, something is written to the controller: no query, no heartbeat and
    /// no stop either. The client asks it in the call that writes, also over a second connection. The
    /// connection stays open. Default `None`: always. An example is a program that may have lost the right to
    /// use the robot while it was frozen.
    pub permission: Option<Permission>,
}

impl Default for RobotSettings {
    fn default() -> Self {
        Self {
            reply_timeout: Duration::from_secs(2),
            connect_timeout: Duration::from_secs(3),
            max_frame_bytes: LONGEST_ADD_RCC,
            reconnect: Reconnect::default(),
            heartbeat: Heartbeat::Off,
            liveness: Liveness::default(),
            type_key: TypeKey::ReqType,
            ds_id: DsIdForm::Long,
            stays_in_mode_7: false,
            permission: None,
        }
    }
}

impl RobotSettings {
    /// The fields around a request to this robot.
    pub(crate) fn addressing<'a>(&self, pack_id: &'a str) -> Addressing<'a> {
        Addressing { ds_id: self.ds_id, type_key: self.type_key, pack_id: Some(pack_id) }
    }
}

/// The waits before reconnect attempts: doubled after each failure, jittered, capped.
///
/// A wait is drawn from the upper half of its range, so that many clients behind one switch do not return at
/// the same moment. The first wait applies again after a connection on which the controller answered and that
/// lasted 5 s. A shorter connection counts as a failed attempt.
///
/// With a subscription ([`crate::Robot::subscribe`]) the client reconnects without being asked. A wait is
/// then at most three eighths of the shortest subscription period, where a period below 1 s counts as 1 s. It
/// is never less than the first wait.
#[derive(Clone, Copy, Debug)]
pub struct Reconnect {
    /// The wait before the first attempt; no subscription makes a wait shorter. Default 100 ms.
    pub first_wait: Duration,
    /// The longest wait. Default 5 s.
    pub cap: Duration,
    /// Seeds the jitter: the same seed gives the same waits. `None` takes a seed from the clock.
    pub jitter_seed: Option<u64>,
}

impl Default for Reconnect {
    fn default() -> Self {
        Self { first_wait: Duration::from_millis(100), cap: Duration::from_secs(5), jitter_seed: None }
    }
}

/// The silence after which a connection counts as suspect, then as dead. The same limits apply to values that
/// should have been read again.
///
/// These limits affect [`crate::Robot::link_quality`] and [`crate::Subscription`]; they end no connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Liveness {
    /// Suspect: shown with its age, not acted on. Default 1 s, which is 38 times the slowest reply that was
    /// measured.
    pub suspect_after: Duration,
    /// Dead: users of the value give up. Default 5 s.
    pub dead_after: Duration,
}

impl Default for Liveness {
    fn default() -> Self {
        Self { suspect_after: Duration::from_secs(1), dead_after: Duration::from_secs(5) }
    }
}

/// Whether `heartbreak` is sent (manual 7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heartbeat {
    /// Never. The first heartbeat would arm a watchdog that raises an alarm if the next one does not come
    /// within 10 s.
    Off,
    /// From the moment of connecting, on a timer of its own that no queue of requests delays.
    ///
    /// The watchdog stays armed when the handle is dropped: the controller then raises an alarm.
    Managed {
        /// The time between two heartbeats; the controller requires one every 10 s. Values below
        /// [`Self::SHORTEST`] or above [`Self::LONGEST`] count as these.
        every: Duration,
    },
}

impl Heartbeat {
    /// The shortest time between two heartbeats.
    pub const SHORTEST: Duration = Duration::from_millis(100);

    /// The longest time between two heartbeats. The watchdog raises alarm 9 after 10 s, so 5 s leaves room
    /// for one late heartbeat.
    pub const LONGEST: Duration = Duration::from_secs(5);
}
