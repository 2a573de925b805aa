//! The watchdog that the first heartbreak arms (manual 7).

use std::time::Duration;

use r6_proto::time::Instant;

/// A deadline for heartbreaks. It is not armed until the first heartbreak; from then on each one has to come
/// in time.
#[derive(Clone, Copy, Debug)]
pub struct Watchdog {
    timeout: Duration,
    fed_at: Option<Instant>,
    bitten: bool,
}

impl Watchdog {
    pub(crate) fn new(timeout: Duration) -> Self {
        Self { timeout, fed_at: None, bitten: false }
    }

    /// Feeds the watchdog: a heartbreak came.
    pub(crate) fn feed(&mut self, now: Instant) {
        self.fed_at = Some(now);
        self.bitten = false;
    }

    /// Postpones the deadline by a time that was jumped over, because no heartbreak could come in it.
    pub(crate) fn postpone(&mut self, by: Duration) {
        self.fed_at = self.fed_at.map(|fed| fed + by);
    }

    /// When the next heartbreak is due; `None` while not armed, and after it has bitten.
    pub(crate) fn due(&self) -> Option<Instant> {
        self.fed_at.filter(|_| !self.bitten).map(|fed| fed + self.timeout)
    }

    /// Whether it bites now: once per missed heartbreak.
    pub(crate) fn bites(&mut self, now: Instant) -> bool {
        let bites = self.due().is_some_and(|due| due <= now);
        self.bitten |= bites;
        bites
    }

    /// Whether a heartbreak ever came.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        self.fed_at.is_some()
    }
}
