//! Queries: split to what a controller takes, and asked again in smaller parts where values are missing.

mod parts;

use std::fmt;
use std::time::Duration;

use r6_proto::Reading;
use r6_proto::address::Address;
use r6_proto::dialect::Envelope;
use r6_proto::error::FieldError;
use r6_proto::request::Request;
use tokio::time::Instant;

use self::parts::{Part, Parts, alone, is_everywhere, may_be_missing};
use crate::error::{NotSent, OutcomeUnknown, RequestError};
use crate::identity::{Identity, asks_who_is_there};
use crate::job::{Answer, Answered, Work};
use crate::link::{Lane, STATE};
use crate::robot::Robot;
use crate::settings::RobotSettings;

/// Unsupported addresses that are remembered for a connection: more than the table of addresses has, registers apart.
const MAX_REMEMBERED: usize = 256;

/// Addresses that had a value, registers included: as many as there are.
const MAX_SUPPORTED: usize = 2048;

/// Replies in a row without the value of an address that the controller should have, until it counts as missing: more than odd replies
/// explain. From then on lists without it are believed again, and an odd firmware is not asked for each address alone for ever.
const MOST_EMPTY: u8 = 8;

/// What a value is taken to need in a reply, quotes and comma included: the longest captured position,
/// `"-2597.112793"`, needs 15.
const BYTES_PER_VALUE: usize = 16;

/// What a reply to a query has around the values, with what it echoes around the addresses, bytes.
pub(crate) fn around_query(settings: &RobotSettings) -> usize {
    let envelope =
        Envelope { ds_id: settings.ds_id, type_key: settings.type_key, pack_id: Some(LONGEST_PACK_ID) };
    let mut frame = Vec::new();
    // A query without addresses has nothing that could fail to be encoded. The reply has `queryData` besides.
    Request::Query(&[]).encode(&envelope, &mut frame).ok();
    frame.len() + "\"queryData\":[],".len()
}

/// The longest `packID` that is counted on, in digits.
const LONGEST_PACK_ID: &str = "18446744073709551615";

/// How often a query is asked for in all, where the connection changes between its parts.
const ROUNDS: u32 = 2;

/// The values of some addresses, each with its address.
///
/// Values that took several frames to read are not of one instant. All of them came over one connection, so they are of one robot.
#[derive(Clone, Debug, PartialEq)]
pub struct QueryResult {
    rows: Vec<(Address, Result<Reading, NoReading>)>,
    took: Duration,
    /// The connection that all replies came over.
    connection: u64,
}

/// When the values of a query were asked for: they are no older.
#[derive(Debug)]
pub(crate) enum AskedAt {
    /// All at once.
    Once(Instant),
    /// Each at its own time, in the order of the addresses.
    Each(Vec<Instant>),
}

impl AskedAt {
    /// The time of the value at this position.
    pub fn of(&self, position: usize) -> Option<Instant> {
        match self {
            Self::Once(at) => Some(*at),
            Self::Each(times) => times.get(position).copied(),
        }
    }

    /// When the first of them was asked for.
    pub fn oldest(&self) -> Instant {
        match self {
            Self::Once(at) => *at,
            Self::Each(times) => times.iter().copied().min().unwrap_or_else(Instant::now),
        }
    }
}

/// Why an address has no value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoReading {
    /// The controller does not support the address, or has no such counter: it leaves the value out.
    Unsupported,
    /// The value cannot be one of this address.
    Unreadable(FieldError),
}

impl fmt::Display for NoReading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsupported => f.write_str("the controller has no such value"),
            Self::Unreadable(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for NoReading {}

impl QueryResult {
    #[cfg(test)]
    pub(crate) fn for_tests(rows: Vec<(Address, Result<Reading, NoReading>)>) -> Self {
        Self { rows, took: Duration::ZERO, connection: 0 }
    }

    /// The number of the connection that all of it was answered over.
    pub(crate) fn connection(&self) -> u64 {
        self.connection
    }

    /// Each address with its value, in the order asked.
    pub fn rows(&self) -> &[(Address, Result<Reading, NoReading>)] {
        &self.rows
    }

    /// The value of an address, if it was asked for and has one.
    #[must_use]
    pub fn reading(&self, address: Address) -> Option<&Reading> {
        self.rows.iter().find(|(asked, _)| *asked == address)?.1.as_ref().ok()
    }

    /// A whole number.
    #[must_use]
    pub fn integer(&self, address: Address) -> Option<i64> {
        match self.reading(address)? {
            Reading::Integer(number) => Some(*number),
            Reading::Text(_)
            | Reading::Decimal(_)
            | Reading::Word(_)
            | Reading::Flag(_)
            | Reading::Texts(_)
            | Reading::Counter(_) => None,
        }
    }

    /// A decimal number, in the unit of its address.
    #[must_use]
    pub fn decimal(&self, address: Address) -> Option<f64> {
        match self.reading(address)? {
            Reading::Decimal(number) => Some(*number),
            Reading::Text(_)
            | Reading::Integer(_)
            | Reading::Word(_)
            | Reading::Flag(_)
            | Reading::Texts(_)
            | Reading::Counter(_) => None,
        }
    }

    /// A flag.
    #[must_use]
    pub fn flag(&self, address: Address) -> Option<bool> {
        match self.reading(address)? {
            Reading::Flag(flag) => Some(*flag),
            Reading::Text(_)
            | Reading::Integer(_)
            | Reading::Decimal(_)
            | Reading::Word(_)
            | Reading::Texts(_)
            | Reading::Counter(_) => None,
        }
    }

    /// A text.
    #[must_use]
    pub fn text(&self, address: Address) -> Option<&str> {
        match self.reading(address)? {
            Reading::Text(text) => Some(text),
            Reading::Integer(_)
            | Reading::Decimal(_)
            | Reading::Word(_)
            | Reading::Flag(_)
            | Reading::Texts(_)
            | Reading::Counter(_) => None,
        }
    }

    /// How long the slowest reply took.
    #[must_use]
    pub fn took(&self) -> Duration {
        self.took
    }
}

impl Robot {
    /// Reads the values of these addresses.
    ///
    /// A long list is split, so that neither request nor reply is longer than the controller takes. Where a reply has
    /// fewer values than were asked for, nobody can tell which are missing; then the addresses are asked for in ever
    /// smaller parts, those that some firmware lacks first apart from the others. What stays without a value when it
    /// is asked for alone is not asked for again on this connection, except for counters, which can be made at any
    /// time, and addresses that both ports have since V6.0.
    ///
    /// A reply may have too many values, or too few although no address turns out to be missing. Then values may stand
    /// at the wrong addresses in lists of the right length too. So each address is asked for alone, and so is the next
    /// query on this connection, until one query passes without such a reply.
    ///
    /// All values are of one robot: where the connection changes between two parts, all of it is asked for once more.
    ///
    /// # Errors
    /// [`RequestError`]; a query that the connection ended under is asked once more over a new one first. If the robot
    /// that answers is not the one that this handle was used with before, its values are not handed out
    /// ([`OutcomeUnknown::AnotherRobot`]).
    pub async fn query(&self, addresses: &[Address]) -> Result<QueryResult, RequestError> {
        self.query_in(Lane::Ordinary, addresses).await
    }

    pub(crate) async fn query_in(
        &self,
        lane: Lane,
        addresses: &[Address],
    ) -> Result<QueryResult, RequestError> {
        Ok(self.query_timed(lane, addresses).await?.0)
    }

    /// A query, the connection that it was answered over, and when the oldest of its values was asked for.
    pub(crate) async fn query_on_one_connection(
        &self,
        lane: Lane,
        addresses: &[Address],
    ) -> Result<(QueryResult, u64, Instant), RequestError> {
        let (read, asked_at) = self.query_timed(lane, addresses).await?;
        let connection = read.connection();
        if lane == Lane::Urgent && self.hub().known().read_of_nobody {
            // This would confirm a stop, of whichever robot answers now.
            return Err(NotSent::StateNotRead.into());
        }
        Ok((read, connection, asked_at.oldest()))
    }

    /// A query, and when each of its values was asked for; for a value that is known to be missing, when that was told.
    pub(crate) async fn query_timed(
        &self,
        lane: Lane,
        addresses: &[Address],
    ) -> Result<(QueryResult, AskedAt), RequestError> {
        let (all, doubts) = {
            let known = self.hub().known();
            let missing = |address: &Address| known.unsupported.contains(address);
            let none_is_missing = known.unsupported.is_empty() || !addresses.iter().any(missing);
            (!known.doubts_lists && none_is_missing, known.doubts)
        };
        let mut answer = None;
        if all && !addresses.is_empty() && self.fits(addresses) {
            // Nearly every query is this one: all in one frame, and all of it answered.
            match self.ask(Work::Query(addresses.to_vec()), lane).await? {
                // Another query may have shown since that lists are wrong.
                Answer::Values { rows, on } if addresses.len() == 1 || !self.doubted_since(doubts) => {
                    self.remember_supported(on.connection, addresses.iter().copied());
                    let result = QueryResult { rows, took: on.after, connection: on.connection };
                    self.remember(lane, &result)?;
                    return Ok((result, AskedAt::Once(self.hub().clock.at(Some(on.asked_at)))));
                }
                other => answer = Some(other),
            }
        }
        for _ in 0..ROUNDS {
            if let Some(read) = self.query_in_parts(lane, addresses, answer.take(), doubts).await? {
                return Ok(read);
            }
        }
        Err(NotSent::Disconnected.into())
    }

    /// The same in as many frames as it takes; `answer` is that to all addresses at once, if there was one. `None` if the connection
    /// changed on the way: what was read before may be of another robot than what comes after. `doubts`: how often lists had been doubted
    /// when the query began.
    async fn query_in_parts(
        &self,
        lane: Lane,
        addresses: &[Address],
        mut answer: Option<Answer>,
        doubts: u64,
    ) -> Result<Option<(QueryResult, AskedAt)>, RequestError> {
        let mut times = vec![Instant::now(); addresses.len()];
        let mut rows: Vec<_> =
            addresses.iter().map(|address| (*address, Err(NoReading::Unsupported))).collect();
        let (wanted, missing_on, doubts_lists): (Part, u64, bool) = {
            let known = self.hub().known();
            // What was answered was asked for, whatever has become known since.
            let wanted = |address: &Address| answer.is_some() || !known.unsupported.contains(address);
            let all = addresses.iter().copied().enumerate();
            (
                all.filter(|(_, address)| wanted(address)).collect(),
                known.connection,
                known.doubts_lists && answer.is_none(),
            )
        };
        let several = wanted.len() > 1;
        let mut took = Duration::ZERO;
        // Which addresses are missing is known of one connection too.
        let mut connection = (wanted.len() < addresses.len()).then_some(missing_on);
        let mut parts = Parts::new(if doubts_lists { alone(wanted) } else { self.split(wanted) });
        let mut told_by_a_list = None;
        while let Some(part) = parts.next(self.doubted_since(doubts)) {
            if parts.contradicted()
                && let Some((connection, identity)) = told_by_a_list.take()
            {
                self.forget_identity(connection, &identity);
            }
            let answered = match answer.take() {
                Some(answer) => answer,
                None => {
                    let asked = part.iter().map(|(_, address)| *address).collect();
                    self.ask(Work::Query(asked), lane).await?
                }
            };
            if let Answer::Values { on: Answered { connection: here, after, .. }, .. }
            | Answer::Mismatch { on: Answered { connection: here, after, .. }, .. } = &answered
            {
                if *connection.get_or_insert(*here) != *here {
                    return Ok(None);
                }
                took = took.max(*after);
            }
            match answered {
                Answer::Values { rows: read, on } => {
                    let asked: Vec<_> = part.iter().map(|(_, address)| *address).collect();
                    if asks_who_is_there(&asked) {
                        // Before the next part leaves: nothing else then has to ask who is there.
                        let (rows, connection) = (read.clone(), on.connection);
                        told_by_a_list =
                            self.remember_identity(connection, &QueryResult { rows, took, connection });
                    }
                    let asked_at = self.hub().clock.at(Some(on.asked_at));
                    for ((at, _), read) in part.iter().zip(read) {
                        if let (Some(time), Some(row)) = (times.get_mut(*at), rows.get_mut(*at)) {
                            (*time, *row) = (asked_at, read);
                        }
                    }
                    self.remember_supported(on.connection, asked.into_iter());
                    parts.answered(&part);
                    if let [(_, address)] = part.as_slice() {
                        self.hub().known().empty.remove(address);
                    }
                }
                Answer::Mismatch { answered, on } => {
                    let (doubted, mut lacked) = (parts.contradicted(), false);
                    // Only a reply to one address alone says which address it is about.
                    if let [(at, address)] = part.as_slice() {
                        let none = if answered == 0 {
                            self.remember_unsupported(on.connection, *address);
                            lacked = self.may_lack(on.connection, *address);
                            NoReading::Unsupported
                        } else {
                            NoReading::Unreadable(too_many(*address, answered))
                        };
                        if let Some((_, row)) = rows.get_mut(*at) {
                            // It may have had a value in a list that is not believed any more.
                            *row = Err(none);
                        }
                    }
                    parts.mismatched(&part, answered, lacked);
                    if parts.contradicted() && !doubted {
                        self.doubt_lists(on.connection);
                    }
                }
                Answer::Accepted { .. } | Answer::Left => {
                    let request = Work::Query(Vec::new()).sent();
                    return Err(OutcomeUnknown::Unclear {
                        request,
                        answer: "a reply to a command".to_owned(),
                    }
                    .into());
                }
            }
        }
        let result = QueryResult { rows, took, connection: connection.unwrap_or(missing_on) };
        if parts.contradicted() {
            self.doubt_lists(result.connection);
        } else if doubts_lists && several {
            // One address says little of lists.
            self.believe_lists(result.connection, doubts);
        }
        self.remember(lane, &result)?;
        Ok(Some((result, AskedAt::Each(times))))
    }

    /// Whether a query of these is one frame, and its reply another.
    fn fits(&self, addresses: &[Address]) -> bool {
        let room = self.settings().max_frame_bytes.saturating_sub(self.around_query());
        // Most are so few that it does not matter how long each is.
        addresses.len() * MOST_NEEDED <= room || addresses.iter().copied().map(needs).sum::<usize>() <= room
    }

    /// Parts whose requests and replies stay below the longest frame.
    fn split(&self, addresses: Part) -> Vec<Part> {
        let longest = self.settings().max_frame_bytes;
        let around = self.around_query();
        if around + addresses.iter().map(|(_, address)| needs(*address)).sum::<usize>() <= longest {
            return if addresses.is_empty() { Vec::new() } else { vec![addresses] };
        }
        let mut parts: Vec<Part> = Vec::new();
        let mut bytes = usize::MAX;
        for (at, address) in addresses {
            match parts.last_mut() {
                Some(part) if bytes.saturating_add(needs(address)) <= longest => {
                    part.push((at, address));
                    bytes += needs(address);
                }
                Some(_) | None => {
                    parts.push(vec![(at, address)]);
                    bytes = around + needs(address);
                }
            }
        }
        parts
    }

    /// What was answered once is there: no odd reply hides it later.
    fn remember_supported(&self, connection: u64, addresses: impl Iterator<Item = Address>) {
        let mut told = addresses.filter(|address| may_be_missing(*address)).peekable();
        if told.peek().is_none() {
            return;
        }
        let mut known = self.hub().known();
        if known.connection != connection {
            return;
        }
        for address in told {
            if known.supported.len() < MAX_SUPPORTED {
                known.supported.insert(address);
            }
        }
    }

    /// Whether a reply without a value is to be believed to say that the controller lacks the address. What every controller has,
    /// or had a value here, is believed to be missing only after many such replies in a row.
    fn may_lack(&self, connection: u64, address: Address) -> bool {
        let mut known = self.hub().known();
        let has = known.supported.contains(&address) || is_everywhere(address);
        if !has || known.connection != connection {
            return true;
        }
        if known.empty.len() >= MAX_SUPPORTED {
            return false;
        }
        let empty = known.empty.entry(address).or_default();
        *empty = empty.saturating_add(1);
        *empty > MOST_EMPTY
    }

    /// Whether values in lists may stand at the wrong addresses: a reply showed it after `doubts` were counted, or before that and no
    /// whole query passed well since.
    fn doubted_since(&self, doubts: u64) -> bool {
        let known = self.hub().known();
        known.doubts_lists || known.doubts != doubts
    }

    /// The next query asks for each address alone.
    fn doubt_lists(&self, connection: u64) {
        self.hub().known().doubt_lists(connection);
    }

    /// Ends the doubt, unless it was raised anew after `doubts` were counted.
    fn believe_lists(&self, connection: u64, doubts: u64) {
        let mut known = self.hub().known();
        if known.connection == connection && known.doubts == doubts {
            known.doubts_lists = false;
        }
    }

    /// An address that every controller has is never remembered, nor one that had a value: one odd reply must not hide alarm and
    /// mode for good.
    fn remember_unsupported(&self, connection: u64, address: Address) {
        if !may_be_missing(address) {
            return;
        }
        let mut known = self.hub().known();
        let had_a_value = known.supported.contains(&address);
        if known.connection == connection && !had_a_value && known.unsupported.len() < MAX_REMEMBERED {
            known.unsupported.insert(address);
        }
    }

    /// Keeps what a query tells of the controller besides its values, and refuses the values of another robot.
    fn remember(&self, lane: Lane, result: &QueryResult) -> Result<(), RequestError> {
        let connection = result.connection;
        self.remember_firmware(connection, result);
        self.remember_identity(connection, result);
        match self.hub().stranger_on(connection) {
            Some((expected, found)) => {
                let request = Work::Query(Vec::new()).sent();
                let (expected, found) = (Box::new(expected), Box::new(found));
                Err(OutcomeUnknown::AnotherRobot { request, expected, found }.into())
            }
            None => {
                self.remember_look(lane, result);
                Ok(())
            }
        }
    }

    /// After a caller has read mode and alarm, the robot that answers now counts as the one that is meant. Reads of subscriptions and
    /// stops do not count.
    fn remember_look(&self, lane: Lane, result: &QueryResult) {
        let mut known = self.hub().known();
        let looked = || STATE.into_iter().all(|address| result.reading(address).is_some());
        if known.read_of_nobody && known.connection == result.connection && lane == Lane::Ordinary && looked()
        {
            known.read_of_nobody = false;
        }
    }

    /// On a first connection a query may tell who is there; on others that is known before any query is sent. Who was taken for
    /// another because of an odd reply is himself again once he says so.
    ///
    /// Returns the connection and the identity where nobody knew before who is meant.
    fn remember_identity(&self, connection: u64, result: &QueryResult) -> Option<(u64, Identity)> {
        let identity = Identity::of(result)?;
        let mut known = self.hub().known();
        // Then who is there may be known in part only.
        let first = known.expected.is_none();
        let meant = known.expected.as_ref() == Some(&identity);
        if known.connection == connection && (meant || first || known.present.is_none()) {
            known.expected.get_or_insert_with(|| identity.clone());
            known.present = Some(identity.clone());
        } else if known.connection != connection {
            // The connection ended right behind this answer: it tells who was there first, and so is meant.
            known.expected.get_or_insert_with(|| identity.clone());
        }
        first.then_some((connection, identity))
    }

    /// The list that told this identity is not believed any more: the robot is unknown, as it was before.
    fn forget_identity(&self, connection: u64, identity: &Identity) {
        let mut known = self.hub().known();
        if known.connection == connection {
            known.present.take_if(|present| present == identity);
        }
        known.expected.take_if(|expected| expected == identity);
    }

    fn remember_firmware(&self, connection: u64, result: &QueryResult) {
        if !result.rows.iter().any(|(address, _)| *address == Address::Version) {
            return;
        }
        let mut known = self.hub().known();
        if known.connection == connection {
            known.firmware = Some(result.text(Address::Version).map(str::to_owned));
        }
    }
}

/// The longest name, `counter-999999999`, with what stands around it and its value, bytes.
const MOST_NEEDED: usize = 17 + "\"\",".len() + BYTES_PER_VALUE;

/// What an address and its value take of the longest frame, bytes.
fn needs(address: Address) -> usize {
    address.name_len() + "\"\",".len() + BYTES_PER_VALUE
}

fn too_many(address: Address, answered: usize) -> FieldError {
    FieldError {
        path: address.to_string(),
        found: Some(format!("{answered} values")),
        wanted: "one value",
        nearest: None,
    }
}
