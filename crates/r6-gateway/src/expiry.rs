//! When a token ends.

use std::fmt;
use std::time::Duration;

use crate::clock;

/// When a token ends: seconds since 1970 by the clock of the system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Expiry(pub u64);

impl Expiry {
    /// So long after now.
    #[must_use]
    pub fn after(time: Duration) -> Self {
        Self(clock::seconds().saturating_add(time.as_secs()))
    }

    /// Whether it is over.
    #[must_use]
    pub fn is_over(self) -> bool {
        self.left().is_zero()
    }

    /// How long it is until then, to the second.
    #[must_use]
    pub fn left(self) -> Duration {
        Duration::from_secs(self.0.saturating_sub(clock::seconds()))
    }
}

/// RFC 3339, UTC, microseconds.
impl fmt::Display for Expiry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&clock::text_of_seconds(self.0))
    }
}
