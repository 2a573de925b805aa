//! Where a list leads the arm, and whether the arm is there.

use std::fmt;

use r6_client::{Done, Status};
use r6_proto::message::Instruction;
use r6_proto::message::instruction::{Action, Coordinates, Manner};
use r6_proto::{AXES, AxisIndex, AxisMask};

/// How far an axis may be from its target, degrees. Real arms end within 0.001 (reported, unit A).
const AXIS_TOLERANCE_DEG: f64 = 0.05;

/// How far the tool may be from its target, mm. Real arms end within 0.005 (reported, unit B).
const POSITION_TOLERANCE_MM: f64 = 0.1;

/// Where a move ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Axes at these angles.
    Axes(Coordinates, AxisMask),
    /// The tool at this position. Orientation is not compared: one orientation has many triples of angles.
    Position(Coordinates, AxisMask),
}

/// How one step of a list ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// It moves the arm, and this is where.
    At(Target),
    /// It moves the arm, and where to cannot be compared with what is read: the position is told in another tool or work frame, or
    /// the step turns the tool only, or moves only axes that are not read.
    Unknown,
}

/// Where a list leads the arm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course {
    /// The end of each step that moves the arm.
    ends: Vec<End>,
    /// Whether an input may cut the last move short.
    watched: bool,
}

impl Course {
    /// Where these instructions lead.
    pub fn of<'i>(instructions: impl IntoIterator<Item = &'i Instruction>) -> Self {
        let (mut course, mut watching, mut other_frame) = (Self::default(), false, false);
        for instruction in instructions {
            let end = match &instruction.action {
                Action::AxisMove(motion) => End::of_axes(motion.target, &motion.manner),
                Action::LinearMove(motion) => End::of_position(motion.target, &motion.manner, other_frame),
                Action::CurveMove(curve) => End::of_position(curve.end, &curve.manner, other_frame),
                Action::Workbench(_) => {
                    other_frame = true;
                    continue;
                }
                Action::Unknown(_) => {
                    // It may move the arm, too.
                    other_frame = true;
                    End::Unknown
                }
                Action::StopOnSignal(stop) => {
                    watching = stop.in_use;
                    continue;
                }
                Action::PathSpeed(_) | Action::Wait(_) | Action::Output(_) | Action::BoardOutput(_) => {
                    continue;
                }
            };
            course.ends.push(end);
            course.watched = watching;
        }
        course
    }

    /// How the last move ends; `None` if no step moves the arm.
    pub fn end(&self) -> Option<End> {
        self.ends.last().copied()
    }

    /// Whether an input may cut the last move short.
    pub fn is_watched(&self) -> bool {
        self.watched
    }

    /// Whether a step leads elsewhere than to this place, as far as can be told.
    pub fn leads_away_from(&self, place: &Position) -> bool {
        self.ends.iter().any(|end| match end {
            End::At(target) => target.missed(place).is_some(),
            End::Unknown => true,
        })
    }
}

impl End {
    fn of_axes(target: Coordinates, manner: &Manner) -> Self {
        let mask = moved(manner, &target);
        // Of others than these six nothing is read.
        let is_read = mask.axes().next().is_some() && mask.axes().all(|axis| AxisMask::SIX.contains(axis));
        if is_read { Self::At(Target::Axes(target, mask)) } else { Self::Unknown }
    }

    fn of_position(end: Coordinates, manner: &Manner, other_frame: bool) -> Self {
        let mask = moved(manner, &end).and(AxisMask::POSITION);
        let other_frame = other_frame || manner.tool.is_some() || manner.coord.is_some();
        if other_frame || mask.axes().next().is_none() {
            return Self::Unknown;
        }
        Self::At(Target::Position(end, mask))
    }
}

/// Where the arm was read to be: axes in degrees, and the pose in mm and degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    axes: [Option<f64>; AXES],
    pose: [Option<f64>; AXES],
}

impl From<&Done> for Position {
    fn from(done: &Done) -> Self {
        Self { axes: done.axes, pose: done.pose }
    }
}

impl From<&Status> for Position {
    fn from(status: &Status) -> Self {
        Self { axes: status.axes, pose: status.pose }
    }
}

impl Target {
    /// What is not where it should be, or was not read, or `None` if the arm is there. What is known to be elsewhere
    /// comes first. Only six axes and components are read.
    pub fn missed(&self, place: &Position) -> Option<Missed> {
        let (wanted, mask, values, tolerance) = match self {
            Self::Axes(wanted, mask) => (wanted, mask, &place.axes, AXIS_TOLERANCE_DEG),
            Self::Position(wanted, mask) => (wanted, mask, &place.pose, POSITION_TOLERANCE_MM),
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
    use r6_proto::message::instruction::{Move, StopOnSignal, Workbench};

    use super::*;

    fn place(axes: [f64; 6]) -> Position {
        let mut values = [None; AXES];
        for (slot, value) in values.iter_mut().zip(axes) {
            *slot = Some(value);
        }
        Position { axes: values, pose: values }
    }

    fn end(instructions: &[Instruction]) -> Option<End> {
        Course::of(instructions).end()
    }

    fn target(instruction: Instruction) -> Target {
        match end(&[instruction]) {
            Some(End::At(target)) => target,
            end => panic!("{end:?}"),
        }
    }

    fn step(action: Action) -> Instruction {
        Instruction { oneshot: true, action }
    }

    fn line(manner: Manner) -> Instruction {
        let target = Coordinates::from_slice(&[400.0, 0.0, 500.0, 180.0, 0.0, 180.0]);
        step(Action::LinearMove(Move { target, manner }))
    }

    fn axis_move(target: &[f64], mask: AxisMask) -> Instruction {
        let manner = Manner { mask: Some(mask), ..Manner::default() };
        step(Action::AxisMove(Move { target: Coordinates::from_slice(target), manner }))
    }

    #[test]
    fn only_the_axes_of_the_mask_are_compared() {
        let mask = AxisMask::from_bits(0b01);
        let target = target(axis_move(&[10.0, 20.0], mask));
        assert_eq!(target.missed(&place([10.001, 0.0, 0.0, 0.0, 0.0, 0.0])), None);
        let missed = target.missed(&place([9.0, 20.0, 0.0, 0.0, 0.0, 0.0])).unwrap();
        assert_eq!(missed.to_string(), "J1 is at 9.000, not at 10.000 degrees");
    }

    #[test]
    fn what_was_not_read_is_not_reached() {
        let target = target(axis_move(&[10.0, 20.0, 30.0], AxisMask::from_bits(0b011)));
        let mut found = place([10.0, 20.0, 0.0, 0.0, 0.0, 0.0]);
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
    fn the_last_motion_counts_and_what_cannot_be_compared_is_not_told_as_known() {
        let (first, last) = (axis_move(&[10.0], AxisMask::SIX), axis_move(&[30.0], AxisMask::SIX));
        assert_eq!(end(&[first, last]), end(&[last]));
        assert_eq!(end(&[]), None);
        let bench = step(Action::Workbench(Workbench { id: 1 }));
        assert_eq!(end(&[bench]), None, "it moves nothing");
        assert!(matches!(end(&[line(Manner::default())]), Some(End::At(Target::Position(..)))));
        let only = |mask| Manner { mask: Some(AxisMask::from_bits(mask)), ..Manner::default() };
        for steps in [
            &[bench, line(Manner::default())][..],
            &[line(Manner { tool: Some(1), ..Manner::default() })],
            &[line(Manner { coord: Some(1), ..Manner::default() })],
            // The orientation alone, and an axis that is not read.
            &[line(only(0x38))],
            &[axis_move(&[1.0; 8], AxisMask::from_bits(0x40))],
        ] {
            assert_eq!(end(steps), Some(End::Unknown), "{steps:?}");
        }
        // Axes are the same in every frame.
        assert_eq!(end(&[bench, last]), end(&[last]));
    }

    #[test]
    fn a_watch_counts_until_it_is_switched_off() {
        let watch = |in_use| step(Action::StopOnSignal(StopOnSignal { in_use, input: 0, on: true }));
        let last = axis_move(&[30.0], AxisMask::SIX);
        assert!(Course::of(&[watch(true), last]).is_watched());
        assert!(!Course::of(&[watch(true), last, watch(false), last]).is_watched());
        assert!(Course::of(&[watch(true), last, watch(false)]).is_watched(), "the last move is what counts");
    }

    #[test]
    fn a_way_there_and_back_leads_away() {
        let (away, back) = (axis_move(&[10.0], AxisMask::SIX), axis_move(&[0.0], AxisMask::SIX));
        let here = place([0.0; 6]);
        assert!(Course::of(&[away, back]).leads_away_from(&here));
        assert!(!Course::of(&[back]).leads_away_from(&here));
    }
}
