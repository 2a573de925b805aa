//! What a controller has in its list, what it executed, and which steps left the list without being executed.

use std::collections::VecDeque;
use std::time::Duration;

use r6_controller::Controller;
use r6_proto::AxisIndex;
use r6_proto::message::Action;

use super::observed::Sight;
use super::{Floor, number_of};
use crate::fault::Promise;
use crate::line::Line;
use crate::record::Record;

/// How near an arm must be to its target, in degrees, to count as there. A client compares with 0.05.
const NEAR: f64 = 0.06;

impl Floor {
    /// Whether these steps were executed.
    #[must_use]
    pub fn has_done(&self, numbers: &[i64]) -> bool {
        numbers.iter().all(|number| self.done.contains(number))
    }

    /// Whether each of these steps was executed, or left the list without being executed.
    #[must_use]
    pub fn is_through_with(&self, numbers: &[i64]) -> bool {
        numbers.iter().all(|number| self.done.contains(number) || self.gone.contains(number))
    }

    /// Whether the controller has begun this step, or is through with it.
    #[must_use]
    pub fn has_begun(&self, number: i64) -> bool {
        self.ahead.front() == Some(&number) || self.is_through_with(&[number])
    }

    /// Whether the arm stands and the list is empty.
    #[must_use]
    pub fn rests_with_an_empty_list(&self) -> bool {
        self.ahead.is_empty()
            && self.sights.back().is_some_and(|sight| sight.speeds.iter().all(|speed| *speed == 0.0))
    }

    /// Whether the arm stands at the target of this step, within 0.06 degrees, which is as close as a client
    /// can judge.
    #[must_use]
    pub fn stands_at(&self, j1: f64, step: i64) -> bool {
        #[expect(clippy::cast_precision_loss, reason = "a small number")]
        let target = [j1, step as f64 / 1000.0];
        let is_near = |sight: &Sight| {
            let stands = sight.speeds.iter().all(|speed| *speed == 0.0);
            stands && target.iter().zip(&sight.axes).all(|(target, axis)| (target - axis).abs() <= NEAR)
        };
        self.sights.back().is_some_and(is_near)
    }

    pub(super) fn lose_list(&mut self) {
        self.gone.extend(self.ahead.drain(..).filter(|number| *number > 0));
    }

    pub(super) fn count(
        &mut self,
        at: Duration,
        controller: &Controller,
        clients: &[Line],
        record: &mut Record,
    ) {
        let machine = controller.machine();
        let list = machine.list();
        if list.completed() < self.completed {
            // It was switched off and on.
            self.completed = 0;
            self.lose_list();
        }
        for _ in self.completed..list.completed() {
            // Every change of the list is an event of its own, and each is followed by an observation.
            if let Some(number) = self.ahead.pop_front().filter(|number| *number > 0) {
                let first = self.done.insert(number);
                record.tally.instructions += 1;
                record.check(Promise::Once, at, first, || {
                    format!("{} carries out step {number} twice", self.name)
                });
                // Each client has its own numbers.
                let is_theirs =
                    clients.iter().any(|line| line.robot() == self.robot && line.has_sent(number));
                record.check(Promise::Once, at, is_theirs, || {
                    format!("{} carries out step {number}, which its client never sent", self.name)
                });
            }
        }
        self.completed = list.completed();
        let number = |step: &r6_proto::message::Instruction| match &step.action {
            Action::AxisMove(step) => step.target.at(AxisIndex::ALL[1]).map_or(0, number_of),
            _ => 0,
        };
        let ahead: VecDeque<_> = (0..list.len()).map_while(|ahead| list.ahead(ahead)).map(number).collect();
        let before = std::mem::replace(&mut self.ahead, ahead);
        self.gone.extend(before.into_iter().filter(|number| *number > 0 && !self.ahead.contains(number)));
        let length = list.len();
        let most = r6_controller::instruction_list::MAX_INSTRUCTIONS;
        record.check(Promise::I6, at, length <= most, || format!("{} has {length} instructions", self.name));
        let (taken, sent) = (self.taken, self.lists_sent);
        record.check(Promise::Once, at, taken <= sent, || {
            format!("{} took {taken} lists of {sent}", self.name)
        });
        let points = machine.points();
        if points.len() != self.points {
            let count = points.len();
            let fresh: Vec<i64> = points.skip(self.points).map(|(_, point)| number_of(point.x)).collect();
            self.points = count;
            for number in fresh.into_iter().filter(|number| *number > 1000) {
                record.tally.points += 1;
                let first = self.numbers.insert(number);
                record.check(Promise::Once, at, first, || format!("{} got point {number} twice", self.name));
            }
            let most = r6_controller::machine::MAX_POINTS;
            record.check(Promise::I6, at, count <= most, || format!("{} has {count} points", self.name));
        }
    }
}
