//! The task that streams one motion: it looks, sends what there is room for, and looks again.

use std::collections::VecDeque;
use std::future;
use std::ops::Range;
use std::time::Duration;

use r6_proto::axis::AXES;
use tokio::sync::{OwnedMutexGuard, OwnedSemaphorePermit, oneshot, watch};
use tokio::time::{Instant, sleep};

use crate::error::{NotSent, RequestError};
use crate::handle::Progress;
use crate::job::{Terms, Work};
use crate::link::Lane;
use crate::motion::{Done, Sample, WaitOptions, Watch};
use crate::path::progress::PathProgress;
use crate::robot::Robot;
use crate::stream::RunOptions;
use crate::stream::error::{Cause, MAX_FAILED, MotionError};

/// How a motion ended.
#[derive(Clone, Debug)]
pub(crate) struct Ended {
    pub result: Result<Done, MotionError>,
    /// Whether it was stopped because its handle asked for that, and for no other reason.
    pub stopped_as_asked: bool,
}

/// A motion that is being streamed.
#[derive(Debug)]
pub(super) struct Task {
    robot: Robot,
    /// The connection that it was looked on before the motion began: no other gets any of it. Whoever answers on another may have lost
    /// its list, or stand elsewhere.
    connection: u64,
    options: RunOptions,
    path: PathProgress,
    /// Until the first list is answered: it begins where the arm was seen to be.
    lists: Option<OwnedMutexGuard<()>>,
    /// What was not sent yet.
    frames: VecDeque<Range<usize>>,
    /// Steps of a frame that may have left and was not answered.
    in_doubt: usize,
    progress: watch::Sender<Progress>,
    begun: Instant,
    watch: Watch,
    /// When a list was last accepted.
    fed: Instant,
    failed: u32,
    /// When something last went on, how many steps were over, and where the axes were.
    went_on: (Instant, usize, [Option<f64>; AXES]),
}

impl Task {
    pub fn new(
        (robot, connection): (Robot, u64),
        options: RunOptions,
        path: PathProgress,
        frames: Vec<Range<usize>>,
        progress: watch::Sender<Progress>,
    ) -> Self {
        let begun = Instant::now();
        let wait = WaitOptions {
            settle: options.settle,
            start_within: options.start_within,
            idle_mode: options.idle_mode,
            ..WaitOptions::default()
        };
        Self {
            robot,
            connection,
            options,
            path,
            lists: None,
            frames: frames.into(),
            in_doubt: 0,
            progress,
            begun,
            watch: Watch::new(wait, begun),
            fed: begun,
            failed: 0,
            went_on: (begun, 0, [None; AXES]),
        }
    }

    /// Runs the motion until it has ended, in whatever way. `ended` is told when the arm is to stop, or is dropped.
    pub async fn run(
        mut self,
        mut ended: oneshot::Receiver<()>,
        mut stops: watch::Receiver<u64>,
        turn: OwnedSemaphorePermit,
        lists: OwnedMutexGuard<()>,
    ) -> Ended {
        self.lists = Some(lists);
        let mut asked_to_stop = false;
        let result = tokio::select! {
            biased;
            asked = &mut ended => {
                asked_to_stop = asked.is_ok();
                Err(match asked {
                    Ok(()) => (Cause::StoppedHere, true),
                    Err(_dropped) => (Cause::Dropped, self.options.stop_on_drop),
                })
            }
            cause = stopped(&mut stops) => Err((cause, false)),
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
        tracing::info!(%cause, ?progress, "the motion did not come to its end");
        let stop = match cause {
            _ if stop && progress.left > 0 => Some(self.robot.stop().await),
            // Somebody else stops the arm: until that is done, its list may not be cleared.
            Cause::StoppedHere if !stop => self.robot.stop_under_way().await,
            _ => None,
        };
        let stop = stop.map(Box::new);
        drop(turn);
        Ended { stopped_as_asked: asked_to_stop, result: Err(MotionError { cause, progress, stop }) }
    }

    async fn stream(&mut self) -> Result<Done, Cause> {
        loop {
            self.feed().await?;
            match self.robot.sample(Lane::Ordinary).await {
                Ok(sample) => {
                    self.failed = 0;
                    self.check_connection(&sample)?;
                    if self.judge(&sample, Instant::now())? {
                        return Ok(Done {
                            axes: sample.axes,
                            pose: sample.pose,
                            mode: sample.mode,
                            moved: self.watch.moved,
                            took: self.begun.elapsed(),
                        });
                    }
                }
                Err(error) => {
                    self.watch.missed();
                    self.failed += 1;
                    Cause::of_failed_read(error, self.failed)?;
                    // What cannot be seen is not fed.
                    sleep(self.options.interval).await;
                    continue;
                }
            }
            if !self.has_room() {
                sleep(self.options.interval).await;
            }
        }
    }

    /// Fails once the connection is another, unless it was seen to move before, and all steps to be over. A controller that was switched off and on has
    /// an empty list, too, and may stand where the path ends; what is in its list may be somebody else's.
    fn check_connection(&self, sample: &Sample) -> Result<(), Cause> {
        // It only counts upwards: if it is the first one still, the read was answered on it. A list that has not begun seems to be over, too.
        let over = self.watch.moved && self.path.done == self.path.steps().len();
        if over || self.robot.connection() == self.connection {
            return Ok(());
        }
        // An alarm, or a mode in which nothing runs, says more.
        sample.check(self.options.idle_mode)?;
        let lost = NotSent::Disconnected;
        Err(if self.frames.is_empty() { Cause::Unreadable(lost.into()) } else { lost.into() })
    }

    fn has_room(&self) -> bool {
        let fits = |frame: &Range<usize>| self.path.in_list() + frame.len() <= self.options.room.max(1);
        self.frames.front().is_some_and(fits)
    }

    /// Sends what there is room for. Every frame leaves once, whatever becomes of it; only one of which nothing has left is tried
    /// again.
    async fn feed(&mut self) -> Result<(), Cause> {
        while self.failed == 0
            && self.has_room()
            && let Some(frame) = self.frames.pop_front()
        {
            let replace = frame.start == 0;
            let steps = self.path.steps().get(frame.clone()).unwrap_or_default().to_vec();
            self.in_doubt = frame.len();
            self.publish(false);
            let list = Work::AddRcc { replace, instructions: steps };
            let terms = Terms { only_on: Some(self.connection), ..Terms::default() };
            let answer = self.robot.accepted_on(terms, list, Lane::Ordinary).await;
            match answer {
                Ok(_) => {
                    self.lists = None;
                    self.in_doubt = 0;
                    self.path.accepted = frame.end;
                    self.fed = Instant::now();
                    self.publish(false);
                }
                Err(RequestError::NotSent(NotSent::Busy { waited })) => {
                    self.in_doubt = 0;
                    self.frames.push_front(frame);
                    self.failed += 1;
                    if self.failed >= MAX_FAILED {
                        return Err(NotSent::Busy { waited }.into());
                    }
                }
                Err(error @ (RequestError::NotSent(_) | RequestError::Invalid(_))) => {
                    self.in_doubt = 0;
                    return Err(error.into());
                }
                // Controllers have run lists that they refused.
                Err(error @ (RequestError::Refused(_) | RequestError::OutcomeUnknown(_))) => {
                    return Err(error.into());
                }
            }
        }
        Ok(())
    }

    /// Takes in one read; `true` once the motion has come to its end.
    fn judge(&mut self, sample: &Sample, now: Instant) -> Result<bool, Cause> {
        // Without the length of the list, a wait in it looks like its end.
        self.watch.options.settle = match (sample.list_length, self.path.all_may_stand()) {
            (Some(_), _) => self.options.settle,
            (None, Some(time)) => self.options.settle + time,
            (None, None) => Duration::MAX,
        };
        let judged = self.watch.judge(*sample, now);
        // What ended the motion is told with the step that it ended in.
        self.path.see(sample, judged == Ok(true));
        self.publish(false);
        let rests = judged?;
        if rests && self.frames.is_empty() && self.path.done == self.path.steps().len() {
            return Ok(true);
        }
        if rests
            && now - self.fed >= self.options.start_within
            && let Some(missed) = self.path.end_of_accepted().missed(sample)
        {
            return Err(Cause::Elsewhere(missed));
        }
        self.notice_progress(sample, now)?;
        Ok(false)
    }

    /// Fails when nothing goes on, although no step says that the arm shall stand.
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

/// Ends when somebody wants the arm to stop.
async fn stopped(stops: &mut watch::Receiver<u64>) -> Cause {
    match stops.changed().await {
        Ok(()) => Cause::StoppedHere,
        // The task has a handle, so the sender is there.
        Err(_gone) => future::pending().await,
    }
}
