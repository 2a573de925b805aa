//! The stops that are under way over one connection, and how long each part of one may take.

use std::time::Duration;

use crate::error::RequestError;
use crate::stop::report::StopReport;

/// How long an arm may take to stand. One was seen to stop within 0.1 s, a paused one within 0.5 s; the rest is room for
/// every means in turn, and for a stop that gets lost.
pub(crate) const CONFIRM_WITHIN: Duration = Duration::from_secs(5);

/// The pause between two reads of the state.
pub(crate) const READ_EVERY: Duration = Duration::from_millis(50);

/// How long frames in doubt are waited for: the 2 s that a reply may take by default, and the time in which it may still be
/// taken after that.
pub(crate) const DOUBT_WITHIN: Duration = Duration::from_secs(4);

/// How long a stop may take in all: [`CONFIRM_WITHIN`], [`DOUBT_WITHIN`], some seconds to stop a list that was taken late, and the
/// time of some replies to clear the list and to look. Then its report says what was seen until then.
pub(crate) const STOP_WITHIN: Duration = Duration::from_secs(15);

/// What is left of that for clearing the list and for the last look: the time of a reply, and some.
pub(crate) const LEFT_FOR_CLEARING: Duration = Duration::from_secs(3);

/// The stops over one connection.
#[derive(Debug, Default)]
pub(crate) struct Stopping {
    pub under_way: usize,
    /// What became of the last one of those that began while none was under way, or later.
    pub last: Option<Result<StopReport, RequestError>>,
}

impl Stopping {
    /// What was stopped before is nothing to what begins now.
    pub fn forget(&mut self) {
        self.last = None;
    }
}
