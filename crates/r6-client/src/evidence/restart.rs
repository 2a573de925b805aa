//! The statement "the controller was restarted". It needs a motion that was under way when its connection was
//! lost. The client never says that a motion was cut short after it reported that motion as done.

use std::fmt;

use r6_proto::OperationMode;

use crate::status::{AlarmAdvice, Status};

/// The state of a controller that lost its list while the connection was lost. Either the controller was
/// switched off and on, or somebody stopped it and cleared its list before the client reconnected. The
/// protocol cannot tell these two apart.
///
/// The client says this only if all of these hold: the same robot answers over another connection, it is in a
/// mode in which no program runs, and its list is empty. If the firmware does not report the length of its
/// list, the origin has to be lost instead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Restart {
    /// The mode it is in now.
    pub mode: OperationMode,
    /// The alarm number; 0: no alarm, `None`: it could not be read.
    pub alarm: Option<i64>,
    /// Whether the controller no longer knows its origin.
    pub origin_lost: bool,
}

impl Restart {
    /// Judges the state of a robot that ran a motion over an earlier connection and waits for instructions in
    /// `idle_mode`.
    pub(crate) fn of(status: &Status, idle_mode: OperationMode) -> Option<Self> {
        let mode = status.mode.filter(|mode| !mode.may_run() && *mode != idle_mode)?;
        let origin_lost = status.homed == Some(false);
        let list_lost = status.list_length == Some(0) || (status.list_length.is_none() && origin_lost);
        list_lost.then_some(Self { mode, alarm: status.alarm, origin_lost })
    }
}

impl fmt::Display for Restart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { mode, alarm, origin_lost } = self;
        write!(f, "the connection was lost, and the controller answers again in mode {mode}")?;
        f.write_str(if *origin_lost { " without its list and its origin" } else { " with an empty list" })?;
        f.write_str(
            ": it was switched off and on (a power cut), or somebody stopped it and cleared its list meanwhile",
        )?;
        f.write_str("; the motion did not come to its end, look where the arm is")?;
        match alarm {
            Some(0) => Ok(()),
            Some(alarm) => write!(f, "; {}", AlarmAdvice(*alarm)),
            None => f.write_str("; its alarm cannot be read"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(mode: i64, list_length: Option<i64>, homed: bool) -> Option<Restart> {
        let mode = Some(OperationMode::of_number(mode));
        let status = Status { mode, list_length, homed: Some(homed), alarm: Some(0), ..Status::default() };
        Restart::of(&status, OperationMode::Running)
    }

    #[test]
    fn an_empty_list_or_a_lost_origin_in_a_mode_that_does_not_run_tells_of_it() {
        assert!(after(3, Some(0), true).is_some_and(|restart| !restart.origin_lost));
        assert!(after(1, None, false).is_some_and(|restart| restart.origin_lost));
        // It was stopped, but it still has its list.
        assert_eq!(after(3, Some(4), true), None);
        assert_eq!(after(3, Some(4), false), None);
        // It is in a running mode, so this proves nothing.
        assert_eq!(after(7, Some(0), true), None);
        assert_eq!(after(3, None, true), None);
        // It waits for instructions, as usual in this idle mode.
        let idle = Status { mode: Some(OperationMode::Auto), list_length: Some(0), ..Status::default() };
        assert_eq!(Restart::of(&idle, OperationMode::Auto), None);
    }
}
