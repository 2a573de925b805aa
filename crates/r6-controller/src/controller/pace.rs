//! What a clock that does not follow real time has to know about the controller.

use r6_proto::time::Instant;

use super::Controller;

/// How far a controller has come, in the terms that a peer may want to react to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Progress {
    pushes: u64,
    cycles: u64,
    list_length: usize,
}

impl Progress {
    /// Whether a list that was not empty is longer in `now`.
    pub(crate) fn was_appended_to(self, now: Self) -> bool {
        self.list_length > 0 && now.list_length > self.list_length
    }
}

impl Controller {
    /// When the controller does something next: its machine acts (`Machine::next_own_event`), an input
    /// follows an output, or a delayed reply is sent.
    #[must_use]
    pub fn next_own_event(&self) -> Option<Instant> {
        // If a reaction comes too late for the step that waits for it, that step keeps its full time limit.
        let limit = self.machine.signal_limit();
        let reaction = self.next_reaction().filter(|due| limit.is_none_or(|limit| *due <= limit));
        self.next_reply().into_iter().chain(self.machine.next_own_event()).chain(reaction).min()
    }

    /// When the next delayed reply is sent, on any connection.
    #[must_use]
    pub fn next_reply(&self) -> Option<Instant> {
        self.connections.values().filter_map(|connection| connection.session.next_transmit()).min()
    }

    /// When a peer has been silent for too long: a heartbreak or a signal is missed, or a frame stays
    /// incomplete. Timed events of a scenario and deadlines of the log count too, because no peer waits for
    /// them.
    #[must_use]
    pub fn next_silence(&self) -> Option<Instant> {
        let sessions = self.connections.values().filter_map(|connection| connection.session.poll_timeout());
        let rest = [self.machine.next_silence(), self.next_of_scenario(), self.log.poll_timeout()];
        sessions.chain(rest.into_iter().flatten()).min()
    }

    /// Jumps to a point in time. No peer could send anything in between, so their deadlines move by the same
    /// amount.
    pub(crate) fn jump(&mut self, to: Instant) {
        let over = to.since(self.machine.now());
        self.machine.watchdog.postpone(over);
        self.advance(to);
        for (id, connection) in &mut self.connections {
            connection.session.postpone(over);
            if connection.session.next_transmit().is_some_and(|due| due <= to) {
                connection.session.split().1.release(to);
                self.woken.push_back(*id);
            }
        }
        self.collect_machine_events();
    }

    pub(crate) fn progress(&self) -> Progress {
        let list_length = self.machine.list().len();
        Progress { pushes: self.pushes, cycles: self.machine.cycles(), list_length }
    }

    /// Whether the arm moves, and began with a list that came since `before`, when the list was empty.
    pub(crate) fn has_set_out_since(&self, before: Progress) -> bool {
        before.list_length == 0 && !self.machine.list().is_empty() && self.machine.tells_moving()
    }

    /// Whether a third of the list was carried out since `before`, but not all of it.
    pub(crate) fn has_done_a_third_since(&self, before: Progress) -> bool {
        let left = self.machine.list().len();
        left > 0 && left <= before.list_length * 2 / 3
    }

    /// Whether the controller sent an unrequested frame since `before`.
    pub(crate) fn has_pushed_since(&self, before: Progress) -> bool {
        self.pushes != before.pushes
    }

    /// Whether a cycle of the program has ended since `before`.
    pub(crate) fn has_ended_a_cycle_since(&self, before: Progress) -> bool {
        self.machine.cycles() != before.cycles
    }
}
