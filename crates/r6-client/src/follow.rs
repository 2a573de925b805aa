//! Following a moving target: one small step after the other, always towards the target's present place.
//!
//! It reads the state and sends one step at a time; `follow/step.rs` decides which. It shares with `run` the
//! check of the machine before the first step, the guard, and the one right to stream.

mod step;
mod target;

use std::time::Duration;

use r6_proto::OperationMode;
use r6_proto::address::Address;
use r6_proto::axis::AXES;
use r6_proto::time::Instant;

use crate::error::{NotSent, RequestError};
use crate::event::Event;
use crate::evidence::{About, Sample};
use crate::follow::step::Step;
pub use crate::follow::target::{TargetSender, Targets};
use crate::guard::{Start, Violation};
use crate::job::{Terms, Work};
use crate::link::Lane;
use crate::moves::step_error::StepError;
use crate::path::place::Place;
use crate::progress::Progress;
use crate::robot::Robot;
use crate::status::Status;
use crate::stream::error::{Cause, MotionError};
use crate::stream::options::RunOptions;
use crate::units::{AxisPosition, Degrees, Percent};

/// Steps in the controller's list at most, if the arm is fed while it moves: its present step and the next
/// one. The arm would make further steps although the target is elsewhere by then.
const MOST_IN_LIST: i64 = 2;

/// The shortest time between two looks at target and arm. Controllers take up to 26 ms to answer, and more
/// questions would only queue up.
const SHORTEST_INTERVAL: Duration = Duration::from_millis(20);

/// The speed at which an operator's arm followed small steps without problems (reported).
const SPEED: Percent = match Percent::new(20.0) {
    Ok(speed) => speed,
    Err(_) => Percent::MAX,
};

/// How a moving target is followed.
///
/// The protocol has no command for it: each step is an instruction of its own. **Small steps without a pause
/// have overloaded the servos of a real arm** (reported). Its operator cut the speed to 20 %, made the steps
/// larger, and sent each only while the arm stood. The default does just that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowOptions {
    /// The time between two looks at target and arm: 20 ms at least. Default 50 ms: 20 times a second.
    pub interval: Duration,
    /// The speed of each step. Default 20 %.
    pub speed: Percent,
    /// The smallest step: nearer than this the arm stays where it is. Above 0, and no more than
    /// [`Self::largest_step`]. Default 1°; mm if an axis slides.
    pub smallest_step: Degrees,
    /// The largest step of an axis: if the target is further away, all axes go the same share of their way.
    /// Above 0, and finite. Default 10°; mm if an axis slides.
    ///
    /// It also bounds how far the arm still moves after targets, program or link are gone: two such steps.
    pub largest_step: Degrees,
    /// Whether a step may be appended while the arm makes the one before. The arm then follows more closely
    /// and rounds the corners; two steps at most are in its list. Default no. On a real arm try it at low
    /// speed, and watch the load of the servos (`curTorque-n`). It has no effect on firmware that does not
    /// report the length of its list (`RemoteCmdLen`).
    pub while_moving: bool,
    /// How long after [`TargetSender::send`] a target counts and a step towards it may still be sent, if no
    /// further target arrives, not even the same one. Above 0. Default 500 ms. A source that hangs must not
    /// keep the arm moving.
    pub fresh_within: Duration,
    /// How long after a step was accepted the arm may stand elsewhere than at the step's end. Default 1 s.
    pub start_within: Duration,
    /// How long a step may take without any progress. Default 5 s.
    pub stall_within: Duration,
    /// As [`crate::WaitOptions::idle_mode`].
    pub idle_mode: OperationMode,
    /// Whether to stop the arm and clear its list if following fails after a step was sent. Default yes.
    pub stop_on_failure: bool,
}

impl Default for FollowOptions {
    fn default() -> Self {
        let run = RunOptions::default();
        Self {
            interval: run.interval,
            speed: SPEED,
            smallest_step: Degrees(1.0),
            largest_step: Degrees(10.0),
            while_moving: false,
            fresh_within: Duration::from_millis(500),
            start_within: run.start_within,
            stall_within: run.stall_within,
            idle_mode: run.idle_mode,
            stop_on_failure: run.stop_on_failure,
        }
    }
}

impl FollowOptions {
    /// Refuses options that following cannot work with.
    fn check(&self) -> Result<(), StepError> {
        let (smallest, largest) = (self.smallest_step.value(), self.largest_step.value());
        let wanted = [
            (largest > 0.0 && largest.is_finite(), "largest_step", "above 0, and finite"),
            (
                smallest > 0.0 && smallest <= largest,
                "smallest_step",
                "above 0, and no more than `largest_step`",
            ),
            (self.interval >= SHORTEST_INTERVAL, "interval", "20 ms at least"),
            (self.fresh_within > Duration::ZERO, "fresh_within", "above 0"),
        ];
        match wanted.into_iter().find(|(holds, _, _)| !holds) {
            Some((_, field, wanted)) => Err(StepError { step: 0, field, wanted, nearest: None }),
            None => Ok(()),
        }
    }
}

/// Result of following a target until its source ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Followed {
    /// Steps that were made.
    pub steps: usize,
    /// Where the arm stands: J1 is `axes[0]`. Degrees, or mm if an axis slides; `None` where not known.
    pub axes: [Option<f64>; AXES],
    /// How far the farthest axis is from the last target sent, whether or not a step towards it was made.
    /// `None` if no target was sent, or if the position of one of its axes is unknown.
    pub behind: Option<Degrees>,
}

impl Robot {
    /// Follows a target until its sender is dropped, then waits until the arm stands.
    ///
    /// Each time the arm is ready for another step, the newest target counts; older ones are skipped. A step
    /// is never sent again. Sending ends once the sender is gone, targets are no longer fresh, the state
    /// cannot be read, the connection was lost, or a handle of this connection sends a stop. The sender may
    /// be dropped before the arm has arrived: to reach the last target, keep sending it.
    ///
    /// Dropping the future ends it too: the arm finishes the step or two in its list. To stop it at once call
    /// [`Robot::stop`].
    ///
    /// ```
    /// # #[tokio::main(flavor = "current_thread")]
    /// # async fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let controller = r6_sim::VirtualController::start().await?;
    /// # let address = controller.address().to_string();
    /// use std::time::Duration;
    /// use r6_client::units::AxisPosition;
    /// use r6_client::{FollowOptions, Robot, RobotSettings, TargetSender};
    ///
    /// let robot = Robot::connect(&address, RobotSettings::default()).await?;
    /// let (target, targets) = TargetSender::new();
    /// let source = async move {
    ///     for n in 0..10 {
    ///         target.send(AxisPosition::degrees([f64::from(n)]));
    ///         tokio::time::sleep(Duration::from_millis(50)).await;
    ///     }
    /// };
    /// let (followed, ()) = tokio::join!(robot.follow(targets, FollowOptions::default()), source);
    /// let followed = followed?;
    /// println!("{} steps, {:?} from the last target", followed.steps, followed.behind);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// [`MotionError`]: as for [`Robot::run`]; its steps are those that were sent. [`Cause::Step`] names an
    /// option that following cannot work with, before anything is sent.
    pub async fn follow(&self, targets: Targets, options: FollowOptions) -> Result<Followed, MotionError> {
        self.drive(self.follow_now(targets, options)).await
    }

    async fn follow_now(&self, targets: Targets, options: FollowOptions) -> Result<Followed, MotionError> {
        let failed = |cause| MotionError {
            cause,
            progress: Progress { ended: true, ..Progress::default() },
            stop: None,
        };
        options.check().map_err(|error| failed(Cause::Step(error)))?;
        let (turn, mut stops) = self.turn().await.map_err(failed)?;
        let ready = RunOptions { idle_mode: options.idle_mode, ..RunOptions::default() };
        let (status, about) = self.look_before(ready).await.map_err(failed)?;
        let mut following = Following::new((self, about), targets, options, status);
        let (cause, stop) = tokio::select! {
            biased;
            // This handle keeps the sender alive.
            _stopped = stops.changed() => (Cause::StoppedHere, false),
            // The arm finishes its present step.
            () = self.is_closing() => (Cause::Closed, false),
            result = following.run() => match result {
                Ok(followed) => return Ok(followed),
                Err(cause) => (cause, options.stop_on_failure),
            },
        };
        let left = following.progress.left;
        let progress = Progress { total: left, ended: true, ..following.progress };
        self.hub().happened(Event::FollowingEnded { cause: cause.clone(), progress });
        let stop = self.stop_after(&cause, stop, progress).await;
        drop(turn);
        Err(MotionError { cause, progress, stop })
    }
}

/// A target that is being followed.
struct Following<'r> {
    robot: &'r Robot,
    /// The robot and connection that it began on: steps are sent to no other.
    about: About,
    /// The status before it began.
    status: Status,
    targets: Targets,
    options: FollowOptions,
    target: AxisPosition,
    /// When the target was sent; `None` before the first one.
    told_at: Option<Instant>,
    /// Where the arm stands once all sent steps are done.
    commanded: [Option<f64>; AXES],
    /// Where the last step ends, while it may be under way, and when it was accepted.
    under_way: Option<(Place, Instant)>,
    /// When an axis last moved, and where it was.
    went_on: (Instant, [Option<f64>; AXES]),
    /// The sent steps are all there are: following has no known total.
    progress: Progress,
    failed: u32,
}

impl<'r> Following<'r> {
    fn new(
        (robot, about): (&'r Robot, About),
        targets: Targets,
        options: FollowOptions,
        status: Status,
    ) -> Self {
        let now = robot.hub().time.now();
        let axes = status.axes;
        Self {
            robot,
            about,
            status,
            targets,
            options,
            target: AxisPosition::none(),
            told_at: None,
            commanded: axes,
            under_way: None,
            went_on: (now, axes),
            progress: Progress::default(),
            failed: 0,
        }
    }

    async fn run(&mut self) -> Result<Followed, Cause> {
        let time = &self.robot.hub().time;
        let mut next = time.now();
        loop {
            time.sleep_until(next).await;
            // A late look delays the looks after it.
            next = time.now() + self.options.interval;
            // No other list is sent between the look and the answer.
            let _lists = self.robot.lists().await;
            let seen = match self.robot.observe(Lane::Ordinary).await {
                Ok(seen) => seen,
                Err(error) => {
                    self.missed_a_read(error)?;
                    continue;
                }
            };
            let sample = seen.values;
            if let Some(address) = unreadable(&sample) {
                self.missed_a_read(RequestError::no_value(address))?;
                continue;
            }
            self.failed = 0;
            // Another connection shows nothing about a step sent on this one, and gets no step.
            let lost = Cause::Unreadable(NotSent::Disconnected.into());
            self.robot.same_connection(&self.about, &seen, self.options.idle_mode, lost).await?;
            self.judge(&sample, self.now())?;
            let ended = self.look_at_target();
            if ended && self.under_way.is_none() {
                let told = self.told_at.and_then(|_| step::farthest(&sample.axes, &self.target));
                let behind = told.map(Degrees);
                return Ok(Followed { steps: self.progress.done, axes: sample.axes, behind });
            }
            let is_recent = self.robot.is_recent(seen.asked_at);
            if !ended && is_recent && self.target_is_fresh() && self.has_room(&sample) {
                self.step(&sample).await?;
            }
        }
    }

    /// Takes in the newest target; `true` once there is no sender any more.
    fn look_at_target(&mut self) -> bool {
        let (told, ended) = self.targets.newest(self.now());
        (self.target, self.told_at) = (told.target, told.at);
        ended
    }

    fn target_is_fresh(&self) -> bool {
        self.told_at.is_some_and(|at| self.now() - at <= self.options.fresh_within)
    }

    fn now(&self) -> Instant {
        self.robot.hub().time.now()
    }

    fn missed_a_read(&mut self, error: RequestError) -> Result<(), Cause> {
        self.failed += 1;
        Cause::of_failed_read(error, self.failed)
    }

    /// Judges the machine and the step under way by this sample.
    fn judge(&mut self, sample: &Sample, now: Instant) -> Result<(), Cause> {
        sample.check(self.options.idle_mode)?;
        // A step behind another client's list would begin at an unknown place.
        let own = match self.under_way {
            None => 0,
            Some(_) if self.options.while_moving => MOST_IN_LIST,
            Some(_) => 1,
        };
        if let Some(length) = sample.list_length.filter(|length| *length > own) {
            return Err(Cause::AnotherList { length });
        }
        let (since, before) = self.went_on;
        if sample.went_on_from(&before) {
            self.went_on = (now, sample.axes);
        }
        let rests = sample.moving == Some(false) && sample.list_length.unwrap_or(0) == 0;
        match self.under_way {
            Some((end, accepted)) if rests => match end.missed(sample) {
                None => self.under_way = None,
                // A controller may answer before it reports that it moves.
                Some(missed) if now - accepted >= self.options.start_within => {
                    return Err(Cause::Elsewhere(missed));
                }
                Some(_) => {}
            },
            Some((_, accepted)) if now - since.max(accepted) >= self.options.stall_within => {
                return Err(Cause::Stalled { after: now - since.max(accepted) });
            }
            Some(_) | None => {}
        }
        let left = match (self.under_way, sample.list_length) {
            (None, _) => 0,
            (Some(_), length) => usize::try_from(length.unwrap_or(1)).unwrap_or(1).max(1),
        };
        self.progress.done = self.progress.done.max(self.progress.accepted.saturating_sub(left));
        if self.under_way.is_none() {
            self.commanded = sample.axes;
        }
        Ok(())
    }

    fn has_room(&self, sample: &Sample) -> bool {
        let room = sample.list_length.is_some_and(|length| length < MOST_IN_LIST);
        // Between the acknowledgement and the first move, a list that is not empty may seem to be.
        let begun = self.under_way.is_none_or(|(_, accepted)| accepted <= self.went_on.0);
        match self.under_way {
            None => sample.moving == Some(false),
            Some(_) => self.options.while_moving && room && begun,
        }
    }

    /// Sends one step towards the target, unless the step would be too small.
    async fn step(&mut self, sample: &Sample) -> Result<(), Cause> {
        let Some(Step { to, end }) = step::towards(&self.commanded, &self.target, &self.options) else {
            return Ok(());
        };
        let instruction = step::instruction(to, &self.options).map_err(Cause::Step)?;
        if let Some(error) = self.status.step_beyond_axes(&[instruction]) {
            return Err(Cause::Step(error));
        }
        if let Some(guard) = self.robot.guard() {
            let from = Start { axes: self.commanded, pose: sample.pose };
            // Steps are counted from the first one sent, as in the progress.
            let counted =
                |violation: Violation| Violation { step: self.progress.left + violation.step, ..violation };
            guard
                .check(&[instruction], &[to.units()], Some(from), self.robot.reckoning())
                .map_err(counted)
                .map_err(Cause::OutsideEnvelope)?;
        }
        let place = Place::of(&instruction.action);
        self.progress.left += 1;
        // A step that waits behind other requests must not be sent towards an outdated target.
        let leave_by = self.told_at.map(|at| at + self.options.fresh_within);
        let terms = Terms { leave_by, only_on: Some(self.about.connection), ..Terms::default() };
        let step = Work::AddRcc { replace: false, instructions: vec![instruction] };
        match self.robot.accepted_on(terms, step, Lane::Ordinary).await {
            Ok(_) => {
                self.progress.accepted = self.progress.left;
                self.commanded = end;
                self.under_way = Some((place, self.now()));
                Ok(())
            }
            Err(error) => {
                self.progress.left -= usize::from(error.nothing_left());
                match error {
                    // By the next look the target is elsewhere.
                    RequestError::NotSent(NotSent::Busy { .. }) => Ok(()),
                    error => Err(error.into()),
                }
            }
        }
    }
}

/// The address of a value that is missing and without which the arm cannot be judged.
fn unreadable(sample: &Sample) -> Option<Address> {
    match (sample.alarm, sample.mode, sample.moving) {
        (None, _, _) => Some(Address::CurAlarm),
        (_, None, _) => Some(Address::CurMode),
        (_, _, None) => Some(Address::IsMoving),
        (Some(_), Some(_), Some(_)) => None,
    }
}
