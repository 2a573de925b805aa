//! The targets of moves of a taught program: registers, points of a camera, places in a stack.

use r6_proto::alarm::AlarmCode;
use r6_proto::message::instruction::{Coordinates, Manner, Move};
use r6_proto::message::{Action, Point};
use r6_proto::{AxisIndex, RegisterIndex};

use super::Machine;
use crate::event::Reason;
use crate::machine::Stack;
use crate::program::Step;
use r6_motion::Geometry;

/// The components of a pose on the wire.
const X: AxisIndex = AxisIndex::ALL[0];
const Y: AxisIndex = AxisIndex::ALL[1];
const Z: AxisIndex = AxisIndex::ALL[2];
const U: AxisIndex = AxisIndex::ALL[3];
const V: AxisIndex = AxisIndex::ALL[4];
const W: AxisIndex = AxisIndex::ALL[5];

impl Machine {
    /// The instruction that a step stands for now; `None` for a step without one.
    pub(super) fn instruction_of(&self, step: &Step) -> Result<Option<Action>, (AlarmCode, Reason)> {
        Ok(match step {
            Step::Instruction(action) => Some(*action),
            Step::MoveToRegisters { first, pose, manner } => {
                Some(self.move_to_registers(*first, *pose, *manner))
            }
            Step::MoveToPoint { above, manner } => Some(self.move_to_point(*above, *manner)?),
            Step::MoveToStack { stack, counter, first, above, manner } => {
                let place = self.place_in_stack(*stack, *counter)?;
                Some(line_to(shifted(first, place, *above), *manner))
            }
            _ => None,
        })
    }

    /// The move to six registers, each × 1000: axes, or a pose.
    fn move_to_registers(&self, first: RegisterIndex, pose: bool, manner: Manner) -> Action {
        let mut target = Coordinates::default();
        for (axis, number) in AxisIndex::ALL.into_iter().take(6).zip(first.number()..) {
            let value =
                RegisterIndex::new(number).and_then(|register| self.registers.values.get(&register).copied());
            // A register has 32 bits. A value beyond them is beyond every limit in any case.
            let value = i32::try_from(value.unwrap_or(0)).unwrap_or(i32::MAX);
            target.set(axis, f64::from(value) / 1000.0);
        }
        if pose { line_to(target, manner) } else { Action::AxisMove(Move { target, manner }) }
    }

    /// The move to the point that was taken.
    fn move_to_point(&self, above: f64, manner: Manner) -> Result<Action, (AlarmCode, Reason)> {
        let point = self.program.point.ok_or((AlarmCode::PROGRAM, Reason::NoPointTaken))?;
        Ok(line_to(shifted(&point, [0.0; 3], above), manner))
    }

    /// The position of a point: a place in the work frame, or an offset from the present tool position
    /// (`Rel`). The program takes a point before it moves there, so all moves to one point (above it, down to
    /// it) mean the same place. Without `Z` the height is the tool's present height. Missing angles stay
    /// missing.
    pub(super) fn place_of(&self, point: &Point) -> Coordinates {
        let mut target = self.coordinates_of(point);
        let here = self.pose_of(&self.axes).components();
        for (axis, here) in AxisIndex::ALL.into_iter().zip(here) {
            match target.at(axis) {
                Some(way) if point.relative => target.set(axis, here + way),
                None if axis == Z => target.set(axis, here),
                Some(_) | None => {}
            }
        }
        target
    }

    /// The given components of X, Y, Z and the angles; `Angel` is W, on a machine of four axes U (manual
    /// 5.2).
    fn coordinates_of(&self, point: &Point) -> Coordinates {
        let mut target = Coordinates::default();
        let turn = match self.model.geometry {
            Geometry::SixAxis(_) => [(U, point.u), (V, point.v), (W, point.angle)],
            Geometry::Scara(_) | Geometry::Cartesian => [(U, point.angle), (V, None), (W, None)],
        };
        for (axis, value) in [(X, Some(point.x)), (Y, Some(point.y)), (Z, point.z)].into_iter().chain(turn) {
            if let Some(value) = value {
                target.set(axis, value);
            }
        }
        target
    }

    /// The offset in mm of the place for a counter from the first place.
    fn place_in_stack(&self, stack: u32, counter: u32) -> Result<[f64; 3], (AlarmCode, Reason)> {
        let (at, place) = self.stack_and_place(stack, counter)?;
        let [x, y, z] = at.count.map(u64::from);
        let places = x.saturating_mul(y).saturating_mul(z);
        if place >= places {
            return Err((
                AlarmCode::PROGRAM,
                format!("place {place} lies beyond stack {stack}, which has {places}").into(),
            ));
        }
        let along = [place % x, place / x % y, place / (x * y)];
        let mut way = at.spacing;
        for (slot, along) in way.iter_mut().zip(along) {
            // Less than the number of places of a stack, which is at most some thousands per direction.
            *slot *= f64::from(u32::try_from(along).unwrap_or(u32::MAX));
        }
        Ok(way)
    }

    /// Whether a counter is beyond the last place of a stack. False if the counter or the stack does not
    /// exist.
    pub(super) fn is_full(&self, stack: u32, counter: u32) -> bool {
        self.stack_and_place(stack, counter).is_ok_and(|(stack, place)| {
            let [x, y, z] = stack.count.map(u64::from);
            place >= x.saturating_mul(y).saturating_mul(z)
        })
    }

    fn stack_and_place(&self, stack: u32, counter: u32) -> Result<(Stack, u64), (AlarmCode, Reason)> {
        let found = self.stacks.get(&stack).copied();
        let found = found.ok_or_else(|| (AlarmCode::PROGRAM, format!("there is no stack {stack}").into()))?;
        if found.count.contains(&0) {
            return Err((AlarmCode::PROGRAM, format!("stack {stack} has no places").into()));
        }
        let counter_state = self.counters.get(&counter);
        let current = counter_state.ok_or((AlarmCode::NO_COUNTER, Reason::NoCounter(counter)))?.current;
        let place = u64::try_from(current).map_err(|_| {
            (AlarmCode::PROGRAM, format!("counter {counter} is {current}, and no place of a stack").into())
        })?;
        Ok((found, place))
    }
}

/// The target with an offset, and `above` it.
fn shifted(first: &Coordinates, by: [f64; 3], above: f64) -> Coordinates {
    let [x, y, z] = by;
    let mut target = *first;
    for (axis, by) in [(X, x), (Y, y), (Z, z + above)] {
        target.set(axis, first.at(axis).unwrap_or(0.0) + by);
    }
    target
}

fn line_to(target: Coordinates, manner: Manner) -> Action {
    Action::LinearMove(Move { target, manner })
}
