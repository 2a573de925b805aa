//! Sent frames: whether they may be sent, and whether they are sent for the first time.

use std::time::Duration;

use serde_json::Value;

use super::connection::Sent;
use super::lenient::answers;
use super::{Line, Run};
use crate::fault::Promise;
use crate::floor::{Floor, SKEW, number_of};
use crate::record::Record;

/// The longest frame that a client sends with the default settings.
const MOST_BYTES: usize = 2048;

/// The addresses of the identity query on a new connection.
const WHO: [&str; 5] = ["version", "machineName", "axisNum", "curMode", "curAlarm"];

impl Line {
    /// Records sent bytes. Returns whether they contain a command that can affect the motion of another
    /// client.
    pub fn sent(
        &mut self,
        at: Duration,
        number: usize,
        bytes: &[u8],
        floors: &mut [Floor],
        record: &mut Record,
    ) -> bool {
        let connection = &mut self.connections[number];
        connection.begun.extend_from_slice(bytes);
        let mut frames = Vec::new();
        let mut stream = serde_json::Deserializer::from_slice(&connection.begun).into_iter::<Value>();
        let mut end = 0;
        while let Some(Ok(frame)) = stream.next() {
            frames.push((frame, stream.byte_offset() - end));
            end = stream.byte_offset();
        }
        drop(stream);
        connection.begun.drain(..end);
        let commands = frames.iter().any(|(frame, _)| {
            frame["reqType"] == "AddRCC"
                || (frame["reqType"] == "command" && frame["cmdData"][0] != "rewriteData")
        });
        for (frame, length) in frames {
            record.tally.frames += 1;
            record.check(Promise::I6, at, length <= MOST_BYTES, || format!("a frame of {length} bytes"));
            self.left(at, number, &frame, floors, record);
            self.connections[number].sent.push(Sent { at, frame });
        }
        commands
    }

    /// A complete frame was sent.
    fn left(
        &mut self,
        at: Duration,
        number: usize,
        frame: &Value,
        floors: &mut [Floor],
        record: &mut Record,
    ) {
        let connection = &mut self.connections[number];
        connection.asked_who |= frame["queryAddr"] == serde_json::json!(WHO);
        if frame["reqType"] == "heartbreak" {
            connection.beaten = at;
        }
        let word = frame["cmdData"][0].as_str().unwrap_or_default();
        let is_list = frame["reqType"] == "AddRCC";
        let stops = ["actionStop", "actionPause", "stopButton"].contains(&word)
            || (is_list && frame["instructions"].as_array().is_some_and(Vec::is_empty));
        let to = connection.robot;
        if stops {
            self.last_stop = Some(at);
            let meant = to == self.robot;
            record.check(Promise::Meant, at, meant, || {
                format!("meant for robot-{}, and reaches robot-{to}: {frame}", self.robot)
            });
        }
        let connection = &self.connections[number];
        let acts =
            is_list || (frame["reqType"] == "command" && !["actionStop", "actionPause"].contains(&word));
        if acts && number > self.before {
            let asked = connection.asked_who;
            record.check(Promise::I4, at, asked, || format!("sent to nobody knows whom: {frame}"));
        }
        let starts = ["startButton", "actionSingleCycle", "clearAlarmRunNext", "clearAlarmContinue"];
        if starts.contains(&word) {
            self.starts_sent += 1;
            floors[to].is_commanded(at);
            let holds = self.starts_sent <= self.starts_asked;
            record.check(Promise::I4, at, holds, || format!("a start that nobody asked for: {frame}"));
        }
        if word == "rewriteData" {
            let value = frame["cmdData"][2].as_str().and_then(|value| value.parse().ok()).unwrap_or(0);
            let times = self.values.entry(value).or_insert(0);
            *times += 1;
            let once = *times == 1;
            record.check(Promise::Once, at, once, || format!("{value} left twice"));
        }
        let steps = frame["instructions"].as_array().filter(|_| is_list);
        let Some(steps) = steps.filter(|steps| !steps.is_empty()) else { return };
        floors[to].lists_sent += 1;
        floors[to].is_commanded(at);
        // A step without a number was sent directly by a program, and the program decides when to read the
        // status. A streamed motion must read the status itself after it was asked for, whatever was read
        // before.
        let is_streamed = steps.iter().all(|step| number_in(step) > 0);
        let streams =
            |run: &&Run| is_streamed && steps.iter().any(|step| run.steps.contains(&number_in(step)));
        let asked = self.runs.values().find(streams).map(|run| run.begun);
        let seen = self.seen_before(at, number, asked);
        let most = if is_streamed { self.patience * 4 + Duration::from_secs(1) } else { Duration::MAX };
        let is_own_business = !is_streamed && number == self.before;
        let fresh = is_own_business || seen.is_some_and(|seen| at.saturating_sub(seen) <= most);
        record.check(Promise::I3, at, fresh, || {
            format!("a list without a look, the last at {seen:?}: {frame}")
        });
        for step in steps {
            self.step_left(at, number, number_in(step), record);
        }
    }

    fn step_left(&mut self, at: Duration, number: usize, step: i64, record: &mut Record) {
        if step <= 0 {
            let asked = self.unnumbered > 0;
            record.check(Promise::I4, at, asked, || "a step that nobody asked for".to_owned());
            return;
        }
        let once = self.sent_steps.insert(step);
        record.check(Promise::Once, at, once, || format!("step {step} left twice"));
        let Some(run) = self.runs.values_mut().find(|run| run.steps.contains(&step)) else {
            return record
                .check(Promise::I4, at, false, || format!("step {step} leaves, and its motion is over"));
        };
        let on = *run.on.get_or_insert(number);
        record.check(Promise::I4, at, on == number, || {
            format!("step {step} leaves on connection {number}, and its motion began on {on}: resumed")
        });
    }

    /// When the last query of mode and alarm on this connection was answered. For a motion that was asked for
    /// at `asked`: the last query of its own.
    fn seen_before(&self, at: Duration, number: usize, asked: Option<Duration>) -> Option<Duration> {
        let connection = &self.connections[number];
        // After a reconnect, neither the polls of a subscription nor the identity query count: the program
        // itself has to read the status. The first connection begins with the program.
        let looks = |sent: &&Sent| {
            let Some(addresses) = sent.frame["queryAddr"].as_array() else { return false };
            let has = |wanted: &str| addresses.iter().any(|address| address == wanted);
            let is_who = sent.frame["queryAddr"] == serde_json::json!(WHO);
            let is_polled = has("axis-0") && !has("isMoving");
            let is_own = !(is_polled || is_who);
            has("curAlarm")
                && match asked {
                    Some(asked) => is_own && sent.at >= asked,
                    None => is_own || number == self.before,
                }
        };
        connection.sent.iter().rev().filter(looks).take(100).find_map(|sent| {
            let replies = connection.since(sent.at);
            replies.into_iter().filter(|(when, ..)| *when <= at + SKEW).find_map(|(when, _, reply)| {
                (answers(&reply, &sent.frame) && reply.contains("queryData")).then_some(when)
            })
        })
    }
}

/// The number of a step on the wire.
fn number_in(step: &Value) -> i64 {
    number_of(step["m1"].as_str().and_then(|place| place.parse().ok()).unwrap_or(0.0))
}
