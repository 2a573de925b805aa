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
    },
    /// A command, AddPoints or AddRCC; the word where the reply names it.
    Named(Option<std::borrow::Cow<'a, str>>),
    /// A reply of this type with a field that cannot be right.
    Broken(RequestType),
}

impl Matcher<'_> {
    pub fn assign(&mut self, message: &Message<'_>) -> Assigned {
        let answers = match &message.body {
            Body::QueryReply(reply) => Answers::Query { addresses: reply.addresses },
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
    fn may_be_answered_by(&self, answers: &Answers<'_>) -> bool {
        match answers {
            Answers::Query { addresses } => {
                self.request == RequestType::Query
                    && addresses.is_none_or(|addresses| hash_of_values(addresses) == self.addresses)
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

/// FNV-1a over the addresses' names: enough to tell one's own query from another's.
struct Hash(u64);

impl Hash {
    const START: Self = Self(0xcbf2_9ce4_8422_2325);

    fn add(&mut self, name: &[u8]) {
        for byte in name.iter().chain(b",") {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

pub(super) fn hash_of_addresses(addresses: &[Address], name: &mut Vec<u8>) -> u64 {
    let mut hash = Hash::START;
    for address in addresses {
        name.clear();
        address.write_name(name);
        hash.add(name);
    }
    hash.0
}

fn hash_of_values(addresses: Values<'_>) -> u64 {
    let mut hash = Hash::START;
    for address in addresses.iter() {
        hash.add(&address.word());
    }
    hash.0
}
