//! Leases, commands and stops: what a caller asks for, and the answers.

use serde::{Deserialize, Serialize};

/// A request for a lease. An empty object asks for a new lease of 10 s.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LeaseRequest {
    /// How long it lasts, 2 000 to 300 000 ms; 10 000 if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(minimum = 2_000, maximum = 300_000, example = 10_000))]
    pub duration_ms: Option<u64>,
    /// Renews the lease that the caller holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub renew: Option<LeaseKey>,
    /// Takes the lease from its holder, for this reason: the robot is stopped first. Admins only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(max_length = 200))]
    pub take_because: Option<String>,
}

/// What proves that the caller holds a lease.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LeaseKey {
    /// The number of the lease.
    pub number: u64,
    /// The secret that the gateway gave out with it.
    pub secret: String,
}

/// A lease, as its holder gets it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Lease {
    /// What to send with each command.
    pub lease: LeaseKey,
    /// How long it lasts unless it is renewed.
    pub expires_in_ms: u64,
    /// Whether the robot is stopped. Clear that before a command that can move it.
    pub stopped: bool,
}

/// A request that needs the lease and nothing else.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct WithLease {
    /// The lease of the caller.
    pub lease: LeaseKey,
}

/// A request to let a robot move again after a stop.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ClearRequest {
    /// The lease of the caller.
    pub lease: LeaseKey,
    /// `stop_number` of the robot, as the caller has seen it: if another stop was told since, that one is not
    /// cleared. Without it, whatever stop holds is cleared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop_number: Option<u64>,
}

/// A request that needs a reason and nothing else.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct WithReason {
    /// Why: 1 to 200 bytes without control characters, for the audit log.
    pub because: String,
}

/// One command for a robot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CommandRequest {
    /// The word of the command, as in `r6 command --list`.
    #[cfg_attr(feature = "openapi", schema(example = "modifyGSPD"))]
    pub command: String,
    /// Its arguments, in the units of `r6 command --list`.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(max_items = 128))]
    pub arguments: Vec<String>,
    /// The lease of the caller. Commands that stop need none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lease: Option<LeaseKey>,
    /// Send a command that starts the machine even if instructions are left in its list.
    #[serde(default)]
    pub run_leftover: bool,
}

/// The controller accepted a command. This does not mean that the arm moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CommandDone {
    /// The number of the command: of its intent in the audit log. `null` for a stop, which does not wait for
    /// the log.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub command_id: Option<u64>,
    /// The command as it was sent.
    pub sent: String,
    /// How long the controller took to answer.
    pub after_ms: f64,
}

/// The arm stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Stopped {
    /// Always `true`: a stop that is not proved is answered with the problem `not_stopped`.
    pub confirmed: bool,
    /// The time until the standstill was proved.
    pub took_ms: f64,
    /// When it was proved, on the clock of the gateway.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(example = "2026-11-27T18:06:08.120394Z"))]
    pub seen_at: String,
}
