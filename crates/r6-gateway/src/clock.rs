//! The clocks of the gateway.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use r6_proto::time::Instant;

use crate::core::history::sample::Micros;

/// The time since the system started. It goes on while the machine sleeps, so that no lease outlives a sleep.
pub fn now() -> Instant {
    #[cfg(feature = "simulation")]
    if let Some(time) = crate::simulated::time() {
        return Instant::ORIGIN + time;
    }
    since_boot()
}

/// Ticks at this period. The first tick comes after one period, and a late tick moves those behind it.
pub fn every(period: Duration) -> tokio::time::Interval {
    let mut ticks = tokio::time::interval_at(tokio::time::Instant::now() + period, period);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    ticks
}

/// The time of day of the system.
pub fn today() -> SystemTime {
    #[cfg(feature = "simulation")]
    if let Some(today) = crate::simulated::today() {
        return today;
    }
    SystemTime::now()
}

#[cfg(target_os = "linux")]
fn since_boot() -> Instant {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    let seconds = Duration::from_secs(u64::try_from(time.tv_sec).unwrap_or(0));
    Instant::ORIGIN + seconds + Duration::from_nanos(u64::try_from(time.tv_nsec).unwrap_or(0))
}

/// The time since the process asked first. On this system it may stand while the machine sleeps.
#[cfg(not(target_os = "linux"))]
fn since_boot() -> Instant {
    static ORIGIN: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    Instant::ORIGIN + ORIGIN.get_or_init(std::time::Instant::now).elapsed()
}

/// The time so long before another.
pub fn before(now: Instant, age: Duration) -> Instant {
    let age = u64::try_from(age.as_nanos()).unwrap_or(u64::MAX);
    Instant::from_nanos(now.as_nanos().saturating_sub(age))
}

/// The time of day: RFC 3339, UTC, microseconds.
pub fn time_of_day() -> String {
    humantime::format_rfc3339_micros(today()).to_string()
}

/// A time of the system as text: RFC 3339, UTC, microseconds.
pub fn text_of(time: SystemTime) -> String {
    let since = time.duration_since(UNIX_EPOCH).unwrap_or_default();
    text_of_seconds(since.as_secs())
}

/// The time of day of the system.
pub fn system() -> Micros {
    let time = today().duration_since(UNIX_EPOCH).unwrap_or_default();
    Micros(i64::try_from(time.as_micros()).unwrap_or(i64::MAX))
}

/// The time of day of the system, in seconds since 1970.
pub fn seconds() -> u64 {
    today().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs()
}

/// A time as text: RFC 3339, UTC, microseconds. Times before 1970 are not kept.
pub fn text(time: Micros) -> String {
    let since = Duration::from_micros(u64::try_from(time.0).unwrap_or(0));
    humantime::format_rfc3339_micros(UNIX_EPOCH.checked_add(since).unwrap_or(UNIX_EPOCH)).to_string()
}

/// The end of the year 9999, in seconds since 1970: RFC 3339 has no later time.
const LAST_SECOND: i64 = 253_402_300_799;

/// A time in seconds since 1970 as text: RFC 3339, UTC, microseconds.
pub fn text_of_seconds(seconds: u64) -> String {
    let seconds = i64::try_from(seconds).unwrap_or(i64::MAX).min(LAST_SECOND);
    text(Micros(seconds.saturating_mul(1_000_000)))
}

/// Milliseconds with three decimals.
pub fn milliseconds(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e6).round() / 1e3
}
