//! Subscriptions: many watchers, one poller.
//!
//! # A subscription
//!
//! 1. This file takes the request for values.
//! 2. `board.rs` keeps all requests and the last value of each address. The first subscription starts the one
//!    errand that polls, which is in this file.
//! 3. `poll_plan.rs` says what is due: addresses and times in, addresses and the next time out.
//! 4. The query goes the way of any other (`query.rs`, `connection.rs`), as `Lane::Background`: values that
//!    it reads do not unlock commands.
//! 5. `query/parts.rs` splits a query into parts, and checks the numbers of values in the replies.
//!    `query/memory.rs` keeps what the replies tell of the controller.
//! 6. `introduction.rs` asks for the identity before the first request and on a new connection.
//!    `link/identification.rs` says which requests wait for the answer. Queries on a first connection wait
//!    0.5 s at most.
//! 7. `link_quality.rs` measures the connection by the replies.

pub(crate) mod limits;

use std::sync::Arc;
use std::time::Duration;

use r6_proto::Reading;
use r6_proto::address::Address;
use r6_proto::error::FieldError;
use r6_proto::time::Instant;
use tokio::sync::watch;

use crate::board::Last;
use crate::error::{NotSent, RequestError};
use crate::link::Lane;
use crate::link_quality::LinkState;
use crate::query::result::{NoReading, Rows};
use crate::robot::Robot;
use crate::settings::Liveness;
pub use crate::subscription::limits::NotSubscribed;
use crate::subscription::limits::{LONGEST_PERIOD, SHORTEST_PERIOD};

/// Values that are read repeatedly: [`Robot::subscribe`]. Dropping it ends that.
#[derive(Debug)]
pub struct Subscription {
    robot: Robot,
    id: u64,
    addresses: Vec<Address>,
    news: watch::Receiver<()>,
}

/// Says when values of a subscription were read again: [`Subscription::changes`].
#[derive(Debug)]
pub struct Changes {
    news: watch::Receiver<()>,
}

/// The values of a subscription at one moment. They may come from several queries: each has its own age.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    values: Vec<Value>,
    failure: Option<RequestError>,
}

/// The last value of an address, and its quality.
#[derive(Clone, Debug, PartialEq)]
pub struct Value {
    /// The address.
    pub address: Address,
    /// The last value read; `None` if there is no value.
    pub reading: Option<Reading>,
    /// The time since it was asked for; the value is no older. `None` if no answer ever came.
    pub age: Option<Duration>,
    /// Whether to act on it.
    pub quality: Quality,
}

/// How much a value can be trusted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Quality {
    /// It was read when it was due.
    Fresh,
    /// It should have been read again at least [`Liveness::suspect_after`] ago, the connection is lost or
    /// suspect, or it was read over an earlier connection.
    Stale,
    /// It should have been read again at least [`Liveness::dead_after`] ago, or the connection is dead.
    Dead,
    /// No answer has come yet.
    NotRead,
    /// The controller has no such value. It is asked for again on the next connection, a counter each time.
    Unsupported,
    /// The controller sent something that cannot be a value of this address.
    Unreadable(FieldError),
}

impl Robot {
    /// Reads these addresses periodically, from now on, until the subscription is dropped.
    ///
    /// All subscriptions of a robot and its clones share one poller. It merges addresses that are due at
    /// about the same time into as few queries as the controller's frames allow. It asks for an address at
    /// the shortest period of all its subscriptions. At most one query is under way, so that a command waits
    /// for no more than one of its frames. Periods that are multiples of each other merge best. Controllers
    /// have been polled every 50 ms for hours.
    ///
    /// After a loss of the connection, the next poll reconnects at once, and for as long as it takes.
    /// Attempts follow each other within three eighths of the shortest period, so that values are there again
    /// within one period once there is a link. All of them are then read again. No motion is resumed. A
    /// command still needs a [`Robot::status`] or query before it: the reads of a subscription do not count.
    ///
    /// A subscription keeps the connection open like a clone of the handle.
    ///
    /// # Errors
    /// [`NotSubscribed`]: no or too many addresses, or a period below 20 ms or above one hour.
    ///
    /// ```no_run
    /// use std::time::Duration;
    ///
    /// use r6_client::{Robot, RobotSettings};
    /// use r6_client::Address;
    ///
    /// # async fn run() -> Result<(), Box<dyn std::error::Error>> {
    /// let robot = Robot::connect("192.168.1.10", RobotSettings::default()).await?;
    /// let mut state =
    ///     robot.subscribe(&[Address::CurMode, Address::CurAlarm], Duration::from_millis(100))?;
    /// while let Some(snapshot) = state.next().await {
    ///     match snapshot.fresh(Address::CurAlarm) {
    ///         Some(alarm) => println!("{alarm:?}"),
    ///         None => println!("not known: {:?}", snapshot.value(Address::CurAlarm)),
    ///     }
    /// }
    /// # Ok(())
    /// # }
    /// ```
    pub fn subscribe(&self, addresses: &[Address], every: Duration) -> Result<Subscription, NotSubscribed> {
        if !(SHORTEST_PERIOD..=LONGEST_PERIOD).contains(&every) {
            return Err(NotSubscribed::Period { asked: every });
        }
        let poll = || self.unbegun_errand(poll(self.clone()));
        let (id, news) = self.hub().board.add(addresses, every, poll)?;
        self.nudge();
        Ok(Subscription { robot: self.clone(), id, addresses: addresses.to_vec(), news })
    }
}

/// Asks for what is due, one query at a time, until no subscription is left or the handle is closed.
async fn poll(robot: Robot) {
    let board = &robot.hub().board;
    // The rows of a poll are read into those of the one before.
    let mut room = Rows::new();
    while let Some(poll) = board.due().await {
        let (addresses, rows) = (Arc::clone(&poll.addresses), std::mem::take(&mut room));
        match robot.query_into(Lane::Background, addresses, rows).await {
            Ok((result, asked_at)) => {
                board.answered(&poll, &result, &asked_at);
                room = result.rows;
            }
            Err(RequestError::NotSent(NotSent::Closed)) => return board.close(),
            Err(error) => board.failed(&poll, error),
        }
    }
}

impl Subscription {
    /// The addresses, as they were given.
    #[must_use]
    pub fn addresses(&self) -> &[Address] {
        &self.addresses
    }

    /// The values as they are known now, in the order of the addresses. It does not wait.
    #[must_use]
    pub fn latest(&self) -> Snapshot {
        let hub = self.robot.hub();
        let settings = self.robot.settings();
        let now = self.robot.now();
        let link = hub.meter().state(now, settings.liveness);
        let connection = hub.known().connection;
        let (values, failure) = hub.board.seen(&self.addresses, |address, last, every| {
            Value::of(address, last, every, now, (link, connection), settings.liveness)
        });
        Snapshot { values, failure }
    }

    /// Waits until any of the values was read again, a poll failed, or the connection was lost; `None` once
    /// the handle is closed.
    ///
    /// A late caller gets the latest values; those in between are gone, and the poller does not wait.
    /// Dropping the future loses nothing.
    pub async fn next(&mut self) -> Option<Snapshot> {
        self.changed().await.then(|| self.latest())
    }

    /// Returns what waits for the next change in place of [`Self::changed`], so that a program can wait for
    /// many subscriptions at once and read the one whose values changed. A change that this subscription has
    /// not told of yet counts.
    #[must_use]
    pub fn changes(&self) -> Changes {
        Changes { news: self.news.clone() }
    }

    /// Waits as [`Self::next`], without taking the values; `false` once the handle is closed.
    pub async fn changed(&mut self) -> bool {
        // The hand drives the poller, which is an errand: to drive here, too, would only be a second look.
        self.news.changed().await.is_ok()
    }
}

impl Changes {
    /// Waits until any of the values was read again, a poll failed, or the connection was lost; `false` once
    /// the subscription was dropped, or the handle is closed. Dropping the future loses nothing.
    pub async fn next(&mut self) -> bool {
        self.news.changed().await.is_ok()
    }
}

impl Drop for Subscription {
    fn drop(&mut self) {
        self.robot.hub().board.remove(self.id);
    }
}

impl Value {
    /// The statement "this value is fresh": it was read when due, over the connection that is alive now.
    fn of(
        address: Address,
        last: Option<&Last>,
        every: Duration,
        now: Instant,
        (link, present): (LinkState, u64),
        liveness: Liveness,
    ) -> Self {
        let Some(Last { value, at, connection }) = last else {
            return Self { address, reading: None, age: None, quality: Quality::NotRead };
        };
        let age = now.since(*at);
        let overdue = age.saturating_sub(every);
        let quality = match value {
            Err(NoReading::Unsupported) => Quality::Unsupported,
            Err(NoReading::Unreadable(error)) => Quality::Unreadable(error.clone()),
            Ok(_) if overdue > liveness.dead_after || link == LinkState::Dead => Quality::Dead,
            // A value of an earlier connection may come from another robot, or from before a power cycle.
            Ok(_)
                if overdue > liveness.suspect_after
                    || link == LinkState::Suspect
                    || *connection != present =>
            {
                Quality::Stale
            }
            Ok(_) => Quality::Fresh,
        };
        let reading = value.as_ref().ok().cloned();
        Self { address, reading, age: Some(age), quality }
    }
}

impl Snapshot {
    /// All values, in the order of the addresses.
    #[must_use]
    pub fn values(&self) -> &[Value] {
        &self.values
    }

    /// The value of an address; `None` if it was not subscribed to.
    #[must_use]
    pub fn value(&self, address: Address) -> Option<&Value> {
        self.values.iter().find(|value| value.address == address)
    }

    /// The value read, if it is fresh: act on no others.
    #[must_use]
    pub fn fresh(&self, address: Address) -> Option<&Reading> {
        self.value(address).filter(|value| value.quality == Quality::Fresh)?.reading.as_ref()
    }

    /// Why the last poll failed; `None` if it succeeded.
    #[must_use]
    pub fn failure(&self) -> Option<&RequestError> {
        self.failure.as_ref()
    }
}
