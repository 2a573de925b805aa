//! Finds the request that a frame answers: by `packID`, else by kind, by the command that it names and by
//! order.

use std::collections::VecDeque;

use super::{InFlight, LearnedDialect, OutOfStep, StrayReason};
use crate::address::Address;
use crate::message::{Body, Message, RequestType, TypeKey};
use crate::value::Values;

/// Finds the request that a frame answers.
pub(super) struct Matcher<'s> {
    pub in_flight: &'s mut VecDeque<InFlight>,
    pub learned: &'s mut LearnedDialect,
    pub out_of_step: &'s mut OutOfStep,
}

pub(super) enum Assigned {
    Reply(InFlight),
    Photo(i64),
    Stray(StrayReason),
}

/// What a reply answers, judged by the reply alone.
enum Answers<'a> {
    Query {
        addresses: Option<Values<'a>>,
        /// Number of values in the reply.
        values: usize,
    },
    /// A reply to a command, AddPoints or AddRCC; the word, if the reply names it.
    Named(Option<std::borrow::Cow<'a, str>>),
    /// A reply of this type with an invalid field.
    Broken(RequestType),
}

impl Matcher<'_> {
    pub fn assign(&mut self, message: &Message<'_>) -> Assigned {
        let answers = match &message.body {
            Body::QueryReply(reply) => {
                Answers::Query { addresses: reply.addresses, values: reply.values.len() }
            }
            Body::CommandReply(reply) => Answers::Named(reply.command()),
            Body::Rejected(rejection) => match rejection.request {
                RequestType::Photo | RequestType::Heartbreak => return Assigned::Stray(StrayReason::NoReply),
                request @ (RequestType::Query
                | RequestType::Command
                | RequestType::AddPoints
                | RequestType::AddRcc) => Answers::Broken(request),
            },
            Body::Photo(photo) => return Assigned::Photo(photo.cam_id),
            Body::Query(_) | Body::Command(_) | Body::AddPoints(_) | Body::AddRcc(_) => {
                return Assigned::Stray(StrayReason::Echo);
            }
            Body::Heartbreak | Body::PhotoAnswer(_) | Body::Unknown(_) => {
                return Assigned::Stray(StrayReason::NoReply);
            }
        };
        let found = match message.header.pack_id {
            Some(pack_id) => self.by_pack_id(pack_id.integer(), &answers),
            None => self.by_order(&answers),
        };
        match found.and_then(|at| self.in_flight.remove(at).ok_or(StrayReason::NothingWaits)) {
            Ok(waiting) => {
                self.learn(message, waiting.request);
                Assigned::Reply(waiting)
            }
            Err(reason) => Assigned::Stray(reason),
        }
    }

    fn by_pack_id(&self, pack_id: Option<i64>, answers: &Answers<'_>) -> Result<usize, StrayReason> {
        let number = pack_id.and_then(|number| u64::try_from(number).ok());
        let at = self
            .in_flight
            .iter()
            .position(|waiting| Some(waiting.ticket.0) == number)
            .ok_or(StrayReason::UnknownPackId)?;
        match self.in_flight.get(at) {
            Some(waiting) if waiting.may_be_answered_by(answers) => Ok(at),
            Some(_) | None => Err(StrayReason::Contradiction),
        }
    }

    fn by_order(&mut self, answers: &Answers<'_>) -> Result<usize, StrayReason> {
        if self.learned.echoes_pack_id == Some(true) {
            // This firmware always echoes packID, so a frame without it answers another client.
            return Err(StrayReason::UnknownPackId);
        }
        match *self.out_of_step {
            OutOfStep::No => {}
            OutOfStep::IfNotEchoed => {
                *self.out_of_step = OutOfStep::Due;
                return Err(StrayReason::OutOfStep);
            }
            OutOfStep::Due | OutOfStep::Said => return Err(StrayReason::OutOfStep),
        }
        let mut candidates =
            self.in_flight.iter().enumerate().filter(|(_, waiting)| waiting.may_be_answered_by(answers));
        let (at, _) = candidates.next().ok_or(StrayReason::NothingWaits)?;
        if matches!(answers, Answers::Broken(_)) && candidates.next().is_some() {
            // The reply does not say what it answers, and it fits more than one request.
            return Err(StrayReason::Contradiction);
        }
        let names_nothing = matches!(answers, Answers::Query { addresses: None, .. });
        if names_nothing && self.learned.echoes_pack_id.is_none() && candidates.next().is_some() {
            // A client that does not yet know whether replies carry names may have sent several queries. If
            // one of them got no answer, this reply would be taken for another query's values.
            *self.out_of_step = OutOfStep::Due;
            return Err(StrayReason::OutOfStep);
        }
        if self.in_flight.get(at).is_some_and(|waiting| waiting.is_exceeded_by(answers)) {
            // No firmware sends more values than a query asks for, so this reply answers an earlier request.
            *self.out_of_step = OutOfStep::Due;
            return Err(StrayReason::OutOfStep);
        }
        Ok(at)
    }

    fn learn(&mut self, message: &Message<'_>, request: RequestType) {
        self.learned.echoes_pack_id = Some(message.header.pack_id.is_some());
        if let Body::QueryReply(reply) = &message.body {
            self.learned.echoes_query_addr = Some(reply.addresses.is_some());
            if let (Some(word), Some(first)) = (message.header.type_word, reply.values.at(0)) {
                // `reqType` is behind `queryData` in the alphabet, and `cmdType` is the first of all keys.
                self.learned.sorts_keys = match message.header.type_key {
                    TypeKey::ReqType => Some(first.offset() < word.offset()),
                    TypeKey::CmdType => message.header.ds_id.map(|ds_id| word.offset() < ds_id.offset()),
                    TypeKey::Absent => None,
                };
            }
        }
        // AddPoints and AddRCC carry their names, and have the type `command`, in every dialect, so they show
        // nothing about the dialect.
        if let (Body::CommandReply(reply), RequestType::Command) = (&message.body, request) {
            self.learned.names_command = Some(reply.command().is_some());
        }
        if let (Some(word), RequestType::Query | RequestType::Command) = (message.header.type_word, request) {
            let echo = matches!(&*word.word(), b"queryEcho" | b"cmdEcho");
            // Only old firmware sends these types. One such reply proves that the firmware is old.
            self.learned.echo_types = Some(echo || self.learned.echo_types == Some(true));
        }
    }
}

impl InFlight {
    /// Whether a reply without addresses has more values than this query has addresses.
    fn is_exceeded_by(&self, answers: &Answers<'_>) -> bool {
        matches!(answers, Answers::Query { addresses: None, values } if *values > self.count)
    }

    fn may_be_answered_by(&self, answers: &Answers<'_>) -> bool {
        match answers {
            Answers::Query { addresses, .. } => {
                self.request == RequestType::Query
                    && addresses.is_none_or(|addresses| echoes(addresses, self.addresses))
            }
            Answers::Named(Some(word)) => self.request != RequestType::Query && self.word == word,
            // Only the reply to a command can lack a name, before 2.0.2.1. AddPoints and AddRCC carry their
            // names in every manual.
            Answers::Named(None) => self.request == RequestType::Command,
            // For AddPoints and AddRCC, its type may be the template's "command".
            Answers::Broken(RequestType::Command) => self.request != RequestType::Query,
            Answers::Broken(request) => self.request == *request,
        }
    }
}

/// The bytes between two names of a list without blanks.
const BETWEEN: &[u8] = b"\",\"";

/// Hashes the addresses of a query as they stand in the frame that was just written. An echo must have the
/// same hash.
pub(super) fn hash_of_query(frame: &[u8], addresses: &[Address]) -> u64 {
    let names: usize = addresses.iter().map(|address| address.name_len()).sum();
    let between = addresses.len().saturating_sub(1) * BETWEEN.len();
    // The list is the last member of the frame.
    let end = frame.len().saturating_sub(b"\"]}".len());
    hash(frame.get(end.saturating_sub(names + between)..end).unwrap_or_default())
}

/// Whether an echo names the addresses of the query with this hash, in spite of different blanks and escapes.
fn echoes(addresses: Values<'_>, query: u64) -> bool {
    // Most controllers echo the list as it was sent.
    hash(addresses.span()) == query || {
        let mut names = Vec::new();
        for (at, address) in addresses.iter().enumerate() {
            names.extend_from_slice(if at > 0 { BETWEEN } else { b"" });
            names.extend_from_slice(&address.word());
        }
        hash(&names) == query
    }
}

/// Hashes eight bytes at a time by multiplying and folding. This is enough to tell the client's own queries
/// apart.
fn hash(bytes: &[u8]) -> u64 {
    const FACTOR: u64 = 0x9E37_79B9_7F4A_7C15;
    let (chunks, rest) = bytes.as_chunks::<8>();
    let mut last = [0; 8];
    for (to, from) in last.iter_mut().zip(rest) {
        *to = *from;
    }
    let length = u64::try_from(bytes.len()).unwrap_or(u64::MAX);
    chunks.iter().chain([&last]).fold(length, |hash, chunk| {
        let mixed = (hash ^ u64::from_le_bytes(*chunk)).wrapping_mul(FACTOR);
        mixed ^ mixed >> 32
    })
}
