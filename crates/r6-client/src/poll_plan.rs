//! Decides which addresses to ask for and when: pure, so that tests can set the time.

use std::time::Duration;

use r6_proto::address::{Address, AddressMap, Walk};
use r6_proto::time::Instant;

/// How much earlier an address may be asked for, at most: a slow one must not be asked for at the pace of a
/// fast one.
const LONGEST_SLACK: Duration = Duration::from_millis(50);

/// The pause before the retry of a poll that failed at once. A lost connection has its own backoff.
const RETRY_AFTER: Duration = Duration::from_millis(100);

/// When each address is due.
///
/// An address is due at the multiples of its period, counted from the origin. So equal periods and multiples
/// of each other coincide, whenever they began. An address that is due within less than a quarter of its
/// period, and less than 50 ms, is asked for together with the others.
#[derive(Debug, Default)]
pub(crate) struct PollPlan {
    rows: AddressMap<Row>,
}

#[derive(Clone, Copy, Debug)]
struct Row {
    every: Duration,
    due: Instant,
}

/// What to do now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Next {
    /// Ask for these, in one query if they fit.
    Ask(Vec<Address>),
    /// Do nothing before then.
    Wait(Instant),
    /// Do nothing at all.
    Idle,
}

impl PollPlan {
    /// Replaces the addresses and periods. A new address is due at once. An address with a shorter period
    /// than before is due no later than the new period says.
    pub fn replace(&mut self, wanted: &AddressMap<Duration>, now: Instant) {
        let row = |(address, every): (Address, &Duration)| {
            let every = *every;
            let due = match self.rows.get(address) {
                Some(row) => row.due.min(next_due(now, every)),
                None => now,
            };
            (address, Row { every, due })
        };
        self.rows = wanted.iter().map(row).collect();
    }

    /// The period of an address.
    pub fn every(&self, address: Address) -> Option<Duration> {
        self.every_of_next(&mut Walk::default(), address)
    }

    /// The period of the next address of a walk.
    pub fn every_of_next(&self, walk: &mut Walk, address: Address) -> Option<Duration> {
        self.rows.walk_to(walk, address).map(|row| row.every)
    }

    /// How many addresses there are.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// What to do now.
    pub fn next(&self, now: Instant) -> Next {
        match self.rows.iter().map(|(_, row)| row.due).min() {
            None => Next::Idle,
            Some(due) if due > now => Next::Wait(due),
            Some(_) => {
                let rides = |row: &Row| row.due <= now || row.due < now + slack(row.every);
                let mut asked = Vec::with_capacity(self.rows.len());
                asked.extend(self.rows.iter().filter(|(_, row)| rides(row)).map(|(address, _)| address));
                Next::Ask(asked)
            }
        }
    }

    /// These were asked for at `at`, and the answer is there at `now`. Polls missed in between are not made
    /// up for.
    pub fn answered(&mut self, asked: &[Address], at: Instant, now: Instant) {
        self.put_off(asked, |every| match next_due(at, every) {
            due if due > now => due,
            _ => next_due(now, every),
        });
    }

    /// These were asked for and not answered: ask again earlier than their period says.
    pub fn failed(&mut self, asked: &[Address], now: Instant) {
        self.put_off(asked, |every| now + RETRY_AFTER.min(every));
    }

    /// These were asked for, and their failure took time to show: ask again at once.
    pub fn lost(&mut self, asked: &[Address], now: Instant) {
        self.put_off(asked, |_| now);
    }

    /// Makes everything due now, because another robot may answer next.
    pub fn all_due(&mut self, now: Instant) {
        self.rows.iter_mut().for_each(|(_, row)| row.due = now);
    }

    fn put_off(&mut self, asked: &[Address], due: impl Fn(Duration) -> Instant) {
        let mut walk = Walk::default();
        for address in asked {
            if let Some(row) = self.rows.walk_to_mut(&mut walk, *address) {
                row.due = due(row.every);
            }
        }
    }
}

/// How much earlier than due an address may be asked for.
pub(crate) fn slack(every: Duration) -> Duration {
    (every / 4).min(LONGEST_SLACK)
}

/// The next multiple of the period that is too far away to be polled now. It is one period plus the slack
/// away at most.
pub(crate) fn next_due(now: Instant, every: Duration) -> Instant {
    let slack = u64::try_from(slack(every).as_nanos()).unwrap_or(u64::MAX);
    let every = u64::try_from(every.as_nanos()).unwrap_or(u64::MAX).max(1);
    let earliest = now.as_nanos().saturating_add(slack);
    Instant::from_nanos(earliest.div_ceil(every).saturating_mul(every))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use r6_proto::axis::AxisIndex;

    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn at(ms: u64) -> Instant {
        Instant::ORIGIN + Duration::from_millis(ms)
    }

    fn plan(wanted: &[(Address, u64)], now: Instant) -> PollPlan {
        let mut plan = PollPlan::default();
        plan.replace(&wanted.iter().map(|(address, every)| (*address, ms(*every))).collect(), now);
        plan
    }

    /// The queries from `from` to `until`, each with its time, by a controller whose replies take `takes`.
    fn queries(plan: &mut PollPlan, from: u64, until: u64, takes: u64) -> Vec<(u64, Vec<Address>)> {
        let mut now = at(from);
        let mut queries = Vec::new();
        while now < at(until) {
            match plan.next(now) {
                Next::Ask(asked) => {
                    queries.push((now.as_nanos() / 1_000_000, asked.clone()));
                    let asked_at = now;
                    now += ms(takes);
                    plan.answered(&asked, asked_at, now);
                }
                Next::Wait(until) => now = until,
                Next::Idle => break,
            }
        }
        queries
    }

    const MODE: Address = Address::CurMode;
    const ALARM: Address = Address::CurAlarm;
    const NAME: Address = Address::MachineName;

    #[test]
    fn equal_periods_ride_together_whenever_they_began() {
        let mut plan = plan(&[(MODE, 100)], at(3));
        assert_eq!(
            queries(&mut plan, 3, 230, 1).iter().map(|(at, _)| *at).collect::<Vec<_>>(),
            [3, 100, 200]
        );
        plan.replace(&[(MODE, ms(100)), (ALARM, ms(100))].into_iter().collect(), at(240));
        let both = vec![MODE, ALARM];
        let found = queries(&mut plan, 240, 510, 1);
        assert_eq!(found, [(240, vec![ALARM]), (300, both.clone()), (400, both.clone()), (500, both)]);
    }

    #[test]
    fn multiples_of_each_other_fall_together() {
        let mut plan = plan(&[(MODE, 50), (ALARM, 100), (NAME, 1000)], at(0));
        let found = queries(&mut plan, 0, 2000, 18);
        assert_eq!(found.len(), 40, "as many queries as the fastest alone needs");
        let asked = |address| found.iter().filter(|(_, asked)| asked.contains(&address)).count();
        assert_eq!((asked(MODE), asked(ALARM), asked(NAME)), (40, 20, 2));
    }

    #[test]
    fn what_is_due_soon_rides_along_and_nothing_else() {
        let mut plan = plan(&[(MODE, 100), (ALARM, 120), (NAME, 10_000)], at(0));
        plan.answered(&[MODE, ALARM, NAME], at(0), at(1));
        assert_eq!(plan.next(at(99)), Next::Wait(at(100)));
        assert_eq!(plan.next(at(100)), Next::Ask(vec![MODE, ALARM]));
        assert_eq!(plan.next(at(9950)), Next::Ask(vec![MODE, ALARM]));
        assert_eq!(plan.next(at(9951)), Next::Ask(vec![MODE, ALARM, NAME]));
    }

    #[test]
    fn a_slow_controller_is_not_asked_twice_for_what_was_missed() {
        let mut plan = plan(&[(MODE, 50)], at(0));
        let found = queries(&mut plan, 0, 1000, 170);
        let times: Vec<_> = found.iter().map(|(at, _)| *at).collect();
        assert_eq!(times, [0, 200, 400, 600, 800]);
    }

    #[test]
    fn a_failed_poll_is_tried_again_before_its_period_is_over() {
        let mut plan = plan(&[(NAME, 60_000), (MODE, 50)], at(0));
        plan.failed(&[NAME, MODE], at(7));
        assert_eq!(plan.next(at(7)), Next::Wait(at(57)));
        assert_eq!(plan.next(at(107)), Next::Ask(vec![MODE, NAME]));
    }

    #[test]
    fn a_shorter_period_takes_hold_at_once_and_nothing_wanted_is_nothing_asked() {
        let mut plan = plan(&[(NAME, 60_000)], at(0));
        plan.answered(&[NAME], at(0), at(1));
        plan.replace(&[(NAME, ms(100))].into_iter().collect(), at(30));
        assert_eq!(plan.next(at(30)), Next::Wait(at(100)));
        plan.all_due(at(31));
        assert_eq!(plan.next(at(31)), Next::Ask(vec![NAME]));
        plan.replace(&AddressMap::default(), at(32));
        assert_eq!(plan.next(at(32)), Next::Idle);
    }

    proptest! {
        /// For any periods: between two queries for an address lie two periods at most, and on average its
        /// period. There are never more queries than the addresses would need one by one.
        #[test]
        fn each_has_its_own_rate(periods in proptest::collection::vec(20_u64..500, 1..7), begun in 0_u64..10_000) {
            let wanted: Vec<_> =
                AxisIndex::ALL.into_iter().map(Address::Axis).zip(periods.iter().copied()).collect();
            let mut plan = plan(&wanted, at(begun));
            let found = queries(&mut plan, begun, begun + 10_000, 3);
            let mut alone = 0;
            for (address, every) in wanted {
                let times: Vec<_> =
                    found.iter().filter(|(_, asked)| asked.contains(&address)).map(|(at, _)| *at).collect();
                alone += times.len();
                for pair in times.windows(2) {
                    let gap = pair[1] - pair[0];
                    prop_assert!(gap > 0, "{address} every {every}: {gap}");
                    prop_assert!(gap <= 2 * every, "{address} every {every}: {gap}");
                }
                let expected = 10_000 / every;
                let count = times.len() as u64;
                prop_assert!(count + 2 >= expected * 9 / 10 && count <= expected * 11 / 10 + 2, "{count} of {expected}");
            }
            prop_assert!(found.len() <= alone);
        }
    }
}
