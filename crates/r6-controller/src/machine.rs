//! The machine behind the connections: everything that a controller knows, as a function of time.
//!
//! There are no ticks. [`Machine::advance`] brings the machine to a point in time by going from event to
//! event (a move ends, a wait runs out, the watchdog fires). Between events every position is a closed
//! formula.

mod buttons;
mod command;
mod deadlines;
mod execution;
mod halt;
mod hand;
mod loading;
mod lone_curve;
mod look_ahead;
mod order;
mod panel;
mod persistent;
mod program;
mod remote_list;
mod signal_stop;
mod watchdog;

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use r6_proto::AXES;
use r6_proto::address::RegisterIndex;
use r6_proto::alarm::AlarmCode;
use r6_proto::message::Point;
use r6_proto::time::Instant;

pub use execution::{Activity, Run};
pub use halt::AfterHalt;
pub use program::{MAX_CALLS, ProgramRun};
pub use remote_list::NotTaken;
pub use watchdog::Watchdog;

pub(crate) use persistent::{Persistent, Placed};

use crate::event::{AlarmCause, Event};
use crate::instruction_list::InstructionList;
use crate::io::{Io, OutputPoint};
use crate::profile::Profile;
use crate::program::Library;
use crate::saved::SavedState;
use crate::settings::ControllerSettings;
use r6_motion::{Axes, Frame, Frames, MotionState, Pose, Ramps, RobotModel};
pub use r6_program::taught::{CounterState, MAX_FRAMES, MAX_STACKS, Stack};
use r6_proto::OperationMode;
use r6_traffic::random::Random;

/// How many points of all cameras are kept; older ones are dropped first. A program consumes them; a camera
/// sends a few dozen.
pub const MAX_POINTS: usize = 1000;

/// How many events of the machine wait to be read; older ones are dropped first.
const MAX_EVENTS: usize = 256;

/// How many timed outputs may be on at once: as many as one output board has points.
const MAX_PULSES: usize = 32;

/// An event of the machine, for the log.
#[derive(Clone, Debug, PartialEq)]
pub struct MachineEvent {
    /// When.
    pub at: Instant,
    /// What.
    pub event: Event,
}

/// The registers that program and PC share.
#[derive(Clone, Debug, Default)]
pub(crate) struct Registers {
    pub values: BTreeMap<RegisterIndex, i64>,
    /// The values that survive a power cut: those last written with `savable`.
    pub saved: Persistent<BTreeMap<RegisterIndex, i64>>,
}

/// The tools and workbenches that are defined, and the numbers of those in use.
#[derive(Clone, Debug, Default)]
pub(crate) struct ToolsAndBenches {
    pub tools: Persistent<BTreeMap<u32, Placed>>,
    pub benches: Persistent<BTreeMap<u32, Placed>>,
    pub tool: u32,
    pub bench: u32,
}

/// The taught programs.
#[derive(Clone, Debug)]
pub(crate) struct Programs {
    pub library: Library,
    /// The texts of the programs that an operator loaded at the machine.
    pub loaded: Persistent<BTreeMap<String, String>>,
    /// The name of the program in use.
    pub mold: String,
}

/// The cycles of the program.
#[derive(Clone, Debug)]
pub(crate) struct Cycles {
    /// The program ends after this pass.
    pub last_pass: bool,
    pub started: Option<Instant>,
    /// How long the last cycle took.
    pub last: Duration,
    /// How many cycles have ended.
    pub count: u64,
    /// When the list last began a pass. It keeps endless passes from taking no time.
    pub pass_started: Instant,
}

/// Photo requests to cameras, and points from them.
#[derive(Clone, Debug, Default)]
pub(crate) struct CameraQueues {
    /// The cameras that a program asks for a photo.
    pub photos: VecDeque<i64>,
    /// Their points: camera, point.
    pub points: VecDeque<(i64, Point)>,
    /// Whether points were dropped for lack of room, and there is still no room.
    loses_points: bool,
}

/// The faults of a scenario in the machine.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MachineFaults {
    /// The list starts no instruction.
    pub list_frozen: bool,
    /// How long the arm rests at each point of the remote list while more instructions wait.
    pub dwell: Option<Duration>,
}

/// A virtual machine: arm, IO, registers, list, mode, alarm.
#[derive(Clone, Debug)]
pub struct Machine {
    pub(crate) profile: Profile,
    pub(crate) model: RobotModel,
    pub(crate) now: Instant,
    pub(crate) mode: OperationMode,
    pub(crate) alarm: AlarmCode,
    pub(crate) homed: bool,
    /// Where the arm rests while nothing moves it.
    pub(crate) axes: Axes,
    pub(crate) io: Io,
    pub(crate) registers: Registers,
    pub(crate) counters: Persistent<BTreeMap<u32, CounterState>>,
    pub(crate) frames: ToolsAndBenches,
    pub(crate) stacks: Persistent<BTreeMap<u32, Stack>>,
    /// The global speed as a fraction; 1 is 100 %.
    pub(crate) global_speed: f64,
    pub(crate) ramps: Ramps,
    pub(crate) programs: Programs,
    pub(crate) machine_name: String,
    pub(crate) account: String,
    pub(crate) io_boards: u8,
    pub(crate) list: InstructionList,
    pub(crate) faults: MachineFaults,
    pub(crate) activity: Activity,
    /// A move by hand, while no program runs.
    hand: Option<hand::HandMove>,
    pub(crate) emergency_stop: bool,
    /// Since an emergency stop no start button was pressed: nothing starts without it.
    pub(crate) start_needed: bool,
    /// Action 51: path speed in mm/s for linear moves without a speed of their own.
    pub(crate) path_speed: Option<f64>,
    /// Action 52: the input that stops the motion, if one is watched.
    signal_watch: signal_stop::SignalWatch,
    /// What the current run of the remote list has contained so far.
    list_run: lone_curve::ListRun,
    /// Outputs to set back: when, which, to what level.
    pub(crate) pulses: Vec<(Instant, OutputPoint, bool)>,
    /// Where the program stands.
    pub(crate) program: ProgramRun,
    pub(crate) cycle: Cycles,
    pub(crate) cameras: CameraQueues,
    pub(crate) watchdog: Watchdog,
    /// How often it was switched on again after a power cut. The change counters of the saved values then
    /// start from 0.
    pub(crate) starts: u64,
    /// The source of all random values, from the seed.
    pub(crate) random: Random,
    events: VecDeque<MachineEvent>,
}

impl Machine {
    /// A machine that was just switched on.
    #[must_use]
    pub fn new(settings: ControllerSettings, now: Instant) -> Self {
        Self::before_start(settings, now).switched_on()
    }

    /// A machine that was just switched on, with the state that a power cut left. The saved state takes
    /// precedence over the settings.
    #[must_use]
    pub fn restored(settings: ControllerSettings, saved: &SavedState, now: Instant) -> Self {
        let mut machine = Self::before_start(settings, now);
        machine.restore(saved);
        machine.switched_on()
    }

    /// Puts the program in use before its first step, and runs it if the mode says so.
    fn switched_on(mut self) -> Self {
        let program = self.programs.library.named(&self.programs.mold).cloned().unwrap_or_default();
        self.use_program(program);
        self.run_list();
        self
    }

    fn before_start(settings: ControllerSettings, now: Instant) -> Self {
        let counters = settings
            .counters
            .into_iter()
            .map(|(id, (target, current))| (id, CounterState { target, current }))
            .collect();
        let ramps = Ramps::new(settings.model.acceleration_time, settings.model.acceleration_time);
        let watchdog = Watchdog::new(settings.profile.heartbeat_timeout);
        Self {
            profile: settings.profile,
            model: settings.model,
            now,
            // A machine that is not homed cannot be running.
            mode: match settings.start.mode() {
                OperationMode::Running if !settings.homed => OperationMode::Auto,
                mode => mode,
            },
            alarm: AlarmCode::NONE,
            homed: settings.homed,
            axes: Axes::ZERO,
            io: Io::default(),
            counters: Persistent::new(counters),
            stacks: Persistent::default(),
            global_speed: (settings.global_speed / 100.0).clamp(0.0, 1.0),
            ramps: ramps.unwrap_or_default(),
            machine_name: settings.machine_name,
            account: settings.account,
            io_boards: settings.io_boards,
            list: InstructionList::default(),
            activity: Activity::Idle,
            hand: None,
            emergency_stop: false,
            start_needed: false,
            path_speed: None,
            signal_watch: signal_stop::SignalWatch::default(),
            list_run: lone_curve::ListRun::default(),
            pulses: Vec::new(),
            program: ProgramRun::default(),
            registers: Registers::default(),
            frames: ToolsAndBenches::default(),
            programs: Programs {
                library: settings.library,
                loaded: Persistent::default(),
                mold: settings.mold,
            },
            faults: MachineFaults::default(),
            cycle: Cycles {
                last_pass: false,
                started: None,
                last: Duration::ZERO,
                count: 0,
                pass_started: now,
            },
            cameras: CameraQueues::default(),
            watchdog,
            starts: 0,
            random: Random::new(settings.seed),
            events: VecDeque::new(),
        }
    }

    /// Brings the machine to a point in time. Going back in time does nothing.
    pub fn advance(&mut self, now: Instant) {
        while let Some(due) = self.next_event().filter(|due| *due <= now) {
            self.now = self.now.max(due);
            self.handle_event();
        }
        self.now = self.now.max(now);
    }

    /// The point in time that the machine has reached.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.now
    }

    fn handle_event(&mut self) {
        if self.watchdog.bites(self.now) {
            let alarm = self.profile.heartbeat_alarm;
            let seconds = self.profile.heartbeat_timeout.as_secs_f64();
            self.raise(alarm, AlarmCause::NoHeartbreak { seconds });
        }
        let now = self.now;
        let mut due = Vec::new();
        self.pulses.retain(|(at, point, on)| {
            let over = *at <= now;
            if over {
                due.push((*point, *on));
            }
            !over
        });
        for (point, on) in due {
            self.io.set(point, on);
            self.io_changed();
        }
        self.finish_hand();
        if self.activity.next_event().is_some_and(|end| end <= now) {
            self.finish_activity();
        }
    }

    /// Sets a timed output back at `due`. If too many wait, the earliest is set back at once.
    pub(crate) fn pulse(&mut self, due: Instant, point: OutputPoint, back_to: bool) {
        self.pulses.retain(|(_, other, _)| *other != point);
        if self.pulses.len() >= MAX_PULSES {
            let earliest = self.pulses.iter().enumerate().min_by_key(|(_, (due, _, _))| *due);
            if let Some((at, _)) = earliest {
                let (_, point, on) = self.pulses.remove(at);
                self.io.set(point, on);
            }
        }
        self.pulses.push((due, point, back_to));
    }

    pub(crate) fn note(&mut self, event: Event) {
        if self.events.len() >= MAX_EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(MachineEvent { at: self.now, event });
    }

    /// The next event of the machine, oldest first.
    pub fn poll_event(&mut self) -> Option<MachineEvent> {
        self.events.pop_front()
    }

    /// The tool and work frame in use.
    #[must_use]
    pub fn frames(&self) -> Frames {
        self.frames_of(self.frames.tool, self.frames.bench)
    }

    /// A tool and a work frame by number. An undefined tool is the flange; an undefined work frame is the
    /// world.
    pub(crate) fn frames_of(&self, tool: u32, bench: u32) -> Frames {
        let frame = |frames: &BTreeMap<u32, Placed>, number| {
            frames.get(number).map_or_else(Frame::default, |placed| placed.frame)
        };
        Frames { tool: frame(&self.frames.tools, &tool), work: frame(&self.frames.benches, &bench) }
    }

    /// The position and speed of the arm, now.
    #[must_use]
    pub fn motion(&self) -> MotionState {
        match self.run_under_way() {
            Some(run) => run.movement.state_at(run.seconds(self.now)),
            None => MotionState {
                axes: self.axes,
                axis_speeds: [0.0; AXES],
                pose: self.pose_of(&self.axes),
                done: true,
            },
        }
    }

    /// Positions and speeds of the axes, now, as in [`Self::motion`]. At rest this avoids computing the pose,
    /// which takes longer.
    pub(crate) fn axes_now(&self) -> (Axes, [f64; AXES]) {
        match self.run_under_way() {
            Some(_) => {
                let motion = self.motion();
                (motion.axes, motion.axis_speeds)
            }
            None => (self.axes, [0.0; AXES]),
        }
    }

    /// The pose of these axes as in `world-n`: of the tool in use, in the work frame in use.
    #[must_use]
    pub fn pose_of(&self, axes: &Axes) -> Pose {
        r6_motion::kinematics::world(&self.model, axes, &self.frames())
    }

    /// Whether a move is under way, its delay included.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.run_under_way().is_some()
    }

    /// The value of `isMoving`: whether a move is under way. A setting of the profile says whether that
    /// includes its delay.
    #[must_use]
    pub fn tells_moving(&self) -> bool {
        self.run_under_way().is_some_and(|run| {
            self.profile.moving_in_delay || !run.movement.stands_first(run.seconds(self.now))
        })
    }

    /// The movement under way, of a step or by hand.
    pub(crate) fn run_under_way(&self) -> Option<&Run> {
        self.activity.run().or(self.hand.as_ref().map(|hand| &hand.run))
    }

    /// The duration of the current cycle so far.
    #[must_use]
    pub fn cycle_time(&self) -> Duration {
        self.cycle.started.map_or(Duration::ZERO, |started| self.now.since(started))
    }

    /// Raises an alarm and stops the machine. The first alarm stays until it is cleared.
    pub fn raise(&mut self, alarm: AlarmCode, why: AlarmCause) {
        self.note(Event::AlarmRaised { alarm, why });
        if !self.alarm.is_raised() {
            self.alarm = alarm;
        }
        self.halt_for_alarm();
    }

    /// Takes the points of a camera. If there are too many, its own oldest points are dropped. No camera
    /// takes another's room, except for its first point.
    pub(crate) fn take_points(&mut self, cam_id: i64, points: &[Point]) {
        let mut loses = false;
        for point in points {
            if self.cameras.points.len() >= MAX_POINTS {
                let own = self.cameras.points.iter().position(|(camera, _)| *camera == cam_id);
                self.cameras.points.remove(own.unwrap_or(0));
                loses = true;
            }
            self.cameras.points.push_back((cam_id, *point));
        }
        let (points, waiting) = (points.len(), self.cameras.points.len());
        self.note(Event::PointsTaken { camera: cam_id, points, waiting });
        // Log only the first loss of a camera that keeps sending.
        if loses && !self.cameras.loses_points {
            self.note(Event::PointsLost { limit: MAX_POINTS });
        }
        self.cameras.loses_points =
            loses || (self.cameras.loses_points && self.cameras.points.len() >= MAX_POINTS);
        self.points_have_come();
    }

    /// Removes the points that no program has used yet.
    pub(crate) fn clear_points(&mut self) {
        let points = self.cameras.points.len();
        self.cameras.points.clear();
        self.cameras.loses_points = false;
        self.note(Event::PointsCleared { points });
    }

    /// The points of the cameras that no program has used yet, oldest first: camera and point.
    pub fn points(&self) -> impl ExactSizeIterator<Item = &(i64, Point)> {
        self.cameras.points.iter()
    }

    /// The defined stacks, by number.
    #[must_use]
    pub fn stacks(&self) -> &BTreeMap<u32, Stack> {
        &self.stacks
    }

    /// The operation mode (`curMode`).
    #[must_use]
    pub fn mode(&self) -> OperationMode {
        self.mode
    }

    /// The alarm (`curAlarm`), 0 for none.
    #[must_use]
    pub fn alarm(&self) -> AlarmCode {
        self.alarm
    }

    /// Whether the emergency stop is pressed.
    #[must_use]
    pub fn emergency_stop(&self) -> bool {
        self.emergency_stop
    }

    /// The arm.
    #[must_use]
    pub fn model(&self) -> &RobotModel {
        &self.model
    }

    /// The instruction list.
    #[must_use]
    pub fn list(&self) -> &InstructionList {
        &self.list
    }

    /// The points of inputs and outputs.
    #[must_use]
    pub fn io(&self) -> &Io {
        &self.io
    }
}

#[cfg(test)]
mod tests;
