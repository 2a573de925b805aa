//! Whether a cycle ended between two readings, from `lastCycle` and `curCycle`.
//!
//! The protocol has no number of cycles. `lastCycle` is the time of the last cycle, `curCycle` that of the
//! present one. What follows from two readings:
//!
//! - `lastCycle` changed: at least one cycle ended. If the last one took as long as the time between the
//!   readings, it began before the first reading, so it is the only one.
//! - `lastCycle` is the same and `curCycle` fell: a cycle of the same time ended, or one was broken off. It
//!   counts only if a program ran at both readings, if no mode between them said that none runs, if the sum
//!   of the times fits, and if there are at least two readings in a cycle. What remains: a program that was
//!   stopped just before the end of a cycle and started again before the mode was read looks the same.
//!
//! A controller reads its times between the question and the reply, so the time between two readings is only
//! known to lie between two bounds.

use std::time::Duration;

use r6_proto::time::Instant;

/// How far the times of a controller may be off: it reads them some milliseconds after they were asked for.
const SLACK: f64 = 0.05;

/// The longest cycle that is believed: a day, in seconds.
const LONGEST: f64 = 86_400.0;

/// What was read of the cycles at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// When it was asked for.
    pub at: Instant,
    /// When the reply was there at the latest.
    pub by: Instant,
    /// `lastCycle`, in seconds.
    pub last: f64,
    /// `curCycle` of the same moment, in seconds.
    pub current: Option<f64>,
    /// Whether a program ran, by the mode.
    pub runs: bool,
    /// Whether a mode was read since the reading before in which no program runs.
    pub stood: bool,
}

/// Cycles that ended between two readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Done {
    /// How many are proved to have ended.
    pub count: u64,
    /// Whether more may have ended.
    pub at_least: bool,
    /// How long it took, in ms; `None` if more may have ended.
    pub ms: Option<u64>,
    /// How long before the reply of the later reading the last one ended at the latest.
    pub ended_before: Duration,
}

/// What ended between two readings; `None` if it is not proved that a cycle ended.
#[must_use]
pub fn between(before: &Reading, now: &Reading) -> Option<Done> {
    // As long as it can be: each use below errs on the side of cycles that are not told.
    let gone = now.by.since(before.at).as_secs_f64();
    // A controller that was switched on again has no last cycle.
    if !(now.last > 0.0 && now.last <= LONGEST) {
        return None;
    }
    let present = now.current.filter(|current| (0.0..=gone).contains(current)).unwrap_or(0.0);
    let ended_before = Duration::from_secs_f64(present);
    // The bits: a value that a robot repeats is the same text.
    if now.last.to_bits() != before.last.to_bits() {
        let is_only_one = now.last >= gone + SLACK;
        let ms = is_only_one.then(|| millis(now.last));
        return Some(Done { count: 1, at_least: !is_only_one, ms, ended_before });
    }
    let (was, is) = (before.current?, now.current?);
    let fits = was - SLACK <= now.last && now.last <= was + gone - is + SLACK;
    let is_seen = is < was && fits && gone * 2.0 <= now.last && before.runs && now.runs && !now.stood;
    is_seen.then(|| Done { count: 1, at_least: false, ms: Some(millis(now.last)), ended_before })
}

/// Whole milliseconds of seconds that are at most [`LONGEST`].
fn millis(seconds: f64) -> u64 {
    u64::try_from(Duration::from_secs_f64(seconds).as_micros().saturating_add(500) / 1000).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(at_ms: u64, last: f64, current: f64) -> Reading {
        let at = Instant::ORIGIN + Duration::from_millis(at_ms);
        Reading { at, by: at, last, current: Some(current), runs: true, stood: false }
    }

    #[test]
    fn a_new_time_of_the_last_cycle_is_one_cycle_or_at_least_one() {
        let done = between(&reading(0, 8.0, 7.9), &reading(100, 8.25, 0.03)).unwrap();
        assert_eq!((done.count, done.at_least, done.ms), (1, false, Some(8250)));
        assert_eq!(done.ended_before, Duration::from_millis(30));
        // Two cycles of 3 s may have ended in 10 s, or three.
        let done = between(&reading(0, 8.0, 2.0), &reading(10_000, 3.0, 1.0)).unwrap();
        assert_eq!((done.count, done.at_least, done.ms), (1, true, None));
    }

    #[test]
    fn a_reply_that_took_long_makes_the_time_between_readings_longer() {
        // Between the values of the two replies may lie 3.1 s, so two cycles of 3 s may have ended.
        let late = |at_ms, last, current, took_ms| {
            let reading = reading(at_ms, last, current);
            Reading { by: reading.at + Duration::from_millis(took_ms), ..reading }
        };
        let before = reading(0, 8.0, 2.0);
        let done = between(&before, &late(100, 3.0, 1.0, 3_000)).unwrap();
        assert_eq!((done.count, done.at_least, done.ms), (1, true, None));
        let done = between(&before, &late(100, 3.0, 1.0, 100)).unwrap();
        assert_eq!((done.at_least, done.ms), (false, Some(3000)));
    }

    #[test]
    fn the_same_time_counts_if_the_sum_fits() {
        let done = between(&reading(0, 8.0, 7.95), &reading(100, 8.0, 0.05)).unwrap();
        assert_eq!((done.count, done.at_least, done.ms), (1, false, Some(8000)));
        // It was broken off after 3 s.
        assert_eq!(between(&reading(0, 8.0, 3.0), &reading(100, 8.0, 0.05)), None);
        // It goes on.
        assert_eq!(between(&reading(0, 8.0, 3.0), &reading(100, 8.0, 3.1)), None);
        // No program runs any more: it may have been broken off at its end.
        let stands = Reading { runs: false, ..reading(100, 8.0, 0.0) };
        assert_eq!(between(&reading(0, 8.0, 7.95), &stands), None);
        // No program ran for a moment between the readings.
        let stood = Reading { stood: true, ..reading(100, 8.0, 0.05) };
        assert_eq!(between(&reading(0, 8.0, 7.95), &stood), None);
        // Too few readings to know.
        assert_eq!(between(&reading(0, 8.0, 5.0), &reading(6_000, 8.0, 3.0)), None);
    }

    #[test]
    fn what_is_no_time_is_no_cycle() {
        for last in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e300] {
            assert_eq!(between(&reading(0, 8.0, 1.0), &reading(100, last, 0.0)), None, "{last}");
        }
        for current in [-5.0, f64::NAN, f64::INFINITY, 1e300] {
            let done = between(&reading(0, f64::NAN, current), &reading(100, 8.0, current)).unwrap();
            assert_eq!((done.ms, done.ended_before), (Some(8000), Duration::ZERO), "{current}");
            assert_eq!(between(&reading(0, 8.0, current), &reading(100, 8.0, current)), None);
        }
    }
}
