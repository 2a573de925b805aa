//! How many events of one robot's values readers get live.

use std::time::Duration;

use r6_proto::time::Instant;

/// How many events in a second. An arm that works has one or two; a controller that flips its values at each
/// poll must not push the events of all others out of the log.
pub const PER_SECOND: u32 = 20;

/// What becomes of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passage {
    /// It is told.
    Told,
    /// It is not told, but that there is more is told once.
    More,
    /// It is not told.
    Skipped,
}

/// Counts the events of one robot, a second at a time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Flood {
    begun: Option<Instant>,
    count: u32,
}

impl Flood {
    /// What becomes of an event.
    #[must_use]
    pub fn event(&mut self, now: Instant) -> Passage {
        if self.begun.is_none_or(|begun| now.since(begun) >= Duration::from_secs(1)) {
            (self.begun, self.count) = (Some(now), 0);
        }
        self.count = self.count.saturating_add(1);
        match self.count {
            ..=PER_SECOND => Passage::Told,
            count if count == PER_SECOND + 1 => Passage::More,
            _ => Passage::Skipped,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_that_flips_its_values_fills_no_log() {
        let mut flood = Flood::default();
        let mut told = [0; 3];
        // Three events each 20 ms, for ten seconds.
        for event in 0..1_500_u64 {
            let now = Instant::ORIGIN + Duration::from_millis(event / 3 * 20);
            told[flood.event(now) as usize] += 1;
        }
        assert_eq!(told, [200, 10, 1_290]);
        // After a pause all is told again.
        let later = Instant::ORIGIN + Duration::from_secs(60);
        assert!((0..PER_SECOND).all(|_| flood.event(later) == Passage::Told));
    }
}
