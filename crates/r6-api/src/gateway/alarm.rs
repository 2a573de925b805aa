//! The alarms of robots, with who answered them.

use serde::{Deserialize, Serialize};

/// Alarms, the active ones first, then those that ended, the latest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotAlarms {
    /// The alarms.
    pub alarms: Vec<RobotAlarm>,
    /// How many more there are than `limit`.
    pub left_out: u64,
    /// Robots whose alarms are not known now, and are not here: no gateway has the robot, or its gateway does
    /// not answer. It is empty if the gateway has a store of its own.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub not_known: Vec<String>,
    /// Of which robots these are, for another gateway; for callers it is not there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robots: Option<Vec<String>>,
}

/// An alarm of a robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotAlarm {
    /// The robot.
    pub robot: String,
    /// Its number. No other alarm of this robot has it.
    #[cfg_attr(feature = "openapi", schema(example = 1_764_043_200_031_200_u64))]
    pub id: u64,
    /// The code.
    pub code: u32,
    /// Its meaning, in a few words.
    pub text: String,
    /// The axis that it names, `J1` to `J8`.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub axis: Option<String>,
    /// What to do about it.
    pub remedy: String,
    /// Whether it is there now.
    pub state: RobotAlarmState,
    /// When it was read first.
    pub since: String,
    /// Whether its begin was seen. If not, it may have been there before.
    pub begin_seen: bool,
    /// When it was seen to be gone; `null` if it was not. If the robot was not seen just before, it may have
    /// ended earlier.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub until: Option<String>,
    /// Whether its end was seen: just before `until` it was still there. If it ended and this is `false`, it
    /// may have ended at any time since the robot was seen last. `false` while it is active.
    pub end_seen: bool,
    /// Who acknowledged it; `null` if it was not acknowledged.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub acknowledged: Option<Acknowledged>,
    /// Who shelved alarms of this code at this robot, and until when; `null` if they are not shelved now.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub shelved: Option<Shelved>,
}

/// Whether an alarm is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum RobotAlarmState {
    /// The robot tells it.
    Active,
    /// The robot told it when it was seen last, and is not seen now.
    Unseen,
    /// The robot tells it no more.
    Ended,
}

/// Who acknowledged an alarm.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Acknowledged {
    /// The name of the user, or the number and the name of the token.
    pub by: String,
    /// When.
    pub at: String,
    /// What they said; `null` if nothing.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub comment: Option<String>,
}

/// Who shelved the alarms of a code.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Shelved {
    /// The name of the user, or the number and the name of the token.
    pub by: String,
    /// When.
    pub at: String,
    /// Until when.
    pub until: String,
    /// Why.
    pub reason: String,
}

/// What is said about an alarm that is acknowledged.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct AcknowledgeRequest {
    /// A comment of 1 to 200 bytes; none if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(min_length = 1, max_length = 200))]
    pub comment: Option<String>,
}

/// For how long the alarms of a code are shelved, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ShelveRequest {
    /// For how long: a second to 8 hours.
    #[cfg_attr(feature = "openapi", schema(minimum = 1000, maximum = 28_800_000))]
    pub for_ms: u64,
    /// The reason, of 1 to 200 bytes.
    #[cfg_attr(feature = "openapi", schema(min_length = 1, max_length = 200))]
    pub reason: String,
}
