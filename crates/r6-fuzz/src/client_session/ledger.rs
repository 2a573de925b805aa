//! Tracks what happened to each request, independently of the session.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use r6_proto::client::{ClientSettings, Ticket};
use r6_proto::dialect::Addressing;
use r6_proto::frame::{FrameBuffer, Limits};
use r6_proto::message::{Body, Message};
use r6_proto::time::Instant;
use r6_proto::{Decoder, Request, RequestType};

use crate::input::Input;

/// A sent request.
#[derive(Clone, Debug)]
pub struct Sent {
    pub kind: RequestType,
    /// The command's word, or the word of AddPoints or AddRCC.
    pub word: &'static str,
    pub sent_at: Instant,
    addresses: Vec<String>,
    state: State,
}

/// The frame that must be sent for a request. It is encoded anew, without anything stored from an earlier
/// frame.
fn frame(settings: &ClientSettings, ticket: Ticket, request: &Request<'_>) -> Vec<u8> {
    let number = ticket.number().to_string();
    let pack_id = request.expects_reply().then_some(&*number);
    let addressing = Addressing { ds_id: settings.ds_id, type_key: settings.type_key, pack_id };
    let mut frame = Vec::new();
    request.encode(&addressing, &mut frame).unwrap_or_else(|error| panic!("it was sent, and now: {error}"));
    frame
}

/// The number of values in a query reply that names its query neither by number nor by addresses.
fn values_of_anybody(message: &Message<'_>) -> Option<usize> {
    match &message.body {
        Body::QueryReply(reply) if message.header.pack_id.is_none() && reply.addresses.is_none() => {
            Some(reply.values.len())
        }
        _ => None,
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Waits,
    Answered,
    TimedOut,
    Lost,
    Withdrawn,
}

/// All requests, and all transmitted bytes.
pub struct Ledger {
    settings: ClientSettings,
    requests: BTreeMap<Ticket, Sent>,
    /// Whether a request has timed out, so that any reply without a number may answer it.
    late: bool,
    /// Whether a reply that names nothing had more values than the first waiting query has addresses.
    exceeded: bool,
    /// Whether a reply that names nothing came before any match, while more than one query waited.
    of_any: bool,
    out_of_step: bool,
    last_reply: Vec<u8>,
    wire: FrameBuffer,
    /// The sent frames that are neither completely transmitted nor withdrawn, in order.
    to_leave: VecDeque<(Ticket, Vec<u8>)>,
    /// How many bytes of the first of them were transmitted.
    part_left: usize,
    /// Every request that was transmitted at least in part.
    begun: BTreeSet<Ticket>,
    /// How often each motion was transmitted, by its number.
    motions: BTreeMap<i64, u32>,
}

impl Ledger {
    pub fn new(settings: ClientSettings) -> Self {
        Self {
            settings,
            requests: BTreeMap::new(),
            late: false,
            exceeded: false,
            of_any: false,
            out_of_step: false,
            last_reply: Vec::new(),
            wire: FrameBuffer::new(Limits::default()),
            to_leave: VecDeque::new(),
            part_left: 0,
            begun: BTreeSet::new(),
            motions: BTreeMap::new(),
        }
    }

    pub fn sent(&mut self, ticket: Ticket, request: &Request<'_>, now: Instant) {
        self.to_leave.push_back((ticket, frame(&self.settings, ticket, request)));
        if !request.expects_reply() {
            return;
        }
        let (word, addresses) = match request {
            Request::Query(addresses) => ("query", addresses.iter().map(ToString::to_string).collect()),
            Request::Command(command) => (command.name().word(), Vec::new()),
            _ => (request.request_type().word(), Vec::new()),
        };
        let sent = Sent { kind: request.request_type(), word, sent_at: now, addresses, state: State::Waits };
        assert!(
            self.requests.insert(ticket, sent).is_none(),
            "two requests have the number {}",
            ticket.number()
        );
    }

    /// Picks one of the waiting requests.
    pub fn waiting(&self, input: &mut Input<'_>) -> Option<Ticket> {
        let waiting: Vec<_> = self
            .requests
            .iter()
            .filter(|(_, sent)| sent.state == State::Waits)
            .map(|(ticket, _)| *ticket)
            .collect();
        if waiting.is_empty() { None } else { Some(input.pick(&waiting)) }
    }

    /// A reply to any request so far, in one of the forms that firmware sends.
    pub fn reply(&mut self, input: &mut Input<'_>) -> Vec<u8> {
        let newest_first: Vec<_> = self.requests.iter().rev().collect();
        if newest_first.is_empty() {
            return Vec::new();
        }
        let (ticket, sent) = input.pick(&newest_first);
        let form = input.byte();
        let mut number = ticket.number();
        if form & 0x30 == 0x30 {
            number = number.wrapping_add(u64::from(input.byte()));
        }
        let pack_id = if form & 1 == 0 { format!(r#""packID":"{number}","#) } else { String::new() };
        let names: Vec<_> = sent.addresses.iter().map(|name| format!("\"{name}\"")).collect();
        let values = vec!["\"0\""; names.len()];
        let reply = match sent.kind {
            RequestType::Query => {
                let echo = if form & 2 == 0 {
                    format!(r#""queryAddr":[{}],"#, names.join(","))
                } else {
                    String::new()
                };
                format!(r#"{{{pack_id}{echo}"queryData":[{}],"reqType":"query"}}"#, values.join(","))
            }
            RequestType::Command
            | RequestType::AddPoints
            | RequestType::AddRcc
            | RequestType::Heartbreak
            | RequestType::Photo => {
                let word = if form & 2 == 0 { format!("\"{}\",", sent.word) } else { String::new() };
                let kind = if form & 4 == 0 { sent.kind.word() } else { "command" };
                format!(r#"{{"cmdReply":[{word}"ok"],{pack_id}"reqType":"{kind}"}}"#)
            }
        };
        self.last_reply = reply.into_bytes();
        self.last_reply.clone()
    }

    pub fn last_reply(&self) -> &[u8] {
        &self.last_reply
    }

    /// Records transmitted bytes. Each request must be sent exactly as it is encoded alone, in order, and no
    /// motion twice.
    pub fn left(&mut self, mut bytes: &[u8]) {
        self.count(bytes.len());
        let mut decoder = Decoder::new();
        while !bytes.is_empty() {
            let taken = self.wire.push(bytes);
            bytes = &bytes[taken..];
            while let Some(frame) = self.wire.next() {
                let frame = frame.unwrap_or_else(|error| panic!("what leaves is no frame: {error}"));
                let (ticket, wanted) = self.to_leave.pop_front().expect("a frame leaves that was not sent");
                self.part_left = self.part_left.saturating_sub(wanted.len());
                assert!(
                    frame.bytes == wanted,
                    "request {} leaves as {}, not as {}",
                    ticket.number(),
                    String::from_utf8_lossy(frame.bytes),
                    String::from_utf8_lossy(&wanted)
                );
                let message = decoder.decode(frame.bytes).unwrap_or_else(|error| panic!("{error}"));
                if let (Body::AddRcc(_), Some(pack_id)) = (&message.body, message.header.pack_id) {
                    let number = pack_id.integer().expect("a number of ours");
                    let times = self.motions.entry(number).or_insert(0);
                    *times += 1;
                    assert_eq!(*times, 1, "motion {number} left twice");
                    let sent =
                        self.requests.iter().find(|(ticket, _)| i64::try_from(ticket.number()) == Ok(number));
                    assert!(
                        sent.is_some_and(|(_, sent)| sent.state != State::Withdrawn),
                        "motion {number} was taken back, and left"
                    );
                }
            }
        }
    }

    /// Records which requests the next `bytes` bytes belong to.
    fn count(&mut self, bytes: usize) {
        self.part_left += bytes;
        let mut starts_at = 0;
        for (ticket, frame) in &self.to_leave {
            if starts_at >= self.part_left {
                break;
            }
            self.begun.insert(*ticket);
            starts_at += frame.len();
        }
    }

    fn end(&mut self, ticket: Ticket, state: State) -> &Sent {
        let number = ticket.number();
        let sent = self.requests.get_mut(&ticket).unwrap_or_else(|| panic!("{number} was not sent"));
        assert_eq!(sent.state, State::Waits, "request {number} has ended, and ends again as {state:?}");
        sent.state = state;
        sent
    }

    pub fn answered(&mut self, ticket: Ticket, message: &Message<'_>) -> Sent {
        let echo: Option<Vec<String>> = match &message.body {
            Body::QueryReply(reply) => {
                reply.addresses.map(|echo| echo.iter().map(|name| name.text().into_owned()).collect())
            }
            _ => None,
        };
        match message.header.pack_id {
            Some(pack_id) => {
                let number = pack_id.integer().and_then(|number| u64::try_from(number).ok());
                assert_eq!(number, Some(ticket.number()), "a reply with another number");
            }
            None => assert!(!self.late && !self.out_of_step, "a reply that may be late was matched"),
        }
        let sent = self.end(ticket, State::Answered);
        assert!(
            values_of_anybody(message).is_none_or(|values| values <= sent.addresses.len()),
            "a reply with more values than were asked for was matched by its order"
        );
        if let Some(echo) = echo {
            assert_eq!(echo.concat(), sent.addresses.concat(), "a reply to another query");
        }
        sent.clone()
    }

    pub fn timed_out(&mut self, ticket: Ticket, now: Instant) {
        let timeout = self.settings.reply_timeout;
        let sent = self.end(ticket, State::TimedOut);
        assert!(now.since(sent.sent_at) >= timeout, "it timed out too soon");
        self.late = true;
    }

    pub fn lost(&mut self, ticket: Ticket, left: bool) {
        let begun = self.begun.contains(&ticket);
        let sent = self.end(ticket, State::Lost);
        assert_eq!(left, begun, "whether any byte of {} left is not told truly", sent.word);
    }

    pub fn withdrawn(&mut self, ticket: Ticket) {
        assert!(!self.begun.contains(&ticket), "request {} left in part, and is taken back", ticket.number());
        self.to_leave.retain(|(other, _)| *other != ticket);
        self.end(ticket, State::Withdrawn);
    }

    /// A frame answered nothing.
    pub fn stray(&mut self, message: &Message<'_>) {
        let first =
            self.requests.values().find(|sent| sent.state == State::Waits && sent.kind == RequestType::Query);
        if let (Some(first), Some(values)) = (first, values_of_anybody(message)) {
            self.exceeded |= values > first.addresses.len();
            let state_is = |wanted: State| self.requests.values().filter(move |sent| sent.state == wanted);
            let queries = state_is(State::Waits).filter(|sent| sent.kind == RequestType::Query).count();
            self.of_any |= queries > 1 && state_is(State::Answered).next().is_none();
        }
    }

    pub fn out_of_step(&mut self) {
        assert!(
            self.late || self.exceeded || self.of_any,
            "out of step although nothing timed out, no reply had too many values, and the first one named what it answers"
        );
        assert!(!std::mem::replace(&mut self.out_of_step, true), "out of step is said once");
    }

    /// Checks after time has passed that no request waits longer than the settings allow.
    pub fn time_has_passed(&self, now: Instant) {
        let timeout = self.settings.reply_timeout;
        let mut waiting = self.requests.values().filter(|sent| sent.state == State::Waits);
        let overdue = waiting.find(|sent| sent.sent_at + timeout <= now);
        assert!(overdue.is_none(), "{overdue:?} should have timed out by {now:?}");
    }

    /// Checks what must hold between any two operations, with `output` bytes waiting to be written.
    pub fn hold(&self, output: usize) {
        let sent: usize = self.to_leave.iter().map(|(_, frame)| frame.len()).sum();
        assert_eq!(
            output,
            sent - self.part_left,
            "what waits to leave is not what was sent and has not left"
        );
        let waiting = self.requests.values().filter(|sent| sent.state == State::Waits).count();
        assert!(waiting <= self.settings.max_in_flight, "{waiting} requests wait");
    }

    pub fn all_have_ended(&self) {
        let waiting = self.requests.values().find(|sent| sent.state == State::Waits);
        assert!(waiting.is_none(), "{waiting:?} never ended");
    }
}
