//! Running a motion: checked first, then streamed, list by list, into the controller.

mod error;
mod task;

use std::ops::Range;
use std::time::Duration;

use r6_proto::OperationMode;
use tokio::sync::{oneshot, watch};
use tokio::time::Instant;

use crate::evidence::About;
use crate::guard::Start;
use crate::handle::{MotionHandle, Progress};
use crate::job::{Terms, Work};
use crate::link::Lane;
use crate::motion::WaitOptions;
use crate::moves::{Motion, StepError};
use crate::path::progress::{PathProgress, standing_time};
use crate::path::{cut, envelope, frame};
use crate::robot::Robot;
use crate::settings::RobotSettings;
use crate::status::{Status, Unmet};
pub use crate::stream::error::{Cause, MotionError};
pub(crate) use crate::stream::task::Ended;
use crate::stream::task::Task;

/// How a motion is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunOptions {
    /// The pause between the answer to one read of the state and the next read. Default 50 ms, which real
    /// controllers bear for hours. There is no minimum: with 0 the state is read as fast as answers come.
    pub interval: Duration,
    /// Instructions in one frame at most, within [`crate::RobotSettings::max_frame_bytes`]. Default 8: eight were always
    /// answered, ten to sixteen never on one unit (reported, unit A), and nobody knows whether their number counts or
    /// their bytes.
    pub frame_instructions: usize,
    /// Instructions in the controller's list at most. Default 24: three frames, so that one can be late by the time of
    /// sixteen moves. How much room real lists have is not known; 17 in one go were streamed (reported, unit A).
    ///
    /// What is in the list runs on when the connection breaks.
    pub room: usize,
    /// As [`WaitOptions::settle`].
    pub settle: Duration,
    /// How long after a list was accepted the arm may stand elsewhere than at its end, with an empty list. Default 1 s.
    pub start_within: Duration,
    /// How long the arm may stand without progress, waits and delays of the motion apart. Default 5 s.
    pub stall_within: Duration,
    /// As [`WaitOptions::idle_mode`].
    pub idle_mode: OperationMode,
    /// Whether a list that is left from before is cleared first, if nothing else is in the way. Default: no, it is told.
    pub clear_leftover: bool,
    /// Whether the arm is stopped and its list cleared ([`Robot::stop`]) when the motion fails after something has left:
    /// outcome unknown, alarm, another mode, no progress. Default: yes.
    pub stop_on_failure: bool,
    /// Whether the arm is stopped when the handle is dropped, or the robot's handle is closed ([`Robot::close`]). Default: no. A motion
    /// whose handle was dropped is then streamed on to its end; one whose robot was closed ends with what is in its list.
    pub stop_on_drop: bool,
}

impl Default for RunOptions {
    fn default() -> Self {
        let wait = WaitOptions::default();
        Self {
            interval: wait.interval,
            frame_instructions: 8,
            room: 24,
            settle: wait.settle,
            start_within: wait.start_within,
            stall_within: Duration::from_secs(5),
            idle_mode: wait.idle_mode,
            clear_leftover: false,
            stop_on_failure: true,
            stop_on_drop: false,
        }
    }
}

impl RunOptions {
    /// Instructions in one frame at most: no more than there is room for.
    fn frame_length(&self) -> usize {
        self.frame_instructions.min(self.room).max(1)
    }
}

impl Robot {
    /// Runs a motion: checks it, looks at the machine, then streams it in lists that the controller takes. The first
    /// replaces the list, the others are appended while the arm moves, as soon as there is room.
    ///
    /// It returns once everything is checked; what then happens is told by the handle. How far the arm is, is read from the
    /// length of the list (`RemoteCmdLen`), or, from firmware without it, from where the arm is. A list whose outcome is
    /// unknown is never sent again: the motion ends there. What has not left when the connection is lost never does
    /// ([`Cause::NotSent`]): no motion goes on over another connection by itself, nor is its end seen there
    /// ([`Cause::Unreadable`]).
    ///
    /// ```
    /// # #[tokio::main(flavor = "current_thread")]
    /// # async fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let controller = r6_sim::VirtualController::builder().clock(r6_sim::Clock::AsFastAsPossible).start().await?;
    /// # let address = controller.address().to_string();
    /// use r6_client::units::{AxisPosition, Percent};
    /// use r6_client::{Motion, Robot, RobotSettings, RunOptions};
    ///
    /// let robot = Robot::connect(&address, RobotSettings::default()).await?;
    /// let fast = Percent::new(50.0)?;
    /// let motion = (0..100).fold(Motion::new(), |motion, n| {
    ///     motion.axis_move(AxisPosition::degrees([f64::from(n) / 4.0, 0.0, 10.0, 0.0, 30.0, 0.0]), fast).blend(5)
    /// });
    /// let handle = robot.run(&motion, RunOptions::default()).await?;
    /// let mut middle = handle.step(50).expect("there are a hundred");
    /// assert!(middle.done().await);
    /// let done = handle.finished().await?;
    /// assert_eq!(done.axes[0], Some(24.75));
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// [`MotionError`], nothing of the motion was sent: a wrong step, a step beyond the guard's envelope
    /// ([`Robot::with_guard`]), a condition of the machine that is not met, another motion that is being streamed, or
    /// a state that cannot be read; or the motion before this one failed, and nobody has asked what became of it
    /// ([`Cause::EarlierFailed`], once). A stop that is under way is waited for, 15 s at most ([`Cause::StoppedHere`]).
    pub async fn run(&self, motion: &Motion, options: RunOptions) -> Result<MotionHandle, MotionError> {
        let failed = |cause| MotionError {
            cause,
            progress: Progress { total: motion.len(), ended: true, ..Progress::default() },
            stop: None,
        };
        let steps = motion.instructions().map_err(|error| failed(Cause::Step(error)))?;
        if steps.is_empty() {
            let wanted = "one step at least";
            return Err(failed(Cause::Step(StepError {
                step: 0,
                field: "instructions",
                wanted,
                nearest: None,
            })));
        }
        let frames = cut(steps, self.settings(), options.frame_length())
            .map_err(|error| failed(Cause::Step(error)))?;
        let (turn, stops) = self.turn().await.map_err(failed)?;
        let lists = self.lists().await;
        let (status, about) = self.look_before(options).await.map_err(failed)?;
        let sample = status.sample();
        if let Some(error) = status.step_beyond_axes(steps) {
            return Err(failed(Cause::Step(error)));
        }
        if status.list_length.is_none() && ends_in_endless_wait(motion) {
            let wanted =
                "limited: this firmware does not tell the length of its list, and nobody could see the end";
            let error = StepError { step: steps.len(), field: "isUnlimit", wanted, nearest: None };
            return Err(failed(Cause::Step(error)));
        }
        if let Some(envelope) = self.guard() {
            let from = Start { axes: status.axes, pose: status.pose };
            envelope
                .check(steps, motion.units(), Some(from), self.reckoning())
                .map_err(|violation| failed(Cause::OutsideEnvelope(violation)))?;
        }
        let (progress, watched) = watch::channel(Progress { total: steps.len(), ..Progress::default() });
        let (end, ended) = oneshot::channel();
        let path = PathProgress::new(steps.to_vec(), sample, Instant::now());
        let number = self.motions().begin();
        let task = Task::new((self.clone(), about, number), options, path, frames, progress);
        let task = tokio::spawn(task.run(ended, stops, turn, lists));
        Ok(MotionHandle {
            robot: self.clone(),
            number,
            progress: watched,
            end: Some(end),
            task,
            outcome: None,
            steps: steps.to_vec(),
        })
    }

    /// The frames that [`Self::run`] would send, in their order, byte by byte but for `packID`: here they are numbered from
    /// 1, and on the wire they are counted together with queries.
    ///
    /// Nothing is sent and nothing is asked. A guard is consulted, without the step from the present position.
    ///
    /// # Errors
    /// [`Cause`]: a wrong step, or one beyond the envelope.
    pub fn dry_run(&self, motion: &Motion, options: RunOptions) -> Result<Vec<Vec<u8>>, Cause> {
        motion.instructions().map_err(Cause::Step)?;
        if let Some(guard) = self.guard() {
            guard.check_motion(motion).map_err(Cause::OutsideEnvelope)?;
        }
        motion.frames(self.settings(), options).map_err(Cause::Step)
    }

    /// Looks at the machine, and clears a list that is left over if that is wished and possible. Tells whom it looked at, over which
    /// connection.
    pub(crate) async fn look_before(&self, options: RunOptions) -> Result<(Status, About), Cause> {
        let (mut status, mut about) = self.status_seen().await.map_err(Cause::Unreadable)?;
        let unmet = |status: &Status| -> Vec<Unmet> {
            let idle = |unmet: &Unmet| matches!(unmet, Unmet::Mode { found } if *found == options.idle_mode);
            status.unmet().into_iter().filter(|unmet| !idle(unmet)).collect()
        };
        let mut found = unmet(&status);
        if options.clear_leftover && matches!(found.as_slice(), [Unmet::LeftoverList { .. }]) {
            // What is left over on another connection was not looked at.
            let terms = Terms { only_on: Some(about.connection), ..Terms::default() };
            let clear = Work::AddRcc { replace: true, instructions: Vec::new() };
            self.accepted_on(terms, clear, Lane::Ordinary).await.map_err(Cause::NotCleared)?;
            (status, about) = self.status_seen().await.map_err(Cause::Unreadable)?;
            found = unmet(&status);
        }
        if found.is_empty() { Ok((status, about)) } else { Err(Cause::NotReady(found)) }
    }
}

impl Motion {
    /// The lists that [`Robot::run`] cuts this motion into: which steps are in each, counted from 0.
    ///
    /// # Errors
    /// [`StepError`]: a wrong step, or one that is too long for a frame of its own.
    pub fn lists(
        &self,
        settings: &RobotSettings,
        options: RunOptions,
    ) -> Result<Vec<Range<usize>>, StepError> {
        cut(self.instructions()?, settings, options.frame_length())
    }

    /// The frames of [`Robot::dry_run`], for which no robot is needed. No guard is consulted: see
    /// [`crate::Envelope::check_motion`].
    ///
    /// # Errors
    /// As [`Self::lists`].
    pub fn frames(&self, settings: &RobotSettings, options: RunOptions) -> Result<Vec<Vec<u8>>, StepError> {
        let steps = self.instructions()?;
        let encoded = |(number, list): (usize, Range<usize>)| {
            let first = list.start + 1;
            let pack_id = (number + 1).to_string();
            let listed = steps.get(list).unwrap_or_default();
            frame(&envelope(settings, &pack_id), number == 0, listed)
                .map_err(|error| StepError::of(first, &error))
        };
        self.lists(settings, options)?.into_iter().enumerate().map(encoded).collect()
    }
}

/// Whether the motion ends in a wait without a limit.
fn ends_in_endless_wait(motion: &Motion) -> bool {
    use r6_proto::message::Action;
    let steps = motion.instructions().unwrap_or_default();
    let moves = |action: &Action| {
        matches!(action, Action::AxisMove(_) | Action::LinearMove(_) | Action::CurveMove(_))
    };
    steps.iter().rev().take_while(|step| !moves(&step.action)).any(|step| standing_time(step).is_none())
}
