//! How time passes: the controller goes from one due event to the next, of the machine and of its scenario.

use r6_proto::time::Instant;

use super::Controller;
use crate::event::Event;

/// How many turns of a scenario one call carries out. A timeline has at most a thousand a second
/// (`scenario/file.rs`). After a gap of more than a minute and a half, repetitions are left out, because
/// catching up would block every peer.
const MAX_TURNS: usize = 100_000;

impl Controller {
    /// Brings the machine to a point in time, with everything that the scenario does on the way.
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

    /// Leaves out the repetitions of the timeline up to now, because there were too many.
    fn catch_up(&mut self, at: Instant, now: Instant) {
        let Some(breakage) = &mut self.breakage else { return };
        let skipped = breakage.run.catch_up(now);
        if skipped > 0 {
            self.tell(at, Event::HappeningsLeftOut { count: skipped });
        }
    }

    /// When the scenario has its next turn: an event is due, or an output may change that an input reacts to.
    fn next_turn(&self) -> Option<Instant> {
        let run = &self.breakage.as_ref()?.run;
        let machine = if run.reacts() { self.machine.next_event() } else { None };
        run.next_due().into_iter().chain(machine).min()
    }

    /// When the next event of the scenario is due.
    pub(crate) fn next_of_scenario(&self) -> Option<Instant> {
        self.breakage.as_ref()?.run.next_due()
    }

    /// When the next reaction of an input that has already begun is due.
    pub(super) fn next_reaction(&self) -> Option<Instant> {
        self.breakage.as_ref()?.run.next_under_way()
    }

    /// Starts the reactions of inputs to outputs that have changed.
    pub(super) fn react(&mut self, now: Instant) {
        let Some(breakage) = &mut self.breakage else { return };
        if breakage.run.reacts() && !breakage.run.react(now, self.machine.io()) {
            self.tell(now, Event::InputDoesNotFollow);
        }
    }
}
