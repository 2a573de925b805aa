//! Who reads along on the wires of one client, and knows what its program has asked for.

mod said;

use std::collections::{BTreeMap, BTreeSet};
use std::task::{Context, Waker};
use std::time::Duration;

use r6_client::{Address, Reading};
use serde_json::Value;
use tokio::sync::watch;

use crate::fault::Promise;
use crate::floor::{Floor, SKEW, number_of};
use crate::plan::ClientPlan;
use crate::record::Record;
use crate::wire::whole_frames;
use said::{answers, says_ok, tells};

/// The longest frame that a client sends unless it is told otherwise.
const MOST_BYTES: usize = 2048;

/// What came is remembered for so long: no answer is made of what came earlier.
const REMEMBERED: Duration = Duration::from_secs(70);

/// And no more of it than this, bytes: some replies are 200 000 bytes too long.
const MOST_REMEMBERED: usize = 16 << 20;

/// Who is asked who it is on a new connection.
const WHO: [&str; 5] = ["version", "machineName", "axisNum", "curMode", "curAlarm"];

/// One connection.
#[derive(Debug, Default)]
struct Connection {
    /// Bytes that left and are no whole frame yet.
    begun: Vec<u8>,
    sent: Vec<Sent>,
    came: Vec<u8>,
    /// How many bytes came before those.
    forgotten: usize,
    /// Where the bytes begin that came at a time.
    marks: Vec<(Duration, usize)>,
    /// Replies that answered a command already: where they end.
    used: BTreeSet<usize>,
    /// Whether somebody was asked who is there.
    asked_who: bool,
}

/// A frame that left.
#[derive(Clone, Debug)]
struct Sent {
    at: Duration,
    frame: Value,
}

/// A motion that is being streamed.
#[derive(Debug)]
struct Run {
    steps: BTreeSet<i64>,
    /// When it was asked for.
    begun: Duration,
    /// The connection that it began on.
    on: Option<usize>,
}

/// All connections of one client's program, or of those that came after it when it was killed.
#[derive(Debug)]
pub struct Line {
    robot: usize,
    patience: Duration,
    connections: Vec<Connection>,
    /// Connections before the present program was started.
    before: usize,
    runs: BTreeMap<u64, Run>,
    next_run: u64,
    sent_steps: BTreeSet<i64>,
    values: BTreeMap<i64, u32>,
    /// Calls under way that may send steps that nobody numbered.
    pub unnumbered: u32,
    /// Starts that the program asked for, and those that left.
    pub starts_asked: u64,
    starts_sent: u64,
    /// The number that the next step has.
    pub next_step: i64,
    /// The value that was written last.
    pub next_value: i64,
    /// Whether its program has done its work, and whether all worked then.
    pub is_done: bool,
    pub is_well: bool,
    /// The number of connections, whenever it grows.
    pub news: watch::Sender<usize>,
    deaf: bool,
    /// The network is away, and nothing has left since.
    held: bool,
    waker: Option<Waker>,
}

impl Line {
    /// Nobody has connected yet.
    #[must_use]
    pub fn new(plan: &ClientPlan) -> Self {
        let (connections, runs, sent_steps, values) = Default::default();
        Self {
            robot: plan.robot,
            patience: plan.patience,
            connections,
            before: 0,
            runs,
            next_run: 0,
            sent_steps,
            values,
            unnumbered: 0,
            starts_asked: 0,
            starts_sent: 0,
            next_step: 0,
            next_value: 0,
            is_done: false,
            is_well: false,
            news: watch::Sender::new(0),
            deaf: false,
            held: false,
            waker: None,
        }
    }

    /// The program is killed: what it asked for is nobody's business any more.
    pub fn program_ends(&mut self) {
        self.runs.clear();
        (self.unnumbered, self.starts_asked) = (0, self.starts_sent);
        self.before = self.connections.len();
        (self.is_done, self.is_well) = (false, false);
    }

    /// Its program streams these steps from now on.
    pub fn run_begins(&mut self, begun: Duration, steps: &[i64]) -> u64 {
        self.next_run += 1;
        self.runs.insert(self.next_run, Run { steps: steps.iter().copied().collect(), begun, on: None });
        self.next_run
    }

    /// Whether nothing is under way that may send a list, and the program is not on its first connection.
    #[must_use]
    pub fn is_free_to_be_hasty(&self) -> bool {
        self.runs.is_empty() && self.unnumbered == 0 && self.connections.len() > self.before + 1
    }

    /// Nothing of it may leave any more.
    pub fn run_ends(&mut self, run: u64) {
        self.runs.remove(&run);
    }

    /// How often this value left.
    #[must_use]
    pub fn times_sent(&self, value: i64) -> u32 {
        self.values.get(&value).copied().unwrap_or(0)
    }

    /// The number of its robot.
    #[must_use]
    pub fn robot(&self) -> usize {
        self.robot
    }

    /// Whether these steps left.
    #[must_use]
    pub fn has_sent(&self, step: i64) -> bool {
        self.sent_steps.contains(&step)
    }

    /// Reads nothing from now on, or goes on.
    pub fn deafen(&mut self, deaf: bool) {
        self.deaf = deaf;
        if let Some(waker) = self.waker.take() {
            waker.wake();
        }
    }

    /// The network is away from now on, or there again.
    pub fn hold(&mut self, held: bool) {
        self.held = held;
    }

    /// Something leaves: whether the network is away, and nothing else has left since.
    pub fn feels_hold(&mut self) -> bool {
        std::mem::take(&mut self.held)
    }

    /// Whether a motion of its program is under way.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        !self.runs.is_empty() || self.unnumbered > 0
    }

    /// Whether nothing came over this connection yet.
    #[must_use]
    pub fn has_heard_nothing(&self, number: usize) -> bool {
        self.connections[number].marks.is_empty() && self.connections[number].forgotten == 0
    }

    /// Whether it reads nothing.
    pub fn is_deaf(&mut self, cx: &Context<'_>) -> bool {
        if self.deaf {
            self.waker = Some(cx.waker().clone());
        }
        self.deaf
    }

    /// A connection was made; its number.
    pub fn connected(&mut self, record: &mut Record) -> usize {
        if self.connections.len() > self.before {
            record.tally.reconnects += 1;
        }
        if let Some(last) = self.connections.last_mut() {
            // What came over it and was not delivered never will be.
            last.begun = Vec::new();
        }
        self.connections.push(Connection::default());
        self.news.send_replace(self.connections.len());
        self.connections.len() - 1
    }

    /// Bytes left; whether there is a command among them that another's motion may feel.
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

    /// A whole frame has left.
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
        let word = frame["cmdData"][0].as_str().unwrap_or_default();
        let is_list = frame["reqType"] == "AddRCC";
        let acts =
            is_list || (frame["reqType"] == "command" && !["actionStop", "actionPause"].contains(&word));
        if acts && number > self.before {
            let asked = connection.asked_who;
            record.check(Promise::I4, at, asked, || format!("sent to nobody knows whom: {frame}"));
        }
        let starts = ["startButton", "actionSingleCycle", "clearAlarmRunNext", "clearAlarmContinue"];
        if starts.contains(&word) {
            self.starts_sent += 1;
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
        floors[self.robot].lists_sent += 1;
        // Where nobody numbered the step, a program sent it by itself, and when it looked is its own business. What streams steps looks by
        // itself once it was asked to, whoever else did before.
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

    /// When the last look at mode and alarm on this connection was answered; for a motion that was asked for at a time: the last look of
    /// its own.
    fn seen_before(&self, at: Duration, number: usize, asked: Option<Duration>) -> Option<Duration> {
        let connection = &self.connections[number];
        // On a connection that was made anew neither what a subscription polls counts nor the question who is there: the program itself
        // has to look. The first one begins with the program.
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

    /// Bytes came.
    pub fn received(&mut self, at: Duration, number: usize, bytes: &[u8], record: &mut Record) {
        record.tally.frames += 1;
        let connection = &mut self.connections[number];
        connection.forget(at);
        connection.marks.push((at, connection.forgotten + connection.came.len()));
        connection.came.extend_from_slice(bytes);
    }

    /// A command with this value was answered with ok: whole replies came since it left that say so (I1), and one of them has its number,
    /// came in time, and answers nothing else (I2).
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

    /// A value was delivered: a whole frame that came since then has it.
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
    }
}

impl Connection {
    /// Forgets what came long ago, in large pieces.
    fn forget(&mut self, at: Duration) {
        let is_old = self.marks.first().is_some_and(|(first, _)| *first + REMEMBERED * 2 < at);
        if !is_old && self.came.len() <= MOST_REMEMBERED {
            return;
        }
        let keep = self.marks.partition_point(|(mark, _)| *mark + REMEMBERED < at).max(self.marks.len() / 2);
        let Some((_, begin)) = self.marks.get(keep).copied() else { return };
        self.came.drain(..begin - self.forgotten);
        self.marks.drain(..keep);
        self.forgotten = begin;
    }

    /// The whole frames that came from then on: when the last byte came, where it ends, and its text.
    fn since(&self, from: Duration) -> Vec<(Duration, usize, String)> {
        let Some((_, begin)) = self.marks.iter().find(|(at, _)| *at >= from) else { return Vec::new() };
        let bytes = self.came.get(begin - self.forgotten..).unwrap_or_default();
        let frames = whole_frames(bytes).map(|(first, end)| {
            let mark = self.marks.partition_point(|(_, start)| *start < begin + end);
            let at = self.marks.get(mark.saturating_sub(1)).map_or(Duration::ZERO, |(at, _)| *at);
            (at, begin + end, String::from_utf8_lossy(&bytes[first..end]).into_owned())
        });
        frames.collect()
    }
}

/// The number of a step on the wire.
fn number_in(step: &Value) -> i64 {
    number_of(step["m1"].as_str().and_then(|place| place.parse().ok()).unwrap_or(0.0))
}
