//! The stops under way over one connection, and how long each part of a stop may take.

use std::time::Duration;

use crate::error::RequestError;
use crate::stop::report::StopReport;

/// How long an arm may take to stand. One arm was seen to stop within 0.1 s, a paused one within 0.5 s. The
/// rest of the time allows for every means in turn, and for a stop that gets lost.
pub(crate) const CONFIRM_WITHIN: Duration = Duration::from_secs(5);

/// The pause between two reads of the state.
pub(crate) const READ_EVERY: Duration = Duration::from_millis(50);

/// How long the client waits for frames in doubt: the 2 s that a reply may take by default, and the time in
/// which the frame may still be accepted after that.
pub(crate) const DOUBT_WITHIN: Duration = Duration::from_secs(4);

/// How long a stop may take in total: [`CONFIRM_WITHIN`], [`DOUBT_WITHIN`], some seconds to stop a list that
/// was accepted late, and the time of some replies to clear the list and to read the state. At this limit the
/// report contains what was seen until then.
pub(crate) const STOP_WITHIN: Duration = Duration::from_secs(15);

/// The part of that time that is kept for clearing the list and for the last read: the time of a reply, and
/// some more.
pub(crate) const LEFT_FOR_CLEARING: Duration = Duration::from_secs(3);

/// The stops over one connection.
#[derive(Debug, Default)]
pub(crate) struct Stopping {
    pub under_way: usize,
    /// The result of the last stop of the present or latest group of overlapping stops.
    pub last: Option<Result<StopReport, RequestError>>,
}

impl Stopping {
    /// Forgets the result of earlier stops, because a new group begins.
    pub fn forget(&mut self) {
        self.last = None;
    }
}
