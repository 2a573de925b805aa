//! The order of the events of one robot.
//!
//! Readers go on behind the time of the last event that they have. So an event never stands before an event
//! that was noticed earlier: a reader who has the earlier one would miss it. An event that comes too late
//! stands at the time of the event before it, and keeps its own time beside it.

use r6_proto::time::Instant;

use super::event::Event;
use super::sample::Micros;

/// A difference above this is a clock that was set, as [`WallClock`](super::wall::WallClock) sees it: times
/// begin anew.
const STEP: i64 = 1_000_000;

/// How late an event of the journal can be, in µs: replies come within seconds. What is further back comes
/// from a clock that was set back, and times begin anew.
const MAX_LATE: i64 = 10_000_000;

/// Puts the events of one robot into their order as they are noticed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Turns {
    /// The last event: when, by the clock that does not jump, and where it stands.
    last: Option<(Instant, Micros)>,
}

impl Turns {
    /// The event, where it stands. `at`: its moment by the clock that does not jump.
    pub fn place(&mut self, at: Instant, event: Event) -> Event {
        let Some((last_at, last)) = self.last else {
            self.last = Some((at, event.time));
            return event;
        };
        // On the present scale: the clock may have been set meanwhile.
        let time = if at < last_at { event.time.after(last_at.since(at)).kept() } else { event.time };
        let ahead = last.0.saturating_sub(time.0);
        let stands = if (0..=STEP).contains(&ahead) { last } else { time };
        self.last = Some((at.max(last_at), stands));
        event.standing_at(stands)
    }
}

/// The event, where it stands behind an event that stands at `last`, if only times of day are known.
pub fn behind(last: Option<Micros>, event: Event) -> Event {
    match last {
        Some(last) if (1..=MAX_LATE).contains(&last.0.saturating_sub(event.time.0)) => {
            event.standing_at(last)
        }
        Some(_) | None => event,
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;
    use crate::core::history::event::Observed;

    fn at(ms: u64) -> Instant {
        Instant::ORIGIN + Duration::from_millis(ms)
    }

    fn event(time: i64) -> Event {
        Event::new(Micros(time), Observed::LinkLost {})
    }

    fn told(event: &Event) -> (i64, Option<i64>) {
        (event.time.0, event.true_time.map(|time| time.0))
    }

    #[test]
    fn a_late_event_stands_at_the_one_before_however_late_it_is() {
        let mut turns = Turns::default();
        let hours = 7_200_000;
        assert_eq!(told(&turns.place(at(hours), event(7_200_000_000))), (7_200_000_000, None));
        assert_eq!(told(&turns.place(at(0), event(0))), (7_200_000_000, Some(0)));
        assert_eq!(told(&turns.place(at(hours + 1), event(7_200_001_000))), (7_200_001_000, None));
    }

    #[test]
    fn a_clock_that_was_set_begins_anew_and_one_that_is_followed_does_not() {
        let mut turns = Turns::default();
        turns.place(at(1_000), event(100_000_000));
        assert_eq!(told(&turns.place(at(1_001), event(99_999_900))), (100_000_000, Some(99_999_900)));
        // It was set back by a minute. A late event stands at the last one, on the new scale.
        assert_eq!(told(&turns.place(at(2_000), event(41_000_000))), (41_000_000, None));
        assert_eq!(told(&turns.place(at(1_500), event(40_500_000))), (41_000_000, Some(40_500_000)));
    }

    #[test]
    fn without_a_steady_clock_a_jump_of_more_than_replies_take_begins_anew() {
        assert_eq!(told(&behind(None, event(5))), (5, None));
        assert_eq!(told(&behind(Some(Micros(7)), event(7))), (7, None));
        assert_eq!(told(&behind(Some(Micros(7)), event(5))), (7, Some(5)));
        let (last, first) = (Micros(MAX_LATE + 5), event(4));
        assert_eq!(told(&behind(Some(last), event(5))), (MAX_LATE + 5, Some(5)));
        assert_eq!(told(&behind(Some(last), first)), (4, None));
    }

    proptest! {
        /// While no clock is set, no event stands before an earlier one, and each tells its own time.
        #[test]
        fn no_event_stands_before_an_earlier_one(
            moments in prop::collection::vec((0..100_000_u64, -400..400_i64), 1..60),
        ) {
            let (mut turns, mut last) = (Turns::default(), Micros(i64::MIN));
            for (moment, drift) in moments {
                let own = Micros(i64::try_from(moment).unwrap() * 1000 + 1_000_000_000 + drift * 100);
                let placed = turns.place(at(moment), Event::new(own, Observed::LinkBack {}));
                prop_assert!(placed.time >= last);
                prop_assert_eq!(placed.true_time.unwrap_or(placed.time), own);
                last = placed.time;
            }
        }
    }
}
