//! Runs programs: the gateway feeds the steps, and stops the arm when it must not go on.
//!
//! `POST /v1/robots/{name}/programs/run`:
//!
//! 1. [`Station::run`] looks whether the request came before (`run/answer.rs`), and takes the robot for the
//!    run (`core/seat/run.rs`).
//! 2. The store keeps the run and its intent. Nothing has left yet.
//! 3. A task of its own streams the steps with the client (`r6-client/src/stream.rs`). Before each list, the
//!    gate of `fleet/send.rs` asks the seat for a permit, and the client checks that again when it writes.
//! 4. The request is answered once the controller accepted the first list.
//! 5. If the seat cuts the run short, the task stops the arm and clears the list. `run/end.rs` says what
//!    became of the run. Only then the robot, and a lease that has ended meanwhile, are free.
//!
//! A list that may still run at a robot out of reach is stopped by `run/owed.rs`, as soon as the robot
//! answers again.

mod answer;
mod end;
mod owed;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::Duration;

use r6_api::Code;
use r6_api::gateway::{AuditRecord, Deed, Happened, Run, RunEnd, RunState};
use r6_client::{Motion, MotionError, MotionHandle, Progress, Robot, RunOptions};
use tokio::sync::oneshot;
use tokio::time::{Instant, timeout};

use self::answer::{again, keep_answer};
use self::end::{Ended, Halted, Outcome};
use super::station::{By, Station, by_itself};
use crate::clock;
use crate::core::library::ProgramName;
use crate::core::seat::{Cut, Key, Left, Ticket};
use crate::problem::Problem;
use crate::store::runs::{Begun, MAX_RUNS, MAX_RUNS_OF_ONE, NewRun};
use crate::store::{Author, StoreError};

/// How many steps are in the list of the controller at most. The arm finishes them if the gateway or the link
/// dies, so they are few.
const AHEAD: usize = 10;

/// How many steps one list has. Half of [`AHEAD`], so that the next list comes while the arm still moves.
const IN_ONE_LIST: usize = 5;

/// The time between two events about the progress of a run: readers follow it, and old events must not be
/// lost for it.
const TOLD_EVERY: Duration = Duration::from_secs(1);

/// How long the end of a run waits for the disk. Then the lease is freed, and the record follows.
const WRITE_WITHIN: Duration = Duration::from_secs(5);

/// After this time the end of a run is written again, if the disk failed: a disk that is full stays so for
/// minutes.
const WRITE_AGAIN: Duration = Duration::from_secs(1);

/// How long to wait for a run that was cut short: a stop takes 15 s at most, and [`WRITE_WITHIN`].
const FINISH_RUN: Duration = Duration::from_secs(21);

/// How often to look whether a run is over.
const FINISH_LOOK: Duration = Duration::from_millis(10);

/// A program to run.
#[derive(Debug)]
pub struct Wish {
    /// The lease.
    pub key: Key,
    /// Who asks: a token or a user.
    pub caller: String,
    /// The `Idempotency-Key` of the request.
    pub idempotency_key: String,
    /// SHA-256 of the request.
    pub hash: [u8; 32],
    /// The steps of all rounds.
    pub motion: Motion,
    /// The name and the version, if the gateway keeps the program.
    pub program: Option<(ProgramName, u64)>,
    /// SHA-256 of the text of the program.
    pub sha256: String,
    /// How often the program runs.
    pub repeat: u32,
}

/// A run under way.
struct UnderWay {
    robot: Robot,
    ticket: Ticket,
    by: By,
    run: Run,
    /// Where the answer to the request goes; `None` once it was given.
    answer: Option<oneshot::Sender<Result<Run, Problem>>>,
    /// When its progress was told last.
    told: Instant,
}

/// The robot is taken for a run. When this is dropped, it is free, also after a fault of the gateway.
struct Taken {
    station: Arc<Station>,
    ticket: Ticket,
    /// What the run leaves if it was not ended before.
    left: Left,
}

impl Drop for Taken {
    fn drop(&mut self) {
        let Self { station, ticket, left } = self;
        let was_ended = !station.seat(|seat, _| seat.end_run(*ticket, *left));
        let run = station.runs.borrow().clone();
        // Without a panic, the gateway ends here without order: the next start ends the run.
        let is_lost = !was_ended && *left != Left::Nothing && std::thread::panicking();
        let Some(run) = run.filter(|run| is_lost && run.state == RunState::Running) else { return };
        let detail = "a fault of the gateway ended the run: what was carried out is not known";
        let (run, record) = lost(run, RunEnd::OutcomeUnknown, detail);
        tracing::error!(robot = station.name(), run = run.run_id, detail, "a run ended");
        let (run_id, done) = (run.run_id, run.done);
        let (state, because) = (RunState::Unknown, RunEnd::OutcomeUnknown);
        station.runs.send_replace(Some(run.clone()));
        station.counts.count_run(state);
        station.publish(Happened::RunEnded { run_id, state, because, stopped_by: None, done });
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            let last = LastWrite { run, answer: None, owed: true, record };
            runtime.spawn(Arc::clone(station).keep_end(last));
        }
    }
}

/// What is written at the end of a run.
struct LastWrite {
    run: Run,
    /// The answer to the request, if it was not given before.
    answer: Option<Result<Run, (u64, Problem)>>,
    /// Whether the next start has to stop the robot, unless [`Station::forget_owed`] comes before.
    owed: bool,
    record: AuditRecord,
}

impl Station {
    /// Runs a program. Returns once the controller accepted the first list; the run goes on.
    ///
    /// # Errors
    /// `no_lease`, `stopped`, `not_ready`, `identity_changed`, `run_under_way`, `leftover_list`, `refused`,
    /// `bad_program`, `no_room`, `store_unavailable`, `outcome_unknown`; those of [`Self::answered_before`].
    pub async fn run(self: Arc<Self>, by: By, wish: Wish) -> Result<Run, Problem> {
        let hash = wish.hash;
        let turn = self.beginning.lock().await;
        if let Some(run) = self.answered_before(&wish.caller, &wish.idempotency_key, hash).await? {
            return Ok(run);
        }
        let taken = self.seat(|seat, now| seat.begin_run(now, wish.key));
        let ticket = taken.map_err(Problem::from).inspect_err(|problem| {
            self.note_refused(&by, "run a program", problem.code);
        })?;
        let mut taken = Taken { station: Arc::clone(&self), ticket, left: Left::Nothing };
        let (robot, begun, run) = self.begin(&by, &wish).await?;
        let run = match begun {
            Begun::New(run_id) => Run { run_id, ..run },
            Begun::Known(known) => return again(*known, hash),
            Begun::Full => {
                let message = format!(
                    "{MAX_RUNS_OF_ONE} runs of one robot, or {MAX_RUNS} of all, are kept for 24 h: there is no room for more"
                );
                return Err(Problem::new(Code::NoRoom, message));
            }
        };
        drop(turn);
        taken.left = Left::OutOfReach;
        let (answer, answered) = oneshot::channel();
        let run_id = run.run_id;
        let under_way = UnderWay { robot, ticket, by, run, answer: Some(answer), told: Instant::now() };
        self.shared.spawn(Arc::clone(&self).carry_out(taken, under_way, wish.motion));
        answered.await.unwrap_or_else(|_| {
            let message = format!("the gateway ends: what became of run {run_id} is not known");
            Err(Problem::new(Code::OutcomeUnknown, message))
        })
    }

    /// Keeps the run and its intent.
    async fn begin(&self, by: &By, wish: &Wish) -> Result<(Robot, Begun, Run), Problem> {
        let robot = self.robot();
        let robot = robot.ok_or_else(|| Problem::new(Code::NotReady, "there is no connection yet"))?;
        let time = clock::time_of_day();
        let (program, version) = wish.program.clone().unzip();
        let run = Run {
            run_id: 0,
            robot: self.name().to_owned(),
            state: RunState::Running,
            program: program.map(|name| name.to_string()),
            version,
            sha256: wish.sha256.clone(),
            repeat: wish.repeat,
            steps: wish.motion.len(),
            accepted: 0,
            done: 0,
            lease: wish.key.number,
            by: by.actor.clone(),
            began_at: time.clone(),
            ended_at: None,
            because: None,
            stopped_by: None,
            proof: None,
            detail: String::new(),
        };
        let new = NewRun {
            caller: wish.caller.clone(),
            key: wish.idempotency_key.clone(),
            hash: wish.hash,
            robot: self.robot_name().clone(),
            now: clock::seconds(),
            run: run.clone(),
            by: Author { time, actor: by.actor.clone(), source: by.source.clone() },
        };
        // What happened before stands before it in the audit log.
        self.write_pending().await?;
        let begun = self.term.keeper.begin_run(new).await?;
        Ok((robot, begun, run))
    }

    /// Carries a run out to its end, whatever that is.
    async fn carry_out(self: Arc<Self>, _taken: Taken, mut under_way: UnderWay, motion: Motion) {
        let UnderWay { robot, ticket, run, .. } = &under_way;
        let (robot, ticket) = (robot.clone(), *ticket);
        tracing::info!(robot = self.name(), run = run.run_id, steps = run.steps, by = run.by, "a run");
        self.runs.send_replace(Some(run.clone()));
        let program = run.program.clone();
        self.publish(Happened::RunBegan { run_id: run.run_id, program, steps: run.steps });
        // Until the end of the run no reading shows the effect of all lists.
        let sending = self.sending();
        let options = RunOptions {
            room: AHEAD,
            frame_instructions: IN_ONE_LIST,
            // This task stops the arm itself, and tells of it. The client does it only if this task is gone.
            stop_on_failure: false,
            stop_on_drop: true,
            ..RunOptions::default()
        };
        let connection = robot.connection();
        let gate = Self::gate(&self, ticket);
        let outcome = match self.guarded(&robot).run_under(&motion, options, gate).await {
            Ok(handle) => self.follow(&mut under_way, handle).await,
            Err(error) => Outcome::Ended(Err(error)),
        };
        let cut = self.seat(|seat, _| seat.cut(ticket));
        let halted = self.halt(&robot, connection, cut, &outcome).await;
        drop(sending);
        // An admin who takes the lease stops the robot a moment later.
        let stopped_by = self.seat(|seat, _| seat.run_stopped_by(ticket));
        let ended = Ended::of(outcome, cut, stopped_by, halted);
        // Before the disk has its turn: the robot may answer again meanwhile.
        self.seat(|seat, _| seat.leave(ticket, ended.left));
        self.end(under_way, ended).await;
    }

    /// Follows a run until it ends by itself or is cut short.
    async fn follow(&self, under_way: &mut UnderWay, mut handle: MotionHandle) -> Outcome {
        let mut progress = handle.watch();
        let mut cuts = self.cut.subscribe();
        let ticket = under_way.ticket;
        loop {
            let now = *progress.borrow_and_update();
            self.see(under_way, now);
            if now.accepted > 0 && under_way.answer.is_some() {
                self.answer(under_way);
            }
            if now.ended {
                break;
            }
            let cut = async {
                let cut = cuts.wait_for(|cut| cut.is_some_and(|(of, _)| of == ticket)).await;
                cut.ok().and_then(|cut| *cut)
            };
            tokio::select! {
                biased;
                cut = cut => match cut {
                    Some((_, Cut::Stop)) | None => break,
                    Some((_, cut)) if cut.is_in_reach() => {
                        let halted = self.stop_list(&under_way.robot).await;
                        let ended = handle.wait().await;
                        self.see(under_way, handle.progress());
                        return Outcome::Halted(ended, halted);
                    }
                    Some((_, _out_of_reach)) => {
                        let progress = handle.release().await;
                        self.see(under_way, progress);
                        return Outcome::Released(progress);
                    }
                },
                changed = progress.changed() => if changed.is_err() { break },
            }
        }
        // It has ended, or a stop that somebody else makes ends it.
        let ended = handle.wait().await;
        self.see(under_way, handle.progress());
        Outcome::Ended(ended)
    }

    /// Stops the arm after a run that ended early, unless it is proved that it stands, or the robot is out of
    /// reach.
    async fn halt(&self, robot: &Robot, connection: u64, cut: Option<Cut>, outcome: &Outcome) -> Halted {
        let error = match outcome {
            Outcome::Ended(Ok(_)) | Outcome::Halted(Ok(_), _) => return Halted::NotNeeded,
            Outcome::Halted(Err(_), halted) => return *halted,
            Outcome::Released(progress) if progress.left == 0 => return Halted::NotNeeded,
            Outcome::Released(_) => return Halted::OutOfReach,
            Outcome::Ended(Err(error)) if error.nothing_left() => return Halted::NotNeeded,
            Outcome::Ended(Err(error)) => error,
        };
        if let MotionError { stop: Some(stop), .. } = error
            && matches!(&**stop, Ok(report) if Halted::of(report) == Halted::Stands)
        {
            return Halted::Stands;
        }
        let answers = self.seat(|seat, _| seat.connection()) == Some(robot.connection());
        if !answers || robot.connection() != connection || cut.is_some_and(|cut| !cut.is_in_reach()) {
            return Halted::OutOfReach;
        }
        self.stop_list(robot).await
    }

    /// Stops the arm and clears the list, and tells of it. Unlike a stop of a person, it does not hold.
    async fn stop_list(&self, robot: &Robot) -> Halted {
        let by = by_itself();
        let sending = self.sending();
        self.publish(Happened::StopBegan { by: by.actor.clone(), holds: false, number: 0 });
        self.note(&by, Deed::StopBegan { request: "stop".to_owned() });
        let answer = robot.stop().await;
        drop(sending);
        let (halted, confirmed, detail) = match answer {
            Ok(report) => (Halted::of(&report), report.confirmed, report.to_string()),
            Err(error) => (Halted::OutOfReach, false, error.to_string()),
        };
        self.counts.count_stop(confirmed);
        tracing::warn!(robot = self.name(), confirmed, detail, "the list of a run was stopped");
        self.publish(Happened::StopEnded { confirmed });
        self.note(&by, Deed::Stop { request: "stop".to_owned(), confirmed, detail });
        halted
    }

    /// Takes in how far a run is.
    fn see(&self, under_way: &mut UnderWay, progress: Progress) {
        let Progress { accepted, done, ended, .. } = progress;
        let run = &mut under_way.run;
        let has_news = (run.accepted, run.done) != (accepted, done);
        (run.accepted, run.done) = (accepted, done);
        if !has_news {
            return;
        }
        self.runs.send_replace(Some(run.clone()));
        if !ended && under_way.told.elapsed() >= TOLD_EVERY {
            under_way.told = Instant::now();
            self.publish(Happened::RunProgress { run_id: run.run_id, accepted, done });
        }
    }

    /// Tells the caller that the run began. The store has that before. Nothing waits for it here, because a
    /// stop must not wait for the disk.
    fn answer(&self, under_way: &mut UnderWay) {
        let Some(to) = under_way.answer.take() else { return };
        let (keeper, answer) = (self.term.keeper.clone(), Ok(under_way.run.clone()));
        tokio::spawn(async move {
            // Without it, the same request is answered with `outcome_unknown` later.
            let kept = timeout(WRITE_WITHIN, keep_answer(&keeper, &answer)).await;
            if !matches!(kept, Ok(Ok(()))) {
                tracing::error!("the answer to the request for a run was not kept");
            }
            // The caller may have gone.
            let _ = to.send(answer.map_err(|(_, problem)| problem));
        });
    }

    /// Ends a run: the store has its end, then the robot is free.
    async fn end(self: &Arc<Self>, mut under_way: UnderWay, ended: Ended) {
        let Ended { state, because, stopped_by, proof, detail, left, problem } = ended;
        let run = &mut under_way.run;
        (run.state, run.because, run.proof) = (state, Some(because), proof);
        run.stopped_by.clone_from(&stopped_by);
        if state == RunState::Done {
            run.done = run.steps;
        }
        run.ended_at = Some(clock::time_of_day());
        run.detail.clone_from(&detail);
        let (run_id, done) = (run.run_id, run.done);
        tracing::info!(robot = self.name(), run = run_id, ?state, ?because, detail, "a run ended");
        self.counts.count_run(state);
        let deed = Deed::RunOutcome { run: run_id, state, because, done, detail };
        let record = self.record(&under_way.by, deed);
        let run = run.clone();
        let Problem { code, message, .. } = problem;
        let answer = if run.accepted > 0 || matches!(state, RunState::Done | RunState::Stopped) {
            Ok(run.clone())
        } else {
            Err((run_id, Problem::new(code, format!("{message} (run {run_id})"))))
        };
        let last = LastWrite {
            run: run.clone(),
            answer: under_way.answer.as_ref().map(|_| answer.clone()),
            owed: left != Left::Nothing,
            record,
        };
        // A task of its own goes on when the time is up: it has taken records out that wait to be written.
        let written = tokio::spawn(Arc::clone(self).keep_end(last));
        if timeout(WRITE_WITHIN, written).await.is_err() {
            tracing::error!(robot = self.name(), run = run_id, "the end of a run is not kept yet");
        }
        self.seat(|seat, _| {
            // A reader that learns of the end can begin the next run at once.
            self.runs.send_replace(Some(run));
            self.publish(Happened::RunEnded { run_id, state, because, stopped_by, done });
            seat.end_run(under_way.ticket, left);
        });
        if let Some(to) = under_way.answer.take() {
            let _ = to.send(answer.map_err(|(_, problem)| problem));
        }
    }

    /// Keeps the end of a run, again and again until the store takes it. A robot has few such tasks: no run
    /// begins while the store fails.
    async fn keep_end(self: Arc<Self>, last: LastWrite) {
        while let Err(error) = self.try_keep_end(&last).await {
            tracing::error!(robot = self.name(), run = last.run.run_id, %error, "the end of a run was not kept");
            if matches!(error, StoreError::Closed | StoreError::NotOwner) {
                // The next start, or the next owner, calls its outcome unknown.
                return;
            }
            tokio::time::sleep(WRITE_AGAIN).await;
        }
        if last.owed {
            self.forget_owed().await;
        }
    }

    async fn try_keep_end(&self, last: &LastWrite) -> Result<(), StoreError> {
        let LastWrite { run, answer, owed, record } = last;
        self.write_pending().await?;
        if let Some(answer) = answer {
            keep_answer(&self.term.keeper, answer).await?;
        }
        self.term.keeper.end_run(run.clone(), *owed, vec![record.clone()]).await
    }

    /// A run with its present progress.
    ///
    /// # Errors
    /// `store_unavailable`.
    pub async fn run_of(&self, number: u64) -> Result<Option<Run>, Problem> {
        let now = self.runs.borrow().clone().filter(|run| run.run_id == number);
        if now.is_some() {
            return Ok(now);
        }
        let kept = self.term.keeper.run(self.robot_name().clone(), number).await?;
        Ok(kept.map(|kept| kept.run))
    }

    /// The runs before this number, the newest first, with a run under way as it stands now.
    ///
    /// # Errors
    /// `store_unavailable`.
    pub async fn runs_before(&self, before: u64, most: usize) -> Result<Vec<Run>, Problem> {
        let robot = self.robot_name().clone();
        let kept = self.term.keeper.work(move |store| store.runs(&robot, before, most)).await?;
        // Looked at after the store, which can tell no later end than this.
        let now = self.runs.borrow().clone();
        let newest = |run: Run| now.clone().filter(|now| now.run_id == run.run_id).unwrap_or(run);
        Ok(kept.into_iter().map(newest).collect())
    }

    /// Gives the lease back, and waits until a run of it is stopped.
    ///
    /// # Errors
    /// `no_lease`; `not_stopped`.
    pub async fn give_back(&self, by: &By, key: Key) -> Result<(), Problem> {
        let had_run = self.seat(|seat, _| seat.has_run());
        self.release(by, key)?;
        if !had_run {
            return Ok(());
        }
        let over = self.run_is_over().await;
        let is_unknown = |run: &Run| run.lease == key.number && run.state == RunState::Unknown;
        if over && !self.runs.borrow().as_ref().is_some_and(is_unknown) {
            return Ok(());
        }
        let message = if self.seat(|seat, _| seat.owes_stop()) {
            "no stop reached the robot; it may finish its list, and is stopped as soon as it answers"
        } else {
            "the program was stopped, and it is not proved that the arm stands and its list is cleared: use the \
             emergency stop"
        };
        Err(Problem::new(Code::NotStopped, message))
    }

    /// Waits until no run has the robot. `false` if it is not over in time after it was cut short.
    pub async fn run_is_over(&self) -> bool {
        let over = async {
            while self.seat(|seat, _| seat.has_run()) {
                tokio::time::sleep(FINISH_LOOK).await;
            }
        };
        let in_time = timeout(FINISH_RUN, over).await.is_ok();
        if !in_time {
            tracing::warn!(robot = self.name(), "a run was cut short and did not end in time");
        }
        in_time
    }
}

/// The end of a run that was under way when the gateway was killed, and its record.
#[must_use]
pub fn killed(run: Run) -> (Run, AuditRecord) {
    let detail = "the gateway ended before the run: what was carried out is not known";
    lost(run, RunEnd::GatewayKilled, detail)
}

/// The end of a run whose outcome cannot be known, and its record.
fn lost(run: Run, because: RunEnd, detail: &str) -> (Run, AuditRecord) {
    let time = clock::time_of_day();
    let (state, detail) = (RunState::Unknown, detail.to_owned());
    let deed = Deed::RunOutcome { run: run.run_id, state, because, done: run.done, detail: detail.clone() };
    let (actor, robot) = ("gateway".to_owned(), Some(run.robot.clone()));
    let record = AuditRecord { time: time.clone(), actor, source: None, robot, deed };
    (Run { state, because: Some(because), ended_at: Some(time), detail, ..run }, record)
}
