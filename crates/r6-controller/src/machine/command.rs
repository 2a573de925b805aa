//! Carries out each command (manual 4.2.1).

use r6_proto::message::command::CommandError;
use r6_proto::message::{CommandWords, RequestType};
use r6_proto::{Command, RegisterIndex};

use super::{AfterHalt, MAX_FRAMES, MAX_STACKS, Machine, Placed, Stack};
use crate::event::{Detail, Event, Reason};
use crate::io::OutputPoint;
use r6_motion::{Frame, Pose, Ramps};

impl Machine {
    /// Carries out a command.
    ///
    /// # Errors
    /// The reason, for the reply and the log.
    pub(crate) fn execute(&mut self, words: &CommandWords<'_>) -> Result<(), Reason> {
        if self.profile.accepts_heartbreak_command && words.word() == RequestType::Heartbreak.word() {
            self.watchdog.feed(self.now);
            return Ok(());
        }
        let name = words.name();
        if let Some(name) = name.filter(|name| !self.profile.has_command(*name)) {
            return Err(Reason::NotOfFirmware(name));
        }
        match words.read() {
            Ok(command) => self.carry_out(&command),
            Err(CommandError::Argument(error)) if !self.profile.checks_arguments => {
                self.note(Event::CommandWithoutEffect { why: error.into() });
                Ok(())
            }
            Err(CommandError::Argument(error)) => Err(error.into()),
            Err(CommandError::UnknownCommand { word, nearest }) => {
                // One known client sends heartbreak as a command.
                let sent = words.word();
                let request = RequestType::ALL.into_iter().find(|request| request.word() == sent);
                Err(Reason::NoCommand { word: Detail::of(word), nearest, request })
            }
        }
    }

    fn carry_out(&mut self, command: &Command<'_>) -> Result<(), Reason> {
        match command {
            Command::ActionStop => self.stop_action(),
            Command::ActionPause => self.pause_action(),
            Command::ActionSingleCycle => self.press_single_cycle()?,
            Command::StartButton => self.press_start()?,
            Command::StopButton => self.press_stop(),
            Command::SwitchMold { mold } => self.switch_mold(mold)?,
            Command::ModifyCounter { id, current, target } => self.modify_counter(*id, *current, *target)?,
            Command::ModifyOutput { board, point, on } => self.modify_output(*board, *point, *on)?,
            Command::ClearAlarmRunNext => self.clear_alarm_and_run(true)?,
            Command::ClearAlarmContinue => self.clear_alarm_and_run(false)?,
            Command::ModifyStackData { stack, spacing, count } => {
                if *stack >= MAX_STACKS {
                    return Err(format!("there are stacks 0 to {}", MAX_STACKS - 1).into());
                }
                self.stacks.insert(*stack, Stack { spacing: *spacing, count: *count });
            }
            Command::ModifyGspd { percent } => {
                self.global_speed = percent / 100.0;
                self.replan_for_global_speed();
            }
            Command::RewriteData { register, value, savable } => {
                self.write_register(*register, *value, *savable);
                self.registers_written(*register, 1);
            }
            Command::RewriteDataList { first, values, savable } => {
                for (number, value) in (first.number()..).zip(values) {
                    if let Some(register) = RegisterIndex::new(number) {
                        self.write_register(register, *value, *savable);
                    }
                }
                self.registers_written(*first, values.len());
            }
            Command::ModifyAccDec { acceleration, deceleration } => {
                self.ramps =
                    Ramps::new(*acceleration, *deceleration).ok_or("times from 0.001 to 60 seconds")?;
            }
            Command::SwitchTool { tool } => self.frames.tool = frame_number(*tool)?,
            Command::ModifyTool { tool, offset } => {
                let number = frame_number(*tool)?;
                let frame = Frame::at(&Pose::from_components(*offset)).map_err(|error| error.to_string())?;
                self.frames.tools.insert(number, Placed { offset: *offset, frame });
            }
            Command::SwitchCoordinate { workbench } => self.frames.bench = frame_number(*workbench)?,
            // The other effects of the arguments in the newest manual are unknown (reported, unit B). They
            // are accepted, and have no further effect.
            Command::ClearAlarm | Command::ClearAlarmWith { .. } => self.clear_alarm()?,
            #[allow(unreachable_patterns, reason = "a command may have its row before it is played here")]
            other => return Err(format!("the virtual controller does not play {}", other.name()).into()),
        }
        Ok(())
    }

    /// Writes a register. A value that is not savable does not replace the saved one, which comes back after
    /// a power cut.
    fn write_register(&mut self, register: RegisterIndex, value: i64, savable: bool) {
        self.registers.values.insert(register, value);
        if savable {
            self.registers.saved.insert(register, value);
        }
    }

    pub(super) fn switch_mold(&mut self, mold: &str) -> Result<(), Reason> {
        let Some(program) = self.programs.library.named(mold).cloned() else {
            let nearest = r6_proto::nearest(mold, self.programs.library.names());
            let nearest = nearest.map(Detail::of);
            return Err(Reason::NoProgram { name: Detail::of(mold), nearest });
        };
        if self.is_moving() {
            return Err(Reason::Moving);
        }
        // The other program starts from its first step, with a list of its own.
        self.halt(self.profile.action_stop_time, AfterHalt::Drop);
        self.clear_list();
        self.cycle.started = None;
        mold.clone_into(&mut self.programs.mold);
        self.use_program(program);
        self.run_list();
        Ok(())
    }

    fn modify_counter(&mut self, id: u32, current: Option<u32>, target: Option<u32>) -> Result<(), Reason> {
        let Some(counter) = self.counters.get_mut(&id) else {
            // Captured, unit C: a missing counter is answered ok nevertheless.
            return if self.profile.checks_arguments { Err(Reason::NoCounter(id)) } else { Ok(()) };
        };
        if target.is_some() && !self.profile.counter_target_writable {
            return Err(Reason::CounterTarget);
        }
        counter.current = current.map_or(counter.current, i64::from);
        counter.target = target.map_or(counter.target, i64::from);
        Ok(())
    }

    fn modify_output(&mut self, board: u8, point: u8, on: bool) -> Result<(), Reason> {
        let point = OutputPoint::of_command(board, point).ok_or(Reason::NoBoard(board))?;
        if matches!(point, OutputPoint::M(..)) && !self.profile.m_output_writable {
            return Err(Reason::MPoints);
        }
        self.io.set(point, on);
        self.io_changed();
        Ok(())
    }
}

fn frame_number(number: u32) -> Result<u32, Reason> {
    if number < MAX_FRAMES { Ok(number) } else { Err(Reason::NumbersBelow(MAX_FRAMES)) }
}
