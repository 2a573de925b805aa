//! Stopping: tries one means after the other until it is proved that the arm stands, and removes what could
//! restart it.
//!
//! A stop is an errand ([`crate::errands`]): once begun, it runs to its end even if its caller is dropped.
//!
//! ```text
//!  actionStop ─▶ watch over this connection (stop/halt.rs) ─proved─▶ clear list ─▶ wait out doubts ─▶ report
//!    └─ nothing for 300 ms ─▶ the same over a second connection ─proved─▲    (frames still unanswered)
//! ```
//!
//! `evidence/standstill.rs` says what proves a standstill.
//!
//! # A stop
//!
//! `robot.stop()`:
//!
//! 1. This file starts an errand that carries the stop to its end.
//! 2. `stop/halt.rs` sends one means after the other over one connection, and reads the state all the time.
//! 3. If nothing comes back within 300 ms, this file does the same over a second connection
//!    (`Robot::second_connection`).
//! 4. After a reconnect, a stop waits for the identity of the controller, for half a second at most
//!    (`Link::holds_stops`, `link/identification.rs`).
//! 5. Requests that were made before the stop and were not sent are withdrawn (`Link::withdraw_overtaken`).
//! 6. `doubt.rs` knows which frames the controller may still carry out. `stop/report.rs` tells the caller
//!    what became of all that.

mod halt;
pub(crate) mod report;
pub(crate) mod stopping;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use r6_proto::OperationMode;
use r6_proto::message::Command;
use r6_proto::time::Instant;

use crate::error::{Invalid, NotSent, OutcomeUnknown, Refused, RequestError};
use crate::job::{Terms, Work};
use crate::link::Lane;
use crate::pushed::LostReason;
use crate::robot::Robot;
use crate::stop::halt::{Halt, Halted};
pub use crate::stop::report::{
    DoubtAfterStop, ListAfterStop, NotTried, SecondConnection, StopMeans, StopReport,
};
use crate::stop::stopping::{CONFIRM_WITHIN, DOUBT_WITHIN, LEFT_FOR_CLEARING, READ_EVERY, STOP_WITHIN};

/// A reply that takes longer than this is late: ten times the slowest that was measured (26 ms). The client
/// then tries a second connection beside the first.
const LATE: Duration = Duration::from_millis(300);

/// A stop that is under way, until this is dropped.
struct UnderWay {
    robot: Robot,
}

impl UnderWay {
    fn begin(robot: Robot) -> Self {
        robot.stopping().send_modify(|stopping| {
            if stopping.under_way == 0 {
                stopping.forget();
            }
            stopping.under_way += 1;
        });
        Self { robot }
    }

    fn end(self, result: Result<StopReport, RequestError>) {
        self.robot.stopping().send_modify(|stopping| stopping.last = Some(result));
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        self.robot.stopping().send_modify(|stopping| {
            stopping.under_way = stopping.under_way.saturating_sub(1);
        });
    }
}

impl Robot {
    /// Stops the motion, ahead of all waiting requests, until it is proved that the arm stands, for 5 s at
    /// most. Then it clears the instruction list, so that the rest of it does not run at the next start.
    ///
    /// It tries `actionStop`, `stopButton`, `actionPause` and a cleared list in turn. [`StopReport::means`]
    /// says which of them worked, [`StopReport::proof`] what proves it. If nothing comes back for 300 ms, it
    /// opens a second connection beside the first and uses whichever answers. It reconnects if the connection
    /// is lost. It does not stop a robot other than the robot that this handle was used with before.
    ///
    /// A frame that can move the arm and is still unanswered may be carried out later. The stop then watches
    /// until the frame is answered or too old, and clears the list again ([`StopReport::doubt`]).
    ///
    /// Dropping the future does not end the stop. This is an ordinary command on a network, not an emergency
    /// stop.
    ///
    /// # Errors
    /// [`RequestError`] if no stop was answered and the state could not be read either:
    /// [`NotSent::NotStopped`] if no stop could be sent. Otherwise the report says whether it is proved that
    /// the arm stands ([`StopReport::confirmed`]).
    pub async fn stop(&self) -> Result<StopReport, RequestError> {
        self.drive(self.stop_now()).await
    }

    pub(crate) async fn stop_now(&self) -> Result<StopReport, RequestError> {
        // Begin before the announcement, so that tasks that see it find the stop under way.
        let under_way = UnderWay::begin(self.clone());
        self.announce_stop();
        let task = self.errand(async move {
            let result = under_way.robot.stop_and_clear().await.map_err(|error| match error {
                RequestError::Invalid(why) => Invalid::NotStopped(Box::new(why)).into(),
                RequestError::NotSent(why) => NotSent::NotStopped(Box::new(why)).into(),
                RequestError::Refused(_) | RequestError::OutcomeUnknown(_) => error,
            });
            under_way.end(result.clone());
            result
        });
        // The errand does not panic. A hand that ends drops it, and then it is unknown which frames were
        // sent.
        task.await.unwrap_or_else(|_ended| {
            let request = Work::Command(Command::ActionStop).sent();
            Err(OutcomeUnknown::ConnectionLost { request, reason: LostReason::ClosedHere }.into())
        })
    }

    /// Waits until no stop is under way over this connection. `false` if the longest time of a stop passes
    /// first.
    pub(crate) async fn no_stop_under_way(&self) -> bool {
        let mut stopping = self.stopping().subscribe();
        let over = stopping.wait_for(|stopping| stopping.under_way == 0);
        matches!(self.hub().time.timeout(STOP_WITHIN, over).await, Ok(Ok(_)))
    }

    /// Waits until no stop is under way over this connection, and returns the result of the last one. `None`
    /// if there was no stop (but a pause), or if it was given up halfway.
    pub(crate) async fn stop_under_way(&self) -> Option<Result<StopReport, RequestError>> {
        let mut stopping = self.stopping().subscribe();
        let over = stopping.wait_for(|stopping| stopping.under_way == 0);
        // The timeout bounds the wait for a stop that never ends. The sender lives as long as this handle.
        let seen = self.hub().time.timeout(STOP_WITHIN, over).await.ok()?.ok()?;
        seen.last.clone()
    }

    async fn stop_and_clear(&self) -> Result<StopReport, RequestError> {
        let begun = self.now();
        let in_doubt = self.hub().doubts.until(begun).is_some();
        let (halted, second) = self.halt_over_either(begun + CONFIRM_WITHIN).await;
        let took = self.now() - begun;
        let deadline = begun + STOP_WITHIN;
        let way = halted.robot.clone();
        let mut report = halted.report(took, second)?;
        let over_second = report.second == Some(SecondConnection::Used);
        let rest = self.clear_and_look(&way, &mut report, in_doubt, deadline);
        if over_second {
            // No other call drives the second connection.
            way.drive(rest).await;
        } else {
            rest.await;
        }
        Ok(report)
    }

    /// Completes a halt over `way`: clears the list, waits for frames in doubt, and looks at the machine once
    /// more.
    async fn clear_and_look(&self, way: &Self, report: &mut StopReport, in_doubt: bool, deadline: Instant) {
        if report.confirmed {
            report.list = way.clear_after_stop(report, deadline).await;
            // The stop and the clearing cover a frame that was answered meanwhile.
            let settled = || DoubtAfterStop { still_open: false, cleared: report.list.clone() };
            report.doubt = in_doubt.then(settled);
            self.wait_out_doubts(way, report, deadline).await;
        } else if self.hub().doubts.until(self.now()).is_some() {
            // Report at once: a person who needs the emergency stop must not wait for these frames.
            let cleared = ListAfterStop::NotTried(NotTried::NotStanding);
            report.doubt = Some(DoubtAfterStop { still_open: true, cleared });
        }
        if let Ok(Ok(seen)) = self.hub().time.timeout_at(deadline, way.observe(Lane::Urgent)).await
            && seen.connection == report.connection
        {
            report.see(&seen);
            // A machine that was seen to run after the proof does not count as stopped.
            if report.is_contradicted_by(&seen) {
                report.disprove();
            }
        }
        if report.confirmed {
            self.motions().forget_sent_on();
        }
        if report.second == Some(SecondConnection::Used) {
            self.hub().time.timeout_at(deadline, way.close_now()).await.ok();
        }
    }

    /// Halts over this connection, and also over a second one once the first answer is late. The first proof
    /// of a standstill wins. Without a proof, the result from a connection that read the machine's state
    /// wins.
    async fn halt_over_either(&self, deadline: Instant) -> (Halted, Option<SecondConnection>) {
        let begun = AtomicBool::new(false);
        let first = Halt::new(self.clone(), deadline).run();
        let second = async {
            // Any reply resets the wait, because reading the state takes many replies if each address is
            // asked for alone.
            let last_reply = || self.hub().meter().last_reply();
            let mut silent_since = self.now();
            loop {
                self.hub().time.sleep_until(silent_since + LATE).await;
                match last_reply().filter(|at| *at > silent_since) {
                    Some(at) => silent_since = at,
                    None => break,
                }
            }
            begun.store(true, Ordering::Relaxed);
            let made = self.hub().time.timeout_at(deadline, self.second_connection()).await;
            let busy = SecondConnection::NotMade(NotSent::Busy { waited: CONFIRM_WITHIN });
            match made.unwrap_or(Err(busy)) {
                // No other call drives the second connection.
                Ok(robot) => Ok(robot.drive(Halt::new(robot.clone(), deadline).run()).await),
                Err(why_not) => Err(why_not),
            }
        };
        tokio::pin!(first, second);
        let (mut one, mut other) = (None, None);
        while one.is_none() || other.is_none() {
            tokio::select! {
                biased;
                halted = &mut first, if one.is_none() => {
                    let over = halted.confirmed() || halted.is_closed() || !begun.load(Ordering::Relaxed);
                    one = Some(halted);
                    if over {
                        break;
                    }
                }
                halted = &mut second, if other.is_none() => {
                    let over = matches!(&halted, Ok(halted) if halted.confirmed());
                    other = Some(halted);
                    if over {
                        break;
                    }
                }
            }
        }
        let opening = begun.load(Ordering::Relaxed) && other.is_none();
        match (one, other) {
            (one, Some(Ok(halted)))
                if halted.confirmed() || (halted.heard() && !one.as_ref().is_some_and(Halted::heard)) =>
            {
                (halted, Some(SecondConnection::Used))
            }
            (Some(one), None) => (one, opening.then_some(SecondConnection::Opening)),
            (Some(one), Some(Ok(halted))) if halted.heard() => (one, Some(SecondConnection::Answered)),
            (Some(one), Some(Ok(_))) => (one, Some(SecondConnection::Silent)),
            (Some(one), Some(Err(why_not))) => (one, Some(why_not)),
            // The loop ends only once one of them is there.
            (None, _) => (Halted::nothing(self.clone()), None),
        }
    }

    /// Clears the list over the connection on which the standstill was proved, and over no other.
    async fn clear_after_stop(&self, report: &StopReport, deadline: Instant) -> ListAfterStop {
        if report.list_length == Some(0) {
            return ListAfterStop::WasEmpty;
        }
        if let Some(mode @ (OperationMode::None | OperationMode::Manual)) = report.mode {
            return ListAfterStop::NotTried(NotTried::Mode(mode));
        }
        self.clear_over(report.connection, deadline).await
    }

    async fn clear_over(&self, connection: u64, deadline: Instant) -> ListAfterStop {
        let clear = Work::AddRcc { replace: true, instructions: Vec::new() };
        let begun = self.now();
        let sent = clear.sent();
        let terms = Terms { only_on: Some(connection), ..Terms::default() };
        let answer = self.hub().time.timeout_at(deadline, self.accepted_on(terms, clear, Lane::Urgent)).await;
        let timed_out =
            || OutcomeUnknown::TimedOut { request: sent, after: (self.now() - begun), heard: None };
        match answer.unwrap_or_else(|_elapsed| Err(timed_out().into())) {
            Ok(_) => ListAfterStop::Cleared,
            Err(RequestError::Refused(
                Refused::InstructionList { reason }
                | Refused::Command { reason, .. }
                | Refused::Points { reason },
            )) => ListAfterStop::Refused(reason),
            Err(RequestError::OutcomeUnknown(unknown)) => ListAfterStop::Unknown(unknown),
            Err(RequestError::NotSent(error)) => ListAfterStop::NotTried(NotTried::NotSent(error)),
            Err(RequestError::Invalid(error)) => ListAfterStop::NotTried(NotTried::Invalid(error)),
        }
    }

    /// Watches while the controller may still take a frame of this handle that can move the arm. Then stops
    /// again, because the frame may have been carried out by now, and clears the list again.
    async fn wait_out_doubts(&self, way: &Self, report: &mut StopReport, deadline: Instant) {
        let doubts = &self.hub().doubts;
        let halt = || Halt::new(way.clone(), (self.now() + CONFIRM_WITHIN).min(deadline - LEFT_FOR_CLEARING));
        let give_up = self.now() + DOUBT_WITHIN;
        let mut waited = false;
        while let Some(until) = doubts.until(self.now())
            && self.now() < give_up
        {
            waited = true;
            let look_at = until.unwrap_or(give_up).min(give_up).min(self.now() + READ_EVERY);
            doubts.change_until(look_at).await;
            let seen = way.observe(Lane::Urgent).await;
            // Stop a running machine at once, then check whether more frames may come.
            if seen.is_ok_and(|seen| seen.connection == report.connection && report.is_contradicted_by(&seen))
            {
                halt().run().await.prove_again(report);
            }
        }
        if !waited {
            return;
        }
        let open = doubts.until(self.now()).is_some();
        halt().run().await.prove_again(report);
        let cleared = way.clear_over(report.connection, deadline).await;
        report.doubt = Some(DoubtAfterStop { still_open: open, cleared });
    }
}
