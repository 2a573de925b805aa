//! The runtime's clock, seen as the pure parts see time.

use std::time::Duration;

use r6_proto::time::Instant;

/// Maps the runtime's clock to nanoseconds since this was made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock(tokio::time::Instant);

impl Clock {
    /// A clock that begins now.
    pub fn start() -> Self {
        Self(tokio::time::Instant::now())
    }

    pub fn now(self) -> Instant {
        self.of(tokio::time::Instant::now())
    }

    /// A point of the runtime's time; the origin for all that was before.
    pub fn of(self, at: tokio::time::Instant) -> Instant {
        Instant::ORIGIN + at.saturating_duration_since(self.0)
    }

    /// A deadline in the runtime's time; without one, far away.
    pub fn at(self, deadline: Option<Instant>) -> tokio::time::Instant {
        const FAR: Duration = Duration::from_secs(86_400);
        match deadline {
            Some(deadline) => self.0 + deadline.since(Instant::ORIGIN),
            None => tokio::time::Instant::now() + FAR,
        }
    }
}
