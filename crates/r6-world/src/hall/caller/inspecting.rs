//! The inspector: it reads all robots, and shows at the end that everything works.

use std::time::Duration;

use r6_api::gateway::{Audit, AuditRecord, RobotState};
use tokio::time::{sleep, timeout};

use super::{Work, ms};
use crate::fault::{Class, Promise};
use crate::hall::{Hall, name_of, values};
use crate::shared::{State, now};

/// The gateway answers about a robot that is sound within this time, whatever the others do.
const ANSWERS_WITHIN: Duration = Duration::from_secs(1);

/// After the faults are over, everything must work again within this time, for each robot.
const RECOVERS_WITHIN: Duration = Duration::from_secs(45);

impl Work {
    /// Reads the robots in turn.
    pub(super) async fn inspect(&mut self) {
        while !self.is_over() {
            for robot in 0..self.robots() {
                self.look_at(robot).await;
                self.rest(150).await;
            }
        }
    }

    /// Reads a robot. Whether its values are fresh.
    async fn look_at(&mut self, robot: usize) -> bool {
        let asked = now();
        let is_sound = self.hall(|hall, _, at| hall.is_sound(robot, at)) == Some(true);
        let answer = self.ask("GET", &Self::path(robot, ""), None).await.ok();
        let heard = now();
        let told = answer.filter(|answer| answer.status == 200);
        let told: Option<RobotState> = told.and_then(|answer| serde_json::from_slice(&answer.body).ok());
        let is_fresh = told.as_ref().is_some_and(values::is_fresh);
        let mut state = self.shared.state();
        let State { hall, record, floors, .. } = &mut *state;
        if let Some(told) = &told {
            values::judge((asked, heard), (robot, told), &floors[robot], record);
        }
        // A gateway that was killed meanwhile may be well again.
        let is_well = |hall: &Hall| hall.is_sound(robot, heard) && hall.has_to_answer(asked, heard);
        let is_sound = is_sound && hall.as_ref().is_some_and(is_well);
        if is_sound {
            if self.shared.plan.hall.as_ref().is_some_and(|hall| hall.another_is_slow(robot, asked)) {
                record.strikes(Class::G1);
            }
            let took = heard - asked;
            record.check(Promise::I8, heard, is_fresh && took <= ANSWERS_WITHIN, || {
                format!("{}: fresh is {is_fresh}, and the answer took {took:?}", name_of(robot))
            });
        }
        is_fresh
    }

    /// Shows for each robot that its values are fresh, that its lease can be had, that a command is accepted
    /// and that a stop is confirmed; then that the audit log is whole.
    pub(super) async fn show_that_all_works(&mut self) {
        let is_ready = |state: &State| {
            let done = state.hall.as_ref().is_some_and(|hall| hall.is_done.iter().all(|done| *done));
            done && state.floors.iter().all(|floor| floor.is_seen_to)
        };
        while !is_ready(&self.shared.state()) {
            sleep(ms(50)).await;
        }
        for robot in 0..self.robots() {
            let begun = now();
            let worked = timeout(RECOVERS_WITHIN, self.show(robot)).await.unwrap_or(Err("not in time"));
            self.shared.check(Promise::Recovery, worked.is_ok(), || {
                format!("{}, since {begun:?}: {worked:?}", name_of(robot))
            });
        }
        let read = timeout(RECOVERS_WITHIN, self.read_log()).await.unwrap_or(Err("not in time".to_owned()));
        self.shared.check(Promise::I7, read.is_ok(), || format!("the audit log over HTTP: {read:?}"));
        self.hall(|hall, record, at| {
            hall.check_disk(at, record);
            let open = hall.open_intents();
            record.check(Promise::I12, at, open.is_empty(), || {
                format!("commands without an outcome: {open:?}")
            });
            hall.is_well = true;
        });
    }

    async fn show(&mut self, robot: usize) -> Result<(), &'static str> {
        let added = self.shared.plan.hall.as_ref().and_then(|hall| hall.added);
        if added == Some(robot) {
            // The engineer may have removed it.
            while !self.put_robot(robot).await.is_ok_and(|answer| answer.status < 300) {
                sleep(ms(500)).await;
            }
        }
        while !self.look_at(robot).await {
            sleep(ms(300)).await;
        }
        loop {
            let Some(lease) = self.acquire(robot, Some("the inspection")).await else {
                sleep(ms(500)).await;
                continue;
            };
            // A robot that was slow may still be about to answer.
            let works = self.clear(&lease).await && self.write(&lease).await == Some(200);
            if works && self.stop(robot).await && self.release(&lease).await {
                return Ok(());
            }
            sleep(ms(500)).await;
        }
    }

    /// Reads the whole audit log over HTTP: what it has is what the disk has.
    async fn read_log(&mut self) -> Result<(), String> {
        let mut told: Vec<AuditRecord> = Vec::new();
        loop {
            let after = told.len() as u64;
            let path = format!("/v1/audit?after={after}&limit=1000");
            let Ok(answer) = self.ask("GET", &path, None).await else {
                sleep(ms(500)).await;
                continue;
            };
            let page: Audit = serde_json::from_slice(&answer.body).map_err(|error| error.to_string())?;
            let is_last = page.next_after.is_none() || page.entries.is_empty();
            for entry in page.entries {
                let before = told.len() as u64;
                if entry.number != before + 1 {
                    return Err(format!("entry {} follows entry {before}", entry.number));
                }
                told.push(entry.record);
            }
            if is_last {
                return self.hall(|hall, _, _| hall.compare_log(&told)).unwrap_or(Ok(()));
            }
        }
    }
}
