//! The PC's end of one connection, without I/O: requests in, frames out; bytes in, events out.
//!
//! A reply is matched by its `packID` where the firmware echoes it. Where it does not, by kind, by the command it
//! names and by order; then a request that timed out may still be answered later, and no reply can be trusted to
//! belong to the next request: the session says so ([`Event::OutOfStep`]) and the connection has to be made anew. So it is where
//! such a reply has more values than were asked for, for it answers an earlier request.

mod matcher;
mod repeated;

use std::collections::VecDeque;
use std::time::Duration;

use self::matcher::{Assigned, Matcher, hash_of_query};
use self::repeated::LastQuery;
use crate::dialect::{Addressing, DsIdForm};
use crate::encode::write_integer;
use crate::error::{EncodeError, JsonError};
use crate::frame::{FrameBuffer, FrameError, Limits};
use crate::message::{Decoder, Message, RequestType, TypeKey};
use crate::request::{LONGEST_ADD_RCC, Request};
use crate::server::PARTIAL_FRAME_TIMEOUT;
use crate::time::Instant;

/// How a client session behaves.
#[derive(Clone, Copy, Debug)]
pub struct ClientSettings {
    /// How long a reply may take. Replies take up to 26 ms on real controllers; the default of 2 s leaves room
    /// for a busy network and is shorter than a person's patience.
    pub reply_timeout: Duration,
    /// The longest frame that is sent. Controllers neither answer nor execute an AddRCC over 2 048 bytes.
    pub max_frame_bytes: usize,
    /// How many requests may wait for a reply at once.
    pub max_in_flight: usize,
    /// The key of the type: `cmdType` for the oldest firmware.
    pub type_key: TypeKey,
    /// The form of `dsID`.
    pub ds_id: DsIdForm,
    /// The number that the first request's `packID` has; a shell that reconnects counts on.
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

/// How much may wait to be written: several times the frames of a full window, so that it only fills where the
/// connection takes nothing.
pub const MAX_OUTPUT_BYTES: usize = 1 << 20;

/// Names one request of a session; its number is the request's `packID`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(u64);

impl Ticket {
    /// The number that stands in `packID`.
    #[must_use]
    pub fn number(self) -> u64 {
        self.0
    }
}

/// Why a request was not sent: nothing has reached the controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SendError {
    /// A value that the wire cannot carry.
    Encode(EncodeError),
    /// The frame is longer than the controller takes.
    TooLong {
        /// Its length.
        bytes: usize,
        /// The limit.
        limit: usize,
    },
    /// The connection takes nothing: so much waits to be written already.
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
                 and append the rest"
            ),
            Self::OutputFull { limit } => {
                write!(f, "{limit} bytes wait to be written already: the connection takes nothing")
            }
            Self::TooManyInFlight { limit } => write!(f, "{limit} requests wait for their replies already"),
        }
    }
}

impl std::error::Error for SendError {}

/// What a client session tells.
#[derive(Debug)]
pub enum Event<'a> {
    /// The reply to a request.
    Reply {
        /// The request.
        ticket: Ticket,
        /// The reply: a [`QueryReply`](crate::Body::QueryReply), a [`CommandReply`](crate::Body::CommandReply) or, if
        /// it cannot be understood, a [`Rejected`](crate::Body::Rejected).
        message: Message<'a>,
        /// How long it took.
        after: Duration,
    },
    /// The controller asks for a photo: it was not asked for anything.
    Photo {
        /// The camera.
        cam_id: i64,
        /// The frame.
        message: Message<'a>,
    },
    /// A frame that answers nothing that waits: late, repeated, contradictory, or of another kind.
    Stray {
        /// Why.
        reason: StrayReason,
        /// The frame.
        message: Message<'a>,
    },
    /// Bytes that are no frame; what follows them is understood again.
    BadFrame(FrameError),
    /// A frame that is no JSON.
    NotJson(JsonError),
    /// No reply came in time: the controller may have acted.
    TimedOut(Ticket),
    /// The connection ended before the reply.
    Lost {
        /// The request.
        ticket: Ticket,
        /// Whether any byte of it was given to the connection: if not, sending it again is safe.
        left: bool,
    },
    /// Replies can no longer be matched with certainty: close the connection and make a new one.
    OutOfStep,
}

/// Why a frame was matched to no request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StrayReason {
    /// Nothing that waits has this `packID`: late, repeated, or another client's.
    UnknownPackId,
    /// The `packID` fits, but the reply is of another kind, names another command or echoes other addresses.
    Contradiction,
    /// Nothing of this kind waits.
    NothingWaits,
    /// An echo of a request.
    Echo,
    /// Without `packID`, after a time-out or with more values than were asked for: it may answer an earlier request.
    OutOfStep,
    /// It is no reply at all.
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

/// What the replies so far tell about the firmware's dialect; `None` where nothing told yet.
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
}

#[derive(Debug)]
struct InFlight {
    ticket: Ticket,
    request: RequestType,
    /// The command's word, or AddPoints or AddRCC.
    word: &'static str,
    /// A query's addresses, hashed: an echo must be theirs.
    addresses: u64,
    /// How many there are.
    count: usize,
    sent_at: Instant,
    deadline: Instant,
    /// Where its first byte stands in the output, counted from the session's start.
    starts_at: u64,
    /// How long its frame is.
    bytes: usize,
}

/// The PC's end of one connection.
#[derive(Debug)]
pub struct ClientSession {
    settings: ClientSettings,
    frames: FrameBuffer,
    decoder: Decoder,
    last_byte: Instant,
    output: Vec<u8>,
    /// How much of `output` was transmitted, and how much before it.
    transmitted: usize,
    transmitted_before: u64,
    next_ticket: u64,
    /// A `packID`, while a request is being written.
    digits: Vec<u8>,
    last_query: LastQuery,
    in_flight: VecDeque<InFlight>,
    timed_out: VecDeque<Ticket>,
    lost: VecDeque<(Ticket, bool)>,
    partial_error: Option<FrameError>,
    learned: LearnedDialect,
    out_of_step: OutOfStep,
}

/// Whether replies without `packID` can still be matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OutOfStep {
    No,
    /// A request timed out before it was known whether the firmware echoes `packID`.
    IfNotEchoed,
    /// They cannot; the event is due.
    Due,
    /// They cannot; it was said.
    Said,
}

impl ClientSession {
    /// A session on a fresh connection.
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

    /// Puts a request into the output.
    ///
    /// # Errors
    /// [`SendError`]: nothing was put there.
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

    /// Appends the frame of a request whose `packID` is in `digits`; the number of a query's addresses.
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

    /// Forgets what was transmitted, once it is at least half of the output: each byte is moved at most once.
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

    /// Tells that the first `bytes` of [`Self::poll_transmit`] were given to the connection.
    pub fn transmitted(&mut self, bytes: usize) {
        self.transmitted = (self.transmitted + bytes).min(self.output.len());
    }

    /// Takes a request back of which no byte was transmitted; `false` if it left, at least in part, or waits no more.
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

    /// Takes bytes from the controller and tells how many there was room for; [`Self::poll_event`] tells what they
    /// mean. Give it the others once that has returned `None`.
    #[must_use = "bytes that were not taken have to be given again"]
    pub fn handle_input(&mut self, now: Instant, bytes: &[u8]) -> usize {
        // A read of nothing is no sign of life.
        if !bytes.is_empty() {
            self.last_byte = now;
        }
        self.frames.push(bytes)
    }

    /// Tells the session what time it is: overdue requests time out, an incomplete frame is given up.
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

    /// Tells the session that the connection ended: every request that waits is lost.
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
        // They wait in the order in which they were sent, each as long as any other.
        let reply = self.in_flight.front().map(|waiting| waiting.deadline);
        match (reply, self.partial_deadline()) {
            (Some(reply), Some(partial)) => Some(reply.min(partial)),
            (reply, partial) => reply.or(partial),
        }
    }

    fn partial_deadline(&self) -> Option<Instant> {
        (self.frames.pending() > 0).then(|| self.last_byte + PARTIAL_FRAME_TIMEOUT)
    }

    /// What the replies so far tell about the firmware.
    #[must_use]
    pub fn learned(&self) -> LearnedDialect {
        self.learned
    }

    /// The number that the next request's `packID` would have: where a new session counts on.
    #[must_use]
    pub fn next_pack_id(&self) -> u64 {
        self.next_ticket
    }

    /// The next event; `None` once more bytes or time are needed. `now` measures how long a reply took.
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
