//! What a clock has to know that does not go at the pace of real time.

use r6_proto::time::Instant;

use super::Controller;

/// How far a controller has come with what a peer may want to react to.
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
    /// When the controller does something next: its machine (`Machine::next_own_event`), an input follows an output,
    /// or a reply leaves that is held back.
    #[must_use]
    pub fn next_own_event(&self) -> Option<Instant> {
        // An input that follows too late for a step that waits for it leaves that step its time.
        let limit = self.machine.signal_limit();
        let reaction = self.next_reaction().filter(|due| limit.is_none_or(|limit| *due <= limit));
        self.next_reply().into_iter().chain(self.machine.next_own_event()).chain(reaction).min()
    }

    /// When the next reply leaves, on any connection, that is held back now.
    #[must_use]
    pub fn next_reply(&self) -> Option<Instant> {
        self.connections.values().filter_map(|connection| connection.session.next_transmit()).min()
    }

    /// When somebody has been silent for too long: a heartbreak or a signal is missed, a frame stays incomplete. What a
    /// scenario has happen at a time of its own counts too, and what the log has to tell then: nobody waits for them.
    #[must_use]
    pub fn next_silence(&self) -> Option<Instant> {
        let sessions = self.connections.values().filter_map(|connection| connection.session.poll_timeout());
        let rest = [self.machine.next_silence(), self.next_of_scenario(), self.log.poll_timeout()];
        sessions.chain(rest.into_iter().flatten()).min()
    }

    /// Brings the controller to a point in time at once: nobody had the time to say anything in between, so nobody's
    /// silence counts.
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

    /// Whether the arm is on its way, by a list that came since then and found none before it.
    pub(crate) fn has_set_out_since(&self, before: Progress) -> bool {
        before.list_length == 0 && !self.machine.list().is_empty() && self.machine.tells_moving()
    }

    /// Whether a third of its list is carried out since then, and not all of it.
    pub(crate) fn has_done_a_third_since(&self, before: Progress) -> bool {
        let left = self.machine.list().len();
        left > 0 && left <= before.list_length * 2 / 3
    }

    /// Whether it sent a frame that nobody had asked for, since then.
    pub(crate) fn has_pushed_since(&self, before: Progress) -> bool {
        self.pushes != before.pushes
    }

    /// Whether a cycle of its program has ended since then.
    pub(crate) fn has_ended_a_cycle_since(&self, before: Progress) -> bool {
        self.machine.cycles() != before.cycles
    }
}
