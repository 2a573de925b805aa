//! A gateway that tells of its robots.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use r6_proto::time::Instant;

/// A gateway that tells of its robots, over one stream.
#[derive(Debug)]
pub struct Teller {
    number: u64,
    /// Until when nothing had changed that it did not tell.
    confirmed: Mutex<Instant>,
    /// Since when something that it told waits here, before readers get it.
    waits_since: Mutex<Option<Instant>>,
}

impl Teller {
    /// The gateway with this number, which has confirmed nothing yet.
    #[must_use]
    pub fn new(number: u64) -> Self {
        Self { number, confirmed: Mutex::new(Instant::ORIGIN), waits_since: Mutex::default() }
    }

    /// The number of the gateway.
    #[must_use]
    pub fn number(&self) -> u64 {
        self.number
    }

    /// It says that until then nothing had changed that it did not tell.
    pub fn confirm(&self, until: Instant) {
        let mut confirmed = self.confirmed.lock().unwrap_or_else(PoisonError::into_inner);
        *confirmed = (*confirmed).max(until);
    }

    pub(super) fn confirmed(&self) -> Instant {
        *self.confirmed.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Since when something that it told waits here, before readers get it; `None`: nothing does.
    pub fn hold_back(&self, since: Option<Instant>) {
        *self.waits_since.lock().unwrap_or_else(PoisonError::into_inner) = since;
    }

    /// How far its readers here may be behind it.
    pub(super) fn behind(&self, now: Instant, begun: Instant) -> Duration {
        let waits = *self.waits_since.lock().unwrap_or_else(PoisonError::into_inner);
        let waits = waits.map_or(Duration::ZERO, |since| now.since(since));
        now.since(self.confirmed().max(begun)).max(waits)
    }
}
