//! How far along a path the arm is: by the length of the controller's list, or else by where the arm is.

use std::ops::Range;
use std::time::Duration;

use r6_proto::message::Action;
use r6_proto::message::Instruction;

use crate::evidence::Sample;
use crate::motion::EndProof;
use crate::path::place::{Missed, Place};

/// Two segments that the arm is as near to as this, degrees or mm, are equally near: corners are rounded. The earlier
/// one counts, so that the list is rather thought too full than too empty.
const EQUALLY_NEAR: f64 = 0.05;

/// Below this, degrees or mm, a difference between two reads is no direction.
const NO_DIRECTION: f64 = 1e-3;

/// A path that is being run.
#[derive(Debug)]
pub(crate) struct PathProgress {
    steps: Vec<Instruction>,
    places: Vec<Place>,
    /// Whether an input may cut the move of a step short.
    watched: Vec<bool>,
    /// Where the arm was before the first step.
    begun_at: Sample,
    before: Sample,
    /// Steps that the controller took.
    pub accepted: usize,
    /// Steps that are over.
    pub done: usize,
    since_fed: SinceFed,
    /// Steps with a move that went out of the list between two looks, at most.
    pace: usize,
}

/// What was seen since a list was last accepted.
#[derive(Clone, Copy, Debug)]
struct SinceFed {
    /// The first step of that list.
    first: usize,
    /// The last look before it.
    from: Sample,
    /// Whether the arm was seen to move.
    moved: bool,
    /// How many steps the list had when it was last seen not to be empty; at first all that should be in it.
    length: usize,
}

impl PathProgress {
    pub fn new(steps: Vec<Instruction>, begun_at: Sample) -> Self {
        let (places, watched) = places(&steps);
        let since_fed = SinceFed { first: 0, from: begun_at, moved: false, length: 0 };
        Self { steps, places, watched, begun_at, before: begun_at, accepted: 0, done: 0, since_fed, pace: 0 }
    }

    pub fn steps(&self) -> &[Instruction] {
        &self.steps
    }

    /// The controller took a list; so many steps are accepted now.
    pub fn fed(&mut self, accepted: usize) {
        self.since_fed =
            SinceFed { first: self.accepted, from: self.before, moved: false, length: accepted - self.done };
        self.accepted = accepted;
    }

    /// Steps in the controller's list, as far as is known. The arm leaves a step's way at the corner, some time before the
    /// step is over: where only the place tells, one more counts.
    pub fn in_list(&self) -> usize {
        let at_corner = self.before.list_length.is_none() && self.done < self.accepted;
        self.accepted - self.done.saturating_sub(usize::from(at_corner))
    }

    /// Where the arm stands when all that was accepted is over, and whether an input may have cut that move short.
    fn end_of_accepted(&self) -> (Place, bool) {
        let places = self.places.iter().zip(&self.watched).take(self.accepted);
        places
            .rev()
            .find(|(place, _)| **place != Place::Same)
            .map_or((Place::Same, false), |(place, watched)| (*place, *watched))
    }

    /// The first axis that is not where the arm has to stand when all that was accepted is over.
    pub fn missed(&self, sample: &Sample) -> Option<Missed> {
        self.end_of_accepted().0.missed(sample)
    }

    /// The statement "all that was accepted was carried out": what proves it, in a look at an arm whose list is empty as far as is
    /// known. `rests`: it was seen to stand.
    ///
    /// A list that was accepted proves nothing, and neither does an empty one: somebody else may have cleared it.
    pub fn end(&self, sample: &Sample, rests: bool) -> Option<EndProof> {
        if sample.list_length.is_some_and(|length| length > 0) {
            return None;
        }
        let (place, watched) = self.end_of_accepted();
        match place {
            Place::Same => Some(EndProof::AtRest),
            Place::Axes(..) | Place::Position(..) => match place.missed(sample) {
                None => self.was_gone().then_some(EndProof::Reached),
                Some(missed) => {
                    (watched && rests && self.was_consumed(sample)).then_some(EndProof::CutShort(missed))
                }
            },
            Place::Unknown => (rests && self.was_consumed(sample)).then_some(EndProof::Consumed),
        }
    }

    /// Whether an arm at the end of the last list must have gone there: it was seen to move, or was elsewhere before, or no step
    /// leads away from where it was.
    fn was_gone(&self) -> bool {
        let SinceFed { first, from, moved, .. } = &self.since_fed;
        let is_elsewhere = |place: &Place| *place == Place::Unknown || place.missed(from).is_some();
        let mut listed = self.places.iter().take(self.accepted).skip(*first);
        *moved || self.missed(from).is_some() || !listed.any(is_elsewhere)
    }

    /// Whether the list was seen to be worked through step by step, down to one move, or at the pace at which it was before; and the arm to
    /// move. Firmware that does not tell the length of its list can prove that of one move only.
    fn was_consumed(&self, sample: &Sample) -> bool {
        let first = match sample.list_length {
            Some(_) => self.accepted.saturating_sub(self.since_fed.length),
            None => self.since_fed.first,
        };
        let at_once = if sample.list_length.is_some() { self.pace.saturating_mul(2).max(1) } else { 1 };
        self.since_fed.moved && self.moves(first..self.accepted) <= at_once
    }

    /// How many of these steps move the arm.
    fn moves(&self, steps: Range<usize>) -> usize {
        self.places.get(steps).unwrap_or_default().iter().filter(|place| **place != Place::Same).count()
    }

    /// Takes in one read. `rests`: it was seen to stand, with an empty list as far as is known.
    pub fn see(&mut self, sample: &Sample, rests: bool) {
        self.since_fed.moved |= sample.moving == Some(true) || sample.went_on_from(&self.since_fed.from.axes);
        let done = match sample.list_length {
            // An empty list elsewhere than at the end of what was accepted: it was taken and not carried out, was cleared by somebody
            // else, or counts only what has not begun.
            Some(0) if self.end(sample, rests).is_some() => self.accepted,
            Some(0) => self.done,
            Some(length) => self.count(usize::try_from(length).unwrap_or(0)),
            None if rests && self.end(sample, rests).is_some() => self.accepted,
            None => self.passed(sample),
        };
        self.done = self.done.max(done).min(self.accepted);
        self.before = *sample;
    }

    /// Takes in the length of a list that is not empty; the steps that are over.
    fn count(&mut self, length: usize) -> usize {
        let over = |length: usize| self.accepted.saturating_sub(length);
        let gone = self.moves(over(self.since_fed.length)..over(length));
        self.pace = self.pace.max(gone);
        self.since_fed.length = length.min(self.since_fed.length);
        over(length)
    }

    /// The step that the arm is on: the earliest of those that lead where it goes and that it is nearest to.
    fn passed(&self, sample: &Sample) -> usize {
        let ways: Vec<(usize, Way)> = (self.done..self.accepted)
            .filter_map(|at| Some((at, self.way(at, sample)?)))
            .filter(|(_, way)| way.agrees)
            .collect();
        let nearest = ways.iter().map(|(_, way)| way.distance).fold(f64::INFINITY, f64::min);
        ways.iter()
            .find(|(_, way)| way.distance <= nearest + EQUALLY_NEAR.min(way.length / 10.0))
            .map_or(self.done, |(at, _)| *at)
    }

    /// How near the arm is to the way of this step.
    fn way(&self, at: usize, sample: &Sample) -> Option<Way> {
        let place = self.places.get(at)?;
        let now = place.beside(sample)?;
        let mut way = Sums::default();
        for (axis, end, found) in now {
            let start = self.start(at, place, axis)?;
            let values = if matches!(place, Place::Axes(..)) { &self.before.axes } else { &self.before.pose };
            let before = values.get(axis.index()).copied().flatten().unwrap_or(found);
            way.add(end - start, found - start, found - before);
        }
        Some(way.way())
    }

    /// Where this coordinate was when the step began.
    fn start(&self, at: usize, place: &Place, axis: r6_proto::AxisIndex) -> Option<f64> {
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
        let values = if matches!(place, Place::Axes(..)) { &self.begun_at.axes } else { &self.begun_at.pose };
        values.get(axis.index()).copied().flatten()
    }

    /// How long the arm may stand because the step whose turn it is says so; `None`: for ever.
    pub fn may_stand(&self) -> Option<Duration> {
        let step = self.steps.get(self.done).filter(|_| self.done < self.accepted);
        step.map_or(Some(Duration::ZERO), standing_time)
    }

    /// How long the steps that are in the list may let the arm stand, together; `None`: for ever.
    pub fn all_may_stand(&self) -> Option<Duration> {
        let listed = self.steps.get(self.done..self.accepted).unwrap_or_default();
        listed.iter().try_fold(Duration::ZERO, |sum, step| Some(sum + standing_time(step)?))
    }
}

/// Where each step ends, and whether an input may cut it short. Nobody can tell of poses once the work frame changes.
fn places(steps: &[Instruction]) -> (Vec<Place>, Vec<bool>) {
    let (mut may_stop, mut other_frame) = (false, false);
    let place = |step: &Instruction| {
        match &step.action {
            Action::StopOnSignal(stop) => may_stop = stop.in_use,
            Action::Workbench(_) | Action::Unknown(_) => other_frame = true,
            Action::AxisMove(_)
            | Action::LinearMove(_)
            | Action::CurveMove(_)
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

/// How near a point is to a way.
#[derive(Clone, Copy, Debug)]
struct Way {
    length: f64,
    distance: f64,
    /// Whether the arm goes along it, and not back; an arm that stands agrees with every way.
    agrees: bool,
}

/// Sums over the coordinates.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// Way times way.
    ww: f64,
    /// From the start of the way to the point, squared.
    pp: f64,
    /// That times the way.
    pw: f64,
    /// The last motion times the way.
    mw: f64,
    /// The last motion squared.
    mm: f64,
}

impl Sums {
    fn add(&mut self, way: f64, from_start: f64, motion: f64) {
        self.ww += way * way;
        self.pp += from_start * from_start;
        self.pw += from_start * way;
        self.mw += motion * way;
        self.mm += motion * motion;
    }

    fn way(self) -> Way {
        let share = if self.ww > 0.0 { (self.pw / self.ww).clamp(0.0, 1.0) } else { 0.0 };
        let squared = self.pp - 2.0 * share * self.pw + share * share * self.ww;
        Way {
            length: self.ww.sqrt(),
            distance: squared.max(0.0).sqrt(),
            agrees: self.mm.sqrt() < NO_DIRECTION || self.mw >= 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use r6_proto::message::instruction::{Coordinates, Manner, Move};
    use r6_proto::{AXES, AxisMask, OperationMode};

    use super::*;

    fn at(j1: f64, j2: f64) -> Sample {
        let mut axes = [None; AXES];
        axes[0] = Some(j1);
        axes[1] = Some(j2);
        Sample {
            moving: Some(true),
            alarm: Some(0),
            mode: Some(OperationMode::Running),
            list_length: None,
            axes,
            pose: [None; AXES],
        }
    }

    fn path(targets: &[[f64; 2]]) -> PathProgress {
        let manner = Manner { mask: Some(AxisMask::from_bits(0b11)), ..Manner::default() };
        let step = |target: &[f64; 2]| Instruction {
            oneshot: true,
            action: Action::AxisMove(Move { target: Coordinates::from_slice(target), manner }),
        };
        let mut path = PathProgress::new(targets.iter().map(step).collect(), at(0.0, 0.0));
        path.accepted = targets.len();
        path
    }

    fn seen(path: &mut PathProgress, samples: &[[f64; 2]]) -> usize {
        for [j1, j2] in samples {
            path.see(&at(*j1, *j2), false);
        }
        path.done
    }

    #[test]
    fn a_way_back_and_forth_is_told_apart_by_its_direction() {
        let mut path = path(&[[8.0, 0.0], [-8.0, 0.0], [8.0, 0.0], [-8.0, 0.0]]);
        assert_eq!(seen(&mut path, &[[1.0, 0.0], [4.0, 0.0]]), 0);
        assert_eq!(seen(&mut path, &[[6.0, 0.0], [2.0, 0.0]]), 1);
        assert_eq!(seen(&mut path, &[[-6.0, 0.0], [-4.0, 0.0], [4.0, 0.0]]), 2);
        assert_eq!(seen(&mut path, &[[7.0, 0.0], [3.0, 0.0]]), 3);
    }

    #[test]
    fn a_rounded_corner_is_passed_in_its_order() {
        let mut path = path(&[[10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [0.0, 0.0]]);
        assert_eq!(seen(&mut path, &[[9.0, 0.3]]), 0);
        assert_eq!(seen(&mut path, &[[9.7, 1.2], [10.0, 6.0]]), 1);
        assert_eq!(seen(&mut path, &[[9.0, 9.8], [3.0, 10.0]]), 2);
    }

    #[test]
    fn a_second_lap_is_not_taken_for_the_first() {
        let lap = [[10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [0.0, 0.0]];
        let mut path = path(&[lap, lap].concat());
        assert_eq!(seen(&mut path, &[[5.0, 0.0]]), 0);
        assert_eq!(seen(&mut path, &[[10.0, 5.0], [5.0, 10.0], [0.0, 5.0], [0.0, 4.0], [3.0, 0.0]]), 4);
    }

    #[test]
    fn the_length_of_the_list_says_more_than_the_place() {
        let mut path = path(&[[8.0, 0.0], [-8.0, 0.0], [8.0, 0.0]]);
        path.see(&Sample { list_length: Some(1), ..at(0.0, 0.0) }, false);
        assert_eq!(path.done, 2);
        path.see(&Sample { list_length: Some(3), ..at(0.0, 0.0) }, false);
        assert_eq!(path.done, 2, "what is done stays done");
    }

    #[test]
    fn an_empty_list_elsewhere_is_no_proof() {
        let mut path = path(&[[8.0, 0.0], [-8.0, 0.0]]);
        path.see(&Sample { list_length: Some(0), ..at(0.0, 0.0) }, true);
        assert_eq!(path.done, 0);
        path.see(&Sample { list_length: Some(0), ..at(-8.0, 0.0) }, true);
        assert_eq!(path.done, 2);
    }
}
