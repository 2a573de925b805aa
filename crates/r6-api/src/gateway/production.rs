//! The figures of production of a robot.

use serde::{Deserialize, Serialize};

use super::ShiftSpan;

/// What a robot did in a range of time. Time that the gateway did not see is counted as unseen, never as
/// anything else.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Production {
    /// The robot.
    pub robot: String,
    /// The begin of the range.
    pub from: String,
    /// Its end, which does not belong to it.
    pub to: String,
    /// The shift whose figures these are; absent if no shift was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shift: Option<ShiftSpan>,
    /// How much of the range was seen.
    pub seen_ms: f64,
    /// How much was not. Both together are the range.
    pub unseen_ms: f64,
    /// The time in each state.
    pub states: StateFigures,
    /// The availability.
    pub availability: Availability,
    /// The cycles.
    pub cycles: CycleFigures,
    /// The parts.
    pub parts: PartFigures,
    /// The alarms.
    pub alarms: AlarmFigures,
    /// Until when what was read is on the disk; `null` if the gateway has written nothing yet. What is behind
    /// it counts as unseen: while the disk fails, events wait in memory.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub kept_until: Option<String>,
    /// How many chunks, events and files of the range cannot be read.
    pub unreadable: u64,
}

/// What a robot did in each shift that begins in a range of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ProductionByShift {
    /// The robot.
    pub robot: String,
    /// The begin of the range.
    pub from: String,
    /// Its end, which does not belong to it.
    pub to: String,
    /// The figures of each shift, whole or up to now, in the order of time.
    pub shifts: Vec<Production>,
}

/// The figures of one range, or of each shift with `by=shift`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(untagged)]
pub enum ProductionFigures {
    /// Of one range or one shift.
    One(Box<Production>),
    /// Of each shift.
    ByShift(ProductionByShift),
}

/// The time in each state. All together are `seen_ms`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct StateFigures {
    /// Mode 7 or 9, no alarm: a program ran. This does not mean that the arm moved.
    pub running_ms: f64,
    /// Mode 2 or 3, no alarm: auto or stop, no program ran.
    pub waiting_ms: f64,
    /// There was an alarm, in whatever mode.
    pub alarm_ms: f64,
    /// Mode 1 or 8, no alarm: manual or single step.
    pub manual_ms: f64,
    /// Mode 0, or a number that the manual does not have; no alarm.
    pub other_ms: f64,
    /// The addresses and events that these come from.
    pub computed_from: Vec<String>,
}

/// The availability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Availability {
    /// From 0 to 1; `null` if nothing was seen.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub value: Option<f64>,
    /// What it is. `running_of_seen_time`: the time in which a program ran, divided by the time that was
    /// seen.
    #[cfg_attr(feature = "openapi", schema(example = "running_of_seen_time"))]
    pub definition: String,
    /// The addresses and events that it comes from.
    pub computed_from: Vec<String>,
}

/// The cycles that were seen to end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CycleFigures {
    /// How many.
    pub count: u64,
    /// Whether more may have ended: cycles were shorter than the time between two readings.
    pub at_least: bool,
    /// How many of them have a time. The figures below are about these.
    pub timed: u64,
    /// Half of them took no longer; `null` without any.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub p50_ms: Option<u64>,
    /// Nine of ten took no longer; `null` without any.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub p90_ms: Option<u64>,
    /// The shortest; `null` without any.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub min_ms: Option<u64>,
    /// The longest; `null` without any.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub max_ms: Option<u64>,
    /// The mean; `null` without any.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub mean_ms: Option<f64>,
    /// The addresses and events that these come from.
    pub computed_from: Vec<String>,
}

/// The parts that were seen to be counted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PartFigures {
    /// How many; `null` if the robot has no counter of parts, or if that was not read in the range.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub count: Option<u64>,
    /// How often the counter went back. Parts just before that may be missing.
    pub resets: u64,
    /// The addresses and events that these come from.
    pub computed_from: Vec<String>,
}

/// The alarms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AlarmFigures {
    /// How many different codes there were.
    pub codes: u64,
    /// Those that lost the most time, 20 at most.
    pub top: Vec<AlarmFigure>,
    /// The addresses and events that these come from.
    pub computed_from: Vec<String>,
}

/// One alarm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AlarmFigure {
    /// The code.
    pub code: u32,
    /// Its meaning, in a few words.
    pub text: String,
    /// What to do about it.
    pub remedy: String,
    /// How often it was seen to begin within the range.
    pub count: u64,
    /// For how long it was read within the range.
    pub lost_ms: f64,
}
