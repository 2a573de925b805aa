//! What happens to instructions, as JSON lines for programs.

use std::time::Duration;

use r6_client::{Done, Unmet};
use serde_json::{Value, json};

use super::frames::Batch;
use crate::exit::Failure;
use crate::output::{readings, status};

/// How many axes are told: as many as are asked for.
const AXES: usize = 6;

/// A condition was not met, and nothing was sent.
pub fn not_sent(robot: &str, unmet: &[Unmet]) -> Value {
    json!({ "event": "not_sent", "robot": robot, "unmet": status::unmet_json(unmet) })
}

/// The controller took a frame.
pub fn accepted(robot: &str, batch: &Batch, after: Duration) -> Value {
    json!({
        "event": "accepted",
        "robot": robot,
        "instructions": batch.instructions.len(),
        "replaced_list": batch.replace,
        "repeats": super::repeats(std::slice::from_ref(batch)),
        "after_ms": readings::milliseconds(after),
    })
}

/// The arm stands. Whether it stands where it should is told by what follows, and by the exit code.
pub fn stands(robot: &str, done: &Done) -> Value {
    json!({
        "event": "stands",
        "robot": robot,
        "took_s": readings::milliseconds(done.took) / 1e3,
        "moved": done.moved,
        "axes_deg": done.axes.iter().take(AXES).collect::<Vec<_>>(),
        "pose": status::pose_json(&done.pose),
    })
}

/// It did not come to what was asked for.
pub fn failed(failure: &Failure) -> Value {
    json!({
        "event": "failed",
        "message": failure.what(),
        "advice": failure.advice(),
        "exit_code": failure.exit().number(),
    })
}
