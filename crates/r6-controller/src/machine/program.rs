//! The taught program, step by step: where it stands, and what its next step does.
//!
//! Steps that AddRCC could also send become instructions of the program's own list. They run like those of a
//! PC, with look-ahead and blending. The others are carried out here.

mod awaiting;
mod places;

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use r6_proto::alarm::AlarmCode;
use r6_proto::message::instruction::{Coordinates, Output, OutputKind};
use r6_proto::message::{Action, Instruction};
use r6_proto::time::Instant;
use r6_proto::{OperationMode, RegisterIndex};

use super::Machine;
use super::execution::{Activity, SHORTEST_PASS};
use crate::event::{AlarmCause, AtStep, Detail, ModeReason, Reason};
use crate::instruction_list::{After, InstructionList};
use crate::io::OutputPoint;
use crate::profile::IdleSingleCycle;
use crate::program::{Change, Condition, Program, Step};
use crate::saved::MAX_COUNTERS;
use crate::snapshot::ProgramStep;

/// How deep programs may call each other.
pub const MAX_CALLS: usize = 16;

/// A step of a program.
#[derive(Clone, Debug)]
struct Place {
    program: Arc<Program>,
    step: usize,
}

/// Where the program stands.
#[derive(Clone, Debug, Default)]
pub struct ProgramRun {
    /// The call stack of programs, the innermost last, each with its current step.
    calls: Vec<Place>,
    /// The program's own instructions.
    own: InstructionList,
    /// The place of each of these instructions in its program.
    places: VecDeque<Place>,
    /// It waits for remote commands, or executes them.
    remote: bool,
    /// Remote commands were executed since it began to wait for them.
    remote_ran: bool,
    /// It begins at its first step as soon as nothing is under way.
    begin_anew: bool,
    /// It was paused: the next start continues.
    paused: bool,
    /// The position of the point that was taken last.
    point: Option<Coordinates>,
    /// Registers written since a step last waited for them.
    written: BTreeSet<RegisterIndex>,
    /// The deadline of a waiting step, while that step is checked again.
    awaiting: Option<Option<Instant>>,
    /// When it last jumped back or began again. This keeps it from doing so endlessly often at one instant.
    last_round: Option<Instant>,
}

impl ProgramRun {
    /// A run that is at the first step of a program.
    pub(super) fn of(program: Arc<Program>) -> Self {
        Self { calls: vec![Place { program, step: 0 }], ..Self::default() }
    }

    /// The current program and step.
    fn place(&self) -> Option<&Place> {
        self.calls.last()
    }

    fn step(&self) -> Option<&Step> {
        self.place().and_then(|place| place.program.steps().get(place.step))
    }

    fn go_to(&mut self, step: usize) {
        if let Some(place) = self.calls.last_mut() {
            place.step = step;
        }
    }

    fn next(&mut self) {
        if let Some(place) = self.calls.last_mut() {
            place.step += 1;
        }
    }

    /// Goes back to the first step of the outermost program.
    fn restart(&mut self) {
        self.calls.truncate(1);
        self.go_to(0);
        self.own.clear();
        self.places.clear();
        self.remote = false;
        self.begin_anew = false;
        self.point = None;
        self.written.clear();
        self.awaiting = None;
        self.last_round = None;
    }
}

impl Machine {
    /// The instructions that are being executed: the remote list, or the program's own.
    pub(super) fn steps(&self) -> &InstructionList {
        if self.program.remote { &self.list } else { &self.program.own }
    }

    /// Ends the current instruction.
    pub(super) fn finish_one(&mut self) -> After {
        if self.program.remote {
            return self.list.finish_current();
        }
        self.program.places.pop_front();
        self.program.own.finish_current()
    }

    /// Whether the program is at a step that waits for remote commands, or executes them.
    pub(crate) fn is_remote(&self) -> bool {
        self.program.remote
    }

    /// Notes that remote commands were executed and none are left.
    pub(super) fn remote_is_over(&mut self) {
        self.program.remote_ran = true;
        self.end_signal_watch_of_list();
    }

    /// Lets the program begin again from its first step once nothing is under way.
    pub(super) fn begin_anew(&mut self) {
        self.program.begin_anew = true;
        self.program.paused = false;
    }

    pub(super) fn program_is_paused(&mut self) {
        self.program.paused = true;
    }

    /// Begins again from the first step, unless the program was paused.
    pub(super) fn restart_program(&mut self) {
        if !std::mem::take(&mut self.program.paused) {
            self.begin_anew();
        }
    }

    pub(super) fn begin_anew_if_asked(&mut self) {
        if self.program.begin_anew {
            self.program.restart();
            self.begin_list_run();
        }
    }

    /// Uses another program, from its first step.
    pub(super) fn use_program(&mut self, program: Arc<Program>) {
        for (number, stack) in program.stacks() {
            if !self.stacks.contains_key(number) {
                self.stacks.insert(*number, *stack);
            }
        }
        for (number, counter) in program.counters() {
            if !self.counters.contains_key(number) && self.counters.len() < MAX_COUNTERS {
                self.counters.insert(*number, *counter);
            }
        }
        self.program = ProgramRun::of(program);
    }

    /// Carries out program steps until one takes time, or an instruction is ready to be executed. Returns
    /// false if there is nothing to do now.
    pub(super) fn next_program_step(&mut self) -> bool {
        if self.program.remote {
            return self.next_after_remote();
        }
        let Some(place) = self.program.place().cloned() else { return false };
        let Some(step) = place.program.steps().get(place.step) else {
            return self.end_of_program(&place);
        };
        let own = self.program.own.len();
        match self.carry_out_step(step) {
            // A single step ends with a step that is not an instruction and takes no time.
            Ok(())
                if self.mode == OperationMode::SingleStep
                    && self.program.own.len() == own
                    && !self.program.remote
                    && !matches!(self.activity, Activity::Awaiting { .. }) =>
            {
                self.leave_running(ModeReason::SingleStep);
                false
            }
            Ok(()) => true,
            Err((alarm, why)) => {
                self.raise(alarm, AlarmCause::Step { step: Some(place_of(&place)), why });
                false
            }
        }
    }

    /// Continues after the remote list is empty.
    fn next_after_remote(&mut self) -> bool {
        if self.program.remote_ran {
            self.program.remote = false;
            self.program.next();
            return true;
        }
        self.program.last_round = None;
        if self.cycle.last_pass && !self.awaits_list_of_single_cycle() {
            self.leave_running(ModeReason::ProgramIsEmpty);
        } else if self.mode == OperationMode::SingleStep {
            self.leave_running(ModeReason::SingleStepWithoutStep);
        }
        false
    }

    /// Whether a single cycle has to run a list first.
    fn awaits_list_of_single_cycle(&self) -> bool {
        self.mode == OperationMode::SingleCycle
            && match self.profile.idle_single_cycle {
                IdleSingleCycle::Wait => true,
                IdleSingleCycle::End => false,
            }
    }

    /// Ends a program after its last step: returns to the calling program, or ends the cycle.
    fn end_of_program(&mut self, place: &Place) -> bool {
        if self.program.calls.len() > 1 {
            self.program.calls.pop();
            self.program.next();
            return true;
        }
        // A program without steps never does anything.
        !place.program.steps().is_empty() && self.end_of_cycle()
    }

    fn end_of_cycle(&mut self) -> bool {
        self.close_cycle();
        self.program.calls.truncate(1);
        self.program.go_to(0);
        if self.cycle.last_pass {
            self.leave_running(ModeReason::ProgramEnded);
            return false;
        }
        self.another_round();
        true
    }

    /// Begins another round of the program, but not twice at one instant.
    fn another_round(&mut self) {
        let mut begins = self.now;
        if self.program.last_round == Some(self.now) {
            begins = self.now + SHORTEST_PASS;
            self.activity = Activity::Resting { until: begins };
        }
        self.program.last_round = Some(begins);
    }

    fn carry_out_step(&mut self, step: &Step) -> Result<(), (AlarmCode, Reason)> {
        if !matches!(
            step,
            Step::Wait { .. }
                | Step::WaitForRegisters { .. }
                | Step::Remote
                | Step::Label
                | Step::Jump(_)
                | Step::If { .. }
        ) && !matches!(step, Step::Instruction(Action::Wait(_)))
        {
            self.begin_cycle();
        }
        match step {
            Step::Instruction(_)
            | Step::MoveToRegisters { .. }
            | Step::MoveToPoint { .. }
            | Step::MoveToStack { .. } => {
                if let Some(action) = self.instruction_of(step)? {
                    self.append_own(action);
                }
            }
            Step::Wait { wait, skip_in_single_cycle, .. } => {
                if *skip_in_single_cycle && self.mode == OperationMode::SingleCycle {
                    self.program.next();
                } else {
                    self.append_own(Action::Wait(*wait));
                }
            }
            Step::TakePoint { camera, model, limit, or_else } => {
                self.take_point((*camera, *model), *limit, *or_else);
            }
            Step::WaitForRegisters { first, count, limit } => self.wait_for_registers(*first, *count, *limit),
            Step::Photo(photo) => self.ask_for_photo(photo, photo.tries),
            Step::Set { point, on } => {
                self.program.next();
                if let Some(point) = OutputPoint::named(*point) {
                    self.io.set(point, *on);
                }
                self.io_changed();
            }
            Step::Alarm { number } => {
                self.program.next();
                return Err((*number, Reason::ByProgram));
            }
            Step::Tool(number) => {
                self.frames.tool = *number;
                self.program.next();
            }
            Step::Counter { id, change } => {
                let counter = self.counters.get_mut(id);
                let counter = counter.ok_or((AlarmCode::NO_COUNTER, Reason::NoCounter(*id)))?;
                counter.current = changed(counter.current, *change);
                self.program.next();
            }
            Step::Register { register, change } => {
                let value = self.registers.values.get(register).copied().unwrap_or(0);
                self.registers.values.insert(*register, changed(value, *change));
                self.program.next();
            }
            Step::Remote => {
                self.program.remote = true;
                self.program.remote_ran = false;
            }
            Step::Label => self.program.next(),
            Step::Jump(to) => self.go_on_at(*to),
            Step::If { condition, to } => {
                if self.holds(*condition) {
                    self.go_on_at(*to)
                } else {
                    self.program.next()
                }
            }
            Step::Call(name) => self.call(name)?,
            Step::Return => {
                let end = self.program.place().map_or(0, |place| place.program.steps().len());
                self.program.go_to(end);
            }
            Step::End => {
                self.end_of_cycle();
            }
        }
        Ok(())
    }

    fn begin_cycle(&mut self) {
        if self.cycle.started.is_none() {
            self.cycle.started = Some(self.now);
        }
    }

    /// Appends an instruction for the current step, and goes to the next step.
    fn append_own(&mut self, action: Action) {
        let Some(place) = self.program.place().cloned() else { return };
        if self.program.own.append(&[Instruction { oneshot: true, action }]).is_ok() {
            self.program.places.push_back(place);
        }
        self.program.next();
    }

    /// Fetches the next step while the arm still moves, if it is a move or another step that takes no time.
    pub(super) fn fetch_ahead(&mut self) {
        if self.program.remote {
            return;
        }
        while matches!(self.program.step(), Some(Step::Label)) {
            self.program.next();
        }
        let Some(step) = self.program.step().cloned() else { return };
        let fetched = match &step {
            Step::Instruction(Action::Wait(_) | Action::Unknown(_)) => return,
            Step::Instruction(Action::Output(Output { kind, delay, .. }))
                if *kind != OutputKind::TimedY && *delay > 0.0 =>
            {
                return;
            }
            Step::Instruction(_) | Step::MoveToRegisters { .. } | Step::MoveToStack { .. } => {
                self.instruction_of(&step)
            }
            Step::MoveToPoint { .. } if self.program.point.is_some() => self.instruction_of(&step),
            _ => return,
        };
        // A faulty step raises its alarm at its turn.
        if let Ok(Some(action)) = fetched {
            self.append_own(action);
        }
    }

    fn go_on_at(&mut self, to: usize) {
        let back = self.program.place().is_some_and(|place| to <= place.step);
        self.program.go_to(to);
        if back {
            self.another_round();
        }
    }

    fn call(&mut self, name: &str) -> Result<(), (AlarmCode, Reason)> {
        if self.program.calls.len() > MAX_CALLS {
            return Err((
                AlarmCode::PROGRAM,
                format!("programs call one another more than {MAX_CALLS} deep").into(),
            ));
        }
        let program = self.programs.library.named(name).cloned();
        let program =
            program.ok_or_else(|| (AlarmCode::PROGRAM, Reason::NoProgramToCall(Detail::of(name))))?;
        self.program.calls.push(Place { program, step: 0 });
        Ok(())
    }

    fn holds(&self, condition: Condition) -> bool {
        match condition {
            Condition::Point(source, on) => self.io.level(source) == Some(on),
            Condition::Counter(id, compare) => {
                self.counters.get(&id).is_some_and(|counter| compare.holds(counter.current))
            }
            Condition::CounterReached(id) => self
                .counters
                .get(&id)
                .is_some_and(|counter| counter.target > 0 && counter.current >= counter.target),
            Condition::Register(register, compare) => {
                compare.holds(self.registers.values.get(&register).copied().unwrap_or(0))
            }
            Condition::Points(camera, model) => self.position_of_point(camera, model).is_some(),
            Condition::StackFull { stack, counter } => self.is_full(stack, counter),
        }
    }

    /// Skips the step that raised an alarm.
    pub(super) fn skip_step(&mut self) {
        if self.steps().current().is_some() {
            self.finish_one();
        } else if !self.program.remote {
            self.program.next();
        }
    }

    fn raise_here(&mut self, alarm: AlarmCode, why: Reason) {
        let step = self.program.place().map(place_of);
        self.raise(alarm, AlarmCause::Step { step, why });
    }

    /// Where the current instruction stands, for the log.
    pub(super) fn place_of_instruction(&self, step: &Instruction) -> AtStep {
        let action = step.action.number();
        match self.program.places.front().filter(|_| !self.program.remote) {
            Some(place) => place_of(place),
            None => AtStep::OfList { instruction: self.steps().position() + 1, action },
        }
    }

    /// The present step, for people. The controller fetches instructions of a program ahead of the arm. While
    /// fetched instructions are left, the first of them is the present step.
    #[must_use]
    pub fn present_step(&self) -> Option<ProgramStep> {
        let fetched = self.program.places.front().filter(|_| !self.program.remote);
        let place = fetched.or_else(|| self.program.place())?;
        let step = place.program.steps().get(place.step)?;
        Some(ProgramStep {
            program: place.program.name().to_owned(),
            number: place.step + 1,
            steps: place.program.steps().len(),
            text: step.to_string(),
        })
    }

    /// The next camera that a program asks for a photo.
    pub(crate) fn poll_photo(&mut self) -> Option<i64> {
        self.cameras.photos.pop_front()
    }
}

/// The name of a step in a message.
fn place_of(place: &Place) -> AtStep {
    AtStep::OfProgram { program: Detail::of(place.program.name()), step: place.step + 1 }
}

fn changed(value: i64, change: Change) -> i64 {
    match change {
        Change::To(to) => to,
        Change::By(by) => value.saturating_add(by),
    }
}
