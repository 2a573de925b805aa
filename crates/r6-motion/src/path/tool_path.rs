//! Linear and curve moves: the tool follows its track, the axes follow the tool.
//!
//! The axes are solved once, during planning, at nodes. These are close enough for a cubic through them to
//! keep the tool on its track. Later queries only look up the axes: they cannot fail, and position and speed
//! do not jump.

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

/// A path no longer than this counts as standing still, in seconds at full speed: two millionths of a
/// micrometre.
const NO_LENGTH: f64 = 1e-12;

/// A distance this short, in mm and degrees, is covered axis by axis. It remains when a client sends back a
/// pose that it read, rounded to three decimals. With a straight wrist such a rounding may point in any
/// direction, and following it would be a singularity. Even if J4 swings round meanwhile, the tool stays
/// within a hundredth of a millimetre.
const CREEP: f64 = 0.002;

/// Half a turn, degrees.
const HALF_TURN: f64 = 180.0;

/// In which direction the tool turns to its target orientation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Turning {
    /// The short way: a target of +180 with the tool at −180 turns nothing.
    #[default]
    Shortest,
    /// The way the numbers say: if the target U, V or W is more than half a turn from the present value, the
    /// tool turns the long way round (reported of a real unit: +180 from −180 was a turn of the wrist).
    AsTold,
}

/// The tool moves straight to a pose, and turns evenly the short way round (`action` 10, manual 6.1.1), or as
/// [`Turning`] says.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearPath(ToolPath);

/// The tool moves on the circle from its present position through a middle to an end (`action` 17, manual
/// 6.1.1).
#[derive(Clone, Debug, PartialEq)]
pub struct CurvePath(ToolPath);

impl LinearPath {
    /// Plans a path from the present axes to `target`, a pose of the tool in the work frame; masked-out
    /// components keep their value at the start.
    ///
    /// Errors name a problem anywhere on the way: out of reach, outside a soft limit, singular.
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
    /// Plans a path from the present axes through `middle` to `end`, poses of the tool in the work frame;
    /// masked-out components of both keep their value at the start.
    ///
    /// The tool turns evenly from the start's orientation to the end's; the middle's orientation is not used.
    /// A middle on the line between start and end makes a line. Errors as for a line, and
    /// [`PlanError::CurvePoints`] if the three points do not define a circle.
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

/// The queries that lines and curves have in common.
macro_rules! answers {
    ($path:ident) => {
        impl $path {
            /// The length in seconds at full line speed, or at full angular speed if turning takes longer.
            #[must_use]
            pub const fn length(&self) -> f64 {
                self.0.length
            }

            /// The largest fraction of full speed at which no axis exceeds its own full speed, at most 1.
            #[must_use]
            pub const fn top_speed(&self) -> f64 {
                self.0.top_speed
            }

            /// The axes at a position on the path: the start before it, exactly the end from its length on.
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
        // Converting to U, V, W and back would round.
        wanted.rotation = start.rotation;
    }
    Ok(work * wanted)
}

/// The track with the requested direction of turning.
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

/// The parts of the change of U, V and W that are more than half a turn, as a turn in the tool frame, in
/// radians; zero if no change is.
fn long_way(model: &RobotModel, start: &Pose, told: [f64; 3]) -> Vector3<f64> {
    let far = |from: f64, to: f64| if (to - from).abs() > HALF_TURN { (to - from).to_radians() } else { 0.0 };
    let [u, v, w] = told;
    let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
    if !matches!(model.geometry, Geometry::SixAxis(_)) {
        return z.into_inner() * far(start.u, u);
    }
    // R = Rz(W)·Ry(V)·Rx(U): U turns about the tool's own X. V and W turn about axes that U and V have
    // turned.
    let about_x = UnitQuaternion::from_axis_angle(&x, start.u.to_radians()).inverse();
    let about_y = UnitQuaternion::from_axis_angle(&y, start.v.to_radians()).inverse();
    x.into_inner() * far(start.u, u)
        + about_x * y.into_inner() * far(start.v, v)
        + about_x * (about_y * z.into_inner()) * far(start.w, w)
}

#[derive(Clone, Debug, PartialEq)]
struct ToolPath {
    /// J7 and J8 keep these positions.
    start: Axes,
    /// At least one node, ascending; the first at 0, the last at the length.
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
