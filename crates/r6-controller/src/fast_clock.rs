//! A clock that goes as fast as it can, and that only the input drives.
//!
//! Time stands while nobody says anything, however long a peer thinks. After each frame, and after each thing that a person
//! or a machine in the cell does, it jumps from event to event of the controller's own (a move ends, a delay is over,
//! a reply leaves that was held back) until
//!
//! - nothing is under way any more,
//! - a frame was sent that nobody had asked for, such as a photo: its receiver has the word,
//! - the arm has set out to carry out a list, where there was none before: whoever looks next sees it move,
//! - a third of the instructions that were in the list are carried out, and one at least is left: whoever looks sees the list get shorter,
//! - or a cycle of the program has ended and the next has begun: a program that never rests makes one cycle for each frame.
//!
//! What is appended to a list takes no time, apart from its reply. Replies that are owed leave in any case. So the same settings, seed and frames in the same order give the same bytes, in
//! whatever pieces they come and however long anybody takes; of a list its sender sees the beginning, some places on the way, and the end.
//!
//! A jump never takes time from others: a heartbreak, a signal that a step waits for with a limit, or the rest of a frame
//! that has begun may take as long as it takes in real time ([`FastClock::pause`]).

use std::time::Duration;

use r6_proto::time::Instant;

use crate::controller::pace::Progress;
use crate::controller::{ConnectionId, Controller};

/// How long, in real time, a peer has the word before time goes on without it: far longer than a program thinks, and short
/// enough for a person who watches a program that nobody talks to.
pub const PATIENCE: Duration = Duration::from_secs(1);

/// How many events may follow one frame. A list of the greatest length has a few thousand; this bounds a program whose
/// cycle never ends.
const MAX_EVENTS_AT_ONCE: usize = 10_000;

/// The time of one controller that goes as fast as it can. Every call takes the controller that it is the clock of.
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

    /// Takes bytes from a connection, and lets time go on after each message.
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

    /// Does what a person or a machine in the cell does, and lets time go on after it.
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

    /// How long to wait, in real time, before [`Self::go_on`] if nobody says anything; `None` for ever.
    #[must_use]
    pub fn pause(&self, controller: &Controller) -> Option<Duration> {
        match controller.next_own_event() {
            Some(_) => Some(PATIENCE),
            None => controller.next_silence().map(|due| due.since(self.now)),
        }
    }

    /// Nobody said anything for as long as [`Self::pause`] told: time goes on without them.
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

    /// Lets the replies leave that are held back, and nothing else happen.
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
            // What a scenario has happen on the way is an event by itself.
            let due = controller.next_of_scenario().map_or(due, |happens| happens.min(due));
            self.now = self.now.max(due);
            controller.jump(self.now);
        }
    }
}
