//! What starts, stops and pauses the machine, and what goes into its list.

use r6_proto::alarm::AlarmCode;
use r6_proto::message::Instruction;

use super::Machine;
use super::execution::Activity;
use super::halt::AfterHalt;
use crate::event::{AlarmCause, Event, ListRefusal, ModeReason};
use crate::instruction_list::MAX_INSTRUCTIONS;
use crate::mode::Key;
use crate::panel::Refused;
use crate::profile::{ReplaceInMotion, StopButton, StopMode, Unarmed};
use r6_proto::OperationMode;

/// Why AddRCC was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotTaken {
    /// It is answered with `err`; the reason is for the log.
    Refused(ListRefusal),
    /// It is not even answered.
    Silent(ListRefusal),
}

impl Machine {
    /// The start button: in automatic the program runs, from where it was paused or from its first step.
    pub(crate) fn press_start(&mut self) -> Result<(), Refused> {
        self.start(true)
    }

    /// Runs the program: from its first step if `anew`, unless it was paused.
    fn start(&mut self, anew: bool) -> Result<(), Refused> {
        self.ready_to_run()?;
        if !self.mode.may_run() {
            if anew {
                self.restart_program();
            }
            self.mode = OperationMode::Running;
            self.last_pass = false;
            self.note(Event::ModeChanged { mode: self.mode, why: ModeReason::Started });
        } else if self.mode == OperationMode::SingleStep {
            self.mode = OperationMode::Running;
        }
        self.go_on();
        Ok(())
    }

    /// Single cycle: the program runs to the end of its pass and stops there.
    pub(crate) fn press_single_cycle(&mut self) -> Result<(), Refused> {
        self.ready_to_run()?;
        if !self.mode.may_run() {
            self.restart_program();
        }
        self.mode = OperationMode::SingleCycle;
        self.last_pass = true;
        self.note(Event::SingleCycle);
        self.skip_trigger();
        self.go_on();
        Ok(())
    }

    /// Single step: the program runs one step, from where it stands, and rests there.
    pub(crate) fn press_single_step(&mut self) -> Result<(), Refused> {
        self.ready_to_run()?;
        self.mode = OperationMode::SingleStep;
        self.note(Event::SingleStep);
        self.go_on();
        Ok(())
    }

    pub(super) fn ready_to_run(&self) -> Result<(), Refused> {
        if self.alarm != 0 && !self.emergency_stop {
            return Err(Refused::Alarm { alarm: self.alarm });
        }
        self.may_start()
    }

    /// Whether a program could run but for an alarm.
    fn may_start(&self) -> Result<(), Refused> {
        if self.emergency_stop {
            return Err(Refused::EmergencyStop);
        }
        if !self.homed {
            return Err(Refused::NotHomed);
        }
        if self.hand.is_some() {
            return Err(Refused::Moving);
        }
        match self.mode {
            OperationMode::Auto
            | OperationMode::Running
            | OperationMode::SingleStep
            | OperationMode::SingleCycle => Ok(()),
            OperationMode::Manual | OperationMode::Stop | OperationMode::None | OperationMode::Unknown(_) => {
                Err(Refused::NotAuto { mode: self.mode })
            }
        }
    }

    fn go_on(&mut self) {
        self.start_needed = false;
        self.resume();
        self.run_list();
    }

    /// The mode key, which only a person at the machine turns: what runs comes to rest, and nothing starts by itself.
    pub(crate) fn turn_key(&mut self, key: Key) {
        self.halt(self.profile.action_stop_time, AfterHalt::Drop);
        self.cycle_started = None;
        self.last_pass = false;
        self.mode = match key {
            Key::Manual => OperationMode::Manual,
            Key::Stop => OperationMode::Stop,
            Key::Auto => OperationMode::Auto,
        };
        self.note(Event::ModeChanged { mode: self.mode, why: ModeReason::KeyTurned });
    }

    /// The stop button.
    pub(crate) fn press_stop(&mut self) {
        self.halt_hand(self.profile.action_stop_time);
        if !self.mode.may_run() {
            return;
        }
        let second_press = self.last_pass;
        match self.profile.stop_button {
            StopButton::FinishCycle if !second_press && self.cycle_started.is_some() => {
                self.last_pass = true;
                self.note(Event::EndsWithCycle);
            }
            StopButton::FinishCycle | StopButton::AtOnce => {
                self.halt(self.profile.action_stop_time, AfterHalt::Drop);
                self.cycle_started = None;
                self.leave_running(ModeReason::StopButton);
            }
        }
    }

    /// `actionStop`: the motion stops at once, and start begins from the first step. The list stays.
    pub(crate) fn stop_action(&mut self) {
        let ran = self.mode.may_run();
        self.halt(self.profile.action_stop_time, AfterHalt::Rewind);
        self.cycle_started = None;
        self.end_signal_watch();
        if ran {
            self.last_pass = false;
            self.mode = self.mode_after_stop();
            self.note(Event::ModeChanged { mode: self.mode, why: ModeReason::ActionStop });
            if self.profile.action_stop_alarm != 0 && self.alarm == 0 {
                self.alarm = self.profile.action_stop_alarm;
                self.note(Event::AlarmRaised { alarm: self.alarm, why: AlarmCause::ActionStop });
            }
        }
    }

    /// The mode in which `actionStop` and the emergency stop leave a program that ran.
    pub(super) fn mode_after_stop(&self) -> OperationMode {
        match self.profile.action_stop_mode {
            StopMode::Auto => OperationMode::Auto,
            StopMode::Stop => OperationMode::Stop,
        }
    }

    /// `actionPause`: the motion rests, and start goes on from there.
    pub(crate) fn pause_action(&mut self) {
        self.halt(self.profile.action_pause_time, AfterHalt::Keep);
        if self.mode.may_run() {
            self.program_is_paused();
        }
        self.leave_running(ModeReason::ActionPause);
    }

    /// An alarm has come: the motion ends, the program no longer runs, the list stays.
    pub(crate) fn halt_for_alarm(&mut self) {
        self.halt(self.profile.action_stop_time, AfterHalt::Drop);
        self.cycle_started = None;
        self.leave_running(ModeReason::Alarm);
    }

    /// `clearAlarm`: the alarm goes, unless the emergency stop is pressed; nothing runs by itself.
    pub(crate) fn clear_alarm(&mut self) -> Result<(), Refused> {
        if self.emergency_stop {
            return Err(Refused::EmergencyStop);
        }
        if self.alarm != 0 {
            self.note(Event::AlarmCleared { alarm: self.alarm });
        }
        self.alarm = 0;
        Ok(())
    }

    /// `clearAlarmContinue`, `clearAlarmRunNext`: the alarm goes and the program goes on, with the next step if `skip`.
    pub(crate) fn clear_alarm_and_run(&mut self, skip: bool) -> Result<(), Refused> {
        self.may_start()?;
        let skip = skip && self.alarm_is_of_a_step();
        self.clear_alarm()?;
        if skip {
            match &mut self.activity {
                // It counts as done once the arm rests.
                Activity::Halting(_, after) if *after < AfterHalt::Rewind => *after = AfterHalt::NextStep,
                Activity::Idle => self.skip_step(),
                Activity::Halting(..)
                | Activity::Moving(_)
                | Activity::Paused(_)
                | Activity::Suspended(..)
                | Activity::Waiting { .. }
                | Activity::Awaiting { .. }
                | Activity::Delaying { .. }
                | Activity::Resting { .. } => {}
            }
        }
        self.start(false)
    }

    /// Takes an AddRCC: `replace` empties the list first.
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
            // An arm that already comes to rest for good is no longer in motion, and an empty list is none.
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
                self.raise(AlarmCode::LIST_REPLACED.0, AlarmCause::ListReplacedInMotion);
                self.clear_list();
                return Err(NotTaken::Refused(ListRefusal::InMotion));
            }
            self.clear_list();
        }
        self.list.append(instructions).map_err(|_| NO_ROOM)?;
        // What a program does meanwhile is no concern of the remote list.
        if replace && self.is_remote() {
            self.cycle_started = None;
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

    /// Empties the list for another one: a run of it is over.
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
                self.press_start()
                    .map_err(|refused| NotTaken::Refused(ListRefusal::NotStarted(refused.reason())))?;
                if self.waits_for_remote() { Ok(()) } else { Err(NotTaken::Refused(WHY)) }
            }
            Unarmed::Arm => Err(NotTaken::Refused(WHY)),
        }
    }
}
