//! The polls that wait until the robot has said over their connection who it is.

use std::collections::VecDeque;
use std::time::Duration;

use r6_client::Recorded;
use r6_proto::time::Instant;

/// How long a poll waits. Two replies to the question who it is may be lost: the client waits 2 s for each,
/// and half a second passes before each next one.
const HELD_FOR: Duration = Duration::from_secs(6);

/// How many polls wait at most: those of this time at the shortest period of 20 ms.
const MAX_HELD: usize = 300;

/// One poll.
pub(super) struct Poll {
    /// When it came.
    pub at: Instant,
    pub values: Vec<Recorded>,
    /// How many values before it were lost.
    pub lost: u64,
}

/// The polls of one robot, the earliest first.
#[derive(Default)]
pub(super) struct Held {
    polls: VecDeque<Poll>,
}

impl Held {
    /// Adds a poll. Returns the oldest one if it is given up: it waited too long, or too many wait.
    pub fn push(&mut self, poll: Poll) -> Option<Poll> {
        let is_late = |first: &mut Poll| poll.at.since(first.at) > HELD_FOR;
        let is_full = self.polls.len() >= MAX_HELD;
        let dropped = if is_full { self.polls.pop_front() } else { self.polls.pop_front_if(is_late) };
        self.polls.push_back(poll);
        dropped
    }

    /// The poll that waits longest.
    pub fn first(&self) -> Option<&Poll> {
        self.polls.front()
    }

    /// Takes out the poll that waits longest.
    pub fn next(&mut self) -> Option<Poll> {
        self.polls.pop_front()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use super::*;

    fn poll(millis: u64) -> Poll {
        Poll { at: Instant::ORIGIN + Duration::from_millis(millis), values: Vec::new(), lost: 0 }
    }

    #[test]
    fn a_poll_waits_for_six_seconds() {
        let mut held = Held::default();
        for poll in (0..=6000).step_by(100).map(poll) {
            assert!(held.push(poll).is_none());
        }
        assert_eq!(held.push(poll(6100)).unwrap().at, poll(0).at);
        assert_eq!(held.push(poll(6200)).unwrap().at, poll(100).at);
        assert_eq!(held.first().unwrap().at, poll(200).at);
        assert_eq!(held.next().unwrap().at, poll(200).at);
        assert_eq!(held.next().unwrap().at, poll(300).at);
    }

    #[test]
    fn no_more_polls_wait_than_the_shortest_period_gives() {
        let mut held = Held::default();
        assert_eq!((0..310).filter_map(|millis| held.push(poll(millis))).count(), 10);
        assert_eq!(held.first().unwrap().at, poll(10).at);
    }
}
