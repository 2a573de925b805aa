//! Six turning axes with parallel base and spherical wrist, by `rs-opw-kinematics`.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rs_opw_kinematics::glam::{DQuat, DVec3};
use rs_opw_kinematics::kinematic_traits::{Kinematics, Pose as SolverPose};
use rs_opw_kinematics::kinematics_impl::OPWKinematics;

use crate::axes::ARM_AXES;
use crate::robot_model::{RobotModel, SixAxisGeometry};

/// J5 this close to 0 turns J4 and J6 about one line, in degrees: the solver's own threshold of 1e-6 rad,
/// rounded up.
const WRIST_STRAIGHT: f64 = 1e-4;

/// The transform of tool 0 in the base frame.
pub(super) fn flange(solver: &OPWKinematics, arm: [f64; ARM_AXES]) -> Isometry3<f64> {
    // `Axes` bounds every angle, so the solver's only error, an overflow, cannot happen.
    let pose = solver.try_forward(&arm.map(f64::to_radians)).unwrap_or(SolverPose::IDENTITY);
    let (t, r) = (pose.translation, pose.rotation);
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(r.w, r.x, r.y, r.z));
    Isometry3::from_parts(Translation3::new(t.x, t.y, t.z), rotation)
}

/// The middles of upper arm and forearm in the base frame.
pub(super) fn middles(model: &RobotModel, g: &SixAxisGeometry, arm: [f64; ARM_AXES]) -> [Vector3<f64>; 2] {
    let mut geometric = arm;
    for (slot, axis) in geometric.iter_mut().zip(&model.axes) {
        *slot = axis.geometric(*slot).to_radians();
    }
    let [j1, j2, j3, ..] = geometric;
    let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
    let base = about(Vector3::z_axis(), j1);
    let shoulder = Vector3::new(g.a1, g.b, g.d1);
    let upper_arm = about(Vector3::y_axis(), j2) * Vector3::new(0.0, 0.0, g.a2);
    let forearm = about(Vector3::y_axis(), j2 + j3) * Vector3::new(g.d4, 0.0, g.a3);
    [base * (shoulder + upper_arm / 2.0), base * (shoulder + upper_arm + forearm / 2.0)]
}

/// The configurations of the arm (up to eight), each axis within half a turn of `near`.
pub(super) fn candidates(
    solver: &OPWKinematics,
    flange_at: &Isometry3<f64>,
    near: [f64; ARM_AXES],
) -> Vec<[f64; ARM_AXES]> {
    let t = &flange_at.translation;
    let r = flange_at.rotation.quaternion();
    let wanted = SolverPose::try_from_parts(DVec3::new(t.x, t.y, t.z), DQuat::from_xyzw(r.i, r.j, r.k, r.w));
    let Ok(wanted) = wanted else { return Vec::new() };
    let found = solver.inverse_continuing(&wanted, &near.map(f64::to_radians));
    found.into_iter().map(|arm| arm.map(f64::to_degrees)).collect()
}

/// With J5 at 0, moves to J6 the part of the turn that J4 cannot make within its limits.
pub(super) fn share_straight_wrist(model: &RobotModel, arm: [f64; ARM_AXES]) -> [f64; ARM_AXES] {
    let [j1, j2, j3, j4, j5, j6] = arm;
    let [_, _, _, axis4, axis5, axis6] = &model.axes;
    if axis5.geometric(j5).abs() > WRIST_STRAIGHT || axis4.soft.contains(j4) {
        return arm;
    }
    let allowed = j4.clamp(axis4.soft.min, axis4.soft.max);
    // Both turn about the same line here, but each has its own sign.
    let rest = (j4 - allowed) * f64::from(axis4.sign) * f64::from(axis6.sign);
    [j1, j2, j3, allowed, j5, j6 + rest]
}
