//! Leases, commands, stops, and the acceptance of another robot.
//!
//! Everything here runs to its end even if its caller goes away: the callers of this module spawn it.
//! `command/recorded.rs` writes intent and outcome, and lets a request that comes twice act once.

mod recorded;

use std::time::Duration;

use r6_api::Code;
use r6_api::gateway::{
    ActedBy, AuditRecord, CommandDone, CommandOutcome, Deed, GlobalSpeed, Happened, Lease, LeaseKey,
    RobotIdentity, Stopped,
};
use r6_client::{Address, NotSent, OutcomeUnknown, RequestError, Robot};
use r6_proto::{Command, Effect};
use tokio::sync::Semaphore;
use tracing::Instrument;

pub use self::recorded::Once;
pub(super) use self::recorded::Told;
use super::link::to_client;
use super::send::Still;
use super::station::{By, MAX_COMMANDS, MAX_STOPS, Station, millis};
use crate::clock;
use crate::core::order::Order;
use crate::core::seat::{Ask, Denied, Granted, Key, Secret, SpeedAnswer};
use crate::problem::Problem;
use crate::{secret, traces};

/// How many characters of a refused request are noted: the longest command of the manual fits in.
const MAX_REQUEST: usize = 100;

/// How long a stop waits for a connection, if there never was one. Longer than an attempt to connect.
const CONNECT_FOR_STOP: Duration = Duration::from_secs(4);

/// How long to wait for commands that are under way. Longer than a reply may take.
const FINISH_COMMANDS: Duration = Duration::from_secs(3);

/// How long to wait for stops that are under way. Longer than one takes: [`CONNECT_FOR_STOP`] and 15 s of the
/// client.
const FINISH_STOPS: Duration = Duration::from_secs(20);

/// How often to look whether commands and stops have ended.
const FINISH_LOOK: Duration = Duration::from_millis(10);

/// How the audit log calls a stop that is more than one command.
const STOP: &str = "stop";

/// What a person has to know if there is no way to the robot.
const NO_CONNECTION: &str =
    "the arm was NOT stopped: there is no connection to this robot; use the emergency stop";

/// What a person has to know if nothing more can be done.
const USE_EMERGENCY_STOP: &str = "it is not known that the arm stands; use the emergency stop";

impl Station {
    /// Gives out the lease if it is free.
    ///
    /// # Errors
    /// `leased`, `identity_changed`, `not_ready`, `store_unavailable`.
    pub async fn acquire(&self, by: &By, lasts: Duration) -> Result<Lease, Problem> {
        let granted = self.acquire_now(by, lasts).await?;
        Ok(self.given(granted))
    }

    /// The same for a caller in the gateway: the key of the lease.
    ///
    /// # Errors
    /// As [`Self::acquire`].
    pub(crate) async fn acquire_key(&self, by: &By, lasts: Duration) -> Result<Key, Problem> {
        Ok(self.acquire_now(by, lasts).await?.key)
    }

    async fn acquire_now(&self, by: &By, lasts: Duration) -> Result<Granted, Problem> {
        let ask = ask(by, lasts)?;
        let granted = self.seat_noting(|seat, now| {
            let granted = seat.acquire(now, ask);
            let record = granted.as_ref().ok().map(|granted| self.lease_began(by, granted, None));
            (granted, record)
        })?;
        self.keep_granted(granted).await
    }

    /// Takes the lease from its holder: the robot is stopped first. The stop holds afterwards.
    ///
    /// # Errors
    /// `leased` if another admin takes it, `identity_changed`, `store_unavailable`.
    pub async fn take(&self, by: &By, lasts: Duration, because: String) -> Result<Lease, Problem> {
        let ask = ask(by, lasts)?;
        self.seat(|seat, now| seat.begin_taking(now))?;
        // An unconfirmed stop holds all the same, so nothing moves before somebody has looked.
        let _ = self.stop(by).await;
        self.run_is_over().await;
        let granted = self.seat_noting(|seat, now| {
            let granted = seat.end_taking(now, ask);
            let record = granted.as_ref().ok().map(|granted| self.lease_began(by, granted, Some(because)));
            (granted, record)
        })?;
        let granted = self.keep_granted(granted).await?;
        Ok(self.given(granted))
    }

    /// Lets the lease last longer.
    ///
    /// # Errors
    /// `no_lease`.
    pub fn renew(&self, key: Key, lasts: Duration) -> Result<Lease, Problem> {
        let granted = self.seat(|seat, now| seat.renew(now, key, lasts))?;
        Ok(self.given(granted))
    }

    /// Gives the lease back. A run of it is cut short: [`Self::run_is_over`] waits for that.
    ///
    /// # Errors
    /// `no_lease`.
    pub fn release(&self, by: &By, key: Key) -> Result<(), Problem> {
        Ok(self.release_by(by, key)?)
    }

    fn lease_began(&self, by: &By, granted: &Granted, taken_because: Option<String>) -> AuditRecord {
        self.record(by, Deed::LeaseBegan { lease: granted.key.number, taken_because })
    }

    /// A lease counts only after its number and its record are on the disk: the number must not be given out
    /// again.
    async fn keep_granted(&self, granted: Granted) -> Result<Granted, Problem> {
        let kept = async {
            self.save().await?;
            self.write_pending().await
        };
        if let Err(error) = kept.await {
            let _ = self.seat(|seat, now| seat.release(now, granted.key));
            return Err(error.into());
        }
        // An admin can have taken it while the disk was slow.
        let (number, now_held) = (granted.key.number, self.seat(|seat, now| seat.lease(now)));
        if now_held.is_none_or(|lease| lease.number != number) {
            // A gateway that has lost the robots gives out no other one either.
            self.term.ownership.check()?;
            let message = format!("lease {number} ended before the disk had it: acquire another one");
            return Err(Problem::new(Code::NoLease, message));
        }
        Ok(granted)
    }

    fn given(&self, granted: Granted) -> Lease {
        let (stopped, left) = self.seat(|seat, now| (seat.stops().0, granted.until.since(now)));
        let secret = granted.key.secret.0.iter().map(|byte| format!("{byte:02x}")).collect();
        let lease = LeaseKey { number: granted.key.number, secret };
        Lease { lease, expires_in_ms: millis(left), stopped }
    }

    /// Sends a command or a list that changes or moves. Its intent is on the disk before it leaves, its
    /// outcome after. With `once`, a request that came before gets the answer of then, and nothing is sent.
    /// With `still`, it does not leave once that does not hold any more.
    ///
    /// # Errors
    /// `no_lease`, `stopped`, `not_ready`, `identity_changed`, `leftover_list`, `refused`, `overloaded`,
    /// `store_unavailable`, `outcome_unknown`; those of [`Self::commanded_before`].
    pub async fn command(
        &self,
        by: &By,
        key: Key,
        order: Order,
        run_leftover: bool,
        once: Option<&Once>,
        still: Option<Still>,
    ) -> Result<CommandDone, Problem> {
        let sent = order.to_string();
        let span = traces::of_command(self.name(), &sent);
        let done = self.try_command(by, key, order, run_leftover, once, still).instrument(span.clone()).await;
        if let Err((problem, Told::No)) = &done {
            span.in_scope(|| traces::note_outcome(None, problem.code.word(), true));
            self.note_refused(by, &sent, problem.code);
        }
        done.map_err(|(problem, _)| problem)
    }

    async fn try_command(
        &self,
        by: &By,
        key: Key,
        order: Order,
        run_leftover: bool,
        once: Option<&Once>,
        still: Option<Still>,
    ) -> Result<CommandDone, (Problem, Told)> {
        let untold = |problem: Problem| (problem, Told::No);
        let _slot = self.commands.try_acquire().map_err(|_| {
            untold(Problem::new(Code::Overloaded, "too many commands of this robot are under way"))
        })?;
        let effect = order.effect();
        let asked = self.seat(|seat, now| seat.check_order(now, key, &order).map(|()| seat.asked(now)));
        let asked = asked.map_err(|denied| untold(denied.into()))?;
        let robot = self.robot.borrow().clone();
        let robot =
            robot.ok_or_else(|| untold(Problem::new(Code::NotReady, "there is no connection yet")))?;
        if order.runs_leftover() && !run_leftover {
            check_list(&robot).await.map_err(untold)?;
        }

        let sent = order.to_string();
        let percent = order.global_speed();
        let send = async {
            // What was true before the disk had its turn may not be true any more.
            let permit = self.seat(|seat, now| seat.permit(now, key, order));
            let permit = permit.and_then(|permit| asked.admit(clock::now(), permit));
            let permit = permit.map_err(|denied| (CommandOutcome::NotSent, denied.into()))?;
            let _sending = self.sending();
            let answer = self.send(&robot, permit, still.clone()).await;
            answer.map_err(|error| {
                let ended = still.filter(|still| !still.holds());
                let problem = match (&error, ended) {
                    (RequestError::NotSent(NotSent::Withdrawn), Some(still)) => {
                        Problem::new(Code::NotAllowed, still.otherwise)
                    }
                    (error, _) => self.problem_of(error, key, effect),
                };
                (outcome(&error), problem)
            })
        };
        let send = self.noting_speed(by, percent, send);
        match once {
            Some(once) => self.recorded_once(by, sent, key.number, once, send).await,
            None => {
                let (command_id, accepted) = self.recorded(by, &sent, key.number, send).await?;
                let after_ms = clock::milliseconds(accepted.after);
                Ok(CommandDone { command_id: Some(command_id), sent, after_ms })
            }
        }
    }

    /// Sends a command, and notes the global speed in percent that it sets, if it does.
    async fn noting_speed<T>(
        &self,
        by: &By,
        percent: Option<f64>,
        send: impl Future<Output = Result<T, (CommandOutcome, Problem)>>,
    ) -> Result<T, (CommandOutcome, Problem)> {
        let Some(percent) = percent else { return send.await };
        self.seat(|seat, _| seat.speed_leaves());
        let answer = send.await;
        let failed = answer.as_ref().err().map(|(outcome, _)| *outcome);
        self.seat(|seat, _| seat.speed_answered(speed_answer(by, percent, failed)));
        answer
    }

    /// The problem of a command that failed. If it was taken back, the seat knows why.
    fn problem_of(&self, error: &RequestError, key: Key, effect: Effect) -> Problem {
        let (checked, stopped) = self.seat(|seat, now| (seat.check(now, key, effect), seat.stops().0));
        match (error, checked) {
            (RequestError::NotSent(_), Err(denied)) => denied.into(),
            // A stop began and ended meanwhile, or the connection is another one.
            (RequestError::NotSent(NotSent::Withdrawn), Ok(())) if stopped => Denied::Stopped.into(),
            (_, _) => Problem::of_request(error),
        }
    }

    /// Stops the robot until it is proved that the arm stands. It needs no lease, and holds until the holder
    /// of the lease clears it.
    ///
    /// # Errors
    /// `not_stopped`.
    pub async fn stop(&self, by: &By) -> Result<Stopped, Problem> {
        self.stop_and_prove(by).instrument(traces::of_command(self.name(), STOP)).await
    }

    async fn stop_and_prove(&self, by: &By) -> Result<Stopped, Problem> {
        let sending = self.sending();
        let written = self.is_stop_written(by, STOP);
        self.begin_stop(by, STOP, written);
        let answer = match self.stops.try_acquire() {
            Ok(_place) => match self.connected().await {
                Some(robot) => robot.stop().await.map_err(|error| error.to_string()),
                None => Err(NO_CONNECTION.to_owned()),
            },
            Err(_) => Err(format!("{MAX_STOPS} stops of this robot are under way: {USE_EMERGENCY_STOP}")),
        };
        drop(sending);
        let seen_at = clock::time_of_day();
        let stopped = match answer {
            Ok(report) if report.confirmed => Ok((report.took, report.to_string())),
            Ok(report) => Err(report.to_string()),
            Err(message) => Err(message),
        };
        let detail = match &stopped {
            Ok((_, detail)) | Err(detail) => detail.clone(),
        };
        self.end_stop(by, STOP, (stopped.is_ok(), detail), written);
        let (took, _) = stopped.map_err(|message| Problem::new(Code::NotStopped, message))?;
        Ok(Stopped { confirmed: true, took_ms: clock::milliseconds(took), seen_at })
    }

    /// Sends one command that stops or pauses. It needs no lease, and holds as [`Self::stop`] does.
    ///
    /// `written`: whether the audit log and the events tell it.
    ///
    /// # Errors
    /// `refused`, `not_ready`, `identity_changed`, `overloaded`, `outcome_unknown`.
    pub async fn stop_command(
        &self,
        by: &By,
        command: Command<'static>,
        written: bool,
    ) -> Result<CommandDone, Problem> {
        let word = command.name().word();
        let span = traces::of_command(self.name(), word);
        self.send_stop_command(by, command, written).instrument(span).await
    }

    async fn send_stop_command(
        &self,
        by: &By,
        command: Command<'static>,
        written: bool,
    ) -> Result<CommandDone, Problem> {
        let (word, sent) = (command.name().word(), command.to_string());
        let sending = self.sending();
        self.begin_stop(by, word, written);
        let answer = match self.stop_commands.try_acquire() {
            Ok(_place) => match self.connected().await {
                Some(robot) => robot.command(command).await.map_err(|error| Problem::of_request(&error)),
                None => Err(Problem::new(Code::NotReady, NO_CONNECTION)),
            },
            Err(_) => {
                let message = format!("{MAX_STOPS} commands that stop this robot are under way");
                Err(Problem::new(Code::Overloaded, message))
            }
        };
        drop(sending);
        let detail = answer.as_ref().err().map(|problem| problem.message.clone()).unwrap_or_default();
        self.end_stop(by, word, (answer.is_ok(), detail), written);
        let after_ms = clock::milliseconds(answer?.after);
        Ok(CommandDone { command_id: None, sent, after_ms })
    }

    /// A stop holds before anything is sent. The audit log is told soon: a stop does not wait for the disk.
    pub(super) fn begin_stop(&self, by: &By, request: &str, written: bool) {
        self.seat_noting(|seat, _| {
            seat.stop_begins();
            seat.name_stop(&by.acts());
            let record = written.then(|| {
                let number = seat.stop_is_told();
                self.publish(Happened::StopBegan { by: by.actor.clone(), holds: true, number });
                self.record(by, Deed::StopBegan { request: request.to_owned() })
            });
            ((), record)
        });
    }

    pub(super) fn end_stop(
        &self,
        by: &By,
        request: &str,
        (confirmed, detail): (bool, String),
        written: bool,
    ) {
        self.seat(|seat, _| seat.stop_ends());
        self.counts.count_stop(confirmed);
        traces::note_outcome(None, if confirmed { "confirmed" } else { "not_confirmed" }, !confirmed);
        // A stop before it may have been confirmed. That this one is not has to stand in the log too.
        let is_news = !confirmed && self.is_first_unconfirmed(by, request);
        if written || is_news {
            tracing::warn!(robot = self.name(), request, confirmed, by = %by.actor, "a stop");
            self.publish(Happened::StopEnded { confirmed });
            self.note(by, Deed::Stop { request: request.to_owned(), confirmed, detail });
        }
    }

    /// The client's handle. If there never was a connection, an attempt is made at once.
    async fn connected(&self) -> Option<Robot> {
        let mut robot = self.robot.subscribe();
        let now = robot.borrow().clone();
        if now.is_some() {
            return now;
        }
        self.try_now.notify_one();
        let there = tokio::time::timeout(CONNECT_FOR_STOP, robot.wait_for(Option::is_some)).await;
        there.ok()?.ok()?.clone()
    }

    /// Lets the robot move again after a stop. `seen`: how many stops the caller was told of; `None` clears
    /// any.
    ///
    /// # Errors
    /// `no_lease`; `stopped` while a stop is under way, or if one has begun since.
    pub fn clear(&self, by: &By, key: Key, seen: Option<u64>) -> Result<(), Problem> {
        // Told before the seat is free: a stop that begins next is told behind it.
        let cleared = self.seat_noting(|seat, now| {
            let cleared = seat.clear(now, key, seen);
            let record = cleared.as_ref().ok().map(|()| {
                self.publish(Happened::StopCleared {});
                self.record(by, Deed::StopCleared { lease: key.number })
            });
            (cleared, record)
        });
        cleared.map_err(|denied| {
            let problem = Problem::from(denied);
            self.note_refused(by, "clear-stopped", problem.code);
            problem
        })
    }

    /// From now on this name stands for the robot that answers.
    ///
    /// # Errors
    /// `identity_changed`: this is not the robot that answers; `store_unavailable`.
    pub async fn accept_identity(&self, by: &By, accepted: RobotIdentity) -> Result<(), Problem> {
        let owed = self.seat(|seat, _| {
            let owed = seat.owes_stop();
            seat.accept_identity(&accepted)?;
            // Before a reading of this robot counts: an alarm of the other one does not go on.
            self.replace_alarms();
            Ok::<_, Denied>(owed)
        })?;
        let robot = self.robot.borrow().clone();
        if let Some(robot) = robot {
            robot.accept_identity(to_client(&accepted));
        }
        self.try_now.notify_one();
        self.publish(Happened::IdentityAccepted { identity: accepted.clone() });
        let deed = Deed::IdentityAccepted { identity: accepted };
        if let Err(error) = self.append(self.record(by, deed.clone())).await {
            self.note(by, deed);
            return Err(error.into());
        }
        // Before the identity: otherwise an acknowledgement could pass to this robot after a kill.
        self.save_alarms().await?;
        self.save().await?;
        if owed {
            self.forget_owed().await;
        }
        Ok(())
    }

    /// Notes that a request was refused: once a minute for each caller, source and request, so that a script
    /// in a loop does not fill the disk. Of a long request the begin is noted.
    pub fn note_refused(&self, by: &By, request: &str, code: Code) {
        let request: String = request.chars().take(MAX_REQUEST).collect();
        if self.is_first_in_a_minute(by, &request) {
            self.note(by, Deed::Refused { request, code });
        }
    }

    /// Whether a stop of this caller has to be written and published: one a minute, and each that is the
    /// first to hold. An unconfirmed stop is also written for its own sake ([`Self::end_stop`]). A script
    /// that stops a stopped robot again and again must not fill the disk, nor push the events of other
    /// robots out.
    pub fn is_stop_written(&self, by: &By, request: &str) -> bool {
        let is_first = self.is_first_in_a_minute(by, request);
        is_first || !self.seat(|seat, _| seat.stops().0)
    }

    /// Waits until no command is under way, as long as one may take.
    pub(super) async fn finish_commands(&self) {
        finish(&self.commands, MAX_COMMANDS, FINISH_COMMANDS).await;
    }

    /// Waits until no stop is under way, as long as one may take.
    pub(super) async fn finish_stops(&self) {
        let stops = finish(&self.stops, MAX_STOPS, FINISH_STOPS);
        tokio::join!(stops, finish(&self.stop_commands, MAX_STOPS, FINISH_STOPS));
    }
}

/// Waits until all places are free. It does not take them: a stop must still get one.
async fn finish(places: &Semaphore, all: u32, within: Duration) {
    let free = async {
        while places.available_permits() < all as usize {
            tokio::time::sleep(FINISH_LOOK).await;
        }
    };
    if tokio::time::timeout(within, free).await.is_err() {
        tracing::warn!("a command or a stop did not end in time");
    }
}

fn ask(by: &By, lasts: Duration) -> Result<Ask, Problem> {
    let mut bytes = [0; 16];
    secret::fill(&mut bytes)
        .map_err(|error| Problem::new(Code::StoreUnavailable, format!("no random numbers: {error}")))?;
    Ok(Ask { holder: by.actor.clone(), lasts, secret: Secret(bytes) })
}

/// What became of a command that sets the global speed. `failed`: how, if it was not accepted.
fn speed_answer(by: &By, percent: f64, failed: Option<CommandOutcome>) -> SpeedAnswer {
    match failed {
        None | Some(CommandOutcome::Accepted) => {
            let ActedBy { by, at } = by.acts();
            SpeedAnswer::Set(GlobalSpeed { percent, by, at })
        }
        Some(CommandOutcome::NotSent | CommandOutcome::Refused) => SpeedAnswer::Unchanged,
        Some(CommandOutcome::Unknown) => SpeedAnswer::Unknown,
    }
}

pub(super) fn outcome(error: &RequestError) -> CommandOutcome {
    match error {
        RequestError::Invalid(_) | RequestError::NotSent(_) => CommandOutcome::NotSent,
        RequestError::Refused(_) => CommandOutcome::Refused,
        RequestError::OutcomeUnknown(_) => CommandOutcome::Unknown,
    }
}

/// Refuses if instructions are left in the list. Passes if the firmware does not tell its length.
pub(super) async fn check_list(robot: &Robot) -> Result<(), Problem> {
    let read = robot.query(&[Address::RemoteCmdLen]).await.map_err(|error| match error {
        RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { .. }) => {
            Problem::new(Code::IdentityChanged, error.to_string())
        }
        error => Problem::new(Code::NotReady, error.to_string()),
    })?;
    let left = match read.left_in_list() {
        Ok(None | Some(0)) => return Ok(()),
        Ok(Some(left)) => format!("{left} left in the instruction list"),
        Err(error) => format!("what is left in the instruction list cannot be read ({error})"),
    };
    let message =
        format!("{left}, and the arm would run the list: a stop clears it, `\"run_leftover\": true` runs it");
    Err(Problem::new(Code::LeftoverList, message))
}
