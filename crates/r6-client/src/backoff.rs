//! The waits between attempts to connect.

use std::time::Duration;

use crate::settings::Reconnect;

/// The longest wait before an attempt, as a part of the shortest subscription period. The rest of the period
/// is for the attempt itself, the identity query and reading the values, so the values are back within one
/// period. A robot that is away costs no more attempts than it would cost queries. Each wait is drawn from
/// its upper half, so that many clients behind one switch do not return at the same moment.
const PART_OF_A_PERIOD: f64 = 0.375;

/// A shorter subscription period counts as this one. How often values are wanted does not say how many
/// attempts a controller tolerates, and a person who looks once a second does not need more.
const SHORTEST_WATCHED: Duration = Duration::from_secs(1);

/// A connection on which the controller answered and that lasted this long counts as good. A shorter one
/// counts as a failed attempt. Otherwise the client would reconnect at once, for ever, to a controller that
/// identifies itself and then closes. It is as long as the longest usual wait.
const LIVED: Duration = Duration::from_secs(5);

/// Waits that double up to a cap, each jittered within its upper half.
#[derive(Debug)]
pub(crate) struct Backoff {
    first: Duration,
    cap: Duration,
    next: Duration,
    jitter: u64,
}

impl Backoff {
    /// `seed` is used if the settings have none.
    pub fn new(settings: Reconnect, seed: impl FnOnce() -> u64) -> Self {
        let first = settings.first_wait.min(settings.cap);
        Self { first, cap: settings.cap, next: first, jitter: settings.jitter_seed.unwrap_or_else(seed) }
    }

    /// The wait before the next attempt. `polled`: the shortest period of all subscriptions. With
    /// subscriptions, the wait is at most a part of that period, but never less than the first wait of the
    /// settings.
    pub fn next_wait(&mut self, polled: Option<Duration>) -> Duration {
        let watched = |every: Duration| every.max(SHORTEST_WATCHED).mul_f64(PART_OF_A_PERIOD).max(self.first);
        let wait = polled.map_or(self.next, |every| self.next.min(watched(every)));
        self.next = self.next.saturating_mul(2).min(self.cap);
        wait.mul_f64(0.5 + 0.5 * self.draw())
    }

    /// A connection on which the controller answered has ended. If it was good, the next outage begins with
    /// the first wait.
    pub fn had_answers_for(&mut self, lasted: Duration) {
        if lasted >= LIVED {
            self.next = self.first;
        }
    }

    /// A number from 0 to 1 (splitmix64).
    fn draw(&mut self) -> f64 {
        self.jitter = self.jitter.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.jitter;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^= bits >> 31;
        f64::from(u32::try_from(bits >> 32).unwrap_or(u32::MAX)) / f64::from(u32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waits(seed: u64) -> Vec<Duration> {
        let settings = Reconnect {
            first_wait: Duration::from_millis(100),
            cap: Duration::from_secs(1),
            jitter_seed: Some(seed),
        };
        let mut backoff = Backoff::new(settings, || unreachable!("the settings have a seed"));
        (0..8).map(|_| backoff.next_wait(None)).collect()
    }

    #[test]
    fn waits_double_up_to_the_cap_within_their_upper_half() {
        for (wait, full) in waits(7).into_iter().zip([100, 200, 400, 800, 1000, 1000, 1000, 1000]) {
            let full = Duration::from_millis(full);
            assert!(wait >= full / 2 && wait <= full, "{wait:?} is not within the upper half of {full:?}");
        }
    }

    #[test]
    fn the_seed_decides() {
        assert_eq!(waits(7), waits(7));
        assert_ne!(waits(7), waits(8));
    }

    /// A thousand clients of one controller that was switched off must not all come back at once.
    #[test]
    fn clients_come_back_evenly_spread() {
        let mut tenths = [0_u32; 10];
        for seed in 0..1000 {
            let share = (waits(seed)[0].as_secs_f64() - 0.05) / 0.05;
            tenths[((share * 10.0) as usize).min(9)] += 1;
        }
        assert!(tenths.iter().all(|count| (60..=140).contains(count)), "{tenths:?}");
    }

    #[test]
    fn a_connection_that_lived_begins_anew_and_a_short_one_does_not() {
        let settings = Reconnect { jitter_seed: Some(1), ..Reconnect::default() };
        let mut backoff = Backoff::new(settings, || 0);
        for _ in 0..5 {
            backoff.next_wait(None);
        }
        backoff.had_answers_for(LIVED - Duration::from_millis(1));
        assert!(backoff.next_wait(None) > settings.first_wait);
        backoff.had_answers_for(LIVED);
        assert!(backoff.next_wait(None) <= settings.first_wait);
    }

    #[test]
    fn a_fast_subscription_does_not_cut_the_waits_of_the_caller() {
        let settings = Reconnect { jitter_seed: Some(1), ..Reconnect::default() };
        for every in [20, 100, 1000].map(Duration::from_millis) {
            let mut backoff = Backoff::new(settings, || 0);
            let waits: Vec<_> = (0..20).map(|_| backoff.next_wait(Some(every))).collect();
            assert!(waits.iter().all(|wait| *wait >= settings.first_wait / 2), "{every:?}: {waits:?}");
            let second = Duration::from_secs(1).mul_f64(PART_OF_A_PERIOD) / 2;
            assert!(waits.iter().skip(3).all(|wait| *wait >= second), "{every:?}: {waits:?}");
        }
        let wait = Duration::from_secs(30);
        let patient = Reconnect { first_wait: wait, cap: wait, jitter_seed: Some(1) };
        let waited = Backoff::new(patient, || 0).next_wait(Some(Duration::from_secs(1)));
        assert!(waited >= wait / 2, "{waited:?}");
    }

    #[test]
    fn who_is_watched_is_not_waited_for_longer_than_a_part_of_the_period() {
        let settings = Reconnect { jitter_seed: Some(1), ..Reconnect::default() };
        let mut backoff = Backoff::new(settings, || 0);
        let every = Duration::from_secs(1);
        let waits: Vec<_> = (0..20).map(|_| backoff.next_wait(Some(every))).collect();
        let most = every * 3 / 8;
        assert!(waits.iter().all(|wait| *wait <= most), "{waits:?}");
        assert!(waits.iter().skip(3).all(|wait| *wait >= most / 2), "no flood of attempts: {waits:?}");
        assert!(backoff.next_wait(None) > most, "without a caller the wait may be long");
    }
}
