//! Turns a step of the list into a move of the arm.

use r6_proto::alarm::AlarmCode;
use r6_proto::message::Action;
use r6_proto::message::instruction::{
    Coordinates, CurveMove, Manner, Move as MoveStep, PathSpeed, Workbench,
};
use r6_proto::{AXES, AxisIndex};

use super::execution::plan_failed;
use super::{MAX_FRAMES, Machine};
use crate::event::Reason;
use r6_motion::{Axes, Blend, Conditions, Move, MoveMask, MoveSpeed, MoveTarget, Pose, Turning};

/// A move, the conditions for planning it, and the blending at the corner after it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Order {
    pub step: Move,
    pub conditions: Conditions,
    pub blend: Blend,
}

/// Settings from earlier steps: the path speed (action 51) and the workbench (action 800).
#[derive(Clone, Copy, Debug)]
pub(super) struct EarlierSteps {
    pub path_speed: Option<f64>,
    pub bench: u32,
}

impl Machine {
    /// The move of a step that begins with the axes at `from`; `None` if the step is not a move.
    ///
    /// # Errors
    /// The alarm that the step raises, and why.
    pub(super) fn order(
        &self,
        action: &Action,
        from: &Axes,
        told: EarlierSteps,
    ) -> Result<Option<Order>, (AlarmCode, Reason)> {
        let (target, given, manner) = match action {
            Action::AxisMove(step) => {
                (MoveTarget::Axes(axes_target(step, from)?), step.target.given().bits(), &step.manner)
            }
            Action::LinearMove(step) => {
                (MoveTarget::Line(pose_target(&step.target)), step.target.given().bits(), &step.manner)
            }
            Action::CurveMove(CurveMove { middle, end, manner }) => {
                let target = MoveTarget::Curve { middle: pose_target(middle), end: pose_target(end) };
                (target, middle.given().and(end.given()).bits(), manner)
            }
            Action::PathSpeed(_)
            | Action::StopOnSignal(_)
            | Action::Wait(_)
            | Action::Output(_)
            | Action::BoardOutput(_)
            | Action::Workbench(_)
            | Action::Unknown(_) => return Ok(None),
        };
        let speed = speed(&target, manner, told.path_speed)?;
        let mask = MoveMask(manner.mask.map_or(given, |mask| mask.bits() & given));
        let step = Move { target, mask, speed, delay: manner.delay.unwrap_or(0.0) };
        let conditions = Conditions {
            global: self.global_speed,
            ramps: self.ramps,
            frames: self
                .frames_of(manner.tool.unwrap_or(self.frames.tool), manner.coord.unwrap_or(told.bench)),
            // Reported for moves that a PC sends. The points of a taught program are taught by hand: they
            // hold axes.
            turning: if self.is_remote() { self.profile.turning } else { Turning::Shortest },
        };
        let blend = Blend::new(manner.smooth.map_or(0, |level| level.level()));
        Ok(Some(Order { step, conditions, blend }))
    }
}

fn speed(
    target: &MoveTarget,
    manner: &Manner,
    path_speed: Option<f64>,
) -> Result<MoveSpeed, (AlarmCode, Reason)> {
    match (target, manner.speed, path_speed) {
        (_, Some(percent), _) => Ok(MoveSpeed::PercentOfMax(percent)),
        (MoveTarget::Line(_) | MoveTarget::Curve { .. }, None, Some(speed)) => {
            Ok(MoveSpeed::MmPerSecond(speed))
        }
        (MoveTarget::Axes(_), None, _) | (_, None, None) => {
            Err((AlarmCode::PATH_SPEED, "the move has no speed".into()))
        }
    }
}

/// The target of an axis move. An axis without a value stays where it is.
fn axes_target(step: &MoveStep, from: &Axes) -> Result<Axes, (AlarmCode, Reason)> {
    let mut degrees: [f64; AXES] = *from.degrees();
    for (slot, axis) in degrees.iter_mut().zip(AxisIndex::ALL) {
        *slot = step.target.at(axis).unwrap_or(*slot);
    }
    Axes::new(degrees).map_err(|error| plan_failed(error.into()))
}

fn pose_target(coordinates: &Coordinates) -> Pose {
    let mut components = [0.0; 6];
    for (slot, axis) in components.iter_mut().zip(AxisIndex::ALL) {
        *slot = coordinates.at(axis).unwrap_or(0.0);
    }
    Pose::from_components(components)
}

/// The workbench of action 800. Its number has to be below the limit of `switchCoordinate`, so that the
/// workbench in use can be saved and read again.
pub(super) fn workbench(step: Workbench) -> Result<u32, (AlarmCode, Reason)> {
    let Workbench { id } = step;
    if id < MAX_FRAMES {
        return Ok(id);
    }
    // Chosen: "user coordinate system wrong".
    Err((
        AlarmCode::FRAME,
        format!("there is no workbench {id}, there are numbers 0 to {}", MAX_FRAMES - 1).into(),
    ))
}

/// The path speed of action 51. It has to be a whole number of mm/s: a fraction raised alarm 219 on unit B.
pub(super) fn path_speed(step: &PathSpeed) -> Result<Option<f64>, (AlarmCode, Reason)> {
    match (step.in_use, step.speed) {
        (false, _) => Ok(None),
        (true, Some(speed)) if speed >= 1.0 && speed.fract() == 0.0 => Ok(Some(speed)),
        (true, Some(speed)) => Err((
            AlarmCode::PATH_SPEED,
            format!("the path speed {speed} is no whole number of mm/s from 1").into(),
        )),
        (true, None) => Err((
            AlarmCode::PATH_SPEED,
            "the path speed is missing: it is a whole number of mm/s from 1".into(),
        )),
    }
}
