//! The log: what arrived, and what the arm did.

use std::time::Duration;

use serde::Serialize;
use serde_json::Value;

use super::Kind;

/// One event.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// The time since the start of the arm; seconds in JSON.
    #[serde(serialize_with = "as_seconds")]
    pub at: Duration,
    /// The number of its connection, from 1; 0 for events without a connection.
    pub connection: u32,
    /// The robot that received it: 1, or 2 after a swap.
    pub robot: usize,
    /// The received frame; `null` for an event without a frame.
    pub frame: Value,
    /// The kind of the received frame.
    pub kind: Kind,
    /// What the arm did.
    pub did: Did,
    /// When the reply leaves, since the start of the arm; `None` without a reply.
    #[serde(serialize_with = "maybe_seconds")]
    pub answered: Option<Duration>,
}

/// What the arm did about an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Did {
    /// It reported values.
    Told,
    /// It stops, or has stopped.
    Halts,
    /// It cleared its list.
    Cleared,
    /// It took instructions into its list.
    Took,
    /// It takes the instructions later.
    TakesLater,
    /// It dropped some or all instructions and replied ok.
    Dropped,
    /// It executed something else: start, clear the alarm, a speed.
    Obeyed,
    /// It did nothing, and replied so.
    Refused,
    /// It did nothing.
    Nothing,
    /// The connection was deaf, so the bytes were not read.
    NotHeard,
    /// A connection was opened.
    Opened,
    /// A connection was refused.
    NotOpened,
    /// A connection has ended.
    Closed,
    /// Another robot answers from now on.
    Swapped,
    /// The controller restarted.
    Rebooted,
}

/// A step that the arm began.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Carried {
    /// The number of its AddRCC among those of this robot, from 1, including those of other clients; 0 for
    /// the taught program.
    pub list: u32,
    /// Its place in that list, from 1.
    pub place: u32,
    /// When it began, since the start of the arm.
    #[serde(serialize_with = "as_seconds")]
    pub begun: Duration,
    /// When it ended; `None` while it runs.
    #[serde(serialize_with = "maybe_seconds")]
    pub ended: Option<Duration>,
    /// Whether it was executed to its end.
    pub whole: bool,
}

fn as_seconds<S: serde::Serializer>(time: &Duration, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(time.as_secs_f64())
}

#[allow(clippy::ref_option, reason = "serde hands a reference to the field")]
fn maybe_seconds<S: serde::Serializer>(time: &Option<Duration>, to: S) -> Result<S::Ok, S::Error> {
    time.map(|time| time.as_secs_f64()).serialize(to)
}
