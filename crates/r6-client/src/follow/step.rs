//! The next step towards a target.

use r6_proto::axis::{AXES, AxisIndex};
use r6_proto::message::Instruction;

use crate::follow::FollowOptions;
use crate::moves::Motion;
use crate::moves::step_error::StepError;
use crate::units::{AxisCoordinate, AxisPosition, Degrees, Millimetres};

/// How much a corner is rounded where steps follow each other without a stop: little, because the steps are
/// small.
const BLEND: u8 = 3;

/// One step, and the position of all axes after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step {
    pub to: AxisPosition,
    pub end: [Option<f64>; AXES],
}

/// How far each axis of the target has to move; `None` if the position of one of them is not known.
fn ways(from: &[Option<f64>; AXES], target: &AxisPosition) -> Option<Vec<(AxisIndex, AxisCoordinate, f64)>> {
    let way = |axis: AxisIndex| {
        let to = target.at(axis)?;
        let at = from.get(axis.index()).copied().flatten()?;
        Some((axis, to, to.value() - at))
    };
    target.mask().axes().map(way).collect()
}

/// How far the farthest axis has to go.
pub(super) fn farthest(from: &[Option<f64>; AXES], target: &AxisPosition) -> Option<f64> {
    let largest = |most: f64, way: f64| if most.is_nan() || most > way { most } else { way };
    Some(ways(from, target)?.iter().map(|(_, _, way)| way.abs()).fold(0.0, largest))
}

/// The next step from here towards the target; `None` if it would be too small, or the position of an axis is
/// not known.
pub(super) fn towards(
    from: &[Option<f64>; AXES],
    target: &AxisPosition,
    options: &FollowOptions,
) -> Option<Step> {
    let farthest = farthest(from, target)?;
    if !farthest.is_finite() {
        // The wire cannot carry it: encoding the step reports the error.
        return Some(Step { to: *target, end: *from });
    }
    if farthest <= 0.0 || farthest < options.smallest_step.value() {
        return None;
    }
    let share = (options.largest_step.value() / farthest).min(1.0);
    let mut step = Step { to: AxisPosition::none(), end: *from };
    for (axis, to, way) in ways(from, target)? {
        let value = if share < 1.0 { to.value() - way * (1.0 - share) } else { to.value() };
        step.to = step.to.with(
            axis,
            match to {
                AxisCoordinate::Degrees(_) => AxisCoordinate::from(Degrees(value)),
                AxisCoordinate::Millimetres(_) => AxisCoordinate::from(Millimetres(value)),
            },
        );
        if let Some(slot) = step.end.get_mut(axis.index()) {
            *slot = Some(value);
        }
    }
    Some(step)
}

/// The step as an instruction.
pub(super) fn instruction(to: AxisPosition, options: &FollowOptions) -> Result<Instruction, StepError> {
    let motion = Motion::new().axis_move(to, options.speed);
    let motion = if options.while_moving { motion.blend(BLEND) } else { motion };
    let wanted = "one step";
    let none = StepError { step: 0, field: "instructions", wanted, nearest: None };
    motion.instructions()?.first().copied().ok_or(none)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ZERO: [Option<f64>; AXES] = [Some(0.0); AXES];

    fn step(target: AxisPosition) -> Option<Step> {
        towards(&ZERO, &target, &FollowOptions::default())
    }

    #[test]
    fn a_long_way_is_gone_in_steps_all_axes_their_share() {
        let step = step(AxisPosition::degrees([40.0, -20.0])).unwrap();
        assert_eq!(step.to, AxisPosition::degrees([10.0, -5.0]));
        assert_eq!(step.end[..3], [Some(10.0), Some(-5.0), Some(0.0)]);
    }

    #[test]
    fn a_short_way_is_gone_at_once_and_a_tiny_one_not_at_all() {
        assert_eq!(step(AxisPosition::degrees([1.5])).unwrap().to, AxisPosition::degrees([1.5]));
        for target in [AxisPosition::degrees([0.9]), AxisPosition::degrees([0.0]), AxisPosition::none()] {
            assert_eq!(step(target), None);
        }
        let tiny = FollowOptions { smallest_step: Degrees(0.0), ..FollowOptions::default() };
        assert_eq!(towards(&ZERO, &AxisPosition::degrees([0.0]), &tiny), None, "there already");
    }

    #[test]
    fn what_is_no_number_is_told_and_an_axis_that_is_nowhere_makes_no_step() {
        for bad in [[f64::NAN, 0.0], [f64::NAN, 30.0], [0.0, f64::NAN], [f64::INFINITY, 0.0]] {
            let to = step(AxisPosition::degrees(bad)).unwrap().to;
            assert!(instruction(to, &FollowOptions::default()).is_err(), "{bad:?}");
        }
        let unknown = [Some(0.0), None, None, None, None, None, None, None];
        let target = AxisPosition::degrees([30.0, 1.0]);
        assert_eq!(towards(&unknown, &target, &FollowOptions::default()), None);
    }

    #[test]
    fn a_step_of_any_size_is_no_larger_than_allowed() {
        for way in [1.0, 9.99, 10.0, 10.01, 359.0, 1e9] {
            let Step { end, .. } = step(AxisPosition::degrees([way, -way])).unwrap();
            assert!(end.iter().flatten().all(|at| at.abs() <= 10.0 + 1e-6), "{way}: {end:?}");
        }
    }
}
