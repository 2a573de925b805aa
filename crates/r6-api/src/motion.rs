//! Commands, motions and stops: what became of them.

use serde::{Deserialize, Serialize};

use crate::{AxisPosition, CommandProblem, Pose, Unit};

/// A command that the controller accepted. This does not mean that anything moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CommandAccepted {
    /// The address of the robot.
    pub robot: String,
    /// The command.
    pub command: String,
    /// Always `true`.
    pub accepted: bool,
    /// How long the reply took.
    pub after_ms: f64,
    /// What the arguments mean, in words; `null` if the command alone says it.
    pub means: Option<String>,
    /// The arguments as sent.
    pub on_the_wire: Vec<String>,
}

/// An event of a motion. Its word is in `event`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum MotionEvent {
    /// The controller accepted a list.
    Accepted {
        /// The address of the robot.
        robot: String,
        /// How many instructions the list has.
        instructions: usize,
        /// Whether it replaced the previous list.
        replaced_list: bool,
        /// Whether it repeats without end.
        repeats: bool,
        /// How long the reply took.
        after_ms: f64,
        /// The steps of the whole motion, if it is sent in several lists.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        steps: Option<Steps>,
    },
    /// The controller went on.
    Progress {
        /// The address of the robot.
        robot: String,
        /// The steps of the motion.
        steps: Steps,
    },
    /// The arm stands at the end of the motion.
    Stands {
        /// The address of the robot.
        robot: String,
        /// How long the motion took.
        took_s: f64,
        /// Whether the arm was seen to move.
        moved: bool,
        /// What proves the end: `reached`, `consumed`, `cut_short` or `at_rest`.
        proof: String,
        /// By how much the arm misses the end of the last move, if an input cut that move short.
        cut_short: Option<CutShort>,
        /// The axes, J1 first.
        axes: Vec<AxisPosition>,
        /// The pose of the tool in use, in the work frame in use.
        pose: Pose,
    },
}

/// How many steps of a motion are where.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Steps {
    /// All steps.
    pub total: usize,
    /// Sent to the controller.
    pub sent: usize,
    /// Accepted by the controller.
    pub accepted: usize,
    /// Seen to be done.
    pub done: usize,
}

/// Where a move should have ended, and where the arm stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CutShort {
    /// `J1` to `J8`, or `X` to `W` of the pose.
    pub axis: String,
    /// Where it should be.
    pub wanted: f64,
    /// Where it is; `null` if it could not be read.
    pub found: Option<f64>,
    /// `null` for an axis, because the protocol does not say whether it turns or slides.
    pub unit: Option<Unit>,
}

/// What became of a stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct StopReport {
    /// The address of the robot; absent if the report is a part of the report of a motion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    /// Whether it is proved that the arm stands. If not, use the emergency stop.
    pub confirmed: bool,
    /// The proof: `not_running` or `empty_list`.
    pub proof: Option<String>,
    /// The last request that was sent before that, by its word on the wire.
    pub means: Option<String>,
    /// The state of a second connection: `used`, `answered`, `silent`, `opening`, `not_made` or
    /// `unidentified`; `null` if the first answer was in time.
    pub second_connection: Option<String>,
    /// Whether a frame that can move the arm is still unanswered; `null` if there was none.
    pub in_doubt: Option<bool>,
    /// How many stops were sent.
    pub attempts: u32,
    /// The time until the standstill was proved, or the stop was given up.
    pub took_ms: f64,
    /// Whether the arm moves (`isMoving`).
    pub moving: Option<bool>,
    /// The operation mode (`curMode`).
    pub mode: Option<i64>,
    /// The alarm, 0 for none (`curAlarm`).
    pub alarm: Option<i64>,
    /// How many instructions are left in the list (`RemoteCmdLen`).
    pub list_length: Option<i64>,
    /// What became of the instructions that were left: `was_empty`, `cleared`, `refused`, `unknown` or
    /// `not_tried`.
    pub list: String,
    /// Why the stop failed; absent if it is confirmed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<CommandProblem>,
}
