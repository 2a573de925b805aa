//! A clock that runs as fast as it can, and advances only on input.
//!
//! Time stands still while no input comes, however long a peer thinks. The clock advances after each frame,
//! and after each action of an operator or a machine in the cell. It then jumps from event to event of the
//! controller itself (a move ends, a delay is over, a delayed reply is sent) until
//!
//! - nothing is under way any more,
//! - an unrequested frame was sent, such as a photo request: its receiver is expected to react,
//! - the arm has begun to carry out a list that came to an empty list: the next query sees it move,
//! - a third of the instructions in the list are carried out, and at least one is left: queries see the list
//!   get shorter,
//! - or a cycle of the program has ended and the next has begun: a program that never rests makes one cycle
//!   per frame.
//!
//! Appending to a list takes no time, apart from the reply. Replies that are due are always sent. So the same
//! settings, seed and frames in the same order give the same bytes. It does not matter how the frames are
//! split or how long a peer takes. The sender of a list sees the beginning, some places on the way, and the
//! end.
//!
//! A jump never takes time from others. A heartbreak, a signal that a step waits for with a limit, or the
//! rest of an incomplete frame may take as long as it takes in real time ([`FastClock::pause`]).

use std::time::Duration;

use r6_proto::time::Instant;

use crate::controller::pace::Progress;
use crate::controller::{ConnectionId, Controller};

/// How long the clock waits for a peer, in real time, before time goes on without it. This is far longer than
/// a program thinks, and short enough for a person who watches a program without a peer.
pub const PATIENCE: Duration = Duration::from_secs(1);

/// How many events may follow one frame. The longest list causes a few thousand; this bounds a program whose
/// cycle never ends.
const MAX_EVENTS_AT_ONCE: usize = 10_000;

/// The time of one controller that runs as fast as it can. Every call takes the controller that this clock
/// belongs to.
#[derive(Clone, Debug)]
pub struct FastClock {
    now: Instant,
}

impl FastClock {
    /// A clock that stands at this point in time.
    #[must_use]
    pub fn new(now: Instant) -> Self {
        Self { now }
    }

    /// The present time.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.now
    }

    /// Takes bytes from a connection, and lets time pass after each message.
    pub fn handle_input(&mut self, controller: &mut Controller, id: ConnectionId, bytes: &[u8]) {
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = controller.take_input(self.now, id, rest);
            if taken == 0 {
                return;
            }
            rest = rest.get(taken..).unwrap_or_default();
            loop {
                let before = controller.progress();
                if !controller.serve_next(self.now, id) {
                    break;
                }
                self.run(controller, before);
            }
        }
    }

    /// Carries out an action of an operator or a machine in the cell, and lets time pass after it.
    pub fn act<T>(
        &mut self,
        controller: &mut Controller,
        act: impl FnOnce(&mut Controller, Instant) -> T,
    ) -> T {
        let before = controller.progress();
        let result = act(controller, self.now);
        self.run(controller, before);
        result
    }

    /// How long to wait, in real time, before [`Self::go_on`] if no input comes; `None` means without limit.
    #[must_use]
    pub fn pause(&self, controller: &Controller) -> Option<Duration> {
        match controller.next_own_event() {
            Some(_) => Some(PATIENCE),
            None => controller.next_silence().map(|due| due.since(self.now)),
        }
    }

    /// Lets time pass after no input came for [`Self::pause`].
    pub fn go_on(&mut self, controller: &mut Controller) {
        let before = controller.progress();
        if controller.next_own_event().is_none()
            && let Some(due) = controller.next_silence()
        {
            self.now = self.now.max(due);
            controller.handle_timeout(self.now);
        }
        self.run(controller, before);
    }

    /// Sends the delayed replies and lets nothing else happen.
    fn release_replies(&mut self, controller: &mut Controller) {
        for _ in 0..MAX_EVENTS_AT_ONCE {
            let Some(due) = controller.next_reply() else { return };
            self.now = self.now.max(due);
            controller.jump(self.now);
        }
    }

    fn run(&mut self, controller: &mut Controller, before: Progress) {
        let listed = controller.progress();
        if before.was_appended_to(listed) {
            return self.release_replies(controller);
        }
        for _ in 0..MAX_EVENTS_AT_ONCE {
            let Some(due) = controller.next_own_event() else { return };
            let anothers_turn = controller.has_pushed_since(before)
                || controller.has_ended_a_cycle_since(before)
                || controller.has_set_out_since(before)
                || controller.has_done_a_third_since(listed);
            if anothers_turn && controller.next_reply().is_none() {
                return;
            }
            // A timed event of a scenario on the way counts as an event of its own.
            let due = controller.next_of_scenario().map_or(due, |happens| happens.min(due));
            self.now = self.now.max(due);
            controller.jump(self.now);
        }
    }
}
