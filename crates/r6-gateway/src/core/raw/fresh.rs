//! Which readings may answer a query after a command.

use std::time::Duration;

use r6_proto::time::Instant;

/// The greatest age of a reading that answers a query: a script that polls every 50 ms sees each change one
/// poll late at most.
pub const FRESH_FOR: Duration = Duration::from_millis(50);

/// When the last command of any client was answered, at one robot.
///
/// Without it a script could read `isMoving` 0 right after its command, from before the command, and take the
/// motion for done.
#[derive(Clone, Copy, Debug, Default)]
pub struct Freshness {
    /// How many commands and stops are under way.
    under_way: u32,
    /// When the last of them ended.
    ended_at: Option<Instant>,
}

impl Freshness {
    /// A command or a stop is about to leave.
    pub fn begins(&mut self) {
        self.under_way = self.under_way.saturating_add(1);
    }

    /// It was answered, or will not be.
    pub fn ends(&mut self, now: Instant) {
        self.under_way = self.under_way.saturating_sub(1);
        self.ended_at = self.ended_at.max(Some(now));
    }

    /// Whether a reading that was asked for then shows the effect of all commands: none is under way, and it
    /// was asked for after the last one was answered.
    #[must_use]
    pub fn shows_all(&self, asked_at: Instant) -> bool {
        self.under_way == 0 && self.ended_at.is_none_or(|ended_at| ended_at < asked_at)
    }

    /// Whether a reading that was asked for then may answer a query now.
    #[must_use]
    pub fn may_answer(&self, now: Instant, asked_at: Instant) -> bool {
        self.shows_all(asked_at) && now.since(asked_at) <= FRESH_FOR
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[derive(Clone, Debug)]
    enum Step {
        Wait(u64),
        Begins,
        Ends,
        Asks,
    }

    proptest! {
        /// Whatever the order of commands and readings: a reading that may answer is young, and no command
        /// was under way since it was asked for.
        #[test]
        fn no_reading_from_before_the_end_of_a_command_answers(steps in prop::collection::vec(prop_oneof![
            3 => (0..60_u64).prop_map(Step::Wait), 1 => Just(Step::Begins), 1 => Just(Step::Ends), 3 => Just(Step::Asks),
        ], 1..60)) {
            let mut now = Instant::ORIGIN + Duration::from_secs(1);
            let mut fresh = Freshness::default();
            let (mut under_way, mut busy_at, mut asked) = (0_u32, None, Vec::new());
            for step in steps {
                match step {
                    Step::Wait(ms) => now += Duration::from_millis(ms),
                    Step::Begins => {
                        fresh.begins();
                        under_way += 1;
                    }
                    Step::Ends if under_way > 0 => {
                        fresh.ends(now);
                        under_way -= 1;
                        busy_at = Some(now);
                    }
                    Step::Ends => {}
                    Step::Asks => asked.push(now),
                }
                for at in &asked {
                    let after_all = under_way == 0 && busy_at.is_none_or(|busy| busy < *at);
                    let young = now.since(*at) <= FRESH_FOR;
                    prop_assert_eq!(fresh.may_answer(now, *at), after_all && young);
                }
            }
        }
    }
}
