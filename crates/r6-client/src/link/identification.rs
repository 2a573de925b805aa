//! Whether the controller of one connection has been identified, and which requests wait for that.
//!
//! ```text
//!  first connection: not asked
//!    ──a query waits, once──────▶ asking; queries wait for half a second ──no answer──▶ the connection stays
//!    ──a command waits, or a stop was sent─▶ asking; all but stops wait ───no answer──▶ the connection ends
//!  reconnected ──────────────▶ asking; all wait, stops half a second ───────no answer──▶ the connection ends
//!  asking ──answered──▶ the controller is identified
//! ```

use std::time::Duration;

use r6_proto::address::Address;
use r6_proto::client::Ticket;
use r6_proto::time::Instant;

use crate::error::RequestError;
use crate::introduction::Introduction;
use crate::job::Answer;

/// How long a stop waits for the identity of the controller after a reconnection, so that it does not stop
/// another robot by mistake. Real controllers answer within 26 ms. A controller that does not answer in this
/// time is most likely the intended one behind a bad link. Then the stop is sent, but it is not confirmed
/// before the controller is identified.
///
/// A query waits as long on a handle's first connection. Then it is sent too, because some controllers may
/// not answer the identity query.
const WHO_WITHIN: Duration = Duration::from_millis(500);

/// The identity query on one connection.
#[derive(Debug)]
pub(super) struct Identification {
    /// Whether this is the handle's first connection.
    first: bool,
    /// The identity query, while the answer is not known.
    introduction: Option<Introduction>,
    without: Without,
    /// Whether the introduction was begun for a query. This happens once per connection.
    begun_for_query: bool,
    /// Until when queries wait for an introduction that was begun for them.
    queries_wait_until: Option<Instant>,
    /// Until when stops wait; `None` if they do not wait.
    stops_wait_until: Option<Instant>,
    /// The identity query that is under way.
    under_way: Option<Ticket>,
}

/// What happens to a connection on which the controller does not identify itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Without {
    /// The connection continues as it is, because only queries wait.
    GoesOn,
    /// No ordinary request is sent on the connection, and it ends.
    Ends,
}

impl Identification {
    /// Starts on a new connection. `meant`: whether it is known which robot should be there.
    pub fn new(first: bool, meant: bool, now: Instant) -> Self {
        Self {
            first,
            introduction: (!first).then(Introduction::again),
            without: if first { Without::GoesOn } else { Without::Ends },
            begun_for_query: false,
            queries_wait_until: None,
            stops_wait_until: meant.then_some(now + WHO_WITHIN),
            under_way: None,
        }
    }

    pub fn is_first(&self) -> bool {
        self.first
    }

    /// Whether the controller is still to be identified.
    pub fn is_open(&self) -> bool {
        self.introduction.is_some()
    }

    pub fn is_under_way(&self) -> bool {
        self.under_way.is_some()
    }

    /// Whether the connection ends if the controller does not answer.
    pub fn has_to_answer(&self) -> bool {
        self.without == Without::Ends
    }

    pub fn holds_stops(&self) -> bool {
        self.is_open() && self.stops_wait_until.is_some()
    }

    /// Whether ordinary requests have to wait.
    pub fn holds_queries(&self) -> bool {
        self.is_open() && (self.has_to_answer() || self.queries_wait_until.is_some())
    }

    /// Starts the identity query. Nothing ordinary is sent before the controller has answered.
    pub fn begin(&mut self) {
        self.without = Without::Ends;
        self.introduction.get_or_insert_with(Introduction::first);
    }

    /// Starts the identity query for a request that is sent even if the controller does not answer. Returns
    /// whether the request has to wait.
    pub fn begin_for_query(&mut self, now: Instant) -> bool {
        if !self.begun_for_query && !self.is_open() {
            self.introduction = Some(Introduction::first());
            self.queries_wait_until = Some(now + WHO_WITHIN);
        }
        self.begun_for_query = true;
        self.holds_queries()
    }

    /// The addresses to query now.
    pub fn question(&self) -> Option<&[Address]> {
        if self.is_under_way() { None } else { self.introduction.as_ref()?.next() }
    }

    /// Notes that [`Self::question`] was handed to the connection.
    pub fn asked(&mut self, ticket: Ticket) {
        self.under_way = Some(ticket);
    }

    /// Whether this is the query that is under way. If so, it counts as ended.
    pub fn take(&mut self, ticket: Ticket) -> bool {
        self.under_way.take_if(|under_way| *under_way == ticket).is_some()
    }

    /// Takes in the answer to [`Self::question`].
    pub fn answered(&mut self, answer: Result<Answer, RequestError>) {
        if let Some(introduction) = &mut self.introduction {
            introduction.answered(answer);
        }
    }

    /// Notes that no answer came in time. Returns whether the connection therefore counts as dead.
    pub fn timed_out(&mut self) -> bool {
        let given_up = self.introduction.as_mut().is_some_and(Introduction::timed_out);
        if given_up && !self.has_to_answer() {
            self.introduction = None;
        }
        given_up && self.has_to_answer()
    }

    /// The result, once all is known.
    pub fn ended(&mut self) -> Option<Introduction> {
        self.introduction.take_if(|asking| asking.next().is_none())
    }

    /// The time at which [`Self::tick`] is due.
    pub fn deadline(&self) -> Option<Instant> {
        let held = [self.stops_wait_until, self.queries_wait_until];
        held.into_iter().flatten().min().filter(|_| self.is_open())
    }

    /// Handles the passing of time: requests that have waited long enough may be sent.
    pub fn tick(&mut self, now: Instant) {
        self.stops_wait_until = self.stops_wait_until.filter(|until| *until > now);
        self.queries_wait_until = self.queries_wait_until.filter(|until| *until > now);
    }
}
