//! How good the connection is, measured by the replies to the client's own requests.

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use r6_proto::time::Instant;

use crate::settings::Liveness;

/// Replies kept for the latencies: a minute of polling at 15 Hz. Each is kept, so that the quantiles are
/// exact; a histogram of two digits' precision would take as much room.
const KEPT_REPLIES: usize = 1024;

/// Older replies do not count.
const WINDOW: Duration = Duration::from_secs(60);

/// How good the connection is: [`crate::Robot::link_quality`].
///
/// All counts are those of the handle and its clones since [`crate::Robot::connect`], over all connections.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkQuality {
    /// Whether the controller is alive, judged by its replies.
    pub state: LinkState,
    /// How long replies took; `None` if there was none in the last minute.
    pub latency: Option<Latency>,
    /// Requests that wait, or waited, for a reply.
    pub requests: u64,
    /// Replies to them.
    pub replies: u64,
    /// Requests that got no reply in time.
    pub timeouts: u64,
    /// Requests whose connection ended before their reply.
    pub lost: u64,
    /// Frames that answered nothing: late, repeated, or another client's.
    pub strays: u64,
    /// Bytes that were no frame, and frames that were no JSON.
    pub garbled: u64,
    /// How often the client reconnected.
    pub reconnects: u64,
    /// How long ago the last reply came; `None` if there never was one.
    pub last_reply: Option<Duration>,
    /// How long the oldest request has waited without any reply arriving, or how long the connection is gone.
    pub silent_for: Option<Duration>,
}

/// Whether the controller is alive. Only a reply to the client's own request shows that: an open socket
/// proves nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LinkState {
    /// A reply came within [`Liveness::suspect_after`].
    Alive,
    /// Nothing was asked for so long that it is unknown.
    Unknown,
    /// The connection is gone, or something was asked and no reply came for [`Liveness::suspect_after`].
    Suspect,
    /// The same for [`Liveness::dead_after`].
    Dead,
}

/// How long the last replies took: at most 1 024 of the last minute, exact to the nanosecond.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Latency {
    /// How many.
    pub count: usize,
    /// Half of them took at most this long.
    pub p50: Duration,
    /// Nine of ten took at most this long.
    pub p90: Duration,
    /// 99 of 100 took at most this long.
    pub p99: Duration,
    /// The longest.
    pub max: Duration,
}

impl Latency {
    fn of(mut took: Vec<Duration>) -> Option<Self> {
        took.sort_unstable();
        // The smallest value that this percentage of the replies does not exceed.
        let rank = |percent: usize| took.get((took.len() * percent).div_ceil(100).checked_sub(1)?).copied();
        Some(Self { count: took.len(), p50: rank(50)?, p90: rank(90)?, p99: rank(99)?, max: rank(100)? })
    }
}

/// Counts what happens on the connections of one handle.
#[derive(Debug, Default)]
pub(crate) struct Meter {
    took: VecDeque<(Instant, Duration)>,
    pub counts: Counts,
    last_reply: Option<Instant>,
    /// Since when a request has waited without any reply, or since when there has been no connection.
    silent_since: Option<Instant>,
    disconnected: bool,
}

/// As the fields of [`LinkQuality`].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Counts {
    requests: u64,
    replies: u64,
    pub timeouts: u64,
    pub lost: u64,
    pub strays: u64,
    pub garbled: u64,
    reconnects: u64,
}

impl Meter {
    /// A request was handed to the connection.
    pub fn asked(&mut self, now: Instant) {
        self.counts.requests += 1;
        self.silent_since.get_or_insert(now);
    }

    /// A reply came; `waiting`: whether other requests still wait for theirs.
    pub fn replied(&mut self, now: Instant, after: Duration, waiting: bool) {
        self.counts.replies += 1;
        self.last_reply = Some(now);
        self.silent_since = waiting.then_some(now);
        if self.took.len() == KEPT_REPLIES {
            self.took.pop_front();
        }
        self.took.push_back((now, after));
    }

    /// When the last reply came.
    pub fn last_reply(&self) -> Option<Instant> {
        self.last_reply
    }

    /// The connection ended.
    pub fn disconnected(&mut self, now: Instant) {
        self.disconnected = true;
        self.silent_since.get_or_insert(now);
    }

    pub fn reconnected(&mut self) {
        self.disconnected = false;
        self.counts.reconnects += 1;
    }

    pub fn state(&self, now: Instant, liveness: Liveness) -> LinkState {
        let silent_for = self.silent_since.map(|since| now.since(since));
        match silent_for {
            Some(silent) if silent > liveness.dead_after => LinkState::Dead,
            Some(silent) if silent > liveness.suspect_after || self.disconnected => LinkState::Suspect,
            Some(_) | None => match self.last_reply {
                Some(at) if now.since(at) <= liveness.suspect_after => LinkState::Alive,
                Some(_) | None => LinkState::Unknown,
            },
        }
    }

    /// All of it at this time.
    pub fn quality(&self, now: Instant, liveness: Liveness) -> LinkQuality {
        let since = |at: Instant| now.since(at);
        let recent = self.took.iter().filter(|(at, _)| since(*at) <= WINDOW).map(|(_, took)| *took);
        let Counts { requests, replies, timeouts, lost, strays, garbled, reconnects } = self.counts;
        LinkQuality {
            state: self.state(now, liveness),
            latency: Latency::of(recent.collect()),
            requests,
            replies,
            timeouts,
            lost,
            strays,
            garbled,
            reconnects,
            last_reply: self.last_reply.map(since),
            silent_for: self.silent_since.map(since),
        }
    }
}

impl fmt::Display for LinkState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Alive => "alive",
            Self::Unknown => "unknown",
            Self::Suspect => "suspect",
            Self::Dead => "dead",
        })
    }
}

impl fmt::Display for LinkQuality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |took: Duration| took.as_secs_f64() * 1e3;
        write!(f, "link {}", self.state)?;
        if let Some(silent) = self.silent_for {
            write!(f, ", silent for {:.1} s", silent.as_secs_f64())?;
        }
        if let Some(latency) = self.latency {
            let (p50, p99, max) = (ms(latency.p50), ms(latency.p99), ms(latency.max));
            write!(f, ", replies within {p50:.1} ms (p50), {p99:.1} ms (p99), {max:.1} ms at most")?;
        }
        write!(
            f,
            ", {} requests, {} timed out, {} lost, {} strays, {} garbled, {} reconnects",
            self.requests, self.timeouts, self.lost, self.strays, self.garbled, self.reconnects
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);
    const LIVENESS: Liveness =
        Liveness { suspect_after: Duration::from_secs(1), dead_after: Duration::from_secs(5) };

    #[test]
    fn quantiles_are_exact() {
        let mut meter = Meter::default();
        let now = Instant::ORIGIN;
        assert_eq!(meter.quality(now, LIVENESS).latency, None);
        // In no order: 1 to 100 ms.
        for ms in (1..=100).map(|n| n * 37 % 101) {
            meter.replied(now, MS * ms, false);
        }
        let latency = meter.quality(now, LIVENESS).latency.unwrap();
        let found = (latency.count, latency.p50, latency.p90, latency.p99, latency.max);
        assert_eq!(found, (100, MS * 50, MS * 90, MS * 99, MS * 100));
    }

    #[test]
    fn old_replies_do_not_count_and_few_are_kept() {
        let mut meter = Meter::default();
        let begun = Instant::ORIGIN + MS;
        meter.replied(begun, MS * 900, false);
        meter.replied(begun + WINDOW, MS * 20, false);
        let at = |now| meter.quality(now, LIVENESS).latency.unwrap();
        assert_eq!(at(begun + WINDOW).max, MS * 900);
        assert_eq!((at(begun + WINDOW + MS).max, at(begun + WINDOW + MS).count), (MS * 20, 1));
        for _ in 0..KEPT_REPLIES {
            meter.replied(begun, MS, false);
        }
        assert_eq!((meter.took.len(), meter.counts.replies), (KEPT_REPLIES, KEPT_REPLIES as u64 + 2));
    }

    #[test]
    fn only_replies_prove_life() {
        let mut meter = Meter::default();
        let begun = Instant::ORIGIN + MS;
        let state = |meter: &Meter, ms: u32| meter.state(begun + MS * ms, LIVENESS);
        assert_eq!(state(&meter, 0), LinkState::Unknown, "an open socket proves nothing");
        meter.asked(begun);
        meter.asked(begun);
        assert_eq!(state(&meter, 1000), LinkState::Unknown);
        assert_eq!(state(&meter, 1001), LinkState::Suspect);
        assert_eq!(state(&meter, 5001), LinkState::Dead);
        meter.replied(begun + MS * 5100, MS, true);
        assert_eq!(state(&meter, 5200), LinkState::Alive);
        // The second one still waits: its silence counts from the last sign of life.
        assert_eq!(state(&meter, 6101), LinkState::Suspect);
        meter.replied(begun + MS * 6200, MS, false);
        assert_eq!(state(&meter, 6300), LinkState::Alive);
        assert_eq!(state(&meter, 60_000), LinkState::Unknown, "nothing was asked");
        // A timeout is not a sign of life.
        meter.asked(begun + MS * 60_000);
        meter.counts.timeouts += 1;
        assert_eq!(state(&meter, 62_000), LinkState::Suspect);
    }

    #[test]
    fn a_lost_connection_is_suspect_at_once_and_dead_in_time() {
        let mut meter = Meter::default();
        let begun = Instant::ORIGIN + MS;
        meter.replied(begun, MS, false);
        meter.disconnected(begun);
        assert_eq!(meter.state(begun, LIVENESS), LinkState::Suspect);
        assert_eq!(meter.state(begun + MS * 5001, LIVENESS), LinkState::Dead);
        meter.reconnected();
        assert_eq!(meter.state(begun + MS * 5001, LIVENESS), LinkState::Dead, "no answer came yet");
        meter.replied(begun + MS * 5010, MS, false);
        assert_eq!(meter.state(begun + MS * 5010, LIVENESS), LinkState::Alive);
    }
}
