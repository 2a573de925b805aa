//! The right to stream a motion over one connection: two motions would mix in one list.

use std::sync::Arc;

use tokio::sync::watch;

use crate::robot::Robot;
use crate::stop::stopping::{STOP_WITHIN, Stopping};
use crate::stream::error::Cause;

/// Whether a motion has the right, and how many stops were announced before it took it.
#[derive(Debug, Default)]
pub(crate) struct Turns {
    taken: Arc<watch::Sender<Option<u64>>>,
}

/// The right, until this is dropped.
#[derive(Debug)]
pub(crate) struct Turn {
    taken: Arc<watch::Sender<Option<u64>>>,
}

impl Drop for Turn {
    fn drop(&mut self) {
        self.taken.send_replace(None);
    }
}

impl Turns {
    /// Takes the right, with the number of stops that were announced until now. An error has the number with
    /// which another motion took it.
    pub fn take(&self, stops: u64) -> Result<Turn, u64> {
        let mut other = None;
        self.taken.send_if_modified(|taken| {
            other = *taken;
            let free = taken.is_none();
            if free {
                *taken = Some(stops);
            }
            free
        });
        other.map_or_else(|| Ok(Turn { taken: Arc::clone(&self.taken) }), Err)
    }

    /// Waits until no motion has the right.
    pub async fn free(&self) {
        // `Self` keeps the sender, so the wait does not fail.
        self.taken.subscribe().wait_for(Option::is_none).await.ok();
    }
}

impl Robot {
    /// Takes the right to stream a path over this connection, and subscribes to every stop from now on. Waits
    /// for a stop that is under way: it may still clear the list, and by then that would be the list of a
    /// moving arm.
    pub(crate) async fn turn(&self) -> Result<(Turn, watch::Receiver<u64>), Cause> {
        let (turn, stops) = self.free_turn().await?;
        if !self.no_stop_under_way().await {
            return Err(Cause::StoppedHere);
        }
        self.stopping().send_modify(Stopping::forget);
        match self.motions().untold_failure() {
            Some(earlier) => Err(Cause::EarlierFailed(earlier)),
            None => Ok((turn, stops)),
        }
    }

    /// Waits for a motion that a stop has reached: it ends a moment after that stop, and a caller who has the
    /// report of the stop cannot see when. A stop during that wait is for the caller's motion, too.
    async fn free_turn(&self) -> Result<(Turn, watch::Receiver<u64>), Cause> {
        let deadline = self.now() + STOP_WITHIN;
        // Subscribe before the check, so that a stop that begins after it is noticed.
        let stops = self.stops();
        let announced = *stops.borrow();
        loop {
            let taken = self.turns().take(announced);
            // The sender lives as long as this handle.
            if stops.has_changed().unwrap_or(true) {
                return Err(Cause::StoppedHere);
            }
            match taken {
                Ok(turn) => return Ok((turn, stops)),
                Err(before) if before == announced => return Err(Cause::AnotherRuns),
                Err(_before) => {
                    let free = self.hub().time.timeout_at(deadline, self.turns().free()).await;
                    free.map_err(|_elapsed| Cause::AnotherRuns)?;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use std::time::Duration;

    use super::Turns;

    #[tokio::test(start_paused = true)]
    async fn one_motion_at_a_time_has_the_turn_and_tells_the_stops_before_it() {
        let turns = Turns::default();
        let turn = turns.take(3).unwrap();
        assert_eq!(turns.take(4).unwrap_err(), 3);
        let free = tokio::time::timeout(Duration::from_secs(1), turns.free());
        assert!(free.await.is_err());
        drop(turn);
        turns.free().await;
        let turn = turns.take(4).unwrap();
        assert_eq!(turns.take(5).unwrap_err(), 4, "those of the first turn are forgotten");
        drop(turn);
    }
}
