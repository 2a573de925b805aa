//! How an arm misbehaves.
//!
//! All fields have a default value, which is correct behaviour. In JSON a time is a number of seconds, and an
//! unknown field is an error.

use std::time::Duration;

use serde::Deserialize;
use serde_json::Value;

use super::AXES;

/// What the controller does, and what it says about it. Fields named `at` count from the start of the arm.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Character {
    /// The robot that answers first.
    pub cabinet: Cabinet,
    /// How long the arm stands at each point that is not blended while more steps wait; `isMoving` is then 0
    /// (0.25 to 0.33 s seen, unit A).
    #[serde(deserialize_with = "seconds::deserialize")]
    pub dwell: Duration,
    /// Whether `RemoteCmdLen` is 0 during such a dwell, although steps wait.
    pub dwell_told_empty: bool,
    /// The value of `RemoteCmdLen`.
    pub list_length: ListLength,
    /// The effect of each way of stopping.
    pub stops: Stops,
    /// The delay of each kind of reply.
    pub delays: Delays,
    /// Connections that accept bytes but answer nothing. Stray connections can block a small socket pool.
    pub deaf: Vec<Deaf>,
    /// Replies that never arrive, although the request was executed.
    pub lost: Vec<Lost>,
    /// Lists that take effect later than they arrive.
    pub late: Vec<Late>,
    /// Instructions that are answered with ok and dropped (seen: a curve move without a linear move before
    /// it).
    pub never_executed: Option<NeverExecuted>,
    /// Whether mode 2 accepts a list and changes to mode 7 (unit B). Otherwise mode 2 refuses lists (firmware
    /// F5.2.1).
    pub arms_itself: bool,
    /// What other clients send into the list.
    pub foreign: Vec<Foreign>,
    /// A taught program that runs at the start. `RemoteCmdLen` does not count its steps.
    pub program: Option<Program>,
    /// Another robot replaces the first one, such as two cabinets behind one port, or a `Listen` where the
    /// next controller dials.
    pub swap: Option<Swap>,
    /// A restart of the controller.
    pub reboot: Option<Reboot>,
}

/// One robot: its identity, and its state at the start.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Cabinet {
    /// `version`.
    pub version: String,
    /// `machineName`.
    pub name: String,
    /// Whether `machineName` is a list with the name in it instead of a text.
    pub name_in_a_list: bool,
    /// `axisNum`, 1 to 8.
    pub axis_count: usize,
    /// The positions of the axes, degrees.
    pub axes: [f64; AXES],
    /// `curMode`.
    pub mode: i64,
    /// `curAlarm`.
    pub alarm: i64,
    /// `origin`.
    pub homed: bool,
    /// The speed of the axis with the longest way, degrees per second. The speed in an instruction has no
    /// effect.
    pub deg_per_s: f64,
    /// The speed of a linear move, mm per second.
    pub mm_per_s: f64,
}

impl Default for Cabinet {
    fn default() -> Self {
        Self {
            version: "HC-QC-RX-7.8.07-master-F5.2.1".to_owned(),
            name: "cell 4".to_owned(),
            name_in_a_list: false,
            axis_count: 6,
            axes: [0.0; AXES],
            mode: 7,
            alarm: 0,
            homed: true,
            deg_per_s: 30.0,
            mm_per_s: 250.0,
        }
    }
}

/// The value of `RemoteCmdLen`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ListLength {
    /// The number of steps that wait or run.
    #[default]
    True,
    /// No value: the address is unknown, as before firmware 207beta25.
    Absent,
    /// Always 0.
    Zero,
    /// A word that is no number.
    Unreadable,
}

/// The effect of each way of stopping.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Stops {
    /// `actionStop`. Default: stops in 80 ms, then mode 3 and alarm 42 (unit B).
    pub action_stop: Reaction,
    /// `stopButton`. Default: ok without an effect (unit B).
    pub stop_button: Reaction,
    /// `actionPause`. Default: stops in 500 ms, then mode 2 (unit B).
    pub action_pause: Reaction,
    /// AddRCC with `emptyList` 1 and no instructions. [`Effect::Works`]: waiting steps are dropped, and the
    /// running step ends normally.
    pub clear: Reaction,
}

impl Default for Stops {
    fn default() -> Self {
        let works = |mode, alarm, takes| Reaction {
            mode,
            alarm,
            takes: Duration::from_millis(takes),
            ..Reaction::default()
        };
        Self {
            action_stop: works(Some(3), Some(42), 80),
            stop_button: Reaction { effect: Effect::NoEffect, ..Reaction::default() },
            action_pause: works(Some(2), None, 500),
            clear: Reaction::default(),
        }
    }
}

/// The effect of one way of stopping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Reaction {
    /// What is done and replied.
    pub effect: Effect,
    /// The mode from then on, for every effect except [`Effect::Lost`]; unchanged if left out.
    pub mode: Option<i64>,
    /// The alarm from then on, in the same way.
    pub alarm: Option<i64>,
    /// The time from the request to the effect. The arm moves on during this time.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub takes: Duration,
}

/// The effect of a stop, and the reply to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Effect {
    /// Executed, answered ok.
    #[default]
    Works,
    /// Not executed, answered ok.
    NoEffect,
    /// Not executed, answered `err`.
    Refused,
    /// Executed, answered `err`.
    RefusedButWorks,
    /// Executed, not answered.
    WorksUnanswered,
    /// Neither executed nor answered.
    Lost,
}

impl Effect {
    pub(super) fn works(self) -> bool {
        matches!(self, Self::Works | Self::RefusedButWorks | Self::WorksUnanswered)
    }

    /// `Some(ok)`, or `None` without a reply.
    pub(super) fn answer(self) -> Option<bool> {
        match self {
            Self::Works | Self::NoEffect => Some(true),
            Self::Refused | Self::RefusedButWorks => Some(false),
            Self::WorksUnanswered | Self::Lost => None,
        }
    }
}

/// The delay of each kind of reply. The values in a reply are those at the arrival of the request.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Delays {
    /// Replies to queries.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub query: Duration,
    /// Replies to commands.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub command: Duration,
    /// Replies to AddRCC.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub list: Duration,
}

impl Default for Delays {
    /// 18 ms each, as with unit A's controller.
    fn default() -> Self {
        let usual = Duration::from_millis(18);
        Self { query: usual, command: usual, list: usual }
    }
}

/// A kind of request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Deserialize, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A query.
    Query,
    /// A command.
    Command,
    /// AddRCC.
    List,
    /// Anything else. It never gets a reply.
    Other,
}

/// A connection that accepts bytes but answers nothing.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Deaf {
    /// The number of the connection, from 1. Left out: every connection.
    pub connection: Option<u32>,
    /// When it begins.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub at: Duration,
    /// How long it lasts. Left out: for ever. Bytes that arrive during this time are lost.
    #[serde(deserialize_with = "maybe_seconds::deserialize")]
    pub lasts: Option<Duration>,
    /// Whether requests are still executed, because only the way back is broken.
    pub obeys: bool,
}

impl Deaf {
    pub(super) fn covers(&self, connection: u32, now: Duration) -> bool {
        let over = self.lasts.is_some_and(|lasts| now >= self.at.saturating_add(lasts));
        self.connection.is_none_or(|which| which == connection) && now >= self.at && !over
    }
}

/// A reply that never arrives. The request is executed.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lost {
    /// The kind of the request.
    pub kind: Kind,
    /// The number of the request among those of its kind, over all connections, from 1.
    pub nth: u32,
}

/// A list that takes effect later than it arrives. It does not delay a list that clears.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Late {
    /// The number of the list among those with instructions, from 1. Left out: every list.
    #[serde(default)]
    pub nth: Option<u32>,
    /// The time from its arrival until it is in the list and runs.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub taken_after: Duration,
    /// The time from its arrival to the reply ok. Left out: no reply.
    #[serde(default, deserialize_with = "maybe_seconds::deserialize")]
    pub answered_after: Option<Duration>,
}

/// Which instructions are answered with ok and dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NeverExecuted {
    /// All instructions.
    Always,
    /// Instructions with a `tool` other than 0.
    WithTool,
    /// A workbench step, and all instructions after it in the same list.
    AfterWorkbench,
}

/// What another client sends into the list.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Foreign {
    /// When it arrives.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub at: Duration,
    /// Whether it replaces the list (`emptyList`).
    #[serde(default)]
    pub replace: bool,
    /// Instructions as in AddRCC. With `replace` and no instructions, the list is cleared.
    #[serde(default)]
    pub instructions: Vec<Value>,
}

/// A taught program. Its waits (action 100) stand for inputs that arrive after some time.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Program {
    /// When it begins.
    #[serde(default, deserialize_with = "seconds::deserialize")]
    pub at: Duration,
    /// Its steps, as in AddRCC.
    pub steps: Vec<Value>,
}

/// Another robot replaces the first one. The first one continues with its work.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Swap {
    /// When it happens.
    pub when: SwapWhen,
    /// What happens to the connections that are open then.
    #[serde(default)]
    pub links: Links,
    /// The other robot.
    pub to: Cabinet,
}

/// When another robot answers.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SwapWhen {
    /// At a time.
    At(#[serde(deserialize_with = "seconds::deserialize")] Duration),
    /// From the connection with this number on, counted from 1. Earlier connections keep their robot.
    Connection(u32),
    /// When the test calls [`super::Arm::swap`].
    Told,
}

/// What happens to open connections at a timed swap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Links {
    /// They end.
    #[default]
    End,
    /// They continue with the other robot, because something in between forwards the bytes to it.
    Carried,
}

/// A restart of the controller. Connections end, its list is empty, the arm stands where it was, and it is
/// the same robot.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Reboot {
    /// When it happens.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub at: Duration,
    /// How long connections are refused.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub away: Duration,
    /// The mode afterwards.
    pub mode: i64,
    /// The alarm afterwards.
    pub alarm: i64,
    /// Whether it is homed afterwards.
    pub homed: bool,
}

impl Default for Reboot {
    fn default() -> Self {
        Self { at: Duration::ZERO, away: Duration::ZERO, mode: 3, alarm: 0, homed: false }
    }
}

mod seconds {
    use std::time::Duration;

    use serde::de::Error;
    use serde::{Deserialize, Deserializer};

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Duration, D::Error> {
        Duration::try_from_secs_f64(f64::deserialize(from)?).map_err(D::Error::custom)
    }
}

mod maybe_seconds {
    use std::time::Duration;

    use serde::de::Error;
    use serde::{Deserialize, Deserializer};

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Duration>, D::Error> {
        let seconds = Option::<f64>::deserialize(from)?;
        seconds.map(Duration::try_from_secs_f64).transpose().map_err(D::Error::custom)
    }
}
