//! Whether the controller of one connection has said who it is, and what waits until it has.
//!
//! ```text
//!  first connection: not asked
//!    ──a query waits, once──────────────▶ asking; queries wait for half a second ──no answer──▶ it goes on
//!    ──a command waits, or a stop left──▶ asking; all but stops wait ─────────────no answer──▶ it ends
//!  made anew ───────────────────────────▶ asking; all wait, stops half a second ──no answer──▶ it ends
//!  asking ──answered──▶ the controller has said who it is
//! ```

use std::time::Duration;

use r6_proto::address::Address;
use r6_proto::client::Ticket;
use r6_proto::time::Instant;

use crate::error::RequestError;
use crate::introduction::Introduction;
use crate::job::Answer;

/// How long a stop waits on a connection that was made anew for the controller to say who it is, so that no other robot is stopped
/// unasked. Real controllers answer within 26 ms. One that does not answer in this time is most likely the one that is meant, behind
/// a bad link: the stop leaves, and is not confirmed before it has said who it is.
///
/// A query waits as long on a handle's first connection. Then it leaves too: some controller may not answer such a question.
const WHO_WITHIN: Duration = Duration::from_millis(500);

/// The question who is there, on one connection.
#[derive(Debug)]
pub(super) struct Identification {
    /// Whether this is the handle's first connection.
    first: bool,
    /// Asks who is there, while that is not known.
    introduction: Option<Introduction>,
    without: Without,
    /// Whether the introduction was begun for a query: once for a connection.
    begun_for_query: bool,
    /// Until when queries wait for an introduction that was begun for them.
    queries_wait_until: Option<Instant>,
    /// Until when stops wait; `None` where they do not.
    stops_wait_until: Option<Instant>,
    /// The query that is under way.
    under_way: Option<Ticket>,
}

/// What becomes of a connection on which the controller does not say who it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Without {
    /// It goes on as it is: only queries were asked for.
    GoesOn,
    /// Nothing ordinary leaves on it, and it ends.
    Ends,
}

impl Identification {
    /// `meant`: whether it is known who should be there.
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

    /// Whether the controller has yet to say who it is.
    pub fn is_open(&self) -> bool {
        self.introduction.is_some()
    }

    pub fn is_under_way(&self) -> bool {
        self.under_way.is_some()
    }

    /// Whether the connection ends where the controller does not answer.
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

    /// Has the controller asked. Nothing ordinary leaves before it has answered.
    pub fn begin(&mut self) {
        self.without = Without::Ends;
        self.introduction.get_or_insert_with(Introduction::first);
    }

    /// The same for a request that leaves without it where the controller does not answer. Whether it has to wait.
    pub fn begin_for_query(&mut self, now: Instant) -> bool {
        if !self.begun_for_query && !self.is_open() {
            self.introduction = Some(Introduction::first());
            self.queries_wait_until = Some(now + WHO_WITHIN);
        }
        self.begun_for_query = true;
        self.holds_queries()
    }

    /// What is to be asked now.
    pub fn question(&self) -> Option<&[Address]> {
        if self.is_under_way() { None } else { self.introduction.as_ref()?.next() }
    }

    /// [`Self::question`] was handed to the connection.
    pub fn asked(&mut self, ticket: Ticket) {
        self.under_way = Some(ticket);
    }

    /// Whether this is the query that is under way. Then it is over.
    pub fn take(&mut self, ticket: Ticket) -> bool {
        self.under_way.take_if(|under_way| *under_way == ticket).is_some()
    }

    /// The answer to [`Self::question`].
    pub fn answered(&mut self, answer: Result<Answer, RequestError>) {
        if let Some(introduction) = &mut self.introduction {
            introduction.answered(answer);
        }
    }

    /// No answer came in time. Whether the connection counts as dead by that.
    pub fn timed_out(&mut self) -> bool {
        let given_up = self.introduction.as_mut().is_some_and(Introduction::timed_out);
        if given_up && !self.has_to_answer() {
            self.introduction = None;
        }
        given_up && self.has_to_answer()
    }

    /// What was found, once all is known.
    pub fn ended(&mut self) -> Option<Introduction> {
        self.introduction.take_if(|asking| asking.next().is_none())
    }

    /// When [`Self::tick`] is due.
    pub fn deadline(&self) -> Option<Instant> {
        let held = [self.stops_wait_until, self.queries_wait_until];
        held.into_iter().flatten().min().filter(|_| self.is_open())
    }

    /// Time passed: what has waited long enough leaves.
    pub fn tick(&mut self, now: Instant) {
        self.stops_wait_until = self.stops_wait_until.filter(|until| *until > now);
        self.queries_wait_until = self.queries_wait_until.filter(|until| *until > now);
    }
}
