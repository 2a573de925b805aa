//! Curves (action 17) of the remote list that have no line (action 10) before them.
//!
//! Real controllers answer such a list with ok and do not execute the curve (reported). What has to be before it is chosen: a line that
//! was begun in the same run of the list. A run begins when the list is replaced, and when the program begins anew.

use r6_proto::message::{Action, Instruction};

use super::Machine;
use crate::event::{Detail, Event};
use crate::profile::LoneCurve;

/// What the present run of the remote list has had so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ListRun {
    has_line: bool,
    /// It was told that a curve is not executed.
    told: bool,
}

impl Machine {
    /// A run of the remote list begins.
    pub(super) fn begin_list_run(&mut self) {
        self.list_run = ListRun::default();
    }

    /// A move of the present list begins.
    pub(super) fn move_begins(&mut self, action: &Action) {
        if self.is_remote() && matches!(action, Action::LinearMove(_)) {
            self.list_run.has_line = true;
        }
    }

    /// Whether this step of the present list is a curve that is not executed.
    pub(super) fn is_lone_curve(&self, action: &Action) -> bool {
        let skips = match self.profile.lone_curve {
            LoneCurve::Skip => true,
            LoneCurve::Run => false,
        };
        skips && self.is_remote() && !self.list_run.has_line && matches!(action, Action::CurveMove(_))
    }

    /// Tells that a curve is not executed, the first time in each run.
    pub(super) fn tell_lone_curve(&mut self, step: &Instruction) {
        if !std::mem::replace(&mut self.list_run.told, true) {
            let step = Detail::of(self.said_of(step));
            self.note(Event::CurveNotExecuted { step });
        }
    }
}
