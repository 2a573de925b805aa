//! Raw ports: the robots' own protocol, for old scripts.

use serde::{Deserialize, Serialize};

use super::ActedBy;

/// The raw ports of a gateway.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RawPorts {
    /// Who closed all raw ports, and when; `null` while they are open. It holds over a restart.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub closed: Option<ActedBy>,
    /// Whether a restart of the gateway leaves them so. `false` while they are closed and the disk does not
    /// take that: it is tried again every second.
    pub kept: bool,
    /// Those of the robots that the caller may see.
    pub ports: Vec<RawPortState>,
}

/// The raw port of a robot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RawPortState {
    /// The robot.
    #[cfg_attr(feature = "openapi", schema(example = "press-4"))]
    pub robot: String,
    /// Where it listens.
    #[cfg_attr(feature = "openapi", schema(example = "192.168.1.2:9760"))]
    pub listen: String,
    /// How many clients are connected now.
    pub clients: u64,
}

/// What all raw ports shall be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct RawPortsWanted {
    /// `false` closes them: all clients are closed, none is let in, and their commands that have not left do
    /// not leave. `true` lets clients in as the rules say.
    pub open: bool,
}
