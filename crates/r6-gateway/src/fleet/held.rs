//! The polls that wait until the robot has said over their connection who it is.

use std::collections::VecDeque;
use std::time::Duration;

use r6_client::Recorded;
use r6_proto::time::Instant;

use super::station::Answers;

/// How long a poll waits. One or two replies to the question who it is may be lost, and the client waits 2 s
/// for each.
const HELD_FOR: Duration = Duration::from_secs(5);

/// How many polls wait at most: those of this time at the shortest period of 20 ms.
const MAX_HELD: usize = 250;

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
    /// How many values were dropped because they had waited too long.
    dropped: u64,
}

impl Held {
    /// Takes in a poll. Returns whether another one had waited too long and was dropped.
    pub fn push(&mut self, poll: Poll) -> bool {
        let is_late = |first: &mut Poll| poll.at.since(first.at) > HELD_FOR;
        let is_full = self.polls.len() >= MAX_HELD;
        let dropped = if is_full { self.polls.pop_front() } else { self.polls.pop_front_if(is_late) };
        self.dropped += dropped.as_ref().map_or(0, Poll::size);
        self.polls.push_back(poll);
        dropped.is_some()
    }

    /// The poll that waits longest.
    pub fn first(&self) -> Option<&Poll> {
        self.polls.front()
    }

    /// Takes out the poll that waits longest, now that it is known who sent it. Values that were dropped
    /// before it count as lost if this robot sent them.
    pub fn next(&mut self, sender: Answers) -> Option<Poll> {
        let mut poll = self.polls.pop_front()?;
        let dropped = std::mem::take(&mut self.dropped);
        if sender == Answers::This {
            poll.lost += dropped;
        }
        Some(poll)
    }
}

impl Poll {
    /// How many values are lost with it.
    fn size(&self) -> u64 {
        self.lost.saturating_add(self.values.len() as u64)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use r6_client::Address;

    use super::*;

    fn poll(millis: u64) -> Poll {
        let value = Recorded { address: Address::CurMode, reading: None, age: Duration::ZERO, connection: 1 };
        Poll { at: Instant::ORIGIN + Duration::from_millis(millis), values: vec![value; 3], lost: 0 }
    }

    #[test]
    fn a_poll_waits_for_five_seconds_and_counts_as_lost_after_that() {
        let mut held = Held::default();
        for poll in (0..=5000).step_by(100).map(poll) {
            assert!(!held.push(poll));
        }
        assert!(held.push(poll(5100)) && held.push(poll(5200)));
        assert_eq!(held.first().unwrap().at, poll(200).at);
        assert_eq!(held.next(Answers::This).unwrap().lost, 6, "two polls of three values");
        assert_eq!(held.next(Answers::This).unwrap().lost, 0);
    }

    #[test]
    fn no_more_polls_wait_than_there_can_be() {
        let mut held = Held::default();
        assert_eq!((0..260).filter(|millis| held.push(poll(*millis))).count(), 10);
        assert_eq!(held.next(Answers::This).unwrap().lost, 30);
    }

    #[test]
    fn what_another_robot_sent_is_not_lost() {
        let mut held = Held::default();
        assert!(!held.push(poll(0)) && held.push(poll(5001)));
        assert_eq!(held.next(Answers::Another).unwrap().lost, 0);
        assert!(!held.push(poll(5002)));
        assert_eq!(held.next(Answers::This).unwrap().lost, 0);
        assert!(held.next(Answers::This).is_none());
    }
}
