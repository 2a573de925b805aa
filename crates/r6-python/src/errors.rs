//! Converts errors of the client to exceptions of `r6._errors`: the same tree, sorted by what the caller must
//! do.

use std::time::Duration;

use pyo3::exceptions::PyTimeoutError;
use pyo3::prelude::*;
use r6_client::units::OutOfRange;
use r6_client::{
    Cause, Checked, Invalid, MotionError, NoReading, NotSent, NotSubscribed, OutcomeUnknown, Refused,
    RequestError, StepError, Violation, WaitError,
};
use r6_program::Mistakes;
use r6_proto::address::UnknownAddress;
use r6_proto::grid::Nearest;
use r6_sim::SimError;

use crate::convert;
use crate::handle::Progress;
use crate::raising::{Exception, Raise};

/// The exception for a wrong file: the text has a line for each mistake, and `mistakes` has all of them.
pub fn wrong_file(py: Python<'_>, class: &str, file: &str, mistakes: &Mistakes) -> PyErr {
    let text = mistakes.lines(file).collect::<Vec<_>>().join("\n");
    let error = Exception::new(py, class, &text).with("more", mistakes.more());
    error.with_made("mistakes", convert::mistakes(py, mistakes)).build()
}

/// The exception for a timeout.
pub fn timed_out(after: Duration) -> PyErr {
    PyTimeoutError::new_err(format!("nothing came within {after:?}"))
}

impl Raise for RequestError {
    fn exception(&self, py: Python<'_>) -> PyErr {
        let class = match self {
            Self::Invalid(Invalid::OutsideEnvelope(violation)) => return violation.exception(py),
            Self::Invalid(Invalid::Step(error)) => return error.exception(py),
            Self::Invalid(_) => "InvalidRequest",
            Self::NotSent(_) => "NotSent",
            Self::Refused(_) => "Refused",
            Self::OutcomeUnknown(_) => "OutcomeUnknown",
        };
        let error = Exception::new(py, class, self).with("may_send_again", self.may_send_again());
        match self {
            Self::Invalid(invalid) => {
                error.with("reason", invalid_word(invalid)).with("nearest", nearest_of(invalid))
            }
            Self::NotSent(not_sent) => {
                let error = error.with("reason", not_sent_word(not_sent));
                match not_sent {
                    NotSent::AnotherRobot { expected, found } => error
                        .with_made("expected", convert::identity(py, expected))
                        .with_made("found", convert::identity(py, found)),
                    NotSent::Unreachable { .. }
                    | NotSent::ConnectTimedOut { .. }
                    | NotSent::Disconnected
                    | NotSent::StateNotRead
                    | NotSent::Unidentified { .. }
                    | NotSent::NoEngine { .. }
                    | NotSent::Overtaken
                    | NotSent::Withdrawn
                    | NotSent::Busy { .. }
                    | NotSent::NoRoom(_)
                    | NotSent::Closed
                    | NotSent::NotStopped(_) => error,
                }
            }
            Self::Refused(
                Refused::Command { reason, .. }
                | Refused::InstructionList { reason }
                | Refused::Points { reason },
            ) => error.with("reason", reason.as_deref()),
            Self::OutcomeUnknown(unknown) => {
                let sent = unknown.request();
                let error = error
                    .with("reason", unknown_word(unknown))
                    .with("request", sent.word)
                    .with("effect", sent.effect.word());
                match unknown {
                    OutcomeUnknown::AnotherRobot { expected, found, .. } => error
                        .with_made("expected", convert::identity(py, expected))
                        .with_made("found", convert::identity(py, found)),
                    OutcomeUnknown::TimedOut { .. }
                    | OutcomeUnknown::ConnectionLost { .. }
                    | OutcomeUnknown::Unreadable { .. }
                    | OutcomeUnknown::Unclear { .. } => error,
                }
            }
        }
        .build()
    }
}

/// The values below and above a value that the wire cannot carry.
fn nearest_of(error: &Invalid) -> Option<(f64, f64)> {
    match error {
        Invalid::Value(error) => error.nearest.map(both),
        Invalid::Step(error) => error.nearest.map(both),
        Invalid::BadAddress { .. } | Invalid::TooLong { .. } | Invalid::OutsideEnvelope(_) => None,
        Invalid::NotStopped(why) => nearest_of(why),
    }
}

fn both(nearest: Nearest) -> (f64, f64) {
    (nearest.below(), nearest.above())
}

fn invalid_word(error: &Invalid) -> &'static str {
    match error {
        Invalid::BadAddress { .. } => "bad_address",
        Invalid::Value(_) => "value",
        Invalid::TooLong { .. } => "too_long",
        Invalid::Step(_) => "step",
        Invalid::OutsideEnvelope(_) => "outside_envelope",
        Invalid::NotStopped(why) => invalid_word(why),
    }
}

fn not_sent_word(error: &NotSent) -> &'static str {
    match error {
        NotSent::Unreachable { .. } => "unreachable",
        NotSent::ConnectTimedOut { .. } => "connect_timed_out",
        NotSent::Disconnected => "disconnected",
        NotSent::StateNotRead => "state_not_read",
        NotSent::AnotherRobot { .. } => "another_robot",
        NotSent::Unidentified { .. } => "unidentified",
        NotSent::NoEngine { .. } => "no_engine",
        NotSent::Overtaken => "overtaken",
        NotSent::Withdrawn => "withdrawn",
        NotSent::Busy { .. } => "busy",
        NotSent::NoRoom(_) => "no_room",
        NotSent::Closed => "closed",
        NotSent::NotStopped(why) => not_sent_word(why),
    }
}

fn unknown_word(error: &OutcomeUnknown) -> &'static str {
    match error {
        OutcomeUnknown::TimedOut { .. } => "timed_out",
        OutcomeUnknown::ConnectionLost { .. } => "connection_lost",
        OutcomeUnknown::Unreadable { .. } => "unreadable",
        OutcomeUnknown::Unclear { .. } => "unclear",
        OutcomeUnknown::AnotherRobot { .. } => "another_robot",
    }
}

impl Raise for Violation {
    fn exception(&self, py: Python<'_>) -> PyErr {
        let what = match self.what {
            Checked::Speed => "speed".to_owned(),
            Checked::PathSpeed => "path_speed".to_owned(),
            Checked::Axis(axis, _) => axis.to_string(),
            Checked::AxisStep(axis, _) => format!("{axis} step"),
            Checked::Place(axis) => axis.world_name().to_owned(),
            Checked::Distance => "distance".to_owned(),
            Checked::Arc => "arc".to_owned(),
            Checked::Unit(axis, _) => format!("{axis} unit"),
            Checked::Frame | Checked::FrameUnknown => "frame".to_owned(),
            Checked::Action(number) => format!("action {number}"),
        };
        Exception::new(py, "OutsideEnvelope", self)
            .with("reason", "outside_envelope")
            .with("step", self.step)
            .with("what", what)
            .with("value", self.value)
            .with("limit", self.limit)
            .build()
    }
}

impl Raise for StepError {
    fn exception(&self, py: Python<'_>) -> PyErr {
        Exception::new(py, "StepError", self)
            .with("step", self.step)
            .with("field", self.field)
            .with("wanted", self.wanted)
            .with("nearest", self.nearest.map(both))
            .build()
    }
}

impl Raise for OutOfRange {
    fn exception(&self, py: Python<'_>) -> PyErr {
        Exception::new(py, "OutOfRange", self)
            .with("value", self.value)
            .with("wanted", self.wanted)
            .with("nearest", self.nearest.map(both))
            .build()
    }
}

impl Raise for Cause {
    fn exception(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Step(error) => error.exception(py),
            Self::OutsideEnvelope(violation) => violation.exception(py),
            Self::NotReady(_)
            | Self::NotCleared(_)
            | Self::AnotherRuns
            | Self::EarlierFailed(_)
            | Self::NotSent(_)
            | Self::Invalid(_)
            | Self::Refused(_)
            | Self::OutcomeUnknown(_)
            | Self::AlarmRaised { .. }
            | Self::Stopped { .. }
            | Self::Restarted(_)
            | Self::StoppedHere
            | Self::Dropped
            | Self::Closed
            | Self::Released
            | Self::NotSeen
            | Self::NotProved(_)
            | Self::AnotherList { .. }
            | Self::Elsewhere(_)
            | Self::Stalled { .. }
            | Self::Unreadable(_)
            | Self::Abandoned => Exception::new(py, "MotionError", self).build(),
        }
    }
}

impl Raise for MotionError {
    fn exception(&self, py: Python<'_>) -> PyErr {
        let class = if matches!(self.cause, Cause::NotReady(_)) { "NotReady" } else { "MotionError" };
        let error = Exception::new(py, class, self)
            .with("cause", cause_word(&self.cause))
            .with("progress", Progress(self.progress))
            .with("nothing_left", self.nothing_left());
        let error = match self.stop.as_deref() {
            Some(Ok(report)) => error.with_made("stop", convert::stop_report(py, report)),
            Some(Err(failed)) => error.with("stop", failed.exception(py)),
            None => error,
        };
        match &self.cause {
            Cause::NotReady(unmet) => error.with_made("unmet", convert::unmet(py, unmet)),
            Cause::Step(step) => error.from(step.exception(py)),
            Cause::OutsideEnvelope(violation) => error.from(violation.exception(py)),
            Cause::NotCleared(request) | Cause::Unreadable(request) => error.from(request.exception(py)),
            Cause::NotSent(request) => error.from(RequestError::from(request.clone()).exception(py)),
            Cause::Invalid(request) => error.from(RequestError::from(request.clone()).exception(py)),
            Cause::Refused(request) => error.from(RequestError::from(request.clone()).exception(py)),
            Cause::OutcomeUnknown(request) => error.from(RequestError::from(request.clone()).exception(py)),
            Cause::AlarmRaised { code } => error.with("alarm", *code),
            Cause::Stopped { mode } => error.with("mode", mode.number()),
            Cause::Restarted(restart) => {
                error.with("mode", restart.mode.number()).with("alarm", alarm_of(restart))
            }
            Cause::AnotherList { length } => error.with("list_length", *length),
            Cause::EarlierFailed(earlier) => error.from(earlier.exception(py)),
            Cause::AnotherRuns
            | Cause::StoppedHere
            | Cause::Dropped
            | Cause::Closed
            | Cause::Released
            | Cause::NotSeen
            | Cause::NotProved(_)
            | Cause::Elsewhere(_)
            | Cause::Stalled { .. }
            | Cause::Abandoned => error,
        }
        .build()
    }
}

/// The alarm of a controller that was restarted; `None` for no alarm.
fn alarm_of(restart: &r6_client::Restart) -> Option<i64> {
    restart.alarm.filter(|alarm| *alarm != 0)
}

fn cause_word(cause: &Cause) -> &'static str {
    match cause {
        Cause::Step(_) => "step",
        Cause::OutsideEnvelope(_) => "outside_envelope",
        Cause::NotReady(_) => "not_ready",
        Cause::NotCleared(_) => "not_cleared",
        Cause::AnotherRuns => "another_runs",
        Cause::EarlierFailed(_) => "earlier_failed",
        Cause::NotSent(_) => "not_sent",
        Cause::Invalid(_) => "invalid",
        Cause::Refused(_) => "refused",
        Cause::OutcomeUnknown(_) => "outcome_unknown",
        Cause::AlarmRaised { .. } => "alarm_raised",
        Cause::Stopped { .. } => "stopped",
        Cause::Restarted(_) => "restarted",
        Cause::StoppedHere => "stopped_here",
        Cause::Dropped => "dropped",
        Cause::Closed => "closed",
        Cause::Released => "released",
        Cause::NotSeen => "not_seen",
        Cause::NotProved(_) => "not_proved",
        Cause::AnotherList { .. } => "another_list",
        Cause::Elsewhere(_) => "elsewhere",
        Cause::Stalled { .. } => "stalled",
        Cause::Unreadable(_) => "unreadable",
        Cause::Abandoned => "abandoned",
    }
}

impl Raise for WaitError {
    fn exception(&self, py: Python<'_>) -> PyErr {
        let error = Exception::new(py, "WaitError", self);
        match self {
            Self::AlarmRaised { code } => error.with("cause", "alarm_raised").with("alarm", *code),
            Self::Stopped { mode } => error.with("cause", "stopped").with("mode", mode.number()),
            Self::Restarted(restart) => error
                .with("cause", "restarted")
                .with("mode", restart.mode.number())
                .with("alarm", alarm_of(restart)),
            Self::TimedOut { list_length, .. } => {
                error.with("cause", "timed_out").with("list_length", *list_length)
            }
            Self::Request(request) => error.with("cause", "request").from(request.exception(py)),
            Self::AnotherConnection => error.with("cause", "another_connection"),
            Self::Motion(motion) => error.with("cause", "motion").from(motion.exception(py)),
        }
        .build()
    }
}

impl Raise for NotSubscribed {
    fn exception(&self, py: Python<'_>) -> PyErr {
        Exception::new(py, "NotSubscribed", self).build()
    }
}

impl Raise for NoReading {
    fn exception(&self, py: Python<'_>) -> PyErr {
        Exception::new(py, "NoReading", self).build()
    }
}

impl Raise for UnknownAddress {
    fn exception(&self, py: Python<'_>) -> PyErr {
        Exception::new(py, "UnknownAddress", self).build()
    }
}

impl Raise for SimError {
    fn exception(&self, py: Python<'_>) -> PyErr {
        Exception::new(py, "SimulatorError", self).build()
    }
}

impl Raise for r6_controller::Refused {
    fn exception(&self, py: Python<'_>) -> PyErr {
        Exception::new(py, "PanelRefused", self).with("code", r6_sim::panel::code(self).word()).build()
    }
}
