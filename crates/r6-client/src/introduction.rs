//! The identity query: sent before the first request, and again after a reconnect.
//!
//! ```text
//!  all in one query ──each has a value──▶ known
//!    └─ one lacks a value ─▶ each alone ─has a value, or lacks it three times─▶ known, or known missing
//!  no answer ──▶ the same question again ──no answer──▶ the controller counts as dead
//! ```

use std::collections::VecDeque;

use r6_proto::OperationMode;
use r6_proto::address::Address;
use r6_proto::message::Reading;

use crate::error::RequestError;
use crate::identity::{Found, IDENTITY, Identity};
use crate::job::Answer;

/// The addresses read after a reconnect. The oldest manual has all of them, so one query suffices.
const AGAIN: [Address; 5] =
    [Address::Version, Address::MachineName, Address::AxisNum, Address::CurMode, Address::CurAlarm];

/// Timeouts of the identity query after which the controller counts as dead. One lost reply is tolerated, and
/// requests behind it wait twice the reply timeout at most.
const MAX_TIMEOUTS: u32 = 2;

/// How often one address is asked for alone until the client believes that the controller has no such value,
/// or no readable one: a single odd reply must not make it a different robot.
const MAX_ODD: u32 = 3;

/// Asks a controller for its identity: one query if the firmware has everything, single ones if values are
/// missing.
#[derive(Debug)]
pub(crate) struct Introduction {
    /// The queries still to be sent; the first is under way.
    parts: VecDeque<Vec<Address>>,
    read: Vec<(Address, Reading)>,
    /// Addresses with an unreadable value, each time.
    unreadable: Vec<Address>,
    timeouts: u32,
    /// How often the query under way gave no value.
    odd: u32,
}

impl Introduction {
    /// For a handle's first connection: reads the identity, so that the robot can be recognised later.
    pub fn first() -> Self {
        Self::asking([IDENTITY.to_vec()])
    }

    /// For a connection after a reconnect: reads the identity, the state, and the length of the list. Older
    /// firmware lacks that length, so it is asked for alone.
    pub fn again() -> Self {
        Self::asking([AGAIN.to_vec(), vec![Address::RemoteCmdLen]])
    }

    fn asking<const N: usize>(parts: [Vec<Address>; N]) -> Self {
        Self { parts: parts.into(), read: Vec::new(), unreadable: Vec::new(), timeouts: 0, odd: 0 }
    }

    /// The next query; `None` when all is known.
    pub fn next(&self) -> Option<&[Address]> {
        self.parts.front().map(Vec::as_slice)
    }

    /// Takes in the answer to [`Self::next`]. An address that repeatedly has no value when asked for alone
    /// counts as missing.
    pub fn answered(&mut self, answer: Result<Answer, RequestError>) {
        let Some(asked) = self.parts.pop_front() else { return };
        let mut missing = Vec::new();
        let lacking = matches!(answer, Ok(Answer::Mismatch { answered: 0, .. }));
        match answer {
            Ok(Answer::Values { rows, .. }) => {
                for (address, (_, value)) in asked.into_iter().zip(rows) {
                    match value {
                        Ok(reading) => self.read.push((address, reading)),
                        Err(_unreadable) => missing.push(address),
                    }
                }
            }
            Ok(Answer::Mismatch { .. } | Answer::Raw { .. } | Answer::Accepted { .. } | Answer::Left)
            | Err(_) => missing = asked,
        }
        match missing.as_slice() {
            [] => self.odd = 0,
            [address] => {
                self.odd += 1;
                // Older firmware lacks the length of its list, and that is not part of the identity.
                if self.odd < MAX_ODD && IDENTITY.contains(address) {
                    self.parts.push_front(missing);
                } else {
                    self.odd = 0;
                    if !lacking {
                        self.unreadable.push(*address);
                    }
                }
            }
            _several => {
                self.odd = 0;
                missing.into_iter().rev().for_each(|address| self.parts.push_front(vec![address]));
            }
        }
    }

    /// No answer came in time: the query is sent again. `true` if it was tried often enough.
    pub fn timed_out(&mut self) -> bool {
        self.timeouts += 1;
        self.timeouts >= MAX_TIMEOUTS
    }

    /// Whether every part of the identity was read, or is known to be missing.
    pub fn is_certain(&self) -> bool {
        !self.unreadable.iter().any(|address| IDENTITY.contains(address))
    }

    /// The values that were read.
    pub fn found(self) -> Found {
        let mut found = Found {
            identity: Identity::default(),
            another: false,
            mode: None,
            alarm: None,
            list_length: None,
        };
        for (address, reading) in self.read {
            match (address, reading) {
                (Address::Version, Reading::Text(text)) => found.identity.firmware = Some(text),
                (Address::MachineName, Reading::Text(text)) => found.identity.machine_name = Some(text),
                (Address::AxisNum, Reading::Integer(axes)) => found.identity.axis_count = Some(axes),
                (Address::CurMode, Reading::Integer(mode)) => {
                    found.mode = Some(OperationMode::of_number(mode));
                }
                (Address::CurAlarm, Reading::Integer(alarm)) => found.alarm = Some(alarm),
                (Address::RemoteCmdLen, Reading::Integer(length)) => found.list_length = Some(length),
                _ => {}
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use r6_proto::time::Instant;

    use super::*;
    use crate::job::Answered;

    const ON: Answered = Answered { connection: 0, asked_at: Instant::ORIGIN, after: Duration::ZERO };

    fn text(text: &str) -> Reading {
        Reading::Text(text.to_owned())
    }

    fn answer(values: Vec<Reading>) -> Result<Answer, RequestError> {
        // The introduction knows which address each value belongs to.
        let rows = values.into_iter().map(|value| (Address::Version, Ok(value))).collect();
        Ok(Answer::Values { rows, on: ON })
    }

    fn short(answered: usize) -> Result<Answer, RequestError> {
        Ok(Answer::Mismatch { answered, on: ON })
    }

    #[test]
    fn all_is_read_in_two_queries() {
        let mut introduction = Introduction::again();
        assert_eq!(introduction.next(), Some(AGAIN.as_slice()));
        let integer = Reading::Integer;
        introduction.answered(answer(vec![text("F5"), text("cell 4"), integer(6), integer(7), integer(135)]));
        assert_eq!(introduction.next(), Some([Address::RemoteCmdLen].as_slice()));
        introduction.answered(answer(vec![integer(3)]));
        assert_eq!(introduction.next(), None);
        let found = introduction.found();
        assert_eq!(found.identity.machine_name.as_deref(), Some("cell 4"));
        assert_eq!(found.identity.firmware.as_deref(), Some("F5"));
        assert_eq!(found.identity.axis_count, Some(6));
        assert_eq!(
            (found.mode, found.alarm, found.list_length),
            (Some(OperationMode::Running), Some(135), Some(3))
        );
    }

    #[test]
    fn what_a_firmware_lacks_is_found_out_one_by_one() {
        let mut introduction = Introduction::first();
        introduction.answered(short(2));
        let mut asked = Vec::new();
        while let Some([address]) = introduction.next() {
            if asked.last() != Some(address) {
                asked.push(*address);
            }
            let reply = match address {
                Address::Version => answer(vec![text("F5")]),
                Address::AxisNum => answer(vec![Reading::Integer(4)]),
                _ => short(0),
            };
            introduction.answered(reply);
        }
        assert_eq!(asked, IDENTITY);
        let identity = introduction.found().identity;
        let axis_count = Some(4);
        assert_eq!(identity, Identity { firmware: Some("F5".to_owned()), machine_name: None, axis_count });
        assert_eq!(identity.to_string(), "no machineName, version `F5`, 4 axes");
    }

    #[test]
    fn one_odd_reply_makes_no_other_robot() {
        let odd = || Err(crate::error::NotSent::Disconnected.into());
        let mut introduction = Introduction::first();
        introduction.answered(odd());
        introduction.answered(answer(vec![text("F5")]));
        introduction.answered(answer(vec![text("cell 4")]));
        introduction.answered(odd());
        introduction.answered(short(0));
        assert_eq!(introduction.next(), Some([Address::AxisNum].as_slice()), "asked a third time");
        introduction.answered(answer(vec![Reading::Integer(6)]));
        assert!(introduction.is_certain());
        assert_eq!(introduction.found().identity.axis_count, Some(6));
        let mut introduction = Introduction::first();
        (0..10).for_each(|_| introduction.answered(odd()));
        assert_eq!(introduction.next(), None, "it comes to an end");
        assert!(!introduction.is_certain());
    }

    #[test]
    fn a_controller_that_does_not_say_who_it_is_is_given_up() {
        let mut introduction = Introduction::again();
        assert!(!introduction.timed_out());
        assert_eq!(introduction.next(), Some(AGAIN.as_slice()), "asked again");
        assert!(introduction.timed_out());
    }
}
