//! Solves the axes for a track of the tool at nodes.

use super::spline::{Node, Stretch};
use super::track::Track;
use crate::axes::{ARM_AXES, Axes, AxisNumber};
use crate::error::PlanError;
use crate::kinematics::{continued, nearby, tool_isometry};
use crate::pose::Frame;
use crate::robot_model::{Limits, RobotModel, first_outside};

/// How far the tool may be from its track between two nodes, mm.
const STRAY_MM: f64 = 0.002;

/// How far it may be turned from its track between two nodes, in degrees.
const STRAY_DEGREES: f64 = 0.001;

/// Half the step for measuring slopes, in seconds at full speed: 0.02 mm or 0.002°. It is far above the
/// solver's rounding near a straight wrist, and far below the distance over which a slope changes.
const SLOPE_STEP: f64 = 1e-5;

/// The shortest distance of two nodes, in seconds at full speed: 2 µm of a line.
const SHORTEST_STEP: f64 = 1e-6;

/// The most nodes of a path. A longer one would be one long singularity; a metre of ordinary line takes a few
/// dozen.
const MOST_NODES: usize = 4096;

/// Below this fraction of full speed (20 mm/s) a path that an axis cannot follow counts as singular, not as
/// slow.
const SLOWEST: f64 = 0.01;

/// Exceeding a soft limit by this little is a rounding error, in degrees.
const LIMIT_ROUNDING: f64 = 1e-6;

/// Walks along a track and solves the axes at nodes as far apart as accuracy allows.
pub(super) struct Follower<'a> {
    model: &'a RobotModel,
    tool: &'a Frame,
    start: &'a Axes,
    track: &'a Track,
    length: f64,
    /// The soft limits, widened to the start position if the arm is outside them, so that it may come back
    /// in.
    allowed: [Limits; ARM_AXES],
}

impl<'a> Follower<'a> {
    pub(super) fn new(
        model: &'a RobotModel,
        tool: &'a Frame,
        start: &'a Axes,
        track: &'a Track,
        length: f64,
    ) -> Self {
        let mut allowed = model.soft_limits();
        for (limits, stands) in allowed.iter_mut().zip(start.arm()) {
            limits.min = limits.min.min(stands) - LIMIT_ROUNDING;
            limits.max = limits.max.max(stands) + LIMIT_ROUNDING;
        }
        Self { model, tool, start, track, length, allowed }
    }

    /// The nodes, and the largest ratio of an axis' slope to its full speed.
    pub(super) fn follow(&self) -> Result<(Vec<Node>, f64), PlanError> {
        let mut here = self.node(0.0, self.start.arm())?;
        // The start is exactly the present position of the axes.
        here.arm = self.start.arm();
        let mut nodes = vec![here];
        let mut hardest = 0.0_f64;
        let mut step = self.length / 4.0;
        while here.position < self.length {
            let rest = self.length - here.position;
            // The last two steps share the rest, so that no tiny step remains.
            let this = if step >= rest { rest } else { step.min(rest / 2.0) };
            let position = if this == rest { self.length } else { here.position + this };
            match self.stretch(&here, position) {
                Ok((next, ratio)) => {
                    hardest = hardest.max(ratio);
                    nodes.push(next);
                    here = next;
                    step = this * 1.5;
                }
                Err(error) if error.is_final(this) => return Err(error.reason),
                Err(_) => step = this / 2.0,
            }
            if nodes.len() >= MOST_NODES {
                return Err(self.singular(&here));
            }
        }
        Ok((nodes, hardest))
    }

    /// Moves every axis evenly to the end, none above its full speed: two nodes, and their distance in
    /// seconds at full speed.
    pub(super) fn creep(&self, end: [f64; ARM_AXES]) -> Result<([Node; 2], f64), PlanError> {
        if let Some((axis, side)) = first_outside(&self.allowed, end) {
            return Err(PlanError::OutsideLimits { axis, side });
        }
        let start = self.start.arm();
        let mut slope = end;
        for (slope, start) in slope.iter_mut().zip(start) {
            *slope = (*slope - start) / self.length;
        }
        let slower = self.hardest(slope).1.max(1.0);
        let slope = slope.map(|slope| slope / slower);
        let length = self.length * slower;
        let nodes = [Node { position: 0.0, arm: start, slope }, Node { position: length, arm: end, slope }];
        Ok((nodes, length))
    }

    /// The next node, and the largest ratio of slope to full speed on the way to it.
    fn stretch(&self, here: &Node, position: f64) -> Result<(Node, f64), Refusal> {
        let mut ahead = here.arm;
        for (axis, slope) in ahead.iter_mut().zip(here.slope) {
            *axis += slope * (position - here.position);
        }
        let next = self.node(position, ahead).map_err(Refusal::perhaps)?;
        let stretch = Stretch { from: here, to: &next };
        let half = (here.position + position) / 2.0;
        if !self.on_track(half, stretch.at(half).0) {
            return Err(Refusal::perhaps(self.singular(&next)));
        }
        let ranges = stretch.ranges();
        for extremes in [ranges.map(|(low, _)| low), ranges.map(|(_, high)| high)] {
            if let Some((axis, side)) = first_outside(&self.allowed, extremes) {
                return Err(Refusal::surely(PlanError::OutsideLimits { axis, side }));
            }
        }
        let (axis, ratio) = self.hardest(stretch.steepest());
        if ratio * SLOWEST > 1.0 {
            Err(Refusal::perhaps(PlanError::Singular { axis }))
        } else {
            Ok((next, ratio))
        }
    }

    /// The axes and slopes at a position on the path, continuing from nearby axes.
    fn node(&self, position: f64, near: [f64; ARM_AXES]) -> Result<Node, PlanError> {
        let part = self.part(position);
        if let Some(found) = nearby(self.model, &self.track.at(part), self.tool, near) {
            let slope = found.follow(&(self.track.velocity(part) / self.length));
            return Ok(Node { position, arm: found.arm, slope });
        }
        let arm = self.solve(position, near).ok_or(PlanError::Unreachable)?;
        // At the edge of the reach one side may not exist. Then the slope of the other side is used.
        let before = self.solve(position - SLOPE_STEP, arm).map(|arm| (arm, SLOPE_STEP));
        let after = self.solve(position + SLOPE_STEP, arm).map(|arm| (arm, SLOPE_STEP));
        let (before, back) = before.unwrap_or((arm, 0.0));
        let (after, forth) = after.unwrap_or((arm, 0.0));
        let width = back + forth;
        if width <= 0.0 {
            return Err(PlanError::Unreachable);
        }
        let mut slope = [0.0; ARM_AXES];
        for (slope, (before, after)) in slope.iter_mut().zip(before.into_iter().zip(after)) {
            *slope = (after - before) / width;
        }
        Ok(Node { position, arm, slope })
    }

    fn solve(&self, position: f64, near: [f64; ARM_AXES]) -> Option<[f64; ARM_AXES]> {
        let track = self.track.at(self.part(position));
        // Near a singularity axes may run away; such axes cannot be continued.
        let near = Axes::of_arm(near).ok()?;
        continued(self.model, &track, self.tool, &near)
    }

    /// The fraction of the path at a position, exactly 1 at the end.
    fn part(&self, position: f64) -> f64 {
        if position == self.length { 1.0 } else { position / self.length }
    }

    fn on_track(&self, position: f64, arm: [f64; ARM_AXES]) -> bool {
        let wanted = self.track.at(position / self.length);
        let is = tool_isometry(self.model, &self.start.with_arm(arm), self.tool);
        let strayed = (wanted.translation.vector - is.translation.vector).norm();
        strayed <= STRAY_MM && wanted.rotation.angle_to(&is.rotation).to_degrees() <= STRAY_DEGREES
    }

    /// The axis with the largest ratio of slope to its full speed, and that ratio.
    fn hardest(&self, slopes: [f64; ARM_AXES]) -> (AxisNumber, f64) {
        let mut hardest = (AxisNumber::ARM[0], 0.0);
        for ((axis, slope), figures) in AxisNumber::ARM.into_iter().zip(slopes).zip(&self.model.axes) {
            let ratio = slope.abs() / figures.max_speed;
            if ratio > hardest.1 {
                hardest = (axis, ratio);
            }
        }
        hardest
    }

    fn singular(&self, at: &Node) -> PlanError {
        PlanError::Singular { axis: self.hardest(at.slope).0 }
    }
}

/// Why a stretch was refused, and whether a shorter one may be possible.
struct Refusal {
    reason: PlanError,
    shorter_may_do: bool,
}

impl Refusal {
    fn perhaps(reason: PlanError) -> Self {
        Self { reason, shorter_may_do: true }
    }

    fn surely(reason: PlanError) -> Self {
        Self { reason, shorter_may_do: false }
    }

    fn is_final(&self, step: f64) -> bool {
        !self.shorter_may_do || step <= SHORTEST_STEP
    }
}
