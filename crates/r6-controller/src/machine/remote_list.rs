//! AddRCC: puts the instructions of a PC into the remote list.

use r6_proto::OperationMode;
use r6_proto::alarm::AlarmCode;
use r6_proto::message::Instruction;

use super::Machine;
use super::execution::Activity;
use super::halt::AfterHalt;
use crate::event::{AlarmCause, ListRefusal};
use crate::instruction_list::MAX_INSTRUCTIONS;
use crate::profile::{ReplaceInMotion, Unarmed};

/// Why an AddRCC was not taken.
#[derive(Clone, Debug, PartialEq)]
pub enum NotTaken {
    /// It is answered with `err`; the reason is for the log.
    Refused(ListRefusal),
    /// It gets no answer.
    Silent(ListRefusal),
}

impl Machine {
    /// Takes an AddRCC. With `replace` the list is emptied first.
    pub(crate) fn add_instructions(
        &mut self,
        replace: bool,
        instructions: &[Instruction],
    ) -> Result<(), NotTaken> {
        if instructions.iter().any(|step| self.profile.unsupported_actions.contains(&step.action.number())) {
            return Err(NotTaken::Refused(ListRefusal::UnsupportedAction));
        }
        const NO_ROOM: NotTaken = NotTaken::Refused(ListRefusal::NoRoom);
        let kept = if replace { 0 } else { self.list.len() };
        if kept + instructions.len() > MAX_INSTRUCTIONS {
            return Err(NO_ROOM);
        }
        let clears = replace && instructions.is_empty();
        if !clears && !self.waits_for_remote() {
            self.arm_by_itself()?;
        }
        if replace {
            // An arm that is already stopping for good no longer counts as in motion, and clearing is not
            // replacing.
            let in_motion = match self.activity {
                Activity::Moving(_) => true,
                Activity::Halting(_, after) => after < AfterHalt::Drop,
                Activity::Idle
                | Activity::Paused(_)
                | Activity::Suspended(..)
                | Activity::Waiting { .. }
                | Activity::Awaiting { .. }
                | Activity::Delaying { .. }
                | Activity::Resting { .. } => false,
            };
            if in_motion && !clears && self.profile.replace_in_motion == ReplaceInMotion::Alarm200 {
                self.raise(AlarmCode::ROUTE, AlarmCause::ListReplacedInMotion);
                self.clear_list();
                return Err(NotTaken::Refused(ListRefusal::InMotion));
            }
            self.clear_list();
        }
        self.list.append(instructions).map_err(|_| NO_ROOM)?;
        // What a program does meanwhile does not affect the remote list.
        if replace && self.is_remote() {
            self.cycle.started = None;
            let takes_over = !clears && self.profile.replace_in_motion == ReplaceInMotion::TakeOver;
            let in_motion = (takes_over && self.take_over())
                || self.halt(self.profile.action_stop_time, AfterHalt::NewList);
            if !in_motion {
                self.activity = Activity::Idle;
            }
        }
        self.run_list();
        Ok(())
    }

    /// Empties the list and ends its run.
    pub(super) fn clear_list(&mut self) {
        self.list.clear();
        self.begin_list_run();
        self.end_signal_watch_of_list();
    }

    fn arm_by_itself(&mut self) -> Result<(), NotTaken> {
        const WHY: ListRefusal = ListRefusal::NotArmed;
        match self.profile.add_rcc_unarmed {
            Unarmed::Refuse => Err(NotTaken::Refused(WHY)),
            Unarmed::Silent => Err(NotTaken::Silent(WHY)),
            Unarmed::Arm if self.mode == OperationMode::Auto && !self.start_needed => {
                self.press_start().map_err(|refused| NotTaken::Refused(ListRefusal::NotStarted(refused)))?;
                if self.waits_for_remote() { Ok(()) } else { Err(NotTaken::Refused(WHY)) }
            }
            Unarmed::Arm => Err(NotTaken::Refused(WHY)),
        }
    }
}
