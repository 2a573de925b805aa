//! What a virtual controller tells about itself.

use std::collections::VecDeque;
use std::fmt;

use r6_proto::printable;
use r6_proto::time::Instant;

use crate::controller::ConnectionId;

/// How many lines wait until somebody reads them; beyond, the oldest go and are counted.
const MAX_LINES: usize = 256;

/// The longest line: a hostile peer's words are quoted, but not without end.
const MAX_LINE_CHARS: usize = 400;

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
