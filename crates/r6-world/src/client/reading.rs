//! What a program subscribes to and queries.

use std::time::Duration;

use r6_client::{Address, AxisIndex, Quality, Reading, Snapshot};
use tokio::time::{sleep, timeout};

use super::{Work, ms};
use crate::fault::Promise;
use crate::shared::{State, now};

impl Work {
    pub(super) async fn watch(self) {
        let addresses: Vec<_> = [Address::CurMode, Address::CurAlarm, Address::RemoteCmdLen]
            .into_iter()
            .chain(AxisIndex::ALL.into_iter().take(3).map(Address::Axis))
            .collect();
        let Ok(mut subscription) = self.robot.subscribe(&addresses, self.plan.every) else { return };
        loop {
            let news = timeout(self.plan.every * 2, subscription.next()).await;
            match news {
                Ok(Some(snapshot)) => self.check(&snapshot),
                Ok(None) => return,
                Err(_) => self.check(&subscription.latest()),
            }
        }
    }

    /// Checks that every value has an age and a quality. A fresh value must have come over the wire, and must
    /// match the machine.
    fn check(&self, snapshot: &Snapshot) {
        let at = now();
        let mut state = self.shared.state();
        let State { record, lines, floors, .. } = &mut *state;
        let liveness = self.robot.link_quality().state;
        for value in snapshot.values() {
            let fits = match value.quality {
                Quality::Fresh => {
                    value.reading.is_some() && value.age.is_some_and(|age| age <= self.plan.every + ms(1000))
                }
                Quality::Stale | Quality::Dead => value.reading.is_some() && value.age.is_some(),
                Quality::NotRead => value.reading.is_none() && value.age.is_none(),
                Quality::Unsupported | Quality::Unreadable(_) => value.reading.is_none(),
            };
            record.check(Promise::I5, at, fits, || format!("client-{}: {value:?}, {liveness:?}", self.index));
            let (Quality::Fresh, Some(reading), Some(age)) = (&value.quality, &value.reading, value.age)
            else {
                continue;
            };
            let may_be = lines[self.index].may_be_fresh(at.saturating_sub(age), at);
            record.check(Promise::Fresh, at, may_be, || {
                format!("client-{}: {value:?} is of no connection that is alive", self.index)
            });
            lines[self.index].delivered((value.address, reading), at.saturating_sub(age), at, record);
            let was = floors[self.plan.robot].was(value.address, reading, at.saturating_sub(age), at);
            if let Some(was) = was.filter(|_| self.robot_plan().tells_values) {
                record.check(Promise::I10, at, was, || {
                    format!(
                        "client-{}: {} is {reading} they say, {age:?} old, and was not",
                        self.index, value.address
                    )
                });
            }
        }
    }

    /// Queries values, different ones each time.
    pub(super) async fn ask(mut self) {
        let mut round: usize = 0;
        while self.plan.asks && !self.is_over() {
            let first = round % 3;
            let asked: Vec<_> = AxisIndex::ALL
                .into_iter()
                .skip(first)
                .take(3)
                .map(Address::Axis)
                .chain([Address::CurMode])
                .collect();
            let begun = now();
            let robot = self.robot.clone();
            if let Some(read) = self.perhaps("a query", robot.query(&asked)).await {
                self.count(&read);
                if let Ok(read) = read {
                    self.check_read(read.rows(), begun);
                }
            }
            round += 1;
            sleep(ms(90) + self.random.up_to(ms(200))).await;
        }
    }

    fn check_read(&self, rows: &[(Address, Result<Reading, r6_client::NoReading>)], begun: Duration) {
        let at = now();
        let mut state = self.shared.state();
        let State { record, lines, floors, .. } = &mut *state;
        for (address, reading) in rows {
            let Ok(reading) = reading else { continue };
            lines[self.index].delivered((*address, reading), begun, at, record);
            let was = floors[self.plan.robot].was(*address, reading, begun, at);
            if let Some(was) = was.filter(|_| self.robot_plan().tells_values) {
                record.check(Promise::I10, at, was, || {
                    format!("client-{}: {address} was not {reading}", self.index)
                });
            }
        }
    }
}
