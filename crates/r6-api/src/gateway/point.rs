//! Points: places of arms that the gateway keeps by name.

use serde::{Deserialize, Serialize};

/// A place of an arm. At least one of `axes` and `pose` is there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PointValue {
    /// The robot whose place it is; `null` if that is not said.
    #[cfg_attr(feature = "openapi", schema(required = true, example = "press-4"))]
    pub robot: Option<String>,
    /// Where the axes stand, J1 first: degrees, or mm of a sliding axis.
    #[cfg_attr(feature = "openapi", schema(required = true, max_items = 8))]
    pub axes: Option<Vec<f64>>,
    /// Where the tool is: X, Y, Z in mm; U, V, W in degrees.
    #[cfg_attr(feature = "openapi", schema(required = true, min_items = 6, max_items = 6))]
    pub pose: Option<Vec<f64>>,
    /// The number of the tool that `pose` is of; `null` if that is not said.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub tool: Option<u8>,
    /// The number of the work frame that `pose` is in; `null` if that is not said.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub work_frame: Option<u8>,
    /// What people have to know of it; may be empty.
    pub note: String,
}

/// A point to keep. Without `axes` and `pose` it is where the robot stands now.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PointWanted {
    /// The robot whose place it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(example = "press-4"))]
    pub robot: Option<String>,
    /// Where the axes stand, J1 first: degrees, or mm of a sliding axis; 1 to 8 numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(max_items = 8))]
    pub axes: Option<Vec<f64>>,
    /// Where the tool is: X, Y, Z in mm; U, V, W in degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(max_items = 6))]
    pub pose: Option<Vec<f64>>,
    /// The number of the tool that `pose` is of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool: Option<u8>,
    /// The number of the work frame that `pose` is in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub work_frame: Option<u8>,
    /// What people have to know of it: 200 bytes at most.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub note: String,
}

/// A version of a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct StoredPoint {
    /// The name of the point.
    #[cfg_attr(feature = "openapi", schema(example = "above-belt"))]
    pub name: String,
    /// The number of the version, from 1.
    pub version: u64,
    /// What `If-Match` takes to change the point, as long as this is its latest version.
    pub etag: String,
    /// SHA-256 of the value as it is stored, in hexadecimal digits.
    pub sha256: String,
    /// When it was stored.
    pub stored_at: String,
    /// Who stored it.
    pub stored_by: String,
    /// The place.
    pub value: PointValue,
}

/// The points that the gateway keeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct StoredPoints {
    /// Each in its latest version, by name.
    pub points: Vec<StoredPoint>,
}

/// The versions of a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PointVersions {
    /// The last 50, the latest first.
    pub versions: Vec<StoredPoint>,
}
