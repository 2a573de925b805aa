//! One robot: its state, and its motion as a function of time.

use std::collections::VecDeque;
use std::time::Duration;

use super::AXES;
use super::character::{Cabinet, Reaction};
use super::log::Carried;
use super::step::{Act, Step};
use super::track::{Leg, Track};

/// The minimum time of every step, so that repeating steps cannot stop time.
const SHORTEST_STEP: Duration = Duration::from_millis(1);

/// The maximum number of steps in a list. A test that sends without end gets a refusal.
const MAX_STEPS: usize = 1000;

/// What the arm is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Nothing.
    Idle,
    /// A step until a time, of the taught program or of the list.
    Step { until: Duration, taught: bool, moves: bool },
    /// It stands at a point while more steps wait.
    Dwell { until: Duration },
}

/// One robot.
#[derive(Clone, Debug)]
pub(super) struct Body {
    pub cabinet: Cabinet,
    pub mode: i64,
    pub alarm: i64,
    pub homed: bool,
    pub track: Track,
    pub carried: Vec<Carried>,
    /// The number of AddRCC frames with instructions that it received, including those of other clients.
    pub lists: u32,
    dwell: Duration,
    now: Duration,
    list: VecDeque<Step>,
    taught: VecDeque<Step>,
    phase: Phase,
    halted: bool,
}

impl Body {
    pub(super) fn new(cabinet: Cabinet, dwell: Duration) -> Self {
        Self {
            mode: cabinet.mode,
            alarm: cabinet.alarm,
            homed: cabinet.homed,
            track: Track::new(cabinet.axes),
            cabinet,
            carried: Vec::new(),
            lists: 0,
            dwell,
            now: Duration::ZERO,
            list: VecDeque::new(),
            taught: VecDeque::new(),
            phase: Phase::Idle,
            halted: false,
        }
    }

    pub(super) fn axes(&self) -> [f64; AXES] {
        self.track.position_at(self.now)
    }

    pub(super) fn moving(&self) -> bool {
        matches!(self.phase, Phase::Step { moves: true, .. })
    }

    pub(super) fn dwelling(&self) -> bool {
        matches!(self.phase, Phase::Dwell { .. })
    }

    /// The number of instructions in the list that wait or run.
    pub(super) fn list_length(&self) -> usize {
        self.list.len()
    }

    /// Lets time pass until `time`. New dwells last `dwell`.
    pub(super) fn pass(&mut self, time: Duration, dwell: Duration) {
        self.dwell = dwell;
        self.advance(time);
    }

    fn advance(&mut self, time: Duration) {
        loop {
            match self.phase {
                Phase::Idle => {
                    if !self.begin_next() {
                        break;
                    }
                }
                Phase::Step { until, taught, moves } if until <= time => {
                    self.now = until;
                    self.finish(taught, moves);
                }
                Phase::Dwell { until } if until <= time => {
                    self.now = until;
                    self.phase = Phase::Idle;
                }
                Phase::Step { .. } | Phase::Dwell { .. } => break,
            }
        }
        self.now = self.now.max(time);
    }

    /// Begins the next step. Returns `false` if the arm is stopped or no step is left.
    fn begin_next(&mut self) -> bool {
        let taught = !self.taught.is_empty();
        let queue = if taught { &self.taught } else { &self.list };
        let Some(step) = queue.front().filter(|_| !self.halted).cloned() else { return false };
        let (time, moves) = match step.act {
            Act::Axes(target) => (self.go(target, false), true),
            Act::Line(target) => (self.go(target, true), true),
            Act::Wait(time) => (time, false),
            Act::Workbench | Act::Nothing => (Duration::ZERO, false),
        };
        let until = self.now + time.max(SHORTEST_STEP);
        self.phase = Phase::Step { until, taught, moves };
        self.carried.push(Carried {
            list: step.list,
            place: step.place,
            begun: self.now,
            ended: None,
            whole: false,
        });
        true
    }

    /// Begins a move. Returns how long it takes.
    fn go(&mut self, target: [Option<f64>; AXES], line: bool) -> Duration {
        let from = self.axes();
        let mut to = from;
        let mut seconds = 0.0_f64;
        let reachable = to.iter_mut().zip(target).take(self.cabinet.axis_count.min(AXES)).enumerate();
        for (axis, (place, target)) in reachable {
            let Some(target) = target else { continue };
            let speed = if line && axis < 3 { self.cabinet.mm_per_s } else { self.cabinet.deg_per_s };
            seconds = seconds.max((target - *place).abs() / speed);
            *place = target;
        }
        let time = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX / 4).max(SHORTEST_STEP);
        self.track.push(Leg { begin: self.now, end: self.now + time, from, to });
        time
    }

    fn finish(&mut self, taught: bool, moved: bool) {
        self.note_end(true);
        let queue = if taught { &mut self.taught } else { &mut self.list };
        let step = queue.pop_front();
        let blended = step.as_ref().is_none_or(|step| step.blended);
        if let Some(step) = step.filter(|step| !step.once) {
            queue.push_back(step);
        }
        let more = !queue.is_empty();
        self.phase = if moved && !blended && more && !self.dwell.is_zero() {
            Phase::Dwell { until: self.now + self.dwell }
        } else {
            Phase::Idle
        };
    }

    fn note_end(&mut self, whole: bool) {
        if let Some(last) = self.carried.last_mut() {
            last.ended = Some(self.now);
            last.whole = whole;
        }
    }

    /// Ends the running step at the present position of the arm. The step stays in its list.
    fn cut(&mut self) {
        if matches!(self.phase, Phase::Step { .. }) {
            self.track.cut(self.now);
            self.note_end(false);
        }
        self.phase = Phase::Idle;
    }

    /// A stop takes effect: the arm stands from now on, and its list stays.
    pub(super) fn halt(&mut self) {
        self.cut();
        self.halted = true;
    }

    /// Sets the mode and the alarm after a stop.
    pub(super) fn show(&mut self, reaction: &Reaction) {
        self.mode = reaction.mode.unwrap_or(self.mode);
        self.alarm = reaction.alarm.unwrap_or(self.alarm);
    }

    /// Drops the waiting steps. The running step continues to its end.
    pub(super) fn clear(&mut self) {
        let runs = matches!(self.phase, Phase::Step { taught: false, .. });
        self.list.truncate(usize::from(runs));
        if let Some(step) = self.list.front_mut() {
            step.once = true;
        }
    }

    /// Takes steps into its list and runs them. With `replace`, the running step is cut short.
    pub(super) fn take(&mut self, replace: bool, steps: Vec<Step>) -> bool {
        if self.list.len() + steps.len() > MAX_STEPS {
            return false;
        }
        if replace {
            if matches!(self.phase, Phase::Step { taught: false, .. } | Phase::Dwell { .. }) {
                self.cut();
            }
            self.list.clear();
        }
        self.list.extend(steps);
        self.halted = false;
        self.advance(self.now);
        true
    }

    pub(super) fn run_taught(&mut self, steps: Vec<Step>) {
        self.taught.extend(steps);
        self.advance(self.now);
    }

    /// `startButton`. Returns `false` if it cannot run.
    pub(super) fn start(&mut self) -> bool {
        if self.alarm != 0 || !self.homed {
            return false;
        }
        self.mode = 7;
        self.halted = false;
        self.advance(self.now);
        true
    }

    /// A power cut: only the position of the arm stays.
    pub(super) fn reboot(&mut self, mode: i64, alarm: i64, homed: bool) {
        self.cut();
        self.list.clear();
        self.taught.clear();
        (self.mode, self.alarm, self.homed, self.halted) = (mode, alarm, homed, false);
    }
}
