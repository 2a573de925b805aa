//! How many requests a token may make.

use std::time::Duration;

use r6_proto::time::Instant;

/// The time of one request: 100 a second in the long run.
const INTERVAL: Duration = Duration::from_millis(10);

/// How many requests may come at once after a pause.
const BURST: u32 = 200;

/// The rate of one token. It remembers one time, whatever happens.
#[derive(Clone, Copy, Debug)]
pub struct Rate {
    /// When all requests so far would be over, one each [`INTERVAL`].
    over: Instant,
}

impl Default for Rate {
    fn default() -> Self {
        Self { over: Instant::ORIGIN }
    }
}

impl Rate {
    /// Counts a request.
    ///
    /// # Errors
    /// It comes too early, and is not counted: how long to wait.
    pub fn request(&mut self, now: Instant) -> Result<(), Duration> {
        let over = self.over.max(now) + INTERVAL;
        let ahead = over.since(now);
        let most = INTERVAL * BURST;
        if ahead > most {
            return Err(ahead - most);
        }
        self.over = over;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Whatever the pauses, no span of time has more requests than the burst and one for each interval.
        /// A request after the wait that the refusal gave is let through.
        #[test]
        fn no_more_pass_than_the_limit(pauses in prop::collection::vec(0..40_u64, 1..1_000)) {
            let mut rate = Rate::default();
            let mut now = Instant::ORIGIN + Duration::from_secs(1);
            let mut passed: Vec<Instant> = Vec::new();
            for pause in pauses {
                // Most pauses are shorter than the interval.
                now += Duration::from_millis(pause / 8);
                match rate.request(now) {
                    Ok(()) => passed.push(now),
                    Err(wait) => {
                        let mut later = rate;
                        prop_assert_eq!(later.request(now + wait), Ok(()));
                    }
                }
            }
            for (first, from) in passed.iter().enumerate() {
                for (number, to) in (1_u32..).zip(&passed[first..]) {
                    prop_assert!(INTERVAL * number <= to.since(*from) + INTERVAL * BURST);
                }
            }
        }
    }

    #[test]
    fn a_token_that_paused_has_its_burst_again() {
        let mut rate = Rate::default();
        let now = Instant::ORIGIN + Duration::from_secs(1);
        let burst = |rate: &mut Rate, now| (0..1_000).filter(|_| rate.request(now).is_ok()).count();
        assert_eq!(burst(&mut rate, now), BURST as usize);
        assert_eq!(rate.request(now), Err(INTERVAL));
        assert_eq!(burst(&mut rate, now + Duration::from_millis(50)), 5);
        assert_eq!(burst(&mut rate, now + Duration::from_secs(60)), BURST as usize);
    }
}
