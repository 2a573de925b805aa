//! The steps of a path as places and lines: where each step begins and ends, how long it is, and how near the
//! arm is to it.

use std::ops::Range;
use std::time::Duration;

use r6_proto::message::instruction::{Coordinates, Manner, Wait, WaitSource};
use r6_proto::message::{Action, Instruction};
use r6_proto::{AxisIndex, AxisMask};

use crate::evidence::Sample;
use crate::path::pace;
use crate::path::place::Place;
use crate::path::way::{Sums, Way};

/// An arm is not on the line of a step if it is farther away than this, in degrees or mm, plus [`ROUNDED`]
/// times the length of the line.
const OFF_THE_WAY: f64 = 0.5;
const ROUNDED: f64 = 0.1;

/// A line that comes this near to a place, degrees or mm, counts as leading through it.
const THROUGH: f64 = 0.1;

/// The steps of a path, and where each of them ends.
#[derive(Debug)]
pub(super) struct Track {
    steps: Vec<Instruction>,
    places: Vec<Place>,
    /// Whether an input may cut the move of a step short.
    watched: Vec<bool>,
    /// Where the arm was before the first step.
    begun_at: Sample,
}

impl Track {
    pub fn new(steps: Vec<Instruction>, begun_at: Sample) -> Self {
        let (places, watched) = places(&steps);
        Self { steps, places, watched, begun_at }
    }

    pub fn steps(&self) -> &[Instruction] {
        &self.steps
    }

    /// Where the arm was before the first step.
    pub fn begun_at(&self) -> &Sample {
        &self.begun_at
    }

    /// Where these steps end.
    pub fn places(&self, steps: Range<usize>) -> &[Place] {
        self.places.get(steps).unwrap_or_default()
    }

    /// Where the arm stands when all accepted steps are over, and whether an input may have cut that move
    /// short.
    pub fn end_of(&self, accepted: usize) -> (Place, bool) {
        let places = self.places.iter().zip(&self.watched).take(accepted);
        places
            .rev()
            .find(|(place, _)| **place != Place::Same)
            .map_or((Place::Same, false), |(place, watched)| (*place, *watched))
    }

    /// How many of these steps move the arm.
    pub fn moves(&self, steps: Range<usize>) -> usize {
        self.places.get(steps).unwrap_or_default().iter().filter(|place| **place != Place::Same).count()
    }

    /// Whether an arm that stands where the path ends may have passed this place before. This is so if an
    /// earlier step that is not proved to be over leads through that place.
    pub fn passes_its_end(&self, open: Range<usize>) -> bool {
        let places = self.places.iter().enumerate().take(open.end);
        let Some((last, end)) = places.rev().find(|(_, place)| **place != Place::Same) else { return false };
        (open.start..last).any(|at| self.passes(at, end))
    }

    /// Whether the line of this step leads through that place, in the coordinates that both have.
    fn passes(&self, at: usize, end: &Place) -> bool {
        let Some(place) = self.places.get(at) else { return false };
        let (values, mask, wanted, also) = match (place, end) {
            (Place::Axes(values, mask), Place::Axes(wanted, also))
            | (Place::Position(values, mask), Place::Position(wanted, also)) => {
                (values, *mask, wanted, *also)
            }
            _ => return false,
        };
        let mut way = Sums::default();
        for axis in AxisIndex::ALL.into_iter().filter(|axis| mask.contains(*axis) && also.contains(*axis)) {
            let (Some(to), Some(wanted)) = (values.at(axis), wanted.at(axis)) else { continue };
            let from = self.start(at, place, axis).unwrap_or(to);
            way.add(to - from, wanted - from, 0.0);
        }
        way.way().distance <= THROUGH
    }

    /// The speed of this step as a share of the fastest speed; 1 if the step does not give one.
    pub fn speed(&self, at: usize) -> f64 {
        let speed = match self.steps.get(at).map(|step| &step.action) {
            Some(Action::AxisMove(step) | Action::LinearMove(step)) => step.manner.speed,
            Some(Action::CurveMove(curve)) => curve.manner.speed,
            _ => None,
        };
        speed.map_or(1.0, |percent| (percent / 100.0).clamp(0.001, 1.0))
    }

    /// Whether the arm is on the line of this step, or of the step before or after it, because corners are
    /// rounded. `true` if this cannot be judged.
    pub fn is_near(&self, step: usize, sample: &Sample, before: &Sample) -> bool {
        let near = |at| self.way(at, sample, before).is_none_or(|way| is_along(&way));
        (step.saturating_sub(1)..=step + 1).any(near)
    }

    /// Whether an arm this near to the line of this step can be on the step. A curve leads away from the line
    /// between its ends.
    pub fn is_on(&self, step: usize, way: &Way) -> bool {
        let is_curve = matches!(self.steps.get(step).map(|step| &step.action), Some(Action::CurveMove(_)));
        is_curve || is_along(way)
    }

    /// The path from where the arm was last seen to the end of this step.
    pub fn rest_of(&self, step: usize, before: &Sample) -> pace::Way {
        let Some(place) = self.places.get(step) else { return pace::Way::default() };
        let rest = place.beside(before).unwrap_or_default();
        let rest = rest.iter().map(|(_, end, found)| (end - found).abs()).fold(0.0, f64::max);
        let speed = self.speed(step);
        match place {
            Place::Axes(..) => pace::Way::of_turn(rest, speed),
            Place::Position(..) => pace::Way::of_tool(rest, speed),
            Place::Same | Place::Unknown => pace::Way::default(),
        }
    }

    /// The path length of these steps.
    pub fn way_of(&self, steps: Range<usize>) -> pace::Way {
        let mut sum = pace::Way::default();
        for at in steps {
            let (Some(place), Some(step)) = (self.places.get(at), self.steps.get(at)) else { break };
            let length = |values: &Coordinates, mask: AxisMask| {
                let along = |axis| Some((values.at(axis)? - self.start(at, place, axis)?).abs());
                let axes = AxisIndex::ALL.into_iter().filter(|axis| mask.contains(*axis));
                axes.filter_map(along).reduce(f64::max)
            };
            let (speed, a_move) = (self.speed(at), pace::Way::of_a_move());
            let way = match place {
                Place::Same => pace::Way { standing: time_alone(&step.action), ..pace::Way::default() },
                Place::Axes(values, mask) => {
                    length(values, *mask).map_or(a_move, |turn| pace::Way::of_turn(turn, speed))
                }
                Place::Position(values, mask) => {
                    length(values, *mask).map_or(a_move, |way| pace::Way::of_tool(way, speed))
                }
                Place::Unknown => a_move,
            };
            sum = sum.and(&way);
        }
        sum
    }

    /// How near the arm is to the line of this step.
    pub fn way(&self, at: usize, sample: &Sample, before: &Sample) -> Option<Way> {
        let place = self.places.get(at)?;
        let now = place.beside(sample)?;
        let mut way = Sums::default();
        for (axis, end, found) in now {
            let start = self.start(at, place, axis)?;
            let before = value(place, before, axis).unwrap_or(found);
            way.add(end - start, found - start, found - before);
        }
        Some(way.way())
    }

    /// The value of this coordinate when the step began.
    fn start(&self, at: usize, place: &Place, axis: AxisIndex) -> Option<f64> {
        let earlier = self.places.get(..at)?;
        for earlier in earlier.iter().rev() {
            match (place, earlier) {
                (_, Place::Same) => {}
                (Place::Axes(..), Place::Axes(values, mask))
                | (Place::Position(..), Place::Position(values, mask)) => {
                    if mask.contains(axis) {
                        return values.at(axis);
                    }
                }
                (Place::Axes(..) | Place::Position(..) | Place::Same | Place::Unknown, _) => return None,
            }
        }
        value(place, &self.begun_at, axis)
    }
}

/// Whether an arm this near to a line is on it.
fn is_along(way: &Way) -> bool {
    way.distance <= OFF_THE_WAY + way.length * ROUNDED
}

/// The value that was seen of this axis, in the coordinates of the place.
fn value(place: &Place, seen: &Sample, axis: AxisIndex) -> Option<f64> {
    let values = if matches!(place, Place::Axes(..)) { &seen.axes } else { &seen.pose };
    values.get(axis.index()).copied().flatten()
}

/// Where each step ends, and whether an input may cut it short. The end of a pose is not known once the work
/// frame changes.
fn places(steps: &[Instruction]) -> (Vec<Place>, Vec<bool>) {
    let (mut may_stop, mut other_frame) = (false, false);
    let is_of_tool = |manner: &Manner| manner.tool.is_some() || manner.coord.is_some();
    let place = |step: &Instruction| {
        match &step.action {
            Action::StopOnSignal(stop) => may_stop = stop.in_use,
            Action::Workbench(_) | Action::Unknown(_) => other_frame = true,
            // It is not known whether the tool and the frame of a move stay in use after it.
            Action::LinearMove(step) => other_frame |= is_of_tool(&step.manner),
            Action::CurveMove(curve) => other_frame |= is_of_tool(&curve.manner),
            Action::AxisMove(_)
            | Action::PathSpeed(_)
            | Action::Wait(_)
            | Action::Output(_)
            | Action::BoardOutput(_) => {}
        }
        let place = match Place::of(&step.action) {
            Place::Position(..) if other_frame => Place::Unknown,
            place @ (Place::Axes(..) | Place::Position(..) | Place::Same | Place::Unknown) => place,
        };
        (place, may_stop)
    };
    steps.iter().map(place).unzip()
}

/// How long a step lets the arm stand; `None`: for ever.
pub(crate) fn standing_time(step: &Instruction) -> Option<Duration> {
    let seconds = match &step.action {
        Action::Wait(wait) if wait.unlimited => return None,
        Action::Wait(wait) => wait.limit,
        Action::Output(output) => output.delay,
        Action::AxisMove(step) | Action::LinearMove(step) => step.manner.delay.unwrap_or(0.0),
        Action::CurveMove(curve) => curve.manner.delay.unwrap_or(0.0),
        Action::PathSpeed(_)
        | Action::StopOnSignal(_)
        | Action::BoardOutput(_)
        | Action::Workbench(_)
        | Action::Unknown(_) => 0.0,
    };
    Some(Duration::try_from_secs_f64(seconds).unwrap_or_default())
}

/// How long a step takes that waits for time only, seconds; 0 for every other step.
fn time_alone(action: &Action) -> f64 {
    match action {
        Action::Wait(Wait { source: WaitSource::Time, unlimited: false, limit, .. }) => *limit,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use r6_proto::AXES;
    use r6_proto::message::instruction::{Coordinates, CurveMove, Move, Workbench};

    use super::*;

    /// Otherwise slow curves that another client cleared would count as made.
    #[test]
    fn a_move_at_half_speed_counts_twice_whatever_its_kind() {
        let manner = Manner { speed: Some(50.0), mask: Some(AxisMask::POSITION), ..Manner::default() };
        let end = Coordinates::from_slice(&[100.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let stood = Sample {
            moving: Some(false),
            alarm: Some(0),
            mode: None,
            list_length: None,
            axes: [Some(0.0); AXES],
            pose: [Some(0.0); AXES],
        };
        for action in [
            Action::AxisMove(Move { target: end, manner }),
            Action::LinearMove(Move { target: end, manner }),
            Action::CurveMove(CurveMove { middle: end, end, manner }),
        ] {
            let way = Track::new(vec![Instruction { oneshot: true, action }], stood).way_of(0..1);
            assert_eq!(way.turn_at_full + way.tool_at_full, 200.0, "{action:?}");
            assert_eq!(way.turn + way.tool, 100.0, "{action:?}");
        }
    }

    #[test]
    fn where_a_move_of_the_tool_ends_is_not_known_behind_another_frame_or_tool() {
        let pose = Coordinates::from_slice(&[400.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let line = |manner| Action::LinearMove(Move { target: pose, manner });
        let curve = |manner| Action::CurveMove(CurveMove { middle: pose, end: pose, manner });
        let own = Manner::default();
        let of_tool = Manner { tool: Some(1), ..own };
        let frame = || Action::Workbench(Workbench { id: 1 });
        for (actions, known) in [
            (vec![line(own), curve(own), line(own)], vec![true, true, true]),
            (vec![frame(), line(own), line(own)], vec![false, false]),
            (vec![frame(), curve(own), line(own)], vec![false, false]),
            (vec![line(of_tool), line(own)], vec![false, false]),
            (vec![curve(of_tool), line(own)], vec![false, false]),
        ] {
            let steps: Vec<_> =
                actions.into_iter().map(|action| Instruction { oneshot: true, action }).collect();
            let (places, _) = places(&steps);
            let moves =
                steps.iter().zip(places).filter(|(step, _)| !matches!(step.action, Action::Workbench(_)));
            let found: Vec<_> = moves.map(|(_, place)| matches!(place, Place::Position(..))).collect();
            assert_eq!(found, known, "{steps:?}");
        }
    }
}
