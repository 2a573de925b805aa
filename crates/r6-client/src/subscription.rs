//! Subscriptions: many watchers, one poller.

use std::fmt;
use std::time::Duration;

use r6_proto::Reading;
use r6_proto::address::Address;
use r6_proto::error::FieldError;
use tokio::sync::watch;
use tokio::time::Instant;

use crate::board::{Last, Seen};
use crate::error::{NotSent, RequestError};
use crate::link::Lane;
use crate::link_quality::LinkState;
use crate::query::NoReading;
use crate::robot::Robot;
use crate::settings::Liveness;

/// Subscriptions of one robot, its clones together: screens, recorders and checks of one program. Each costs some
/// hundred bytes and a wake-up per poll.
pub(crate) const MAX_SUBSCRIPTIONS: usize = 256;

/// Addresses of one subscription: more than all that are not registers.
pub(crate) const MAX_ADDRESSES: usize = 256;

/// Addresses of all subscriptions of one robot. Some fifty fit into a query, and a reply takes 18 ms: all of these take
/// a controller a third of a second.
pub(crate) const MAX_POLLED: usize = 1024;

/// No address is asked for more often: a viewer of the maker's asks for 26 addresses every 20 ms, and a reply takes that long.
const SHORTEST_PERIOD: Duration = Duration::from_millis(20);

/// No address is asked for less often: whoever needs it once a day asks for it himself.
const LONGEST_PERIOD: Duration = Duration::from_secs(3600);

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

/// Why there is no subscription.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotSubscribed {
    /// No address, or more than 256.
    Addresses {
        /// How many were asked for, each counted once.
        asked: usize,
    },
    /// The period is shorter than 20 ms or longer than an hour.
    Period {
        /// As asked for.
        asked: Duration,
    },
    /// 256 subscriptions of this robot exist.
    Subscriptions,
    /// All subscriptions of a robot together ask for 1 024 addresses at most.
    Polled {
        /// So many are asked for already.
        polled: usize,
        /// So many would be added.
        new: usize,
    },
    /// The handle was closed.
    Closed,
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
    /// use r6_proto::Address;
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
        let poll = || self.runtime().spawn(poll(self.clone())).abort_handle();
        let (id, news) = self.hub().board.add(addresses, every, poll)?;
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
        let now = Instant::now();
        let link = hub.meter().state(hub.clock.of(now), settings.liveness);
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
        self.news.changed().await.ok()?;
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
        let age = now.saturating_duration_since(at);
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

impl fmt::Display for NotSubscribed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("not subscribed: ")?;
        match self {
            Self::Addresses { asked: 0 } => f.write_str("no address was given; name one at least"),
            Self::Addresses { asked } => {
                write!(f, "{asked} addresses are too many for one; give each at most {MAX_ADDRESSES}")
            }
            Self::Period { asked } => write!(
                f,
                "every {asked:?} is no period that a controller is asked at; choose one from {SHORTEST_PERIOD:?} to \
                 {LONGEST_PERIOD:?}, 50ms or longer for hours on end"
            ),
            Self::Subscriptions => {
                write!(f, "{MAX_SUBSCRIPTIONS} exist already; drop some, or share one between tasks")
            }
            Self::Polled { polled, new } => write!(
                f,
                "{polled} addresses are asked for already and {new} more would exceed {MAX_POLLED}; drop some"
            ),
            Self::Closed => f.write_str("the handle is closed; connect again"),
        }
    }
}

impl std::error::Error for NotSubscribed {}
