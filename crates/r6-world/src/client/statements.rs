//! Compares what a program hears about a motion or a stop with what was sent and with what the controller
//! did.

use std::time::Duration;

use r6_client::{StepHandle, StepState};

use super::Work;
use crate::fault::{Class, Promise};
use crate::floor::Floor;
use crate::line::Line;
use crate::record::Record;
use crate::shared::{State, now};

impl Work {
    /// Checks the steps of a motion that ended successfully for its program against what the controller
    /// executed.
    pub(super) fn check_end(
        &self,
        at: Duration,
        steps: &[i64],
        floor: &Floor,
        line: &Line,
        record: &mut Record,
    ) {
        let is_true = self.robot_plan().does_what_it_says;
        let of = if is_true { steps } else { &steps[steps.len() - 1..] };
        let left = steps.iter().all(|step| line.has_sent(*step));
        let others_clear = self.shared.plan.trap == Some(Class::E5);
        // If another client clears the list during a step, the controller never counts that step as executed.
        let is_through =
            if self.is_alone() && !others_clear { floor.has_done(of) } else { floor.is_through_with(of) };
        record.check(Promise::Once, at, left && is_through, || {
            format!("client-{}: {steps:?} came to an end, they say; left: {left}", self.index)
        });
        if !self.is_alone() || !is_true {
            return;
        }
        let Some((last, before)) = steps.split_last() else { return };
        // Another client may clear the list when the arm has almost reached the end of the last step.
        let is_there = || line.targets.get(last).is_some_and(|j1| floor.stands_at(*j1, *last));
        let ends = floor.has_done(&[*last]) || (others_clear && is_there());
        let is_gapless = floor.has_done(before);
        let told = || {
            let missing = steps.iter().filter(|step| !floor.has_done(&[**step])).collect::<Vec<_>>();
            let index = self.index;
            format!(
                "client-{index}: {steps:?} are done, they say; left: {left}; not carried out: {missing:?}"
            )
        };
        record.check(Promise::Whole, at, left && ends && (is_gapless || others_clear), told);
        record.check(Promise::Gapless, at, is_gapless, told);
    }

    /// Checks that the reported state of each step agrees with what was sent and executed.
    pub(super) fn compare(&self, told: &[StepHandle], steps: &[i64]) {
        let at = now();
        let mut state = self.shared.state();
        let State { record, lines, floors, .. } = &mut *state;
        let plan = self.robot_plan();
        let is_true = plan.tells_values && plan.does_what_it_says;
        for (told, step) in told.iter().zip(steps) {
            let (left, floor) = (lines[self.index].has_sent(*step), &floors[self.plan.robot]);
            let (done, begun) = (floor.has_done(&[*step]), floor.has_begun(*step));
            let holds = match told.state() {
                StepState::Queued => !left,
                // With blending, a client sees the next move begin before the machine counts this one.
                StepState::Done => left && (begun || !is_true),
                StepState::Sent | StepState::Running | StepState::Lost => true,
            };
            record.check(Promise::Once, at, holds && (left || !done), || {
                format!(
                    "client-{}: step {step} is {:?}; it left: {left}, done: {done}",
                    self.index,
                    told.state()
                )
            });
        }
    }

    pub(super) fn note_stop(&self, confirmed: Option<bool>) {
        let at = now();
        let mut state = self.shared.state();
        let State { record, floors, lines, .. } = &mut *state;
        record.tally.stops[usize::from(confirmed != Some(true))] += 1;
        if confirmed == Some(true) {
            lines[self.index].dropped_runs_end();
            let floor = &mut floors[self.plan.robot];
            if self.is_alone() { floor.is_told_to_stand(at) } else { floor.stands(at) }
        }
    }
}
