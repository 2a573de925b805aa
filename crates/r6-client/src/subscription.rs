//! Subscriptions: many watchers, one poller.

pub(crate) mod limits;

use std::time::Duration;

use r6_proto::Reading;
use r6_proto::address::Address;
use r6_proto::error::FieldError;
use r6_proto::time::Instant;
use tokio::sync::watch;

use crate::board::{Last, Seen};
use crate::error::{NotSent, RequestError};
use crate::link::Lane;
use crate::link_quality::LinkState;
use crate::query::result::NoReading;
use crate::robot::Robot;
use crate::settings::Liveness;
pub use crate::subscription::limits::NotSubscribed;
use crate::subscription::limits::{LONGEST_PERIOD, SHORTEST_PERIOD};

/// Values that are read again and again: [`Robot::subscribe`]. Dropping it ends that.
#[derive(Debug)]
pub struct Subscription {
    robot: Robot,
    id: u64,
    addresses: Vec<Address>,
    news: watch::Receiver<()>,
}

/// The values of a subscription at one moment. They need not have been read in one query: each has its own age.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    values: Vec<Value>,
    failure: Option<RequestError>,
}

/// The last value of an address, and what it is worth.
#[derive(Clone, Debug, PartialEq)]
pub struct Value {
    /// The address.
    pub address: Address,
    /// What was read last; `None` if there is no value.
    pub reading: Option<Reading>,
    /// How long ago it was asked for: it is no older. `None` if no answer ever came.
    pub age: Option<Duration>,
    /// Whether to act on it.
    pub quality: Quality,
}

/// What a value is worth.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Quality {
    /// It was read when it was due.
    Fresh,
    /// It should have been read again, [`Liveness::suspect_after`] ago or longer, or the connection is lost or suspect, or it was
    /// read over an earlier connection.
    Stale,
    /// The same since [`Liveness::dead_after`].
    Dead,
    /// No answer has come yet.
    NotRead,
    /// The controller has no such value. It is asked for again on the next connection, a counter each time.
    Unsupported,
    /// The controller sent something that cannot be a value of this address.
    Unreadable(FieldError),
}

impl Robot {
    /// Has these addresses read every so often, from now on, until the subscription is dropped.
    ///
    /// All subscriptions of a robot and its clones share one poller. It merges what is due at about the same time into as few
    /// queries as the controller's frames allow, asks for an address at the shortest period that anybody wants, and has never
    /// more than one query under way, so that a command waits for no more than one of its frames. Periods that are
    /// multiples of each other are merged best. Controllers have been polled every 50 ms for hours.
    ///
    /// A lost connection is made anew by the next poll, at once, and for as long as it takes: attempts follow each other within three
    /// eighths of the shortest period, so that values are there again within one period once there is a link. All of them are then
    /// read again. No motion is resumed, and
    /// a command still has to be preceded by somebody's [`Robot::status`] or query: what a subscription reads does not count.
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

/// Asks for what is due, one query at a time, until nothing is wanted or the handle is closed.
async fn poll(robot: Robot) {
    let board = &robot.hub().board;
    while let Some(poll) = board.due().await {
        match robot.query_timed(Lane::Background, &poll.addresses).await {
            Ok((result, asked_at)) => board.answered(&poll, &result, &asked_at),
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

    /// The values as they are known now, in the order of the addresses. Waits for nothing.
    #[must_use]
    pub fn latest(&self) -> Snapshot {
        let hub = self.robot.hub();
        let settings = self.robot.settings();
        let now = self.robot.now();
        let link = hub.meter().state(now, settings.liveness);
        let connection = hub.known().connection;
        let Seen { rows, failure } = hub.board.seen(&self.addresses);
        let values = rows.into_iter().map(|(address, last, every)| {
            Value::of(address, last, every, now, (link, connection), settings.liveness)
        });
        Snapshot { values: values.collect(), failure }
    }

    /// Waits until any of the values was read again, a poll failed, or the connection was lost; `None` once the handle is
    /// closed.
    ///
    /// Whoever comes late gets the latest values; what was in between is gone, and nobody waits for him. Dropping
    /// the future loses nothing.
    pub async fn next(&mut self) -> Option<Snapshot> {
        self.robot.drive(self.news.changed()).await.ok()?;
        Some(self.latest())
    }
}

impl Drop for Subscription {
    fn drop(&mut self) {
        self.robot.hub().board.remove(self.id);
    }
}

impl Value {
    /// The statement "this value is fresh": it was read over the connection that is alive now, and when it was due.
    fn of(
        address: Address,
        last: Option<Last>,
        every: Duration,
        now: Instant,
        (link, present): (LinkState, u64),
        liveness: Liveness,
    ) -> Self {
        let Some(Last { value, at, connection }) = last else {
            return Self { address, reading: None, age: None, quality: Quality::NotRead };
        };
        let age = now.since(at);
        let overdue = age.saturating_sub(every);
        let (reading, quality) = match value {
            Err(NoReading::Unsupported) => (None, Quality::Unsupported),
            Err(NoReading::Unreadable(error)) => (None, Quality::Unreadable(error)),
            Ok(reading) if overdue > liveness.dead_after || link == LinkState::Dead => {
                (Some(reading), Quality::Dead)
            }
            // A value of an earlier connection may be another robot's, or from before it was switched off.
            Ok(reading)
                if overdue > liveness.suspect_after
                    || link == LinkState::Suspect
                    || connection != present =>
            {
                (Some(reading), Quality::Stale)
            }
            Ok(reading) => (Some(reading), Quality::Fresh),
        };
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

    /// What was read, if it is fresh: the only values to act on.
    #[must_use]
    pub fn fresh(&self, address: Address) -> Option<&Reading> {
        self.value(address).filter(|value| value.quality == Quality::Fresh)?.reading.as_ref()
    }

    /// Why the last poll failed; `None` if it did not.
    #[must_use]
    pub fn failure(&self) -> Option<&RequestError> {
        self.failure.as_ref()
    }
}
