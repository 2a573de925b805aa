//! What a program did: positions and speeds over time, and what follows from them.

use std::time::Duration;

use r6_controller::RobotModel;
use r6_controller::machine::Machine;
use r6_proto::time::Instant;

/// How often the arm is looked at while it moves, at first: finer than any picture shows.
const FIRST_STEP: Duration = Duration::from_millis(2);

/// How many samples are kept: where there are more, every other one goes and the step doubles. 50 000 are 100 s of
/// motion at 2 ms, and far more than a picture has columns.
pub const MAX_SAMPLES: usize = 50_000;

/// Below this share of its full speed an axis stands: a rounding error, no motion.
const STANDS: f64 = 1e-6;

/// The arm at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Seconds since the program began.
    pub at: f64,
    /// J1 to J6, degrees or mm.
    pub axes: [f64; 6],
    /// Their speeds, degrees or mm per second.
    pub speeds: [f64; 6],
    /// X, Y, Z of the tool, mm.
    pub tool: [f64; 3],
    /// Something begins or ends here: it is never thinned out.
    is_event: bool,
}

/// What one axis did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisSummary {
    /// Where it began and ended.
    pub ends: (f64, f64),
    /// The smallest and largest position.
    pub range: (f64, f64),
    /// How far it went, both ways added.
    pub way: f64,
    /// Its highest speed, per second.
    pub top_speed: f64,
}

/// When an instruction was under way, seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// When the one before was done.
    pub begin: f64,
    /// When it was done itself; `None` if it never was.
    pub end: Option<f64>,
    /// The sample of its end.
    tool: [f64; 3],
}

impl Turn {
    /// Where the tool was when it was done.
    pub fn tool(&self) -> Option<[f64; 3]> {
        self.end.map(|_| self.tool)
    }
}

/// An alarm.
#[derive(Clone, Debug, PartialEq)]
pub struct Alarm {
    /// Its number.
    pub code: i64,
    /// Why it came, in the controller's words.
    pub why: String,
    /// When it came.
    pub at: Instant,
    /// The instruction whose turn it was, counted from 1.
    pub instruction: usize,
}

/// How a program ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// It ran to its end.
    Done,
    /// An alarm ended it.
    Alarm(Alarm),
    /// It waits for something that never comes.
    Waiting,
    /// It is longer than anybody looks.
    TooLong,
}

/// What a program did.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The arm over time.
    pub samples: Vec<Sample>,
    /// What each axis did, J1 first, as many as the arm has.
    pub axes: Vec<AxisSummary>,
    /// One turn for each instruction that was begun.
    pub turns: Vec<Turn>,
    /// How many instructions the program has.
    pub instructions: usize,
    /// The way of the tool, mm.
    pub tool_path: f64,
    /// How often the arm came to rest between two motions.
    pub stops: usize,
    /// How long it took, seconds.
    pub duration: f64,
    /// When the alarm came, seconds.
    pub alarm_at: Option<f64>,
    /// How it ended.
    pub ending: Ending,
}

impl Recording {
    /// The instruction at which it ended before its end, counted from 1.
    pub fn ended_at(&self) -> Option<usize> {
        match &self.ending {
            Ending::Done => None,
            Ending::Alarm(alarm) => Some(alarm.instruction),
            Ending::Waiting | Ending::TooLong => Some(self.turns.len()),
        }
    }
}

/// Takes a recording.
pub struct Recorder {
    full_speeds: Vec<f64>,
    begin: Instant,
    step: Duration,
    samples: Vec<Sample>,
    axes: Vec<AxisSummary>,
    turns: Vec<Turn>,
    done_before: u64,
    tool_path: f64,
    rests: usize,
    moved: bool,
    moving: bool,
}

impl Recorder {
    /// A recorder that begins now.
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
            done_before: machine.list().completed(),
            tool_path: 0.0,
            rests: 0,
            moved: false,
            moving: false,
        }
    }

    /// Seconds of the program.
    pub fn seconds(&self, now: Instant) -> f64 {
        now.since(self.begin).as_secs_f64()
    }

    /// When to look next at an arm that moves.
    pub fn next_look(&self, now: Instant) -> Instant {
        now + self.step
    }

    /// Takes a sample of the machine as it is now.
    pub fn look(&mut self, now: Instant, machine: &Machine) {
        let motion = machine.motion();
        let [x, y, z, ..] = machine.pose_of(&motion.axes).components();
        let mut speeds = [0.0; 6];
        for (slot, speed) in speeds.iter_mut().zip(motion.axis_speeds) {
            *slot = speed;
        }
        let mut sample = Sample {
            at: self.seconds(now),
            axes: motion.axes.arm(),
            speeds,
            tool: [x, y, z],
            is_event: machine.is_moving() != self.moving,
        };
        self.moving = machine.is_moving();
        sample.is_event |= self.finish_turns(&sample, machine);
        self.measure(&sample);
        self.count_rests(&sample);
        self.samples.push(sample);
        if self.samples.len() > MAX_SAMPLES {
            self.thin();
        }
    }

    /// Notes the instructions that are done since the last look.
    fn finish_turns(&mut self, sample: &Sample, machine: &Machine) -> bool {
        let done = machine.list().completed().saturating_sub(self.done_before);
        let done = usize::try_from(done).unwrap_or(usize::MAX);
        let before = self.turns.len();
        while self.turns.len() < done {
            let begin = self.turns.last().and_then(|turn| turn.end).unwrap_or(0.0);
            self.turns.push(Turn { begin, end: Some(sample.at), tool: sample.tool });
        }
        self.turns.len() > before
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

    /// Takes every other sample away that marks nothing.
    fn thin(&mut self) {
        let mut keep = false;
        self.samples.retain(|sample| {
            keep = !keep;
            keep || sample.is_event
        });
        self.step *= 2;
    }

    /// The recording of a program of so many instructions.
    pub fn finish(mut self, instructions: usize, ending: Ending) -> Recording {
        let duration = self.samples.last().map_or(0.0, |sample| sample.at);
        if self.turns.len() < instructions {
            let begin = self.turns.last().and_then(|turn| turn.end).unwrap_or(0.0);
            self.turns.push(Turn { begin, end: None, tool: [0.0; 3] });
        }
        let alarm_at = match &ending {
            Ending::Alarm(alarm) => Some(alarm.at.since(self.begin).as_secs_f64()),
            Ending::Done | Ending::Waiting | Ending::TooLong => None,
        };
        Recording {
            samples: self.samples,
            axes: self.axes,
            turns: self.turns,
            instructions,
            tool_path: self.tool_path,
            // The last rest is the end.
            stops: self.rests.saturating_sub(1),
            duration,
            alarm_at,
            ending,
        }
    }
}

/// The distance of two points.
pub fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}
