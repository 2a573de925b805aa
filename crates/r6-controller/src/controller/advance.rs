//! How time passes: from one thing that is due to the next, of the machine and of its scenario.

use r6_proto::time::Instant;

use super::Controller;
use crate::event::Event;

/// How many turns of a scenario one call carries out. A timeline has at most a thousand a second (`scenario/file.rs`): whoever
/// was away for longer than a minute and a half misses repetitions, and does not hold everybody up to make up for them.
const MAX_TURNS: usize = 100_000;

impl Controller {
    /// Brings the machine to a point in time, with whatever the scenario has happen on the way.
    pub(super) fn advance(&mut self, now: Instant) {
        let mut turns = 0;
        while let Some(at) = self.next_turn().filter(|at| *at <= now) {
            let at = at.max(self.machine.now());
            self.machine.advance(at);
            self.react(at);
            while let Some(turn) = self.breakage.as_mut().and_then(|breakage| breakage.run.take(at)) {
                turns += 1;
                self.happen(at, turn);
                self.react(at);
            }
            if turns >= MAX_TURNS {
                turns = 0;
                self.catch_up(at, now);
            }
        }
        self.machine.advance(now);
        self.react(now);
    }

    /// Repetitions of the timeline up to now are left out: there were too many.
    fn catch_up(&mut self, at: Instant, now: Instant) {
        let Some(breakage) = &mut self.breakage else { return };
        let skipped = breakage.run.catch_up(now);
        if skipped > 0 {
            self.tell(at, Event::HappeningsLeftOut { count: skipped });
        }
    }

    /// When the scenario has its next turn: something is due, or an output may change that an input reacts to.
    fn next_turn(&self) -> Option<Instant> {
        let run = &self.breakage.as_ref()?.run;
        let machine = if run.reacts() { self.machine.next_event() } else { None };
        run.next_due().into_iter().chain(machine).min()
    }

    /// When something of the scenario is due next.
    pub(crate) fn next_of_scenario(&self) -> Option<Instant> {
        self.breakage.as_ref()?.run.next_due()
    }

    /// When an input follows that is on its way already.
    pub(super) fn next_reaction(&self) -> Option<Instant> {
        self.breakage.as_ref()?.run.next_under_way()
    }

    /// Inputs follow what has changed of the outputs.
    pub(super) fn react(&mut self, now: Instant) {
        let Some(breakage) = &mut self.breakage else { return };
        if breakage.run.reacts() && !breakage.run.react(now, self.machine.io()) {
            self.tell(now, Event::InputDoesNotFollow);
        }
    }
}
