//! Which request a frame answers: by `packID`, else by kind, by the command it names and by order.

use std::collections::VecDeque;

use super::{InFlight, LearnedDialect, OutOfStep, StrayReason};
use crate::address::Address;
use crate::message::{Body, Message, RequestType};
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

/// What a reply answers, as far as the reply itself tells.
enum Answers<'a> {
    Query {
        addresses: Option<Values<'a>>,
        /// How many values it has.
        values: usize,
    },
    /// A command, AddPoints or AddRCC; the word where the reply names it.
    Named(Option<std::borrow::Cow<'a, str>>),
    /// A reply of this type with a field that cannot be right.
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
            // This firmware always echoes: a frame without packID answers somebody else.
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
            // It does not say what it answers, and more than one request could be meant.
            return Err(StrayReason::Contradiction);
        }
        let names_nothing = matches!(answers, Answers::Query { addresses: None, .. });
        if names_nothing && self.learned.echoes_pack_id.is_none() && candidates.next().is_some() {
            // Whoever sends before it is known that replies name nothing may have sent several queries. Were one of them not answered,
            // this would be the value of another address.
            *self.out_of_step = OutOfStep::Due;
            return Err(StrayReason::OutOfStep);
        }
        if self.in_flight.get(at).is_some_and(|waiting| waiting.is_exceeded_by(answers)) {
            // No firmware has a reason to send more values than it was asked for: this one answers an earlier request.
            *self.out_of_step = OutOfStep::Due;
            return Err(StrayReason::OutOfStep);
        }
        Ok(at)
    }

    fn learn(&mut self, message: &Message<'_>, request: RequestType) {
        self.learned.echoes_pack_id = Some(message.header.pack_id.is_some());
        if let Body::QueryReply(reply) = &message.body {
            self.learned.echoes_query_addr = Some(reply.addresses.is_some());
        }
        // AddPoints and AddRCC name themselves, and say `command`, in every dialect: they tell nothing.
        if let (Body::CommandReply(reply), RequestType::Command) = (&message.body, request) {
            self.learned.names_command = Some(reply.command().is_some());
        }
        if let (Some(word), RequestType::Query | RequestType::Command) = (message.header.type_word, request) {
            let echo = matches!(&*word.word(), b"queryEcho" | b"cmdEcho");
            // Only old firmware ever says it; one that did is old.
            self.learned.echo_types = Some(echo || self.learned.echo_types == Some(true));
        }
    }
}

impl InFlight {
    /// Whether a reply that does not say which addresses it answers has more values than this query has addresses.
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
            // Only the reply to a command goes without a name, before 2.0.2.1; AddPoints and AddRCC name themselves in
            // every manual.
            Answers::Named(None) => self.request == RequestType::Command,
            // Its type may be the template's "command" for AddPoints and AddRCC.
            Answers::Broken(RequestType::Command) => self.request != RequestType::Query,
            Answers::Broken(request) => self.request == *request,
        }
    }
}

/// Between two names of a list without blanks.
const BETWEEN: &[u8] = b"\",\"";

/// A number for the addresses of a query, as the frame names them that it was just written into: an echo must have the same.
pub(super) fn hash_of_query(frame: &[u8], addresses: &[Address]) -> u64 {
    let names: usize = addresses.iter().map(|address| address.name_len()).sum();
    let between = addresses.len().saturating_sub(1) * BETWEEN.len();
    // The list is the last member of the frame.
    let end = frame.len().saturating_sub(b"\"]}".len());
    hash(frame.get(end.saturating_sub(names + between)..end).unwrap_or_default())
}

/// Whether an echo names the addresses of the query with this number, whatever blanks and escapes it has.
fn echoes(addresses: Values<'_>, query: u64) -> bool {
    // As it is sent, as a rule.
    hash(addresses.span()) == query || {
        let mut names = Vec::new();
        for (at, address) in addresses.iter().enumerate() {
            names.extend_from_slice(if at > 0 { BETWEEN } else { b"" });
            names.extend_from_slice(&address.word());
        }
        hash(&names) == query
    }
}

/// Eight bytes at a time, multiplied and folded: enough to tell one's own query from another's.
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
