//! Linear and curve moves: the tool follows its track, the axes follow the tool.
//!
//! The axes are solved once, at planning, at nodes close enough together that a cubic through them keeps the
//! tool on its track. Asking for the axes later is a look-up: it cannot fail, and position and speed have no
//! jumps.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::follower::Follower;
use super::spline::{Node, Stretch};
use super::track::Track;
use crate::axes::{ARM_AXES, Axes, MoveMask};
use crate::error::PlanError;
use crate::kinematics::{Frames, continued, place_of, pose_of, tool_isometry};
use crate::path::PathAxes;
use crate::pose::{Frame, Pose};
use crate::robot_model::{Geometry, RobotModel};

/// A path no longer than this is standing still, seconds at full speed: two millionths of a micrometre.
const NO_LENGTH: f64 = 1e-12;

/// A way this short, mm and degrees, is gone axis by axis: it is what is left when a client sends a pose back
/// as it read it, rounded to three decimals. With a straight wrist such a rounding may point anywhere, and
/// following it would be a singularity. Even if J4 swings round meanwhile, the tool stays within a hundredth
/// of a millimetre.
const CREEP: f64 = 0.002;

/// Half a turn, degrees.
const HALF_TURN: f64 = 180.0;

/// Which way round the tool turns to the orientation it is told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Turning {
    /// The short way: a target of +180 where the tool reads −180 turns nothing.
    #[default]
    Shortest,
    /// The way the numbers say: where U, V or W is told more than half a turn from what it reads, the long way
    /// round (reported of a real unit: +180 where it stood at −180 was a turn of the wrist).
    AsTold,
}

/// The tool straight from where it is to a pose, turning evenly the short way round (`action` 10, manual
/// 6.1.1), or as [`Turning`] says.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearPath(ToolPath);

/// The tool on the circle from where it is through a middle to an end (`action` 17, manual 6.1.1).
#[derive(Clone, Debug, PartialEq)]
pub struct CurvePath(ToolPath);

impl LinearPath {
    /// From where the axes stand to `target`, a pose of the tool in the work frame; masked-out components
    /// keep the value they have at the start.
    ///
    /// Errors name what is wrong anywhere on the way: out of reach, outside a soft limit, singular.
    pub fn plan(
        model: &RobotModel,
        frames: &Frames,
        start: &Axes,
        target: &Pose,
        mask: MoveMask,
        turning: Turning,
    ) -> Result<Self, PlanError> {
        let from = tool_isometry(model, start, &frames.tool);
        let to = masked(model, frames, &from, target, mask)?;
        let track = turned(Track::line(from, to), model, frames, &from, target, (mask, turning));
        ToolPath::plan(model, &frames.tool, start, track).map(Self)
    }
}

impl CurvePath {
    /// From where the axes stand through `middle` to `end`, poses of the tool in the work frame; masked-out
    /// components keep, in both, the value they have at the start.
    ///
    /// The tool turns evenly from the start's orientation to the end's; the middle's orientation says
    /// nothing. A middle on the line between start and end makes a line. Errors as for a line, and
    /// [`PlanError::CurvePoints`] when the three points give no circle.
    pub fn plan(
        model: &RobotModel,
        frames: &Frames,
        start: &Axes,
        (middle, end): (&Pose, &Pose),
        mask: MoveMask,
        turning: Turning,
    ) -> Result<Self, PlanError> {
        let from = tool_isometry(model, start, &frames.tool);
        let through = masked(model, frames, &from, middle, mask)?.translation.vector;
        let to = masked(model, frames, &from, end, mask)?;
        let track = Track::arc(from, Point3::from(through), to)?;
        let track = turned(track, model, frames, &from, end, (mask, turning));
        ToolPath::plan(model, &frames.tool, start, track).map(Self)
    }
}

/// What a line and a curve answer alike.
macro_rules! answers {
    ($path:ident) => {
        impl $path {
            /// How long it is, seconds at full line speed, or full angular speed if turning takes longer.
            #[must_use]
            pub const fn length(&self) -> f64 {
                self.0.length
            }

            /// The largest fraction of full speed at which no axis exceeds its own full speed, 1 at most.
            #[must_use]
            pub const fn top_speed(&self) -> f64 {
                self.0.top_speed
            }

            /// The axes at a place on the path: the start before it, exactly the end from its length on.
            #[must_use]
            pub fn at(&self, position: f64) -> PathAxes {
                self.0.at(position)
            }
        }
    };
}
answers!(LinearPath);
answers!(CurvePath);

/// A pose of the work frame as a transform in the base frame, with the start's values where the mask is
/// clear.
fn masked(
    model: &RobotModel,
    frames: &Frames,
    from: &Isometry3<f64>,
    target: &Pose,
    mask: MoveMask,
) -> Result<Isometry3<f64>, PlanError> {
    let work = frames.work.isometry();
    let start = work.inv_mul(from);
    let picked = mask.pick(pose_of(model, &start).components(), target.components());
    let mut wanted = place_of(model, &Pose::from_components(picked), &start.rotation)?;
    if !mask.touches(MoveMask::ORIENTATION) {
        // Not by way of U, V, W and back, which rounds.
        wanted.rotation = start.rotation;
    }
    Ok(work * wanted)
}

/// The track with the turn as it is told.
fn turned(
    track: Track,
    model: &RobotModel,
    frames: &Frames,
    from: &Isometry3<f64>,
    target: &Pose,
    (mask, turning): (MoveMask, Turning),
) -> Track {
    let start = pose_of(model, &frames.work.isometry().inv_mul(from));
    let picked = mask.pick(start.components(), target.components());
    let [_, _, _, u, v, w] = picked;
    match turning {
        Turning::Shortest => track,
        Turning::AsTold => track.turned_as_told(&long_way(model, &start, [u, v, w])),
    }
}

/// What U, V and W are told to change beyond half a turn, as a turn that the tool sees, in radians; nothing where
/// none is.
fn long_way(model: &RobotModel, start: &Pose, told: [f64; 3]) -> Vector3<f64> {
    let far = |from: f64, to: f64| if (to - from).abs() > HALF_TURN { (to - from).to_radians() } else { 0.0 };
    let [u, v, w] = told;
    let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
    if !matches!(model.geometry, Geometry::SixAxis(_)) {
        return z.into_inner() * far(start.u, u);
    }
    // R = Rz(W)·Ry(V)·Rx(U): U turns about the tool's own X, V and W about axes that U and V have turned away.
    let about_x = UnitQuaternion::from_axis_angle(&x, start.u.to_radians()).inverse();
    let about_y = UnitQuaternion::from_axis_angle(&y, start.v.to_radians()).inverse();
    x.into_inner() * far(start.u, u)
        + about_x * y.into_inner() * far(start.v, v)
        + about_x * (about_y * z.into_inner()) * far(start.w, w)
}

#[derive(Clone, Debug, PartialEq)]
struct ToolPath {
    /// Where J7 and J8 stay.
    start: Axes,
    /// At least one; the first at 0, the last at the length, ascending.
    nodes: Vec<Node>,
    length: f64,
    top_speed: f64,
}

impl ToolPath {
    fn plan(model: &RobotModel, tool: &Frame, start: &Axes, track: Track) -> Result<Self, PlanError> {
        let length = (track.distance() / model.max_line_speed).max(track.angle() / model.max_angular_speed);
        if length <= NO_LENGTH {
            let still = Node { position: 0.0, arm: start.arm(), slope: [0.0; ARM_AXES] };
            return Ok(Self { start: *start, nodes: vec![still], length: 0.0, top_speed: 1.0 });
        }
        let end = continued(model, &track.at(1.0), tool, start).ok_or(PlanError::Unreachable)?;
        let follower = Follower::new(model, tool, start, &track, length);
        if track.distance() <= CREEP && track.angle() <= CREEP {
            let (nodes, length) = follower.creep(end)?;
            return Ok(Self { start: *start, nodes: nodes.to_vec(), length, top_speed: 1.0 });
        }
        let (nodes, hardest) = follower.follow()?;
        Ok(Self { start: *start, nodes, length, top_speed: (1.0 / hardest).min(1.0) })
    }

    fn at(&self, position: f64) -> PathAxes {
        let after = self.nodes.partition_point(|node| node.position <= position);
        let before = self.nodes.get(after.saturating_sub(1));
        let (arm, slope) = match (before, self.nodes.get(after)) {
            (Some(from), Some(to)) => Stretch { from, to }.at(position),
            (Some(last), None) => (last.arm, last.slope),
            (None, _) => (self.start.arm(), [0.0; ARM_AXES]),
        };
        PathAxes { axes: self.start.with_arm(arm), slope }
    }
}

#[cfg(test)]
mod tests;
