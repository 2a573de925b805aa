//! What happened at one robot, counted for `/metrics`.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use r6_api::gateway::{CommandOutcome, RunState};

use crate::core::raw::session::Cause;
use crate::history::RobotCounts;

/// How runs end, with the words of the contract.
const RUN_ENDS: [(RunState, &str); 5] = [
    (RunState::Done, "done"),
    (RunState::Stopped, "stopped"),
    (RunState::Refused, "refused"),
    (RunState::Failed, "failed"),
    (RunState::Unknown, "unknown"),
];

/// The counts of one robot, since it was added or the gateway started.
#[derive(Debug, Default)]
pub struct Counts {
    accepted: AtomicU64,
    refused: AtomicU64,
    not_sent: AtomicU64,
    unknown: AtomicU64,
    confirmed: AtomicU64,
    not_confirmed: AtomicU64,
    /// Runs of programs that ended, in the order of [`RUN_ENDS`].
    runs: [AtomicU64; RUN_ENDS.len()],
    events_skipped: AtomicU64,
    /// The clients of the raw port.
    pub raw: RawCounts,
    /// The samples of its values.
    pub history: Arc<RobotCounts>,
}

impl Counts {
    /// An event was not told live: too many came.
    pub fn skip_event(&self) {
        self.events_skipped.fetch_add(1, Ordering::Relaxed);
    }

    /// How many events were not told live.
    pub fn events_skipped(&self) -> u64 {
        self.events_skipped.load(Ordering::Relaxed)
    }
}

/// The counts of the clients of one robot's raw port.
#[derive(Debug, Default)]
pub struct RawCounts {
    clients: AtomicU64,
    refused: AtomicU64,
    closed: [AtomicU64; Cause::ALL.len()],
}

impl RawCounts {
    /// A client came. It is there until the returned value is dropped.
    pub fn client(&self) -> Present<'_> {
        self.clients.fetch_add(1, Ordering::Relaxed);
        Present(self)
    }

    /// A request was refused.
    pub fn refused(&self) {
        self.refused.fetch_add(1, Ordering::Relaxed);
    }

    /// A client was closed, or not let in.
    pub fn closed(&self, cause: Cause) {
        if let Some(count) = self.closed.get(cause as usize) {
            count.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// How many clients are there now, and how many requests were refused.
    pub fn now(&self) -> (u64, u64) {
        (self.clients.load(Ordering::Relaxed), self.refused.load(Ordering::Relaxed))
    }

    /// The clients that were closed, by the word of the cause.
    pub fn by_cause(&self) -> impl Iterator<Item = (&'static str, u64)> {
        Cause::ALL
            .iter()
            .zip(&self.closed)
            .map(|(cause, count)| (cause.word(), count.load(Ordering::Relaxed)))
    }
}

/// A client of a raw port.
#[derive(Debug)]
#[must_use = "it is gone when this is dropped"]
pub struct Present<'c>(&'c RawCounts);

impl Drop for Present<'_> {
    fn drop(&mut self) {
        self.0.clients.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Counts {
    /// Counts a command.
    pub fn count_command(&self, outcome: CommandOutcome) {
        let count = match outcome {
            CommandOutcome::Accepted => &self.accepted,
            CommandOutcome::Refused => &self.refused,
            CommandOutcome::NotSent => &self.not_sent,
            CommandOutcome::Unknown => &self.unknown,
        };
        count.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts a run that ended.
    pub fn count_run(&self, state: RunState) {
        let at = RUN_ENDS.iter().position(|(end, _)| *end == state);
        if let Some(count) = at.and_then(|at| self.runs.get(at)) {
            count.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// The runs that ended, by the word of their state.
    pub fn runs(&self) -> impl Iterator<Item = (&'static str, u64)> {
        RUN_ENDS.iter().zip(&self.runs).map(|((_, word), count)| (*word, count.load(Ordering::Relaxed)))
    }

    /// Counts a stop.
    pub fn count_stop(&self, confirmed: bool) {
        let count = if confirmed { &self.confirmed } else { &self.not_confirmed };
        count.fetch_add(1, Ordering::Relaxed);
    }

    /// The commands that stand in the audit log, by the word of their outcome.
    pub fn commands(&self) -> [(&'static str, u64); 4] {
        let all = [
            (CommandOutcome::Accepted, &self.accepted),
            (CommandOutcome::Refused, &self.refused),
            (CommandOutcome::NotSent, &self.not_sent),
            (CommandOutcome::Unknown, &self.unknown),
        ];
        all.map(|(outcome, count)| (outcome.word(), count.load(Ordering::Relaxed)))
    }

    /// The stops, by whether they were confirmed.
    pub fn stops(&self) -> [(bool, u64); 2] {
        let all = [(true, &self.confirmed), (false, &self.not_confirmed)];
        all.map(|(confirmed, count)| (confirmed, count.load(Ordering::Relaxed)))
    }
}
