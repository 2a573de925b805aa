//! How a robot is talked to.

use std::time::Duration;

use r6_proto::dialect::{Addressing, DsIdForm};
use r6_proto::message::TypeKey;
use r6_proto::request::LONGEST_ADD_RCC;

/// The longest `packID` that is counted on, in digits.
pub(crate) const LONGEST_PACK_ID: &str = "18446744073709551615";

/// How a robot is talked to; the default suits every firmware that is known.
#[derive(Clone, Debug)]
pub struct RobotSettings {
    /// How long a reply may take, and how long a frame may take to leave. Default 2 s: real controllers answer
    /// within 26 ms.
    pub reply_timeout: Duration,
    /// How long a connection attempt may take, name lookup included. Default 3 s.
    pub connect_timeout: Duration,
    /// The longest frame that is sent, in bytes. Default 2 048: controllers neither answer nor execute a longer AddRCC.
    pub max_frame_bytes: usize,
    /// How a lost connection is made anew.
    pub reconnect: Reconnect,
    /// Whether the controller's watchdog is armed and fed.
    pub heartbeat: Heartbeat,
    /// After how much silence values and connection count as suspect, then as dead.
    pub liveness: Liveness,
    /// The key of a request's type: `cmdType` for the oldest firmware.
    pub type_key: TypeKey,
    /// The form of `dsID`.
    pub ds_id: DsIdForm,
    /// Whether this controller stays in mode 7 after a stop that it carried out. Default `false`: none is known that does. Where
    /// it is `true`, a rest of 2 s with an empty list proves the standstill after a stop, too
    /// ([`crate::StandProof::EmptyList`]); a taught program that waits for longer is then told to stand, and moves the arm later.
    pub stays_in_mode_7: bool,
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
        }
    }
}

impl RobotSettings {
    /// What stands around a request to this robot.
    pub(crate) fn addressing<'a>(&self, pack_id: &'a str) -> Addressing<'a> {
        Addressing { ds_id: self.ds_id, type_key: self.type_key, pack_id: Some(pack_id) }
    }
}

/// The waits before attempts to connect anew: doubled after each failure, jittered, capped.
///
/// A wait is drawn from the upper half of its range, so that many clients of one switch do not return as one. The first wait comes again
/// after a connection on which the controller answered and that lasted 5 s; a shorter one counts as a failed attempt.
///
/// A robot that is watched ([`crate::Robot::subscribe`]) is connected to anew without being asked for, and waited for no longer than
/// three eighths of the shortest period of its subscriptions, of which one below 1 s counts as 1 s; but never less than the first wait.
#[derive(Clone, Copy, Debug)]
pub struct Reconnect {
    /// The wait before the first attempt; no subscription makes a wait shorter. Default 100 ms.
    pub first_wait: Duration,
    /// No wait is longer. Default 5 s.
    pub cap: Duration,
    /// Seeds the jitter: the same seed gives the same waits. `None` takes a seed from the clock.
    pub jitter_seed: Option<u64>,
}

impl Default for Reconnect {
    fn default() -> Self {
        Self { first_wait: Duration::from_millis(100), cap: Duration::from_secs(5), jitter_seed: None }
    }
}

/// After how much silence a connection, and values that should have been read again, are no longer trusted.
///
/// They are for whoever reads [`crate::Robot::link_quality`] and [`crate::Subscription`]; no connection ends by them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Liveness {
    /// Suspect: shown with its age, not acted on. Default 1 s, which is 38 times the slowest reply that was measured.
    pub suspect_after: Duration,
    /// Dead: whoever depends on it gives up. Default 5 s.
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
    /// Never: the first one arms a watchdog that raises an alarm when the next fails to come within 10 s.
    Off,
    /// From the moment of connecting, on a timer of its own that no queue of requests delays.
    ///
    /// The watchdog stays armed when the handle is dropped: the controller then raises an alarm.
    Managed {
        /// The time from one to the next; the controller wants one every 10 s. Below [`Self::SHORTEST`] or above
        /// [`Self::LONGEST`] counts as these.
        every: Duration,
    },
}

impl Heartbeat {
    /// No heartbeat is sent more often than every 100 ms.
    pub const SHORTEST: Duration = Duration::from_millis(100);

    /// The watchdog raises alarm 9 after 10 s: half of that, 5 s, leaves room for one heartbeat that is late.
    pub const LONGEST: Duration = Duration::from_secs(5);
}
