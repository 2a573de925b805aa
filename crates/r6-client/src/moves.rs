//! Motions: moves, outputs and waits in order, checked while they are put together.

pub(crate) mod step_error;

use std::ops::{Bound, RangeBounds};
use std::time::Duration;

use r6_proto::axis::AxisMask;
use r6_proto::io_point::{IoPoint, PointKind};
use r6_proto::message::instruction::{
    Action, BlendLevel, BoardOutput, CurveMove, Instruction, Manner, Move, Output, OutputKind, PathSpeed,
    StopOnSignal, Wait, WaitCondition, WaitSource, Workbench, WrongPoint,
};

pub use crate::moves::step_error::StepError;
use crate::path::encoded_bytes;
use crate::units::position::AxisUnits;
use crate::units::{AxisPosition, MillimetresPerSecond, Percent, Pose};

/// The largest number of steps of a motion: hours of moves, and some tens of megabytes.
pub const MAX_STEPS: usize = 100_000;

/// Moves, outputs and waits in order, for [`crate::Robot::run`].
///
/// Every step runs once, unless the motion repeats ([`Self::repeat`]). An error is kept until
/// [`Self::instructions`] returns it, so that a motion can be written as one chain. [`crate::Robot::run`]
/// sends nothing of a wrong motion.
///
/// ```
/// use std::time::Duration;
/// use r6_client::units::{AxisPosition, Degrees, Millimetres, Percent, Pose};
/// use r6_client::{IoPoint, Motion, WaitCondition};
///
/// let fast = Percent::new(50.0)?;
/// let slow = Percent::new(5.0)?;
/// let above = Pose::new([500.0, 0.0, 300.0].map(Millimetres), [180.0, 0.0, 0.0].map(Degrees));
/// let part = Pose::position([500.0, 0.0, 200.0].map(Millimetres));
/// let (gripper, closed): (IoPoint, IoPoint) = ("Y012".parse()?, "X014".parse()?);
/// let pick = Motion::new()
///     .axis_move(AxisPosition::degrees([0.0, 0.0, 0.0, 0.0, 45.0, 0.0]), fast)
///     .blend(3)
///     .linear_move(above, fast)
///     .linear_move(part, slow)
///     .set_output(gripper, true)
///     .wait_for(closed, WaitCondition::On, Some(Duration::from_secs(2)))
///     .linear_move(above, fast);
/// assert_eq!(pick.instructions()?.len(), 6);
///
/// let wrong = Motion::new().axis_move(AxisPosition::degrees([0.0]), fast).set_output(closed, true);
/// let error = wrong.instructions().unwrap_err();
/// assert_eq!(error.to_string(), "step 2: `point` has to be an output: Y, M or EUY");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    steps: Vec<Instruction>,
    /// The unit in which the axes of each step were given.
    units: Vec<AxisUnits>,
    /// Whether a path speed is set for the steps to come.
    path_speed: bool,
    /// Whether a path speed was in force where this part was cut from a motion. The part does not set it.
    cut_behind_path_speed: bool,
    /// The steps, counted from 0, that begin a frame of their own.
    frame_starts: Vec<usize>,
    wrong: Option<StepError>,
}

impl Motion {
    /// A motion without steps.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Moves the axes to this position; all arrive together (action 4).
    #[must_use]
    pub fn axis_move(self, to: AxisPosition, speed: Percent) -> Self {
        let manner = manner(to.mask(), Some(speed));
        let named = to.mask() != AxisMask::NONE;
        let step = Instruction {
            oneshot: true,
            action: Action::AxisMove(Move { target: to.coordinates(), manner }),
        };
        self.push(step, to.units()).check(named, "ckStatus", "a mask with one axis at least")
    }

    /// Moves the tool straight to a pose (action 10). 100 % are 2000 mm/s (reported, unit B).
    #[must_use]
    pub fn linear_move(self, to: Pose, speed: Percent) -> Self {
        let manner = manner(to.mask(), Some(speed));
        self.instruct(Action::LinearMove(Move { target: to.coordinates(), manner }))
    }

    /// Moves the tool straight to a pose at the speed that [`Self::path_speed`] set.
    #[must_use]
    pub fn linear_move_at_path_speed(self, to: Pose) -> Self {
        let set = self.path_speed;
        self.instruct(Action::LinearMove(Move { target: to.coordinates(), manner: manner(to.mask(), None) }))
            .check(set, "speed", "given, or set by a path speed before")
    }

    /// Moves the tool through a middle pose to an end (action 17).
    ///
    /// A controller was seen to accept a curve without a linear move before it, and not to go there
    /// (reported).
    #[must_use]
    pub fn curve_move(self, through: Pose, to: Pose, speed: Percent) -> Self {
        let manner = manner(to.mask().and(through.mask()), Some(speed));
        let same = to.mask() == through.mask();
        self.instruct(Action::CurveMove(CurveMove {
            middle: through.coordinates(),
            end: to.coordinates(),
            manner,
        }))
        .check(same, "ckStatus", "the same for both poses: give the turn of both, or of neither")
    }

    /// Rounds the corner after the last step, which has to be a move: 0 stops there, 9 rounds most.
    #[must_use]
    pub fn blend(self, level: u8) -> Self {
        const WANTED: &str = "a blend level from 0 to 9, after a move";
        match BlendLevel::new(level) {
            Some(level) => self.modify("smooth", WANTED, |manner| manner.smooth = Some(level)),
            None => self.check(false, "smooth", WANTED),
        }
    }

    /// Waits before the last step, which has to be a move: at most a day, in steps of 0.1 s (manual 6.1.1).
    /// Other times are refused.
    #[must_use]
    pub fn delay(self, time: Duration) -> Self {
        self.modify("delay", "a time to wait, after a move", |manner| manner.delay = Some(time.as_secs_f64()))
    }

    /// Makes the last step with this tool frame. The step has to be a move.
    #[must_use]
    pub fn tool(self, number: u32) -> Self {
        self.modify("tool", "a tool number, after a move", |manner| manner.tool = Some(number))
    }

    /// Makes the last step in this work frame. The step has to be a move.
    #[must_use]
    pub fn work_frame(self, number: u32) -> Self {
        self.modify("coord", "a number of a work frame, after a move", |manner| manner.coord = Some(number))
    }

    /// Sets the speed of later moves along a path that have no speed of their own (action 51).
    #[must_use]
    pub fn path_speed(self, speed: MillimetresPerSecond) -> Self {
        self.instruct(Action::PathSpeed(PathSpeed { in_use: true, speed: Some(speed.value()) }))
    }

    /// Sets an output of the first board (action 200): Y, M or EUY by its name on the pendant.
    #[must_use]
    pub fn set_output(self, point: IoPoint, on: bool) -> Self {
        self.named(OutputKind::of(point), |(kind, point)| {
            Action::Output(Output { kind, point, on, delay: 0.0 })
        })
    }

    /// Sets an output Y of the first board for a time, in steps of a millisecond, then sets it back
    /// (action 200, timed).
    #[must_use]
    pub fn pulse_output(self, point: IoPoint, on: bool, time: Duration) -> Self {
        let output = match OutputKind::of(point) {
            Ok((OutputKind::Y, number)) => Ok(number),
            Ok(_) => Err(WrongPoint::HasNoPulse(point)),
            Err(wrong) => Err(wrong),
        };
        let delay = time.as_secs_f64();
        self.named(output, |point| Action::Output(Output { kind: OutputKind::TimedY, point, on, delay }))
    }

    /// Sets many outputs of a board at once (action 204): Y or M, the first two boards of each.
    #[must_use]
    pub fn set_board(self, points: impl IntoIterator<Item = (IoPoint, bool)>) -> Self {
        self.named(BoardOutput::of(points), Action::BoardOutput)
    }

    /// Waits for a time, with the arm at rest (action 100): at most a day, in steps of 0.1 s (manual 6.1.3).
    /// Other times are refused.
    #[must_use]
    pub fn wait(self, time: Duration) -> Self {
        self.instruct(Action::Wait(Wait {
            source: WaitSource::Time,
            condition: WaitCondition::Off,
            limit: time.as_secs_f64(),
            unlimited: false,
        }))
    }

    /// Waits for a signal, with the arm at rest (action 100): at most for `limit`, in steps of 0.1 s, or for
    /// ever without a limit.
    #[must_use]
    pub fn wait_for(self, point: IoPoint, condition: WaitCondition, limit: Option<Duration>) -> Self {
        let (unlimited, limit) = (limit.is_none(), limit.unwrap_or_default().as_secs_f64());
        self.named(WaitSource::of(point), |source| Action::Wait(Wait { source, condition, limit, unlimited }))
    }

    /// From here on, lets an input, 0 to 31, stop the motion when it takes this state (action 52).
    #[must_use]
    pub fn stop_on_input(self, point: IoPoint, on: bool) -> Self {
        let input = match point {
            IoPoint { kind: PointKind::X, board: 0, point } => Ok(point),
            other => Err(WrongPoint::StopsNoMove(other)),
        };
        self.named(input, |input| Action::StopOnSignal(StopOnSignal { in_use: true, input, on }))
    }

    /// Changes the workbench (action 800).
    #[must_use]
    pub fn workbench(self, id: u32) -> Self {
        self.instruct(Action::Workbench(Workbench { id }))
    }

    /// Adds any other step. It has to be one-shot: a step that stays in the list ([`Self::repeat`],
    /// [`Self::of_list`]) never ends.
    #[must_use]
    pub fn instruction(self, instruction: Instruction) -> Self {
        let wanted = "1: a step that stays in the list never ends";
        self.push(instruction, AxisUnits::default()).check(instruction.oneshot, "oneshot", wanted)
    }

    /// A motion of these instructions unchanged: those that are not one-shot stay in the controller's list,
    /// as with [`Self::repeat`].
    #[must_use]
    pub fn of_list(instructions: impl IntoIterator<Item = Instruction>) -> Self {
        instructions.into_iter().fold(Self::new(), |motion, step| motion.push(step, AxisUnits::default()))
    }

    /// Makes every step so far stay in the controller's list (`oneshot` 0). After the last step the list
    /// starts over, until the arm is stopped or the list is cleared.
    ///
    /// Such a motion has to fit into the list as a whole ([`crate::RunOptions::room`]). It never ends with a
    /// [`crate::Done`]: its handle says why it no longer runs. It continues even if this program dies. An
    /// [`crate::Envelope`] also checks the step from the last target back to the first.
    #[must_use]
    pub fn repeat(mut self) -> Self {
        self.steps.iter_mut().for_each(|step| step.oneshot = false);
        self
    }

    /// Whether a step stays in the controller's list, so that the motion never ends without a stop.
    #[must_use]
    pub fn repeats(&self) -> bool {
        self.steps.iter().any(|step| !step.oneshot)
    }

    /// Makes the next step begin a frame of its own, even if it would fit into the one before.
    #[must_use]
    pub fn begin_frame(mut self) -> Self {
        self.frame_starts.push(self.steps.len());
        self
    }

    /// Appends the steps of another motion. Steps that stay in the list there stay here, too.
    #[must_use]
    pub fn extend(mut self, other: &Self) -> Self {
        let before = self.steps.len();
        self.cut_behind_path_speed |= other.cut_behind_path_speed;
        self.frame_starts.extend(other.frame_starts.iter().map(|start| before + start));
        let steps = other.steps.iter().zip(&other.units);
        let motion = steps.fold(self, |motion, (step, units)| motion.push(*step, *units));
        match other.wrong {
            Some(error) => motion.check(false, error.field, error.wanted),
            None => motion,
        }
    }

    /// Returns a part of the motion as a motion of its own. Steps are counted from 0: `motion.part(2..5)`.
    ///
    /// A path speed that was set before the part is not in it: a part that has a move at the path speed and
    /// does not set one is refused ([`StepError`]), because it would go at the speed of some earlier list. A
    /// motion with a mistake has it in each of its parts.
    #[must_use]
    pub fn part(&self, steps: impl RangeBounds<usize>) -> Self {
        let end = match steps.end_bound() {
            Bound::Included(last) => last.saturating_add(1),
            Bound::Excluded(end) => *end,
            Bound::Unbounded => usize::MAX,
        };
        let begin = match steps.start_bound() {
            Bound::Included(first) => *first,
            Bound::Excluded(before) => before.saturating_add(1),
            Bound::Unbounded => 0,
        };
        let (begin, end) = (begin.min(self.len()), end.min(self.len()));
        let kept = || self.steps.iter().zip(&self.units).take(end).skip(begin);
        let starts = self.frame_starts.iter().filter(|start| (begin..end).contains(*start));
        let before = path_speed_after(self.cut_behind_path_speed, self.steps.iter().take(begin));
        Self {
            steps: kept().map(|(step, _)| *step).collect(),
            units: kept().map(|(_, units)| *units).collect(),
            path_speed: path_speed_after(false, kept().map(|(step, _)| step)),
            cut_behind_path_speed: before,
            frame_starts: starts.map(|start| start - begin).collect(),
            wrong: self.wrong,
        }
    }

    /// How many steps there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether there is no step.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// The steps.
    ///
    /// # Errors
    /// [`StepError`]: the first thing that is wrong with them.
    pub fn instructions(&self) -> Result<&[Instruction], StepError> {
        match self.wrong.or_else(|| self.without_speed()) {
            Some(wrong) => Err(wrong),
            None => Ok(&self.steps),
        }
    }

    /// The first move of a part that would go at a path speed which the part does not set.
    fn without_speed(&self) -> Option<StepError> {
        if !self.cut_behind_path_speed {
            return None;
        }
        let mut set = false;
        (1..).zip(&self.steps).find_map(|(step, instruction)| {
            let speed = match &instruction.action {
                Action::PathSpeed(speed) => {
                    set = speed.in_use;
                    return None;
                }
                Action::LinearMove(step) => step.manner.speed,
                Action::CurveMove(curve) => curve.manner.speed,
                _ => return None,
            };
            let wanted = "given, or set by a path speed in the same part";
            (speed.is_none() && !set).then_some(StepError { step, field: "speed", wanted, nearest: None })
        })
    }

    /// The unit in which the axes of each step were given; as many as there are steps.
    pub(crate) fn units(&self) -> &[AxisUnits] {
        &self.units
    }

    /// The steps, counted from 0 and in order, that begin a frame of their own.
    pub(crate) fn frame_starts(&self) -> &[usize] {
        &self.frame_starts
    }

    /// Adds a step about a point that was named, or keeps why the instruction cannot have this point.
    fn named<P>(self, point: Result<P, WrongPoint>, step: impl FnOnce(P) -> Action) -> Self {
        match point {
            Ok(point) => self.instruct(step(point)),
            Err(wrong) => self.wrong_step("point", wrong.wanted()),
        }
    }

    /// Keeps what is wrong with the step that would have come next.
    fn wrong_step(mut self, field: &'static str, wanted: &'static str) -> Self {
        let step = self.steps.len() + 1;
        self.wrong.get_or_insert(StepError { step, field, wanted, nearest: None });
        self
    }

    fn instruct(self, action: Action) -> Self {
        self.push(Instruction { oneshot: true, action }, AxisUnits::default())
    }

    fn push(mut self, instruction: Instruction, units: AxisUnits) -> Self {
        if self.steps.len() >= MAX_STEPS {
            return self.check(false, "instructions", "100000 at most");
        }
        self.steps.push(instruction);
        self.units.push(units);
        if let Action::PathSpeed(speed) = instruction.action {
            self.path_speed = speed.in_use;
        }
        self.encoded()
    }

    /// Records an error in the last step, unless an earlier one is recorded.
    fn check(mut self, right: bool, field: &'static str, wanted: &'static str) -> Self {
        if !right {
            let step = self.steps.len();
            self.wrong.get_or_insert(StepError { step, field, wanted, nearest: None });
        }
        self
    }

    /// Records why the last step cannot be sent, if it cannot, unless an earlier error is recorded.
    fn encoded(mut self) -> Self {
        if let Some(Err(error)) = self.steps.last().map(encoded_bytes) {
            self.wrong.get_or_insert(StepError::of(self.steps.len(), &error));
        }
        self
    }

    /// Changes how the last step moves; records an error if it is not a move.
    fn modify(mut self, field: &'static str, wanted: &'static str, change: impl FnOnce(&mut Manner)) -> Self {
        let manner = match self.steps.last_mut().map(|step| &mut step.action) {
            Some(Action::AxisMove(step) | Action::LinearMove(step)) => Some(&mut step.manner),
            Some(Action::CurveMove(curve)) => Some(&mut curve.manner),
            Some(
                Action::PathSpeed(_)
                | Action::StopOnSignal(_)
                | Action::Wait(_)
                | Action::Output(_)
                | Action::BoardOutput(_)
                | Action::Workbench(_)
                | Action::Unknown(_),
            )
            | None => None,
        };
        match manner {
            Some(manner) => {
                change(manner);
                self.encoded()
            }
            None => self.check(false, field, wanted),
        }
    }
}

/// Collects instructions into a motion.
impl FromIterator<Instruction> for Motion {
    fn from_iter<I: IntoIterator<Item = Instruction>>(instructions: I) -> Self {
        instructions.into_iter().fold(Self::new(), Self::instruction)
    }
}

/// Whether a path speed is in force after these steps.
fn path_speed_after<'s>(before: bool, steps: impl Iterator<Item = &'s Instruction>) -> bool {
    steps.fold(before, |set, step| match step.action {
        Action::PathSpeed(speed) => speed.in_use,
        _ => set,
    })
}

fn manner(mask: AxisMask, speed: Option<Percent>) -> Manner {
    Manner { mask: Some(mask), speed: speed.map(Percent::value), ..Manner::default() }
}

#[cfg(test)]
mod tests {
    use r6_proto::message::instruction::Coordinates;

    use super::*;
    use crate::units::{Degrees, Millimetres};

    fn slow() -> Percent {
        Percent::new(5.0).unwrap()
    }

    fn step() -> Motion {
        Motion::new().axis_move(AxisPosition::degrees([1.0; 6]), slow())
    }

    fn wrong(motion: &Motion) -> (usize, &'static str) {
        let error = motion.instructions().unwrap_err();
        (error.step, error.field)
    }

    #[test]
    fn the_first_mistake_is_told_with_its_step_and_field() {
        let place = Pose::position([Millimetres(1.0); 3]);
        let pose = Pose::new([Millimetres(1.0); 3], [Degrees(0.0); 3]);
        let [kept, m, y, x] = ["M3.010", "M011", "Y011", "X1.010"].map(|name| name.parse().unwrap());
        let day = Duration::from_secs(86_401);
        for (motion, expected) in [
            (step().blend(10), (1, "smooth")),
            (Motion::new().blend(1), (0, "smooth")),
            (step().wait(Duration::from_secs(1)).blend(1), (2, "smooth")),
            (step().delay(day), (1, "delay")),
            (step().delay(Duration::from_millis(1250)), (1, "delay")),
            (step().wait(Duration::from_millis(30)), (2, "limit")),
            (step().pulse_output(y, true, Duration::from_micros(500)), (2, "delay")),
            (step().pulse_output(m, true, Duration::from_secs(1)), (2, "point")),
            (step().wait(day), (2, "limit")),
            (step().wait_for(kept, WaitCondition::On, None), (2, "point")),
            (step().wait_for(y, WaitCondition::On, None), (2, "point")),
            (step().set_output(x, true).blend(10), (2, "point")),
            (step().set_board([(y, true), (m, true)]), (2, "point")),
            (step().stop_on_input(x, true), (2, "point")),
            (step().linear_move_at_path_speed(pose), (2, "speed")),
            (step().curve_move(place, pose, slow()), (2, "ckStatus")),
            (Motion::new().axis_move(AxisPosition::none(), slow()), (1, "ckStatus")),
            (Motion::new().axis_move(AxisPosition::degrees([f64::NAN]), slow()), (1, "m0")),
        ] {
            assert_eq!(wrong(&motion), expected, "{motion:?}");
        }
    }

    #[test]
    fn what_never_ends_is_no_step_of_a_motion() {
        let again = Instruction { oneshot: false, ..step().steps[0] };
        assert_eq!(wrong(&Motion::from_iter([again])), (1, "oneshot"));
        assert!(Motion::of_list([again]).repeats(), "unless it is asked for");
    }

    #[test]
    fn a_motion_repeats_as_a_whole_and_keeps_its_frames_behind_another() {
        let once = step().extend(&step());
        assert!(!once.repeats());
        let round = once.clone().repeat();
        assert!(round.instructions().unwrap().iter().all(|step| !step.oneshot));
        let both = once.begin_frame().extend(&step().begin_frame().extend(&step()));
        assert_eq!((both.len(), both.frame_starts()), (4, &[2, 3][..]));
        assert!(step().extend(&round).repeats());
    }

    fn curve_at_path_speed() -> Action {
        let place = Coordinates::from_slice(&[1.0; 6]);
        Action::CurveMove(CurveMove { middle: place, end: place, manner: Manner::default() })
    }

    #[test]
    fn a_part_has_its_steps_as_they_were() {
        let pose = Pose::position([Millimetres(1.0); 3]);
        let speed = MillimetresPerSecond::new(100).unwrap();
        let whole = step().begin_frame().path_speed(speed).linear_move_at_path_speed(pose).blend(3);
        assert_eq!(whole.part(..), whole);
        assert!(whole.part(2..2).is_empty() && !whole.part(2..).is_empty());
        let last = whole.part(2..);
        assert_eq!((last.len(), last.frame_starts()), (1, &[][..]));
        assert_eq!(wrong(&last), (1, "speed"), "it would go at the speed of an earlier list");
        assert_eq!(wrong(&whole.part(2..2).linear_move_at_path_speed(pose)), (1, "speed"));
        let of_curve = Motion::of_list([Instruction { action: curve_at_path_speed(), ..whole.steps[0] }]);
        let behind_speed = Motion::new().path_speed(speed).extend(&of_curve);
        assert_eq!(behind_speed.instructions().unwrap().len(), 2);
        assert_eq!(wrong(&behind_speed.part(1..)), (1, "speed"), "curves, too");
        let again = Motion::new().path_speed(speed).extend(&last);
        assert_eq!(again.linear_move_at_path_speed(pose).instructions().unwrap().len(), 3);
        assert_eq!(whole.part(1..).part(..).instructions().unwrap().len(), 2);
        assert_eq!(whole.part(1..=1).frame_starts(), [0]);
        assert_eq!(whole.part(0..1).instructions().unwrap(), step().instructions().unwrap());
        let (late, early) = (2, 1);
        assert!(whole.part(7..9).is_empty() && whole.part(late..early).is_empty());
        assert!(step().blend(10).part(0..0).instructions().is_err(), "a wrong motion has no right part");
    }

    #[test]
    fn a_path_speed_serves_the_moves_after_it() {
        let pose = Pose::position([Millimetres(1.0); 3]);
        let speed = MillimetresPerSecond::new(200).unwrap();
        let motion = Motion::new().path_speed(speed).linear_move_at_path_speed(pose);
        let steps = motion.instructions().unwrap();
        let Action::LinearMove(last) = steps[1].action else { panic!("{steps:?}") };
        assert_eq!((last.manner.speed, last.manner.mask), (None, Some(AxisMask::POSITION)));
    }

    #[test]
    fn a_step_too_many_is_refused() {
        let many = std::iter::repeat_n(step().steps[0], MAX_STEPS + 1).collect::<Motion>();
        assert_eq!(wrong(&many).1, "instructions");
        assert_eq!(many.len(), MAX_STEPS);
    }
}
