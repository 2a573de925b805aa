//! The errand that streams one motion: it reads the state, sends what fits into the list, and reads again.

use std::collections::VecDeque;
use std::future;
use std::ops::Range;
use std::time::Duration;

use r6_proto::axis::AXES;
use r6_proto::message::Instruction;
use r6_proto::time::Instant;
use tokio::sync::oneshot::error::TryRecvError;
use tokio::sync::{OwnedMutexGuard, oneshot, watch};

use crate::conditions::{Conditions, ListGate};
use crate::done::{Done, EndProof, WaitOptions};
use crate::error::{NotSent, RequestError};
use crate::event::Event;
use crate::evidence::rest::Rest;
use crate::evidence::{About, Observation, Sample};
use crate::job::{Terms, Work};
use crate::link::Lane;
use crate::moves::Motion;
use crate::path::pace::Looked;
use crate::path::progress::PathProgress;
use crate::progress::Progress;
use crate::robot::Robot;
use crate::stream::error::{Cause, MotionError};
use crate::stream::options::RunOptions;
use crate::stream::turn::Turn;

/// What the owner of a motion may request before the motion ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wish {
    /// The arm stops.
    Stop,
    /// Nothing more is sent.
    Release,
}

/// How a motion ended.
#[derive(Clone, Debug)]
pub(crate) struct Ended {
    pub result: Result<Done, MotionError>,
    /// Whether it was stopped only because its handle asked for that.
    pub stopped_as_asked: bool,
}

/// How a motion runs that is sent at once, without regard to the progress of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Whole {
    /// It is appended to the list.
    Appended,
    /// It repeats.
    Repeats,
}

impl Whole {
    /// `None` for a motion that is streamed.
    pub fn of(motion: &Motion, options: RunOptions) -> Option<Self> {
        match (motion.repeats(), options.append) {
            (true, _) => Some(Self::Repeats),
            (false, true) => Some(Self::Appended),
            (false, false) => None,
        }
    }
}

/// A motion that is under way.
#[derive(Debug)]
pub(super) struct Task {
    robot: Robot,
    /// The robot and connection that were checked before the motion began. No other connection gets any part
    /// of it, because a robot that answers there may have lost its list, or stand elsewhere.
    about: About,
    /// The number of the motion.
    number: u64,
    options: RunOptions,
    /// Asked before each list, if there is one.
    gate: Option<ListGate>,
    /// `None`: the motion is streamed.
    whole: Option<Whole>,
    path: PathProgress,
    /// Held until the first list is answered, because that list begins where the arm was seen.
    lists: Option<OwnedMutexGuard<()>>,
    /// The frames that were not sent yet.
    frames: VecDeque<Range<usize>>,
    /// Steps of a frame that may have been sent and was not answered.
    in_doubt: usize,
    progress: watch::Sender<Progress>,
    begun: Instant,
    rest: Rest,
    /// When a list was last accepted.
    fed: Instant,
    /// When the last read was requested.
    looked_at: Instant,
    failed: u32,
    /// When there was last progress, how many steps were over, and where the axes were.
    went_on: (Instant, usize, [Option<f64>; AXES]),
}

impl Task {
    pub fn new(
        (robot, about, number): (Robot, About, u64),
        (mut options, gate): (RunOptions, Option<ListGate>),
        whole: Option<Whole>,
        path: PathProgress,
        frames: Vec<Range<usize>>,
        progress: watch::Sender<Progress>,
    ) -> Self {
        if whole.is_some() {
            let lead = path.lead_time().unwrap_or(Duration::MAX);
            options.start_within = options.start_within.saturating_add(lead);
        }
        let begun = robot.hub().time.now();
        let rest_about = about.clone();
        let wait = WaitOptions {
            settle: options.settle,
            start_within: options.start_within,
            idle_mode: options.idle_mode,
            ..WaitOptions::default()
        };
        Self {
            robot,
            about,
            number,
            options,
            gate,
            whole,
            path,
            lists: None,
            frames: frames.into(),
            in_doubt: 0,
            progress,
            begun,
            rest: Rest::new(wait, rest_about, begun),
            fed: begun,
            looked_at: begun,
            failed: 0,
            went_on: (begun, 0, [None; AXES]),
        }
    }

    /// Runs the motion until it has ended, for any reason. `ended` receives the wish of the owner, or is
    /// dropped. If it is dropped, the motion continues to its end, unless the options ask for a stop.
    pub async fn run(
        self,
        ended: oneshot::Receiver<Wish>,
        stops: watch::Receiver<u64>,
        turn: Turn,
        lists: OwnedMutexGuard<()>,
    ) -> Ended {
        let (robot, number, progress) = (self.robot.clone(), self.number, self.progress.clone());
        let ended = self.run_and_stop(ended, stops, lists).await;
        robot.motions().end(number, &ended.result, turn);
        // Another thread that waits for this may begin the next motion at once.
        drop(progress);
        ended
    }

    async fn run_and_stop(
        mut self,
        mut ended: oneshot::Receiver<Wish>,
        mut stops: watch::Receiver<u64>,
        lists: OwnedMutexGuard<()>,
    ) -> Ended {
        self.lists = Some(lists);
        let mut asked_to_stop = false;
        let (robot, stop_on_drop) = (self.robot.clone(), self.options.stop_on_drop);
        let result = tokio::select! {
            biased;
            cause = asked(&mut ended, stop_on_drop) => {
                asked_to_stop = cause == Cause::StoppedHere;
                let stop = cause != Cause::Released;
                Err((cause, stop))
            }
            cause = stopped(&mut stops) => Err((cause, false)),
            () = robot.is_closing() => Err((Cause::Closed, stop_on_drop)),
            result = self.stream() => result.map_err(|cause| (cause, self.options.stop_on_failure)),
        };
        self.lists = None;
        let (cause, stop) = match result {
            Ok(done) => {
                self.publish(true);
                return Ended { result: Ok(done), stopped_as_asked: false };
            }
            Err(failed) => failed,
        };
        self.publish(true);
        let progress = *self.progress.borrow();
        let dropped = matches!(ended.try_recv(), Err(TryRecvError::Closed));
        let dropped = dropped && !asked_to_stop && cause != Cause::Released;
        self.robot.hub().happened(Event::MotionEnded { cause: cause.clone(), progress, dropped });
        let stop = self.robot.stop_after(&cause, stop, progress).await;
        Ended { stopped_as_asked: asked_to_stop, result: Err(MotionError { cause, progress, stop }) }
    }

    async fn stream(&mut self) -> Result<Done, Cause> {
        loop {
            self.feed().await?;
            match self.robot.observe(Lane::Ordinary).await {
                Ok(seen) => {
                    self.failed = 0;
                    self.looked_at = seen.asked_at;
                    let lost = NotSent::Disconnected;
                    let lost =
                        if self.frames.is_empty() { Cause::Unreadable(lost.into()) } else { lost.into() };
                    self.robot.same_connection(&self.about, &seen, self.options.idle_mode, lost).await?;
                    if let Some(proof) = self.judge(&seen, self.now())? {
                        let (moved, took) = (self.rest.moved, self.now() - self.begun);
                        return Ok(Done::of(Some(self.number), proof, &seen.values, moved, took));
                    }
                }
                Err(error) => {
                    self.rest.missed();
                    self.failed += 1;
                    Cause::of_failed_read(error, self.failed)?;
                    // The client does not feed a motion that it cannot see.
                    self.robot.hub().time.sleep(self.options.interval).await;
                    continue;
                }
            }
            if !self.has_room() {
                self.robot.hub().time.sleep(self.options.interval).await;
            }
        }
    }

    fn now(&self) -> Instant {
        self.robot.hub().time.now()
    }

    fn has_room(&self) -> bool {
        if self.whole.is_some() {
            return !self.frames.is_empty();
        }
        if self.path.is_unproved() {
            return false;
        }
        let fits = |frame: &Range<usize>| self.path.in_list() + frame.len() <= self.options.room.max(1);
        self.frames.front().is_some_and(fits)
    }

    /// Sends the frames that fit. Every frame is sent once. A frame is retried only if nothing of it was
    /// sent.
    async fn feed(&mut self) -> Result<(), Cause> {
        while self.failed == 0
            && self.has_room()
            && self.looked_lately()?
            && let Some(frame) = self.frames.pop_front()
        {
            let replace = frame.start == 0 && !self.options.append;
            let steps = self.path.steps().get(frame.clone()).unwrap_or_default().to_vec();
            let terms = self.terms(replace, &steps)?;
            self.in_doubt = frame.len();
            self.publish(false);
            let list = Work::AddRcc { replace, instructions: steps };
            let answer = self.robot.accepted_on(terms, list, Lane::Ordinary).await;
            match answer {
                Ok(_) => {
                    self.lists = None;
                    self.in_doubt = 0;
                    self.path.fed(frame.end);
                    self.fed = self.now();
                    self.publish(false);
                    // Until the pace of the arm is known, the client reads the state after each list, so that
                    // no other client can clear the list unseen.
                    if self.whole.is_none() && !self.path.knows_pace() {
                        return Ok(());
                    }
                }
                Err(RequestError::NotSent(NotSent::Busy { .. })) => {
                    // Nothing of it was sent: it is fed again after the next read that succeeds.
                    self.in_doubt = 0;
                    self.frames.push_front(frame);
                    return Ok(());
                }
                Err(error) => {
                    // Controllers have run lists that they refused.
                    if error.nothing_left() {
                        self.in_doubt = 0;
                    }
                    return Err(error.into());
                }
            }
        }
        Ok(())
    }

    /// Under which terms this list may leave.
    fn terms(&self, replace: bool, steps: &[Instruction]) -> Result<Terms, Cause> {
        let connection = self.about.connection;
        let conditions = match &self.gate {
            None => Conditions::default(),
            Some(gate) => gate.decide(replace, steps).ok_or(NotSent::Withdrawn)?,
        };
        let Conditions { leave_within, only_on, permission } = conditions;
        if only_on.is_some_and(|only| only != connection) {
            return Err(NotSent::Disconnected.into());
        }
        let leave_by = leave_within.map(|within| self.now() + within);
        Ok(Terms { leave_by, only_on: Some(connection), permission, ..Terms::default() })
    }

    /// Whether the last read is recent enough for a list to be sent: this program may have been suspended
    /// since. The first list was checked against that read, so it is never sent after the read is too old.
    fn looked_lately(&self) -> Result<bool, Cause> {
        let lately = self.robot.is_recent(self.looked_at);
        if !lately && self.path.accepted == 0 {
            return Err(Cause::Unreadable(self.robot.too_slow(self.looked_at)));
        }
        Ok(lately)
    }

    /// Takes in one read. Returns the proof of the end once the motion has ended.
    fn judge(&mut self, seen: &Observation, now: Instant) -> Result<Option<EndProof>, Cause> {
        let sample = &seen.values;
        // If the length of the list is unknown, a wait in it looks like its end.
        self.rest.options.settle = match (sample.list_length, self.path.all_may_stand()) {
            (Some(_), _) => self.options.settle,
            (None, Some(time)) => self.options.settle + time,
            (None, None) => Duration::MAX,
        };
        let judged = self.rest.judge(seen, now);
        if let Some(whole) = self.whole {
            return self.judge_whole(whole, sample, judged?, now);
        }
        // The error that ended the motion contains the step in which it ended.
        let looked = Looked { asked_at: seen.asked_at, answered_at: now };
        self.path.see(sample, judged == Ok(true), looked);
        self.publish(false);
        let rests = judged?;
        if let Some(skipped) = self.path.skipped() {
            self.robot.hub().happened(Event::StepsNotMade { steps: skipped });
            return Err(Cause::NotSeen);
        }
        let proof = self.path.end(sample, true).filter(|_| rests);
        if proof.is_some() && self.frames.is_empty() && self.path.done == self.path.steps().len() {
            return Ok(proof);
        }
        if rests && proof.is_none() && now - self.fed >= self.options.start_within {
            return Err(self.path.missed(sample).map_or(Cause::NotSeen, Cause::Elsewhere));
        }
        self.notice_progress(sample, now)?;
        Ok(None)
    }

    /// Returns the proof of the end of a motion whose steps cannot be counted, once the arm `rests`.
    fn judge_whole(
        &mut self,
        whole: Whole,
        sample: &Sample,
        rests: bool,
        now: Instant,
    ) -> Result<Option<EndProof>, Cause> {
        let started = self.rest.moved || now - self.fed >= self.options.start_within;
        if !(rests && started && self.frames.is_empty()) {
            return Ok(None);
        }
        let proof = match whole {
            // Its steps are gone, but the steps of a repeating list never leave it without a cause from
            // outside.
            Whole::Repeats => return Err(Cause::NotSeen),
            Whole::Appended => self.path.carried_out(sample, self.rest.moved)?,
        };
        self.path.done = self.path.steps().len();
        Ok(Some(proof))
    }

    /// Fails if there is no progress although no step lets the arm stand.
    fn notice_progress(&mut self, sample: &Sample, now: Instant) -> Result<(), Cause> {
        let (since, done, axes) = self.went_on;
        if sample.went_on_from(&axes) || done != self.path.done {
            self.went_on = (now, self.path.done, sample.axes);
            return Ok(());
        }
        let may_stand = match sample.list_length {
            Some(_) => self.path.may_stand(),
            None => self.path.all_may_stand(),
        };
        let after = now - since;
        match may_stand {
            Some(time) if after >= self.options.stall_within + time => Err(Cause::Stalled { after }),
            Some(_) | None => Ok(()),
        }
    }

    fn publish(&self, ended: bool) {
        let progress = Progress {
            total: self.path.steps().len(),
            left: self.path.accepted + self.in_doubt,
            accepted: self.path.accepted,
            done: self.path.done,
            ended,
        };
        self.progress.send_if_modified(|known| {
            let news = *known != progress;
            *known = progress;
            news
        });
    }
}

/// Waits until the motion's own handle asks to end it. Dropping the handle counts only if the options ask for
/// a stop then.
async fn asked(ended: &mut oneshot::Receiver<Wish>, stop_on_drop: bool) -> Cause {
    match ended.await {
        Ok(Wish::Stop) => Cause::StoppedHere,
        Ok(Wish::Release) => Cause::Released,
        Err(_dropped) if stop_on_drop => Cause::Dropped,
        Err(_dropped) => future::pending().await,
    }
}

/// Waits until a stop or a pause is announced on this connection.
async fn stopped(stops: &mut watch::Receiver<u64>) -> Cause {
    match stops.changed().await {
        Ok(()) => Cause::StoppedHere,
        // The task holds a handle, so the sender exists.
        Err(_gone) => future::pending().await,
    }
}
