//! The watch of action 52: an input that stops the present move.

use r6_proto::message::instruction::StopOnSignal;

use super::Machine;
use super::execution::Activity;
use super::halt::AfterHalt;
use crate::profile::SignalStop;

/// The input that is watched, if any.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SignalWatch {
    watched: Option<StopOnSignal>,
    /// Its level at the last check. Every change of a point is checked.
    level: bool,
}

impl Machine {
    /// Begins a watch, or ends the current one (`isUse` 0).
    pub(super) fn watch_signal(&mut self, stop: &StopOnSignal) {
        self.signal_watch =
            SignalWatch { watched: stop.in_use.then_some(*stop), level: self.io.input(stop.input) };
    }

    /// Ends the watch.
    pub(super) fn end_signal_watch(&mut self) {
        self.signal_watch = SignalWatch::default();
    }

    /// Ends the watch after the list has ended or was replaced, if the profile says so.
    pub(super) fn end_signal_watch_of_list(&mut self) {
        if !self.profile.signal_stop_outlives_list {
            self.end_signal_watch();
        }
    }

    /// Stops the current move if the signal says so. Called whenever a point has changed or a move has begun.
    pub(super) fn check_signal_stop(&mut self) {
        let Some(StopOnSignal { input, on, .. }) = self.signal_watch.watched else { return };
        let level = self.io.input(input);
        let before = std::mem::replace(&mut self.signal_watch.level, level);
        let stops = match self.profile.signal_stop {
            SignalStop::Level => level == on,
            SignalStop::Edge => level == on && before != on,
        };
        if stops && matches!(self.activity, Activity::Moving(_)) {
            self.halt(self.profile.action_stop_time, AfterHalt::NextStep);
        }
    }
}
