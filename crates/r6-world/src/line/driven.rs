//! Checks that a client's connections are driven, however badly its calls drive: arrived bytes are read, and
//! heartbeats are sent.

use std::time::Duration;

use super::Line;
use crate::fault::Promise;
use crate::pipes::Pipes;
use crate::record::Record;

/// The maximum time until arrived bytes are read: some steps of the world.
const READS_WITHIN: Duration = Duration::from_millis(20);

/// The heartbeat period of clients that feed the watchdog.
pub const BEATS_EVERY: Duration = Duration::from_secs(2);

/// The maximum delay of a heartbeat.
const BEATS_WITHIN: Duration = Duration::from_millis(20);

impl Line {
    /// Checks all connections of this client. `latency`: the longest time that a packet takes.
    ///
    /// A slow call may harm itself. If no other call waits, there is no subscription and no heartbeat is due,
    /// its bytes may stay unread.
    pub fn look_at_drivers(
        &self,
        client: usize,
        at: Duration,
        latency: Duration,
        pipes: &Pipes,
        record: &mut Record,
    ) {
        if self.away || self.deaf {
            return;
        }
        let harms_itself = self.awake == 0 && self.asleep > 0 && !self.depends_on_keeper;
        for (number, written) in pipes.unread(client) {
            let has_ended = self.connections[number].ended.is_some();
            let late = at > written.max(self.passes_since) + latency + READS_WITHIN;
            record.check(Promise::Driven, at, !late || has_ended || harms_itself, || {
                let (awake, asleep) = (self.awake, self.asleep);
                format!(
                    "client-{client}/{number}: nobody reads what was written at {written:?}; {awake} calls wait, {asleep} are slow"
                )
            });
        }
        // The second connection of a stop sends no heartbeats.
        let beating = self.connections.iter().filter(|it| !it.beaten.is_zero() && it.ended.is_none());
        for connection in beating {
            let due = connection.beaten.max(self.passes_since) + BEATS_EVERY + BEATS_WITHIN;
            record.check(Promise::Driven, at, at <= due, || {
                format!("client-{client}: no heartbeat since {:?}", connection.beaten)
            });
        }
    }
}
