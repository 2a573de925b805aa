//! One-time links.

use super::UserChange;
use crate::core::account::{UserName, Wish};

/// For how long a one-time link is valid, in seconds: long enough to carry it to another screen.
const LINK_LASTS: u64 = 3_600;

/// How far the clock may be set back before a link that was just made counts as one of the future, in
/// seconds.
const CLOCK_TOLERANCE: u64 = 60;

/// A one-time link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Link {
    /// SHA-256 of its secret.
    pub hash: [u8; 32],
    /// Whose password it sets; `None` for the link that makes the first admin.
    pub user: Option<UserName>,
    /// When it was made, in seconds since 1970.
    pub made: u64,
}

impl Link {
    /// Whether it can be used at this time, in seconds since 1970.
    pub(super) fn is_valid(&self, now: u64) -> bool {
        now < self.made.saturating_add(LINK_LASTS) && self.made <= now.saturating_add(CLOCK_TOLERANCE)
    }

    /// Whether it is for this change.
    pub(super) fn allows(&self, change: &UserChange) -> bool {
        match (&self.user, &change.wish) {
            (None, Wish::FirstAdmin(_)) => true,
            (Some(user), Wish::Password(_)) => *user == change.name,
            _ => false,
        }
    }
}
