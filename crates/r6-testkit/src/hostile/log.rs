//! What arrived, and what the arm did.

use std::time::Duration;

use serde::Serialize;
use serde_json::Value;

use super::Kind;

/// One thing that happened.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// When, since the start of the arm; seconds in JSON.
    #[serde(serialize_with = "as_seconds")]
    pub at: Duration,
    /// The connection that brought it, the first is 1; 0 for what came over none.
    pub connection: u32,
    /// The robot it came to: 1, or 2 after a swap.
    pub robot: usize,
    /// What arrived; `null` where nothing did.
    pub frame: Value,
    /// The kind of what arrived.
    pub kind: Kind,
    /// What the arm did.
    pub did: Did,
    /// When the answer leaves, since the start of the arm; `None` if there is none.
    #[serde(serialize_with = "maybe_seconds")]
    pub answered: Option<Duration>,
}

/// What the arm did about something.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Did {
    /// It told values.
    Told,
    /// It stops, or has stopped.
    Halts,
    /// It cleared its list.
    Cleared,
    /// It took instructions into its list.
    Took,
    /// It will take them later.
    TakesLater,
    /// It dropped instructions, all or some of them, and said ok.
    Dropped,
    /// Something else that it was told to: start, clear the alarm, a speed.
    Obeyed,
    /// It did nothing and said so.
    Refused,
    /// It did nothing.
    Nothing,
    /// The connection was deaf: nothing was even read.
    NotHeard,
    /// A connection was opened.
    Opened,
    /// A connection was refused.
    NotOpened,
    /// A connection has ended.
    Closed,
    /// Another robot answers from now on.
    Swapped,
    /// The controller started anew.
    Rebooted,
}

/// A step that the arm began.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Carried {
    /// The AddRCC that brought it, the first one of this robot is 1, other clients' included; 0 for the
    /// taught program.
    pub list: u32,
    /// Its place in that list, the first is 1.
    pub place: u32,
    /// When it began, since the start of the arm.
    #[serde(serialize_with = "as_seconds")]
    pub begun: Duration,
    /// When it ended; `None` while it runs.
    #[serde(serialize_with = "maybe_seconds")]
    pub ended: Option<Duration>,
    /// Whether it was carried out to its end.
    pub whole: bool,
}

fn as_seconds<S: serde::Serializer>(time: &Duration, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(time.as_secs_f64())
}

#[allow(clippy::ref_option, reason = "serde hands a reference to the field")]
fn maybe_seconds<S: serde::Serializer>(time: &Option<Duration>, to: S) -> Result<S::Ok, S::Error> {
    time.map(|time| time.as_secs_f64()).serialize(to)
}
