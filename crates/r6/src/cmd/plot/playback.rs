//! Plays a program on a virtual controller with a virtual clock: the client, the arm and the inputs of the
//! cell.

use r6_controller::Event;
use r6_controller::event::AlarmCause;
use std::collections::VecDeque;
use std::time::Duration;

use r6_controller::instruction_list::MAX_INSTRUCTIONS as LIST_ROOM;
use r6_controller::{ConnectionId, Controller, ControllerSettings, Level};
use r6_proto::AXES;
use r6_proto::message::Instruction;
use r6_proto::message::instruction::{Action, BlendLevel, Coordinates, Manner, Move};
use r6_proto::time::Instant;

use super::inputs::InputChange;
use crate::cmd::job;
use crate::exit::Failure;
use crate::recording::{Alarm, Ending, Recorder, Recording};
use crate::robot;
use r6_client::{Motion, RunOptions};
use r6_program::{MotionList, first_axes};

/// The most instructions that are played: far more than the longest known program, and few enough to draw.
pub const MAX_INSTRUCTIONS: usize = 10_000;

/// How long a program is followed, in its own time. A longer program is taken for a mistake.
pub const LONGEST: Duration = Duration::from_secs(7 * 24 * 3600);

/// The conditions in which the program is played.
pub struct Cell {
    /// The controller and its arm.
    pub settings: ControllerSettings,
    /// Start positions of the axes, degrees or mm. Axes without a value start at 0.
    pub from: Vec<f64>,
    /// Changes of the inputs.
    pub inputs: Vec<InputChange>,
}

/// Plays the lists and returns what happened. Calls `progress` now and then with the program's time, seconds.
///
/// # Errors
/// The arm cannot reach the start, or the controller refuses a frame.
pub fn play(cell: Cell, lists: Vec<MotionList>, progress: &mut dyn FnMut(f64)) -> Result<Recording, Failure> {
    let count = lists.iter().map(|list| list.instructions.len()).sum::<usize>();
    if count > MAX_INSTRUCTIONS {
        return Err(Failure::usage(format!(
            "{count} instructions are too many for one picture: at most {MAX_INSTRUCTIONS}"
        )));
    }
    let model = cell.settings.model.clone();
    let mut controller = Controller::new(cell.settings, Instant::ORIGIN);
    let id = controller.connect(Instant::ORIGIN);
    let mut player = Player {
        controller,
        id,
        now: Instant::ORIGIN,
        frames: VecDeque::new(),
        frame_number: 0,
        answered: Instant::ORIGIN,
        inputs: VecDeque::new(),
        alarm: None,
        done_before: 0,
    };
    player.go_to(&cell.from)?;
    player.frames = Frame::all(lists)?;
    player.done_before = player.controller.machine().list().completed();
    let begin = player.now;
    let mut inputs = cell.inputs;
    inputs.sort_by_key(|change| change.at);
    player.inputs = inputs.into_iter().map(|change| (begin + change.at, change)).collect();
    let mut recorder = Recorder::new(&model, begin, player.controller.machine());
    let ending = player.follow(&mut recorder, progress)?;
    Ok(recorder.finish(count, ending))
}

/// A frame, and its effect on the list.
struct Frame {
    bytes: Vec<u8>,
    replaces: bool,
    instructions: usize,
}

impl Frame {
    /// All frames, for a controller that accepts every length: the frames of the file, or shorter ones.
    fn all(lists: Vec<MotionList>) -> Result<VecDeque<Self>, Failure> {
        let append = lists.first().is_some_and(|list| !list.replace);
        Self::of(&job::in_frames(lists), append)
    }

    fn of(motion: &Motion, append: bool) -> Result<VecDeque<Self>, Failure> {
        let (settings, most) = (robot::settings(), usize::MAX);
        let options = RunOptions { append, frame_instructions: most, room: most, ..RunOptions::default() };
        let lists = motion.lists(&settings, options).map_err(Failure::usage)?;
        let frames = motion.frames(&settings, options).map_err(Failure::usage)?;
        let frame = |(list, bytes): (std::ops::Range<usize>, Vec<u8>)| Self {
            bytes,
            replaces: list.start == 0 && !append,
            instructions: list.len(),
        };
        Ok(lists.into_iter().zip(frames).map(frame).collect())
    }
}

/// A client, its controller, and the inputs of the cell.
struct Player {
    controller: Controller,
    id: ConnectionId,
    now: Instant,
    /// Frames that the client still has to send.
    frames: VecDeque<Frame>,
    frame_number: u64,
    /// When the controller answers the last frame. The client sends the next one after that.
    answered: Instant,
    inputs: VecDeque<(Instant, InputChange)>,
    alarm: Option<Alarm>,
    /// Instructions that were done before the program began.
    done_before: u64,
}

impl Player {
    /// Moves the axes to the start of the program.
    fn go_to(&mut self, from: &[f64]) -> Result<(), Failure> {
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
            Some(alarm) => {
                Err(Failure::usage(format!("--from cannot be reached: alarm {}: {}", alarm.code, alarm.why)))
            }
        }
    }

    /// Goes from event to event, and samples in between while the arm moves.
    fn follow(&mut self, recorder: &mut Recorder, progress: &mut dyn FnMut(f64)) -> Result<Ending, Failure> {
        let end = self.now + LONGEST;
        loop {
            self.feed()?;
            recorder.look(self.now, self.controller.machine());
            if let Some(ending) = self.ending() {
                return Ok(ending);
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
    fn feed(&mut self) -> Result<(), Failure> {
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

    fn send(&mut self, frame: &[u8]) -> Result<(), Failure> {
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
        Err(Failure::refused(format!("the controller does not take frame {}: {why}", self.frame_number)))
    }

    /// The first warning in the controller's log.
    fn warning(&mut self) -> Option<String> {
        std::iter::from_fn(|| self.controller.poll_log())
            .find(|entry| entry.level() == Level::Warning)
            .map(|entry| entry.event.to_string())
    }

    /// Reads the controller's log. Of all events the picture shows only an alarm.
    fn listen(&mut self) {
        let done = self.controller.machine().list().completed().saturating_sub(self.done_before);
        while let Some(line) = self.controller.poll_log() {
            if line.connection.is_none()
                && self.alarm.is_none()
                && let Event::AlarmRaised { alarm, why } = line.event
            {
                let instruction = usize::try_from(done).unwrap_or(usize::MAX).saturating_add(1);
                // The number of the instruction in this text would count from the present front of the list.
                let why = match why {
                    AlarmCause::Step { why, .. } => why.to_string(),
                    other => other.to_string(),
                };
                self.alarm = Some(Alarm { code: i64::from(alarm), why, at: line.at, instruction });
            }
        }
    }

    /// How the program ended; `None` while it runs.
    fn ending(&self) -> Option<Ending> {
        let machine = self.controller.machine();
        if machine.is_moving() {
            return None;
        }
        match &self.alarm {
            Some(alarm) => Some(Ending::Alarm(alarm.clone())),
            None => (machine.list().is_empty() && self.frames.is_empty()).then_some(Ending::Done),
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
