//! What happens to instructions, as JSON lines for programs.

use std::time::Duration;

use r6_client::{Done, EndProof, Missed, Progress, Unmet};
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
        "proof": proof(&done.proof),
        "cut_short": cut_short(&done.proof),
        "axes": status::axes_json(&done.axes),
        "pose": status::pose_json(&done.pose),
    })
}

/// The word for the proof of the end.
fn proof(proof: &EndProof) -> &'static str {
    match proof {
        EndProof::Reached => "reached",
        EndProof::Consumed => "consumed",
        EndProof::CutShort(_) => "cut_short",
        EndProof::AtRest => "at_rest",
    }
}

/// Where the last move should have ended and where the arm stands, if an input cut that move short.
fn cut_short(proof: &EndProof) -> Option<Value> {
    match proof {
        EndProof::CutShort(Missed { axis, of_pose, wanted, found }) => {
            let (axis, unit) =
                if *of_pose { (axis.world_name().to_owned(), "mm") } else { (axis.to_string(), "deg") };
            Some(json!({ "axis": axis, "wanted": wanted, "found": found, "unit": unit }))
        }
        EndProof::Reached | EndProof::Consumed | EndProof::AtRest => None,
    }
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
