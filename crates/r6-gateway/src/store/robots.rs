//! What tables keep of a robot beside the columns that they had from the beginning on: one text.

use r6_api::gateway::GuardWanted;
use serde::{Deserialize, Serialize};

use super::{StoreError, StoredRobot};

/// The text. What it lacks is not configured. A name that it should not have is not passed over: it could be
/// a limit of a later version.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct More {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parts: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub guard: Option<Box<GuardWanted>>,
}

impl More {
    /// The text of a robot.
    pub fn of(robot: &StoredRobot) -> Result<String, StoreError> {
        let (parts, guard) = (robot.parts.clone(), robot.guard.clone());
        serde_json::to_string(&Self { parts, guard })
            .map_err(|error| StoreError::Unreadable(error.to_string()))
    }
}
