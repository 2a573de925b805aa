//! The instruction list, step by step.

use std::time::Duration;

use r6_proto::alarm::AlarmCode;
use r6_proto::message::instruction::{Output, OutputKind, PathSpeed, Wait, WaitCondition, WaitSource};
use r6_proto::message::{Action, Instruction};
use r6_proto::time::Instant;

use super::Machine;
use super::halt::AfterHalt;
use super::order::{EarlierSteps, path_speed, workbench};
use crate::event::{AlarmCause, Detail, Event, ModeReason, Reason};
use crate::instruction_list::After;
use crate::io::OutputPoint;
use crate::program::Photo;
use r6_motion::{Blend, LimitSide, Movement, PlanError};
use r6_proto::{AxisIndex, OperationMode};

/// The shortest duration of a pass, so that a list of steps that take no time cannot run endlessly often at
/// one instant. Chosen: about the scan of a controller's program.
pub const SHORTEST_PASS: Duration = Duration::from_millis(1);

/// The longest activity that is timed, in seconds: some thirty years, for a very slow move.
const LONGEST_ACTIVITY: f64 = 1e9;

/// What the machine is doing.
#[derive(Clone, Debug)]
pub enum Activity {
    /// Nothing: there is no step to run, or no program runs.
    Idle,
    /// A move.
    Moving(Run),
    /// A move comes to rest before its end.
    Halting(Run, AfterHalt),
    /// A move that rests before its end, and can continue from there.
    Paused(Run),
    /// A wait or a delay that a pause interrupted: the activity, and how much of its time is left.
    Suspended(Box<Activity>, Option<Duration>),
    /// A wait, with its end unless it has no limit.
    Waiting {
        /// What it waits for.
        wait: Wait,
        /// The level when it was last checked.
        level: Option<bool>,
        /// When it runs out.
        until: Option<Instant>,
    },
    /// An output that is set after a delay.
    Delaying {
        /// The output.
        output: Output,
        /// When it is set.
        until: Instant,
    },
    /// The program waits for something other than an input or M point.
    Awaiting {
        /// What it waits for.
        what: Awaited,
        /// When it runs out.
        until: Option<Instant>,
    },
    /// A rest after a pass that took no time, or at a point where the arm dwells. The next step begins after
    /// it.
    Resting {
        /// When it ends.
        until: Instant,
    },
}

/// What a program can wait for, besides inputs and M points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Awaited {
    /// The answer to a photo request, and how many tries are left, this one included.
    Photo(Photo, u32),
    /// A point of a camera.
    Point,
    /// A write to registers.
    Registers,
}

/// A movement that began at a point in time.
#[derive(Clone, Debug)]
pub struct Run {
    pub(crate) movement: Box<Movement>,
    started: Instant,
    /// The blending at the corner after its last move.
    pub(super) blend: Blend,
    /// How many steps after the current one the step of its second move comes; 0 while there is no second
    /// move.
    pub(super) joined: usize,
    /// The corner has been reached: an instruction that is appended later joins at once.
    pub(super) at_corner: bool,
}

impl Run {
    pub(super) fn new(movement: Movement, started: Instant, blend: Blend) -> Self {
        Self { movement: Box::new(movement), started, blend, joined: 0, at_corner: false }
    }

    /// The same run with a movement that replaces its own.
    pub(super) fn by(self, movement: Movement, started: Instant) -> Self {
        Self { movement: Box::new(movement), started, ..self }
    }

    /// The same run with a second move, of the step `ahead` steps later.
    pub(super) fn joined_by(&self, movement: Movement, ahead: usize, blend: Blend) -> Self {
        Self { movement: Box::new(movement), joined: ahead, blend, ..self.clone() }
    }

    fn after(&self, time: f64) -> Instant {
        self.started + Duration::from_secs_f64(time.clamp(0.0, LONGEST_ACTIVITY))
    }

    /// When its next event is: the corner, the end of the first of two moves, or the end.
    fn next_event(&self) -> Instant {
        let first_ends = self.movement.first_ends();
        let corner = if self.at_corner { None } else { self.movement.corner(self.blend) };
        let end = self.after(self.movement.duration());
        [first_ends, corner].into_iter().flatten().map(|time| self.after(time)).fold(end, Instant::min)
    }

    pub(super) fn ends_at(&self) -> Instant {
        self.after(self.movement.duration())
    }

    /// Whether this time of the movement is over.
    pub(super) fn is_past(&self, time: f64, now: Instant) -> bool {
        self.after(time) <= now
    }

    /// The time of the movement at `now`, in seconds.
    pub(crate) fn seconds(&self, now: Instant) -> f64 {
        now.since(self.started).as_secs_f64()
    }
}

impl Activity {
    /// When its next event is.
    pub(crate) fn next_event(&self) -> Option<Instant> {
        match self {
            Self::Idle | Self::Paused(_) | Self::Suspended(..) => None,
            Self::Moving(run) => Some(run.next_event()),
            Self::Halting(run, _) => Some(run.ends_at()),
            Self::Waiting { until, .. } | Self::Awaiting { until, .. } => *until,
            Self::Delaying { until, .. } | Self::Resting { until } => Some(*until),
        }
    }

    /// The movement under way.
    pub(crate) fn run(&self) -> Option<&Run> {
        match self {
            Self::Moving(run) | Self::Halting(run, _) => Some(run),
            Self::Idle
            | Self::Paused(_)
            | Self::Suspended(..)
            | Self::Waiting { .. }
            | Self::Awaiting { .. }
            | Self::Delaying { .. }
            | Self::Resting { .. } => None,
        }
    }
}

impl Machine {
    /// Sets the fault that the list starts no instruction. A step under way continues.
    pub(crate) fn freeze_list(&mut self, frozen: bool) {
        if std::mem::replace(&mut self.faults.list_frozen, frozen) && !frozen {
            self.run_list();
        }
    }

    /// Sets the fault that the arm rests at each point while more instructions wait, and for how long.
    pub(crate) fn dwell_at_points(&mut self, rest: Option<Duration>) {
        self.faults.dwell = rest;
    }

    /// Rests at the end of a move, if that fault is in force and more instructions wait.
    fn dwell_here(&mut self) {
        let waits = matches!(self.activity, Activity::Idle) && self.runs() && self.is_remote();
        let Some(rest) = self.faults.dwell.filter(|_| waits && !self.list.is_empty()) else { return };
        self.note(Event::Dwells { rest });
        self.activity = Activity::Resting { until: self.now + rest };
    }

    /// Whether a program runs.
    pub(crate) fn runs(&self) -> bool {
        self.mode.may_run() && !self.alarm.is_raised()
    }

    /// Whether remote instructions are executed: a program runs, and is at a step that waits for them.
    pub(crate) fn waits_for_remote(&self) -> bool {
        self.runs() && self.is_remote()
    }

    /// Runs steps until one takes time, or none are left.
    pub(crate) fn run_list(&mut self) {
        if self.faults.list_frozen && self.is_remote() {
            return;
        }
        self.join_next();
        while self.runs() && matches!(self.activity, Activity::Idle) {
            self.begin_anew_if_asked();
            let Some(step) = self.steps().current().copied() else {
                if self.next_program_step() {
                    continue;
                }
                return;
            };
            if self.global_speed <= 0.0 && is_motion(&step) {
                // It begins once the global speed is above 0 again.
                return;
            }
            if self.cycle.started.is_none() && self.is_remote() {
                self.cycle.started = Some(self.now);
                self.cycle.pass_started = self.now;
            }
            if let Err((alarm, why)) = self.begin(&step) {
                let step = Some(self.place_of_instruction(&step));
                self.raise(alarm, AlarmCause::Step { step, why });
                return;
            }
            if matches!(self.activity, Activity::Idle) {
                self.finish_step();
            }
        }
    }

    pub(super) fn close_cycle(&mut self) {
        if let Some(started) = self.cycle.started.take() {
            self.cycle.count += 1;
            self.cycle.last = self.now.since(started);
        }
    }

    pub(crate) fn finish_step(&mut self) {
        self.activity = Activity::Idle;
        let stepped = self.mode == OperationMode::SingleStep;
        match self.finish_one() {
            After::Next => {}
            After::Empty if self.is_remote() => self.remote_is_over(),
            After::Empty => {}
            After::PassOver => {
                self.close_cycle();
                if self.cycle.last_pass {
                    self.leave_running(ModeReason::ProgramEnded);
                } else if self.now.since(self.cycle.pass_started) < SHORTEST_PASS {
                    self.activity = Activity::Resting { until: self.cycle.pass_started + SHORTEST_PASS };
                }
            }
        }
        if stepped {
            self.leave_running(ModeReason::SingleStep);
        }
    }

    /// Ends an activity whose time is over.
    pub(crate) fn finish_activity(&mut self) {
        let activity = std::mem::replace(&mut self.activity, Activity::Idle);
        match activity {
            Activity::Idle => {}
            Activity::Paused(_) | Activity::Suspended(..) => self.activity = activity,
            Activity::Moving(run) if run.ends_at() > self.now => {
                self.activity = Activity::Moving(self.pass_corner(run));
            }
            Activity::Moving(run) => {
                self.finish_joined(&run);
                self.axes = run.movement.state_at(run.movement.duration()).axes;
                self.finish_step();
                self.dwell_here();
            }
            Activity::Halting(run, after) => self.finish_halt(run, after),
            Activity::Waiting { wait, .. } => match wait.source {
                WaitSource::Time => self.finish_step(),
                WaitSource::Input { .. } | WaitSource::M { .. } | WaitSource::Eu { .. }
                    if self.wait_in_vain() => {}
                source @ (WaitSource::Input { .. } | WaitSource::M { .. } | WaitSource::Eu { .. }) => {
                    let alarm = AlarmCode::of_wait(source.point());
                    let meaning = Detail::of(alarm.decode().text);
                    self.raise(alarm, AlarmCause::WaitedTooLong { limit: wait.limit, meaning });
                }
            },
            Activity::Delaying { output, .. } => {
                self.write_output(&output);
                self.finish_step();
            }
            Activity::Awaiting { what, .. } => self.awaited_in_vain(&what),
            Activity::Resting { .. } => {}
        }
        self.run_list();
    }

    /// Begins a step. The machine stays idle if the step took no time.
    pub(super) fn begin(&mut self, step: &Instruction) -> Result<(), (AlarmCode, Reason)> {
        match &step.action {
            Action::CurveMove(_) if self.is_lone_curve(&step.action) => {
                self.tell_lone_curve(step);
                Ok(())
            }
            Action::AxisMove(_) | Action::LinearMove(_) | Action::CurveMove(_) => {
                let told = EarlierSteps { path_speed: self.path_speed, bench: self.frames.bench };
                let Some(order) = self.order(&step.action, &self.axes, told)? else { return Ok(()) };
                let movement = Movement::plan(&self.model, &self.axes, &order.step, &order.conditions)
                    .map_err(plan_failed)?;
                self.move_begins(&step.action);
                self.activity = Activity::Moving(Run::new(movement, self.now, order.blend));
                self.check_signal_stop();
                Ok(())
            }
            Action::PathSpeed(speed) => self.set_path_speed(speed),
            Action::StopOnSignal(stop) => {
                self.watch_signal(stop);
                Ok(())
            }
            Action::Wait(wait) => {
                self.begin_wait(wait);
                Ok(())
            }
            Action::Output(output) => {
                self.begin_output(output);
                Ok(())
            }
            Action::BoardOutput(output) => {
                self.io.set_board(output);
                self.io_changed();
                Ok(())
            }
            Action::Workbench(bench) => {
                self.frames.bench = workbench(*bench)?;
                Ok(())
            }
            Action::Unknown(_) => Err((AlarmCode::PROGRAM, "unknown action".into())),
        }
    }

    fn set_path_speed(&mut self, speed: &PathSpeed) -> Result<(), (AlarmCode, Reason)> {
        self.path_speed = path_speed(speed)?;
        Ok(())
    }

    fn begin_wait(&mut self, wait: &Wait) {
        let level = self.io.level(wait.source);
        if level.is_some_and(|level| fulfilled_at_once(wait.condition, level)) {
            return;
        }
        let timed = !wait.unlimited || wait.source == WaitSource::Time;
        let until = timed.then(|| self.now + duration(wait.limit));
        self.activity = Activity::Waiting { wait: *wait, level, until };
    }

    fn begin_output(&mut self, output: &Output) {
        let point = output_point(output);
        match output.kind {
            OutputKind::TimedY => {
                self.io.set(point, output.on);
                self.pulse(self.now + duration(output.delay), point, !output.on);
                self.io_changed();
            }
            OutputKind::Y | OutputKind::M | OutputKind::Euy if output.delay > 0.0 => {
                self.activity =
                    Activity::Delaying { output: *output, until: self.now + duration(output.delay) };
            }
            OutputKind::Y | OutputKind::M | OutputKind::Euy => self.write_output(output),
        }
    }

    fn write_output(&mut self, output: &Output) {
        self.io.set(output_point(output), output.on);
        self.io_changed();
    }

    /// Reacts to a changed point: a step may wait for it, or a move may stop at it.
    pub(crate) fn io_changed(&mut self) {
        if let Activity::Waiting { wait, level, .. } = &mut self.activity {
            let present = self.io.level(wait.source);
            let before = std::mem::replace(level, present);
            if present.is_some_and(|present| fulfilled(wait.condition, before.unwrap_or(present), present)) {
                self.finish_step();
                self.run_list();
            }
        }
        self.check_signal_stop();
    }

    /// Stops the program, without an alarm.
    pub(crate) fn leave_running(&mut self, why: ModeReason) {
        self.cycle.last_pass = false;
        if self.mode.may_run() {
            self.mode = OperationMode::Auto;
            self.note(Event::ModeChanged { mode: self.mode, why });
        }
    }
}

pub(super) fn is_motion(step: &Instruction) -> bool {
    match step.action {
        Action::AxisMove(_) | Action::LinearMove(_) | Action::CurveMove(_) => true,
        Action::PathSpeed(_)
        | Action::StopOnSignal(_)
        | Action::Wait(_)
        | Action::Output(_)
        | Action::BoardOutput(_)
        | Action::Workbench(_)
        | Action::Unknown(_) => false,
    }
}

/// The alarm of a move that cannot be planned (135 for J6 and 219 for a fractional speed were reported from
/// real units).
pub(super) fn plan_failed(error: PlanError) -> (AlarmCode, Reason) {
    let alarm = match error {
        PlanError::OutsideLimits { axis, side } => {
            let limit = match side {
                LimitSide::Plus => AlarmCode::positive_limit,
                LimitSide::Minus => AlarmCode::negative_limit,
            };
            AxisIndex::new(axis.number()).map_or(AlarmCode::ROUTE, limit)
        }
        PlanError::Unreachable
        | PlanError::Singular { .. }
        | PlanError::CurvePoints
        | PlanError::NotFinite => AlarmCode::ROUTE,
        PlanError::Speed => AlarmCode::PATH_SPEED,
    };
    (alarm, Reason::Plan(error))
}

/// A duration from seconds.
pub(super) fn duration(time: f64) -> Duration {
    Duration::from_secs_f64(time.clamp(0.0, LONGEST_ACTIVITY))
}

fn output_point(output: &Output) -> OutputPoint {
    match output.kind {
        OutputKind::Y | OutputKind::TimedY => OutputPoint::Y(0, output.point),
        OutputKind::M => OutputPoint::M(0, output.point),
        OutputKind::Euy => OutputPoint::Eu(output.point),
    }
    .on_first_boards()
}

pub(super) fn fulfilled_at_once(condition: WaitCondition, level: bool) -> bool {
    match condition {
        WaitCondition::On => level,
        WaitCondition::Off => !level,
        WaitCondition::RisingEdge | WaitCondition::FallingEdge => false,
    }
}

fn fulfilled(condition: WaitCondition, before: bool, now: bool) -> bool {
    match condition {
        WaitCondition::On | WaitCondition::Off => fulfilled_at_once(condition, now),
        WaitCondition::RisingEdge => !before && now,
        WaitCondition::FallingEdge => before && !now,
    }
}
