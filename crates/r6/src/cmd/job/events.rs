//! What happens to instructions, as JSON lines for programs.

use std::time::Duration;

use r6_client::{Done, Missed, Progress, Unmet};
use serde_json::{Value, json};

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
    pub fn whole(&self, robot: &str) -> Value {
        json!({
            "event": "accepted",
            "robot": robot,
            "instructions": self.instructions,
            "replaced_list": self.replaced_list,
            "repeats": self.repeats,
            "after_ms": readings::milliseconds(self.after),
        })
    }

    /// The event for a list of a stream, with the steps accepted so far and the progress of the motion.
    pub fn streamed(&self, robot: &str, accepted: usize, progress: &Progress) -> Value {
        let mut event = self.whole(robot);
        event["steps"] = steps(&Progress { accepted, ..*progress });
        event
    }
}

/// The event for the progress of a motion.
pub fn progress(robot: &str, progress: &Progress) -> Value {
    json!({ "event": "progress", "robot": robot, "steps": steps(progress) })
}

fn steps(progress: &Progress) -> Value {
    let Progress { total, left, accepted, done, .. } = *progress;
    json!({ "total": total, "sent": left, "accepted": accepted, "done": done })
}

/// The event for an arm that stands at the end of the motion, with the proof of the end.
pub fn stands(robot: &str, done: &Done) -> Value {
    json!({
        "event": "stands",
        "robot": robot,
        "took_s": readings::milliseconds(done.took) / 1e3,
        "moved": done.moved,
        "proof": done.proof.word(),
        "cut_short": done.proof.cut_short().map(cut_short),
        "axes": status::axes_json(&done.axes),
        "pose": status::pose_json(&done.pose),
    })
}

/// Where the last move should have ended and where the arm stands. The unit of an axis is not known.
fn cut_short(missed: &Missed) -> Value {
    let unit = missed.of_pose.then_some("mm");
    json!({ "axis": missed.name(), "wanted": missed.wanted, "found": missed.found, "unit": unit })
}

/// Adds event, steps and stop to the failure of a job, for programs: the steps if they were streamed, the
/// stop if the arm was stopped.
pub fn failed(ended: Ended) -> Failure {
    let Ended { mut failure, progress, stop } = ended;
    if !failure.members().contains_key("event") {
        failure = failure.member("event", "failed");
    }
    if let Some(progress) = &progress {
        failure = failure.member("steps", steps(progress));
    }
    if let Some(report) = &stop {
        failure = failure.member("stop", stop::seen(report));
    }
    failure
}
