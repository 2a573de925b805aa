//! Converts axes to poses and back.

mod four_axis;
mod jacobian;
mod six_axis;

use std::fmt;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

pub(crate) use jacobian::Nearby;

use super::axes::{ARM_AXES, Axes, AxisNumber};
use super::error::{LimitSide, NotFinite, PlanError};
use super::pose::{Frame, Pose};
use super::robot_model::{AxisMotion, Geometry, RobotModel, first_outside};

/// A solution beyond a soft limit by at most this is a rounding error, and is put on the limit. Degrees.
const LIMIT_ROUNDING: f64 = 1e-9;

/// A full turn, degrees.
const TURN: f64 = 360.0;

/// The tool frame and the work frame in use.
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
    /// The arm reaches there only with an axis outside its soft limits. The axis is that of the solution
    /// nearest to the present position.
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
    pose_of(model, &tool_isometry(model, axes, tool))
}

/// The pose of the tool in the work frame, as in `world-0` … `world-5`.
#[must_use]
pub fn world(model: &RobotModel, axes: &Axes, frames: &Frames) -> Pose {
    let in_base = tool_isometry(model, axes, &frames.tool);
    pose_of(model, &frames.work.isometry().inv_mul(&in_base))
}

/// The pose for a transform of the tool, as the controller of this arm shows it.
///
/// A machine of three or four axes can only turn the tool about Z. U is that turn (manual 5.2, `Angel`: W,
/// "for a four-axis robot U"; it has no other angle). V and W read 0.
#[must_use]
pub fn pose_of(model: &RobotModel, at: &Isometry3<f64>) -> Pose {
    let full = Pose::from_isometry(at);
    match &model.geometry {
        Geometry::SixAxis(_) => full,
        Geometry::Scara(_) | Geometry::Cartesian => Pose { u: full.w, v: 0.0, w: 0.0, ..full },
    }
}

/// The transform of the tool for a pose of this arm; an error if the pose is not finite or beyond all reach.
///
/// On a machine of four axes the tool keeps the tilt of `like`, and turns about Z to the U of the pose; V and
/// W are not used. On a machine of three axes the tool keeps the orientation of `like`.
pub fn place_of(
    model: &RobotModel,
    pose: &Pose,
    like: &UnitQuaternion<f64>,
) -> Result<Isometry3<f64>, NotFinite> {
    let place = pose.to_isometry()?;
    let rotation = match &model.geometry {
        Geometry::SixAxis(_) => return Ok(place),
        Geometry::Cartesian if model.axis_count() < four_axis::TURN_AXIS => *like,
        Geometry::Scara(_) | Geometry::Cartesian => {
            let shown = pose_of(model, &Isometry3::from_parts(Translation3::identity(), *like)).u;
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), (pose.u - shown).to_radians()) * like
        }
    };
    Ok(Isometry3::from_parts(place.translation, rotation))
}

/// The axes within the soft limits that put the tool at a pose of the base frame, nearest to `near`.
///
/// Nearest means the smallest sum over all axes of the time that each needs at full speed. Whole turns count
/// as different positions, so a target of +180 with the arm at −180 does not turn the wrist round. With J5 of
/// a six-axis arm at 0 only the sum of J4 and J6 matters: the turn is shared evenly, or as the limits allow.
pub fn inverse(model: &RobotModel, pose: &Pose, tool: &Frame, near: &Axes) -> Result<Axes, InverseError> {
    let turned = fitted(model, pose, tool, near);
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

/// All axis positions within the soft limits that put the tool at a pose of the base frame, nearest to `near`
/// first. Empty if no position does.
///
/// At most one for each configuration of the arm (eight for six axes, two for a SCARA, one for a Cartesian
/// machine). Every axis is turned by whole turns to the nearest position that its limits allow.
#[must_use]
pub fn all_solutions(model: &RobotModel, pose: &Pose, tool: &Frame, near: &Axes) -> Vec<Axes> {
    let limits = model.soft_limits();
    let mut found = fitted(model, pose, tool, near);
    found.retain(|arm| first_outside(&limits, *arm).is_none());
    found.sort_by(|a, b| travel_time(model, *a, near.arm()).total_cmp(&travel_time(model, *b, near.arm())));
    found.into_iter().map(|arm| near.with_arm(arm)).collect()
}

/// All configurations of the arm for a pose of the base frame, fitted to the limits where possible. Empty if
/// the arm does not reach there, or the pose is not finite.
fn fitted(model: &RobotModel, pose: &Pose, tool: &Frame, near: &Axes) -> Vec<[f64; ARM_AXES]> {
    let Ok(tool_at) = place_of(model, pose, &tool.isometry().rotation) else { return Vec::new() };
    let found = candidates(model, &flange_of(&tool_at, tool), near);
    found.into_iter().map(|arm| fit_to_limits(model, arm, near.arm())).collect()
}

/// The transform of the tool in the base frame.
pub(super) fn tool_isometry(model: &RobotModel, axes: &Axes, tool: &Frame) -> Isometry3<f64> {
    flange(model, axes.arm()) * tool.isometry()
}

/// The axes nearest to `near` that put the tool there, without regard to the limits. This is for following a
/// path, where a whole turn or another configuration would be a jump.
pub(super) fn continued(
    model: &RobotModel,
    tool_at: &Isometry3<f64>,
    tool: &Frame,
    near: &Axes,
) -> Option<[f64; ARM_AXES]> {
    nearest(model, candidates(model, &flange_of(tool_at, tool), near).into_iter(), near.arm())
}

/// The same, computed from nearby axes where that is certain, and with how the axes follow the tool.
pub(super) fn nearby(
    model: &RobotModel,
    tool_at: &Isometry3<f64>,
    tool: &Frame,
    near: [f64; ARM_AXES],
) -> Option<Nearby> {
    match &model.geometry {
        Geometry::SixAxis(lengths) => jacobian::nearby(model, lengths, tool_at, tool, near),
        Geometry::Scara(_) | Geometry::Cartesian => None,
    }
}

/// The transform of tool 0 in the base frame.
fn flange(model: &RobotModel, arm: [f64; ARM_AXES]) -> Isometry3<f64> {
    match &model.geometry {
        Geometry::SixAxis(lengths) => six_axis::flange(&model.solver(lengths), arm),
        Geometry::Scara(lengths) => four_axis::scara_flange(model, lengths, arm),
        Geometry::Cartesian => four_axis::cartesian_flange(model, arm),
    }
}

/// The positions of the model's three masses in the base frame, mm: the middles of upper arm and forearm, and
/// tool 0. On a Cartesian machine the first moves with X, the second also with Y, the third with all.
pub(super) fn mass_points(model: &RobotModel, arm: [f64; ARM_AXES]) -> [Vector3<f64>; 3] {
    let tool = flange(model, arm).translation.vector;
    let [upper_arm, forearm] = match &model.geometry {
        Geometry::SixAxis(lengths) => six_axis::middles(model, lengths, arm),
        Geometry::Scara(lengths) => four_axis::scara_middles(model, lengths, arm),
        Geometry::Cartesian => [Vector3::new(tool.x, 0.0, 0.0), Vector3::new(tool.x, tool.y, 0.0)],
    };
    [upper_arm, forearm, tool]
}

fn flange_of(tool_at: &Isometry3<f64>, tool: &Frame) -> Isometry3<f64> {
    tool_at * tool.isometry().inverse()
}

/// All configurations of the arm with tool 0 there, each turning axis within half a turn of `near`, without
/// regard to limits. Axes that the arm lacks stay as in `near`.
fn candidates(model: &RobotModel, flange_at: &Isometry3<f64>, near: &Axes) -> Vec<[f64; ARM_AXES]> {
    match &model.geometry {
        Geometry::SixAxis(lengths) => six_axis::candidates(&model.solver(lengths), flange_at, near.arm()),
        Geometry::Scara(lengths) => four_axis::scara_candidates(model, lengths, flange_at, near.arm()),
        Geometry::Cartesian => {
            four_axis::cartesian_candidate(model, flange_at, near.arm()).into_iter().collect()
        }
    }
}

/// The same configuration with every turning axis turned by whole turns into its soft limits, as near to
/// `near` as they allow. An axis without such a turn stays outside.
fn fit_to_limits(model: &RobotModel, arm: [f64; ARM_AXES], near: [f64; ARM_AXES]) -> [f64; ARM_AXES] {
    let mut fitted = match &model.geometry {
        Geometry::SixAxis(_) => six_axis::share_straight_wrist(model, arm),
        Geometry::Scara(_) | Geometry::Cartesian => arm,
    };
    for ((slot, near), axis) in fitted.iter_mut().zip(near).zip(model.drives()) {
        let turns: &[f64] = match axis.motion {
            AxisMotion::Turns => &[-2.0, -1.0, 0.0, 1.0, 2.0],
            AxisMotion::Slides => &[0.0],
        };
        let snapped = turns.iter().map(|turns| {
            let turned = *slot + turns * TURN;
            let on_limit = turned.clamp(axis.soft.min, axis.soft.max);
            if (turned - on_limit).abs() <= LIMIT_ROUNDING { on_limit } else { turned }
        });
        let best = snapped
            .filter(|turned| axis.soft.contains(*turned))
            .min_by(|a, b| (a - near).abs().total_cmp(&(b - near).abs()));
        if let Some(best) = best {
            *slot = best;
        }
    }
    fitted
}

fn nearest(
    model: &RobotModel,
    arms: impl Iterator<Item = [f64; ARM_AXES]>,
    near: [f64; ARM_AXES],
) -> Option<[f64; ARM_AXES]> {
    arms.min_by(|a, b| travel_time(model, *a, near).total_cmp(&travel_time(model, *b, near)))
}

/// The time at full speed, in seconds, summed over the axes.
fn travel_time(model: &RobotModel, a: [f64; ARM_AXES], b: [f64; ARM_AXES]) -> f64 {
    a.into_iter().zip(b).zip(&model.axes).map(|((a, b), axis)| (a - b).abs() / axis.max_speed).sum()
}

#[cfg(test)]
pub(super) mod tests;
