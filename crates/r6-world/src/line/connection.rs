//! One connection of a client: sent frames and received bytes.

use std::collections::BTreeSet;
use std::time::Duration;

use serde_json::Value;

use crate::wire::whole_frames;

/// How long received bytes are kept. No check needs older bytes.
const REMEMBERED: Duration = Duration::from_secs(70);

/// The maximum number of kept bytes. Some replies are 200 000 bytes too long.
const MOST_REMEMBERED: usize = 16 << 20;

/// One connection.
#[derive(Debug, Default)]
pub(super) struct Connection {
    /// Sent bytes that do not yet form a complete frame.
    pub begun: Vec<u8>,
    pub sent: Vec<Sent>,
    pub came: Vec<u8>,
    /// How many bytes came before those in `came`.
    pub forgotten: usize,
    /// For each time of arrival, the position of its first byte.
    pub marks: Vec<(Duration, usize)>,
    /// Replies that already answered a command, by the position of their end.
    pub used: BTreeSet<usize>,
    /// Whether the client asked for the controller's identity.
    pub asked_who: bool,
    /// The robot at its other end.
    pub robot: usize,
    /// When it was made.
    pub made: Duration,
    /// When the last heartbeat left.
    pub beaten: Duration,
    /// When its program saw it end, or ended it.
    pub ended: Option<Duration>,
}

/// A frame that left.
#[derive(Clone, Debug)]
pub(super) struct Sent {
    pub at: Duration,
    pub frame: Value,
}

impl Connection {
    /// Drops old bytes, in large pieces.
    pub fn forget(&mut self, at: Duration) {
        let is_old = self.marks.first().is_some_and(|(first, _)| *first + REMEMBERED * 2 < at);
        if !is_old && self.came.len() <= MOST_REMEMBERED {
            return;
        }
        let keep = self.marks.partition_point(|(mark, _)| *mark + REMEMBERED < at).max(self.marks.len() / 2);
        let Some((_, begin)) = self.marks.get(keep).copied() else { return };
        self.came.drain(..begin - self.forgotten);
        self.marks.drain(..keep);
        self.forgotten = begin;
    }

    /// The complete frames that arrived from then on: the time of the last byte, the position of the end, and
    /// the text.
    pub fn since(&self, from: Duration) -> Vec<(Duration, usize, String)> {
        let Some((_, begin)) = self.marks.iter().find(|(at, _)| *at >= from) else { return Vec::new() };
        let bytes = self.came.get(begin - self.forgotten..).unwrap_or_default();
        let frames = whole_frames(bytes).map(|(first, end)| {
            let mark = self.marks.partition_point(|(_, start)| *start < begin + end);
            let at = self.marks.get(mark.saturating_sub(1)).map_or(Duration::ZERO, |(at, _)| *at);
            (at, begin + end, String::from_utf8_lossy(&bytes[first..end]).into_owned())
        });
        frames.collect()
    }
}
