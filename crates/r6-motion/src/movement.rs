//! A move from rest to rest, or two moves with a blended corner between them.
//!
//! A move is a delay, a path, and a profile that gives the position on the path at any time. Blending lets
//! the second move begin before the first has come to rest, and adds both motions of each axis. The ramp down
//! and the ramp up then make one curve: the arm does not stop, its speed does not jump, and no axis is faster
//! than either move requires.
//!
//! A movement counts its own time from 0. Stopping, resuming and a change of global speed make a new
//! movement. It takes over at an instant of the old one, on the same path, without a jump in position or
//! speed.

mod blend;
mod limits;
mod pace;
mod take_over;

use std::sync::Arc;

use super::axes::{ARM_AXES, AXES, Axes, MoveMask};
use super::error::PlanError;
use super::kinematics::{Frames, world};
use super::path::{AxisPath, CurvePath, LinearPath, Path, Turning};
use super::pose::Pose;
use super::robot_model::RobotModel;
use super::speed_profile::{Profile, Ramps, SmoothStep};
use pace::Pace;
use take_over::Tail;

pub use blend::Blend;

/// How long `actionStop` takes, seconds (reported, unit B: 0.078 s, 0.28 mm).
pub const STOP_SECONDS: f64 = 0.078;

/// How long `actionPause` takes, seconds (reported, unit B: about half a second).
pub const PAUSE_SECONDS: f64 = 0.5;

/// The longest delay, in seconds: beyond it a double no longer resolves a microsecond.
const LONGEST_DELAY: f64 = 1e9;

/// A movement this close to its end counts as ended, in seconds, because a clock of whole nanoseconds may
/// have rounded down.
const END_ROUNDING: f64 = 1e-9;

/// The speed of a move, before the global speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MoveSpeed {
    /// Percent of full speed: of the slowest axis for an axis move, of full line speed and full angular speed
    /// for a line or curve (`speed`, manual 6.1.1, tenths of a percent on the wire).
    PercentOfMax(f64),
    /// mm/s of a line or curve (action 51, reported, unit B: scaled by the global speed like any other).
    /// Turning and axis moves use the same fraction of their own full speed.
    MmPerSecond(f64),
}

/// The target of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MoveTarget {
    /// Axis move (action 4) to these positions, in degrees or mm.
    Axes(Axes),
    /// Linear move (action 10) to this pose of the tool in the work frame.
    Line(Pose),
    /// Curve move (action 17); both poses are those of the tool in the work frame.
    Curve {
        /// The pose on the way; its orientation is not used.
        middle: Pose,
        /// The pose at the end.
        end: Pose,
    },
}

/// One move as it was requested.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// The target.
    pub target: MoveTarget,
    /// Which axes or pose components change.
    pub mask: MoveMask,
    /// The speed.
    pub speed: MoveSpeed,
    /// How long to rest first, in seconds.
    pub delay: f64,
}

/// The settings of the controller when a move is planned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Global speed as a fraction, 1 for 100 %.
    pub global: f64,
    /// Ramps that were set last.
    pub ramps: Ramps,
    /// Current tool and work frame.
    pub frames: Frames,
    /// In which direction the tool turns in a line or curve.
    pub turning: Turning,
}

/// The arm at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionState {
    /// Positions of the axes, in degrees or mm.
    pub axes: Axes,
    /// Speeds of the axes, in degrees or mm per second; 0 for J7 and J8.
    pub axis_speeds: [f64; AXES],
    /// The pose of the tool in the work frame, with both frames as they were when the move was planned.
    pub pose: Pose,
    /// Whether the arm has come to rest for good: at the end of the path, or where it was halted.
    pub done: bool,
}

/// A planned move, two blended moves, or what became of them. All times are seconds from its own start.
#[derive(Clone, Debug)]
pub struct Movement {
    model: RobotModel,
    first: Stroke,
    /// A move that began before the first has ended.
    second: Option<Stroke>,
    /// The motion that this one took over from, while it comes to rest.
    tail: Option<Tail>,
    /// The time scale of both moves.
    pace: Pace,
}

/// One move, with times of its movement.
#[derive(Clone, Debug)]
struct Stroke {
    frames: Frames,
    path: Arc<Path>,
    /// Fraction of full speed before the global speed.
    told_speed: f64,
    profile: Profile,
    /// When it begins to move.
    starts: f64,
}

/// One move at one instant.
struct StrokeState {
    axes: Axes,
    speeds: [f64; ARM_AXES],
}

impl Stroke {
    fn plan(
        model: &RobotModel,
        start: &Axes,
        order: &Move,
        conditions: &Conditions,
        from: f64,
    ) -> Result<Self, PlanError> {
        let told_speed = match order.speed {
            MoveSpeed::PercentOfMax(percent) => percent / 100.0,
            MoveSpeed::MmPerSecond(speed) => speed / model.max_line_speed,
        };
        if !(0.0..=LONGEST_DELAY).contains(&order.delay) {
            return Err(PlanError::NotFinite);
        }
        fraction(told_speed, conditions.global)?;
        let path = plan_path(model, start, order, conditions)?;
        let top = top_speed(&path, told_speed, conditions.global)?;
        let profile = Profile::plan(path.length(), top, conditions.ramps).ok_or(PlanError::Speed)?;
        let starts = from + order.delay;
        Ok(Self { frames: conditions.frames, path: Arc::new(path), told_speed, profile, starts })
    }

    fn ends(&self) -> f64 {
        self.starts + self.profile.duration()
    }

    fn end(&self) -> Axes {
        self.path.at(f64::INFINITY).axes
    }

    fn at(&self, time: f64) -> StrokeState {
        let here = self.profile.at(time - self.starts);
        let there = self.path.at(here.position);
        let speed = if time >= self.starts { here.speed } else { 0.0 };
        StrokeState { axes: there.axes, speeds: there.slope.map(|slope| slope * speed) }
    }

    /// The same with another global speed from `time` on.
    fn with_global(&self, time: f64, global: f64) -> Result<Self, PlanError> {
        let top = top_speed(&self.path, self.told_speed, global)?;
        let profile = self.profile.with_top(time - self.starts, top).ok_or(PlanError::Speed)?;
        Ok(Self { profile, ..self.clone() })
    }
}

impl Movement {
    /// Plans a move from rest at `start`.
    ///
    /// The speed law (reported, unit B): speed × global speed × full speed of the slowest axis, or × full
    /// line speed. The ramps take the same time at any speed, so a short move stays below the requested
    /// speed. A line that would take an axis beyond its own full speed is slowed down as a whole.
    ///
    /// Errors: see [`PlanError`].
    pub fn plan(
        model: &RobotModel,
        start: &Axes,
        order: &Move,
        conditions: &Conditions,
    ) -> Result<Self, PlanError> {
        let first = Stroke::plan(model, start, order, conditions, 0.0)?;
        Ok(Self { model: model.to_owned(), first, second: None, tail: None, pace: Pace::EVEN })
    }

    /// The duration in seconds, delay included.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.pace.when(self.last().ends()).unwrap_or_else(|| self.pace.settles())
    }

    /// Whether the arm still rests for the move's delay, `seconds` after the start. Always false for a move
    /// without a delay.
    #[must_use]
    pub fn stands_first(&self, seconds: f64) -> bool {
        self.tail.is_none() && self.pace.time(since_start(seconds)) < self.first.starts
    }

    /// Whether it ends at the end of its path. A halted movement does so only if it reaches the end first.
    #[must_use]
    pub fn reaches_end(&self) -> bool {
        self.pace.when(self.last().ends()).is_some()
    }

    /// The arm `seconds` after the start. From [`Movement::duration`] on, or a nanosecond sooner, it rests at
    /// exactly the end. NaN counts as the start.
    #[must_use]
    pub fn state_at(&self, seconds: f64) -> MotionState {
        let done = seconds >= self.duration() - END_ROUNDING;
        let t = since_start(seconds);
        let here = match (done, self.reaches_end()) {
            (true, true) => self.at(f64::INFINITY),
            (true, false) => self.at(self.pace.time(self.pace.settles())),
            (false, _) => self.moving_at(t),
        };
        let mut axis_speeds = [0.0; AXES];
        if seconds >= 0.0 && !done {
            for (slot, speed) in axis_speeds.iter_mut().zip(here.speeds) {
                *slot = speed;
            }
        }
        let pose = world(&self.model, &here.axes, &self.last().frames);
        MotionState { axes: here.axes, axis_speeds, pose, done }
    }

    /// The accelerations of the axes `seconds` after the start, in degrees or mm per second squared; 0 for J7
    /// and J8. Computed from the speeds half a millisecond before and after.
    #[must_use]
    pub fn accelerations_at(&self, seconds: f64) -> [f64; AXES] {
        /// As short as rounding allows: speeds are exact to some 1e-13.
        const HALF_MILLISECOND: f64 = 5e-4;
        let before = self.state_at(seconds - HALF_MILLISECOND).axis_speeds;
        let mut accelerations = self.state_at(seconds + HALF_MILLISECOND).axis_speeds;
        for (slot, before) in accelerations.iter_mut().zip(before) {
            *slot = (*slot - before) / (2.0 * HALF_MILLISECOND);
        }
        accelerations
    }

    /// The arm at a time of the plan.
    fn at(&self, time: f64) -> StrokeState {
        let told = match &self.second {
            None => self.first.at(time),
            Some(second) if time >= self.first.ends() => second.at(time),
            Some(second) => sum(&self.first.at(time), &second.at(time), &self.first.end()),
        };
        match &self.tail {
            Some(tail) if time < tail.ends() => sum(&tail.at(time), &told, &tail.rest),
            Some(_) | None => told,
        }
    }

    /// The arm this many seconds after the start, while it moves: without the rounding at the end.
    fn moving_at(&self, seconds: f64) -> StrokeState {
        let rate = self.pace.rate(seconds);
        let here = self.at(self.pace.time(seconds));
        StrokeState { speeds: here.speeds.map(|speed| speed * rate), ..here }
    }

    fn last(&self) -> &Stroke {
        self.second.as_ref().unwrap_or(&self.first)
    }

    /// Comes to rest along the path within `within` seconds from `at` on; at the end of the path if that
    /// comes first.
    ///
    /// If `within` is not above zero, or not finite, the arm stops at once. Halting during the delay keeps
    /// the rest of the delay.
    #[must_use]
    pub fn halt(&self, at: f64, within: f64) -> Self {
        let at = since_start(at);
        let waits = self.waits(at);
        let takes_time = within.is_finite() && within > 0.0 && !waits;
        let step = takes_time.then(|| SmoothStep::within(within));
        Self { pace: self.pace.to(at, 0.0, step), ..self.clone() }
    }

    /// Goes to the end of the path with this global speed from `at` on. It works after a halt, at rest or
    /// still slowing down, and in mid-move.
    ///
    /// [`PlanError::Speed`] if the global speed is not above zero or not finite.
    pub fn resume(&self, at: f64, global: f64) -> Result<Self, PlanError> {
        let at = since_start(at);
        let at = if self.pace.stops() { at } else { at.min(self.duration()) };
        let mut next = self.retold(at, global)?;
        next.pace = if self.pace.stops() {
            let step = SmoothStep::within(self.last().profile.shortest_change());
            self.pace.to(at, 1.0, (!self.waits(at)).then_some(step))
        } else {
            self.pace.from(at)
        };
        Ok(next)
    }

    /// The same movement with another global speed from `at` on. A halting movement keeps halting. A corner
    /// that is being blended is finished first.
    ///
    /// [`PlanError::Speed`] if the global speed is not above zero or not finite.
    pub fn with_global(&self, at: f64, global: f64) -> Result<Self, PlanError> {
        if self.pace.stops() {
            fraction(self.first.told_speed, global)?;
            return Ok(Self { pace: self.pace.from(since_start(at)), ..self.clone() });
        }
        self.resume(at, global)
    }

    /// Whether the arm has not begun to move yet.
    fn waits(&self, at: f64) -> bool {
        self.tail.is_none() && self.pace.time(at) <= self.first.starts
    }

    /// With another global speed from `at` on, and an unchanged time scale.
    fn retold(&self, at: f64, global: f64) -> Result<Self, PlanError> {
        let time = self.pace.time(at);
        let mut next = self.clone();
        match &self.second {
            None => next.first = self.first.with_global(time, global)?,
            Some(second) => next.second = Some(second.with_global(time.max(self.first.ends()), global)?),
        }
        Ok(next)
    }

    /// The positions of the axes at the end.
    #[must_use]
    pub fn end(&self) -> Axes {
        self.last().end()
    }

    /// The path of the movement; the first of two.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.first.path
    }
}

/// The sum of two parts of a motion. The first goes to `corner`, the second begins there.
fn sum(first: &StrokeState, second: &StrokeState, corner: &Axes) -> StrokeState {
    let (mut arm, mut speeds) = ([0.0; ARM_AXES], [0.0; ARM_AXES]);
    let places = first.axes.arm().into_iter().zip(second.axes.arm()).zip(corner.arm());
    for (slot, ((first, second), corner)) in arm.iter_mut().zip(places) {
        *slot = first + (second - corner);
    }
    for (slot, (first, second)) in speeds.iter_mut().zip(first.speeds.into_iter().zip(second.speeds)) {
        *slot = first + second;
    }
    StrokeState { axes: corner.with_arm(arm), speeds }
}

/// A time from a caller, not before the start. NaN counts as the start.
fn since_start(at: f64) -> f64 {
    at.max(0.0)
}

fn plan_path(
    model: &RobotModel,
    start: &Axes,
    order: &Move,
    conditions: &Conditions,
) -> Result<Path, PlanError> {
    let Conditions { frames, turning, .. } = conditions;
    let mask = order.mask;
    Ok(match &order.target {
        MoveTarget::Axes(target) => Path::Axis(AxisPath::plan(model, start, target, mask)?),
        MoveTarget::Line(target) => {
            Path::Linear(LinearPath::plan(model, frames, start, target, mask, *turning)?)
        }
        MoveTarget::Curve { middle, end } => {
            Path::Curve(CurvePath::plan(model, frames, start, (middle, end), mask, *turning)?)
        }
    })
}

/// The requested fraction of full speed. The path's own top speed, at most 1, still bounds it.
fn fraction(told_speed: f64, global: f64) -> Result<f64, PlanError> {
    let usable = told_speed.is_finite() && told_speed > 0.0 && global.is_finite() && global > 0.0;
    if usable { Ok(told_speed * global) } else { Err(PlanError::Speed) }
}

/// The fraction of full speed on this path.
fn top_speed(path: &Path, told_speed: f64, global: f64) -> Result<f64, PlanError> {
    Ok(fraction(told_speed, global)?.min(path.top_speed()))
}

#[cfg(test)]
mod tests;
