//! A small model of a controller: a few readable rules that are checked after each operation.

use std::time::Duration;

use r6_controller::{ControllerSettings, ControllerSnapshot, OperationMode, PanelAction, RobotModel};
use r6_proto::alarm::AlarmCode;
use r6_proto::time::Instant;

use super::cell::Cell;
use super::duty::said_ok;
use super::operation::Operation;

/// How far beyond a limit an axis may be because of rounding, in degrees or mm.
const ROUNDING: f64 = 1e-6;

/// The factor by which a speed may exceed its limit, because the plan is sampled.
const SPEED_ROUNDING: f64 = 1.000_1;

/// How much later than specified an arm may be at rest.
const REST_ROUNDING: Duration = Duration::from_millis(2);

/// The state before an operation.
#[derive(Clone, Copy, Debug)]
struct Before {
    mode: OperationMode,
    alarm: AlarmCode,
    list: usize,
    now: Instant,
    sent: usize,
}

/// The rules and their state.
pub struct Model {
    robot: RobotModel,
    max_connections: usize,
    stop_time: Duration,
    before: Option<Before>,
    /// Whether the beginning of a frame may have arrived, so that the meaning of the next bytes is unknown.
    tainted: bool,
    /// Since when no motion may begin, because of a stop, an emergency stop, the key or a power cut.
    stopped: Option<Instant>,
    /// Since when there is an alarm.
    alarm_since: Option<Instant>,
    /// Where the arm has been at rest since then.
    rests_at: Option<[f64; r6_proto::AXES]>,
}

impl Model {
    /// The rules for a controller with these settings.
    pub fn new(settings: &ControllerSettings) -> Self {
        Self {
            robot: settings.model.clone(),
            max_connections: settings.profile.max_connections,
            stop_time: settings.profile.action_stop_time,
            before: None,
            tainted: false,
            stopped: None,
            alarm_since: None,
            rests_at: None,
        }
    }

    /// Records the state before an operation.
    pub fn before(&mut self, operation: &Operation<'_>, cell: &mut Cell) {
        let seen = cell.controller.snapshot(cell.now);
        let (mode, alarm, list) = (seen.mode, seen.alarm, seen.list_length);
        self.before = Some(Before { mode, alarm, list, now: cell.now, sent: cell.transcript.len() });
        match operation {
            Operation::Bytes(_) => self.tainted = true,
            Operation::Reconnect | Operation::Lose | Operation::PowerCut => self.tainted = false,
            _ => {}
        }
        if self.may_start(operation) {
            self.stopped = None;
            self.rests_at = None;
        }
        if matches!(operation, Operation::PowerCut) {
            // After a power cut the arm stands at zero.
            self.rests_at = None;
        }
    }

    fn may_start(&self, operation: &Operation<'_>) -> bool {
        let is_frame =
            matches!(operation, Operation::Command(_) | Operation::Frame(_) | Operation::AskEverything);
        operation.may_start() || (self.tainted && is_frame)
    }

    /// Checks the state after an operation.
    pub fn after(&mut self, operation: &Operation<'_>, cell: &mut Cell) {
        let Some(before) = self.before else { return };
        let seen = cell.controller.snapshot(cell.now);
        let runs = |mode: OperationMode| {
            matches!(mode, OperationMode::Running | OperationMode::SingleCycle | OperationMode::SingleStep)
        };
        if !self.may_start(operation) {
            assert!(
                runs(before.mode) || !runs(seen.mode),
                "{operation:?} began a program: {before:?} {seen:?}"
            );
        }
        if before.alarm != 0 && !self.tainted && !operation.may_clear_alarm() {
            let stays = seen.alarm == before.alarm || seen.alarm == 7;
            assert!(stays, "{operation:?} changed the alarm: {before:?} {}", seen.alarm);
        }
        // Only AddRCC fills the list, with at most its own instructions.
        let most = match operation {
            Operation::List { steps, replace: false, .. } => before.list + steps,
            // A refused list leaves the old list unchanged.
            Operation::List { steps, replace: true, .. } => before.list.max(*steps),
            _ => before.list,
        };
        assert!(
            self.tainted || seen.list_length <= most,
            "{operation:?} made of {} instructions {}",
            before.list,
            seen.list_length
        );
        let stops = match operation {
            Operation::Panel(PanelAction::EmergencyStop | PanelAction::TurnKey(_)) | Operation::PowerCut => {
                true
            }
            // A stop has no effect on a connection that is not served, or inside another frame.
            _ => operation.is_stop() && said_ok("actionStop", &cell.transcript[before.sent..]),
        };
        if stops {
            assert!(!runs(seen.mode), "{operation:?} left it running: {:?}", seen.mode);
            self.stopped.get_or_insert(before.now);
        }
        if let Operation::Panel(PanelAction::TurnKey(key)) = operation {
            let wanted = match key {
                r6_controller::Key::Manual => OperationMode::Manual,
                r6_controller::Key::Stop => OperationMode::Stop,
                r6_controller::Key::Auto => OperationMode::Auto,
            };
            assert_eq!(seen.mode, wanted, "the key tells the mode");
        }
        if matches!(operation, Operation::Panel(PanelAction::EmergencyStop)) {
            assert!(seen.emergency_stop && seen.alarm == 7);
        }
    }

    /// Checks the position and the speed of the arm at any time.
    pub fn hold_within_limits(&self, cell: &mut Cell) {
        let seen = cell.controller.snapshot(cell.now);
        for (axis, (position, drive)) in seen.axes.iter().zip(self.robot.drives()).enumerate() {
            let within = drive.soft.min - ROUNDING..=drive.soft.max + ROUNDING;
            assert!(within.contains(position), "axis {axis} at {position}, beyond {:?}", drive.soft);
        }
        let motion = cell.controller.machine().motion();
        for (axis, (speed, drive)) in motion.axis_speeds.iter().zip(self.robot.drives()).enumerate() {
            let most = drive.max_speed * SPEED_ROUNDING + ROUNDING;
            assert!(speed.abs() <= most, "axis {axis} at {speed} a second, above {}", drive.max_speed);
        }
    }

    /// Checks what must hold at any time.
    pub fn hold(&mut self, cell: &mut Cell) {
        self.hold_within_limits(cell);
        let seen = cell.controller.snapshot(cell.now);
        assert!(seen.world.iter().all(|number| number.is_finite()));
        assert!(seen.list_length <= r6_controller::instruction_list::MAX_INSTRUCTIONS);
        assert!(seen.connections <= self.max_connections, "{} connections are served", seen.connections);
        let runs = matches!(
            seen.mode,
            OperationMode::Running | OperationMode::SingleCycle | OperationMode::SingleStep
        );
        assert!(seen.alarm == 0 || !runs, "it runs with alarm {}", seen.alarm);
        assert!(!seen.emergency_stop || seen.alarm == 7, "an emergency stop shows alarm {}", seen.alarm);
        assert!(seen.homed || !runs, "it runs and is not homed");
        assert!((0.0..=100.0).contains(&seen.global_speed_percent));
        // Otherwise a shell that waits for the deadline would not wait at all.
        cell.controller.handle_timeout(cell.now);
        let due = cell.controller.poll_timeout();
        assert!(due.is_none_or(|due| due > cell.now), "at {} something is due at {due:?}", cell.now);
        self.hold_at_rest(&seen, cell.now);
    }

    /// The common rule of an emergency stop, an alarm and a stop: after the stopping time the arm is at rest
    /// and stays where it is.
    fn hold_at_rest(&mut self, seen: &ControllerSnapshot, now: Instant) {
        if seen.alarm == 0 {
            self.alarm_since = None;
        } else {
            let since = *self.alarm_since.get_or_insert(now);
            let over = now >= since + self.stop_time + REST_ROUNDING;
            assert!(!over || !seen.moving, "with alarm {} it moves", seen.alarm);
        }
        if let Some(stopped) = self.stopped
            && now >= stopped + self.stop_time + REST_ROUNDING
        {
            assert!(!seen.moving, "{} after a stop it moves", now.since(stopped).as_secs_f64());
            let rests_at = *self.rests_at.get_or_insert(seen.axes);
            assert_eq!(seen.axes, rests_at, "after a stop it is elsewhere");
        }
    }
}
