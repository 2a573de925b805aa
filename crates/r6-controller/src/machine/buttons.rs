//! Starts, stops and pauses the machine.

use super::Machine;
use super::execution::Activity;
use super::halt::AfterHalt;
use crate::event::{AlarmCause, Event, ModeReason};
use crate::mode::Key;
use crate::panel::Refused;
use crate::profile::{StopButton, StopMode};
use r6_proto::OperationMode;
use r6_proto::alarm::AlarmCode;

impl Machine {
    /// Presses the start button: in automatic the program runs, from where it was paused or from its first
    /// step.
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
            self.cycle.last_pass = false;
            self.note(Event::ModeChanged { mode: self.mode, why: ModeReason::Started });
        } else if self.mode == OperationMode::SingleStep {
            self.mode = OperationMode::Running;
        }
        self.go_on();
        Ok(())
    }

    /// Runs the program from its first step to the end of one pass, and stops there. Unlike a single cycle,
    /// the program waits at every wait.
    pub(crate) fn run_one_pass(&mut self) -> Result<(), Refused> {
        self.ready_to_run()?;
        self.begin_anew();
        self.mode = OperationMode::Running;
        self.cycle.last_pass = true;
        self.note(Event::ModeChanged { mode: self.mode, why: ModeReason::Started });
        self.go_on();
        Ok(())
    }

    /// Presses single cycle: the program runs to the end of its pass and stops there.
    pub(crate) fn press_single_cycle(&mut self) -> Result<(), Refused> {
        self.ready_to_run()?;
        if !self.mode.may_run() {
            self.restart_program();
        }
        self.mode = OperationMode::SingleCycle;
        self.cycle.last_pass = true;
        self.note(Event::SingleCycle);
        self.skip_trigger();
        self.go_on();
        Ok(())
    }

    /// Presses single step: the program runs one step from where it stands, and rests there.
    pub(crate) fn press_single_step(&mut self) -> Result<(), Refused> {
        self.ready_to_run()?;
        self.mode = OperationMode::SingleStep;
        self.note(Event::SingleStep);
        self.go_on();
        Ok(())
    }

    pub(super) fn ready_to_run(&self) -> Result<(), Refused> {
        if self.alarm.is_raised() && !self.emergency_stop {
            return Err(Refused::Alarm { alarm: self.alarm });
        }
        self.may_start()
    }

    /// Whether a program could run if there were no alarm.
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

    /// Turns the mode key, which only an operator at the machine can do. A motion under way comes to rest,
    /// and nothing starts on its own.
    pub(crate) fn turn_key(&mut self, key: Key) {
        self.halt(self.profile.action_stop_time, AfterHalt::Drop);
        self.cycle.started = None;
        self.cycle.last_pass = false;
        self.mode = match key {
            Key::Manual => OperationMode::Manual,
            Key::Stop => OperationMode::Stop,
            Key::Auto => OperationMode::Auto,
        };
        self.note(Event::ModeChanged { mode: self.mode, why: ModeReason::KeyTurned });
    }

    /// Presses the stop button.
    pub(crate) fn press_stop(&mut self) {
        self.halt_hand(self.profile.action_stop_time);
        if !self.mode.may_run() {
            return;
        }
        let second_press = self.cycle.last_pass;
        match self.profile.stop_button {
            StopButton::FinishCycle if !second_press && self.cycle.started.is_some() => {
                self.cycle.last_pass = true;
                self.note(Event::EndsWithCycle);
            }
            StopButton::FinishCycle | StopButton::AtOnce => {
                self.halt(self.profile.action_stop_time, AfterHalt::Drop);
                self.cycle.started = None;
                self.leave_running(ModeReason::StopButton);
            }
        }
    }

    /// Carries out `actionStop`: the motion stops at once, and start begins from the first step. The list
    /// stays.
    pub(crate) fn stop_action(&mut self) {
        let ran = self.mode.may_run();
        self.halt(self.profile.action_stop_time, AfterHalt::Rewind);
        self.cycle.started = None;
        self.end_signal_watch();
        if ran {
            self.cycle.last_pass = false;
            self.mode = self.mode_after_stop();
            self.note(Event::ModeChanged { mode: self.mode, why: ModeReason::ActionStop });
            if self.profile.action_stop_alarm.is_raised() && !self.alarm.is_raised() {
                self.alarm = self.profile.action_stop_alarm;
                self.note(Event::AlarmRaised { alarm: self.alarm, why: AlarmCause::ActionStop });
            }
        }
    }

    /// The mode of a program that ran, after `actionStop` or an emergency stop.
    pub(super) fn mode_after_stop(&self) -> OperationMode {
        match self.profile.action_stop_mode {
            StopMode::Auto => OperationMode::Auto,
            StopMode::Stop => OperationMode::Stop,
        }
    }

    /// Carries out `actionPause`: the motion comes to rest, and start continues from there.
    pub(crate) fn pause_action(&mut self) {
        self.halt(self.profile.action_pause_time, AfterHalt::Keep);
        if self.mode.may_run() {
            self.program_is_paused();
        }
        self.leave_running(ModeReason::ActionPause);
    }

    /// Stops for an alarm: the motion ends, the program no longer runs, the list stays.
    pub(crate) fn halt_for_alarm(&mut self) {
        self.halt(self.profile.action_stop_time, AfterHalt::Drop);
        self.cycle.started = None;
        self.leave_running(ModeReason::Alarm);
    }

    /// Carries out `clearAlarm`: clears the alarm, unless the emergency stop is pressed. Nothing starts to
    /// run.
    pub(crate) fn clear_alarm(&mut self) -> Result<(), Refused> {
        if self.emergency_stop {
            return Err(Refused::EmergencyStop);
        }
        if self.alarm.is_raised() {
            self.note(Event::AlarmCleared { alarm: self.alarm });
        }
        self.alarm = AlarmCode::NONE;
        Ok(())
    }

    /// Carries out `clearAlarmContinue` and `clearAlarmRunNext`: clears the alarm and continues the program,
    /// with the next step if `skip`.
    pub(crate) fn clear_alarm_and_run(&mut self, skip: bool) -> Result<(), Refused> {
        self.may_start()?;
        let skip = skip && self.alarm_is_of_a_step();
        self.clear_alarm()?;
        if skip {
            match &mut self.activity {
                // The step counts as done once the arm rests.
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
}
