//! The panel of a virtual robot over the gateway.

use serde::{Deserialize, Serialize};

use super::LeaseKey;
use crate::panel::{Action, Snapshot};

/// An action at the panel of a virtual robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PanelRequest {
    /// What a person does at the machine.
    pub action: Action,
    /// The lease of the caller. The buttons stop and pause and the emergency stop need none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lease: Option<LeaseKey>,
    /// For a start: the arm may also run what is left in the instruction list.
    #[serde(default)]
    pub run_leftover: bool,
}

/// What was done at the panel of a virtual robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PanelDone {
    /// The number of its intent in the audit log; `null` for a stop.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub command_id: Option<u64>,
    /// What a person at the machine sees afterwards. A move has begun, not ended.
    pub panel: Snapshot,
}
