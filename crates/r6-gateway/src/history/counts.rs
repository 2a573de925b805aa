//! What became of samples, counted for `/metrics`.

use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};

use crate::core::history::sample::Micros;

/// The samples of one robot, since it was added or the gateway started.
#[derive(Debug, Default)]
pub struct RobotCounts {
    kept: AtomicU64,
    lost: AtomicU64,
    events: AtomicU64,
    events_lost: AtomicU64,
    kept_until: AtomicI64,
    read_until: AtomicI64,
}

impl RobotCounts {
    /// Samples were taken in.
    pub(super) fn keep(&self, count: usize) {
        self.kept.fetch_add(count as u64, Ordering::Relaxed);
    }

    /// Samples were lost.
    pub fn lose(&self, count: u64) {
        self.lost.fetch_add(count, Ordering::Relaxed);
    }

    /// Events were taken in.
    pub(super) fn keep_events(&self, count: usize) {
        self.events.fetch_add(count as u64, Ordering::Relaxed);
    }

    /// Events were lost.
    pub fn lose_events(&self, count: usize) {
        self.events_lost.fetch_add(count as u64, Ordering::Relaxed);
    }

    /// How many events were kept, and how many were lost.
    pub fn events(&self) -> (u64, u64) {
        (self.events.load(Ordering::Relaxed), self.events_lost.load(Ordering::Relaxed))
    }

    /// Everything that was read until this time is on the disk. It may be earlier than before: the clock may
    /// be set back.
    pub(super) fn keep_until(&self, time: Micros) {
        self.kept_until.store(time.0, Ordering::Relaxed);
    }

    /// A value was read that was asked for at this time.
    pub fn read(&self, time: Micros) {
        self.read_until.store(time.0, Ordering::Relaxed);
    }

    /// How many µs of what was read are not on the disk yet.
    pub fn lag(&self) -> i64 {
        let kept = self.kept_until.load(Ordering::Relaxed);
        self.read_until.load(Ordering::Relaxed).saturating_sub(kept).max(0)
    }

    /// How many samples were kept, and how many were lost.
    pub fn now(&self) -> (u64, u64) {
        (self.kept.load(Ordering::Relaxed), self.lost.load(Ordering::Relaxed))
    }

    /// Until when what was read survives the end of the process; `None` if nothing was written yet.
    pub fn kept_until(&self) -> Option<Micros> {
        Some(Micros(self.kept_until.load(Ordering::Relaxed))).filter(|time| time.0 > 0)
    }
}

/// The history of all robots.
#[derive(Debug, Default)]
pub struct HistoryCounts {
    /// Whether the disk does not take samples.
    pub paused: AtomicBool,
    /// How much all files take.
    pub bytes: AtomicU64,
    /// The day of the oldest file, in days since 1970; 0 without a file.
    pub oldest_day: AtomicI64,
    /// How often the clock of the system was set.
    pub clock_steps: AtomicU64,
    /// How many rows of tails could not be read after a start.
    pub unreadable: AtomicU64,
    /// How many files of values were removed to keep the limits.
    pub removed: AtomicU64,
    /// How many of these had values of which no averages were computed.
    pub removed_unaveraged: AtomicU64,
    /// How many files of averages were removed to keep the limits.
    pub removed_averages: AtomicU64,
    /// How much all files of averages take; it is in `bytes` too.
    pub average_bytes: AtomicU64,
    /// Of how many days averages were computed.
    pub averaged_days: AtomicU64,
    /// Days whose averages were given up.
    pub given_up_days: AtomicU64,
}
