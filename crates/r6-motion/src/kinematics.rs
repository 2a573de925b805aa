//! From axes to poses and back.

use std::fmt;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use rs_opw_kinematics::glam::{DQuat, DVec3};
use rs_opw_kinematics::kinematic_traits::{Kinematics, Pose as SolverPose};
use rs_opw_kinematics::kinematics_impl::OPWKinematics;

use super::axes::{ARM_AXES, Axes, AxisNumber};
use super::error::{LimitSide, PlanError};
use super::pose::{Frame, Pose};
use super::robot_model::{RobotModel, first_outside};

/// J5 this close to 0 turns J4 and J6 about one line, degrees: the solver's own threshold of 1e-6 rad,
/// rounded up.
const WRIST_STRAIGHT: f64 = 1e-4;

/// A solution this far beyond a soft limit is rounding, and is put on the limit, degrees.
const LIMIT_ROUNDING: f64 = 1e-9;

/// A full turn, degrees.
const TURN: f64 = 360.0;

/// The tool that moves and the workbench that poses are measured in.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frames {
    /// The tool frame, from tool 0.
    pub tool: Frame,
    /// The work frame, from the base.
    pub work: Frame,
}

/// Why no axis position was found for a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InverseError {
    /// The arm does not reach there, or the pose is not finite.
    Unreachable,
    /// It would, but only with an axis outside its soft limits. The axis is that of the solution nearest to
    /// where the arm stands.
    OutsideLimits {
        /// The first axis outside.
        axis: AxisNumber,
        /// The end of its range.
        side: LimitSide,
    },
}

impl fmt::Display for InverseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        PlanError::from(*self).fmt(f)
    }
}

impl std::error::Error for InverseError {}

impl From<InverseError> for PlanError {
    fn from(error: InverseError) -> Self {
        match error {
            InverseError::Unreachable => Self::Unreachable,
            InverseError::OutsideLimits { axis, side } => Self::OutsideLimits { axis, side },
        }
    }
}

/// The pose of the tool in the base frame.
#[must_use]
pub fn forward(model: &RobotModel, axes: &Axes, tool: &Frame) -> Pose {
    Pose::from_isometry(&tool_isometry(model, axes, tool))
}

/// The pose of the tool in the work frame: what `world-0` … `world-5` show.
#[must_use]
pub fn world(model: &RobotModel, axes: &Axes, frames: &Frames) -> Pose {
    let in_base = tool_isometry(model, axes, &frames.tool);
    Pose::from_isometry(&frames.work.isometry().inv_mul(&in_base))
}

/// The axis position within the soft limits that puts the tool at a pose of the base frame, nearest to
/// `near`.
///
/// Nearest by the sum over all axes of the time each needs at full speed. Whole turns count as different
/// positions, so a target written as +180 where the arm stands at −180 does not send the wrist round. With J5
/// at 0 only the sum of J4 and J6 matters: the turn is shared evenly, or as the limits allow.
pub fn inverse(model: &RobotModel, pose: &Pose, tool: &Frame, near: &Axes) -> Result<Axes, InverseError> {
    let tool_at = pose.to_isometry().map_err(|_| InverseError::Unreachable)?;
    let found = candidates(model, &flange_of(&tool_at, tool), near);
    let turned: Vec<_> = found.into_iter().map(|arm| fit_to_limits(model, arm, near.arm())).collect();
    let limits = model.soft_limits();
    let allowed = turned.iter().copied().filter(|arm| first_outside(&limits, *arm).is_none());
    if let Some(arm) = nearest(model, allowed, near.arm()) {
        return Ok(near.with_arm(arm));
    }
    let arm = nearest(model, turned.iter().copied(), near.arm()).ok_or(InverseError::Unreachable)?;
    match first_outside(&limits, arm) {
        Some((axis, side)) => Err(InverseError::OutsideLimits { axis, side }),
        None => Ok(near.with_arm(arm)),
    }
}

/// Every axis position within the soft limits that puts the tool at a pose of the base frame, nearest to
/// `near` first; empty when there is none.
///
/// At most one for each of the eight ways to bend shoulder, elbow and wrist, every axis turned by whole turns
/// to be as near as its limits allow.
#[must_use]
pub fn all_solutions(model: &RobotModel, pose: &Pose, tool: &Frame, near: &Axes) -> Vec<Axes> {
    let Ok(tool_at) = pose.to_isometry() else { return Vec::new() };
    let limits = model.soft_limits();
    let mut found: Vec<_> = candidates(model, &flange_of(&tool_at, tool), near)
        .into_iter()
        .map(|arm| fit_to_limits(model, arm, near.arm()))
        .filter(|arm| first_outside(&limits, *arm).is_none())
        .collect();
    found.sort_by(|a, b| travel_time(model, *a, near.arm()).total_cmp(&travel_time(model, *b, near.arm())));
    found.into_iter().map(|arm| near.with_arm(arm)).collect()
}

/// The tool in the base frame.
pub(super) fn tool_isometry(model: &RobotModel, axes: &Axes, tool: &Frame) -> Isometry3<f64> {
    flange(&model.solver(), axes.arm()) * tool.isometry()
}

/// The axes nearest to `near` that put the tool there, whatever the limits say: for following a path, where a
/// whole turn or another way to bend would be a jump.
pub(super) fn continued(
    model: &RobotModel,
    tool_at: &Isometry3<f64>,
    tool: &Frame,
    near: &Axes,
) -> Option<[f64; ARM_AXES]> {
    nearest(model, candidates(model, &flange_of(tool_at, tool), near).into_iter(), near.arm())
}

/// Tool 0 in the base frame.
fn flange(solver: &OPWKinematics, arm: [f64; ARM_AXES]) -> Isometry3<f64> {
    // `Axes` bounds every angle, so the solver's only error, an overflow, cannot happen.
    let pose = solver.try_forward(&arm.map(f64::to_radians)).unwrap_or(SolverPose::IDENTITY);
    let (t, r) = (pose.translation, pose.rotation);
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(r.w, r.x, r.y, r.z));
    Isometry3::from_parts(Translation3::new(t.x, t.y, t.z), rotation)
}

fn flange_of(tool_at: &Isometry3<f64>, tool: &Frame) -> Isometry3<f64> {
    tool_at * tool.isometry().inverse()
}

/// Every way to bend the arm so that tool 0 is there, each axis within half a turn of `near`, limits ignored.
fn candidates(model: &RobotModel, flange_at: &Isometry3<f64>, near: &Axes) -> Vec<[f64; ARM_AXES]> {
    let t = &flange_at.translation;
    let r = flange_at.rotation.quaternion();
    let wanted = SolverPose::try_from_parts(DVec3::new(t.x, t.y, t.z), DQuat::from_xyzw(r.i, r.j, r.k, r.w));
    let Ok(wanted) = wanted else { return Vec::new() };
    let found = model.solver().inverse_continuing(&wanted, &near.arm().map(f64::to_radians));
    found.into_iter().map(|arm| arm.map(f64::to_degrees)).collect()
}

/// The same bend with every axis turned by whole turns into its soft limits, as near to `near` as they allow;
/// an axis that has no such turn is left outside.
fn fit_to_limits(model: &RobotModel, arm: [f64; ARM_AXES], near: [f64; ARM_AXES]) -> [f64; ARM_AXES] {
    let [j1, j2, j3, j4, j5, j6] = share_straight_wrist(model, arm);
    let mut fitted = [j1, j2, j3, j4, j5, j6];
    for ((slot, near), axis) in fitted.iter_mut().zip(near).zip(&model.axes) {
        let snapped = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|turns| {
            let turned = *slot + turns * TURN;
            let on_limit = turned.clamp(axis.soft.min, axis.soft.max);
            if (turned - on_limit).abs() <= LIMIT_ROUNDING { on_limit } else { turned }
        });
        let best = snapped
            .into_iter()
            .filter(|turned| axis.soft.contains(*turned))
            .min_by(|a, b| (a - near).abs().total_cmp(&(b - near).abs()));
        if let Some(best) = best {
            *slot = best;
        }
    }
    fitted
}

/// With J5 at 0, hands to J6 what J4 cannot turn within its limits.
fn share_straight_wrist(model: &RobotModel, arm: [f64; ARM_AXES]) -> [f64; ARM_AXES] {
    let [j1, j2, j3, j4, j5, j6] = arm;
    let [_, _, _, axis4, _, _] = &model.axes;
    if j5.abs() > WRIST_STRAIGHT || axis4.soft.contains(j4) {
        return arm;
    }
    let allowed = j4.clamp(axis4.soft.min, axis4.soft.max);
    [j1, j2, j3, allowed, j5, j6 + (j4 - allowed)]
}

fn nearest(
    model: &RobotModel,
    arms: impl Iterator<Item = [f64; ARM_AXES]>,
    near: [f64; ARM_AXES],
) -> Option<[f64; ARM_AXES]> {
    arms.min_by(|a, b| travel_time(model, *a, near).total_cmp(&travel_time(model, *b, near)))
}

/// Seconds at full speed, summed over the axes.
fn travel_time(model: &RobotModel, a: [f64; ARM_AXES], b: [f64; ARM_AXES]) -> f64 {
    a.into_iter().zip(b).zip(&model.axes).map(|((a, b), axis)| (a - b).abs() / axis.max_speed).sum()
}

#[cfg(test)]
pub(super) mod tests;
