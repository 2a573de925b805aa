//! Mishaps of a program's motions: its connection becomes deaf, its output fails, or the owner of the motion
//! is interrupted.

use std::time::Duration;

use r6_client::{Motion, MotionHandle, RunOptions};
use tokio::time::{sleep, timeout};

use super::{Work, ms};
use crate::fault::{Class, Promise};
use crate::plan::Mishap;
use crate::shared::{State, now};

/// The longest path ends within this time in ms, unless something stops it.
const ENDS_WITHIN: u64 = 40_000;

/// Doubts at the time of a confirmed stop show within this time.
const LATEST: Duration = Duration::from_millis(4200);

/// A stop takes effect within this time if the first connection is deaf.
const STOPS_WITHIN: Duration = Duration::from_millis(1500);

impl Work {
    /// Streams a path, and applies the mishap to it.
    pub(super) async fn run_into(
        &mut self,
        mishap: Mishap,
        motion: &Motion,
        options: RunOptions,
        steps: &[i64],
    ) {
        let robot = self.robot.clone();
        match mishap {
            Mishap::StopsWhenDeaf => {
                let begun = self.bounded("a motion", robot.run(motion, options)).await;
                if let Ok(handle) = begun {
                    self.stop_when_deaf(handle, steps).await;
                }
            }
            // This one streams nothing.
            Mishap::StopsOthers => {}
            Mishap::Stopped => {
                if let Ok(handle) = self.bounded("a motion", robot.run(motion, options)).await {
                    self.stop_it(handle).await;
                }
            }
            Mishap::OutputFails => {
                let Ok(handle) = self.bounded("a motion", robot.run(motion, options)).await else { return };
                let begun = now();
                if self.prints_until_it_fails(&handle).await {
                    drop(handle);
                    self.is_without_owner(Class::E7, begun, steps).await;
                } else {
                    let _ends = self.attend(handle, steps).await;
                }
            }
            Mishap::Interrupted => {
                let begun = now();
                let patience = self.random.up_to(ms(150));
                let later = self.random.strikes(0.5).then(|| self.random.up_to(ms(900)));
                if let Ok(Ok(mut handle)) = timeout(patience, robot.run(motion, options)).await {
                    // Interrupts the wait for the end.
                    let waiting = timeout(later.unwrap_or(patience), handle.wait()).await;
                    if waiting.is_ok() {
                        return;
                    }
                }
                self.is_without_owner(Class::E8, begun, steps).await;
            }
        }
    }

    /// Stops a motion of another source, and waits long enough for the consequences to show.
    pub(super) async fn stop_others(&mut self) {
        self.start().await;
        sleep(ms(100) + self.random.up_to(ms(2500))).await;
        let stopped = self.bounded("a stop", self.robot.stop()).await;
        self.note_stop(stopped.as_ref().ok().map(|report| report.confirmed));
        sleep(LATEST).await;
    }

    /// Stops a motion at a random time, by its handle or by the robot, and waits long enough for the
    /// consequences to show.
    async fn stop_it(&mut self, handle: MotionHandle) {
        sleep(ms(30) + self.random.up_to(ms(2500))).await;
        let stopped = if self.random.strikes(0.5) {
            self.bounded("a stop", handle.stop()).await
        } else {
            let stopped = self.bounded("a stop", self.robot.stop()).await;
            drop(self.bounded("a motion", handle.finished()).await);
            stopped
        };
        self.note_stop(stopped.as_ref().ok().map(|report| report.confirmed));
        sleep(LATEST).await;
    }

    /// If the connection becomes deaf while the arm moves, stops the arm at once.
    async fn stop_when_deaf(&mut self, handle: MotionHandle, steps: &[i64]) {
        let is_deaf = || self.shared.state().floors[self.plan.robot].felt.is_in_force("half-open");
        for _ in 0..400 {
            if is_deaf() {
                break;
            }
            sleep(ms(10)).await;
        }
        if !is_deaf() {
            let _ends = self.attend(handle, steps).await;
            return;
        }
        // The fault takes effect with the next byte.
        sleep(ms(20)).await;
        let asked = now();
        self.shared.state().record.strikes(Class::E3);
        let (stopped, ()) = tokio::join!(self.bounded("a stop", handle.stop()), async {
            sleep(STOPS_WITHIN).await;
            let heard = self.shared.state().floors[self.plan.robot].last_stop();
            self.shared.check(Promise::Soon, heard >= asked, || {
                format!(
                    "client-{}: a stop asked for at {asked:?}, the last that was heard at {heard:?}",
                    self.index
                )
            });
        });
        self.note_stop(stopped.as_ref().ok().map(|report| report.confirmed));
        sleep(ms(900)).await;
    }

    /// Prints the progress line by line until a line cannot be written. Returns whether that happened before
    /// the end.
    async fn prints_until_it_fails(&mut self, handle: &MotionHandle) -> bool {
        let mut news = handle.watch();
        let fails = 1 + self.random.below(8);
        for _ in 0..fails {
            if !matches!(timeout(ms(2000), news.changed()).await, Ok(Ok(()))) {
                return false;
            }
        }
        true
    }

    /// Checks a motion that has lost its owner. Either a stop is sent, or all of its steps are executed. If
    /// none of it was sent, there is nothing to check.
    async fn is_without_owner(&mut self, class: Class, begun: Duration, steps: &[i64]) {
        let (lost, index, robot) = (now(), self.index, self.plan.robot);
        self.shared.state().record.strikes(class);
        let connections = self.shared.state().lines[index].connections();
        let mut still = 0;
        // Waits until the arm stands for a second and a half with an empty list.
        for _ in 0..ENDS_WITHIN / 50 {
            sleep(ms(50)).await;
            let rests = self.shared.state().floors[robot].rests_with_an_empty_list();
            still = if rests { still + 1 } else { 0 };
            if still >= 30 {
                break;
            }
        }
        let at = now();
        let mut state = self.shared.state();
        let State { record, lines, floors, .. } = &mut *state;
        let line = &lines[index];
        let is_excused = line.connections() != connections
            || floors[robot].last_alarm().is_some_and(|alarm| alarm >= begun);
        let left = steps.iter().any(|step| line.has_sent(*step));
        if is_excused || !left {
            return;
        }
        let is_stopped = line.last_stop.is_some_and(|stop| stop >= lost);
        let is_whole = floors[robot].has_done(steps);
        record.check(Promise::Owned, at, is_stopped || is_whole, || {
            let done = steps.iter().filter(|step| floors[robot].has_done(&[**step])).count();
            format!(
                "client-{index}: a motion of {} steps has no owner since {lost:?}; {done} were carried out, and no stop left",
                steps.len()
            )
        });
    }
}
