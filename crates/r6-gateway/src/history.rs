//! The history of values: what is kept, for how long, and the thread that writes it.
//!
//! `fleet/record.rs` decides which readings of a robot are kept, and hands them to the [`Recorder`]. Its
//! thread puts them into the [`journal`], and writes that to the disk four times a second. [`query`] reads.
//!
//! The disk of the history is used by this thread and by queries only. If it is slow, full or broken, samples
//! are lost, and nothing else waits.

mod counts;
pub mod journal;
pub mod query;
mod recorder;

use std::collections::BTreeMap;

use r6_proto::Address;

pub use counts::{HistoryCounts, RobotCounts};
pub use recorder::{Batch, NotKept, Recorder};

/// The least that all files of the history may take: parts of an eighth of it are still large enough.
pub const LEAST_MAX_BYTES: u64 = 64 * 1024 * 1024;

/// What is kept of the values of all robots, and for how long.
#[derive(Clone, Debug, PartialEq)]
pub struct HistorySettings {
    /// Whether values are kept.
    pub on: bool,
    /// For how many days, today included: 1 at least.
    pub keep_days: u32,
    /// For how many days averages of minutes are kept, today included: 1 at least.
    pub keep_minutes_days: u32,
    /// For how many days averages of hours are kept, today included: at least as many as those of minutes.
    pub keep_hours_days: u32,
    /// How much all files of the history take, in bytes. The oldest values go first.
    pub max_bytes: u64,
    /// By how much a number has to differ to be kept. Others have [`Self::usual_deadband`].
    pub deadbands: BTreeMap<Address, f64>,
    /// How much memory samples take before they are written as chunks, in bytes.
    pub memory: usize,
    /// How much room has to be left on the disk, in bytes: the audit log needs it.
    pub min_free: u64,
}

impl Default for HistorySettings {
    /// 30 days, minutes for 90 days, hours for five years, 10 GiB.
    fn default() -> Self {
        Self {
            on: true,
            keep_days: 30,
            keep_minutes_days: 90,
            keep_hours_days: 1830,
            max_bytes: 10 * 1024 * 1024 * 1024,
            deadbands: BTreeMap::new(),
            memory: 64 * 1024 * 1024,
            min_free: 256 * 1024 * 1024,
        }
    }
}

impl HistorySettings {
    /// No values are kept.
    #[must_use]
    pub fn off() -> Self {
        Self { on: false, ..Self::default() }
    }

    /// Axes and poses are kept if they differ by more than 0.001 mm or degrees: less is noise of the
    /// encoders. Everything else is kept if it differs at all.
    #[must_use]
    pub fn usual_deadband(address: Address) -> f64 {
        match address {
            Address::Axis(_) | Address::World(_) => 0.001,
            _ => 0.0,
        }
    }

    /// The deadband of an address.
    #[must_use]
    pub fn deadband(&self, address: Address) -> f64 {
        self.deadbands.get(&address).copied().unwrap_or_else(|| Self::usual_deadband(address))
    }
}
