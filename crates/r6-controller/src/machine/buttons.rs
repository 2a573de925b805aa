//! What starts, stops and pauses the machine, and what goes into its list.

use r6_proto::message::Instruction;

use super::Machine;
use super::execution::{Activity, AfterHalt};
use crate::profile::{ReplaceInMotion, StopButton, StopMode, Unarmed};
use r6_proto::OperationMode;

/// Why AddRCC was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotTaken {
    /// It is answered with `err`; the reason is for the log.
    Refused(&'static str),
    /// It is not even answered.
    Silent(&'static str),
}

/// Why a button did nothing.
pub type NotPossible = &'static str;

impl Machine {
    /// The start button: in automatic the program runs, from where it was paused or from its first step.
    pub(crate) fn press_start(&mut self) -> Result<(), NotPossible> {
        self.ready_to_run()?;
        if !self.mode.may_run() {
            self.mode = OperationMode::Running;
            self.last_pass = false;
            self.note(format!("{}: started", self.mode));
        }
        self.go_on();
        Ok(())
    }

    /// Single cycle: the program runs to the end of its pass and stops there.
    pub(crate) fn press_single_cycle(&mut self) -> Result<(), NotPossible> {
        self.ready_to_run()?;
        self.mode = OperationMode::SingleCycle;
        self.last_pass = true;
        self.note("single cycle".to_owned());
        self.go_on();
        if self.list.is_empty() {
            self.leave_running("single cycle: nothing to run");
        }
        Ok(())
    }

    fn ready_to_run(&self) -> Result<(), NotPossible> {
        if self.alarm != 0 {
            return Err("an alarm is present: clear it first");
        }
        if !self.homed {
            return Err("the machine is not homed");
        }
        match self.mode {
            OperationMode::Auto
            | OperationMode::Running
            | OperationMode::SingleStep
            | OperationMode::SingleCycle => Ok(()),
            OperationMode::Manual => Err("the machine is in manual: turn the key to automatic"),
            OperationMode::Stop | OperationMode::None | OperationMode::Unknown(_) => {
                Err("the machine is in stop: turn the key to automatic")
            }
        }
    }

    fn go_on(&mut self) {
        self.resume_move();
        self.run_list();
    }

    /// The stop button.
    pub(crate) fn press_stop(&mut self) {
        if !self.mode.may_run() {
            return;
        }
        let second_press = self.last_pass;
        match self.profile.stop_button {
            StopButton::FinishCycle if !second_press && self.cycle_started.is_some() => {
                self.last_pass = true;
                self.note("stop button: ends with this cycle".to_owned());
            }
            StopButton::FinishCycle | StopButton::AtOnce => {
                self.halt(self.profile.action_stop_time, AfterHalt::Drop);
                self.leave_running("stop button");
            }
        }
    }

    /// `actionStop`: the motion stops at once, and start begins from the first step. The list stays.
    pub(crate) fn stop_action(&mut self) {
        let ran = self.mode.may_run();
        self.halt(self.profile.action_stop_time, AfterHalt::Drop);
        self.list.rewind();
        self.cycle_started = None;
        self.stop_signal = None;
        if ran {
            self.leave_running("actionStop");
            if self.profile.action_stop_mode == StopMode::Stop {
                self.mode = OperationMode::Stop;
            }
            if self.profile.action_stop_alarm != 0 && self.alarm == 0 {
                self.alarm = self.profile.action_stop_alarm;
                self.note(format!("alarm {}: actionStop", self.alarm));
            }
        }
    }

    /// `actionPause`: the motion rests, and start goes on from there.
    pub(crate) fn pause_action(&mut self) {
        self.halt(self.profile.action_pause_time, AfterHalt::Keep);
        self.leave_running("actionPause");
    }

    /// An alarm has come: the motion ends, the program no longer runs, the list stays.
    pub(crate) fn halt_for_alarm(&mut self) {
        self.halt(self.profile.action_stop_time, AfterHalt::Drop);
        self.cycle_started = None;
        self.leave_running("alarm");
    }

    /// `clearAlarm`: the alarm goes; nothing runs by itself.
    pub(crate) fn clear_alarm(&mut self) {
        if self.alarm != 0 {
            self.note(format!("alarm {} cleared", self.alarm));
        }
        self.alarm = 0;
    }

    /// `clearAlarmContinue`, `clearAlarmRunNext`: the alarm goes and the program goes on, with the next step if `skip`.
    pub(crate) fn clear_alarm_and_run(&mut self, skip: bool) -> Result<(), NotPossible> {
        let had_alarm = self.alarm != 0;
        self.clear_alarm();
        if skip && had_alarm && matches!(self.activity, Activity::Idle) && self.list.current().is_some() {
            self.list.finish_current();
        }
        self.press_start()
    }

    /// Takes an AddRCC: `replace` empties the list first.
    pub(crate) fn add_instructions(
        &mut self,
        replace: bool,
        instructions: &[Instruction],
    ) -> Result<(), NotTaken> {
        if instructions.iter().any(|step| self.profile.unsupported_actions.contains(&step.action.number())) {
            return Err(NotTaken::Refused("this firmware does not know one of the actions"));
        }
        let clears = replace && instructions.is_empty();
        if !clears && !self.waits_for_remote() {
            self.arm_by_itself()?;
        }
        if replace {
            let in_motion = self.is_moving();
            if in_motion && self.profile.replace_in_motion == ReplaceInMotion::Alarm200 {
                self.raise(200, "AddRCC replaced the list in mid-motion".to_owned());
                self.list.clear();
                return Err(NotTaken::Refused("the list was replaced in mid-motion: alarm 200"));
            }
            self.list.clear();
            self.cycle_started = None;
            if !self.halt(self.profile.action_stop_time, AfterHalt::NewList) {
                self.activity = Activity::Idle;
            }
        }
        self.list
            .append(instructions)
            .map_err(|_| NotTaken::Refused("the instruction list has no room for so many instructions"))?;
        self.run_list();
        Ok(())
    }

    fn arm_by_itself(&mut self) -> Result<(), NotTaken> {
        const WHY: &str = "no program waits for remote commands: the mode is not 7, or an alarm is present";
        match self.profile.add_rcc_unarmed {
            Unarmed::Refuse => Err(NotTaken::Refused(WHY)),
            Unarmed::Silent => Err(NotTaken::Silent(WHY)),
            Unarmed::Arm if self.mode == OperationMode::Auto => self.press_start().map_err(NotTaken::Refused),
            Unarmed::Arm => Err(NotTaken::Refused(WHY)),
        }
    }
}
