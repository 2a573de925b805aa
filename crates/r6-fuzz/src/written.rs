//! Compares data that was written and read again with the original: every field must be equal, and numbers
//! must agree within half a step of their last written decimal.

use r6_proto::message::instruction::{Action, Coordinates, Instruction, Manner};
use r6_proto::message::{Command, Point};
use r6_proto::{AxisIndex, AxisMask};

/// The step of positions, which have at most six decimals.
const POSITION: f64 = 1e-6;

/// The step of all other numbers, which have three decimals,
const FEW: f64 = 1e-3;

/// except the global speed: tenths of a percent.
const PERCENT: f64 = 0.1;

/// The numbers that are rounded when written, each with its last decimal. Zeros take their places, so that
/// the rest can be compared for equality.
#[derive(Default)]
struct Rounded(Vec<(f64, f64)>);

impl Rounded {
    fn take(&mut self, number: &mut f64, step: f64) {
        self.0.push((std::mem::take(number), step));
    }

    fn take_all<'n>(&mut self, numbers: impl IntoIterator<Item = &'n mut f64>, step: f64) {
        numbers.into_iter().for_each(|number| self.take(number, step));
    }

    fn coordinates(&mut self, coordinates: &mut Coordinates) {
        for axis in AxisIndex::ALL {
            if let Some(mut value) = coordinates.at(axis) {
                self.take(&mut value, POSITION);
                coordinates.set(axis, value);
            }
        }
    }

    fn manner(&mut self, manner: &mut Manner, given: AxisMask) {
        // Without a mask, all axes with a coordinate move. If some coordinates are absent, the mask is
        // written.
        manner.mask.get_or_insert(given);
        self.take_all(manner.speed.iter_mut().chain(&mut manner.delay), FEW);
    }

    fn instruction(&mut self, instruction: &mut Instruction) {
        match &mut instruction.action {
            Action::AxisMove(motion) | Action::LinearMove(motion) => {
                self.coordinates(&mut motion.target);
                self.manner(&mut motion.manner, motion.target.given());
            }
            Action::CurveMove(curve) => {
                self.coordinates(&mut curve.middle);
                self.coordinates(&mut curve.end);
                self.manner(&mut curve.manner, curve.middle.given().and(curve.end.given()));
            }
            Action::PathSpeed(path) => self.take_all(&mut path.speed, FEW),
            Action::Wait(wait) => self.take(&mut wait.limit, FEW),
            Action::Output(output) => self.take(&mut output.delay, FEW),
            Action::StopOnSignal(_) | Action::BoardOutput(_) | Action::Workbench(_) | Action::Unknown(_) => {}
        }
    }

    fn point(&mut self, point: &mut Point) {
        self.take_all([&mut point.x, &mut point.y], POSITION);
        let may = [&mut point.z, &mut point.u, &mut point.v, &mut point.angle];
        self.take_all(may.into_iter().flatten(), POSITION);
        self.take_all(&mut point.similarity, FEW);
    }

    fn command(&mut self, command: &mut Command<'_>) {
        match command {
            Command::ModifyStackData { spacing, .. } => self.take_all(spacing, FEW),
            Command::ModifyGspd { percent } => self.take(percent, PERCENT),
            Command::ModifyAccDec { acceleration, deceleration } => {
                self.take_all([acceleration, deceleration], FEW);
            }
            Command::ModifyTool { offset, .. } => self.take_all(offset, FEW),
            // The other commands have no fractions.
            _ => {}
        }
    }

    fn is_near(&self, again: &Self) -> bool {
        // Scaling rounds once, and reading the digits rounds once more.
        let near = |(number, step): (f64, f64), again: f64| {
            (number - again).abs() <= step / 2.0 + number.abs() * 4.0 * f64::EPSILON
        };
        self.0.len() == again.0.len()
            && self.0.iter().zip(&again.0).all(|(one, (again, _))| near(*one, *again))
    }
}

/// Compares two lists of instructions.
pub fn same_instructions(first: &[Instruction], again: &[Instruction]) {
    same("instruction", first, again, Rounded::instruction);
}

/// Compares two lists of points.
pub fn same_points(first: &[Point], again: &[Point]) {
    same("point", first, again, Rounded::point);
}

/// Compares two commands.
pub fn same_command<'c>(first: &Command<'c>, again: &Command<'c>) {
    same("command", std::slice::from_ref(first), std::slice::from_ref(again), Rounded::command);
}

fn same<T: Clone + PartialEq + std::fmt::Debug>(
    what: &str,
    first: &[T],
    again: &[T],
    apart: impl Fn(&mut Rounded, &mut T),
) {
    assert_eq!(first.len(), again.len(), "{first:?} became {again:?}");
    let apart = |whole: &T| {
        let (mut numbers, mut rest) = (Rounded::default(), whole.clone());
        apart(&mut numbers, &mut rest);
        (numbers, rest)
    };
    for (number, (first, again)) in first.iter().zip(again).enumerate() {
        let ((numbers, rest), (numbers_again, rest_again)) = (apart(first), apart(again));
        let is_same = rest == rest_again && numbers.is_near(&numbers_again);
        assert!(is_same, "{what} {number}: {first:?} became {again:?}");
    }
}

#[cfg(test)]
mod tests {
    use r6_proto::message::instruction::{BlendLevel, Move};

    use super::*;

    fn going_to(coordinates: &[f64]) -> Instruction {
        let target = Coordinates::from_slice(coordinates);
        let manner = Manner { smooth: BlendLevel::new(3), speed: Some(50.0), ..Manner::default() };
        Instruction { oneshot: true, action: Action::AxisMove(Move { target, manner }) }
    }

    #[test]
    fn only_decimals_that_are_not_written_may_differ() {
        same_instructions(&[going_to(&[1.234_567_4, -2.0])], &[going_to(&[1.234_567, -2.0])]);
    }

    #[test]
    #[should_panic(expected = "instruction 1")]
    fn two_axes_in_each_other_s_place_are_another_instruction() {
        let first = [going_to(&[0.0, 0.0]), going_to(&[1.0, 2.0])];
        same_instructions(&first, &[going_to(&[0.0, 0.0]), going_to(&[2.0, 1.0])]);
    }

    #[test]
    #[should_panic(expected = "instruction 0")]
    fn one_without_its_blend_level_is_another_instruction() {
        let target = Coordinates::from_slice(&[1.0]);
        let manner = Manner { speed: Some(50.0), ..Manner::default() };
        let dropped = Instruction { oneshot: true, action: Action::AxisMove(Move { target, manner }) };
        same_instructions(&[going_to(&[1.0])], &[dropped]);
    }
}
