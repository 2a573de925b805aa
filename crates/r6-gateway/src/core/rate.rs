//! How many requests a token may make, and other things that come at a limited rate.

use std::time::Duration;

use r6_proto::time::Instant;

/// How fast something may come.
#[derive(Clone, Copy, Debug)]
pub struct Limit {
    /// The time of each in the long run.
    pub interval: Duration,
    /// How many may come at once after a pause.
    pub burst: u32,
}

/// Requests: 100 a second in the long run.
const REQUESTS: Limit = Limit { interval: Duration::from_millis(10), burst: 200 };

/// The rate of one token or user. It remembers one time, whatever happens.
#[derive(Clone, Copy, Debug)]
pub struct Rate {
    /// When all so far would be over, one each interval.
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
        let wait = self.wait(now, REQUESTS);
        if !wait.is_zero() {
            return Err(wait);
        }
        self.count(now, REQUESTS);
        Ok(())
    }

    /// How long the next one has to wait.
    #[must_use]
    pub fn wait(&self, now: Instant, limit: Limit) -> Duration {
        let ahead = (self.over.max(now) + limit.interval).since(now);
        ahead.saturating_sub(limit.interval * limit.burst)
    }

    /// Counts one, whether it came too early or not.
    pub fn count(&mut self, now: Instant, limit: Limit) {
        self.over = self.over.max(now) + limit.interval;
    }

    /// Whether it is as if nothing had come yet.
    #[must_use]
    pub fn is_idle(&self, now: Instant) -> bool {
        self.over <= now
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
                    prop_assert!(REQUESTS.interval * number <= to.since(*from) + REQUESTS.interval * REQUESTS.burst);
                }
            }
        }
    }

    #[test]
    fn a_token_that_paused_has_its_burst_again() {
        let mut rate = Rate::default();
        let now = Instant::ORIGIN + Duration::from_secs(1);
        let burst = |rate: &mut Rate, now| (0..1_000).filter(|_| rate.request(now).is_ok()).count();
        assert_eq!(burst(&mut rate, now), REQUESTS.burst as usize);
        assert_eq!(rate.request(now), Err(REQUESTS.interval));
        assert_eq!(burst(&mut rate, now + Duration::from_millis(50)), 5);
        assert_eq!(burst(&mut rate, now + Duration::from_secs(60)), REQUESTS.burst as usize);
    }
}
