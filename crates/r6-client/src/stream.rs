//! Running a motion: checked first, then streamed, list by list, into the controller.
//!
//! # A long path
//!
//! `robot.run(&motion, options)`:
//!
//! 1. `moves.rs` has checked each step when it was added, in the types of `units.rs`.
//! 2. `path.rs` cuts the steps into frames by their encoded length.
//! 3. One motion at a time is streamed (`stream/turn.rs`). This file reads the state of the machine and asks
//!    the guard (`guard.rs`). If a condition is not met, it sends nothing.
//! 4. One errand (`stream/task.rs`) reads the state, sends what there is room for, and reads again.
//!    `path/progress.rs` says how much room there is: from `RemoteCmdLen`, or, if the firmware has none, from
//!    where the arm is on its path (`path/track.rs`).
//! 5. `path/pace.rs`, with its geometry in `path/way.rs`, judges steps that are gone from the list: the arm
//!    may have made them, or another client may have cleared them.
//! 6. If another connection answers, `evidence/restart.rs` says whether the controller was switched off and
//!    on.
//! 7. `handle.rs` reports the state of each step to the caller (`progress.rs`). `done.rs` says what proves
//!    the end.
//!
//! A motion that is appended to others (`RunOptions::append`) or repeats (`Motion::repeat`) takes the same
//! way. It is sent at once and as a whole, and `path/whole.rs` says what proves its end.

pub(crate) mod error;
pub(crate) mod options;
pub(crate) mod task;
pub(crate) mod turn;

use std::ops::Range;

use r6_proto::OperationMode;
use r6_proto::time::Instant;
use tokio::sync::{oneshot, watch};

use crate::conditions::ListGate;
use crate::error::RequestError;
use crate::evidence::{About, Observation};
use crate::guard::Start;
use crate::handle::MotionHandle;
use crate::job::{Terms, Work};
use crate::link::Lane;
use crate::moves::Motion;
use crate::moves::step_error::StepError;
use crate::observe::MOST_LOOKS;
use crate::path::progress::PathProgress;
use crate::path::track::standing_time;
use crate::path::{cut, frame};
use crate::progress::Progress;
use crate::robot::Robot;
use crate::settings::RobotSettings;
use crate::status::{Status, Unmet};
use crate::stop::report::StopReport;
pub use crate::stream::error::{Cause, MotionError, NotProved};
pub use crate::stream::options::RunOptions;
use crate::stream::task::{Task, Whole};

impl Robot {
    /// Runs a motion: checks it, looks at the machine, then streams it in lists that the controller takes.
    /// The first list replaces the controller's list. The others are appended while the arm moves, as soon as
    /// there is room.
    ///
    /// It returns once everything is checked; the handle reports what happens then. The progress of the arm
    /// is read from the length of the list (`RemoteCmdLen`) or, if the firmware has none, from the position
    /// of the arm. A list with an unknown outcome is never sent again: the motion ends there. If the
    /// connection is lost, the unsent rest is never sent ([`Cause::NotSent`]). A motion does not continue
    /// over another connection, nor is its end observed there ([`Cause::Unreadable`]).
    ///
    /// A motion that is appended ([`RunOptions::append`]) or repeats ([`Motion::repeat`]) is sent at once and
    /// as a whole.
    ///
    /// ```
    /// # #[tokio::main(flavor = "current_thread")]
    /// # async fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let builder = r6_sim::VirtualController::builder();
    /// # let controller = builder.clock(r6_sim::Clock::AsFastAsPossible).start().await?;
    /// # let address = controller.address().to_string();
    /// use r6_client::units::{AxisPosition, Percent};
    /// use r6_client::{Motion, Robot, RobotSettings, RunOptions};
    ///
    /// let robot = Robot::connect(&address, RobotSettings::default()).await?;
    /// let fast = Percent::new(50.0)?;
    /// let motion = (0..100).fold(Motion::new(), |motion, n| {
    ///     let target = AxisPosition::degrees([f64::from(n) / 4.0, 0.0, 10.0, 0.0, 30.0, 0.0]);
    ///     motion.axis_move(target, fast).blend(5)
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
    /// [`MotionError`]; nothing of the motion was sent. The causes:
    ///
    /// - a wrong step, or a step beyond the guard's envelope ([`Robot::with_guard`])
    /// - a condition of the machine that is not met, or a state that cannot be read
    /// - another motion that is being streamed. If it was stopped or paused, this waits for its
    ///   end, for 15 s at most
    /// - a failure of the previous motion that the program has not read yet ([`Cause::EarlierFailed`], once)
    /// - a stop that is still under way after 15 s ([`Cause::StoppedHere`])
    pub async fn run(&self, motion: &Motion, options: RunOptions) -> Result<MotionHandle, MotionError> {
        self.drive(self.begin(motion, options, None)).await
    }

    /// Runs a motion as [`Self::run`], but asks the gate before each list, and sends the list only under the
    /// conditions that the gate gives for it. For programs that hand motions on for others.
    ///
    /// A list that the gate refuses ends the motion with [`NotSent::Withdrawn`](crate::NotSent::Withdrawn),
    /// and so does a permission that is withdrawn before the list leaves. A list that was too late
    /// ([`crate::Conditions::leave_within`]) is tried again after the next read of the state, and the gate is
    /// asked each time. [`RunOptions::clear_leftover`] counts as `false`.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub async fn run_under(
        &self,
        motion: &Motion,
        options: RunOptions,
        gate: ListGate,
    ) -> Result<MotionHandle, MotionError> {
        let options = RunOptions { clear_leftover: false, ..options };
        self.drive(self.begin(motion, options, Some(gate))).await
    }

    async fn begin(
        &self,
        motion: &Motion,
        options: RunOptions,
        gate: Option<ListGate>,
    ) -> Result<MotionHandle, MotionError> {
        self.checked_and_begun(motion, options, gate).await.map_err(|cause| {
            let progress = Progress { total: motion.len(), ended: true, ..Progress::default() };
            MotionError { cause, progress, stop: None }
        })
    }

    async fn checked_and_begun(
        &self,
        motion: &Motion,
        options: RunOptions,
        gate: Option<ListGate>,
    ) -> Result<MotionHandle, Cause> {
        let wrong = |step, field, wanted| Cause::Step(StepError { step, field, wanted, nearest: None });
        let steps = motion.instructions().map_err(Cause::Step)?;
        if steps.is_empty() {
            return Err(wrong(0, "instructions", "one step at least"));
        }
        let frames = motion.lists(self.settings(), options).map_err(Cause::Step)?;
        let (turn, stops) = self.turn().await?;
        let lists = self.lists().await;
        let (status, about) = self.look_before(options).await?;
        if let Some(error) = status.step_beyond_axes(steps) {
            return Err(Cause::Step(error));
        }
        if status.list_length.is_none() && !motion.repeats() && ends_in_endless_wait(motion) {
            let wanted =
                "limited: this firmware does not tell the length of its list, and the end could not be seen";
            return Err(wrong(steps.len(), "isUnlimit", wanted));
        }
        if let Some(envelope) = self.guard() {
            // Appended steps begin where the list ends, and that place is unknown.
            let at_rest = status.moving == Some(false) && status.list_length == Some(0);
            let from = (!options.append || at_rest).then_some(Start { axes: status.axes, pose: status.pose });
            let checked = envelope.check(steps, motion.units(), from, self.reckoning());
            checked.map_err(Cause::OutsideEnvelope)?;
        }
        let (progress, watched) = watch::channel(Progress { total: steps.len(), ..Progress::default() });
        let (end, ended) = oneshot::channel();
        let path = PathProgress::new(steps.to_vec(), status.sample(), self.hub().time.now());
        let number = self.motions().begin();
        let whole = Whole::of(motion, options);
        let task = Task::new((self.clone(), about, number), (options, gate), whole, path, frames, progress);
        let task = self.errand(task.run(ended, stops, turn, lists));
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

    /// The frames that [`Self::run`] would send, in order. They differ from those on the wire only in
    /// `packID`: here they are numbered from 1, on the wire they are counted together with queries.
    ///
    /// Sends and reads nothing. Checks the guard's envelope, without the step from the present position.
    /// # Errors
    /// [`Cause`]: a wrong step, or a step beyond the envelope.
    pub fn dry_run(&self, motion: &Motion, options: RunOptions) -> Result<Vec<Vec<u8>>, Cause> {
        motion.instructions().map_err(Cause::Step)?;
        if let Some(guard) = self.guard() {
            guard.check_motion(motion).map_err(Cause::OutsideEnvelope)?;
        }
        motion.frames(self.settings(), options).map_err(Cause::Step)
    }

    /// Looks at the machine, and clears a leftover list if the options ask for it and it is possible. Returns
    /// the status, and the robot and connection that it was read from. Looks again if the calling task was
    /// slow, because the state may have changed.
    pub(crate) async fn look_before(&self, options: RunOptions) -> Result<(Status, About), Cause> {
        let mut last = self.hub().time.now();
        for _ in 0..MOST_LOOKS {
            let (status, about, asked_at) = self.look_once(options).await?;
            if self.is_recent(asked_at) {
                return Ok((status, about));
            }
            last = asked_at;
        }
        Err(Cause::Unreadable(self.too_slow(last)))
    }

    async fn look_once(&self, options: RunOptions) -> Result<(Status, About, Instant), Cause> {
        let (mut status, mut about, mut asked_at) = self.status_timed().await.map_err(Cause::Unreadable)?;
        let unmet = |status: &Status| -> Vec<Unmet> {
            let in_the_way = |unmet: &Unmet| match unmet {
                Unmet::Mode { found } => *found != options.idle_mode,
                // Appending to a list that runs is what appending is for.
                Unmet::Moving | Unmet::LeftoverList { .. } => !options.append,
                Unmet::Alarm { .. } | Unmet::NotHomed | Unmet::OtherProgram | Unmet::Unknown { .. } => true,
            };
            status.unmet().into_iter().filter(in_the_way).collect()
        };
        let mut found = unmet(&status);
        if options.clear_leftover && matches!(found.as_slice(), [Unmet::LeftoverList { .. }]) {
            // Only on this connection: the leftover list of another one was not looked at.
            let terms = Terms { only_on: Some(about.connection), ..Terms::default() };
            let clear = Work::AddRcc { replace: true, instructions: Vec::new() };
            self.accepted_on(terms, clear, Lane::Ordinary).await.map_err(Cause::NotCleared)?;
            (status, about, asked_at) = self.status_timed().await.map_err(Cause::Unreadable)?;
            found = unmet(&status);
        }
        if found.is_empty() { Ok((status, about, asked_at)) } else { Err(Cause::NotReady(found)) }
    }
}

impl Robot {
    /// Fails once another connection answers. After a power cycle a controller has an empty list, too, and
    /// may stand where the path ends; its list may belong to another client. `lost`: the cause to report if
    /// no better one is found.
    pub(crate) async fn same_connection(
        &self,
        about: &About,
        seen: &Observation,
        idle_mode: OperationMode,
        lost: Cause,
    ) -> Result<(), Cause> {
        if seen.is_about(about) {
            return Ok(());
        }
        if let Some(restart) = self.restart_since(about, seen, idle_mode).await {
            return Err(Cause::Restarted(restart));
        }
        // An alarm, or a mode in which nothing runs, is the better cause.
        seen.values.check(idle_mode)?;
        Err(lost)
    }

    /// Stops the arm if a step was sent and `stop` is set. Returns the result of that stop, or of another
    /// caller's stop.
    pub(crate) async fn stop_after(
        &self,
        cause: &Cause,
        stop: bool,
        progress: Progress,
    ) -> Option<Box<Result<StopReport, RequestError>>> {
        let stop = match cause {
            _ if stop && progress.left > 0 => Some(self.stop_now().await),
            // Another caller stops the arm. Wait for it, because the list may not be cleared before.
            Cause::StoppedHere if !stop => self.stop_under_way().await,
            _ => None,
        };
        stop.map(Box::new)
    }
}

impl Motion {
    /// The lists that [`Robot::run`] cuts this motion into: the steps of each, counted from 0.
    ///
    /// # Errors
    /// [`StepError`]: a wrong step, or a step that is too long for a frame of its own. Its field is `room` if
    /// the motion has to be sent as a whole (it is appended, or it repeats) and is too long for that.
    pub fn lists(
        &self,
        settings: &RobotSettings,
        options: RunOptions,
    ) -> Result<Vec<Range<usize>>, StepError> {
        let steps = self.instructions()?;
        if self.goes_whole(options) && steps.len() > options.room {
            let wanted =
                "no less than the steps of a motion that is appended or repeats: it is sent as a whole";
            return Err(StepError { step: 0, field: "room", wanted, nearest: None });
        }
        cut(steps, self.frame_starts(), settings, options.frame_length())
    }

    /// Whether it is sent at once: its progress cannot be observed if it is appended or repeats.
    fn goes_whole(&self, options: RunOptions) -> bool {
        options.append || self.repeats()
    }

    /// The frames of [`Robot::dry_run`], without a robot. No guard is checked: see
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
            frame(&settings.addressing(&pack_id), number == 0 && !options.append, listed)
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
