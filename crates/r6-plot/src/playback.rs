//! Plays a motion or a taught program on a virtual controller with a virtual clock: the client, the arm and
//! the inputs of the cell.

use std::collections::VecDeque;
use std::time::Duration;

use r6_client::{Motion, RobotSettings, RunOptions};
use r6_controller::event::{AlarmCause, ModeReason, Reason};
use r6_controller::instruction_list::MAX_INSTRUCTIONS as LIST_ROOM;
use r6_controller::settings::REMOTE_MOLD;
use r6_controller::{
    ConnectionId, Controller, ControllerSettings, Event, Key, Level, PanelAction, Profile, Program,
    ProgramStep, RobotModel, StartState,
};
use r6_program::first_axes;
use r6_program::taught;
use r6_proto::AXES;
use r6_proto::alarm::AlarmCode;
use r6_proto::message::Instruction;
use r6_proto::message::instruction::{Action, BlendLevel, Coordinates, Manner, Move};
use r6_proto::time::Instant;

use crate::error::PlayError;
use crate::recording::{Alarm, Ending, Played, Reached, Recorder, Recording, Step};
use crate::words;

/// The most instructions of a motion that are played, and the most steps of a pass: far more than the longest
/// known program, and few enough to draw.
pub const MAX_INSTRUCTIONS: usize = 10_000;

/// How long a program is followed, in its own time. A longer program is taken for a mistake.
pub const LONGEST: Duration = Duration::from_secs(7 * 24 * 3600);

/// How often the controller is looked at. It keeps a program that goes round in a millisecond from being
/// followed for a week.
const MAX_LOOKS: u64 = 1_000_000;

/// The conditions in which a motion or a program is played.
#[derive(Clone, Debug)]
pub struct Cell {
    /// The controller and its arm.
    pub settings: ControllerSettings,
    /// Start positions of the axes, degrees or mm. Axes without a value start at 0.
    pub from: Vec<f64>,
    /// Changes of the inputs.
    pub inputs: Vec<InputChange>,
    /// How much is played.
    pub limits: Limits,
}

/// How much of a motion or a program is played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// How long it is followed, in its own time. [`LONGEST`] at most.
    pub longest: Duration,
    /// The most instructions of a motion, and the most steps of a pass. [`MAX_INSTRUCTIONS`] at most.
    pub instructions: usize,
    /// How often the controller is looked at: this bounds the time of computing.
    pub looks: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { longest: LONGEST, instructions: MAX_INSTRUCTIONS, looks: MAX_LOOKS }
    }
}

impl Cell {
    /// A cell with a controller of the profile `hc1`, this arm and this global speed in percent, where no
    /// input changes.
    #[must_use]
    pub fn of_model(model: RobotModel, global_speed: f64, from: Vec<f64>) -> Self {
        let settings = ControllerSettings { global_speed, ..ControllerSettings::new(Profile::hc1(), model) };
        Self { settings, from, inputs: Vec::new(), limits: Limits::default() }
    }
}

/// A change of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputChange {
    /// When, from the beginning of the motion or program.
    pub at: Duration,
    /// The board, 0 to 7.
    pub board: u8,
    /// The point, 0 to 31.
    pub point: u8,
    /// The new level.
    pub on: bool,
}

/// Plays a motion and returns what happened. A motion that repeats is played once. `append` sends it as a
/// client that appends to the list. Calls `progress` now and then with the time since the beginning, seconds.
///
/// # Errors
/// The motion is wrong or too long, the arm cannot reach the start, or the controller refuses a frame.
pub fn motion(
    cell: Cell,
    motion: &Motion,
    append: bool,
    progress: &mut dyn FnMut(f64),
) -> Result<Recording, PlayError> {
    let once = motion.repeats().then(|| once(motion)).transpose()?;
    let motion = once.as_ref().unwrap_or(motion);
    let instructions = motion.instructions()?.to_vec();
    let count = instructions.len();
    let most = cell.limits.instructions.min(MAX_INSTRUCTIONS);
    if count > most {
        return Err(PlayError::TooManyInstructions { count, most });
    }
    let frames = Frame::of(motion, append)?;
    let (mut player, mut recorder) = Player::at_start(cell, Script::Motion(instructions))?;
    player.frames = frames;
    let ending = player.follow(&mut recorder, progress)?;
    let rest = (recorder.turns() < count).then(|| player.instruction(recorder.turns()));
    let ended_at = match &ending {
        Ending::Done => None,
        Ending::Alarm(_) => Some(player.instruction(player.done)),
        Ending::Waiting | Ending::TooLong | Ending::Endless => {
            Some(player.instruction(recorder.turns().min(count.saturating_sub(1))))
        }
    };
    Ok(recorder.finish(Played::Motion(count), ending, ended_at, rest))
}

/// Plays one pass of a taught program and returns what happened. Programs that it calls are taken from the
/// library of the settings. Calls `progress` now and then with the time since the beginning, seconds.
///
/// # Errors
/// The program has no steps or calls a program that does not exist, or the arm cannot reach the start.
pub fn program(cell: Cell, program: &Program, progress: &mut dyn FnMut(f64)) -> Result<Recording, PlayError> {
    if program.steps().is_empty() {
        return Err(PlayError::NoSteps);
    }
    let mut library = cell.settings.library.clone();
    library.insert(program.clone()).map_err(PlayError::Library)?;
    if let Some(missing) = library.missing_call(program) {
        return Err(PlayError::MissingCall(missing));
    }
    let (mut player, mut recorder) = Player::at_start(cell, Script::Program(program.clone()))?;
    let name = program.name().to_owned();
    let preparations = [
        PanelAction::TurnKey(Key::Stop),
        PanelAction::TurnKey(Key::Auto),
        PanelAction::LoadProgram { name: name.clone(), text: program.text().to_owned() },
        PanelAction::SwitchProgram(name.clone()),
    ];
    for action in preparations {
        player.controller.operate(player.now, &action).map_err(PlayError::NotStarted)?;
    }
    player.forget_log();
    player.controller.run_one_pass(player.now).map_err(PlayError::NotStarted)?;
    player.listen();
    let ending = player.follow(&mut recorder, progress)?;
    let ended_at = match &ending {
        Ending::Done => None,
        Ending::Alarm(_) => player.alarm_step.take(),
        Ending::Waiting | Ending::TooLong | Ending::Endless => player.present_step(),
    };
    let played = Played::Program { name, steps: program.steps().len() };
    Ok(recorder.finish(played, ending, ended_at, None))
}

/// The same motion, each step once.
fn once(motion: &Motion) -> Result<Motion, PlayError> {
    let steps = motion.instructions()?.iter();
    Ok(Motion::of_list(steps.map(|step| Instruction { oneshot: true, ..*step })))
}

/// A frame, and its effect on the list.
struct Frame {
    bytes: Vec<u8>,
    replaces: bool,
    instructions: usize,
}

impl Frame {
    /// The frames of a motion, for a controller that accepts every length.
    fn of(motion: &Motion, append: bool) -> Result<VecDeque<Self>, PlayError> {
        let (settings, most) = (RobotSettings::default(), usize::MAX);
        let options = RunOptions { append, frame_instructions: most, room: most, ..RunOptions::default() };
        let lists = motion.lists(&settings, options)?;
        let frames = motion.frames(&settings, options)?;
        let frame = |(list, bytes): (std::ops::Range<usize>, Vec<u8>)| Self {
            bytes,
            replaces: list.start == 0 && !append,
            instructions: list.len(),
        };
        Ok(lists.into_iter().zip(frames).map(frame).collect())
    }
}

/// What is played.
enum Script {
    Motion(Vec<Instruction>),
    Program(Program),
}

/// A client, its controller, and the inputs of the cell.
struct Player {
    controller: Controller,
    id: ConnectionId,
    now: Instant,
    script: Script,
    /// Frames that the client still has to send.
    frames: VecDeque<Frame>,
    frame_number: u64,
    /// When the controller answers the last frame. The client sends the next one after that.
    answered: Instant,
    inputs: VecDeque<(Instant, InputChange)>,
    begin: Instant,
    alarm: Option<Alarm>,
    /// The step of a taught program that raised the alarm.
    alarm_step: Option<Step>,
    /// Why a taught program no longer runs.
    over: Option<ModeReason>,
    /// Instructions that were done before the motion began.
    done_before: u64,
    /// Instructions of the motion that are done.
    done: usize,
    limits: Limits,
}

impl Player {
    /// A controller whose arm is at the start, and a recorder that starts now.
    fn at_start(cell: Cell, script: Script) -> Result<(Self, Recorder), PlayError> {
        let model = cell.settings.model.clone();
        let settings =
            ControllerSettings { mold: REMOTE_MOLD.to_owned(), start: StartState::Waiting, ..cell.settings };
        let mut controller = Controller::new(settings, Instant::ORIGIN);
        let id = controller.connect(Instant::ORIGIN);
        let mut player = Self {
            controller,
            id,
            now: Instant::ORIGIN,
            script,
            frames: VecDeque::new(),
            frame_number: 0,
            answered: Instant::ORIGIN,
            inputs: VecDeque::new(),
            begin: Instant::ORIGIN,
            alarm: None,
            alarm_step: None,
            over: None,
            done_before: 0,
            done: 0,
            limits: cell.limits,
        };
        player.go_to(&cell.from)?;
        player.done_before = player.controller.machine().list().completed();
        player.begin = player.now;
        let mut inputs = cell.inputs;
        inputs.sort_by_key(|change| change.at);
        player.inputs = inputs.into_iter().map(|change| (player.begin + change.at, change)).collect();
        let recorder = Recorder::new(&model, player.begin, player.controller.machine());
        Ok((player, recorder))
    }

    /// Moves the axes to the start of the program.
    fn go_to(&mut self, from: &[f64]) -> Result<(), PlayError> {
        if from.iter().all(|axis| *axis == 0.0) {
            return Ok(());
        }
        let mut target = [0.0; AXES];
        for (slot, value) in target.iter_mut().zip(from) {
            *slot = *value;
        }
        let manner = Manner {
            mask: Some(first_axes(from.len())),
            speed: Some(100.0),
            smooth: BlendLevel::new(0),
            ..Manner::default()
        };
        let motion = Move { target: Coordinates::from_slice(&target), manner };
        let step = Instruction { oneshot: true, action: Action::AxisMove(motion) };
        self.frames = Frame::of(&Motion::of_list([step]), false)?;
        self.feed()?;
        while let Some(due) = self.next_event() {
            self.pass(due);
        }
        match &self.alarm {
            None => Ok(()),
            Some(alarm) => Err(PlayError::StartNotReached { alarm: alarm.code, why: alarm.why.clone() }),
        }
    }

    /// Goes from event to event, and samples in between while the arm moves.
    fn follow(
        &mut self,
        recorder: &mut Recorder,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Ending, PlayError> {
        let Limits { longest, instructions, looks } = self.limits;
        let end = self.now + longest.min(LONGEST);
        for _ in 0..looks {
            self.feed()?;
            let reached = self.reached(recorder.turns());
            recorder.look(self.now, self.controller.machine(), reached);
            if let Some(ending) = self.ending() {
                return Ok(ending);
            }
            if recorder.turns() > instructions.min(MAX_INSTRUCTIONS) {
                return Ok(Ending::Endless);
            }
            let moving = self.controller.machine().is_moving();
            let look = moving.then(|| recorder.next_look(self.now));
            let Some(due) = self.next_event().into_iter().chain(look).min() else {
                return Ok(Ending::Waiting);
            };
            if due > end {
                return Ok(Ending::TooLong);
            }
            self.pass(due);
            progress(recorder.seconds(self.now));
        }
        Ok(Ending::Endless)
    }

    /// The time of the next event: a timeout of the controller, an answer, or an input.
    fn next_event(&self) -> Option<Instant> {
        let answer = (self.answered > self.now).then_some(self.answered);
        let input = self.inputs.front().map(|(at, _)| *at);
        [self.controller.poll_timeout(), answer, input].into_iter().flatten().min()
    }

    /// Advances the time to `to`. The caller makes sure that no event is due before.
    fn pass(&mut self, to: Instant) {
        self.now = self.now.max(to);
        self.controller.handle_timeout(self.now);
        while let Some((_, change)) = self.inputs.pop_front_if(|(at, _)| *at <= self.now) {
            self.controller.set_input(self.now, change.board, change.point, change.on);
        }
        self.listen();
    }

    /// Sends the frames that the list has room for, each after the answer to the previous one.
    fn feed(&mut self) -> Result<(), PlayError> {
        while self.answered <= self.now && self.alarm.is_none() {
            let left = self.controller.machine().list().len();
            let fits = |frame: &mut Frame| {
                let kept = if frame.replaces { 0 } else { left };
                kept + frame.instructions <= LIST_ROOM
            };
            let Some(frame) = self.frames.pop_front_if(fits) else { return Ok(()) };
            self.send(&frame.bytes)?;
            self.listen();
        }
        Ok(())
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), PlayError> {
        self.frame_number += 1;
        self.controller.handle_input(self.now, self.id, frame);
        let mut accepted = false;
        loop {
            let at = self.controller.next_transmit(self.id).unwrap_or(self.now).max(self.now);
            let Some(reply) = self.controller.poll_transmit(at, self.id) else { break };
            accepted = reply_is_ok(reply);
            self.answered = at;
        }
        if accepted {
            return Ok(());
        }
        let why = self.warning().unwrap_or_else(|| "it was not answered".to_owned());
        Err(PlayError::FrameRefused { frame: self.frame_number, why })
    }

    /// The first warning in the controller's log.
    fn warning(&mut self) -> Option<String> {
        std::iter::from_fn(|| self.controller.poll_log())
            .find(|entry| entry.level() == Level::Warning)
            .map(|entry| entry.event.to_string())
    }

    /// Reads the controller's log and drops it.
    fn forget_log(&mut self) {
        while self.controller.poll_log().is_some() {}
    }

    /// Reads the controller's log: the first alarm, and the end of a taught program.
    fn listen(&mut self) {
        let done = self.controller.machine().list().completed().saturating_sub(self.done_before);
        while let Some(line) = self.controller.poll_log() {
            match line.event {
                Event::AlarmRaised { alarm, why } if line.connection.is_none() && self.alarm.is_none() => {
                    self.done = usize::try_from(done).unwrap_or(usize::MAX);
                    let plan = match &why {
                        AlarmCause::Step { why: Reason::Plan(error), .. } => Some(*error),
                        _ => None,
                    };
                    // The number in the text of the step counts from the present front of the list.
                    let why = match why {
                        AlarmCause::Step { why, .. } => why.to_string(),
                        other => other.to_string(),
                    };
                    let at = line.at.since(self.begin).as_secs_f64();
                    self.alarm = Some(Alarm { code: alarm, why, at, plan });
                    self.alarm_step = self.step_that_raised(alarm);
                }
                Event::ModeChanged { why, .. } if why != ModeReason::Started => self.over = Some(why),
                _ => {}
            }
        }
    }

    /// The instruction of the motion with this number, counted from 0.
    fn instruction(&self, index: usize) -> Step {
        let instruction = match &self.script {
            Script::Motion(instructions) => instructions.get(index),
            Script::Program(_) => None,
        };
        Step {
            number: index + 1,
            program: None,
            text: instruction.map(|step| words::action(&step.action)).unwrap_or_default(),
            action: instruction.map(|step| step.action.number()),
        }
    }

    /// The step of the taught program whose turn it is.
    fn present_step(&self) -> Option<Step> {
        let ProgramStep { program, number, text, .. } = self.controller.machine().present_step()?;
        Some(Step { number, program: Some(program), text, action: None })
    }

    /// The step of the taught program that has just raised an alarm. A step `alarm` is over when its alarm
    /// comes: the step after it is then the present one.
    fn step_that_raised(&self, code: AlarmCode) -> Option<Step> {
        let Script::Program(main) = &self.script else { return None };
        let present = self.present_step();
        let (name, before) = match &present {
            Some(step) => (step.program.as_deref().unwrap_or_default(), step.number.checked_sub(2)),
            None => (main.name(), main.steps().len().checked_sub(1)),
        };
        let program = if name == main.name() { main } else { return present };
        let raises = before.and_then(|before| Some((before, program.steps().get(before)?)));
        match raises {
            Some((index, step @ taught::Step::Alarm { number })) if *number == code => Some(Step {
                number: index + 1,
                program: Some(name.to_owned()),
                text: step.to_string(),
                action: None,
            }),
            _ => present,
        }
    }

    /// How far the motion or the program is; `turns` are recorded.
    fn reached(&self, turns: usize) -> Reached {
        match &self.script {
            Script::Motion(_) => {
                let done = self.controller.machine().list().completed().saturating_sub(self.done_before);
                let done = usize::try_from(done).unwrap_or(usize::MAX);
                Reached::Done((turns..done).map(|index| self.instruction(index)).collect())
            }
            Script::Program(_) => match (&self.alarm, self.over) {
                (None, Some(ModeReason::ProgramEnded)) => Reached::Between,
                (None, _) => self.present_step().map_or(Reached::Same, Reached::At),
                (Some(_), _) => self.alarm_step.clone().map_or(Reached::Same, Reached::At),
            },
        }
    }

    /// How it ended; `None` while it runs.
    fn ending(&self) -> Option<Ending> {
        let machine = self.controller.machine();
        if machine.is_moving() {
            return None;
        }
        if let Some(alarm) = &self.alarm {
            return Some(Ending::Alarm(alarm.clone()));
        }
        match &self.script {
            Script::Motion(_) => {
                (machine.list().is_empty() && self.frames.is_empty()).then_some(Ending::Done)
            }
            Script::Program(_) => match self.over? {
                ModeReason::ProgramEnded => Some(Ending::Done),
                _ => Some(Ending::Waiting),
            },
        }
    }
}

/// Whether a reply to AddRCC says ok.
fn reply_is_ok(reply: &[u8]) -> bool {
    let reply: Option<serde_json::Value> = serde_json::from_slice(reply).ok();
    reply.and_then(|reply| Some(reply.get("cmdReply")?.get(1)? == "ok")).unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_ok_is_ok() {
        assert!(reply_is_ok(br#"{"cmdReply":["AddRCC","ok"]}"#));
        assert!(!reply_is_ok(br#"{"cmdReply":["AddRCC","err"]}"#));
        assert!(!reply_is_ok(b"ok"));
    }
}
