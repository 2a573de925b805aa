//! The log of a virtual controller.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::time::Duration;

use r6_proto::time::Instant;
use serde::{Serialize, Serializer};

use crate::controller::ConnectionId;
use r6_proto::Language;

use crate::event::{Event, Level};

/// How many entries wait to be read. Beyond that, the oldest are dropped and counted.
const MAX_ENTRIES: usize = 256;

/// How many warnings of one connection are logged within [`WARNING_WINDOW`]. A person cannot read more, and a
/// peer that sends rubbish as fast as it can must not fill the disk that holds the log.
const MAX_WARNINGS: u32 = 32;

/// The time within which the warnings of a connection are counted.
const WARNING_WINDOW: Duration = Duration::from_secs(1);

/// One entry of the log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LogEntry {
    /// When it happened. As data it is `at_s`, in seconds since the controller was switched on.
    #[serde(rename = "at_s", serialize_with = "seconds")]
    pub at: Instant,
    /// The connection; `None` for the machine itself.
    #[serde(serialize_with = "number")]
    pub connection: Option<ConnectionId>,
    /// What happened. As data, its name is in `event`, with its fields beside it.
    #[serde(flatten)]
    pub event: Event,
}

fn seconds<S: Serializer>(at: &Instant, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(at.as_secs_f64())
}

#[expect(clippy::ref_option, reason = "what serde asks for")]
fn number<S: Serializer>(connection: &Option<ConnectionId>, to: S) -> Result<S::Ok, S::Error> {
    connection.map(ConnectionId::number).serialize(to)
}

impl LogEntry {
    /// How much it matters.
    #[must_use]
    pub fn level(&self) -> Level {
        self.event.level()
    }

    /// The entry on one line.
    #[must_use]
    pub fn text(&self, language: Language) -> String {
        let text = self.event.text(language);
        match (self.connection, language) {
            (Some(id), Language::English) => format!("connection {}: {text}", id.number()),
            (Some(id), Language::Chinese) => format!("连接 {}：{text}", id.number()),
            (None, _) => text,
        }
    }
}

impl fmt::Display for LogEntry {
    /// In English.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text(Language::English))
    }
}

#[derive(Debug, Default)]
pub(crate) struct Log {
    entries: VecDeque<LogEntry>,
    dropped: u64,
    /// The warnings of each connection that was warned of, until it ends.
    connections: BTreeMap<ConnectionId, ConnectionWarnings>,
}

/// The warnings of one connection.
#[derive(Debug, Default)]
struct ConnectionWarnings {
    /// When the current [`WARNING_WINDOW`] began.
    since: Instant,
    /// How many warnings were logged in it.
    warnings: u32,
    /// How many more were left out.
    left_out: u64,
    /// Whether the log has already warned of a wrong `dsID`.
    ds_id: bool,
}

impl ConnectionWarnings {
    /// When the log reports how many warnings were left out.
    fn due(&self) -> Option<Instant> {
        (self.left_out > 0).then(|| self.since + WARNING_WINDOW)
    }
}

impl Log {
    pub fn add(&mut self, at: Instant, connection: Option<ConnectionId>, event: Event) {
        if self.entries.len() >= MAX_ENTRIES {
            self.entries.pop_front();
            self.dropped += 1;
        }
        self.entries.push_back(LogEntry { at, connection, event });
    }

    /// Logs a warning about a connection; beyond [`MAX_WARNINGS`] it is only counted.
    pub fn warn(&mut self, at: Instant, id: ConnectionId, event: Event) {
        let told = self.connections.entry(id).or_default();
        let is_over = at.since(told.since) >= WARNING_WINDOW;
        if is_over || told.warnings == 0 {
            let left_out = std::mem::take(&mut told.left_out);
            (told.since, told.warnings) = (at, 0);
            self.tell_left_out(at, id, left_out);
        }
        let told = self.connections.entry(id).or_default();
        if told.warnings < MAX_WARNINGS {
            told.warnings += 1;
            self.add(at, Some(id), event);
        } else {
            told.left_out += 1;
        }
    }

    /// Whether this is the first call for this connection. The `dsID` is warned of only then.
    pub fn is_first_ds_id(&mut self, id: ConnectionId) -> bool {
        !std::mem::replace(&mut self.connections.entry(id).or_default().ds_id, true)
    }

    /// When [`Self::handle_timeout`] has something to log.
    pub fn poll_timeout(&self) -> Option<Instant> {
        self.connections.values().filter_map(ConnectionWarnings::due).min()
    }

    /// Logs how many warnings were left out, for connections that have stopped sending.
    pub fn handle_timeout(&mut self, now: Instant) {
        let is_due = |told: &ConnectionWarnings| told.due().is_some_and(|due| due <= now);
        let due = self.connections.iter_mut().filter(|(_, told)| is_due(told));
        let left_out: Vec<_> = due
            .map(|(id, told)| {
                (
                    *id,
                    std::mem::replace(
                        told,
                        ConnectionWarnings { ds_id: told.ds_id, ..ConnectionWarnings::default() },
                    ),
                )
            })
            .collect();
        for (id, told) in left_out {
            self.tell_left_out(now, id, told.left_out);
        }
    }

    /// Forgets a connection that has ended.
    pub fn forget(&mut self, at: Instant, id: ConnectionId) {
        let left_out = self.connections.remove(&id).map_or(0, |told| told.left_out);
        self.tell_left_out(at, id, left_out);
    }

    fn tell_left_out(&mut self, at: Instant, id: ConnectionId, left_out: u64) {
        if left_out > 0 {
            self.add(at, Some(id), Event::WarningsLeftOut { count: left_out, told: MAX_WARNINGS });
        }
    }

    pub fn poll(&mut self) -> Option<LogEntry> {
        if self.dropped > 0 {
            let event = Event::EventsDropped { count: std::mem::take(&mut self.dropped) };
            let at = self.entries.front().map(|entry| entry.at).unwrap_or_default();
            return Some(LogEntry { at, connection: None, event });
        }
        self.entries.pop_front()
    }
}
