//! The next event of the machine, in two kinds: its own actions, and the deadlines that measure how long
//! others are silent.
//!
//! A clock that runs as fast as it can (`FastClock`) jumps over the first kind and leaves the second to real
//! time.

use r6_proto::message::instruction::WaitSource;
use r6_proto::time::Instant;

use super::Machine;
use super::execution::Activity;

impl Machine {
    /// When the next event of the machine is due.
    #[must_use]
    pub fn next_event(&self) -> Option<Instant> {
        let all = [
            self.activity.next_event(),
            self.by_hand(),
            self.held_until(),
            self.next_pulse(),
            self.watchdog.due(),
        ];
        all.into_iter().flatten().min()
    }

    /// When the machine does something next: a move ends or reaches a corner, a wait for time or a delay is
    /// over, an output is set back. `None` if a wait for a signal runs out before that.
    #[must_use]
    pub fn next_own_event(&self) -> Option<Instant> {
        match self.signal_limit() {
            Some(limit) => [self.next_pulse(), self.by_hand_alone()]
                .into_iter()
                .flatten()
                .min()
                .filter(|due| *due <= limit),
            None => {
                let activity = if self.awaits_signal() { None } else { self.activity.next_event() };
                [activity, self.by_hand_alone(), self.next_pulse()].into_iter().flatten().min()
            }
        }
    }

    /// When a peer has been silent for too long: a heartbreak is missed, a signal that a step waits for does
    /// not come, or a button that is held is not seen pressed any more.
    #[must_use]
    pub fn next_silence(&self) -> Option<Instant> {
        [self.signal_limit(), self.watchdog.due(), self.held_until()].into_iter().flatten().min()
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

    /// The same, unless the move lasts as long as a person holds a button.
    fn by_hand_alone(&self) -> Option<Instant> {
        self.by_hand().filter(|_| self.held_until().is_none())
    }

    /// Whether it waits for others: a signal, a photo, points, registers.
    fn awaits_signal(&self) -> bool {
        match &self.activity {
            Activity::Waiting { wait, .. } => wait.source != WaitSource::Time,
            Activity::Awaiting { .. } => true,
            _ => false,
        }
    }

    /// When the wait of a step for a signal runs out, if it has a limit.
    pub(crate) fn signal_limit(&self) -> Option<Instant> {
        self.activity.next_event().filter(|_| self.awaits_signal())
    }
}
