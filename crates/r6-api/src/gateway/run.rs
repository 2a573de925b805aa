//! Runs of programs: what a caller asks for, and what becomes of it.

use serde::{Deserialize, Serialize};

use super::{ActedBy, LeaseKey};

/// A request to run a program. It has either `program` or `name`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct RunRequest {
    /// The text of the program: TOML or JSON with instructions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(max_length = 262_144))]
    pub program: Option<String>,
    /// The name of a program that the gateway keeps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Its version; the latest if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub version: Option<u64>,
    /// SHA-256 of the text that the caller checked, 64 hexadecimal digits in small letters. If the text to
    /// run is another one, the run is refused (`other_text`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(min_length = 64, max_length = 64))]
    pub sha256: Option<String>,
    /// The lease of the caller.
    pub lease: LeaseKey,
    /// How often the program runs, one time after the other: 1 to 1000; 1 if it is missing. All rounds
    /// together have at most 10 000 steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(minimum = 1, maximum = 1_000, example = 1))]
    pub repeat: Option<u32>,
}

/// How a run stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum RunState {
    /// It is under way.
    Running,
    /// It is proved that the arm carried the program out, and stands.
    Done,
    /// It was stopped before its end. It is proved that the arm stands, and the list is cleared.
    Stopped,
    /// Nothing was carried out: no step was sent.
    Refused,
    /// It ended before its end for another reason. It is proved that the arm stands.
    Failed,
    /// It is not known what was carried out, or not proved that the arm stands. Look at the arm.
    Unknown,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum RunEnd {
    /// The program reached its end.
    Finished,
    /// Its lease was not renewed.
    LeaseExpired,
    /// Its lease was given back.
    LeaseReleased,
    /// An admin took the lease.
    LeaseTaken,
    /// Somebody stopped or paused the robot over the gateway.
    Stop,
    /// Another robot answers.
    IdentityChanged,
    /// The robot did not answer, or the connection was lost.
    LinkLost,
    /// The robot was configured anew or removed.
    RobotChanged,
    /// The gateway ended in order.
    GatewayEnded,
    /// The gateway lost the robot: its database did not answer, or another gateway has the robot.
    OwnerChanged,
    /// The gateway was killed.
    GatewayKilled,
    /// The machine was not ready, or its state could not be read.
    NotReady,
    /// The controller refused a list.
    Refused,
    /// A list left, and no usable answer came.
    OutcomeUnknown,
    /// An alarm.
    Alarm,
    /// The mode of the controller changed: somebody stopped it at the pendant, or turned the key.
    ModeChanged,
    /// The controller was switched off and on.
    Restarted,
    /// Nothing went on for 5 s.
    Stalled,
    /// The arm stands, but not where the program ends.
    NotAtTarget,
    /// The list is gone, and nothing proves that it was carried out.
    NotProved,
    /// Another program sends lists to this robot, too.
    AnotherList,
    /// A list could not be sent.
    NotSent,
}

/// What proves the end of a run that is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum RunProof {
    /// The arm stands where the last move ends.
    Reached,
    /// The end of the last move cannot be compared, and the controller was seen to work through its list.
    Consumed,
    /// An input that the program watches ended the last move early.
    CutShort,
    /// The program has no move. The arm stands, and the list is empty.
    AtRest,
}

/// Runs of a robot, the newest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Runs {
    /// The runs.
    pub runs: Vec<Run>,
    /// Ask with this `before` to read on; `null` at the end.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub next_before: Option<u64>,
}

/// A run of a program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Run {
    /// Its number, which is not used again.
    pub run_id: u64,
    /// The robot.
    pub robot: String,
    /// How it stands.
    pub state: RunState,
    /// The name of the program; `null` if its text was sent.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub program: Option<String>,
    /// The version of the program; `null` if its text was sent.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub version: Option<u64>,
    /// SHA-256 of the text of the program.
    pub sha256: String,
    /// How often the program runs.
    pub repeat: u32,
    /// The steps of all rounds.
    pub steps: usize,
    /// How many of them the controller accepted.
    pub accepted: usize,
    /// How many of them are done, as far as is seen. They are done in order.
    pub done: usize,
    /// The number of the lease that it runs with.
    pub lease: u64,
    /// Who runs it.
    pub by: String,
    /// When it began.
    pub began_at: String,
    /// When it ended; `null` while it is under way.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub ended_at: Option<String>,
    /// Why it ended; `null` while it is under way.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub because: Option<RunEnd>,
    /// Who stopped the robot, and when, if `because` is `stop` or `lease_taken`; `null` otherwise.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub stopped_by: Option<ActedBy>,
    /// What proves the end; `null` unless it is done.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub proof: Option<RunProof>,
    /// The details, for people; empty while it is under way.
    pub detail: String,
}
