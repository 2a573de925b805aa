//! Checks that a controller does its duties: a move that it accepted while ready ends at its target, and a
//! command has its effect.

use std::time::Duration;

use r6_controller::{ControllerSettings, ControllerSnapshot, OperationMode, RobotModel};
use r6_proto::alarm::AlarmCode;
use r6_proto::time::Instant;

use super::cell::Cell;
use super::operation::{AxisMove, Operation};

/// How far from its target an axis may end, in degrees or mm. Frames have three decimals.
const NEAR: f64 = 0.001;

/// The additional time that a move may take, in s: the ramps at both ends, at the longest setting of any
/// input.
const RAMPS: f64 = 4.0;

/// A move that was sent.
#[derive(Debug)]
struct Arrival {
    target: [f64; 6],
    due: Instant,
    /// Position in the transcript where its reply may begin.
    sent: usize,
}

/// The state before a command.
#[derive(Debug)]
struct Before {
    sent: usize,
    registers: Option<Vec<i64>>,
}

/// The expected effects.
pub struct Duties {
    robot: RobotModel,
    arrival: Option<Arrival>,
    before: Option<Before>,
    /// Whether arbitrary bytes were sent, which may be any instruction or the beginning of a frame.
    tainted: bool,
    /// Whether an input may stop a move (action 52).
    watched: bool,
}

impl Duties {
    /// The duties of a controller with these settings.
    pub fn new(settings: &ControllerSettings) -> Self {
        Self { robot: settings.model.clone(), arrival: None, before: None, tainted: false, watched: false }
    }

    /// Records the state before an operation.
    pub fn before(&mut self, operation: &Operation<'_>, cell: &mut Cell) {
        match operation {
            Operation::Bytes(_) => self.tainted = true,
            Operation::PowerCut => (self.tainted, self.watched) = (false, false),
            Operation::List { frame, .. } => self.watched |= frame.contains(r#""action":"52""#),
            _ => {}
        }
        self.before = None;
        if let Operation::Command(words) = operation
            && !self.tainted
        {
            let registers = if words.starts_with("\"rewriteData") { cell.registers() } else { None };
            self.before = Some(Before { sent: cell.transcript.len(), registers });
        }
        match operation {
            Operation::Pass(_) => {}
            Operation::List { moves: Some(moves), .. } => self.arrival = self.arrival_of(moves, cell),
            _ => self.arrival = None,
        }
    }

    /// The expected end of these moves; `None` if the controller is not ready for them.
    fn arrival_of(&self, moves: &[AxisMove], cell: &mut Cell) -> Option<Arrival> {
        let seen = cell.controller.snapshot(cell.now);
        if self.tainted || self.watched || !is_ready(&seen) {
            return None;
        }
        let mut seconds = 0.0;
        let mut from = seen.axes;
        for step in moves {
            let share = step.speed / 100.0 * seen.global_speed_percent / 100.0;
            let mut longest = 0.0_f64;
            for ((drive, from), target) in self.robot.drives().zip(&mut from).zip(step.target) {
                if !(drive.soft.min..=drive.soft.max).contains(&target) {
                    return None;
                }
                longest = longest.max((target - *from).abs() / (drive.max_speed * share));
                *from = target;
            }
            seconds += longest + step.delay + RAMPS;
        }
        let due = cell.now + Duration::from_secs_f64(seconds);
        Some(Arrival { target: moves.last()?.target, due, sent: cell.transcript.len() })
    }

    /// Checks the effects after an operation.
    pub fn after(&mut self, operation: &Operation<'_>, cell: &mut Cell) {
        if let (Operation::Command(words), Some(before)) = (operation, self.before.take()) {
            has_been_set(words, &before, cell);
        }
        if let Some(arrival) = self.arrival.take_if(|arrival| cell.now >= arrival.due) {
            self.has_arrived(&arrival, cell);
        }
    }

    fn has_arrived(&self, arrival: &Arrival, cell: &mut Cell) {
        let seen = cell.controller.snapshot(cell.now);
        if !said_ok("AddRCC", &cell.transcript[arrival.sent..]) || seen.alarm == AlarmCode::NO_HOST {
            return;
        }
        assert_eq!((seen.list_length, seen.moving), (0, false), "{arrival:?} is not over: {seen:?}");
        for ((at, target), _) in seen.axes.iter().zip(arrival.target).zip(self.robot.drives()) {
            assert!((at - target).abs() <= NEAR, "{arrival:?} ended at {:?}", seen.axes);
        }
    }
}

/// Whether a list would begin as soon as it arrives.
fn is_ready(seen: &ControllerSnapshot) -> bool {
    seen.mode == OperationMode::Running
        && seen.program == "remote"
        && seen.alarm == 0
        && !seen.moving
        && seen.list_length == 0
        && seen.global_speed_percent > 0.0
}

/// Checks that a command that was answered with ok has its effect.
fn has_been_set(words: &str, before: &Before, cell: &mut Cell) {
    let words: Vec<_> = words.split(',').map(|word| word.trim_matches('"')).collect();
    let numbers: Vec<i64> = words.iter().filter_map(|word| word.parse().ok()).collect();
    if !said_ok(words[0], &cell.transcript[before.sent..]) {
        return;
    }
    let (first, values) = match (words[0], &numbers[..]) {
        ("modifyGSPD", _) => {
            let seen = cell.controller.snapshot(cell.now).global_speed_percent;
            let wanted: f64 = words[1].parse().expect("tenths of a percent");
            assert!((seen * 10.0 - wanted).abs() < 1e-9, "{words:?} made the global speed {seen} %");
            return;
        }
        ("rewriteData", [register, value, _]) => (*register, vec![*value]),
        ("rewriteDataList", [first, _, _, values @ ..]) => (*first, values.to_vec()),
        _ => return,
    };
    let Some(mut wanted) = before.registers.clone() else { return };
    for (number, value) in (first - 800..).zip(values) {
        wanted[usize::try_from(number).expect("a register")] = value;
    }
    assert_eq!(cell.registers(), Some(wanted), "{words:?} left the registers so");
}

/// Whether this request was answered with ok, with its name, or without a name as in older firmware.
pub(super) fn said_ok(word: &str, frames: &[u8]) -> bool {
    let text = String::from_utf8_lossy(frames);
    text.contains(&format!(r#"["{word}","ok"]"#)) || text.contains(r#"["ok"]"#)
}
