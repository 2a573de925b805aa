//! What is said of something that fails again and again: at once, then once a minute, and that it is over.

use std::fmt::Display;
use std::time::Duration;

use r6_proto::time::Instant;

use crate::clock;

/// How often to say that it still fails.
const AGAIN: Duration = Duration::from_secs(60);

/// Something that is tried again and again.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outage {
    /// Since when it fails, and when that was said last.
    fails: Option<(Instant, Instant)>,
}

impl Outage {
    /// Notes how it went now, and says in the log what is to be said. `what`: what was to be done, as in "the
    /// users cannot be read".
    pub fn note<T, E: Display>(&mut self, what: &str, result: &Result<T, E>) {
        let now = clock::now();
        match result {
            Ok(_) => {
                if let Some(after) = self.is_over(now) {
                    tracing::info!(after_s = after.as_secs(), "no more: {what}");
                }
            }
            Err(error) => {
                if let Some(since) = self.failed(now) {
                    tracing::error!(%error, since_s = since.as_secs(), "{what}: it is tried again and again");
                }
            }
        }
    }

    /// It failed. Returns for how long by now, if it is time to say so.
    fn failed(&mut self, now: Instant) -> Option<Duration> {
        let (since, told) = self.fails.unwrap_or((now, now));
        let is_first = self.fails.is_none();
        if !is_first && now.since(told) < AGAIN {
            return None;
        }
        self.fails = Some((since, now));
        Some(now.since(since))
    }

    /// It went well. Returns for how long it had failed, if it had.
    fn is_over(&mut self, now: Instant) -> Option<Duration> {
        self.fails.take().map(|(since, _)| now.since(since))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A database that is away for a night fills no disk with lines.
    #[test]
    fn an_outage_is_told_at_once_then_once_a_minute_and_that_it_is_over() {
        let mut outage = Outage::default();
        let begin = clock::now();
        let at = |s: u64| begin + Duration::from_secs(s);
        assert_eq!(outage.is_over(at(0)), None, "there was none");
        let told: Vec<_> = (0..150).filter_map(|s| Some((s, outage.failed(at(s))?.as_secs()))).collect();
        assert_eq!(told, [(0, 0), (60, 60), (120, 120)]);
        assert_eq!(outage.is_over(at(150)), Some(Duration::from_secs(150)));
        assert_eq!(outage.failed(at(151)), Some(Duration::ZERO), "the next one is told at once");
    }
}
