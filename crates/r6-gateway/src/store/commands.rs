//! Commands with an `Idempotency-Key` in the store: so a request that comes twice is sent once.
//!
//! A key is unique for its caller. It is written together with the intent of its command, before the command
//! leaves, and its answer together with the outcome.

use r6_api::gateway::AuditRecord;

/// For how long a key is kept, in seconds: a day, as for runs.
pub const KEPT: u64 = 24 * 3_600;

/// How many keys are kept, the newest ones: at 300 bytes each, they take 60 MB of the file.
pub const MAX_KEYS: u64 = 200_000;

/// For how long a key is kept for certain, in seconds, however many newer ones there are. A client that got
/// no answer asks again within minutes. More than [`MAX_KEYS`] in this time are refused.
pub const KEPT_AT_LEAST: u64 = 600;

/// A command that is to leave once.
#[derive(Clone, Debug)]
pub struct NewCommand {
    /// Who asks: a token or a user.
    pub caller: String,
    /// The `Idempotency-Key` of the request.
    pub key: String,
    /// SHA-256 of the request.
    pub hash: [u8; 32],
    /// Now, in seconds since 1970.
    pub now: u64,
    /// The intent, for the audit log.
    pub intent: AuditRecord,
}

/// A command in the store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeptCommand {
    /// The number of its intent in the audit log.
    pub intent: u64,
    /// SHA-256 of its request.
    pub hash: [u8; 32],
    /// The answer to the request; `None` if there was none yet.
    pub answer: Option<String>,
    /// Whether its outcome is in the audit log, or the log has lost its intent.
    pub ended: bool,
}

/// What became of a command that is to leave.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Noted {
    /// Its intent is in the audit log, with this number.
    New(u64),
    /// There is a command with this key of this caller. Nothing was written.
    Known(KeptCommand),
    /// There are [`MAX_KEYS`] of the last [`KEPT_AT_LEAST`] seconds. Nothing was written.
    Full,
}
