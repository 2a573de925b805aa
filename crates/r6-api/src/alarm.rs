//! What an alarm means.

use r6_proto::alarm::AlarmCode;
use serde::{Deserialize, Serialize};

use crate::CommandProblem;

/// What an alarm code means.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Alarm {
    /// The code.
    pub code: u32,
    /// Its meaning, in a few words.
    pub text: String,
    /// The axis that it names, `J1` to `J8`.
    pub axis: Option<String>,
    /// What to do about it.
    pub remedy: String,
    /// Whether the code is in the table.
    pub known: bool,
    /// Whether a real controller was seen to raise it.
    pub seen_live: bool,
    /// Why the command failed for it; absent if the code is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<CommandProblem>,
}

impl Alarm {
    /// What this code means.
    #[must_use]
    pub fn of(code: AlarmCode) -> Self {
        let alarm = code.decode();
        Self {
            code: code.0,
            text: alarm.text,
            axis: alarm.axis.map(|axis| axis.to_string()),
            remedy: alarm.remedy.to_owned(),
            known: alarm.known,
            seen_live: alarm.seen_live,
            problem: None,
        }
    }
}
