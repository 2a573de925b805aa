//! The models of arms that the gateway knows: what a picture of an arm needs.

use axum::Json;
use r6_api::gateway::{ArmAxis, ArmGeometry, ArmModel, Models};
use r6_motion::RobotModel;
use r6_motion::robot_model::{AxisModel, Geometry, ScaraGeometry, SixAxisGeometry};

use super::caller::Caller;
use super::described::OfToken;
use crate::programs::plan::unit;

/// The models of arms: lengths, axes and limits. They are in the program, so they are the same until the
/// gateway is another one.
#[utoipa::path(get, path = "/v1/models", operation_id = "models", responses(
    (status = 200, description = "All models", body = Models),
    OfToken,
))]
pub async fn list(_caller: Caller) -> Json<Models> {
    let models = RobotModel::names().filter_map(RobotModel::named).map(told).collect();
    Json(Models { models })
}

fn told(model: &RobotModel) -> ArmModel {
    ArmModel {
        name: model.name.to_string(),
        geometry: geometry(model.geometry),
        axes: model.drives().map(axis).collect(),
        max_line_speed: model.max_line_speed,
    }
}

fn geometry(of: Geometry) -> ArmGeometry {
    match of {
        Geometry::SixAxis(SixAxisGeometry { d1, a1, b, a2, a3, d4, d6, tool_offset }) => {
            ArmGeometry::SixAxis { d1, a1, b, a2, a3, d4, d6, tool_offset }
        }
        Geometry::Scara(ScaraGeometry { height, upper_arm, forearm }) => {
            ArmGeometry::Scara { height, upper_arm, forearm }
        }
        Geometry::Cartesian => ArmGeometry::Cartesian,
    }
}

fn axis(of: &AxisModel) -> ArmAxis {
    ArmAxis {
        unit: unit(of.motion).to_owned(),
        limits: [of.soft.min, of.soft.max],
        sign: of.sign,
        offset: of.offset,
        full_speed: of.max_speed,
    }
}
