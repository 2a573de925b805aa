//! Whether the connections of a client are driven, however its calls drive: what came is read, and heartbeats
//! leave.

use std::time::Duration;

use super::Line;
use crate::fault::Promise;
use crate::pipes::Pipes;
use crate::record::Record;

/// What is there is read within this time: some steps of the world.
const READS_WITHIN: Duration = Duration::from_millis(20);

/// Clients that keep the watchdog fed do so this often.
pub const BEATS_EVERY: Duration = Duration::from_secs(2);

/// No heartbeat is later than this.
const BEATS_WITHIN: Duration = Duration::from_millis(20);

impl Line {
    /// Looks at all connections of this client. `latency`: the longest time that a packet takes.
    ///
    /// A call that is slow harms itself: while no other call waits, nobody watches and no heartbeat is due,
    /// nobody has to read what comes for it.
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
        // The second connection of a stop never beats.
        let beating = self.connections.iter().filter(|it| !it.beaten.is_zero() && it.ended.is_none());
        for connection in beating {
            let due = connection.beaten.max(self.passes_since) + BEATS_EVERY + BEATS_WITHIN;
            record.check(Promise::Driven, at, at <= due, || {
                format!("client-{client}: no heartbeat since {:?}", connection.beaten)
            });
        }
    }
}
