//! Carries out the operator's actions at the machine.

use super::Machine;
use super::execution::Activity;
use super::halt::AfterHalt;
use crate::event::{AlarmCause, Event};
use crate::io::{BOARDS, POINTS};
use crate::panel::{Button, PanelAction, Refused};
use r6_proto::alarm::AlarmCode;

impl Machine {
    /// Does what an operator does at the machine. The machine has to be at the present time.
    pub(crate) fn operate(&mut self, action: &PanelAction) -> Result<(), Refused> {
        match action {
            PanelAction::SetInput { board, point, on } => {
                if usize::from(*board) >= BOARDS || *point >= POINTS {
                    return Err(Refused::NoSuchInput { board: *board, point: *point });
                }
                self.io.set_input(*board, *point, *on);
                self.io_changed();
            }
            PanelAction::SetEuInput { point, on } => {
                if *point >= POINTS {
                    return Err(Refused::NoSuchInput { board: 0, point: *point });
                }
                self.io.set_eu_input(*point, *on);
                self.io_changed();
            }
            PanelAction::Press(Button::Start) => {
                self.rests_to_start()?;
                self.press_start()?;
            }
            PanelAction::Press(Button::Stop) => self.press_stop(),
            PanelAction::Press(Button::Pause) => self.pause_action(),
            PanelAction::Press(Button::SingleCycle) => {
                self.rests_to_start()?;
                self.press_single_cycle()?;
            }
            PanelAction::Press(Button::SingleStep) => {
                self.rests_to_start()?;
                self.press_single_step()?;
            }
            PanelAction::TurnKey(key) => self.turn_key(*key),
            PanelAction::EmergencyStop => self.press_emergency_stop(),
            PanelAction::ReleaseEmergencyStop => self.release_emergency_stop(),
            PanelAction::ClearAlarm => {
                if self.alarm.is_raised() && !self.emergency_stop && self.is_moving() {
                    return Err(Refused::Moving);
                }
                self.clear_alarm()?;
            }
            PanelAction::RaiseAlarm(alarm) if !(1..=AlarmCode::LAST.0).contains(&alarm.0) => {
                return Err(Refused::NoSuchAlarm { alarm: *alarm });
            }
            PanelAction::RaiseAlarm(alarm) => self.raise(*alarm, AlarmCause::Panel),
            PanelAction::Home => self.home_by_hand()?,
            PanelAction::Jog { axis, by, percent } => self.jog(*axis, *by, *percent)?,
            PanelAction::HoldJog { axis, up, percent } => self.hold(*axis, *up, *percent)?,
            PanelAction::KeepJog => self.still_held()?,
            PanelAction::EndJog => self.let_go(),
            PanelAction::ClearPoints => self.clear_points(),
            PanelAction::SwitchProgram(name) => {
                self.switch_mold(name).map_err(|reason| Refused::Program { reason: reason.to_string() })?;
            }
            PanelAction::LoadProgram { name, text } => self.load_program(name, text)?,
        }
        Ok(())
    }

    /// Refuses a start from the panel while the arm still slows down after a stop. (Over the wire a start is
    /// accepted at once, and the first step begins once the arm rests. After a pause, start resumes in any
    /// case.)
    fn rests_to_start(&self) -> Result<(), Refused> {
        let slows_down = matches!(self.activity, Activity::Halting(_, AfterHalt::Drop | AfterHalt::Rewind));
        if !slows_down || self.mode.may_run() {
            return Ok(());
        }
        self.ready_to_run()?;
        Err(Refused::Moving)
    }

    /// Presses the emergency stop. The alarm becomes 7, whatever it was. The arm comes to rest as fast as
    /// with `actionStop`, and the mode is as after `actionStop`. Nothing resumes later: the next start begins
    /// with the first step.
    fn press_emergency_stop(&mut self) {
        if self.emergency_stop {
            return;
        }
        self.emergency_stop = true;
        self.start_needed = true;
        self.halt(self.profile.action_stop_time, AfterHalt::Rewind);
        self.cycle.started = None;
        self.end_signal_watch();
        self.cycle.last_pass = false;
        if self.mode.may_run() {
            self.mode = self.mode_after_stop();
        }
        self.alarm = AlarmCode::EMERGENCY_STOP;
        let why = AlarmCause::EmergencyStop { mode: self.mode };
        self.note(Event::AlarmRaised { alarm: AlarmCode::EMERGENCY_STOP, why });
    }

    fn release_emergency_stop(&mut self) {
        if std::mem::replace(&mut self.emergency_stop, false) {
            self.note(Event::EmergencyStopReleased);
        }
    }

    /// Whether an alarm interrupted the program at a step. After an emergency stop the program begins again
    /// instead.
    pub(super) fn alarm_is_of_a_step(&self) -> bool {
        !matches!(self.alarm, AlarmCode::NONE | AlarmCode::EMERGENCY_STOP)
    }
}
