//! The ends of the audit log, and the signed heads that stand beside it.

use crate::core::chain::Hash;

/// The two ends of the audit log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ends {
    /// The number of the oldest entry; 0 without one.
    pub first: u64,
    /// The number of the newest entry; 0 without one.
    pub last: u64,
    /// The hash of the newest entry.
    pub hash: Hash,
    /// The oldest command without an outcome among the oldest
    /// [`BATCH`](crate::core::retention::BATCH) entries.
    pub open: Option<u64>,
}

/// The signed heads of the store, as text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Heads {
    /// The public key that checks them.
    pub key: Option<String>,
    /// The newest head that was put.
    pub end: Option<String>,
    /// The head of the last entry that was removed.
    pub cut: Option<String>,
}
