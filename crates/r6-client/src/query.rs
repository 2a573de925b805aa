//! Queries: splits them to what a controller takes, and asks again in smaller parts where values are missing.

pub(crate) mod frames;
mod memory;
mod parts;
mod raw;
pub(crate) mod result;

use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use r6_proto::address::Address;
use r6_proto::error::{EncodeError, FieldError, FieldPath, Wanted};
use r6_proto::time::Instant;

use crate::error::{Invalid, NotSent, OutcomeUnknown, RequestError, Sent};
use crate::identity::asks_who_is_there;
use crate::job::{Answer, Answered, Work};
use crate::link::Lane;
use crate::query::parts::{Part, Parts, alone};
use crate::query::result::{AskedAt, Rows};
pub use crate::query::result::{NoReading, QueryResult};
use crate::robot::Robot;

/// A query without addresses is a mistake in the calling program.
const NO_ADDRESS: EncodeError = EncodeError {
    field: "queryAddr",
    wanted: "one address at least, such as curMode or axis-0",
    nearest: None,
};

/// How often a query is asked in all, if the connection changes between its parts.
const ROUNDS: u32 = 2;

impl Robot {
    /// Reads the values of these addresses.
    ///
    /// A long list is split, so that neither request nor reply is longer than the controller takes. If a
    /// reply has fewer values than were asked for, it does not show which are missing. The client then asks
    /// again in ever smaller parts, and first separates the addresses that some firmware lacks. An address
    /// that has no value even when asked for alone is not asked for again on this connection. Exceptions:
    /// counters, which can be made at any time, and addresses that both ports have since V6.0.
    ///
    /// A reply may have too many values, or too few although no address turns out to be missing. Then lists
    /// of the right length may have values at the wrong addresses too. So the client asks for each address
    /// alone. It does so in the next query on this connection too, until one query passes without such a
    /// reply.
    ///
    /// All values come from one robot: if the connection changes between two parts, the client asks for all
    /// of them once more.
    ///
    /// # Errors
    /// [`RequestError`]; [`Invalid::Value`] if there is no address in the list. If the connection ends during
    /// the query, the client first asks once more over a new one. If the robot that answers is not the one
    /// that this handle was used with before, its values are not handed out
    /// ([`OutcomeUnknown::AnotherRobot`]).
    pub async fn query(&self, addresses: &[Address]) -> Result<QueryResult, RequestError> {
        if addresses.is_empty() {
            return Err(Invalid::Value(NO_ADDRESS).into());
        }
        // Pinned here because it is large: otherwise it would be moved on its way.
        let query = pin!(self.query_in(Lane::Ordinary, addresses));
        self.drive(query).await
    }

    /// Reads the values of the same addresses again, into the same result.
    ///
    /// This allocates no memory if the list fits into one frame and the firmware has a number for each
    /// address. Texts, lists and queries in parts still allocate.
    ///
    /// The old values are gone as soon as this begins: after an error, or if the future is dropped, the
    /// result has no rows. It keeps its addresses, so it can be read again.
    ///
    /// ```no_run
    /// use r6_client::{Address, AxisIndex, Robot};
    ///
    /// # async fn watch(robot: Robot) -> Result<(), r6_client::RequestError> {
    /// let j1 = Address::Axis(AxisIndex::ALL[0]);
    /// let mut read = robot.query(&[j1, Address::CurMode]).await?;
    /// for _ in 0..100 {
    ///     println!("{:?} deg", read.decimal(j1));
    ///     robot.query_again(&mut read).await?;
    /// }
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`Self::query`].
    pub async fn query_again(&self, result: &mut QueryResult) -> Result<(), RequestError> {
        let room = std::mem::take(&mut result.rows);
        let query = pin!(self.query_into(Lane::Ordinary, Arc::clone(&result.addresses), room));
        *result = self.drive(query).await?.0;
        Ok(())
    }

    /// The firmware's version (`version`), asked for once per connection; `None` if the controller has none.
    ///
    /// # Errors
    /// [`RequestError`] of the query.
    pub async fn firmware(&self) -> Result<Option<String>, RequestError> {
        let known = self.hub().known().firmware.clone();
        match known {
            Some(firmware) => Ok(firmware),
            None => {
                let result = self.query(&[Address::Version]).await?;
                Ok(result.text(Address::Version).map(str::to_owned))
            }
        }
    }

    pub(crate) async fn query_in(
        &self,
        lane: Lane,
        addresses: &[Address],
    ) -> Result<QueryResult, RequestError> {
        Ok(self.query_timed(lane, addresses).await?.0)
    }

    /// Queries, and returns the connection that answered and when the oldest value was asked for.
    pub(crate) async fn query_on_one_connection(
        &self,
        lane: Lane,
        addresses: &[Address],
    ) -> Result<(QueryResult, u64, Instant), RequestError> {
        let (read, asked_at) = self.query_timed(lane, addresses).await?;
        let connection = read.connection();
        if lane == Lane::Urgent && self.hub().known().read_of_nobody {
            // This would confirm a stop, whichever robot answers now.
            return Err(NotSent::StateNotRead.into());
        }
        Ok((read, connection, asked_at.oldest()))
    }

    /// Queries, and returns when each value was asked for. For a value known to be missing: a time
    /// during this query.
    pub(crate) async fn query_timed(
        &self,
        lane: Lane,
        addresses: &[Address],
    ) -> Result<(QueryResult, AskedAt), RequestError> {
        self.query_into(lane, addresses.into(), Rows::new()).await
    }

    /// Like [`Self::query_timed`], but the values go into `room`.
    pub(crate) async fn query_into(
        &self,
        lane: Lane,
        asked: Arc<[Address]>,
        room: Rows,
    ) -> Result<(QueryResult, AskedAt), RequestError> {
        let (lacking, doubts) = {
            let known = self.hub().known();
            let is_missing = |address: &Address| known.unsupported.contains(address);
            let lacking = !known.unsupported.is_empty() && asked.iter().any(is_missing);
            // What is missing holds for one connection.
            let lacking = lacking.then(|| {
                let there: Arc<[_]> = asked.iter().copied().filter(|address| !is_missing(address)).collect();
                (there, known.connection)
            });
            ((!known.doubts_lists).then_some(lacking), known.doubts)
        };
        let mut answer = None;
        if let Some(lacking) = lacking {
            let wanted = lacking.as_ref().map_or(&asked, |(there, _)| there);
            if !wanted.is_empty() && self.query_frames().fit(wanted) {
                // Nearly every query is this one: all in one frame, and all of it answered.
                match self.ask_into(room, Work::Query(Arc::clone(wanted)), lane).await? {
                    // Another query may have shown since then that lists are wrong. If all but one value are
                    // known to be missing, there is no list.
                    Answer::Values { rows, on }
                        if (wanted.len() == 1 || !self.hub().doubted_since(doubts))
                            && lacking.as_ref().is_none_or(|(_, known_on)| *known_on == on.connection) =>
                    {
                        self.hub().remember_supported(on.connection, wanted.iter().copied());
                        if lacking.is_some()
                            && let [address] = &**wanted
                        {
                            self.hub().known().empty.remove(address);
                        }
                        let rows = if lacking.is_some() { with_missing(&asked, rows) } else { rows };
                        let (took, connection) = (on.after, on.connection);
                        let result = QueryResult { addresses: asked, rows, took, connection };
                        self.hub().remember(lane, &result)?;
                        return Ok((result, AskedAt::Once(on.asked_at)));
                    }
                    other => {
                        let on = match &other {
                            Answer::Values { on, .. } | Answer::Mismatch { on, .. } => Some(on.connection),
                            Answer::Accepted { .. } | Answer::Raw { .. } | Answer::Left => None,
                        };
                        // On another connection other addresses may be missing.
                        let counts = lacking.as_ref().is_none_or(|(_, known_on)| on == Some(*known_on));
                        answer = counts.then(|| (other, Arc::clone(wanted)));
                    }
                }
            }
        }
        for _ in 0..ROUNDS {
            // Boxed: nearly no query comes here, and otherwise each would carry its size.
            let in_parts = Box::pin(self.query_in_parts(lane, &asked, answer.take(), doubts));
            if let Some(read) = in_parts.await? {
                return Ok(read);
            }
        }
        Err(NotSent::Disconnected.into())
    }

    /// Queries in as many frames as needed. `None` if the connection changed on the way, because earlier and
    /// later values may then come from different robots.
    ///
    /// - `answer`: the reply to one frame, and which addresses that was about: all but those that are known
    ///   to be missing.
    /// - `doubts`: how often lists had been doubted when the query began.
    async fn query_in_parts(
        &self,
        lane: Lane,
        addresses: &Arc<[Address]>,
        answer: Option<(Answer, Arc<[Address]>)>,
        doubts: u64,
    ) -> Result<Option<(QueryResult, AskedAt)>, RequestError> {
        let mut times = vec![self.hub().time.now(); addresses.len()];
        let mut rows: Vec<_> =
            addresses.iter().map(|address| (*address, Err(NoReading::Unsupported))).collect();
        let (wanted, missing_on, doubts_lists): (Part, u64, bool) = {
            let known = self.hub().known();
            // An answered address was asked for, whatever has become known since.
            let wanted = |address: &Address| match &answer {
                Some((_, asked)) => asked.contains(address),
                None => !known.unsupported.contains(address),
            };
            let all = addresses.iter().copied().enumerate();
            (
                all.filter(|(_, address)| wanted(address)).collect(),
                known.connection,
                known.doubts_lists && answer.is_none(),
            )
        };
        let several = wanted.len() > 1;
        let mut took = Duration::ZERO;
        // Which addresses are missing also depends on the connection.
        let mut connection = (wanted.len() < addresses.len()).then_some(missing_on);
        let mut parts =
            Parts::new(if doubts_lists { alone(wanted) } else { self.query_frames().split(wanted) });
        let mut answer = answer.map(|(answer, _)| answer);
        let mut told_by_a_list = None;
        while let Some(part) = parts.next(self.hub().doubted_since(doubts)) {
            if parts.contradicted()
                && let Some((connection, identity)) = told_by_a_list.take()
            {
                self.hub().forget_identity(connection, &identity);
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
                        // Remember it before the next part is sent: then nothing else has to ask for the
                        // identity.
                        let (rows, connection) = (read.clone(), on.connection);
                        let addresses = asked.as_slice().into();
                        let told = QueryResult { addresses, rows, took, connection };
                        told_by_a_list = self.hub().remember_identity(connection, &told);
                    }
                    let asked_at = on.asked_at;
                    for ((at, _), read) in part.iter().zip(read) {
                        if let (Some(time), Some(row)) = (times.get_mut(*at), rows.get_mut(*at)) {
                            (*time, *row) = (asked_at, read);
                        }
                    }
                    self.hub().remember_supported(on.connection, asked.into_iter());
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
                            self.hub().remember_unsupported(on.connection, *address);
                            lacked = self.hub().may_lack(on.connection, *address);
                            NoReading::Unsupported
                        } else {
                            NoReading::Unreadable(too_many(*address, answered))
                        };
                        if let Some((_, row)) = rows.get_mut(*at) {
                            // It may have had a value in a list that is no longer trusted.
                            *row = Err(none);
                        }
                    }
                    parts.mismatched(&part, answered, lacked);
                    if parts.contradicted() && !doubted {
                        self.hub().known().doubt_lists(on.connection);
                    }
                }
                Answer::Accepted { .. } | Answer::Raw { .. } | Answer::Left => {
                    let answer = "a reply to a command".to_owned();
                    return Err(OutcomeUnknown::Unclear { request: Sent::QUERY, answer }.into());
                }
            }
        }
        let connection = connection.unwrap_or(missing_on);
        let result = QueryResult { addresses: Arc::clone(addresses), rows, took, connection };
        if parts.contradicted() {
            self.hub().known().doubt_lists(result.connection);
        } else if doubts_lists && several {
            // A query of one address says little about lists.
            self.hub().believe_lists(result.connection, doubts);
        }
        self.hub().remember(lane, &result)?;
        Ok(Some((result, AskedAt::Each(times))))
    }
}

/// The rows of all these addresses, of which the controller has the ones in `rows`, in the same order.
fn with_missing(asked: &[Address], rows: Rows) -> Rows {
    let mut rows = rows.into_iter().peekable();
    let row = |address: &Address| {
        rows.next_if(|(there, _)| there == address).unwrap_or((*address, Err(NoReading::Unsupported)))
    };
    asked.iter().map(row).collect()
}

fn too_many(address: Address, answered: usize) -> FieldError {
    FieldError {
        path: FieldPath::Member(address.to_string()),
        found: Some(format!("{answered} values")),
        wanted: Wanted(&["one value", "一个值"]),
        nearest: None,
    }
}
