//! Looks one move ahead, so that the arm does not have to stop at a point.
//!
//! A move with a blend level reaches its corner some time before its end. If another move follows, it begins
//! at the corner; steps in between that take no time are carried out there. The first move still counts as
//! finished only at its own end. If no move is waiting at the corner, the corner stays open until that end:
//! instructions that are appended meanwhile join at once. The arm comes to rest before a wait, before a move
//! with a delay, and at the end of a pass.

use r6_proto::message::instruction::OutputKind;
use r6_proto::message::{Action, Instruction};

use super::Machine;
use super::execution::{Activity, Run};
use super::order::{EarlierSteps, Order, path_speed, workbench};
use crate::event::AlarmCause;
use r6_motion::Axes;
use r6_proto::OperationMode;

impl Machine {
    /// Handles an instant within a run: its corner is reached, or the first of its two moves has ended.
    pub(super) fn pass_corner(&mut self, mut run: Run) -> Run {
        let first_is_over = run.movement.first_ends().is_some_and(|end| run.is_past(end, self.now));
        if first_is_over {
            self.finish_joined(&run);
            run.movement = Box::new(run.movement.without_first());
            run.joined = 0;
            run.at_corner = false;
        } else {
            run.at_corner = true;
        }
        run
    }

    /// Finishes the step of the first of two moves, and the steps that were carried out at the corner.
    pub(super) fn finish_joined(&mut self, run: &Run) {
        for _ in 0..run.joined {
            self.finish_one();
        }
    }

    /// Begins the next move while the current one is at its corner.
    pub(super) fn join_next(&mut self) {
        let Activity::Moving(run) = &self.activity else { return };
        let single = self.mode == OperationMode::SingleStep;
        if !run.at_corner || run.joined > 0 || single || !self.runs() {
            return;
        }
        let run = run.clone();
        self.fetch_moves();
        let Some((ahead, order)) = self.next_move(1, &run.movement.end()) else { return };
        let seconds = run.seconds(self.now);
        let Ok(movement) = run.movement.join(seconds, &order.step, &order.conditions, run.blend) else {
            // The next move raises its alarm at its turn, with the arm at rest.
            return;
        };
        if let Some(action) = self.steps().ahead(ahead).map(|step| step.action) {
            self.move_begins(&action);
        }
        let between: Vec<_> = (1..ahead).filter_map(|step| self.steps().ahead(step).copied()).collect();
        self.activity = Activity::Moving(run.joined_by(movement, ahead, order.blend));
        self.begin_at_once(&between);
    }

    /// Fetches steps of the program up to the next move.
    fn fetch_moves(&mut self) {
        /// More steps than anyone teaches between two successive moves.
        const MOST: usize = 16;
        for _ in 0..MOST {
            let length = self.steps().len();
            let moves =
                (1..length).filter_map(|ahead| self.steps().ahead(ahead)).any(super::execution::is_motion);
            if moves {
                return;
            }
            self.fetch_ahead();
            if self.steps().len() == length {
                return;
            }
        }
    }

    /// Lets a new list take over the arm in mid-move, without a stop. Returns false if the arm has to stop
    /// first: the first move does not follow at once, or cannot be reached from here. Then the alarm comes
    /// once the arm rests.
    pub(super) fn take_over(&mut self) -> bool {
        let Activity::Moving(run) = &self.activity else { return false };
        let seconds = run.seconds(self.now);
        let Some((ahead, order)) = self.next_move(0, &self.motion().axes) else { return false };
        let Ok(Some(movement)) = run.movement.take_over(seconds, &order.step, &order.conditions) else {
            return false;
        };
        if let Some(action) = self.steps().ahead(ahead).map(|step| step.action) {
            self.move_begins(&action);
        }
        self.activity = Activity::Moving(Run::new(movement, self.now, order.blend));
        self.cycle.started = Some(self.now);
        self.cycle.pass_started = self.now;
        let before: Vec<_> = (0..ahead).filter_map(|step| self.list.ahead(step).copied()).collect();
        for _ in &before {
            self.list.finish_current();
        }
        self.begin_at_once(&before);
        true
    }

    /// Carries out steps that take no time, while the arm keeps moving.
    fn begin_at_once(&mut self, steps: &[Instruction]) {
        for step in steps {
            if let Err((alarm, why)) = self.begin(step) {
                self.raise(alarm, AlarmCause::Step { step: None, why });
                return;
            }
        }
        self.check_signal_stop();
    }

    /// The next move and how many steps ahead it is, if only steps that take no time lie before it. The
    /// search begins `first` steps ahead.
    fn next_move(&self, first: usize, from: &Axes) -> Option<(usize, Order)> {
        let mut told = EarlierSteps { path_speed: self.path_speed, bench: self.frames.bench };
        for ahead in first.. {
            let action = &self.steps().ahead(ahead)?.action;
            match action {
                Action::PathSpeed(speed) => told.path_speed = path_speed(speed).ok()?,
                Action::Workbench(bench) => told.bench = workbench(*bench).ok()?,
                Action::StopOnSignal(_) | Action::BoardOutput(_) => {}
                Action::Output(output) if output.kind == OutputKind::TimedY || output.delay <= 0.0 => {}
                Action::Output(_) | Action::Wait(_) | Action::Unknown(_) => return None,
                // The arm stops before it, and then does not move.
                Action::CurveMove(_) if self.is_lone_curve(action) => return None,
                Action::AxisMove(_) | Action::LinearMove(_) | Action::CurveMove(_) => {
                    let order = self.order(action, from, told).ok()??;
                    return (order.step.delay <= 0.0).then_some((ahead, order));
                }
            }
        }
        None
    }
}
