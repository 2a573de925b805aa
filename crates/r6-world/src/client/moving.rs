//! What a program does with the arm: it streams paths, follows targets, stops, and sends places that cannot
//! be reached.

use std::pin::pin;

use r6_client::units::{AxisPosition, Degrees, Percent};
use r6_client::{
    Command, FollowOptions, Motion, MotionHandle, OperationMode, RunOptions, Unmet, WaitOptions,
};
use tokio::time::{sleep, timeout};

use super::{Work, ms};
use crate::fault::{Class, Promise};
use crate::plan::Mishap;
use crate::shared::{State, now};

/// The maximum number of steps that one client numbers. A number is a thousandth of a degree of J2.
const MOST_STEPS: i64 = 6000;

/// The minimum distance between places of a path, in degrees of J1, so that they can be distinguished.
const APART: f64 = 0.15;

/// After this time in ms, a frame that was handed over has left or was withdrawn.
const HANDED_OVER: u64 = 10;

/// What happened to a motion whose handle the program has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Attended {
    /// The program knows how it ended.
    Ended,
    /// The program dropped the handle.
    Dropped,
}

impl Work {
    /// Moves again and again, in various ways.
    pub(super) async fn move_about(mut self) {
        while self.plan.moves && !self.is_over() {
            self.move_once().await;
            sleep(ms(60) + self.random.up_to(ms(200))).await;
        }
    }

    async fn move_once(&mut self) {
        if self.plan.mishap == Some(Mishap::StopsOthers) {
            return self.stop_others().await;
        }
        let robot = self.robot.clone();
        if self.random.strikes(0.1) {
            return self.send_without_a_look().await;
        }
        let Some(Ok(status)) = self.perhaps("the status", robot.status()).await else { return };
        let unmet = status.unmet();
        for unmet in &unmet {
            match unmet {
                Unmet::LeftoverList { .. } => drop(self.bounded("clearing", robot.clear_list()).await),
                Unmet::Alarm { .. } => {
                    drop(self.bounded("clearing", robot.command(Command::ClearAlarm)).await)
                }
                Unmet::Mode { found: OperationMode::Auto } if self.random.strikes(0.5) => self.start().await,
                Unmet::Mode { .. }
                | Unmet::NotHomed
                | Unmet::Moving
                | Unmet::OtherProgram
                | Unmet::Unknown { .. } => {}
            }
        }
        if !unmet.is_empty() {
            return;
        }
        match self.random.below(20) {
            0..13 => self.stream().await,
            13..17 => self.follow().await,
            _ => self.overreach().await,
        }
    }

    /// Creates a path of new steps.
    fn path(&mut self) -> Option<(Vec<i64>, Motion)> {
        let base = 1 + i64::try_from(self.place()).unwrap_or(0) * MOST_STEPS;
        let trap = self.shared.plan.trap;
        // For P10 the path fits in one list, so that the step that was not executed cannot be in the middle
        // of a path.
        let most = match trap {
            Some(Class::P10) => 3,
            Some(Class::E5) => 24,
            _ => 12,
        };
        let count = i64::try_from(3 + self.random.below(most)).unwrap_or(3);
        let with_tool = trap.is_some() && self.random.strikes(0.7);
        let first = {
            let mut state = self.shared.state();
            let line = &mut state.lines[self.index];
            line.next_step += count;
            if line.next_step >= MOST_STEPS {
                return None;
            }
            base + line.next_step - count
        };
        let steps: Vec<i64> = (first..first + count).collect();
        let mut motion = Motion::new();
        let mut places: Vec<f64> = Vec::new();
        for step in &steps {
            #[expect(clippy::cast_precision_loss, reason = "a small number")]
            let (mut j1, j2) = (self.random.below(30_000) as f64 / 1000.0, *step as f64 / 1000.0);
            // No two steps end at places that a client could confuse.
            while places.iter().any(|place| (place - j1).abs() < APART) {
                j1 += APART;
            }
            places.push(j1);
            self.shared.state().lines[self.index].targets.insert(*step, j1);
            let place = AxisPosition::degrees([j1, j2, 0.0, 0.0, 0.0, 0.0]);
            let speed = Percent::new([30.0, 60.0, 100.0][self.random.below(3)]).ok()?;
            motion = motion.axis_move(place, speed);
            if self.random.strikes(0.3) {
                motion = motion.blend(5);
            }
            if with_tool {
                motion = motion.tool(1);
            }
        }
        Some((steps, motion))
    }

    async fn stream(&mut self) {
        let Some((steps, mut motion)) = self.path() else { return };
        let trap = self.shared.plan.trap;
        if trap == Some(Class::P10) && self.random.strikes(0.5) {
            motion = motion.workbench(0);
        }
        let options = match trap {
            Some(Class::P10) => RunOptions::default(),
            _ => {
                RunOptions { frame_instructions: 1 + self.random.below(4), room: 6, ..RunOptions::default() }
            }
        };
        let run = self.shared.state().lines[self.index].run_begins(now(), &steps);
        // A step that moves nothing has no number.
        let unnumbered = u32::from(trap == Some(Class::P10));
        self.shared.state().lines[self.index].unnumbered += unnumbered;
        let robot = self.robot.clone();
        let mut is_dropped = false;
        if trap == Some(Class::E6) && self.random.strikes(0.4) {
            self.send_and_wait(&motion, &steps).await;
        } else if let Some(mishap) = self.plan.mishap {
            self.run_into(mishap, &motion, options, &steps).await;
        } else {
            is_dropped = match self.perhaps("a motion", robot.run(&motion, options)).await {
                Some(Ok(handle)) => self.attend(handle, &steps).await == Attended::Dropped,
                Some(Err(_)) => false,
                None => true,
            };
        }
        sleep(ms(HANDED_OVER)).await;
        let line = &mut self.shared.state().lines[self.index];
        line.unnumbered -= unnumbered;
        if is_dropped { line.run_is_dropped(run) } else { line.run_ends(run) }
    }

    /// Sends a list directly, and waits until it is done.
    async fn send_and_wait(&mut self, motion: &Motion, steps: &[i64]) {
        let (Ok(instructions), robot) = (motion.instructions(), self.robot.clone()) else { return };
        let begun = now();
        let looked = self.bounded("a look", robot.status()).await;
        // A program whose call was slow does not send a list based on an old status.
        if !looked.is_ok_and(|status| status.is_ready()) || now() - begun > self.plan.patience * 4 {
            return;
        }
        let list = instructions.get(..instructions.len().min(6)).unwrap_or_default();
        if self.bounded("a list", robot.add_rcc(true, list.to_vec())).await.is_err() {
            return;
        }
        let options = WaitOptions { timeout: ms(30_000), ..WaitOptions::default() };
        if let Ok(done) = self.bounded("the end of a list", robot.wait_until_done(options)).await {
            let sent = steps.get(..list.len()).unwrap_or_default();
            let is_whole = self.shared.state().floors[self.plan.robot].has_done(sent);
            self.shared.check(Promise::Whole, is_whole, || {
                format!("client-{}: {sent:?} are done, they say: moved {}", self.index, done.moved)
            });
        }
    }

    /// Waits for the end of a motion, stops it, drops it, or changes its speed.
    pub(super) async fn attend(&mut self, handle: MotionHandle, steps: &[i64]) -> Attended {
        let told: Vec<_> = (1..=steps.len()).filter_map(|step| handle.step(step)).collect();
        let after = ms(30) + self.random.up_to(ms(900));
        match self.random.below(20) {
            0..4 => {
                sleep(after).await;
                let stopped = self.bounded("a stop", handle.stop()).await;
                self.note_stop(stopped.as_ref().ok().map(|report| report.confirmed));
                // Long enough to see whether the arm stays at rest.
                sleep(ms(900)).await;
            }
            4..6 if self.plan.drops => {
                sleep(after).await;
                drop(handle);
                return Attended::Dropped;
            }
            turn => {
                if turn < 9 {
                    sleep(after).await;
                    self.change_speed().await;
                }
                let finished = self.bounded("a motion", handle.finished()).await;
                let at = now();
                let mut state = self.shared.state();
                let State { record, floors, lines, .. } = &mut *state;
                record.tally.motions[usize::from(finished.is_err())] += 1;
                let floor = &floors[self.plan.robot];
                match &finished {
                    Ok(_) => self.check_end(at, steps, floor, &lines[self.index], record),
                    Err(error) => record.tell(at, format_args!("client-{}: {error}", self.index)),
                }
                drop(state);
                if let Some(stop) = finished.err().and_then(|error| error.stop) {
                    self.note_stop(stop.ok().map(|report| report.confirmed));
                }
            }
        }
        self.compare(&told, steps);
        Attended::Ended
    }

    /// Changes the speed during the motion, or pauses and starts it. Restores everything at the end.
    async fn change_speed(&mut self) {
        let robot = self.robot.clone();
        if self.random.strikes(0.6) {
            for percent in [25.0, 100.0] {
                drop(self.bounded("a speed", robot.command(Command::ModifyGspd { percent })).await);
                sleep(ms(150)).await;
            }
        } else {
            drop(self.bounded("a pause", robot.command(Command::ActionPause)).await);
            sleep(ms(600)).await;
            self.start().await;
        }
    }

    /// Follows a moving target.
    async fn follow(&mut self) {
        let (target, targets) = r6_client::TargetSender::new();
        let wanted = self.random.below(40);
        let source = async move {
            for n in 0..20 {
                #[expect(clippy::cast_precision_loss, reason = "a small number")]
                let place = wanted as f64 + f64::from(n);
                target.send(AxisPosition::degrees([place]));
                sleep(ms(50)).await;
            }
        };
        let options = FollowOptions {
            largest_step: Degrees(5.0),
            while_moving: self.random.strikes(0.3),
            ..FollowOptions::default()
        };
        self.shared.state().lines[self.index].unnumbered += 1;
        let robot = self.robot.clone();
        let (mut source, mut has_told_all) = (pin!(source), false);
        let following = async {
            let mut follows = pin!(robot.follow(targets, options));
            loop {
                tokio::select! {
                    biased;
                    followed = &mut follows => return followed,
                    () = &mut source, if !has_told_all => has_told_all = true,
                }
            }
        };
        let followed = self.perhaps("following", following).await;
        if followed.is_some() && !has_told_all {
            source.await;
        }
        if let Some(followed) = &followed {
            self.shared.state().record.tally.motions[usize::from(followed.is_err())] += 1;
        }
        sleep(ms(HANDED_OVER)).await;
        self.shared.state().lines[self.index].unnumbered -= 1;
    }

    /// A careless program sends a list without reading the status first. The list is sent only if the status
    /// was already read on this connection.
    async fn send_without_a_look(&mut self) {
        self.send_blindly().await;
        sleep(ms(400)).await;
    }

    /// Sends such a list as soon as the client has reconnected, before or together with the read of the
    /// status there.
    pub(super) async fn be_hasty(mut self) {
        let mut news = self.shared.state().lines[self.index].news.subscribe();
        while self.plan.moves && !self.is_over() {
            // The program also ends if its robot does not come back.
            if matches!(timeout(ms(100), news.changed()).await, Ok(Ok(())))
                && self.shared.state().lines[self.index].is_free_to_be_hasty()
            {
                self.send_blindly().await;
            }
        }
    }

    async fn send_blindly(&mut self) {
        let Ok(speed) = Percent::new(50.0) else { return };
        let motion = Motion::new().axis_move(AxisPosition::degrees([12.0]), speed);
        let Ok(steps) = motion.instructions() else { return };
        self.shared.state().lines[self.index].unnumbered += 1;
        let robot = self.robot.clone();
        if let Some(sent) = self.perhaps("a list", robot.add_rcc(false, steps.to_vec())).await {
            self.count(&sent);
        }
        sleep(ms(HANDED_OVER)).await;
        self.shared.state().lines[self.index].unnumbered -= 1;
    }

    /// Sends a place twice, beyond a soft limit or within it. The motion ends with an alarm or at the place.
    async fn overreach(&mut self) {
        let beyond =
            AxisPosition::degrees([[160.0, -170.0, 10.0][self.random.below(3)], 0.0, 0.0, 0.0, 0.0, 0.0]);
        let Ok(speed) = Percent::new(80.0) else { return };
        let motion = Motion::new().axis_move(beyond, speed).axis_move(beyond, speed);
        let Ok(steps) = motion.instructions() else { return };
        self.shared.state().lines[self.index].unnumbered += 1;
        let robot = self.robot.clone();
        let sent = self.perhaps("a list", robot.add_rcc(true, steps.to_vec())).await;
        if let Some(sent) = &sent {
            self.count(sent);
        }
        sleep(ms(HANDED_OVER)).await;
        self.shared.state().lines[self.index].unnumbered -= 1;
        sleep(ms(800)).await;
    }

    /// Without faults, a motion comes to its end, and each of its steps is executed.
    pub(super) async fn move_to_the_end(&mut self) -> Result<(), String> {
        let Some((steps, motion)) = self.path() else { return Ok(()) };
        let run = self.shared.state().lines[self.index].run_begins(now(), &steps);
        let handle = self
            .robot
            .run(&motion, RunOptions::default())
            .await
            .map_err(|error| format!("a motion: {error}"))?;
        handle.finished().await.map_err(|error| format!("a motion: {error}"))?;
        let mut state = self.shared.state();
        state.lines[self.index].run_ends(run);
        state.record.tally.motions[0] += 1;
        if state.floors[self.plan.robot].has_done(&steps) {
            Ok(())
        } else {
            Err(format!("{steps:?} were not all done"))
        }
    }
}
