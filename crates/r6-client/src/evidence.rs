//! Observations of a robot: the only basis of statements about its arm.
//!
//! One function makes each statement about an arm ("it stands", "it is done", "this value is fresh"), from
//! observations. Each observation says which robot answered, over which connection, and when it was asked
//! for. An observation of another robot, or over another connection, proves nothing, and neither does
//! silence. docs/EVIDENCE.md lists every statement.
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

/// Two positions closer than this (degrees or mm) count as the same: encoders tremble in the last digit at
/// rest.
const STILL_WITHIN: f64 = 0.01;

/// A smaller change, in degrees, is no progress: encoders tremble.
const NO_PROGRESS: f64 = 1e-3;

/// The robot and the connection that a statement is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct About {
    /// The number of the connection.
    pub connection: u64,
    /// The expected robot; `None` until its identity is read.
    pub robot: Option<Identity>,
}

/// Values from one look at the machine, and their origin.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Observation {
    /// The robot on this connection; `None` until its identity is read.
    pub robot: Option<Identity>,
    /// The number of the connection that answered all of it.
    pub connection: u64,
    /// When the oldest of the values was asked for.
    pub asked_at: Instant,
    /// The values.
    pub values: Sample,
}

impl Observation {
    /// Whether it can say anything about that robot over that connection.
    pub fn is_about(&self, about: &About) -> bool {
        let same_robot = about.robot.is_none() || self.robot == about.robot;
        self.connection == about.connection && same_robot
    }
}

/// Values about motion from one look. `None` if the controller has no such value or sent an unreadable one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    pub moving: Option<bool>,
    pub alarm: Option<i64>,
    pub mode: Option<OperationMode>,
    pub list_length: Option<i64>,
    pub axes: [Option<f64>; AXES],
    pub pose: [Option<f64>; AXES],
}

/// The end of a motion by an alarm, or by a mode in which nothing runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Interrupted {
    ByAlarm { code: i64 },
    ByMode { mode: OperationMode },
}

impl Sample {
    /// Fails if an alarm or the mode ends a motion.
    pub fn check(&self, idle_mode: OperationMode) -> Result<(), Interrupted> {
        if let Some(code) = self.alarm.filter(|code| *code != 0) {
            return Err(Interrupted::ByAlarm { code });
        }
        match self.mode.filter(|mode| !mode.may_run() && *mode != idle_mode) {
            Some(mode) => Err(Interrupted::ByMode { mode }),
            None => Ok(()),
        }
    }

    /// Whether an axis is at another place than before.
    pub fn went_on_from(&self, before: &[Option<f64>; AXES]) -> bool {
        self.axes.iter().zip(before).any(|(now, before)| match (now, before) {
            (Some(now), Some(before)) => (now - before).abs() > NO_PROGRESS,
            (Some(_), None) => true,
            (None, _) => false,
        })
    }

    /// Whether the arm stood from `before` until this sample, judged by its axes, and by `isMoving` if that
    /// is known.
    pub fn stands_since(&self, before: &Self) -> bool {
        let same = self.axes.iter().zip(before.axes).all(|(now, before)| match (now, before) {
            (Some(now), Some(before)) => (now - before).abs() <= STILL_WITHIN,
            (None, None) => true,
            (Some(_), None) | (None, Some(_)) => false,
        });
        let moves = self.moving == Some(true) || before.moving == Some(true);
        // The flag alone has been seen to be wrong.
        !moves && same && self.axes.iter().any(Option::is_some)
    }
}
