//! The PC's side of one connection, without I/O: requests in, frames out; bytes in, events out.
//!
//! If the firmware echoes the `packID`, the session matches a reply to its request by `packID`. Otherwise it
//! matches by kind, by the command that the reply names, and by order. Without `packID`, a late reply to a
//! timed-out request looks like the reply to the next request. The session then reports [`Event::OutOfStep`],
//! and the caller must reconnect. A reply with more values than the query asked for has the same effect,
//! because it answers an earlier request.

mod matcher;
mod repeated;

use std::collections::VecDeque;
use std::time::Duration;

use self::matcher::{Assigned, Matcher, hash_of_query};
use self::repeated::LastQuery;
use crate::dialect::{Addressing, CommandReplyForm, Dialect, DsIdForm, KeyOrder, ReplyType};
use crate::encode::write_integer;
use crate::error::{EncodeError, JsonError};
use crate::frame::{FrameBuffer, FrameError, Limits};
use crate::message::{Decoder, Message, RequestType, TypeKey};
use crate::request::{LONGEST_ADD_RCC, Request};
use crate::server::PARTIAL_FRAME_TIMEOUT;
use crate::time::Instant;

/// Settings of a client session.
#[derive(Clone, Copy, Debug)]
pub struct ClientSettings {
    /// How long the session waits for a reply. Real controllers reply within 26 ms. The default of 2 s leaves
    /// room for a busy network and is shorter than a person's patience.
    pub reply_timeout: Duration,
    /// The longest frame that the session sends. Controllers neither answer nor execute an AddRCC over 2 048
    /// bytes.
    pub max_frame_bytes: usize,
    /// How many requests may wait for a reply at the same time.
    pub max_in_flight: usize,
    /// The key that carries the request type: `cmdType` for the oldest firmware.
    pub type_key: TypeKey,
    /// The form of `dsID`.
    pub ds_id: DsIdForm,
    /// The `packID` of the first request. After a reconnect, the shell continues the count from here.
    pub first_pack_id: u64,
}

impl Default for ClientSettings {
    fn default() -> Self {
        Self {
            reply_timeout: Duration::from_secs(2),
            max_frame_bytes: LONGEST_ADD_RCC,
            max_in_flight: 64,
            type_key: TypeKey::ReqType,
            ds_id: DsIdForm::Long,
            first_pack_id: 1,
        }
    }
}

/// How many bytes may wait to be written. This is several times the frames of a full window, so the output
/// fills up only when the connection accepts no bytes.
pub const MAX_OUTPUT_BYTES: usize = 1 << 20;

/// Identifies one request of a session; its number is the request's `packID`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(u64);

impl Ticket {
    /// The number sent as `packID`.
    #[must_use]
    pub fn number(self) -> u64 {
        self.0
    }
}

/// Why a request was not sent. Nothing has reached the controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SendError {
    /// A value that the wire cannot carry.
    Encode(EncodeError),
    /// The frame is longer than the controller accepts.
    TooLong {
        /// Length of the frame in bytes.
        bytes: usize,
        /// The limit in bytes.
        limit: usize,
    },
    /// The connection accepts no bytes, and too many bytes already wait to be written.
    OutputFull {
        /// The limit in bytes.
        limit: usize,
    },
    /// Too many requests wait for their replies.
    TooManyInFlight {
        /// The limit.
        limit: usize,
    },
}

impl std::fmt::Display for SendError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Encode(error) => error.fmt(f),
            Self::TooLong { bytes, limit } => write!(
                f,
                "the frame has {bytes} bytes, but the controller takes {limit}: send fewer instructions in one list \
                 and append the rest, or fewer points in a request"
            ),
            Self::OutputFull { limit } => {
                write!(f, "{limit} bytes wait to be written already: the connection takes nothing")
            }
            Self::TooManyInFlight { limit } => write!(f, "{limit} requests wait for their replies already"),
        }
    }
}

impl std::error::Error for SendError {}

/// An event of a client session.
#[derive(Debug)]
pub enum Event<'a> {
    /// The reply to a request.
    Reply {
        /// The request.
        ticket: Ticket,
        /// The reply: a [`QueryReply`](crate::Body::QueryReply), a
        /// [`CommandReply`](crate::Body::CommandReply) or, if the session cannot read it, a
        /// [`Rejected`](crate::Body::Rejected).
        message: Message<'a>,
        /// Time from the request to the reply.
        after: Duration,
    },
    /// The controller asks for a photo. This frame is not a reply.
    Photo {
        /// The camera.
        cam_id: i64,
        /// The frame.
        message: Message<'a>,
    },
    /// A frame that answers no waiting request: it is late, repeated, contradictory, or of another kind.
    Stray {
        /// Why.
        reason: StrayReason,
        /// The frame.
        message: Message<'a>,
    },
    /// Bytes that are not a frame. The session can read the bytes that follow.
    BadFrame(FrameError),
    /// A frame that is not JSON.
    NotJson(JsonError),
    /// No reply came in time. The controller may have acted.
    TimedOut(Ticket),
    /// The connection ended before the reply.
    Lost {
        /// The request.
        ticket: Ticket,
        /// Whether any byte of the request was given to the connection. If not, it is safe to send the
        /// request again.
        left: bool,
    },
    /// The session can no longer match replies with certainty: close the connection and open a new one.
    OutOfStep,
}

/// Why a frame matched no request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StrayReason {
    /// No waiting request has this `packID`: the reply is late, repeated, or meant for another client.
    UnknownPackId,
    /// The `packID` matches, but the reply is of another kind, names another command or echoes other
    /// addresses.
    Contradiction,
    /// No request of this kind is waiting.
    NothingWaits,
    /// An echo of a request.
    Echo,
    /// The reply has no `packID`, and it came after a timeout or has more values than the query asked for. It
    /// may answer an earlier request.
    OutOfStep,
    /// The frame is not a reply.
    NoReply,
}

impl std::fmt::Display for StrayReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::UnknownPackId => "a reply with a packID that nothing waits for",
            Self::Contradiction => "a reply to something else with the same packID",
            Self::NothingWaits => "a reply to something else",
            Self::Echo => "the request itself",
            Self::OutOfStep => "a reply that may answer an earlier request",
            Self::NoReply => "a frame that is no reply",
        })
    }
}

/// What the replies have shown so far about the firmware's dialect; `None` if no reply has shown it yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LearnedDialect {
    /// Replies carry the request's `packID`.
    pub echoes_pack_id: Option<bool>,
    /// Query replies carry the addresses.
    pub echoes_query_addr: Option<bool>,
    /// Command replies name the command (from 2.0.2.1 / 1.6.4 on).
    pub names_command: Option<bool>,
    /// Replies say `queryEcho` or `cmdEcho` (before 2.0.2.1).
    pub echo_types: Option<bool>,
    /// The keys of query replies are in the order of the alphabet, not in that of the manual.
    pub sorts_keys: Option<bool>,
}

impl LearnedDialect {
    /// The dialect of the replies, as far as it is known; the rest as [`Dialect::HC1`].
    ///
    /// The form of counters and the types of replies to AddPoints and AddRCC are not learned.
    #[must_use]
    pub fn dialect(self) -> Dialect {
        let is = |learned: Option<bool>| learned != Some(false);
        let old = self.echo_types == Some(true);
        Dialect {
            key_order: if is(self.sorts_keys) { KeyOrder::Alphabetical } else { KeyOrder::Manual },
            reply_type: if old { ReplyType::Echo } else { ReplyType::AsSent },
            command_reply: match is(self.names_command) {
                true => CommandReplyForm::NameAndVerdict,
                false => CommandReplyForm::Verdict,
            },
            echo_pack_id: is(self.echoes_pack_id),
            echo_query_addr: is(self.echoes_query_addr),
            ..Dialect::HC1
        }
    }
}

#[derive(Debug)]
struct InFlight {
    ticket: Ticket,
    request: RequestType,
    /// The command's word, or `AddPoints` or `AddRCC`.
    word: &'static str,
    /// Hash of a query's addresses. An echo must have the same hash.
    addresses: u64,
    /// Number of addresses.
    count: usize,
    sent_at: Instant,
    deadline: Instant,
    /// Position of the first byte of its frame in the output, counted from the start of the session.
    starts_at: u64,
    /// Length of its frame in bytes.
    bytes: usize,
}

/// The PC's side of one connection.
#[derive(Debug)]
pub struct ClientSession {
    settings: ClientSettings,
    frames: FrameBuffer,
    decoder: Decoder,
    last_byte: Instant,
    output: Vec<u8>,
    /// How many bytes of `output` were transmitted, and how many bytes before it.
    transmitted: usize,
    transmitted_before: u64,
    next_ticket: u64,
    /// The digits of a `packID`, while a request is being written.
    digits: Vec<u8>,
    last_query: LastQuery,
    in_flight: VecDeque<InFlight>,
    timed_out: VecDeque<Ticket>,
    lost: VecDeque<(Ticket, bool)>,
    partial_error: Option<FrameError>,
    learned: LearnedDialect,
    out_of_step: OutOfStep,
}

/// Whether the session can still match replies without `packID`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OutOfStep {
    No,
    /// A request timed out before the session knew whether the firmware echoes `packID`.
    IfNotEchoed,
    /// It cannot; the event is not reported yet.
    Due,
    /// It cannot; the event was reported.
    Said,
}

impl ClientSession {
    /// Creates a session for a new connection.
    #[must_use]
    pub fn new(settings: ClientSettings) -> Self {
        Self {
            settings,
            frames: FrameBuffer::new(Limits::default()),
            decoder: Decoder::new(),
            last_byte: Instant::ORIGIN,
            output: Vec::new(),
            transmitted: 0,
            transmitted_before: 0,
            next_ticket: settings.first_pack_id,
            digits: Vec::new(),
            last_query: LastQuery::default(),
            in_flight: VecDeque::new(),
            timed_out: VecDeque::new(),
            lost: VecDeque::new(),
            partial_error: None,
            learned: LearnedDialect::default(),
            out_of_step: OutOfStep::No,
        }
    }

    /// Appends a request to the output.
    ///
    /// # Errors
    /// [`SendError`]: nothing was appended.
    pub fn send(&mut self, now: Instant, request: &Request<'_>) -> Result<Ticket, SendError> {
        let waits = request.expects_reply();
        if waits && self.in_flight.len() >= self.settings.max_in_flight {
            return Err(SendError::TooManyInFlight { limit: self.settings.max_in_flight });
        }
        self.compact();
        if self.output.len() > MAX_OUTPUT_BYTES {
            return Err(SendError::OutputFull { limit: MAX_OUTPUT_BYTES });
        }
        let ticket = Ticket(self.next_ticket);
        let before = self.output.len();
        self.digits.clear();
        write_integer(&mut self.digits, i64::try_from(ticket.0).unwrap_or(i64::MAX));
        let addresses = match request {
            Request::Query(addresses) if self.last_query.asks(addresses) => {
                self.last_query.append(&self.digits, &mut self.output)
            }
            Request::Query(_)
            | Request::Command(_)
            | Request::AddRcc { .. }
            | Request::AddPoints(_)
            | Request::Heartbreak
            | Request::PhotoAnswer(_) => self.encode(request)?,
        };
        let bytes = self.output.len() - before;
        if bytes > self.settings.max_frame_bytes {
            self.output.truncate(before);
            return Err(SendError::TooLong { bytes, limit: self.settings.max_frame_bytes });
        }
        self.next_ticket += 1;
        if waits {
            let word = match request {
                Request::Command(command) => command.name().word(),
                Request::Query(_)
                | Request::AddRcc { .. }
                | Request::AddPoints(_)
                | Request::Heartbreak
                | Request::PhotoAnswer(_) => request.request_type().word(),
            };
            let count = if let Request::Query(asked) = request { asked.len() } else { 0 };
            self.in_flight.push_back(InFlight {
                ticket,
                request: request.request_type(),
                word,
                addresses,
                count,
                sent_at: now,
                deadline: now + self.settings.reply_timeout,
                starts_at: self.transmitted_before + u64::try_from(before).unwrap_or(u64::MAX),
                bytes,
            });
        }
        Ok(ticket)
    }

    /// Appends the frame of a request whose `packID` is in `digits`. Returns the hash of a query's addresses.
    fn encode(&mut self, request: &Request<'_>) -> Result<u64, SendError> {
        let before = self.output.len();
        let digits = std::str::from_utf8(&self.digits).unwrap_or_default();
        let addressing = Addressing {
            ds_id: self.settings.ds_id,
            type_key: self.settings.type_key,
            pack_id: request.expects_reply().then_some(digits),
        };
        request.encode(&addressing, &mut self.output).map_err(SendError::Encode)?;
        let Request::Query(addresses) = request else { return Ok(0) };
        let frame = self.output.get(before..).unwrap_or_default();
        let number = hash_of_query(frame, addresses);
        if frame.len() <= self.settings.max_frame_bytes {
            self.last_query.keep(addresses, frame, digits.len(), number);
        }
        Ok(number)
    }

    /// Drops the transmitted bytes once they are at least half of the output, so that each byte moves at most
    /// once.
    fn compact(&mut self) {
        if self.transmitted > 0 && self.transmitted * 2 >= self.output.len() {
            self.transmitted_before += u64::try_from(self.transmitted).unwrap_or(u64::MAX);
            self.output.drain(..self.transmitted);
            self.transmitted = 0;
        }
    }

    /// The bytes that wait to be written to the connection.
    #[must_use]
    pub fn poll_transmit(&self) -> Option<&[u8]> {
        self.output.get(self.transmitted..).filter(|rest| !rest.is_empty())
    }

    /// Records that the first `bytes` of [`Self::poll_transmit`] were given to the connection.
    pub fn transmitted(&mut self, bytes: usize) {
        self.transmitted = (self.transmitted + bytes).min(self.output.len());
    }

    /// Withdraws a request before any byte of it is transmitted. Returns `false` if a part of it was
    /// transmitted, or if it no longer waits.
    pub fn withdraw(&mut self, ticket: Ticket) -> bool {
        let transmitted = self.transmitted_before + u64::try_from(self.transmitted).unwrap_or(u64::MAX);
        let found = self.in_flight.iter().position(|waiting| waiting.ticket == ticket);
        let Some(at) = found else { return false };
        if self.in_flight.get(at).is_none_or(|waiting| waiting.starts_at < transmitted) {
            return false;
        }
        let Some(gone) = self.in_flight.remove(at) else { return false };
        let start = usize::try_from(gone.starts_at - self.transmitted_before).unwrap_or(usize::MAX);
        let end = start.saturating_add(gone.bytes).min(self.output.len());
        if start < end {
            self.output.drain(start..end);
        }
        let bytes = u64::try_from(gone.bytes).unwrap_or(u64::MAX);
        for later in self.in_flight.iter_mut().filter(|waiting| waiting.starts_at > gone.starts_at) {
            later.starts_at -= bytes;
        }
        true
    }

    /// Takes bytes from the controller and returns how many fit; [`Self::poll_event`] returns what they mean.
    /// Pass the rest again after `poll_event` has returned `None`.
    #[must_use = "bytes that were not taken have to be given again"]
    pub fn handle_input(&mut self, now: Instant, bytes: &[u8]) -> usize {
        // A read of zero bytes is not a sign of life.
        if !bytes.is_empty() {
            self.last_byte = now;
        }
        self.frames.push(bytes)
    }

    /// Tells the session the current time. Overdue requests time out, and the session gives up an overdue
    /// incomplete frame.
    pub fn handle_timeout(&mut self, now: Instant) {
        while let Some(at) = self.in_flight.iter().position(|waiting| waiting.deadline <= now) {
            if let Some(waiting) = self.in_flight.remove(at) {
                self.timed_out.push_back(waiting.ticket);
                self.fall_out_of_step();
            }
        }
        if self.partial_deadline().is_some_and(|due| due <= now) {
            self.partial_error = self.frames.abandon_partial();
        }
    }

    fn fall_out_of_step(&mut self) {
        self.out_of_step = match (self.out_of_step, self.learned.echoes_pack_id) {
            (OutOfStep::Said, _) => OutOfStep::Said,
            (state, Some(true)) => state,
            (_, Some(false)) => OutOfStep::Due,
            (OutOfStep::Due, None) => OutOfStep::Due,
            (OutOfStep::No | OutOfStep::IfNotEchoed, None) => OutOfStep::IfNotEchoed,
        };
    }

    /// Tells the session that the connection ended. Every waiting request is lost.
    pub fn handle_disconnect(&mut self) {
        let transmitted = self.transmitted_before + u64::try_from(self.transmitted).unwrap_or(u64::MAX);
        for waiting in self.in_flight.drain(..) {
            self.lost.push_back((waiting.ticket, waiting.starts_at < transmitted));
        }
        self.partial_error = self.frames.abandon_partial();
    }

    /// When [`Self::handle_timeout`] has to be called next.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        // The requests wait in the order in which they were sent, all with the same timeout.
        let reply = self.in_flight.front().map(|waiting| waiting.deadline);
        match (reply, self.partial_deadline()) {
            (Some(reply), Some(partial)) => Some(reply.min(partial)),
            (reply, partial) => reply.or(partial),
        }
    }

    fn partial_deadline(&self) -> Option<Instant> {
        (self.frames.pending() > 0).then(|| self.last_byte + PARTIAL_FRAME_TIMEOUT)
    }

    /// What the replies have shown so far about the firmware.
    #[must_use]
    pub fn learned(&self) -> LearnedDialect {
        self.learned
    }

    /// The `packID` of the next request. A new session continues from here.
    #[must_use]
    pub fn next_pack_id(&self) -> u64 {
        self.next_ticket
    }

    /// Returns the next event, or `None` if the session needs more bytes or time. `now` is used to measure
    /// how long a reply took.
    pub fn poll_event(&mut self, now: Instant) -> Option<Event<'_>> {
        if let Some(ticket) = self.timed_out.pop_front() {
            return Some(Event::TimedOut(ticket));
        }
        if let Some(error) = self.partial_error.take() {
            return Some(Event::BadFrame(error));
        }
        if self.out_of_step == OutOfStep::Due {
            self.out_of_step = OutOfStep::Said;
            return Some(Event::OutOfStep);
        }
        if let Some((ticket, left)) = self.lost.pop_front() {
            return Some(Event::Lost { ticket, left });
        }
        let message = match self.decoder.length_of_same_reply(self.frames.waiting()) {
            Some(length) => self.decoder.same_reply(self.frames.take_frame(length)),
            None => {
                let frame = match self.frames.next()? {
                    Ok(frame) => frame,
                    Err(error) => return Some(Event::BadFrame(error)),
                };
                match self.decoder.decode(frame.bytes) {
                    Ok(message) => message,
                    Err(error) => return Some(Event::NotJson(error)),
                }
            }
        };
        let mut matcher = Matcher {
            in_flight: &mut self.in_flight,
            learned: &mut self.learned,
            out_of_step: &mut self.out_of_step,
        };
        Some(match matcher.assign(&message) {
            Assigned::Reply(waiting) => {
                Event::Reply { ticket: waiting.ticket, message, after: now.since(waiting.sent_at) }
            }
            Assigned::Photo(cam_id) => Event::Photo { cam_id, message },
            Assigned::Stray(reason) => Event::Stray { reason, message },
        })
    }
}
