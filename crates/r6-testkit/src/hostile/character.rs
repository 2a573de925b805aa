//! In which ways an arm misbehaves.
//!
//! All fields have a default, which behaves. In JSON a time is a number of seconds, an unknown field is an
//! error.

use std::time::Duration;

use serde::Deserialize;
use serde_json::Value;

use super::AXES;

/// What the controller does, and what it says about it. Times that begin with `at` count from the start of
/// the arm.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Character {
    /// The robot that answers first.
    pub cabinet: Cabinet,
    /// The arm stands this long at each point that is not blended while more steps wait, and `isMoving` is 0
    /// (0.25 to 0.33 s seen, unit A).
    #[serde(deserialize_with = "seconds::deserialize")]
    pub dwell: Duration,
    /// `RemoteCmdLen` is 0 during such a dwell, although steps wait.
    pub dwell_told_empty: bool,
    /// What `RemoteCmdLen` tells.
    pub list_length: ListLength,
    /// What each means of stopping does.
    pub stops: Stops,
    /// How long each kind of reply takes.
    pub delays: Delays,
    /// Connections that take bytes and answer nothing: stray connections wedge a small socket pool.
    pub deaf: Vec<Deaf>,
    /// Answers that never arrive, although the request was carried out.
    pub lost: Vec<Lost>,
    /// Lists that are taken later than they arrive.
    pub late: Vec<Late>,
    /// Instructions that are answered ok and dropped (seen: a curve move without a linear move before it).
    pub never_executed: Option<NeverExecuted>,
    /// In mode 2 a list is taken, and the mode goes to 7 by itself (unit B). Else mode 2 refuses lists
    /// (firmware F5.2.1).
    pub arms_itself: bool,
    /// What other clients do to the list.
    pub foreign: Vec<Foreign>,
    /// A taught program that runs at the start. `RemoteCmdLen` does not count its steps.
    pub program: Option<Program>,
    /// Another robot takes the place of the first one: two cabinets behind one port, a `Listen` where the
    /// next controller dials.
    pub swap: Option<Swap>,
    /// The controller starts anew in the middle of things.
    pub reboot: Option<Reboot>,
}

/// One robot: who it says it is, and its state at the start.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Cabinet {
    /// `version`.
    pub version: String,
    /// `machineName`.
    pub name: String,
    /// `machineName` comes as a list with the name in it, which is no text.
    pub name_in_a_list: bool,
    /// `axisNum`, 1 to 8.
    pub axis_count: usize,
    /// Where the axes stand, degrees.
    pub axes: [f64; AXES],
    /// `curMode`.
    pub mode: i64,
    /// `curAlarm`.
    pub alarm: i64,
    /// `origin`.
    pub homed: bool,
    /// The speed of the axis that moves most, degrees per second; what an instruction says of speed does not
    /// count.
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

/// What `RemoteCmdLen` tells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ListLength {
    /// The steps that wait or run.
    #[default]
    True,
    /// Nothing: the address is unknown, as before firmware 207beta25.
    Absent,
    /// 0, whatever waits.
    Zero,
}

/// What each means of stopping does.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Stops {
    /// `actionStop`. Default: stops in 80 ms, then mode 3 and alarm 42 (unit B).
    pub action_stop: Reaction,
    /// `stopButton`. Default: ok without effect (unit B).
    pub stop_button: Reaction,
    /// `actionPause`. Default: stops in 500 ms, then mode 2 (unit B).
    pub action_pause: Reaction,
    /// AddRCC with `emptyList` 1 and no instructions. [`Effect::Works`]: steps that wait are dropped, the one
    /// that runs ends.
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

/// What one means of stopping does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Reaction {
    /// What is done and answered.
    pub effect: Effect,
    /// The mode from then on, whatever the effect, [`Effect::Lost`] apart; as it was if left out.
    pub mode: Option<i64>,
    /// The alarm from then on, in the same way.
    pub alarm: Option<i64>,
    /// The time from the request until the effect, in which the arm moves on.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub takes: Duration,
}

/// What a stop does, and what it is answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Effect {
    /// Carried out, answered ok.
    #[default]
    Works,
    /// Not carried out, answered ok.
    NoEffect,
    /// Not carried out, answered `err`.
    Refused,
    /// Carried out, answered `err`.
    RefusedButWorks,
    /// Carried out, not answered.
    WorksUnanswered,
    /// Neither carried out nor answered.
    Lost,
}

impl Effect {
    pub(super) fn works(self) -> bool {
        matches!(self, Self::Works | Self::RefusedButWorks | Self::WorksUnanswered)
    }

    /// `Some(ok)`, or `None` where nothing is answered.
    pub(super) fn answer(self) -> Option<bool> {
        match self {
            Self::Works | Self::NoEffect => Some(true),
            Self::Refused | Self::RefusedButWorks => Some(false),
            Self::WorksUnanswered | Self::Lost => None,
        }
    }
}

/// How long each kind of reply takes. What a reply tells is of the time the request arrived.
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
    /// 18 ms each, as unit A's controller needs.
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
    /// Anything else; it is never answered.
    Other,
}

/// A connection that takes bytes and answers nothing.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Deaf {
    /// Which connection, the first is 1. Left out: every one.
    pub connection: Option<u32>,
    /// From when on.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub at: Duration,
    /// For how long. Left out: for ever. What arrives meanwhile is gone.
    #[serde(deserialize_with = "maybe_seconds::deserialize")]
    pub lasts: Option<Duration>,
    /// Whether what arrives is carried out all the same: the way back is broken only.
    pub obeys: bool,
}

impl Deaf {
    pub(super) fn covers(&self, connection: u32, now: Duration) -> bool {
        let over = self.lasts.is_some_and(|lasts| now >= self.at.saturating_add(lasts));
        self.connection.is_none_or(|which| which == connection) && now >= self.at && !over
    }
}

/// An answer that never arrives. The request is carried out.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lost {
    /// The kind of the request.
    pub kind: Kind,
    /// Which one of its kind, the first is 1, over all connections.
    pub nth: u32,
}

/// A list that is taken later than it arrives. Clearing the list is never late by this.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Late {
    /// Which list with instructions, the first is 1. Left out: every one.
    #[serde(default)]
    pub nth: Option<u32>,
    /// The time from its arrival until it is in the list and runs.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub taken_after: Duration,
    /// The time from its arrival until it is answered ok. Left out: it is never answered.
    #[serde(default, deserialize_with = "maybe_seconds::deserialize")]
    pub answered_after: Option<Duration>,
}

/// Which instructions are answered ok and dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NeverExecuted {
    /// Every one.
    Always,
    /// Those with a `tool` other than 0.
    WithTool,
    /// Those after a workbench step in the same list, and that step.
    AfterWorkbench,
}

/// What another client sends into the list.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Foreign {
    /// When.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub at: Duration,
    /// Whether the list is emptied first (`emptyList`).
    #[serde(default)]
    pub replace: bool,
    /// Instructions as in AddRCC. With `replace` and none, the list is cleared.
    #[serde(default)]
    pub instructions: Vec<Value>,
}

/// A taught program. Its waits (action 100) stand for inputs that somebody gives after some time.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Program {
    /// When it begins.
    #[serde(default, deserialize_with = "seconds::deserialize")]
    pub at: Duration,
    /// Its steps, as in AddRCC.
    pub steps: Vec<Value>,
}

/// Another robot takes the place of the first one. The first goes on with what it does.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Swap {
    /// When.
    pub when: SwapWhen,
    /// What becomes of connections that are open at that time.
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
    /// From the connection with this number on, the first is 1; the ones before stay where they are.
    Connection(u32),
    /// When the test says so ([`super::Arm::swap`]).
    Told,
}

/// What becomes of open connections at a swap at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Links {
    /// They end.
    #[default]
    End,
    /// They go on with the other robot behind them: something between forwards the bytes elsewhere.
    Carried,
}

/// The controller starts anew: connections end, its list is empty, the arm stands where it was, and it is the
/// same robot.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Reboot {
    /// When.
    #[serde(deserialize_with = "seconds::deserialize")]
    pub at: Duration,
    /// For how long connections are refused.
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
