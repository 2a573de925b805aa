//! One move from rest to rest: a delay, a path, and a profile that says when the arm is where on it.
//!
//! A movement counts its own time from 0. Stopping, going on and a change of global speed make a new movement
//! that takes over at an instant of the old one, on the same path, without a jump in position or speed.

use std::sync::Arc;

use super::axes::{AXES, Axes, MoveMask};
use super::error::PlanError;
use super::kinematics::{Frames, world};
use super::path::{AxisPath, CurvePath, LinearPath, Path};
use super::pose::Pose;
use super::profile::{PathPoint, Profile, Ramps};
use super::robot_model::RobotModel;

/// How long `actionStop` takes, seconds (reported, unit B: 0.078 s, 0.28 mm).
pub const STOP_SECONDS: f64 = 0.078;

/// How long `actionPause` takes, seconds (reported, unit B: about half a second).
pub const PAUSE_SECONDS: f64 = 0.5;

/// No delay is longer, seconds: beyond it a double no longer resolves a microsecond.
const LONGEST_DELAY: f64 = 1e9;

/// A movement this close to its end is at its end, seconds: a clock that counts nanoseconds may have rounded
/// down.
const END_ROUNDING: f64 = 1e-9;

/// How fast a move is told to be, before the global speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MoveSpeed {
    /// Percent of full speed: of the slowest axis for an axis move, of full line speed and full angular speed
    /// for a line or curve (`speed`, manual 6.1.1, tenths of a percent on the wire).
    PercentOfMax(f64),
    /// mm/s of a line or curve (action 51, reported, unit B: scaled by the global speed like any other).
    /// Turning, and axis moves, take the fraction that this is of full line speed.
    MmPerSecond(f64),
}

/// Where a move goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MoveTarget {
    /// Axis move (action 4) to these degrees.
    Axes(Axes),
    /// Linear move (action 10) to this pose of the tool in the work frame.
    Line(Pose),
    /// Curve move (action 17), both poses of the tool in the work frame.
    Curve {
        /// On the way; its orientation says nothing.
        middle: Pose,
        /// At the end.
        end: Pose,
    },
}

/// One move as it is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Where to.
    pub target: MoveTarget,
    /// Which axes or pose components change.
    pub mask: MoveMask,
    /// How fast.
    pub speed: MoveSpeed,
    /// Seconds to stand still first.
    pub delay: f64,
}

/// What the controller is set to when a move is planned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Global speed as a fraction, 1 for 100 %.
    pub global: f64,
    /// Ramps as last set.
    pub ramps: Ramps,
    /// Current tool and work frame.
    pub frames: Frames,
}

/// The arm at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionState {
    /// Where the axes are, degrees.
    pub axes: Axes,
    /// How fast they turn, degrees per second; 0 for J7 and J8.
    pub axis_speeds: [f64; AXES],
    /// Where the tool is in the work frame, both as they were when the move was planned.
    pub pose: Pose,
    /// Whether the arm has come to rest for good: at the end of the path, or where it was halted.
    pub done: bool,
}

/// A planned move, or what became of one. All times are seconds from its own start.
#[derive(Clone, Debug)]
pub struct Movement {
    model: RobotModel,
    frames: Frames,
    path: Arc<Path>,
    ramps: Ramps,
    /// Fraction of full speed before the global speed.
    told_speed: f64,
    profile: Profile,
    aim: Aim,
}

/// What the profile is for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Aim {
    /// To the end of the path, after a delay.
    Finish { delay: f64 },
    /// To rest on the way; `delay` is what was left of it.
    Halt { delay: f64 },
}

impl Movement {
    /// Plans a move from rest at `start`.
    ///
    /// The speed law (reported, unit B): speed × global speed × full speed of the slowest axis, or × full
    /// line speed. The ramps are the times to *full* speed, so the acceleration is the same whatever the
    /// speed. A line that would take an axis beyond its own full speed is slowed down as a whole.
    ///
    /// Errors: see [`PlanError`]; each has its alarm.
    pub fn plan(
        model: &RobotModel,
        start: &Axes,
        order: &Move,
        conditions: &Conditions,
    ) -> Result<Self, PlanError> {
        let told_speed = match order.speed {
            MoveSpeed::PercentOfMax(percent) => percent / 100.0,
            MoveSpeed::MmPerSecond(speed) => speed / model.max_line_speed,
        };
        if !(0.0..=LONGEST_DELAY).contains(&order.delay) {
            return Err(PlanError::NotFinite);
        }
        fraction(told_speed, conditions.global)?;
        let path = plan_path(model, start, order, &conditions.frames)?;
        let at = PathPoint { position: 0.0, speed: 0.0 };
        let profile = profile_to_end(&path, at, told_speed, conditions.global, conditions.ramps)?;
        Ok(Self {
            model: model.clone(),
            frames: conditions.frames,
            path: Arc::new(path),
            ramps: conditions.ramps,
            told_speed,
            profile,
            aim: Aim::Finish { delay: order.delay },
        })
    }

    /// How long it takes, delay included.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.delay() + self.profile.duration()
    }

    /// Whether it ends at the end of its path; a halted one does only when that came first.
    #[must_use]
    pub fn reaches_end(&self) -> bool {
        self.profile.end() >= self.path.length()
    }

    /// The arm `seconds` after the start; rest at exactly the end from [`Movement::duration`] on, or a
    /// nanosecond sooner. What is no number counts as the start.
    #[must_use]
    pub fn state_at(&self, seconds: f64) -> MotionState {
        let done = seconds >= self.duration() - END_ROUNDING;
        let here = self.profile.at(if done { f64::INFINITY } else { seconds - self.delay() });
        let speed = if seconds >= self.delay() { here.speed } else { 0.0 };
        let there = self.path.at(here.position);
        let mut axis_speeds = [0.0; AXES];
        for (slot, slope) in axis_speeds.iter_mut().zip(there.slope) {
            *slot = slope * speed;
        }
        MotionState {
            axes: there.axes,
            axis_speeds,
            pose: world(&self.model, &there.axes, &self.frames),
            done,
        }
    }

    /// From `at` on, comes to rest along the path within `within` seconds; at the end of the path if that is
    /// nearer.
    ///
    /// `within` not above zero, or not finite, stops dead. Halting during the delay keeps what is left of it.
    #[must_use]
    pub fn halt(&self, at: f64, within: f64) -> Self {
        let profile = Profile::stop_from(self.point_at(at), self.path.length(), within);
        Self { profile, aim: Aim::Halt { delay: self.delay_left(at) }, ..self.clone() }
    }

    /// From `at` on, goes to the end of the path with this global speed: after a halt, at rest or still
    /// slowing down, or in mid-move.
    ///
    /// [`PlanError::Speed`] when the global speed is not above zero or not finite.
    pub fn resume(&self, at: f64, global: f64) -> Result<Self, PlanError> {
        let profile = profile_to_end(&self.path, self.point_at(at), self.told_speed, global, self.ramps)?;
        Ok(Self { profile, aim: Aim::Finish { delay: self.delay_left(at) }, ..self.clone() })
    }

    /// From `at` on, the same with another global speed. A halting movement goes on halting as it was.
    ///
    /// [`PlanError::Speed`] when the global speed is not above zero or not finite.
    pub fn with_global(&self, at: f64, global: f64) -> Result<Self, PlanError> {
        match self.aim {
            Aim::Finish { .. } => self.resume(at, global),
            Aim::Halt { .. } => {
                fraction(self.told_speed, global)?;
                Ok(self.halt(at, self.duration() - since_start(at)))
            }
        }
    }

    /// The path it follows.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Seconds it stands still before it sets out.
    fn delay(&self) -> f64 {
        match self.aim {
            Aim::Finish { delay } => delay,
            Aim::Halt { .. } => 0.0,
        }
    }

    fn delay_left(&self, at: f64) -> f64 {
        match self.aim {
            Aim::Finish { delay } => (delay - since_start(at)).max(0.0),
            Aim::Halt { delay } => delay,
        }
    }

    fn point_at(&self, at: f64) -> PathPoint {
        let here = self.profile.at(since_start(at) - self.delay());
        PathPoint { position: here.position, speed: here.speed }
    }
}

/// A time a caller gives: never before the start; what is no number counts as the start.
fn since_start(at: f64) -> f64 {
    at.max(0.0)
}

fn plan_path(model: &RobotModel, start: &Axes, order: &Move, frames: &Frames) -> Result<Path, PlanError> {
    Ok(match &order.target {
        MoveTarget::Axes(target) => Path::Axis(AxisPath::plan(model, start, target, order.mask)?),
        MoveTarget::Line(target) => Path::Linear(LinearPath::plan(model, frames, start, target, order.mask)?),
        MoveTarget::Curve { middle, end } => {
            Path::Curve(CurvePath::plan(model, frames, start, (middle, end), order.mask)?)
        }
    })
}

/// The fraction of full speed that is asked for; the path's own top speed, 1 at most, still bounds it.
fn fraction(told_speed: f64, global: f64) -> Result<f64, PlanError> {
    let usable = told_speed.is_finite() && told_speed > 0.0 && global.is_finite() && global > 0.0;
    if usable { Ok(told_speed * global) } else { Err(PlanError::Speed) }
}

fn profile_to_end(
    path: &Path,
    from: PathPoint,
    told_speed: f64,
    global: f64,
    ramps: Ramps,
) -> Result<Profile, PlanError> {
    let top = fraction(told_speed, global)?.min(path.top_speed());
    Profile::plan(from, path.length(), top, ramps).ok_or(PlanError::Speed)
}

#[cfg(test)]
mod tests;
