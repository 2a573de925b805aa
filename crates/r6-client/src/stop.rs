//! Stopping: one means after the other until it is proved that the arm stands, and nothing left that could start it again.
//!
//! A stop is an errand ([`crate::errands`]): once begun, it goes on to its end, whatever becomes of the caller.
//!
//! ```text
//!  actionStop leaves ──▶ watched over this connection (stop/halt.rs) ──proved──▶ list cleared ──▶ doubts waited out ──▶ report
//!        └─ nothing for 300 ms ───▶ the same over a second connection ─proved─▲        (frames that are still unanswered)
//! ```
//!
//! What proves a standstill is told in `evidence/standstill.rs`.

mod halt;
pub(crate) mod report;
pub(crate) mod stopping;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use r6_proto::OperationMode;
use r6_proto::message::Command;
use r6_proto::time::Instant;
use tokio::sync::{OwnedSemaphorePermit, watch};

use crate::error::{Invalid, NotSent, OutcomeUnknown, Refused, RequestError};
use crate::job::{Terms, Work};
use crate::link::Lane;
use crate::pushed::LostReason;
use crate::robot::Robot;
use crate::stop::halt::{Halt, Halted};
pub use crate::stop::report::{
    DoubtAfterStop, ListAfterStop, NotTried, SecondConnection, StopMeans, StopReport,
};
use crate::stop::stopping::{
    CONFIRM_WITHIN, DOUBT_WITHIN, LEFT_FOR_CLEARING, READ_EVERY, STOP_WITHIN, Stopping,
};
use crate::stream::error::Cause;

/// An answer that takes longer than this is late: ten times the slowest that was measured (26 ms). Then a second
/// connection is tried beside the first.
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
    /// Stops the motion, ahead of all that waits, until it is proved that the arm stands, for 5 s at most; then clears the
    /// instruction list, so that the rest of it does not run at the next start.
    ///
    /// It tries `actionStop`, `stopButton`, `actionPause` and a cleared list in turn; [`StopReport::means`] says which one
    /// worked, [`StopReport::proof`] what proves it. If nothing comes back for 300 ms, it opens a second connection beside the
    /// first and uses the one that answers. A lost connection is made anew. A robot that turns out to be another
    /// one than this handle was used with before is not stopped.
    ///
    /// A frame that can move the arm and is still unanswered may be carried out later: then the stop watches on until it is
    /// answered or too old, and clears the list again ([`StopReport::doubt`]).
    ///
    /// Dropping the future does not end the stop. This is an ordinary command on a network and no emergency stop.
    ///
    /// # Errors
    /// [`RequestError`] if no stop was answered and the state could not be read either: [`NotSent::NotStopped`] if none could be
    /// sent. Otherwise the report says whether it is proved that the arm stands ([`StopReport::confirmed`]).
    pub async fn stop(&self) -> Result<StopReport, RequestError> {
        self.drive(self.stop_now()).await
    }

    pub(crate) async fn stop_now(&self) -> Result<StopReport, RequestError> {
        // Before anybody hears of it, so that whoever does finds it under way.
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
        // The errand does not panic; a hand that is gone gives it up, and what of it has left by then nobody knows.
        task.await.unwrap_or_else(|_ended| {
            let request = Work::Command(Command::ActionStop).sent();
            Err(OutcomeUnknown::ConnectionLost { request, reason: LostReason::ClosedHere }.into())
        })
    }

    /// The right to stream a path over this connection, and news of every stop from now on. One that is under way is waited for: it
    /// may still clear the list, which would be that of a moving arm by then.
    pub(crate) async fn turn(&self) -> Result<(OwnedSemaphorePermit, watch::Receiver<u64>), Cause> {
        let turn = self.streaming().ok_or(Cause::AnotherRuns)?;
        // Before the look at what is under way: a stop that is not seen there is heard of.
        let stops = self.stops();
        if !self.no_stop_under_way().await {
            return Err(Cause::StoppedHere);
        }
        self.stopping().send_modify(Stopping::forget);
        match self.motions().untold_failure() {
            Some(earlier) => Err(Cause::EarlierFailed(earlier)),
            None => Ok((turn, stops)),
        }
    }

    /// Waits until no stop is under way over this connection; `false` if one still is after the time that it may take.
    pub(crate) async fn no_stop_under_way(&self) -> bool {
        let mut stopping = self.stopping().subscribe();
        let over = stopping.wait_for(|stopping| stopping.under_way == 0);
        matches!(self.hub().time.timeout(STOP_WITHIN, over).await, Ok(Ok(_)))
    }

    /// Waits until no stop is under way over this connection, and tells what became of the last one; `None` if there was none
    /// (it was a pause), or if it was given up halfway.
    pub(crate) async fn stop_under_way(&self) -> Option<Result<StopReport, RequestError>> {
        let mut stopping = self.stopping().subscribe();
        let over = stopping.wait_for(|stopping| stopping.under_way == 0);
        // Nobody who dropped out is waited for without end; the sender lives as long as this handle.
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
            // Nobody else waits on it.
            way.drive(rest).await;
        } else {
            rest.await;
        }
        Ok(report)
    }

    /// What follows a halt over this way: the list is cleared, frames in doubt are waited out, and the machine is looked at once more.
    async fn clear_and_look(&self, way: &Self, report: &mut StopReport, in_doubt: bool, deadline: Instant) {
        if report.confirmed {
            report.list = way.clear_after_stop(report, deadline).await;
            // One that was answered meanwhile was dealt with by the stop and the clearing.
            let settled = || DoubtAfterStop { still_open: false, cleared: report.list.clone() };
            report.doubt = in_doubt.then(settled);
            self.wait_out_doubts(way, report, deadline).await;
        } else if self.hub().doubts.until(self.now()).is_some() {
            // Whoever is sent to the emergency stop is not kept waiting for it.
            let cleared = ListAfterStop::NotTried(NotTried::NotStanding);
            report.doubt = Some(DoubtAfterStop { still_open: true, cleared });
        }
        if let Ok(Ok(seen)) = self.hub().time.timeout_at(deadline, way.observe(Lane::Urgent)).await
            && seen.connection == report.connection
        {
            report.see(&seen);
            // What was proved is not told of a machine that was seen to run since.
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

    /// Halts over this connection, and over a second one beside it once the first answer is late. What proves the standstill first
    /// counts; otherwise what saw the machine at all.
    async fn halt_over_either(&self, deadline: Instant) -> (Halted, Option<SecondConnection>) {
        let begun = AtomicBool::new(false);
        let first = Halt::new(self.clone(), deadline).run();
        let second = async {
            // Each reply counts: where each address is asked for alone, a look at the state takes many.
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
                // Nobody else waits on it.
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
            // The loop ends with one of them.
            (None, _) => (Halted::nothing(self.clone()), None),
        }
    }

    /// Clears the list over the connection that the standstill was proved on, and on no other.
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

    /// While a frame of this handle that can move the arm may still be taken, watches on. Then stops again, for the frame may have
    /// been carried out by now, and clears the list again.
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
            // What runs is stopped at once; whether more comes is looked at after that.
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
