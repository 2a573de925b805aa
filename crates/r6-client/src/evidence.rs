//! What was observed of a robot: the only ground of a statement about its arm.
//!
//! A statement about an arm ("it stands", "it is done", "this value is fresh") is made by one function, from observations.
//! Each observation says who answered, over which connection, and when it was asked for. An observation of another robot,
//! or over another connection, proves nothing, and neither does silence. docs/EVIDENCE.md lists every statement.
//!
//! | statement | function |
//! |---|---|
//! | the arm stands after a stop | [`standstill::Standstill::see`] |
//! | the arm is at rest | [`rest::Rest::judge`] |
//! | a path was carried out | [`crate::path::progress::PathProgress::end`] |
//! | what was appended was carried out | [`crate::path::progress::PathProgress::carried_out`] |
//! | the controller was started anew | [`restart::Restart::of`] |
//! | a value is fresh | [`crate::subscription::Value`] |

pub(crate) mod rest;
pub(crate) mod restart;
pub(crate) mod standstill;

use r6_proto::OperationMode;
use r6_proto::axis::AXES;
use r6_proto::time::Instant;

use crate::identity::Identity;

/// Two positions closer than this (degrees or mm) are the same: encoders tremble in the last digit at rest.
const STILL_WITHIN: f64 = 0.01;

/// Less than this, degrees, is no progress: encoders tremble.
const NO_PROGRESS: f64 = 1e-3;

/// The robot and the connection that a statement is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct About {
    /// The number of the connection.
    pub connection: u64,
    /// Who is meant; `None` while nobody has read that.
    pub robot: Option<Identity>,
}

/// Values that were read in one look at the machine, and where they come from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Observation {
    /// Who answers on this connection; `None` while nobody has read that.
    pub robot: Option<Identity>,
    /// The number of the connection that all of it was answered on.
    pub connection: u64,
    /// When the oldest of the values was asked for.
    pub asked_at: Instant,
    /// The values.
    pub values: Sample,
}

impl Observation {
    /// Whether it can say anything of that robot over that connection.
    pub fn is_about(&self, about: &About) -> bool {
        let same_robot = about.robot.is_none() || self.robot == about.robot;
        self.connection == about.connection && same_robot
    }
}

/// What one look tells about motion. `None` where the controller has no such value or sent one that cannot be read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    pub moving: Option<bool>,
    pub alarm: Option<i64>,
    pub mode: Option<OperationMode>,
    pub list_length: Option<i64>,
    pub axes: [Option<f64>; AXES],
    pub pose: [Option<f64>; AXES],
}

/// What ends a motion: an alarm, or a mode in which nothing runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Interrupted {
    ByAlarm { code: i64 },
    ByMode { mode: OperationMode },
}

impl Sample {
    /// Refuses what ends a motion.
    pub fn check(&self, idle_mode: OperationMode) -> Result<(), Interrupted> {
        if let Some(code) = self.alarm.filter(|code| *code != 0) {
            return Err(Interrupted::ByAlarm { code });
        }
        match self.mode.filter(|mode| !mode.may_run() && *mode != idle_mode) {
            Some(mode) => Err(Interrupted::ByMode { mode }),
            None => Ok(()),
        }
    }

    /// Whether an axis is elsewhere than before.
    pub fn went_on_from(&self, before: &[Option<f64>; AXES]) -> bool {
        self.axes.iter().zip(before).any(|(now, before)| match (now, before) {
            (Some(now), Some(before)) => (now - before).abs() > NO_PROGRESS,
            (Some(_), None) => true,
            (None, _) => false,
        })
    }

    /// Whether the arm stood from `before` to this one, by its axes, and by `isMoving` where that is known.
    pub fn stands_since(&self, before: &Self) -> bool {
        let same = self.axes.iter().zip(before.axes).all(|(now, before)| match (now, before) {
            (Some(now), Some(before)) => (now - before).abs() <= STILL_WITHIN,
            (None, None) => true,
            (Some(_), None) | (None, Some(_)) => false,
        });
        let moves = self.moving == Some(true) || before.moving == Some(true);
        // A flag alone has been seen to lie.
        !moves && same && self.axes.iter().any(Option::is_some)
    }
}
