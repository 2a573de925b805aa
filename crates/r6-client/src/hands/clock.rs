//! Converts the runtime's clock to the time type of the pure state machine.

use std::time::Duration;

use r6_proto::time::Instant;

/// Maps the runtime's clock to nanoseconds since this clock was created.
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

    /// Converts a time of the runtime. Times before the start of this clock become the origin.
    pub fn of(self, at: tokio::time::Instant) -> Instant {
        Instant::ORIGIN + at.saturating_duration_since(self.0)
    }

    /// Converts a deadline to the runtime's time. `None` becomes a time far in the future.
    pub fn at(self, deadline: Option<Instant>) -> tokio::time::Instant {
        const FAR: Duration = Duration::from_secs(86_400);
        match deadline {
            Some(deadline) => self.0 + deadline.since(Instant::ORIGIN),
            None => tokio::time::Instant::now() + FAR,
        }
    }
}
