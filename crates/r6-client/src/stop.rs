//! Stopping: sent until the arm is seen to stand, and nothing left that could start it again.

use std::fmt;
use std::time::Duration;

use r6_proto::message::Command;
use tokio::sync::{OwnedSemaphorePermit, watch};
use tokio::time::{Instant, sleep, timeout, timeout_at};

use crate::error::{NotSent, OutcomeUnknown, Refused, RequestError};
use crate::job::Work;
use crate::link::Lane;
use crate::motion::Sample;
use crate::robot::Robot;
use crate::stream::Cause;
use r6_proto::OperationMode;

/// How long an arm may take to stand. One was seen to stop within 0.1 s, a paused one within 0.5 s; the rest is room for
/// a stop that gets lost.
const CONFIRM_WITHIN: Duration = Duration::from_secs(5);

/// An arm that still moves this long after a stop was answered gets another one.
const SEND_AGAIN_AFTER: Duration = Duration::from_millis(500);

/// The pause between two reads of the state.
const READ_EVERY: Duration = Duration::from_millis(50);

/// The pause after a stop that did not reach the controller: a connection that is refused at once must not become
/// a flood of attempts.
const PAUSE_AFTER_FAILURE: Duration = Duration::from_millis(250);

/// How long a stop may take in all: [`CONFIRM_WITHIN`], and then the time of some replies to clear the list and to look.
pub(crate) const STOP_WITHIN: Duration = Duration::from_secs(15);

/// The stops over one connection.
#[derive(Debug, Default)]
pub(crate) struct Stopping {
    pub(crate) under_way: usize,
    /// What became of the last one of those that began while none was under way, or later.
    pub(crate) last: Option<Result<StopReport, RequestError>>,
}

impl Stopping {
    /// What was stopped before is nothing to what begins now.
    fn forget(&mut self) {
        self.last = None;
    }
}

/// A stop that is under way, until this is dropped.
struct UnderWay<'r> {
    robot: &'r Robot,
}

impl<'r> UnderWay<'r> {
    fn begin(robot: &'r Robot) -> Self {
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

impl Drop for UnderWay<'_> {
    fn drop(&mut self) {
        self.robot.stopping().send_modify(|stopping| {
            stopping.under_way = stopping.under_way.saturating_sub(1);
        });
    }
}

/// What became of a stop.
#[derive(Clone, Debug, PartialEq)]
pub struct StopReport {
    /// Whether the arm was seen to stand in two reads after a stop that was answered.
    pub confirmed: bool,
    /// How many stops were sent.
    pub attempts: u32,
    /// How long it took until the arm was seen to stand, or until it was given up.
    pub took: Duration,
    /// `isMoving` at the end.
    pub moving: Option<bool>,
    /// `curMode` at the end.
    pub mode: Option<OperationMode>,
    /// `curAlarm` at the end; 42 after a stop is usual on some firmware (reported, unit B).
    pub alarm: Option<i64>,
    /// `RemoteCmdLen` at the end.
    pub list_length: Option<i64>,
    /// What became of the instructions that were left.
    pub list: ListAfterStop,
}

/// What became of the instruction list after a stop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ListAfterStop {
    /// The controller said that it was empty.
    WasEmpty,
    /// It was cleared, and the controller said ok.
    Cleared,
    /// The controller refused to clear it, with its reason where it gives one.
    Refused(Option<String>),
    /// Clearing it was sent, and nobody knows what became of it.
    Unknown(OutcomeUnknown),
    /// Clearing it was not tried.
    NotTried(NotTried),
}

/// Why clearing the list was not tried.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotTried {
    /// The arm was not seen to stand: replacing the list of an arm that moves raises an alarm.
    NotStanding,
    /// The controller takes no instructions in this mode.
    Mode(OperationMode),
    /// It could not be sent.
    NotSent(NotSent),
}

impl Robot {
    /// Stops the motion (`actionStop`), ahead of all that waits, again and again until the arm is seen to stand, for 5 s at
    /// most; then clears the instruction list, so that the rest of it does not run at the next start.
    ///
    /// A lost connection is made anew for it. This is an ordinary command on a network and no emergency stop.
    ///
    /// # Errors
    /// [`RequestError`] if no stop was answered at all: [`NotSent::NotStopped`] if none could be sent. If one was answered, but
    /// the arm was not seen to stand, the report says so ([`StopReport::confirmed`]).
    pub async fn stop(&self) -> Result<StopReport, RequestError> {
        // Before anybody hears of it, so that whoever does finds it under way.
        let under_way = UnderWay::begin(self);
        self.announce_stop();
        let result = self.stop_and_clear().await.map_err(|error| match error {
            RequestError::NotSent(why) => NotSent::NotStopped(Box::new(why)).into(),
            RequestError::Refused(_) | RequestError::OutcomeUnknown(_) => error,
        });
        under_way.end(result.clone());
        result
    }

    /// The right to stream a path over this connection, and news of every stop from now on. One that is under way is waited for: it
    /// may still clear the list, which would be that of a moving arm by then.
    pub(crate) async fn turn(&self) -> Result<(OwnedSemaphorePermit, watch::Receiver<u64>), Cause> {
        let turn = self.streaming().ok_or(Cause::AnotherRuns)?;
        // Before the look at what is under way: a stop that is not seen there is heard of.
        let stops = self.stops();
        let mut stopping = self.stopping().subscribe();
        let over = stopping.wait_for(|stopping| stopping.under_way == 0);
        if !matches!(timeout(STOP_WITHIN, over).await, Ok(Ok(_))) {
            return Err(Cause::StoppedHere);
        }
        self.stopping().send_modify(Stopping::forget);
        Ok((turn, stops))
    }

    /// Waits until no stop is under way over this connection, and tells what became of the last one; `None` if there was none
    /// (it was a pause), or if it was given up halfway.
    pub(crate) async fn stop_under_way(&self) -> Option<Result<StopReport, RequestError>> {
        let mut stopping = self.stopping().subscribe();
        let over = stopping.wait_for(|stopping| stopping.under_way == 0);
        // Nobody who dropped out is waited for without end; the sender lives as long as this handle.
        let seen = timeout(STOP_WITHIN, over).await.ok()?.ok()?;
        seen.last.clone()
    }

    async fn stop_and_clear(&self) -> Result<StopReport, RequestError> {
        let begun = Instant::now();
        let deadline = begun + CONFIRM_WITHIN;
        let mut attempts = 0;
        let mut failed: Option<RequestError> = None;
        let mut answered = false;
        let mut seen = None;
        let mut confirmed = false;
        while !confirmed && Instant::now() < deadline {
            let stop = self.accepted(Work::Command(Command::ActionStop), Lane::Urgent);
            match timeout_at(deadline, stop).await {
                // Whoever says no may stand already: the state decides.
                Ok(Ok(_) | Err(RequestError::Refused(_))) => {
                    attempts += 1;
                    answered = true;
                }
                // Nothing will ever be sent on this handle again.
                Ok(Err(error @ RequestError::NotSent(NotSent::Closed))) if !answered => {
                    return Err(rather(failed, error));
                }
                Ok(Err(error)) => {
                    attempts += u32::from(!matches!(error, RequestError::NotSent(_)));
                    failed = Some(rather(failed, error));
                    sleep(PAUSE_AFTER_FAILURE).await;
                    continue;
                }
                Err(_elapsed) => break,
            }
            let until = deadline.min(Instant::now() + SEND_AGAIN_AFTER);
            let looking = timeout_at(deadline, self.sees_standing(until, &mut seen));
            confirmed = looking.await.unwrap_or(false);
        }
        let took = begun.elapsed();
        if !answered {
            let request = Work::Command(Command::ActionStop).sent();
            let timed_out = OutcomeUnknown::TimedOut { request, after: CONFIRM_WITHIN, heard: None };
            return Err(failed.unwrap_or(timed_out.into()));
        }
        let list = self.clear_after_stop(confirmed, seen).await;
        if let Ok(sample) = self.sample(Lane::Urgent).await {
            seen = Some(sample);
        }
        Ok(StopReport {
            confirmed,
            attempts,
            took,
            moving: seen.and_then(|seen| seen.moving),
            mode: seen.and_then(|seen| seen.mode),
            alarm: seen.and_then(|seen| seen.alarm),
            list_length: seen.and_then(|seen| seen.list_length),
            list,
        })
    }

    /// Whether the arm is seen to stand in two reads in a row before the time is up.
    async fn sees_standing(&self, until: Instant, seen: &mut Option<Sample>) -> bool {
        let mut before: Option<Sample> = None;
        // The first two reads are made even if the answer to the stop took all the time.
        for read in 0.. {
            match self.sample(Lane::Urgent).await {
                Ok(sample) => {
                    *seen = Some(sample);
                    if before.is_some_and(|before| sample.stands_since(&before)) {
                        return true;
                    }
                    before = Some(sample);
                }
                Err(_unreadable) => before = None,
            }
            if read > 0 && Instant::now() >= until {
                break;
            }
            sleep(READ_EVERY).await;
        }
        false
    }

    async fn clear_after_stop(&self, confirmed: bool, seen: Option<Sample>) -> ListAfterStop {
        let Some(seen) = seen.filter(|_| confirmed) else {
            return ListAfterStop::NotTried(NotTried::NotStanding);
        };
        if seen.list_length == Some(0) {
            return ListAfterStop::WasEmpty;
        }
        if let Some(mode @ (OperationMode::None | OperationMode::Manual)) = seen.mode {
            return ListAfterStop::NotTried(NotTried::Mode(mode));
        }
        let clear = Work::AddRcc { replace: true, instructions: Vec::new() };
        match self.accepted(clear, Lane::Urgent).await {
            Ok(_) => ListAfterStop::Cleared,
            Err(RequestError::Refused(
                Refused::InstructionList { reason }
                | Refused::Command { reason, .. }
                | Refused::Points { reason },
            )) => ListAfterStop::Refused(reason),
            Err(RequestError::OutcomeUnknown(unknown)) => ListAfterStop::Unknown(unknown),
            Err(RequestError::NotSent(error)) => ListAfterStop::NotTried(NotTried::NotSent(error)),
        }
    }
}

/// What to tell of stops that failed: one that left may be carried out, whatever became of those after it.
fn rather(before: Option<RequestError>, error: RequestError) -> RequestError {
    match (before, error) {
        (Some(left @ RequestError::OutcomeUnknown(_)), RequestError::NotSent(_)) => left,
        (_, error) => error,
    }
}

impl fmt::Display for StopReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.took.as_secs_f64();
        let sent = match self.attempts {
            1 => "sent once".to_owned(),
            times => format!("sent {times} times"),
        };
        if self.confirmed {
            write!(f, "the arm stands ({seconds:.2} s, {sent})")?;
        } else {
            write!(
                f,
                "the arm was not seen to stand within {seconds:.2} s ({sent}): use the emergency stop"
            )?;
        }
        match self.mode {
            Some(mode) => write!(f, "; mode {mode}")?,
            None => f.write_str("; mode not known")?,
        }
        match self.alarm {
            Some(0) => {}
            Some(alarm) => write!(f, "; alarm {alarm}")?,
            None => f.write_str("; alarm not known")?,
        }
        write!(f, "; {}", self.list)?;
        match self.list_length {
            None | Some(0) => Ok(()),
            Some(length) => write!(
                f,
                "; {length} {} still in the list and may run at the next start: clear it before that",
                if length == 1 { "instruction is" } else { "instructions are" }
            ),
        }
    }
}

impl fmt::Display for ListAfterStop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WasEmpty => f.write_str("the instruction list was empty"),
            Self::Cleared => f.write_str("the instruction list was cleared"),
            Self::Refused(Some(reason)) => {
                write!(f, "the instruction list was not cleared, refused: {reason}")
            }
            Self::Refused(None) => {
                f.write_str("the instruction list was not cleared, refused without a reason")
            }
            Self::Unknown(unknown) => {
                write!(f, "whether the instruction list was cleared is not known: {unknown}")
            }
            Self::NotTried(NotTried::NotStanding) => f.write_str("the instruction list was left as it is"),
            Self::NotTried(NotTried::Mode(mode)) => {
                write!(f, "the instruction list was left as it is, because nothing is taken in mode {mode}")
            }
            Self::NotTried(NotTried::NotSent(error)) => {
                write!(f, "the instruction list was not cleared: {error}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_in_the_list_is_counted() {
        let report = |length| StopReport {
            confirmed: true,
            attempts: 1,
            took: Duration::from_millis(120),
            moving: Some(false),
            mode: Some(OperationMode::Stop),
            alarm: Some(0),
            list_length: Some(length),
            list: ListAfterStop::Refused(None),
        };
        let text = |length| report(length).to_string();
        assert!(!text(0).contains("still in the list"), "{}", text(0));
        assert!(text(1).contains("; 1 instruction is still in the list and"), "{}", text(1));
        assert!(text(2).contains("; 2 instructions are still in the list and"), "{}", text(2));
    }
}
