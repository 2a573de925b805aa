//! Runs of programs in the store, each with the `Idempotency-Key` of the request for it.
//!
//! A key is unique for its caller. It is kept for [`KEPT`] and longer while the run is under way or a stop is
//! owed for it. So a request that comes twice never runs a program twice.

use r6_api::gateway::{AuditRecord, Deed, Run};

use super::{Author, StoreError};
use crate::core::name::RobotName;

/// For how long a run and its key are kept, in seconds: a day.
pub const KEPT: u64 = 24 * 3_600;

/// The most runs that are kept: at 1 KB each, the file of the audit log has to stay small enough to be
/// copied. A hall can begin one a second for a day.
pub const MAX_RUNS: usize = 100_000;

/// The most runs of one robot that are kept, so that one script leaves room for all other robots: one every
/// five seconds for a day.
pub const MAX_RUNS_OF_ONE: usize = 20_000;

/// A run that is to begin.
#[derive(Clone, Debug)]
pub struct NewRun {
    /// Who asks: a token or a user.
    pub caller: String,
    /// The `Idempotency-Key` of the request.
    pub key: String,
    /// SHA-256 of the request.
    pub hash: [u8; 32],
    /// The robot.
    pub robot: RobotName,
    /// Now, in seconds since 1970.
    pub now: u64,
    /// The run. Its number is not known yet.
    pub run: Run,
    /// Who runs it, for the audit log.
    pub by: Author,
}

impl NewRun {
    /// The record about it.
    pub(super) fn record(&self, run: u64) -> AuditRecord {
        let Run { program, version, sha256, repeat, steps, lease, .. } = self.run.clone();
        let deed = Deed::RunIntent { run, program, version, sha256, repeat, steps, lease };
        AuditRecord { robot: Some(self.robot.to_string()), ..self.by.record(deed) }
    }
}

/// A run in the store.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptRun {
    /// SHA-256 of its request.
    pub hash: [u8; 32],
    /// How it was when it was written: at its begin or at its end.
    pub run: Run,
    /// The answer to the request; `None` if there was none yet.
    pub answer: Option<String>,
    /// Whether it has ended.
    pub ended: bool,
}

/// What became of a run that was to begin.
#[derive(Clone, Debug, PartialEq)]
pub enum Begun {
    /// It has this number, and its intent is in the audit log.
    New(u64),
    /// There is a run with this key of this caller. Nothing was written.
    Known(Box<KeptRun>),
    /// There are [`MAX_RUNS`], or [`MAX_RUNS_OF_ONE`] of this robot. Nothing was written.
    Full,
}

/// A run as text.
pub(super) fn to_text(run: &Run) -> Result<String, StoreError> {
    serde_json::to_string(run).map_err(|error| StoreError::Unreadable(error.to_string()))
}

/// The run of a text.
pub(super) fn of_text(number: u64, text: &str) -> Result<Run, StoreError> {
    serde_json::from_str(text).map_err(|error| StoreError::Unreadable(format!("run {number}: {error}")))
}
