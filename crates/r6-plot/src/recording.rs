//! What an arm did during a motion or a program: positions and speeds over time, and figures derived from
//! them.

use std::time::Duration;

use r6_controller::RobotModel;
use r6_controller::machine::Machine;
use r6_motion::PlanError;
use r6_proto::alarm::AlarmCode;
use r6_proto::time::Instant;

use crate::points::{PointRecorder, PointTrack};

/// The first time between two samples of a moving arm: finer than any picture shows.
const FIRST_STEP: Duration = Duration::from_millis(2);

/// The longest time between two samples of a moving arm.
const LONGEST_STEP: Duration = Duration::from_secs(3600);

/// How many samples are kept. Above this, every other sample is removed and the step doubles. 50 000 samples
/// are 100 s of motion at 2 ms, and far more than a picture has columns.
pub const MAX_SAMPLES: usize = 50_000;

/// An axis below this share of its full speed stands: such a speed is a rounding error.
const STANDS: f64 = 1e-6;

/// The arm at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Seconds since the program began.
    pub at: f64,
    /// J1 to J6, degrees or mm.
    pub axes: [f64; 6],
    /// Speeds of J1 to J6, degrees or mm per second.
    pub speeds: [f64; 6],
    /// X, Y, Z of the tool, mm.
    pub tool: [f64; 3],
    /// U, V, W of the tool, degrees.
    pub orientation: [f64; 3],
    /// Whether something begins or ends here. Such a sample is never removed.
    is_event: bool,
}

impl Sample {
    /// Whether something begins or ends here: a step, or a motion of the arm.
    #[must_use]
    pub fn is_event(&self) -> bool {
        self.is_event
    }
}

/// What one axis did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisSummary {
    /// First and last position.
    pub ends: (f64, f64),
    /// The smallest and largest position.
    pub range: (f64, f64),
    /// Total distance travelled, both directions added.
    pub way: f64,
    /// Its highest speed, per second.
    pub top_speed: f64,
}

/// An instruction of a motion, or a step of a taught program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// Its number in the motion or in its program, from 1.
    pub number: usize,
    /// The taught program it belongs to; `None` for an instruction of a motion.
    pub program: Option<String>,
    /// What it does, in English; empty if that is unknown.
    pub text: String,
    /// The number of its action; `None` for a step of a taught program.
    pub action: Option<i64>,
}

/// When a step ran, seconds.
#[derive(Clone, Debug, PartialEq)]
pub struct Turn {
    /// What ran.
    pub step: Step,
    /// When the previous step was done.
    pub begin: f64,
    /// When this step was done; `None` if it never was.
    pub end: Option<f64>,
    /// Tool position at the end.
    tool: [f64; 3],
}

impl Turn {
    /// The tool position when the step was done.
    pub fn tool(&self) -> Option<[f64; 3]> {
        self.end.map(|_| self.tool)
    }
}

/// An alarm.
#[derive(Clone, Debug, PartialEq)]
pub struct Alarm {
    /// Its number.
    pub code: AlarmCode,
    /// Its cause, in the controller's words.
    pub why: String,
    /// When it came, seconds.
    pub at: f64,
    /// Why the arm cannot move so, if that is the cause.
    pub plan: Option<PlanError>,
}

/// How a motion or a program ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// It ran to its end.
    Done,
    /// An alarm ended it.
    Alarm(Alarm),
    /// It waits for a signal that never comes.
    Waiting,
    /// It is longer than the time that is simulated.
    TooLong,
    /// The pass of a taught program does not end.
    Endless,
}

/// What was played.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Played {
    /// A motion of so many instructions.
    Motion(usize),
    /// One pass of a taught program.
    Program {
        /// Its name.
        name: String,
        /// How many steps it has.
        steps: usize,
    },
}

/// What an arm did.
#[derive(Clone, Debug)]
pub struct Recording {
    /// What was played.
    pub played: Played,
    /// The arm over time.
    pub samples: Vec<Sample>,
    /// What each axis did, J1 first, one entry per axis of the arm.
    pub axes: Vec<AxisSummary>,
    /// One turn for each step that began. Steps of a taught program that take no time have none.
    pub turns: Vec<Turn>,
    /// The points that changed: inputs, then outputs, then M points.
    pub points: Vec<PointTrack>,
    /// Length of the tool's path, mm.
    pub tool_path: f64,
    /// How often the arm came to rest between two motions.
    pub stops: usize,
    /// How long it took, seconds.
    pub duration: f64,
    /// How it ended.
    pub ending: Ending,
    /// The step at which it ended early; `None` if it ran to its end.
    pub ended_at: Option<Step>,
}

impl Recording {
    /// The alarm that ended it.
    pub fn alarm(&self) -> Option<&Alarm> {
        match &self.ending {
            Ending::Alarm(alarm) => Some(alarm),
            Ending::Done | Ending::Waiting | Ending::TooLong | Ending::Endless => None,
        }
    }
}

/// How far the motion or the program is.
#[derive(Clone, Debug)]
pub enum Reached {
    /// These instructions are done, the first of them first. Those that were done before are left out.
    Done(Vec<Step>),
    /// The program is at this step.
    At(Step),
    /// The step before is done, and no other has begun.
    Between,
    /// Nothing has changed.
    Same,
}

/// Records what an arm does.
pub struct Recorder {
    full_speeds: Vec<f64>,
    begin: Instant,
    step: Duration,
    samples: Vec<Sample>,
    axes: Vec<AxisSummary>,
    turns: Vec<Turn>,
    points: PointRecorder,
    tool_path: f64,
    rests: usize,
    moved: bool,
    moving: bool,
}

impl Recorder {
    /// A recorder that starts now.
    pub fn new(model: &RobotModel, begin: Instant, machine: &Machine) -> Self {
        let full_speeds: Vec<_> = model.drives().map(|axis| axis.max_speed).collect();
        let axes = machine.motion().axes;
        let axes = axes.degrees().iter().take(full_speeds.len()).map(|&position| AxisSummary {
            ends: (position, position),
            range: (position, position),
            way: 0.0,
            top_speed: 0.0,
        });
        Self {
            axes: axes.collect(),
            full_speeds,
            begin,
            step: FIRST_STEP,
            samples: Vec::new(),
            turns: Vec::new(),
            points: PointRecorder::new(machine.io()),
            tool_path: 0.0,
            rests: 0,
            moved: false,
            moving: false,
        }
    }

    /// Seconds since the recording began.
    pub fn seconds(&self, now: Instant) -> f64 {
        now.since(self.begin).as_secs_f64()
    }

    /// When to take the next sample of a moving arm.
    pub fn next_look(&self, now: Instant) -> Instant {
        now + self.step
    }

    /// How many turns there are.
    pub fn turns(&self) -> usize {
        self.turns.len()
    }

    /// Takes a sample of the machine as it is now.
    pub fn look(&mut self, now: Instant, machine: &Machine, reached: Reached) {
        let motion = machine.motion();
        let [x, y, z, u, v, w] = machine.pose_of(&motion.axes).components();
        let mut speeds = [0.0; 6];
        for (slot, speed) in speeds.iter_mut().zip(motion.axis_speeds) {
            *slot = speed;
        }
        let mut sample = Sample {
            at: self.seconds(now),
            axes: motion.axes.arm(),
            speeds,
            tool: [x, y, z],
            orientation: [u, v, w],
            is_event: machine.is_moving() != self.moving,
        };
        self.moving = machine.is_moving();
        sample.is_event |= self.note_turns(&sample, reached);
        self.points.look(sample.at, machine.io());
        self.measure(&sample);
        self.count_rests(&sample);
        self.samples.push(sample);
        if self.samples.len() > MAX_SAMPLES {
            self.thin();
        }
    }

    /// Notes which steps ended or began since the last sample. Returns whether any did.
    fn note_turns(&mut self, sample: &Sample, reached: Reached) -> bool {
        match reached {
            Reached::Same => false,
            Reached::Done(steps) if steps.is_empty() => false,
            Reached::Done(steps) => {
                for step in steps {
                    let begin = self.turns.last().and_then(|turn| turn.end).unwrap_or(0.0);
                    self.turns.push(Turn { step, begin, end: Some(sample.at), tool: sample.tool });
                }
                true
            }
            Reached::At(step) if self.open_step() == Some(&step) => false,
            Reached::At(step) => {
                self.end_turn(sample);
                self.turns.push(Turn { step, begin: sample.at, end: None, tool: sample.tool });
                true
            }
            Reached::Between => self.end_turn(sample),
        }
    }

    /// The step that runs now.
    fn open_step(&self) -> Option<&Step> {
        self.turns.last().filter(|turn| turn.end.is_none()).map(|turn| &turn.step)
    }

    /// Ends the turn that is open. Returns whether there was one.
    fn end_turn(&mut self, sample: &Sample) -> bool {
        match self.turns.last_mut().filter(|turn| turn.end.is_none()) {
            Some(turn) => {
                turn.end = Some(sample.at);
                turn.tool = sample.tool;
                true
            }
            None => false,
        }
    }

    fn measure(&mut self, sample: &Sample) {
        for ((axis, position), speed) in self.axes.iter_mut().zip(sample.axes).zip(sample.speeds) {
            axis.way += (position - axis.ends.1).abs();
            axis.ends.1 = position;
            axis.range = (axis.range.0.min(position), axis.range.1.max(position));
            axis.top_speed = axis.top_speed.max(speed.abs());
        }
        if let Some(before) = self.samples.last() {
            self.tool_path += distance(before.tool, sample.tool);
        }
    }

    /// Counts how often the arm comes to rest.
    fn count_rests(&mut self, sample: &Sample) {
        let moves =
            sample.speeds.iter().zip(&self.full_speeds).any(|(speed, full)| speed.abs() > STANDS * full);
        if self.moved && !moves {
            self.rests += 1;
        }
        self.moved = moves;
    }

    /// Removes every other sample, but keeps those that mark an event.
    fn thin(&mut self) {
        let mut keep = false;
        self.samples.retain(|sample| {
            keep = !keep;
            keep || sample.is_event
        });
        self.step = (self.step * 2).min(LONGEST_STEP);
    }

    /// Ends the recording. `ended_at` is the step at which it ended early, `rest` the first instruction of a
    /// motion that was not done.
    pub fn finish(
        mut self,
        played: Played,
        ending: Ending,
        ended_at: Option<Step>,
        rest: Option<Step>,
    ) -> Recording {
        let duration = self.samples.last().map_or(0.0, |sample| sample.at);
        if let Some(step) = rest {
            let begin = self.turns.last().and_then(|turn| turn.end).unwrap_or(0.0);
            self.turns.push(Turn { step, begin, end: None, tool: [0.0; 3] });
        }
        Recording {
            played,
            samples: self.samples,
            axes: self.axes,
            turns: self.turns,
            points: self.points.finish(),
            tool_path: self.tool_path,
            // The last stop is the end of the program.
            stops: self.rests.saturating_sub(1),
            duration,
            ending,
            ended_at,
        }
    }
}

/// The distance between two points.
pub fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}
