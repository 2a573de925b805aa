//! How far the arm is along a path: by the length of the controller's list, or else by the position of the
//! arm.

use std::ops::Range;
use std::time::Duration;

use r6_proto::message::Instruction;
use r6_proto::time::Instant;

use crate::done::EndProof;
use crate::evidence::Sample;
use crate::path::pace::{self, Looked, Pace};
use crate::path::place::{Missed, Place};
use crate::path::track::{Track, standing_time};
use crate::path::way::Way;

/// If the arm is this near to two segments, degrees or mm, they count as equally near, because corners are
/// rounded. The earlier segment counts, so that the client rather overestimates the list than underestimates
/// it.
const EQUALLY_NEAR: f64 = 0.05;

/// The longest time that arms stand in a corner that is not blended (0.25 to 0.33 s, reported, unit A).
const CORNER: Duration = Duration::from_millis(350);

/// A path that is being run.
#[derive(Debug)]
pub(crate) struct PathProgress {
    track: Track,
    /// The last look.
    before: Sample,
    /// Steps that the controller has accepted.
    pub accepted: usize,
    /// Steps that are over.
    pub done: usize,
    since_fed: SinceFed,
    /// The highest number of moving steps that left the list between two looks.
    at_once: usize,
    pace: Pace,
    /// Set if something was appended since the last look: the steps up to this one were in the list before
    /// that. If another client cleared the list before the append, all of these steps are gone.
    held_until: Option<usize>,
    /// Whether the empty list that was seen last can have been worked through; `None`: no empty list was
    /// seen. An append, or a list that is not empty, resets it.
    worked_through: Option<bool>,
    /// Whether the list was seen to count the step under way.
    counts_running: bool,
    /// The steps that left the list faster than the arm can have made them.
    skipped: Option<Range<usize>>,
}

/// What was seen since the controller last accepted a list.
#[derive(Clone, Copy, Debug)]
struct SinceFed {
    /// The first step of that list.
    first: usize,
    /// The last look before it.
    from: Sample,
    /// Whether the arm was seen to move since.
    moved: bool,
    /// How many steps the list had when it was last seen not empty. At first, all the steps that should be in
    /// it.
    length: usize,
}

impl PathProgress {
    pub fn new(steps: Vec<Instruction>, begun_at: Sample, now: Instant) -> Self {
        Self {
            track: Track::new(steps, begun_at),
            before: begun_at,
            accepted: 0,
            done: 0,
            since_fed: SinceFed { first: 0, from: begun_at, moved: false, length: 0 },
            at_once: 0,
            pace: Pace::new(now),
            held_until: None,
            worked_through: None,
            counts_running: false,
            skipped: None,
        }
    }

    pub fn steps(&self) -> &[Instruction] {
        self.track.steps()
    }

    /// Where the steps lead.
    pub(super) fn track(&self) -> &Track {
        &self.track
    }

    /// Notes that the controller accepted a list. `accepted`: the number of steps accepted so far.
    pub fn fed(&mut self, accepted: usize) {
        // The first list replaces the old contents.
        if self.accepted > 0 {
            self.held_until.get_or_insert(self.accepted);
        }
        self.since_fed =
            SinceFed { first: self.accepted, from: self.before, moved: false, length: accepted - self.done };
        self.accepted = accepted;
        self.worked_through = None;
    }

    /// The number of steps in the controller's list, as far as is known. The arm leaves the path of a step at
    /// the corner, some time before the step is over. So if only the position tells, one more step counts.
    pub fn in_list(&self) -> usize {
        let at_corner = self.before.list_length.is_none() && self.done < self.accepted;
        self.accepted - self.done.saturating_sub(usize::from(at_corner))
    }

    /// Whether the list is empty and nothing proves that its steps were carried out. A list appended now
    /// would hide that.
    pub fn is_unproved(&self) -> bool {
        self.before.list_length == Some(0) && self.done < self.accepted
    }

    /// The first axis that is not where the arm has to stand when all accepted steps are over.
    pub fn missed(&self, sample: &Sample) -> Option<Missed> {
        self.track.end_of(self.accepted).0.missed(sample)
    }

    /// The proof of the statement "everything accepted was carried out". It is taken from one look at an arm
    /// whose list is empty as far as is known. `rests`: the arm was seen at rest.
    ///
    /// An accepted list proves nothing, and neither does an empty one, because another client may have
    /// cleared it.
    pub fn end(&self, sample: &Sample, rests: bool) -> Option<EndProof> {
        if sample.list_length.is_some_and(|length| length != 0) {
            return None;
        }
        let (place, watched) = self.track.end_of(self.accepted);
        match place {
            Place::Same => (self.worked_through != Some(false)).then_some(EndProof::AtRest),
            Place::Axes(..) | Place::Position(..) => match place.missed(sample) {
                None => {
                    let passes_before = || self.track.passes_its_end(self.done..self.accepted);
                    let came_by_its_end = self.worked_through != Some(false) || !passes_before();
                    (self.was_gone() && came_by_its_end).then_some(EndProof::Reached)
                }
                Some(missed) => {
                    (watched && rests && self.was_consumed(sample)).then_some(EndProof::CutShort(missed))
                }
            },
            Place::Unknown => (rests && self.was_consumed(sample)).then_some(EndProof::Consumed),
        }
    }

    /// Whether an arm at the end of the last list must have moved there: it was seen to move, or it was
    /// elsewhere before, or no step leads away from where it was.
    fn was_gone(&self) -> bool {
        let SinceFed { first, from, moved, .. } = &self.since_fed;
        let is_elsewhere = |place: &Place| *place == Place::Unknown || place.missed(from).is_some();
        let listed = self.track.places(*first..self.accepted);
        *moved || self.missed(from).is_some() || !listed.iter().any(is_elsewhere)
    }

    /// Whether the arm was seen to move and the list was seen to be worked through. The list must have shrunk
    /// step by step down to one move, or at the pace seen before. Firmware that does not report the length of
    /// its list can prove this for one move only.
    fn was_consumed(&self, sample: &Sample) -> bool {
        let first = match sample.list_length {
            Some(_) => self.accepted.saturating_sub(self.since_fed.length),
            None => self.since_fed.first,
        };
        let at_once = if sample.list_length.is_some() { self.at_once.saturating_mul(2).max(1) } else { 1 };
        self.since_fed.moved && self.track.moves(first..self.accepted) <= at_once
    }

    /// Whether the arm was seen to move often enough to judge which steps it cannot have made.
    pub fn knows_pace(&self) -> bool {
        self.pace.is_known()
    }

    /// The steps that left the list although the arm cannot have made them: another client cleared it.
    pub fn skipped(&self) -> Option<Range<usize>> {
        self.skipped.clone()
    }

    /// Takes in one read. `rests`: the arm was seen at rest, with an empty list as far as is known.
    pub fn see(&mut self, sample: &Sample, rests: bool, looked: Looked) {
        self.since_fed.moved |= sample.moving == Some(true) || sample.went_on_from(&self.since_fed.from.axes);
        let done = match sample.list_length {
            // If the list is empty while the arm is not at the end of the accepted steps, there are three
            // explanations: the list was accepted and not carried out, another client cleared it, or the list
            // counts only steps that have not begun.
            Some(0) => {
                self.emptied(sample, looked);
                if self.end(sample, rests).is_some() { self.accepted } else { self.done }
            }
            Some(length) => match usize::try_from(length) {
                Ok(length) => self.count(length, sample, looked),
                // Negative: not a length, so it says nothing.
                Err(_) => self.done,
            },
            None if rests && self.end(sample, rests).is_some() => self.accepted,
            None => self.passed(sample),
        };
        self.done = self.done.max(done).min(self.accepted);
        self.before = *sample;
        self.held_until = None;
    }

    /// Takes in an empty list. Decides whether it can have been worked through since the last look.
    fn emptied(&mut self, sample: &Sample, looked: Looked) {
        if self.worked_through.is_none() {
            let beyond_first = self.track.way_of(self.done + 1..self.accepted);
            let can = self.was_consumed(sample) || self.pace.allows(&beyond_first, looked, true);
            self.worked_through = Some(can && self.can_have_stood(&(self.done..self.accepted), looked));
        }
    }

    /// Whether these steps, if they are only waits, can have waited as long as they say. The first step may
    /// have been over soon.
    fn can_have_stood(&self, steps: &Range<usize>, looked: Looked) -> bool {
        let beyond_first = self.track.way_of(steps.start + 1..steps.end);
        self.track.moves(steps.clone()) > 0 || self.pace.allows_standing(&beyond_first, looked)
    }

    /// Takes in the length of a list that is not empty. Returns the number of steps that are over.
    fn count(&mut self, length: usize, sample: &Sample, looked: Looked) -> usize {
        let over = |length: usize| self.accepted.saturating_sub(length);
        let gone = over(self.since_fed.length)..over(length);
        let since = self.done..over(length);
        // If the arm moves and the list is as long as everything sent, the list counts the step under way.
        self.counts_running |= length == self.accepted && sample.moving == Some(true);
        let way = self.way_since(&since);
        // A controller that clears its list may keep the step that it is carrying out.
        let may_be_cleared = since.end + 1 >= self.held_until.unwrap_or(self.accepted);
        if may_be_cleared && !self.can_have_made(&since, &way, sample, looked) {
            self.skipped = Some(since);
            return self.done;
        }
        let share = self.track.speed(since.end).max(self.track.speed(since.start));
        let turned = pace::Way::of_turn(largest_change(&self.before.axes, &sample.axes), share);
        let went = pace::Way::of_tool(largest_change(&self.before.pose[..3], &sample.pose[..3]), share);
        self.pace.went(&way.most(&turned).most(&went), looked);
        if !since.is_empty() && !may_be_cleared {
            self.pace.goes_stepwise();
        }
        self.at_once = self.at_once.max(self.track.moves(gone));
        self.since_fed.length = length.min(self.since_fed.length);
        self.worked_through = None;
        over(length)
    }

    /// Whether the arm can have made these steps since the last look, by its pace and its position.
    fn can_have_made(&self, steps: &Range<usize>, way: &pace::Way, sample: &Sample, looked: Looked) -> bool {
        let on_the_old = self.track.is_near(steps.start, sample, &self.before);
        let on_the_new = self.track.is_near(steps.end, sample, &self.before);
        let by_place = on_the_new && !on_the_old;
        // If the arm is not on its new path, its list may be ahead of it, as it was before.
        let by_pace = self.pace.allows(way, looked, on_the_new && on_the_old);
        (by_place || by_pace) && self.can_have_stood(steps, looked)
    }

    /// The minimum path that the arm has made since the last look, if it has made these steps. It may still
    /// be on the last step, because corners are rounded. If the list counts only steps that have not begun,
    /// the arm may have just left the first one.
    fn way_since(&self, steps: &Range<usize>) -> pace::Way {
        let between = self.track.way_of(steps.start + 1..steps.end.saturating_sub(1));
        if self.counts_running && steps.len() > 1 {
            between.and(&self.track.rest_of(steps.start, &self.before))
        } else {
            between
        }
    }

    /// The step that the arm is on: the earliest of the steps that lead in its direction and are nearest to
    /// it. An arm that is on none of them is on a step of another client, which says nothing about our steps.
    fn passed(&self, sample: &Sample) -> usize {
        if !sample.went_on_from(&self.before.axes) {
            // The arm stands, perhaps in a wait. No position tells that a wait is over.
            return self.done;
        }
        let ways: Vec<(usize, Way)> = (self.done..self.accepted)
            .filter_map(|at| Some((at, self.track.way(at, sample, &self.before)?)))
            .filter(|(at, way)| way.agrees && self.track.is_on(*at, way))
            .collect();
        let nearest = ways.iter().map(|(_, way)| way.distance).fold(f64::INFINITY, f64::min);
        ways.iter()
            .find(|(_, way)| way.distance <= nearest + EQUALLY_NEAR.min(way.length / 10.0))
            .map_or(self.done, |(at, _)| *at)
    }

    /// How long the present step may let the arm stand; `None`: for ever.
    pub fn may_stand(&self) -> Option<Duration> {
        let step = self.steps().get(self.done).filter(|_| self.done < self.accepted);
        step.map_or(Some(Duration::ZERO), standing_time)
    }

    /// How long the steps in the list may let the arm stand, together; `None`: for ever. If there is a wait,
    /// corners count too: a move that leads nowhere is also a corner.
    pub fn all_may_stand(&self) -> Option<Duration> {
        let listed = self.steps().get(self.done..self.accepted).unwrap_or_default();
        let waits = listed.iter().try_fold(Duration::ZERO, |sum, step| Some(sum + standing_time(step)?))?;
        let corners = u32::try_from(self.track.moves(self.done..self.accepted)).unwrap_or(u32::MAX);
        Some(if waits.is_zero() { waits } else { waits + CORNER.saturating_mul(corners) })
    }
}

/// The largest change of a value between two looks.
fn largest_change(before: &[Option<f64>], now: &[Option<f64>]) -> f64 {
    let both = before.iter().zip(now);
    both.filter_map(|(before, now)| Some(((*now)? - (*before)?).abs())).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use r6_proto::message::Action;
    use r6_proto::message::instruction::{
        Coordinates, Manner, Move, PathSpeed, Wait, WaitCondition, WaitSource,
    };
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
        let mut path = PathProgress::new(
            targets.iter().map(step).collect(),
            at(0.0, 0.0),
            Instant::ORIGIN + Duration::from_secs(100),
        );
        path.accepted = targets.len();
        path
    }

    /// A look one second after the path began.
    fn just_now() -> Looked {
        let at = (Instant::ORIGIN + Duration::from_secs(100)) + Duration::from_secs(1);
        Looked { asked_at: at, answered_at: at }
    }

    /// Runs the first eight steps of a path, 10 degrees each, at 100 degrees a second, and looks every 50 ms,
    /// `looks` times. The next look finds a list of `length` steps. Returns the steps that are not believed.
    fn skipped_after(looks: u32, length: i64) -> Option<Range<usize>> {
        let mut path = path(&[[10.0, 0.0], [0.0, 0.0]].repeat(8));
        path.accepted = 0;
        path.fed(8);
        let begun = Instant::ORIGIN + Duration::from_secs(100);
        let look = |n: u32| {
            let at = begun + Duration::from_millis(50) * n;
            Looked { asked_at: at, answered_at: at }
        };
        for n in 1..=looks {
            let (steps, rest) = (n / 2, f64::from(n % 2) * 5.0);
            let j1 = if steps % 2 == 0 { rest } else { 10.0 - rest };
            let sample = Sample { list_length: Some(8 - i64::from(steps)), ..at(j1, 0.0) };
            path.see(&sample, false, look(n));
        }
        path.fed(9);
        path.see(&Sample { list_length: Some(length), ..at(5.0, 0.0) }, false, look(looks + 1));
        path.skipped()
    }

    #[test]
    fn steps_that_are_gone_faster_than_the_arm_goes_were_not_made() {
        assert_eq!(skipped_after(7, 1), Some(3..8));
        assert_eq!(skipped_after(7, 5), None);
        assert_eq!(skipped_after(7, 4), None);
        // Its pace is not known yet, but no arm is that fast.
        assert_eq!(skipped_after(2, 1), Some(1..8));
        assert_eq!(skipped_after(2, 5), None);
    }

    /// Ten steps to new places. Nine of them are gone after 50 ms, which is more than any pace allows. The
    /// next look finds the arm at `j1`.
    fn skipped_where(j1: f64) -> Option<Range<usize>> {
        let targets: Vec<[f64; 2]> = (1..=10).map(|n| [f64::from(n) * 30.0, 0.0]).collect();
        let mut path = path(&targets);
        path.accepted = 0;
        path.fed(10);
        let asked_at = Instant::ORIGIN + Duration::from_secs(100);
        let answered_at = asked_at + Duration::from_millis(50);
        path.see(&Sample { list_length: Some(1), ..at(j1, 0.0) }, false, Looked { asked_at, answered_at });
        path.skipped()
    }

    #[test]
    fn an_arm_that_is_seen_where_the_next_step_begins_made_the_ones_before() {
        assert_eq!(skipped_where(5.0), Some(0..9));
        assert_eq!(skipped_where(275.0), None);
    }

    /// Five steps with this action. Four of them are gone after 50 ms.
    fn skipped_standing(action: Action) -> Option<Range<usize>> {
        let steps = vec![Instruction { oneshot: true, action }; 5];
        let asked_at = Instant::ORIGIN + Duration::from_secs(100);
        let mut path = PathProgress::new(steps, at(0.0, 0.0), asked_at);
        path.fed(5);
        let looked = Looked { asked_at, answered_at: asked_at + Duration::from_millis(50) };
        path.see(&Sample { list_length: Some(1), ..at(0.0, 0.0) }, false, looked);
        path.skipped()
    }

    #[test]
    fn waits_take_their_time_and_other_standing_steps_none() {
        let (source, condition) = (WaitSource::Time, WaitCondition::Off);
        let second = Wait { source, condition, limit: 1.0, unlimited: false };
        assert_eq!(skipped_standing(Action::Wait(second)), Some(0..4));
        assert_eq!(skipped_standing(Action::PathSpeed(PathSpeed { in_use: true, speed: Some(50.0) })), None);
    }

    fn seen(path: &mut PathProgress, samples: &[[f64; 2]]) -> usize {
        for [j1, j2] in samples {
            path.see(&at(*j1, *j2), false, just_now());
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

    /// The steps of another master are in the same list.
    #[test]
    fn an_arm_on_the_way_of_somebody_else_says_nothing_of_ours() {
        let mut path = path(&[[20.0, 0.0], [13.0, 0.0], [28.0, 0.0], [14.0, 0.0]]);
        assert_eq!(
            seen(&mut path, &[[12.0, 3.0], [20.0, 5.0], [25.0, 6.0], [27.0, 6.0], [22.0, 6.0], [16.0, 6.0]]),
            0
        );
        assert_eq!(seen(&mut path, &[[19.0, 0.1], [18.0, 0.0]]), 1);
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
        path.see(&Sample { list_length: Some(1), ..at(0.0, 0.0) }, false, just_now());
        assert_eq!(path.done, 2);
        path.see(&Sample { list_length: Some(3), ..at(0.0, 0.0) }, false, just_now());
        assert_eq!(path.done, 2, "what is done stays done");
    }

    #[test]
    fn an_empty_list_elsewhere_is_no_proof() {
        let mut path = path(&[[8.0, 0.0], [-8.0, 0.0]]);
        path.see(&Sample { list_length: Some(0), ..at(0.0, 0.0) }, true, just_now());
        assert_eq!(path.done, 0);
        path.see(&Sample { list_length: Some(0), ..at(-8.0, 0.0) }, true, just_now());
        assert_eq!(path.done, 2);
    }
}
