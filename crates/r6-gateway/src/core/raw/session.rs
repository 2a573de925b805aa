//! One client of a raw port: its frames, its replies in their order, and its limits.
//!
//! Bytes and times come in; requests, replies and the next deadline go out. A request is answered with
//! [`Session::answer`], whenever that is possible: replies leave in the order of the requests. A stop is
//! handed out at once, ahead of requests that wait.

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use r6_proto::dialect::Dialect;
use r6_proto::frame::{FrameBuffer, FrameFault, Limits};
use r6_proto::message::Header;
use r6_proto::reply::{ReplyWriter, Verdict, encode_photo};
use r6_proto::time::Instant;
use r6_proto::value::Values;
use r6_proto::{Body, Decoder, Message, RequestType};

use super::asked::{Asked, asked};
use crate::core::camera::Camera;

/// How many requests of one client may wait or be under way, and how many stops besides. Scripts send one at
/// a time.
pub const MAX_WAITING: usize = 8;

/// How many bytes of replies may wait for a client that does not read. A usual reply is below 4 KiB.
pub const MAX_OUTPUT: usize = 64 * 1024;

/// How long a frame may take from its first byte to its last.
pub const HALF_FRAME: Duration = Duration::from_secs(10);

/// The longest frame. Controllers take 4 KiB at most.
pub const MAX_FRAME: usize = 16 * 1024;

/// How many broken frames in a row end a connection. Controllers pass over them, and so does this, but not
/// without end.
pub const MAX_BROKEN: u32 = 16;

/// Why a connection was closed by the gateway.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// No rule allows this source.
    Denied,
    /// The robot has as many clients as it may have.
    TooManyClients,
    /// The robot does not answer, or another connection to it began.
    RobotDown,
    /// Too many requests waited.
    TooManyRequests,
    /// The client does not read its replies.
    SlowReader,
    /// A frame did not end in time.
    HalfFrame,
    /// A frame was too long.
    LongFrame,
    /// Broken frame after broken frame came, or something else before the first frame.
    Garbage,
}

impl Cause {
    /// All causes.
    pub const ALL: [Self; 8] = [
        Self::Denied,
        Self::TooManyClients,
        Self::RobotDown,
        Self::TooManyRequests,
        Self::SlowReader,
        Self::HalfFrame,
        Self::LongFrame,
        Self::Garbage,
    ];

    /// Its word in the metrics.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Denied => "denied",
            Self::TooManyClients => "too_many_clients",
            Self::RobotDown => "robot_down",
            Self::TooManyRequests => "too_many_requests",
            Self::SlowReader => "slow_reader",
            Self::HalfFrame => "half_frame",
            Self::LongFrame => "long_frame",
            Self::Garbage => "garbage",
        }
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// Names one request of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Ticket(u64);

/// The answer to a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The values of a query as the controller wrote them.
    Values(Vec<Vec<u8>>),
    /// The controller accepted the command.
    Accepted,
    /// The controller has taken the points of a camera: how many, if it said that.
    Taken(Option<usize>),
    /// Nothing was done, or the controller refused it, for this reason. Controllers do not always give one.
    Refused(Option<String>),
    /// No reply: it is not known what the controller did, or controllers do not answer this.
    Silence,
}

/// One client.
#[derive(Debug)]
pub struct Session {
    frames: FrameBuffer,
    decoder: Decoder,
    /// Since when the present frame is incomplete.
    half_since: Option<Instant>,
    broken: u32,
    /// Whether the first byte of a frame came.
    has_begun: bool,
    next_ticket: u64,
    /// The requests whose replies have not left, oldest first.
    waiting: VecDeque<Waiting>,
    /// Replies that may leave.
    output: VecDeque<Vec<u8>>,
    /// How much of the first of them has left.
    left: usize,
    closed: Option<Cause>,
}

#[derive(Debug)]
struct Waiting {
    ticket: Ticket,
    /// Its reply repeats parts of it.
    frame: Vec<u8>,
    is_stop: bool,
    state: State,
}

#[derive(Debug)]
enum State {
    New(Asked),
    UnderWay,
    Answered(Vec<u8>),
}

impl Default for Session {
    fn default() -> Self {
        Self::new()
    }
}

impl Session {
    /// A new client.
    #[must_use]
    pub fn new() -> Self {
        let limits = Limits { max_frame_bytes: MAX_FRAME, ..Limits::default() };
        Self {
            frames: FrameBuffer::new(limits),
            decoder: Decoder::new(),
            half_since: None,
            broken: 0,
            has_begun: false,
            next_ticket: 0,
            waiting: VecDeque::new(),
            output: VecDeque::new(),
            left: 0,
            closed: None,
        }
    }

    /// Takes in bytes. Returns how many complete frames were among them.
    pub fn handle_input(&mut self, now: Instant, bytes: &[u8]) -> usize {
        if !self.has_begun {
            // A web page can make a browser send a frame in the body of a request. But no request begins as a
            // frame does.
            match bytes.iter().find(|byte| !byte.is_ascii_whitespace()) {
                None => {}
                Some(b'{') => self.has_begun = true,
                Some(_) => {
                    self.closed.get_or_insert(Cause::Garbage);
                }
            }
        }
        let (mut rest, mut frames) = (bytes, 0);
        while self.closed.is_none() {
            let taken = self.frames.push(rest);
            rest = rest.get(taken..).unwrap_or_default();
            frames += self.take_frames();
            if rest.is_empty() {
                break;
            }
        }
        self.half_since = if self.frames.pending() > 0 { self.half_since.or(Some(now)) } else { None };
        frames
    }

    fn take_frames(&mut self) -> usize {
        let mut frames = 0;
        while self.closed.is_none()
            && let Some(next) = self.frames.next()
        {
            self.half_since = None;
            let message = match next {
                Ok(frame) => self.decoder.decode(frame.bytes).ok(),
                Err(error) if matches!(error.fault, FrameFault::TooLarge { .. }) => {
                    self.closed = Some(Cause::LongFrame);
                    None
                }
                Err(_) => None,
            };
            let Some(message) = message else {
                self.broken += 1;
                if self.broken >= MAX_BROKEN {
                    self.closed.get_or_insert(Cause::Garbage);
                }
                continue;
            };
            (self.broken, frames) = (0, frames + 1);
            let Some(asked) = asked(&message) else { continue };
            let is_stop = matches!(asked, Asked::Stop(_));
            let ticket = Ticket(self.next_ticket);
            self.next_ticket += 1;
            let frame = message.frame().to_vec();
            self.waiting.push_back(Waiting { ticket, frame, is_stop, state: State::New(asked) });
            let same = |waiting: &&Waiting| {
                waiting.is_stop == is_stop && !matches!(waiting.state, State::Answered(_))
            };
            if self.waiting.iter().filter(same).count() > MAX_WAITING {
                self.closed.get_or_insert(Cause::TooManyRequests);
            }
        }
        frames
    }

    /// The next request to carry out: a stop, or the oldest request once those before it are answered.
    ///
    /// Stops are handed out even if the connection is to be closed.
    pub fn poll_request(&mut self) -> Option<(Ticket, Asked)> {
        let stop =
            self.waiting.iter().position(|waiting| waiting.is_stop && matches!(waiting.state, State::New(_)));
        let at = match stop {
            Some(at) => at,
            None if self.closed.is_some() => return None,
            // Everything else goes one by one: a script expects its requests to be carried out in order.
            None => self.waiting.iter().position(|waiting| !matches!(waiting.state, State::Answered(_)))?,
        };
        let waiting = self.waiting.get_mut(at)?;
        match std::mem::replace(&mut waiting.state, State::UnderWay) {
            State::New(asked) => Some((waiting.ticket, asked)),
            other => {
                waiting.state = other;
                None
            }
        }
    }

    /// The client may do nothing any more. What it has sent is not carried out, except for stops.
    pub fn close(&mut self, cause: Cause) {
        self.closed.get_or_insert(cause);
    }

    /// Tells the client that the controller asks for a photo of this camera, as the controller does.
    pub fn push_photo(&mut self, camera: Camera) {
        let mut frame = Vec::new();
        encode_photo(camera.number().into(), None, &mut frame);
        self.output.push_back(frame);
        self.limit_output();
    }

    /// Answers a request in this dialect. Its reply leaves after those of earlier requests.
    pub fn answer(&mut self, ticket: Ticket, dialect: Dialect, answer: &Answer) {
        let Some(waiting) = self.waiting.iter_mut().find(|waiting| waiting.ticket == ticket) else { return };
        let reply = match self.decoder.decode(&waiting.frame) {
            Ok(message) => reply(&message, dialect, answer),
            // It was decoded before.
            Err(_) => Vec::new(),
        };
        waiting.state = State::Answered(reply);
        while let Some(Waiting { state: State::Answered(_), .. }) = self.waiting.front() {
            if let Some(Waiting { state: State::Answered(reply), .. }) = self.waiting.pop_front()
                && !reply.is_empty()
            {
                self.output.push_back(reply);
            }
        }
        self.limit_output();
    }

    /// Gives up a client that does not read.
    fn limit_output(&mut self) {
        let held = self.waiting.iter().map(|waiting| match &waiting.state {
            State::Answered(reply) => reply.len(),
            State::New(_) | State::UnderWay => 0,
        });
        let bytes = self.output.iter().map(Vec::len).chain(held).sum::<usize>() - self.left;
        if bytes > MAX_OUTPUT {
            self.closed.get_or_insert(Cause::SlowReader);
        }
    }

    /// The rest of the frame that leaves next. No two frames are joined: old clients read with one call.
    #[must_use]
    pub fn poll_transmit(&self) -> Option<&[u8]> {
        self.output.front()?.get(self.left..)
    }

    /// The first `bytes` of [`Self::poll_transmit`] have left.
    pub fn transmitted(&mut self, bytes: usize) {
        self.left += bytes;
        if self.output.front().is_some_and(|frame| frame.len() <= self.left) {
            self.output.pop_front();
            self.left = 0;
        }
    }

    /// When to call [`Self::handle_timeout`].
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        self.half_since.map(|since| since + HALF_FRAME)
    }

    /// Gives up a client whose frame does not end.
    pub fn handle_timeout(&mut self, now: Instant) {
        if self.poll_timeout().is_some_and(|due| due <= now) {
            self.closed.get_or_insert(Cause::HalfFrame);
        }
    }

    /// Why the connection has to be closed, if it has to be.
    #[must_use]
    pub fn closed(&self) -> Option<Cause> {
        self.closed
    }

    /// Whether all requests are answered, and all replies have left.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.waiting.is_empty() && self.output.is_empty()
    }
}

/// The reply to a request; empty for none.
fn reply(message: &Message<'_>, dialect: Dialect, answer: &Answer) -> Vec<u8> {
    let mut out = Vec::new();
    let header = &message.header;
    if header.type_word.is_none() {
        return out;
    }
    match (&message.body, answer) {
        (_, Answer::Silence) => {}
        (body @ (Body::Query(_) | Body::Rejected(_)), Answer::Values(values)) => {
            let addresses = match body {
                Body::Query(query) => query.addresses,
                _ => Values::EMPTY,
            };
            writer(header, dialect, RequestType::Query).query(addresses, &mut out, |data| {
                values.iter().for_each(|value| data.wire(value));
            });
        }
        (_, Answer::Values(_)) => {}
        (body, Answer::Accepted | Answer::Taken(None)) => {
            verdict(body, header, dialect, Verdict::Ok, &mut out);
        }
        (body, Answer::Taken(Some(count))) => {
            verdict(body, header, dialect, Verdict::Points(*count), &mut out);
        }
        (body, Answer::Refused(Some(reason))) => {
            verdict(body, header, dialect, Verdict::Err(reason), &mut out);
        }
        (body, Answer::Refused(None)) => verdict(body, header, dialect, Verdict::BareErr, &mut out),
    }
    out
}

fn verdict(body: &Body<'_>, header: &Header<'_>, dialect: Dialect, verdict: Verdict<'_>, out: &mut Vec<u8>) {
    let (request, word) = match body {
        Body::Command(words) => (RequestType::Command, words.word()),
        Body::AddRcc(_) => (RequestType::AddRcc, "AddRCC".into()),
        Body::AddPoints(_) => (RequestType::AddPoints, "AddPoints".into()),
        Body::Rejected(rejection) => match rejection.request {
            RequestType::Command => (RequestType::Command, "".into()),
            request => (request, request.word().into()),
        },
        // A query has no place for a reason: it stays without a reply.
        Body::Query(_)
        | Body::Heartbreak
        | Body::PhotoAnswer(_)
        | Body::Unknown(_)
        | Body::QueryReply(_)
        | Body::CommandReply(_)
        | Body::Photo(_) => return,
    };
    writer(header, dialect, request).verdict(&word, verdict, out);
}

fn writer<'h>(header: &Header<'h>, dialect: Dialect, request: RequestType) -> ReplyWriter<'h> {
    ReplyWriter::new(dialect, *header, request)
}

#[cfg(test)]
mod tests;
