//! What happens to instructions, as JSON lines for programs.

use std::time::Duration;

use r6_api::position::SHOWN_AXES;
use r6_api::{AxisPosition, CutShort, MotionEvent, Pose, Steps, Unit};
use r6_client::{Done, Missed, Progress, Unmet};
use serde_json::json;

use crate::cmd::job::ended::Ended;
use crate::cmd::stop;
use crate::exit::Failure;
use crate::output::problem::Code;
use crate::output::{readings, status};

/// A condition was not met, and nothing was sent. Stderr has already reported it.
pub fn not_sent(robot: &str, unmet: &[Unmet]) -> Failure {
    Failure::refused(format!("nothing was sent: {}", status::conditions(unmet)))
        .with_code(Code::NotReady)
        .member("event", "not_sent")
        .member("robot", robot)
        .member("unmet", status::unmet_json(unmet))
        .said()
}

/// The controller accepted a list.
#[derive(Clone, Copy, Debug)]
pub struct Accepted {
    /// How many instructions.
    pub instructions: usize,
    /// Whether it replaced the previous list.
    pub replaced_list: bool,
    /// Whether it repeats without end.
    pub repeats: bool,
    /// How long the answer took.
    pub after: Duration,
}

impl Accepted {
    /// The event for a list that was sent as a whole.
    pub fn whole(&self, robot: &str) -> MotionEvent {
        self.event(robot, None)
    }

    /// The event for a list of a stream, with the steps accepted so far and the progress of the motion.
    pub fn streamed(&self, robot: &str, accepted: usize, progress: &Progress) -> MotionEvent {
        self.event(robot, Some(steps(&Progress { accepted, ..*progress })))
    }

    fn event(&self, robot: &str, steps: Option<Steps>) -> MotionEvent {
        MotionEvent::Accepted {
            robot: robot.to_owned(),
            instructions: self.instructions,
            replaced_list: self.replaced_list,
            repeats: self.repeats,
            after_ms: readings::milliseconds(self.after),
            steps,
        }
    }
}

/// The event for the progress of a motion.
pub fn progress(robot: &str, progress: &Progress) -> MotionEvent {
    MotionEvent::Progress { robot: robot.to_owned(), steps: steps(progress) }
}

fn steps(progress: &Progress) -> Steps {
    let Progress { total, left, accepted, done, .. } = *progress;
    Steps { total, sent: left, accepted, done }
}

/// The event for an arm that stands at the end of the motion, with the proof of the end.
pub fn stands(robot: &str, done: &Done) -> MotionEvent {
    MotionEvent::Stands {
        robot: robot.to_owned(),
        took_s: readings::milliseconds(done.took) / 1e3,
        moved: done.moved,
        proof: done.proof.word().to_owned(),
        cut_short: done.proof.cut_short().map(cut_short),
        axes: AxisPosition::read(done.axes.get(..SHOWN_AXES).unwrap_or(&done.axes)),
        pose: Pose::of(&done.pose),
    }
}

/// Where the last move should have ended and where the arm stands. The unit of an axis is not known.
fn cut_short(missed: &Missed) -> CutShort {
    let unit = missed.of_pose.then_some(Unit::Millimetres);
    CutShort { axis: missed.name(), wanted: missed.wanted, found: missed.found, unit }
}

/// Adds event, steps and stop to the failure of a job, for programs: the steps if they were streamed, the
/// stop if the arm was stopped.
pub fn failed(ended: Ended) -> Failure {
    let Ended { mut failure, progress, stop } = ended;
    if !failure.members().contains_key("event") {
        failure = failure.member("event", "failed");
    }
    if let Some(progress) = &progress {
        failure = failure.member("steps", json!(steps(progress)));
    }
    if let Some(report) = &stop {
        failure = failure.member("stop", json!(stop::seen(report)));
    }
    failure
}
