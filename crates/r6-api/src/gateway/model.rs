//! The models of arms: lengths and limits, for pictures of an arm.

use serde::{Deserialize, Serialize};

/// The models that the gateway knows, by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Models {
    /// The models.
    pub models: Vec<ArmModel>,
}

/// One model of an arm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ArmModel {
    /// Its name.
    #[cfg_attr(feature = "openapi", schema(example = "BRTIRUS0707A"))]
    pub name: String,
    /// Its lengths.
    pub geometry: ArmGeometry,
    /// Its axes, J1 first.
    pub axes: Vec<ArmAxis>,
    /// Full speed of a linear or curve move, mm/s.
    pub max_line_speed: f64,
}

/// How the axes of an arm carry the tool. Lengths are in mm. They apply with every axis of the geometry at 0,
/// which is `sign * axis + offset`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum ArmGeometry {
    /// Six axes that turn. At 0 the upper arm stands upright and the forearm is level along +X. Positive
    /// turns: J1 about +Z; J2, J3 and J5 about +Y; J4 and J6 about +X.
    SixAxis {
        /// Floor to shoulder, upwards.
        d1: f64,
        /// J1 to shoulder, forwards.
        a1: f64,
        /// The plane of J1 to the axis of the forearm, to the left.
        b: f64,
        /// Shoulder to elbow, upwards.
        a2: f64,
        /// Elbow to forearm, upwards.
        a3: f64,
        /// Elbow to wrist centre, forwards.
        d4: f64,
        /// Wrist centre to flange, forwards.
        d6: f64,
        /// Flange to what the controller calls tool 0, along the axis of the flange.
        tool_offset: f64,
    },
    /// Two links that turn about +Z, a slide upwards, a turn about +Z. At 0 the arm is stretched along +X.
    Scara {
        /// Floor to tool 0 at J3 = 0.
        height: f64,
        /// J1 to J2.
        upper_arm: f64,
        /// J2 to J4.
        forearm: f64,
    },
    /// X, Y and Z slide; a fourth axis, if there is one, turns the tool about +Z.
    Cartesian,
}

/// One axis of a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ArmAxis {
    /// `deg` or `mm`.
    #[cfg_attr(feature = "openapi", schema(example = "deg"))]
    pub unit: String,
    /// Where moves may take it: lowest and highest position.
    pub limits: [f64; 2],
    /// 1 or -1: the direction of the axis in the geometry.
    pub sign: i8,
    /// The position of the geometry where the axis reads 0.
    pub offset: f64,
    /// Its full speed, per second.
    pub full_speed: f64,
}
