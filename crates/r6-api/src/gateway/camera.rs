//! Cameras: who may send points as which one, and the points.

use serde::{Deserialize, Serialize};

/// A part that a camera found (manual 5.2). Numbers go over the wire with at most six decimals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CameraPoint {
    /// `ModelID`: the template that recognised the part; 0 if it is missing.
    #[serde(default)]
    pub model_id: i64,
    /// `X`, mm.
    pub x: f64,
    /// `Y`, mm.
    pub y: f64,
    /// `Z`, mm. If it is missing, the tool keeps its height.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub z: Option<f64>,
    /// `U`, degrees. If it is missing, the tool keeps its U. A four-axis robot has no U.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub u: Option<f64>,
    /// `V`, degrees. If it is missing, the tool keeps its V. A four-axis robot has no V.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub v: Option<f64>,
    /// `Angel` of the wire, degrees: W, or U on a four-axis robot. If it is missing, the tool keeps its
    /// angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle: Option<f64>,
    /// `Similarity`. The manual does not give its range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub similarity: Option<f64>,
    /// `Color`. The manual does not give its range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color: Option<i64>,
    /// `Rel`: whether the coordinates are relative.
    #[serde(default)]
    pub relative: bool,
}

/// The parts of a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PointsRequest {
    /// 1 to 50. All of them have to fit into a frame of 2048 bytes: some 12 with all fields, 40 with X and Y.
    #[cfg_attr(feature = "openapi", schema(min_items = 1, max_items = 50))]
    pub points: Vec<CameraPoint>,
}

/// The controller accepted points. This does not mean that a program uses them, or that the arm moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PointsDone {
    /// The number of the intent in the audit log.
    pub command_id: u64,
    /// How many points were sent.
    pub sent: usize,
    /// How many the controller says it took; `null` if its reply has no number.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub taken: Option<u64>,
    /// How long the reply took.
    pub after_ms: f64,
}

/// The answer to a request for a photo.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PhotoRequest {
    /// Whether the picture was taken (`ret` 1 or 0). Points that follow are sent on their own.
    pub taken: bool,
}

/// A token that shall feed a camera.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CameraGrantWanted {
    /// The number of the token.
    pub token: i64,
}

/// A standing grant: this token may send points to the robot as this camera, without the lease.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CameraGrant {
    /// `camID`.
    pub camera: u16,
    /// The number of the token.
    pub token: i64,
    /// What people call the token; empty if it has no name.
    pub token_name: String,
    /// Who gave it.
    pub by: String,
    /// When.
    pub at: String,
}

/// The grants of a robot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CameraGrants {
    /// In the order of the cameras, then of the tokens.
    pub grants: Vec<CameraGrant>,
}
