//! Machines with an upright tool: SCARA and Cartesian.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::TURN;
use crate::axes::ARM_AXES;
use crate::robot_model::{AxisModel, AxisMotion, RobotModel, ScaraGeometry};

/// A machine with at least this many axes can turn its tool.
pub(super) const TURN_AXIS: usize = 4;

/// A flange whose tilt is at most this counts as upright, because frames and tracks are rounded. The same
/// holds for its turn on a machine that cannot turn it. Sine.
const UPRIGHT: f64 = 1e-6;

/// An elbow this straight counts as one configuration, in degrees: the two would be a millionth of a
/// millimetre apart on a metre of arm.
const ELBOW_STRAIGHT: f64 = 1e-6;

/// Exceeding the reach by this little is a rounding error; cosine of the elbow.
const REACH_ROUNDING: f64 = 1e-12;

pub(super) fn scara_flange(model: &RobotModel, g: &ScaraGeometry, arm: [f64; ARM_AXES]) -> Isometry3<f64> {
    let [j1, j2, j3, j4, _, _] = geometric(model, arm);
    let (sin1, cos1) = j1.to_radians().sin_cos();
    let (sin12, cos12) = (j1 + j2).to_radians().sin_cos();
    let x = g.upper_arm * cos1 + g.forearm * cos12;
    let y = g.upper_arm * sin1 + g.forearm * sin12;
    upright(Vector3::new(x, y, g.height + j3), j1 + j2 + j4)
}

/// The middles of upper arm and forearm in the base frame.
pub(super) fn scara_middles(
    model: &RobotModel,
    g: &ScaraGeometry,
    arm: [f64; ARM_AXES],
) -> [Vector3<f64>; 2] {
    let [j1, j2, ..] = geometric(model, arm);
    let along = |degrees: f64, length: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Vector3::new(cos, sin, 0.0) * length
    };
    let (base, upper_arm) = (Vector3::new(0.0, 0.0, g.height), along(j1, g.upper_arm));
    [base + upper_arm / 2.0, base + upper_arm + along(j1 + j2, g.forearm) / 2.0]
}

pub(super) fn cartesian_flange(model: &RobotModel, arm: [f64; ARM_AXES]) -> Isometry3<f64> {
    let [x, y, z, turn, _, _] = geometric(model, arm);
    upright(Vector3::new(x, y, z), if model.axis_count() < TURN_AXIS { 0.0 } else { turn })
}

/// The solutions with the elbow to either side; only one if the arm is stretched.
pub(super) fn scara_candidates(
    model: &RobotModel,
    g: &ScaraGeometry,
    flange_at: &Isometry3<f64>,
    near: [f64; ARM_AXES],
) -> Vec<[f64; ARM_AXES]> {
    let Some(turn) = upright_turn(flange_at) else { return Vec::new() };
    let t = &flange_at.translation;
    let (a, b) = (g.upper_arm, g.forearm);
    let cos = (t.x * t.x + t.y * t.y - a * a - b * b) / (2.0 * a * b);
    if cos.is_nan() || cos.abs() > 1.0 + REACH_ROUNDING {
        return Vec::new();
    }
    let cos = cos.clamp(-1.0, 1.0);
    let bend = (1.0 - cos * cos).sqrt().atan2(cos).to_degrees();
    let ways: &[f64] = if bend <= ELBOW_STRAIGHT { &[1.0] } else { &[1.0, -1.0] };
    ways.iter()
        .map(|way| {
            let (sin2, cos2) = (way * bend).to_radians().sin_cos();
            let j1 = (t.y.atan2(t.x) - (b * sin2).atan2(a + b * cos2)).to_degrees();
            let j2 = way * bend;
            axes(model, [j1, j2, t.z - g.height, turn - j1 - j2], near)
        })
        .collect()
}

pub(super) fn cartesian_candidate(
    model: &RobotModel,
    flange_at: &Isometry3<f64>,
    near: [f64; ARM_AXES],
) -> Option<[f64; ARM_AXES]> {
    let turn = upright_turn(flange_at)?;
    let can_turn = model.axis_count() >= TURN_AXIS;
    let t = &flange_at.translation;
    (can_turn || turn.to_radians().abs() <= UPRIGHT).then(|| axes(model, [t.x, t.y, t.z, turn], near))
}

fn upright(at: Vector3<f64>, turn: f64) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn.to_radians());
    Isometry3::from_parts(Translation3::from(at), rotation)
}

/// The turn of an upright flange about Z, in degrees within [−180, 180]; `None` if the flange is tilted.
fn upright_turn(flange_at: &Isometry3<f64>) -> Option<f64> {
    let rotation = flange_at.rotation.to_rotation_matrix();
    let r = rotation.matrix();
    let stands = r[(2, 2)] > 0.0 && r[(2, 0)].hypot(r[(2, 1)]) <= UPRIGHT;
    stands.then(|| r[(1, 0)].atan2(r[(0, 0)]).to_degrees())
}

fn geometric(model: &RobotModel, arm: [f64; ARM_AXES]) -> [f64; ARM_AXES] {
    let mut geometric = arm;
    for (slot, axis) in geometric.iter_mut().zip(&model.axes) {
        *slot = axis.geometric(*slot);
    }
    geometric
}

/// The axes for these positions of the geometry, each turning axis within half a turn of `near`.
fn axes(model: &RobotModel, geometric: [f64; 4], near: [f64; ARM_AXES]) -> [f64; ARM_AXES] {
    let mut arm = near;
    for ((slot, geometric), axis) in arm.iter_mut().zip(geometric).zip(model.drives()) {
        *slot = continued(axis, geometric, *slot);
    }
    arm
}

fn continued(axis: &AxisModel, geometric: f64, near: f64) -> f64 {
    let position = axis.position(geometric);
    match axis.motion {
        AxisMotion::Slides => position,
        AxisMotion::Turns => position - ((position - near) / TURN).round() * TURN,
    }
}
