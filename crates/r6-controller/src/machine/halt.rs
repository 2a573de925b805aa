//! Brings the machine to rest, and resumes it.

use std::time::Duration;

use r6_proto::time::Instant;

use super::Machine;
use super::execution::{Activity, Run, fulfilled_at_once, plan_failed};
use crate::event::AlarmCause;

/// What follows after a move has come to rest before its end. If there are two reasons, the stronger one
/// counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AfterHalt {
    /// The move waits to continue from there.
    Keep,
    /// The step counts as done and the next one follows (stop on signal).
    NextStep,
    /// The move is over. Its step begins again with the next start.
    Drop,
    /// The move is over, and the next start begins with the first step.
    Rewind,
    /// The list was replaced meanwhile: the new list begins.
    NewList,
}

impl Run {
    /// The same run, at rest within `time`, or at its own end if that is sooner.
    pub(super) fn sooner(self, time: Duration, now: Instant) -> Self {
        let movement = self.movement.halt(self.seconds(now), time.as_secs_f64());
        let halted = self.clone().by(movement, now);
        if halted.ends_at() < self.ends_at() { halted } else { self }
    }
}

impl Machine {
    /// Brings the motion to rest within `time`, then does what `after` says. Returns false if no move has to
    /// come to rest.
    pub(crate) fn halt(&mut self, time: Duration, after: AfterHalt) -> bool {
        self.halt_hand(time);
        let activity = std::mem::replace(&mut self.activity, Activity::Idle);
        match activity {
            Activity::Moving(run) => {
                let movement = run.movement.halt(run.seconds(self.now), time.as_secs_f64());
                let mut run = run.by(movement, self.now);
                self.leave_joined(&mut run, after);
                self.activity = Activity::Halting(run, after);
                true
            }
            Activity::Halting(mut run, before) => {
                let after = before.max(after);
                run = run.sooner(time, self.now);
                if before == AfterHalt::Keep {
                    self.leave_joined(&mut run, after);
                }
                self.activity = Activity::Halting(run, after);
                true
            }
            Activity::Paused(mut run) => {
                if after == AfterHalt::Keep {
                    self.activity = Activity::Paused(run);
                } else {
                    self.leave_joined(&mut run, after);
                    self.after_rest(after);
                }
                false
            }
            Activity::Waiting { .. }
            | Activity::Awaiting { .. }
            | Activity::Delaying { .. }
            | Activity::Resting { .. }
                if after == AfterHalt::Keep =>
            {
                let left = activity.next_event().map(|due| due.since(self.now));
                self.activity = Activity::Suspended(Box::new(activity), left);
                false
            }
            Activity::Suspended(..) if after == AfterHalt::Keep => {
                self.activity = activity;
                false
            }
            Activity::Idle
            | Activity::Suspended(..)
            | Activity::Waiting { .. }
            | Activity::Awaiting { .. }
            | Activity::Delaying { .. }
            | Activity::Resting { .. } => {
                self.after_rest(after);
                false
            }
        }
    }

    /// Ends the first of two overlapping moves: the arm has left it for the second, and does not go back.
    fn leave_joined(&mut self, run: &mut Run, after: AfterHalt) {
        match after {
            AfterHalt::Keep => return,
            AfterHalt::NextStep | AfterHalt::Drop | AfterHalt::Rewind => self.finish_joined(run),
            AfterHalt::NewList => {}
        }
        run.joined = 0;
    }

    /// Does what `after` says when nothing had to come to rest.
    fn after_rest(&mut self, after: AfterHalt) {
        if after == AfterHalt::Rewind {
            self.list.rewind();
            self.begin_anew();
        }
    }

    /// Ends a halt: the move has come to rest before its end.
    pub(super) fn finish_halt(&mut self, run: Run, after: AfterHalt) {
        let reached = run.movement.reaches_end();
        self.axes = run.movement.state_at(run.movement.duration()).axes;
        match after {
            AfterHalt::Keep => self.activity = Activity::Paused(run),
            AfterHalt::NextStep => self.finish_step(),
            AfterHalt::Drop | AfterHalt::Rewind => {
                if reached {
                    self.finish_one();
                }
                self.after_rest(after);
            }
            AfterHalt::NewList => {
                self.list.rewind();
                self.cycle.started = None;
            }
        }
    }

    /// Resumes what was paused.
    pub(crate) fn resume(&mut self) {
        match &self.activity {
            // Pressing start while the arm still slows down for a pause also resumes.
            Activity::Paused(run) | Activity::Halting(run, AfterHalt::Keep) => {
                let run = run.clone();
                if self.global_speed <= 0.0 {
                    return;
                }
                match run.movement.resume(run.seconds(self.now), self.global_speed) {
                    Ok(movement) => self.activity = Activity::Moving(run.by(movement, self.now)),
                    Err(error) => {
                        let (alarm, why) = plan_failed(error);
                        self.raise(alarm, AlarmCause::Step { step: None, why });
                    }
                }
            }
            Activity::Suspended(suspended, left) => {
                let (suspended, left) = ((**suspended).clone(), *left);
                self.resume_suspended(suspended, left);
            }
            Activity::Idle
            | Activity::Moving(_)
            | Activity::Halting(..)
            | Activity::Waiting { .. }
            | Activity::Awaiting { .. }
            | Activity::Delaying { .. }
            | Activity::Resting { .. } => {}
        }
    }

    fn resume_suspended(&mut self, suspended: Activity, left: Option<Duration>) {
        let due = left.map(|left| self.now + left);
        self.activity = match suspended {
            Activity::Waiting { wait, .. } => {
                let level = self.io.level(wait.source);
                if level.is_some_and(|level| fulfilled_at_once(wait.condition, level)) {
                    self.finish_step();
                    return;
                }
                Activity::Waiting { wait, level, until: due }
            }
            Activity::Delaying { output, .. } => {
                Activity::Delaying { output, until: due.unwrap_or(self.now) }
            }
            Activity::Awaiting { what, .. } => {
                self.await_again(what, due);
                return;
            }
            Activity::Resting { .. } => Activity::Resting { until: due.unwrap_or(self.now) },
            Activity::Idle
            | Activity::Moving(_)
            | Activity::Halting(..)
            | Activity::Paused(_)
            | Activity::Suspended(..) => Activity::Idle,
        };
    }

    /// Applies a new global speed to the move under way. At 0 the arm rests where it is until the speed is
    /// above 0 again.
    pub(crate) fn replan_for_global_speed(&mut self) {
        self.replan_hand();
        match &self.activity {
            Activity::Moving(run) => {
                match run.movement.with_global(run.seconds(self.now), self.global_speed) {
                    Ok(movement) => self.activity = Activity::Moving(run.clone().by(movement, self.now)),
                    Err(_) => {
                        self.halt(self.profile.action_pause_time, AfterHalt::Keep);
                    }
                }
            }
            Activity::Paused(_) | Activity::Halting(_, AfterHalt::Keep) | Activity::Idle if self.runs() => {
                self.resume();
                self.run_list();
            }
            Activity::Idle
            | Activity::Paused(_)
            | Activity::Suspended(..)
            | Activity::Halting(..)
            | Activity::Waiting { .. }
            | Activity::Awaiting { .. }
            | Activity::Delaying { .. }
            | Activity::Resting { .. } => {}
        }
    }
}
