//! What happened at one robot, counted for `/metrics`.

use std::sync::atomic::{AtomicU64, Ordering};

use r6_api::gateway::CommandOutcome;

/// The counts of one robot, since it was added or the gateway started.
#[derive(Debug, Default)]
pub struct Counts {
    accepted: AtomicU64,
    refused: AtomicU64,
    not_sent: AtomicU64,
    unknown: AtomicU64,
    confirmed: AtomicU64,
    not_confirmed: AtomicU64,
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

    /// Counts a stop.
    pub fn count_stop(&self, confirmed: bool) {
        let count = if confirmed { &self.confirmed } else { &self.not_confirmed };
        count.fetch_add(1, Ordering::Relaxed);
    }

    /// The commands that stand in the audit log, by the word of their outcome.
    pub fn commands(&self) -> [(&'static str, u64); 4] {
        let all = [
            ("accepted", &self.accepted),
            ("refused", &self.refused),
            ("not_sent", &self.not_sent),
            ("unknown", &self.unknown),
        ];
        all.map(|(word, count)| (word, count.load(Ordering::Relaxed)))
    }

    /// The stops, by whether they were confirmed.
    pub fn stops(&self) -> [(bool, u64); 2] {
        let all = [(true, &self.confirmed), (false, &self.not_confirmed)];
        all.map(|(confirmed, count)| (confirmed, count.load(Ordering::Relaxed)))
    }
}
