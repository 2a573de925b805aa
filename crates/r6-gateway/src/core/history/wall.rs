//! The time of day. It is read once, and then carried by a clock that does not jump.

use std::time::Duration;

use r6_proto::time::Instant;

use super::sample::Micros;

/// A difference above this is a step: somebody set the clock. Below, the carried time follows slowly.
const STEP: i64 = 1_000_000;

/// How much the carried time follows in a second: 500 µs, as the system's own clock does. So it always goes
/// on.
const SLEW_PER_SECOND: i64 = 500;

/// The carried time of day.
#[derive(Clone, Debug)]
pub struct WallClock {
    at: Instant,
    time: Micros,
    last_look: Instant,
}

impl WallClock {
    /// It is this time of day now.
    #[must_use]
    pub fn new(now: Instant, time: Micros) -> Self {
        Self { at: now, time, last_look: now }
    }

    /// The time of day at a moment, which may be before the last one.
    #[must_use]
    pub fn time(&self, at: Instant) -> Micros {
        if at >= self.at { self.time.after(at.since(self.at)) } else { self.time.before(self.at.since(at)) }
    }

    /// Compares with the clock of the system. If that was set, takes its time and returns how far it stepped,
    /// in µs.
    pub fn look(&mut self, now: Instant, system: Micros) -> Option<i64> {
        let difference = system.0.saturating_sub(self.time(now).0);
        let gone = now.since(self.last_look);
        if difference.abs() > STEP {
            *self = Self::new(now, system);
            return Some(difference);
        }
        if gone >= Duration::from_secs(1) {
            let most = i64::try_from(gone.as_secs()).unwrap_or(i64::MAX).saturating_mul(SLEW_PER_SECOND);
            let time = Micros(self.time(now).0.saturating_add(difference.clamp(-most, most)));
            (self.at, self.time, self.last_look) = (now, time, now);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::ORIGIN + Duration::from_millis(millis)
    }

    #[test]
    fn a_step_is_taken_over_and_told() {
        let mut clock = WallClock::new(at(0), Micros(1_000_000_000));
        assert_eq!(clock.time(at(1_500)), Micros(1_001_500_000));
        assert_eq!(clock.look(at(2_000), Micros(1_002_900_000)), None);
        assert_eq!(clock.look(at(3_000), Micros(1_010_000_000)), Some(6_999_000));
        assert_eq!(clock.time(at(3_000)), Micros(1_010_000_000));
        assert_eq!(clock.look(at(4_000), Micros(1_000_000_000)), Some(-11_000_000));
        assert_eq!(clock.time(at(3_500)), Micros(999_500_000), "before the step, on the new scale");
    }

    #[test]
    fn a_clock_that_drifts_is_followed_and_time_goes_on() {
        let mut clock = WallClock::new(at(0), Micros(0));
        let mut last = Micros(-1);
        for second in 1..=5_000_u64 {
            // The system's clock is 100 ppm slow.
            let system = Micros(i64::try_from(second).unwrap() * 999_900);
            assert_eq!(clock.look(at(second * 1000), system), None);
            let time = clock.time(at(second * 1000));
            assert!(time > last && (time.0 - system.0).abs() < 1_000, "{second}: {time:?} {system:?}");
            last = time;
        }
    }
}
