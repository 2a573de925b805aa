//! What one gateway told of a robot.

use std::sync::Arc;
use std::time::Duration;

use r6_api::gateway::{LiveChange, PollGroup, RobotLink, RobotState, RobotSummary, Signal, SignalQuality};
use r6_proto::time::Instant;

use super::teller::Teller;
use crate::clock;
use crate::core::owner::CLOSE;
use crate::fleet::group::periods;

/// For how long a value that its owner told as fresh is still told as fresh if the owner says nothing more of
/// it, beyond the greatest age of a fresh value. An owner that is silent for longer may have lost the robot.
pub const HEARD: Duration = CLOSE;

/// What one gateway told of a robot.
#[derive(Clone, Debug)]
pub struct Copied {
    /// `None`: it is not heard of.
    pub teller: Option<Arc<Teller>>,
    pub summary: RobotSummary,
    /// When the values came first.
    pub begun: Instant,
    /// When the summary came.
    pub summed_at: Instant,
    /// When a stop was told that holds. A list that was asked for before may not know of it.
    pub stopped_at: Option<Instant>,
    pub period_ms: u64,
    /// What is read with other periods.
    pub groups: Vec<PollGroup>,
    /// Of each value, the greatest age that its owner tells it with as fresh.
    fresh_for: Vec<Duration>,
    /// The number of the last change, as its owner counts.
    pub there: u64,
    /// The values, and when each came.
    pub rows: Vec<(Signal, Instant)>,
}

impl Copied {
    /// `suspect_after`: for how long after its period its owner tells a value as fresh.
    pub fn new(teller: Option<Arc<Teller>>, state: RobotState, suspect_after: Duration) -> Self {
        let now = clock::now();
        let RobotState { summary, period_ms, groups, number, signals, .. } = state;
        let addresses = signals.iter().map(|signal| signal.address.as_str());
        let fresh_for =
            periods(addresses, period_ms, &groups).into_iter().map(|period| period + suspect_after);
        let fresh_for = fresh_for.collect();
        let rows = signals.into_iter().map(|signal| (signal, now)).collect();
        let stopped_at = None;
        Self {
            teller,
            summary,
            begun: now,
            summed_at: now,
            stopped_at,
            period_ms,
            groups,
            fresh_for,
            there: number,
            rows,
        }
    }

    /// The same, once it is not heard of any more: nothing is fresh.
    pub fn lost(mut self) -> Self {
        self.silence();
        for (signal, _) in &mut self.rows {
            if signal.quality == SignalQuality::Fresh {
                signal.quality = SignalQuality::Stale;
            }
        }
        self
    }

    /// No owner tells of it.
    pub fn silence(&mut self) {
        self.teller = None;
        self.summary.link = RobotLink::Down;
        self.summary.stops_under_way = 0;
        self.summary.global_speed = None;
    }

    /// Its owner is not its owner any more, so the lease is over.
    pub fn ended(mut self) -> Self {
        self.summary.lease = None;
        self.lost()
    }

    /// Takes in what changed. Returns the places; `None`: something is missing in between.
    pub fn change(&mut self, change: LiveChange) -> Option<Vec<usize>> {
        if self.there != change.after {
            return None;
        }
        let now = clock::now();
        let mut places = Vec::new();
        for signal in change.signals {
            let place = self.rows.iter().position(|(known, _)| known.address == signal.address)?;
            *self.rows.get_mut(place)? = (signal, now);
            places.push(place);
        }
        self.there = change.number;
        Some(places)
    }

    /// A value as it is told now.
    pub fn signal(&self, place: usize, now: Instant) -> Option<Signal> {
        let (signal, told_at) = self.rows.get(place)?;
        let mut signal = signal.clone();
        let Some(age) = signal.age_ms else { return Some(signal) };
        let mut age = age.saturating_add(millis(now.since(*told_at)));
        if let (SignalQuality::Fresh, Some(teller)) = (signal.quality, &self.teller) {
            let confirmed = teller.confirmed();
            let fresh_for = self.fresh_for.get(place).copied().unwrap_or_default();
            if confirmed >= *told_at {
                // Its owner reads it again and again, and tells of it only if it changes or grows old.
                age = age.min(millis(fresh_for + now.since(confirmed)));
            }
            if age > millis(fresh_for + HEARD) {
                signal.quality = SignalQuality::Stale;
            }
        }
        signal.age_ms = Some(age);
        Some(signal)
    }

    pub fn signals(&self, now: Instant) -> Vec<Signal> {
        (0..self.rows.len()).filter_map(|place| self.signal(place, now)).collect()
    }
}

pub fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}
