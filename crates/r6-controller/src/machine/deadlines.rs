//! What happens next by itself, in two kinds: what the machine does, and what only measures how long others are silent.
//!
//! A clock that goes as fast as it can (`FastClock`) jumps over the first kind and leaves the second to real time.

use r6_proto::message::instruction::WaitSource;
use r6_proto::time::Instant;

use super::Machine;
use super::execution::Activity;

impl Machine {
    /// When something happens next by itself.
    #[must_use]
    pub fn next_event(&self) -> Option<Instant> {
        let all = [self.activity.next_event(), self.by_hand(), self.next_pulse(), self.watchdog.due()];
        all.into_iter().flatten().min()
    }

    /// When the machine does something next: a move ends or comes to a corner, a wait for time or a delay is over, an output
    /// goes back. `None` where the end of a wait for a signal comes before that.
    #[must_use]
    pub fn next_own_event(&self) -> Option<Instant> {
        match self.signal_limit() {
            Some(limit) => {
                [self.next_pulse(), self.by_hand()].into_iter().flatten().min().filter(|due| *due <= limit)
            }
            None => {
                let activity = if self.awaits_signal() { None } else { self.activity.next_event() };
                [activity, self.by_hand(), self.next_pulse()].into_iter().flatten().min()
            }
        }
    }

    /// When somebody has been silent for too long: a heartbreak is missed, or a signal that a step waits for does not come.
    #[must_use]
    pub fn next_silence(&self) -> Option<Instant> {
        [self.signal_limit(), self.watchdog.due()].into_iter().flatten().min()
    }

    /// How many cycles have ended since the machine was switched on.
    #[must_use]
    pub fn cycles(&self) -> u64 {
        self.cycle.count
    }

    fn next_pulse(&self) -> Option<Instant> {
        self.pulses.iter().map(|(due, _, _)| *due).min()
    }

    /// When a move by hand ends.
    fn by_hand(&self) -> Option<Instant> {
        self.hand.as_ref().map(|hand| hand.run.ends_at())
    }

    /// Whether it waits for somebody else: a signal, a photo, points, registers.
    fn awaits_signal(&self) -> bool {
        match &self.activity {
            Activity::Waiting { wait, .. } => wait.source != WaitSource::Time,
            Activity::Awaiting { .. } => true,
            _ => false,
        }
    }

    /// Until when a step waits for a signal, where it has a limit.
    pub(crate) fn signal_limit(&self) -> Option<Instant> {
        self.activity.next_event().filter(|_| self.awaits_signal())
    }
}
