//! The history of a robot's values.

use serde::{Deserialize, Serialize};

use super::Happened;
use crate::AddressValue;

/// A page of the history of one signal: its samples, or its buckets if a width was asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct History {
    /// The robot.
    pub robot: String,
    /// The query address.
    #[cfg_attr(feature = "openapi", schema(example = "axis-0"))]
    pub signal: String,
    /// The unit; `null` if the value has none, or if the protocol does not tell it.
    #[cfg_attr(feature = "openapi", schema(required = true, example = "mm"))]
    pub unit: Option<String>,
    /// The begin of the range.
    pub from: String,
    /// Its end, which does not belong to it.
    pub to: String,
    /// The width of the buckets; absent for samples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bucket_ms: Option<u64>,
    /// The samples, in the order of time. The first one is the last one before the range if it counts at its
    /// begin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples: Option<Vec<HistorySample>>,
    /// The buckets, in the order of time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub buckets: Option<Vec<HistoryBucket>>,
    /// Samples up to this time survive the end of the process, in whatever way it ends. `null` if none was
    /// written since the gateway started.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub kept_until: Option<String>,
    /// How many chunks of the range cannot be read: the disk or another program changed them. Their samples
    /// are missing.
    pub unreadable_chunks: u64,
    /// Where the values of the range are gone, wholly or in part, and averages of them are left, in the order
    /// of time; absent if the values are there.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub averages: Vec<HistoryAverages>,
    /// Ask with this `cursor`, and the same `signal`, `from`, `to` and `bucket`, to read on; `null` at the
    /// end.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub next_cursor: Option<String>,
}

/// What is known of a signal from a time on, until the next sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct HistorySample {
    /// When the value was asked for: it is no older.
    pub time: String,
    /// The value; `null` without a value.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub value: Option<AddressValue>,
    /// Why there is no value from this time on; absent if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<Gap>,
}

/// What a signal was in a span of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct HistoryBucket {
    /// Its begin.
    pub time: String,
    /// The average, weighted by time, over the time with a value; `null` without a number.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub mean: Option<f64>,
    /// The smallest number; `null` without a number.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub min: Option<f64>,
    /// The largest number; `null` without a number.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub max: Option<f64>,
    /// The value at its end; `null` if there was none then.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub last: Option<AddressValue>,
    /// For how long there was a value.
    pub good_ms: f64,
    /// How many samples were kept in it.
    pub samples: u64,
}

/// A part of a range of which averages are left.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct HistoryAverages {
    /// The begin of the part.
    pub from: String,
    /// Its end, which does not belong to it.
    pub to: String,
    /// How wide the averages are that were used, or the narrowest that are left: a minute or an hour.
    #[cfg_attr(feature = "openapi", schema(example = 60_000))]
    pub width_ms: u64,
    /// What was done with them.
    pub used: AveragesUsed,
}

/// What was done with averages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum AveragesUsed {
    /// The buckets are the same as those of the values.
    Exact,
    /// Edges of buckets lie within averages: each average counts in the bucket in which it begins.
    ByBegin,
    /// The averages lack some values of their days, and so do the buckets. Edges of buckets may lie within
    /// averages, too.
    Incomplete,
    /// They are not in the answer, which has samples or narrower buckets: ask for buckets of `width_ms` at
    /// least.
    NotUsed,
}

/// Why there is no value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Gap {
    /// The value was not read within 1.5 s after it was due.
    Stale,
    /// The controller does not have it, it cannot be parsed, or it is a text of more than 1 KiB.
    None,
    /// It was read and could not be kept: the disk or the gateway was too slow, the disk failed, or for more
    /// than 6 s the robot had not said over this connection who it is.
    Lost,
    /// The gateway ended, or stopped reading this robot, or another robot answers in its place.
    Ended,
    /// The clock of the gateway was set. Times before and behind this sample do not fit together.
    ClockStepped,
    /// No sample came for 2.5 times the longest interval of the signal, one minute in general: the gateway
    /// was killed, or the machine was off.
    NoData,
}

impl Gap {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Stale, Self::None, Self::Lost, Self::Ended, Self::ClockStepped, Self::NoData];

    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Stale => "stale",
            Self::None => "none",
            Self::Lost => "lost",
            Self::Ended => "ended",
            Self::ClockStepped => "clock_stepped",
            Self::NoData => "no_data",
        }
    }
}

/// Whether the values of robots are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum HistoryState {
    /// They are kept.
    Kept,
    /// The disk is full or fails. Samples wait in memory, and are lost once there is no room.
    Paused,
    /// The file of the gateway says that none are kept.
    Off,
}

/// A page of what was seen to happen at a robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct HistoryEvents {
    /// The robot.
    pub robot: String,
    /// The begin of the range.
    pub from: String,
    /// Its end, which does not belong to it.
    pub to: String,
    /// The events, in the order of time.
    pub events: Vec<HistoryEvent>,
    /// Events up to this time survive the end of the process, in whatever way it ends. `null` if none was
    /// written since the gateway started.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub kept_until: Option<String>,
    /// How many events and files of the range cannot be read: the disk or another program changed them.
    pub unreadable: u64,
    /// Ask with this `cursor`, and the same `from`, `to` and `kind`, to read on; `null` at the end. A page
    /// may have fewer events than were asked for, and still go on.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub next_cursor: Option<String>,
}

/// An event of the history.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct HistoryEvent {
    /// Its id, which does not change: the number of its day, that of the file of this day, that in the file.
    #[cfg_attr(feature = "openapi", schema(example = "20782-1-57"))]
    pub id: String,
    /// When the value that shows it was asked for; never before the time of the event before it.
    pub time: String,
    /// When the value was asked for, if that is before the time of an event that was noticed earlier; absent
    /// otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub true_time: Option<String>,
    /// What.
    #[serde(flatten)]
    pub happened: Happened,
}

/// Why the gateway did not see a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum UnseenBecause {
    /// The connection ended, or nothing came back over it.
    Link,
    /// The gateway was too slow, or the machine slept.
    Late,
    /// The gateway started, or began to read the robot anew.
    Start,
    /// Values or events could not be kept: the gateway or the disk was too slow, or the disk failed.
    Lost,
    /// The robot answered without a value that events come from.
    Unread,
    /// Another robot answered at its address, until an engineer accepted it.
    AnotherRobot,
}

impl UnseenBecause {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Link, Self::Late, Self::Start, Self::Lost, Self::Unread, Self::AnotherRobot];
}
