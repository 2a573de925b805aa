//! Random numbers from a seed: the same seed gives the same numbers, always and on every machine.

use std::time::Duration;

/// A small generator (SplitMix64) with one word of state and no bad seeds. Use it for variation in a cell,
/// never for secrets.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// Creates a generator with this seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns the next number. All 2^64 numbers are equally likely.
    pub fn next_number(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// Returns a number from 0 and below `end`; 0 if `end` is 0.
    pub fn below(&mut self, end: usize) -> usize {
        let wide = (u128::from(self.next_number()) * u128::try_from(end).unwrap_or(0)) >> 64;
        usize::try_from(wide).unwrap_or(0)
    }

    /// Returns `true` with this chance, 0 to 1.
    pub fn strikes(&mut self, chance: f64) -> bool {
        // The upper 53 bits fit exactly in an f64 and give a number below 1.
        #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
        let part = (self.next_number() >> 11) as f64 / (1_u64 << 53) as f64;
        part < chance
    }

    /// Returns a time from 0 to `most`.
    pub fn up_to(&mut self, most: Duration) -> Duration {
        self.around(most / 2, most / 2).min(most)
    }

    /// Returns a time from `middle` − `spread` to `middle` + `spread`. All nanoseconds are equally likely. It
    /// is never negative.
    pub fn around(&mut self, middle: Duration, spread: Duration) -> Duration {
        if spread.is_zero() {
            return middle;
        }
        let lowest = middle.saturating_sub(spread);
        let width = middle.saturating_add(spread).saturating_sub(lowest).as_nanos();
        let width = u64::try_from(width).unwrap_or(u64::MAX);
        // The upper half of a product: a number from 0 to `width`.
        let nanos = (u128::from(self.next_number()) * (u128::from(width) + 1)) >> 64;
        lowest.saturating_add(Duration::from_nanos(u64::try_from(nanos).unwrap_or(width)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIDDLE: Duration = Duration::from_millis(18);
    const SPREAD: Duration = Duration::from_millis(2);

    fn draw(seed: u64) -> Vec<Duration> {
        let mut random = Random::new(seed);
        (0..1000).map(|_| random.around(MIDDLE, SPREAD)).collect()
    }

    #[test]
    fn a_seed_says_what_comes() {
        assert_eq!(draw(7), draw(7));
        assert_ne!(draw(7), draw(8));
    }

    #[test]
    fn a_spread_is_filled_and_not_left() {
        let drawn = draw(1);
        assert!(drawn.iter().all(|time| (MIDDLE - SPREAD..=MIDDLE + SPREAD).contains(time)));
        let near = |edge: Duration| drawn.iter().any(|time| time.abs_diff(edge) < SPREAD / 20);
        assert!(near(MIDDLE - SPREAD) && near(MIDDLE) && near(MIDDLE + SPREAD));
    }

    #[test]
    fn nothing_is_drawn_below_zero_or_without_a_spread() {
        let mut random = Random::new(3);
        assert_eq!(random.around(MIDDLE, Duration::ZERO), MIDDLE);
        for _ in 0..1000 {
            assert!(random.around(SPREAD, MIDDLE) <= MIDDLE + SPREAD);
        }
    }

    #[test]
    fn numbers_fill_their_range_and_stay_in_it() {
        let mut random = Random::new(4);
        let mut seen = [0_u32; 7];
        for _ in 0..7000 {
            seen[random.below(7)] += 1;
        }
        assert!(seen.iter().all(|count| (850..1150).contains(count)), "{seen:?}");
        assert_eq!((random.below(0), random.below(1)), (0, 0));
        let drawn: Vec<_> = (0..1000).map(|_| random.up_to(SPREAD)).collect();
        assert!(drawn.iter().all(|time| *time <= SPREAD));
        assert!(
            drawn.iter().any(|time| *time < SPREAD / 20) && drawn.iter().any(|time| *time > SPREAD / 20 * 19)
        );
        assert_eq!(random.up_to(Duration::ZERO), Duration::ZERO);
    }

    #[test]
    fn what_has_a_chance_happens_that_often() {
        let mut random = Random::new(5);
        let mut count = |chance| (0..10_000).filter(|_| random.strikes(chance)).count();
        assert_eq!((count(0.0), count(1.0), count(f64::NAN)), (0, 10_000, 0));
        assert!((2800..3200).contains(&count(0.3)));
    }
}
