//! Stops the arm over one connection: tries one means after the other, and reads the state all the time.

use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use futures_util::stream::{FuturesUnordered, StreamExt};
use r6_proto::message::Command;
use r6_proto::time::Instant;

use crate::error::{NotSent, OutcomeUnknown, RequestError};
use crate::evidence::standstill::{StandProof, Standstill, Tried};
use crate::evidence::{About, Observation};
use crate::job::{Answer, Terms, Work};
use crate::link::Lane;
use crate::robot::Robot;
use crate::robot::requests::Given;
use crate::stop::report::{ListAfterStop, NotTried, SecondConnection, StopMeans, StopReport};
use crate::stop::stopping::{CONFIRM_WITHIN, READ_EVERY};

/// If the arm is not seen at rest this long after a means was sent, the next means is sent. A paused arm was
/// seen to take half a second.
const NEXT_AFTER: Duration = Duration::from_millis(500);

/// The pause after a stop that did not reach the controller: a connection that is refused at once must not
/// cause a flood of attempts.
const PAUSE_AFTER_FAILURE: Duration = Duration::from_millis(250);

/// How many stops may wait for their answers at once. Behind a link that has stalled, each of them arrives
/// later and may then end a motion that should continue.
const MOST_UNANSWERED: usize = 2;

/// A read of the state that is under way, or the pause before it.
type Reading = Pin<Box<dyn Future<Output = Result<Observation, RequestError>> + Send>>;

/// A stop over one connection. It ends when it is proved that the arm stands, or when the time is up.
#[derive(Debug)]
pub(super) struct Halt {
    deadline: Instant,
    /// The index of the next means in the order of means.
    next: usize,
    next_at: Instant,
    watch: Option<(About, Standstill)>,
    tried: Vec<StopMeans>,
    halted: Halted,
}

/// The result of a [`Halt`].
#[derive(Debug)]
pub(super) struct Halted {
    /// The handle of that connection.
    pub robot: Robot,
    pub proof: Option<StandProof>,
    /// The last means that was sent before the standstill was proved.
    pub means: Option<StopMeans>,
    pub attempts: u32,
    /// Whether a stop was answered, accepted or refused.
    pub answered: bool,
    /// Whether a stop was accepted over the present connection.
    accepted: bool,
    pub seen: Option<Observation>,
    pub failed: Option<RequestError>,
}

impl Halted {
    /// The result before anything was tried.
    pub fn nothing(robot: Robot) -> Self {
        Self {
            robot,
            proof: None,
            means: None,
            attempts: 0,
            answered: false,
            accepted: false,
            seen: None,
            failed: None,
        }
    }

    pub fn confirmed(&self) -> bool {
        self.proof.is_some()
    }

    /// Whether anything came back over this connection.
    pub fn heard(&self) -> bool {
        self.answered || self.seen.is_some()
    }

    /// Whether the handle is closed, so that nothing can be sent on it any more.
    pub fn is_closed(&self) -> bool {
        self.failed == Some(NotSent::Closed.into())
    }

    /// Makes the report of this stop.
    pub fn report(
        self,
        took: Duration,
        second: Option<SecondConnection>,
    ) -> Result<StopReport, RequestError> {
        if !self.heard() {
            return Err(self.into_error());
        }
        let connection = self.seen.as_ref().map_or_else(|| self.robot.connection(), |seen| seen.connection);
        let mut report = StopReport {
            confirmed: self.confirmed(),
            proof: self.proof,
            means: self.means,
            attempts: self.attempts,
            took,
            robot: self.robot.hub().identity_on(connection),
            connection,
            second,
            moving: None,
            mode: None,
            alarm: None,
            list_length: None,
            list: ListAfterStop::NotTried(NotTried::NotStanding),
            doubt: None,
        };
        if let Some(seen) = &self.seen {
            report.see(seen);
        }
        Ok(report)
    }
    /// The standstill had to be proved again. Updates the report with this result.
    pub fn prove_again(self, report: &mut StopReport) {
        report.attempts += self.attempts;
        let same = self.seen.as_ref().is_some_and(|seen| seen.connection == report.connection);
        report.proof = self.proof.filter(|_| same);
        report.confirmed = report.proof.is_some();
        report.means = self.means.or(report.means);
        if let Some(seen) = self.seen.as_ref().filter(|_| same) {
            report.see(seen);
        }
    }

    /// The error to return if nothing came back at all.
    fn into_error(self) -> RequestError {
        let request = Work::Command(Command::ActionStop).sent();
        let timed_out = || OutcomeUnknown::TimedOut { request, after: CONFIRM_WITHIN, heard: None }.into();
        match self.failed {
            // A stop that was sent may still be carried out, even if the others failed.
            Some(failed) if failed.nothing_left() && self.attempts > 0 => timed_out(),
            Some(failed) => failed,
            None => timed_out(),
        }
    }
}

impl Halt {
    pub fn new(robot: Robot, deadline: Instant) -> Self {
        Self {
            deadline,
            next: 0,
            next_at: robot.hub().time.now(),
            watch: None,
            tried: Vec::new(),
            halted: Halted::nothing(robot),
        }
    }

    /// Sends stops and reads the state until the end.
    pub async fn run(mut self) -> Halted {
        let time = Arc::clone(&self.halted.robot.hub().time);
        let mut answers = FuturesUnordered::new();
        let mut reading: Option<Reading> = None;
        while self.halted.proof.is_none() && !self.halted.is_closed() && time.now() < self.deadline {
            if time.now() >= self.next_at && answers.len() < MOST_UNANSWERED {
                let (means, mut given) = self.send();
                answers.push(async move { (means, given.answer().await) });
                continue;
            }
            let robot = &self.halted.robot;
            let read = reading.get_or_insert_with(|| read(robot.clone(), Duration::ZERO));
            let may_send = answers.len() < MOST_UNANSWERED;
            tokio::select! {
                biased;
                Some((means, answer)) = answers.next() => self.answered(means, answer),
                seen = read => {
                    reading = Some(self::read(self.halted.robot.clone(), READ_EVERY));
                    self.see(seen);
                }
                () = time.sleep_until(self.next_at), if may_send => {}
                () = time.sleep_until(self.deadline) => {}
            }
        }
        self.halted
    }

    /// Gives the next means to the connection. Only reads that are requested from now on count for the proof.
    fn send(&mut self) -> (StopMeans, Given) {
        let now = self.halted.robot.hub().time.now();
        let means = StopMeans::nth(self.next);
        self.next += 1;
        self.next_at = now + NEXT_AFTER;
        let about = self.about();
        if self.watch.as_ref().is_none_or(|(watched, _)| *watched != about) {
            // A stop over another connection proves nothing about the robot on this one.
            self.tried.clear();
            self.halted.accepted = false;
            self.watch = Some((about.clone(), Standstill::new(about, now)));
        }
        let given = self.halted.robot.give(Terms::default(), means.work(), Lane::Urgent);
        self.halted.attempts += 1;
        self.halted.means = Some(means);
        self.tried.push(means);
        (means, given)
    }

    /// The robot to be stopped: the intended robot, over the present connection.
    fn about(&self) -> About {
        let known = self.halted.robot.hub().known();
        About { connection: known.connection, robot: known.expected.clone() }
    }

    fn answered(&mut self, means: StopMeans, answer: Result<Answer, RequestError>) {
        match answer {
            Ok(Answer::Accepted { on, .. }) => {
                self.halted.answered = true;
                let here = self.watch.as_ref().is_some_and(|(about, _)| about.connection == on.connection);
                self.halted.accepted |= here && means != StopMeans::ClearList;
            }
            // A controller may refuse a stop because the arm stands already. So the state decides, not the
            // answer.
            Ok(_) | Err(RequestError::Refused(_)) => self.halted.answered = true,
            Err(error) => {
                if error.nothing_left() {
                    self.halted.attempts = self.halted.attempts.saturating_sub(1);
                    self.take_back(means);
                }
                self.failed(error);
            }
        }
    }

    /// Takes back a means that was not sent, because it does not count as tried. The list cannot be cleared
    /// before the state is read; that does not delay the other means.
    fn take_back(&mut self, means: StopMeans) {
        if let Some(at) = self.tried.iter().rposition(|tried| *tried == means) {
            self.tried.remove(at);
        }
        if means != StopMeans::ClearList {
            self.next = 0;
        }
        self.halted.means = self.tried.last().copied();
        self.next_at = self.halted.robot.hub().time.now() + PAUSE_AFTER_FAILURE;
    }

    fn failed(&mut self, error: RequestError) {
        self.halted.failed = Some(match self.halted.failed.take() {
            // A stop that was sent may be carried out, even if a later one could not be sent. So the first
            // error is kept.
            Some(left @ RequestError::OutcomeUnknown(_))
                if !matches!(error, RequestError::OutcomeUnknown(_)) =>
            {
                left
            }
            _ => error,
        });
    }

    fn see(&mut self, seen: Result<Observation, RequestError>) {
        let seen = match seen {
            Ok(seen) => seen,
            Err(_unreadable) => {
                if let Some((_, watch)) = &mut self.watch {
                    watch.missed();
                }
                return;
            }
        };
        let tried = Tried {
            all: StopMeans::IN_ORDER.iter().all(|means| self.tried.contains(means)),
            accepted: self.halted.accepted,
            stays_in_mode_7: self.halted.robot.settings().stays_in_mode_7,
        };
        if let Some((about, watch)) = &mut self.watch {
            self.halted.proof = watch.see(&seen, tried);
            if seen.connection != about.connection {
                // No stop was sent over this connection yet.
                (self.next, self.next_at) = (0, self.halted.robot.hub().time.now());
            }
        }
        self.halted.seen = Some(seen);
    }
}

/// Reads the state after a pause.
fn read(robot: Robot, pause: Duration) -> Reading {
    Box::pin(async move {
        robot.hub().time.sleep(pause).await;
        robot.observe(Lane::Urgent).await
    })
}
