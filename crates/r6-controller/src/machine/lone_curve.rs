//! Curves (action 17) of the remote list without a line (action 10) before them.
//!
//! Real controllers answer such a list with ok and do not execute the curve (reported). We chose what has to
//! come before it: a line that began in the same run of the list. A run begins when the list is replaced, and
//! when the program begins again.

use r6_proto::message::{Action, Instruction};

use super::Machine;
use crate::event::Event;
use crate::profile::LoneCurve;

/// What the current run of the remote list has contained so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ListRun {
    has_line: bool,
    /// The log already says that a curve is not executed.
    told: bool,
}

impl Machine {
    /// Begins a run of the remote list.
    pub(super) fn begin_list_run(&mut self) {
        self.list_run = ListRun::default();
    }

    /// Notes that a move of the current list begins.
    pub(super) fn move_begins(&mut self, action: &Action) {
        if self.is_remote() && matches!(action, Action::LinearMove(_)) {
            self.list_run.has_line = true;
        }
    }

    /// Whether this step of the current list is a curve that is not executed.
    pub(super) fn is_lone_curve(&self, action: &Action) -> bool {
        let skips = match self.profile.lone_curve {
            LoneCurve::Skip => true,
            LoneCurve::Run => false,
        };
        skips && self.is_remote() && !self.list_run.has_line && matches!(action, Action::CurveMove(_))
    }

    /// Logs that a curve is not executed, the first time in each run.
    pub(super) fn tell_lone_curve(&mut self, step: &Instruction) {
        if !std::mem::replace(&mut self.list_run.told, true) {
            let step = self.place_of_instruction(step);
            self.note(Event::CurveNotExecuted { step });
        }
    }
}
