//! The speed of time for a virtual controller.
//!
//! It maps real time to the controller's time, or lets `r6-controller/src/fast_clock.rs` drive the
//! controller. That clock is pure, so a conversation without sockets has the same bytes as one over TCP.
//! `machine/deadlines.rs` says which deadlines are the controller's own, and which measure the silence of
//! others.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use r6_controller::{ConnectionId, Controller, FastClock};
use r6_proto::time::Instant;

/// The slowest and the fastest time. Above a hundred times, the system timer (a millisecond) limits the
/// accuracy of short waits. Above a thousand, use `AsFastAsPossible`.
const SPEEDS: std::ops::RangeInclusive<f64> = 0.01..=1000.0;

/// The speed of time for a virtual controller.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Clock {
    /// Real time: `real`.
    #[default]
    Real,
    /// This many times as fast, 0.01 to 1000: `10x`. Other numbers are clamped to this range.
    Times(f64),
    /// Jumps from event to event, and stands still without input: `max`. The same seed and the same frames
    /// give the same bytes; see [`FastClock`] for the rules.
    AsFastAsPossible,
}

/// The error of a text that is not a [`Clock`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadClock(String);

impl fmt::Display for BadClock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "there is no clock `{}`; there are: real, 10x (0.01x to 1000x), max (as fast as possible)",
            self.0
        )
    }
}

impl std::error::Error for BadClock {}

impl FromStr for Clock {
    type Err = BadClock;

    fn from_str(text: &str) -> Result<Self, BadClock> {
        match text {
            "real" => Ok(Self::Real),
            "max" => Ok(Self::AsFastAsPossible),
            _ => text
                .strip_suffix('x')
                .and_then(|factor| factor.parse().ok())
                .filter(|factor| SPEEDS.contains(factor))
                .map(Self::Times)
                .ok_or_else(|| BadClock(text.to_owned())),
        }
    }
}

impl fmt::Display for Clock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Real => f.write_str("real"),
            Self::Times(factor) => write!(f, "{factor}x"),
            Self::AsFastAsPossible => f.write_str("max"),
        }
    }
}

/// The running clock of one controller.
#[derive(Debug)]
pub(crate) enum Pace {
    /// Time passes without input.
    Flowing {
        /// When it began.
        started: tokio::time::Instant,
        /// The factor to real time.
        factor: f64,
    },
    /// Only the input drives time.
    Driven(FastClock),
}

impl Pace {
    pub fn new(clock: Clock, started: tokio::time::Instant) -> Self {
        match clock {
            Clock::Real => Self::Flowing { started, factor: 1.0 },
            // `clamp` would return NaN.
            Clock::Times(factor) if factor.is_nan() => Self::Flowing { started, factor: 1.0 },
            Clock::Times(factor) => {
                Self::Flowing { started, factor: factor.clamp(*SPEEDS.start(), *SPEEDS.end()) }
            }
            Clock::AsFastAsPossible => Self::Driven(FastClock::new(Instant::ORIGIN)),
        }
    }

    /// The present time of the controller.
    pub fn now(&self) -> Instant {
        match self {
            Self::Flowing { started, factor } => Instant::ORIGIN + scaled(started.elapsed(), *factor),
            Self::Driven(clock) => clock.now(),
        }
    }

    /// How long it takes, in real time, until `due`, for a connection that waits for it.
    pub fn until(&self, due: Instant) -> Duration {
        match self {
            Self::Flowing { factor, .. } => scaled(due.since(self.now()), 1.0 / factor),
            // Everything due is sent within the call that caused it. Otherwise the task that drives the clock
            // wakes the connection.
            Self::Driven(_) => Duration::MAX,
        }
    }

    /// The time that counts for something due at `due`: the present time, or, if only the input drives time,
    /// `due` itself.
    pub fn reach(&self, due: Option<Instant>) -> Instant {
        match self {
            Self::Flowing { .. } => self.now(),
            Self::Driven(clock) => due.unwrap_or_default().max(clock.now()),
        }
    }

    /// Does something to the controller, and lets its consequences happen.
    pub fn act<T>(
        &mut self,
        controller: &mut Controller,
        act: impl FnOnce(&mut Controller, Instant) -> T,
    ) -> T {
        match self {
            Self::Flowing { .. } => act(controller, self.now()),
            Self::Driven(clock) => clock.act(controller, act),
        }
    }

    /// Takes bytes from a connection.
    pub fn handle_input(&mut self, controller: &mut Controller, id: ConnectionId, bytes: &[u8]) {
        match self {
            Self::Flowing { .. } => controller.handle_input(self.now(), id, bytes),
            Self::Driven(clock) => clock.handle_input(controller, id, bytes),
        }
    }

    /// How long it takes, in real time, until [`Self::handle_timeout`] has to be called; `None` for no limit.
    pub fn pause(&self, controller: &Controller) -> Option<Duration> {
        match self {
            Self::Flowing { .. } => controller.poll_timeout().map(|due| self.until(due)),
            Self::Driven(clock) => clock.pause(controller),
        }
    }

    /// The same as a time of the controller. If it changes, the pause changes.
    pub fn deadline(&self, controller: &Controller) -> Option<Instant> {
        match self {
            Self::Flowing { .. } => controller.poll_timeout(),
            Self::Driven(clock) => clock.pause(controller).map(|pause| clock.now() + pause),
        }
    }

    /// Handles the end of the pause.
    pub fn handle_timeout(&mut self, controller: &mut Controller) {
        match self {
            Self::Flowing { .. } => controller.handle_timeout(self.now()),
            Self::Driven(clock) => clock.go_on(controller),
        }
    }
}

fn scaled(time: Duration, factor: f64) -> Duration {
    // Real time stays exact.
    #[expect(clippy::float_cmp, reason = "1 is what `Pace::new` set for real time")]
    let real = factor == 1.0;
    if real {
        time
    } else {
        Duration::try_from_secs_f64(time.as_secs_f64() * factor).unwrap_or(Duration::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_are_read_and_written_alike() {
        let clocks = [
            ("real", Clock::Real),
            ("10x", Clock::Times(10.0)),
            ("0.5x", Clock::Times(0.5)),
            ("max", Clock::AsFastAsPossible),
        ];
        for (text, clock) in clocks {
            assert_eq!(text.parse(), Ok(clock));
            assert_eq!(clock.to_string(), text);
        }
        for text in ["", "fast", "10", "x", "0x", "-1x", "1001x", "nanx", "infx"] {
            assert_eq!(text.parse::<Clock>(), Err(BadClock(text.to_owned())));
        }
    }

    #[tokio::test(start_paused = true)]
    async fn time_goes_as_fast_as_told() {
        for (clock, seconds) in [(Clock::Real, 2.0), (Clock::Times(10.0), 20.0), (Clock::Times(0.5), 1.0)] {
            let pace = Pace::new(clock, tokio::time::Instant::now());
            tokio::time::advance(Duration::from_secs(2)).await;
            let now = pace.now();
            assert!((now.as_secs_f64() - seconds).abs() < 1e-9, "{clock}: {now}");
            let until = pace.until(now + Duration::from_secs(20)).as_secs_f64();
            assert!((until * seconds - 40.0).abs() < 1e-6, "{clock}: {until}");
        }
    }
}
