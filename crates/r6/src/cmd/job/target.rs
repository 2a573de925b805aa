//! Where a job should end, and whether the arm is there.

use std::fmt;

use r6_client::Done;
use r6_proto::message::Instruction;
use r6_proto::message::instruction::{Action, Coordinates, Manner};
use r6_proto::{AxisIndex, AxisMask};

/// How far an axis may be from its target, degrees. Real arms end within 0.001 (reported, unit A).
const AXIS_TOLERANCE_DEG: f64 = 0.05;

/// How far the tool may be from its target, mm. Real arms end within 0.005 (reported, unit B).
const POSITION_TOLERANCE_MM: f64 = 0.1;

/// Where a job should end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Axes at these angles.
    Axes(Coordinates, AxisMask),
    /// The tool at this position. Orientation is not compared: one orientation has many triples of angles.
    Position(Coordinates, AxisMask),
}

impl Target {
    /// Where the last motion of these instructions ends; `None` if there is none, or the tool frame or work frame
    /// changes on the way, so that the pose that is read does not compare.
    pub fn of<'i>(instructions: impl IntoIterator<Item = &'i Instruction>) -> Option<Self> {
        let mut last = None;
        for instruction in instructions {
            last = match &instruction.action {
                Action::AxisMove(motion) => {
                    Some(Self::Axes(motion.target, moved(&motion.manner, &motion.target)))
                }
                Action::LinearMove(motion) => Self::position(&motion.manner, motion.target),
                Action::CurveMove(curve) => Self::position(&curve.manner, curve.end),
                Action::Workbench(_) | Action::Unknown(_) | Action::StopOnSignal(_) => return None,
                Action::PathSpeed(_) | Action::Wait(_) | Action::Output(_) | Action::BoardOutput(_) => last,
            };
        }
        last
    }

    fn position(manner: &Manner, end: Coordinates) -> Option<Self> {
        let other_frame = manner.tool.is_some() || manner.coord.is_some();
        (!other_frame).then(|| Self::Position(end, moved(manner, &end).and(AxisMask::POSITION)))
    }

    /// What is not where it should be, or was not read, or `None` if the arm is there. What is known to be elsewhere
    /// comes first. Only the six axes and components that [`Done`] tells are compared.
    pub fn missed(&self, done: &Done) -> Option<Missed> {
        let (wanted, mask, values, tolerance) = match self {
            Self::Axes(wanted, mask) => (wanted, mask, &done.axes, AXIS_TOLERANCE_DEG),
            Self::Position(wanted, mask) => (wanted, mask, &done.pose, POSITION_TOLERANCE_MM),
        };
        let off = |axis: &AxisIndex| {
            let wanted = wanted.at(*axis)?;
            let found = values.get(axis.index()).copied().flatten()?;
            // What is no number is not there either.
            let there = (found - wanted).abs() <= tolerance;
            (!there).then_some((*axis, wanted, found))
        };
        let unread = |axis: &AxisIndex| {
            wanted.at(*axis).is_some() && values.get(axis.index()).copied().flatten().is_none()
        };
        let (name, unit): (fn(AxisIndex) -> String, _) = match self {
            Self::Axes(..) => (|axis| axis.to_string(), "degrees"),
            Self::Position(..) => (|axis| axis.world_name().to_owned(), "mm"),
        };
        let mask = mask.and(AxisMask::SIX);
        if let Some((axis, wanted, found)) = mask.axes().find_map(|axis| off(&axis)) {
            return Some(Missed::Elsewhere { what: name(axis), wanted, found, unit });
        }
        mask.axes().find(unread).map(|axis| Missed::Unread { what: name(axis) })
    }
}

fn moved(manner: &Manner, given: &Coordinates) -> AxisMask {
    manner.mask.unwrap_or(AxisMask::ALL).and(given.given())
}

/// The first axis or component that is not seen where it should be.
#[derive(Clone, Debug, PartialEq)]
pub enum Missed {
    /// It is somewhere else.
    Elsewhere {
        /// Which one.
        what: String,
        /// Where it should be.
        wanted: f64,
        /// Where it is.
        found: f64,
        /// The unit of both.
        unit: &'static str,
    },
    /// Nobody knows where it is.
    Unread {
        /// Which one.
        what: String,
    },
}

impl fmt::Display for Missed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Elsewhere { what, wanted, found, unit } => {
                write!(f, "{what} is at {found:.3}, not at {wanted:.3} {unit}")
            }
            Self::Unread { what } => {
                write!(f, "where the arm is could not be read: there is no value of {what}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use r6_proto::message::instruction::Move;

    use super::*;

    fn done(axes: [f64; 6]) -> Done {
        let mut values = [None; 8];
        for (slot, value) in values.iter_mut().zip(axes) {
            *slot = Some(value);
        }
        Done {
            motion: None,
            proof: r6_client::EndProof::AtRest,
            axes: values,
            pose: values,
            mode: None,
            moved: true,
            took: Duration::ZERO,
        }
    }

    fn axis_move(target: &[f64], mask: AxisMask) -> Instruction {
        let manner = Manner { mask: Some(mask), ..Manner::default() };
        Instruction {
            oneshot: true,
            action: Action::AxisMove(Move { target: Coordinates::from_slice(target), manner }),
        }
    }

    #[test]
    fn only_the_axes_of_the_mask_are_compared() {
        let mask = AxisMask::from_bits(0b01);
        let target = Target::of(&[axis_move(&[10.0, 20.0], mask)]).unwrap();
        assert_eq!(target.missed(&done([10.001, 0.0, 0.0, 0.0, 0.0, 0.0])), None);
        let missed = target.missed(&done([9.0, 20.0, 0.0, 0.0, 0.0, 0.0])).unwrap();
        assert_eq!(missed.to_string(), "J1 is at 9.000, not at 10.000 degrees");
    }

    #[test]
    fn what_was_not_read_is_not_reached() {
        let target = Target::of(&[axis_move(&[10.0, 20.0, 30.0], AxisMask::from_bits(0b011))]).unwrap();
        let mut found = done([10.0, 20.0, 0.0, 0.0, 0.0, 0.0]);
        found.axes[2] = None;
        assert_eq!(target.missed(&found), None, "the mask leaves it out");
        found.axes[1] = None;
        let missed = target.missed(&found).unwrap();
        assert_eq!(missed, Missed::Unread { what: "J2".to_owned() });
        assert_eq!(missed.to_string(), "where the arm is could not be read: there is no value of J2");
        // What is known to be wrong says more.
        found.axes[0] = Some(0.0);
        assert!(matches!(target.missed(&found), Some(Missed::Elsewhere { .. })));
        found.axes[0] = Some(f64::NAN);
        assert!(matches!(target.missed(&found), Some(Missed::Elsewhere { .. })));
    }

    #[test]
    fn the_last_motion_counts_and_a_change_of_the_work_frame_ends_the_comparison() {
        let last = axis_move(&[30.0], AxisMask::SIX);
        let bench = r6_proto::message::instruction::Workbench { id: 1 };
        let bench = Instruction { oneshot: true, action: Action::Workbench(bench) };
        let found = Target::of(&[axis_move(&[10.0], AxisMask::SIX), last]).unwrap();
        assert_eq!(found.missed(&done([30.0, 0.0, 0.0, 0.0, 0.0, 0.0])), None);
        assert_eq!(Target::of(&[last, bench]), None);
        assert_eq!(Target::of(&[]), None);
    }
}
