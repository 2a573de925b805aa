//! Received bytes, and whether they support what the program hears.

use std::time::Duration;

use r6_client::{Address, Reading};

use super::Line;
use super::lenient::{answers, says_ok, tells};
use crate::fault::Promise;
use crate::floor::SKEW;
use crate::record::Record;

impl Line {
    /// Bytes arrived.
    pub fn received(&mut self, at: Duration, number: usize, bytes: &[u8], record: &mut Record) {
        record.tally.frames += 1;
        let connection = &mut self.connections[number];
        connection.forget(at);
        connection.marks.push((at, connection.forgotten + connection.came.len()));
        connection.came.extend_from_slice(bytes);
    }

    /// Checks that a command with this value was answered with ok. A complete reply since it was sent must
    /// say so (I1). Such a reply must have the command's number, must be in time, and must not have answered
    /// another command (I2).
    pub fn answered(&mut self, value: i64, since: Duration, at: Duration, record: &mut Record) {
        let (patience, found) = (self.patience + SKEW * 2, value.to_string());
        let (mut came, mut answered) = (false, false);
        for connection in &mut self.connections {
            let Some(sent) = connection.sent.iter().rev().find(|sent| {
                sent.at + SKEW >= since && sent.frame["cmdData"][2].as_str() == Some(found.as_str())
            }) else {
                continue;
            };
            let (frame, sent_at) = (sent.frame.clone(), sent.at);
            let mut replies = connection.since(sent_at);
            replies.retain(|(_, _, reply)| says_ok(reply));
            came |= !replies.is_empty();
            let own = replies.into_iter().find(|(when, end, reply)| {
                answers(reply, &frame) && *when <= sent_at + patience && !connection.used.contains(end)
            });
            if let Some((_, end, _)) = own {
                connection.used.insert(end);
                answered = true;
            }
        }
        record.check(Promise::I1, at, came, || {
            format!("{value} was answered with ok, they say, and no whole frame came since that says ok")
        });
        record.check(Promise::I2, at, answered || !came, || {
            format!("{value} was answered, they say, and no reply of its own came in time that answers nothing else")
        });
    }

    /// Checks a delivered value: a complete frame since then must contain it.
    pub fn delivered(
        &self,
        (address, reading): (Address, &Reading),
        since: Duration,
        at: Duration,
        record: &mut Record,
    ) {
        let wanted = address.to_string();
        let supported = self.connections.iter().rev().any(|connection| {
            let frames = connection.since(since.saturating_sub(SKEW));
            frames.iter().rev().any(|(_, _, frame)| tells(frame, &wanted, reading))
        });
        record.check(Promise::I1, at, supported, || {
            format!("{wanted} is {reading} they say, and no whole frame since {since:?} says so")
        });
        if self.connections.iter().all(|connection| connection.robot == self.robot) {
            return record.check(Promise::Fresh, at, true, String::new);
        }
        let is_own =
            self.connections.iter().rev().filter(|connection| connection.robot == self.robot).any(|own| {
                let frames = own.since(since.saturating_sub(SKEW));
                frames.iter().rev().any(|(_, _, frame)| tells(frame, &wanted, reading))
            });
        record.check(Promise::Fresh, at, is_own || !supported, || {
            format!("{wanted} is {reading} they say of robot-{}, and only another robot said so", self.robot)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor::Floor;
    use crate::plan::ClientPlan;

    const PATIENCE: Duration = Duration::from_secs(1);

    fn ms(millis: u64) -> Duration {
        Duration::from_millis(millis)
    }

    /// The first broken promise if a command with number 5 and value 77 counts as answered with ok, after
    /// these replies at these times.
    fn broken(replies: &[(u64, &str)]) -> Option<Promise> {
        let plan = ClientPlan {
            robot: 0,
            seed: 1,
            every: ms(100),
            patience: PATIENCE,
            beats: false,
            moves: false,
            drops: false,
            mishap: None,
            watches: true,
            asks: true,
        };
        let (mut line, mut record) = (Line::new(&plan), Record::new(false));
        let number = line.connected(0, Duration::ZERO, &mut record);
        let frame = r#"{"reqType":"command","packID":"5","cmdData":["rewriteData","860","77","0"]}"#;
        line.sent(ms(100), number, frame.as_bytes(), &mut [Floor::new(0)], &mut record);
        for (at, reply) in replies {
            line.received(ms(*at), number, reply.as_bytes(), &mut record);
        }
        line.answered(77, ms(100), ms(5000), &mut record);
        record.violation.map(|violation| violation.promise)
    }

    #[test]
    fn what_never_came_and_what_answers_something_else_are_two_failures() {
        let own = r#"{"reqType":"command","packID":"5","cmdReply":["rewriteData","ok"]}"#;
        let other = r#"{"reqType":"command","packID":"4","cmdReply":["rewriteData","ok"]}"#;
        let refused = r#"{"reqType":"command","packID":"5","cmdReply":["rewriteData","err"]}"#;
        let part = own.get(..own.len() - 1).unwrap();
        for (replies, promise) in [
            (vec![], Some(Promise::I1)),
            (vec![(50, own)], Some(Promise::I1)),
            (vec![(200, part)], Some(Promise::I1)),
            (vec![(200, refused)], Some(Promise::I1)),
            (vec![(200, other)], Some(Promise::I2)),
            (vec![(3000, own)], Some(Promise::I2)),
            (vec![(200, own)], None),
            (vec![(200, other), (300, own)], None),
        ] {
            assert_eq!(broken(&replies), promise, "{replies:?}");
        }
    }
}
