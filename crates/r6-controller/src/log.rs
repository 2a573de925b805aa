//! What a virtual controller tells about itself.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::time::Duration;

use r6_proto::printable;
use r6_proto::time::Instant;

use crate::controller::ConnectionId;

/// How many lines wait until somebody reads them; beyond, the oldest go and are counted.
const MAX_LINES: usize = 256;

/// The longest line: a hostile peer's words are quoted, but not without end.
const MAX_LINE_CHARS: usize = 400;

/// How many warnings of one connection are told within [`WARNING_WINDOW`]. A person who reads along sees no more; a peer that sends
/// rubbish as fast as it can would fill the disk of whoever keeps the log.
const MAX_WARNINGS: u32 = 32;

/// The time within which the warnings of a connection are counted.
const WARNING_WINDOW: Duration = Duration::from_secs(1);

/// How much a line matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// A change of state.
    Info,
    /// Something that a peer should do otherwise.
    Warning,
}

/// One line of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// When.
    pub at: Instant,
    /// On which connection; `None` for the machine itself.
    pub connection: Option<ConnectionId>,
    /// How much it matters.
    pub level: Level,
    /// What, on one line: words of a peer are escaped (`r6_proto::printable`).
    pub text: String,
}

impl fmt::Display for LogLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.connection {
            Some(id) => write!(f, "connection {}: {}", id.number(), self.text),
            None => f.write_str(&self.text),
        }
    }
}

#[derive(Debug, Default)]
pub(crate) struct Log {
    lines: VecDeque<LogLine>,
    dropped: u64,
    /// What was told of the connections that were warned of, until they end.
    connections: BTreeMap<ConnectionId, Told>,
}

/// What was told of one connection.
#[derive(Debug, Default)]
struct Told {
    /// When the present [`WARNING_WINDOW`] began.
    since: Instant,
    /// How many warnings were told in it.
    warnings: u32,
    /// How many more there were.
    left_out: u64,
    /// That it sends a wrong `dsID`.
    ds_id: bool,
}

impl Told {
    /// When it is told how many warnings were left out.
    fn due(&self) -> Option<Instant> {
        (self.left_out > 0).then(|| self.since + WARNING_WINDOW)
    }
}

impl Log {
    pub fn add(&mut self, at: Instant, connection: Option<ConnectionId>, level: Level, text: String) {
        if self.lines.len() >= MAX_LINES {
            self.lines.pop_front();
            self.dropped += 1;
        }
        let text = printable(&text).to_string();
        let text = if text.chars().nth(MAX_LINE_CHARS).is_some() {
            text.chars().take(MAX_LINE_CHARS).chain(['…']).collect()
        } else {
            text
        };
        self.lines.push_back(LogLine { at, connection, level, text });
    }

    /// Warns of what a connection sent; beyond [`MAX_WARNINGS`] it is only counted.
    pub fn warn(&mut self, at: Instant, id: ConnectionId, text: String) {
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
            self.add(at, Some(id), Level::Warning, text);
        } else {
            told.left_out += 1;
        }
    }

    /// Whether this is the first time that somebody asks whether to tell of this connection's `dsID`.
    pub fn is_first_ds_id(&mut self, id: ConnectionId) -> bool {
        !std::mem::replace(&mut self.connections.entry(id).or_default().ds_id, true)
    }

    /// When [`Self::handle_timeout`] has something to tell.
    pub fn poll_timeout(&self) -> Option<Instant> {
        self.connections.values().filter_map(Told::due).min()
    }

    /// Tells how many warnings were left out, of connections that send no more.
    pub fn handle_timeout(&mut self, now: Instant) {
        let is_due = |told: &Told| told.due().is_some_and(|due| due <= now);
        let due = self.connections.iter_mut().filter(|(_, told)| is_due(told));
        let left_out: Vec<_> = due
            .map(|(id, told)| (*id, std::mem::replace(told, Told { ds_id: told.ds_id, ..Told::default() })))
            .collect();
        for (id, told) in left_out {
            self.tell_left_out(now, id, told.left_out);
        }
    }

    /// A connection has ended.
    pub fn forget(&mut self, at: Instant, id: ConnectionId) {
        let left_out = self.connections.remove(&id).map_or(0, |told| told.left_out);
        self.tell_left_out(at, id, left_out);
    }

    fn tell_left_out(&mut self, at: Instant, id: ConnectionId, left_out: u64) {
        if left_out > 0 {
            let text =
                format!("{left_out} more warnings were left out: {MAX_WARNINGS} within a second are told");
            self.add(at, Some(id), Level::Warning, text);
        }
    }

    pub fn poll(&mut self) -> Option<LogLine> {
        if self.dropped > 0 {
            let text = format!("{} lines were dropped: nobody read them in time", self.dropped);
            self.dropped = 0;
            let at = self.lines.front().map(|line| line.at).unwrap_or_default();
            return Some(LogLine { at, connection: None, level: Level::Warning, text });
        }
        self.lines.pop_front()
    }
}
