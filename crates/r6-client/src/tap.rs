//! Hands the values of each poll on to a recording.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use r6_proto::Reading;
use r6_proto::address::Address;
use r6_proto::time::Instant;
use tokio::sync::mpsc::{self, error::TrySendError};

use crate::query::result::{AskedAt, QueryResult};

/// How many polls wait for the reader of a recording: 20 s at the shortest period. They are in memory.
const MAX_WAITING: usize = 1024;

/// The most recordings of one robot.
pub const MAX_RECORDINGS: usize = 8;

/// A value that a poll has read.
#[derive(Debug)]
pub struct Polled {
    /// The address.
    pub address: Address,
    /// The value.
    pub reading: Option<Reading>,
    /// When it was asked for.
    pub at: Instant,
    /// The number of the connection over which it came.
    pub connection: u64,
}

/// Where a recording gets its values from.
#[derive(Debug)]
pub struct Tap {
    polls: mpsc::Sender<Poll>,
    lost: Arc<AtomicU64>,
}

/// The values of a poll.
#[derive(Debug)]
pub struct Poll {
    /// The values.
    pub values: Vec<Polled>,
    /// How many values of earlier polls were lost.
    pub lost: u64,
}

impl Tap {
    /// A tap, and what comes out of it.
    pub fn new() -> (Self, mpsc::Receiver<Poll>) {
        let (polls, waiting) = mpsc::channel(MAX_WAITING);
        (Self { polls, lost: Arc::default() }, waiting)
    }

    /// Hands on the values of a poll. Returns whether somebody still records.
    pub fn take(&self, result: &QueryResult, asked_at: &AskedAt) -> bool {
        let rows = result.rows().iter().enumerate();
        let mut values = Vec::with_capacity(rows.len());
        values.extend(rows.filter_map(|(position, (address, value))| {
            let at = asked_at.of(position)?;
            let connection = result.connection();
            Some(Polled { address: *address, reading: value.as_ref().ok().cloned(), at, connection })
        }));
        let poll = Poll { values, lost: self.lost.load(Ordering::Relaxed) };
        match self.polls.try_send(poll) {
            Ok(()) => true,
            Err(TrySendError::Full(Poll { values, .. })) => {
                self.lost.fetch_add(values.len() as u64, Ordering::Relaxed);
                true
            }
            Err(TrySendError::Closed(_)) => false,
        }
    }
}
