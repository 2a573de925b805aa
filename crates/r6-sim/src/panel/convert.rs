//! Converts between the types of HTTP and those of the controller. No other module does.

use std::cell::RefCell;

use axum::http::StatusCode;
use r6_api::panel::{self, Action, Axis, CameraPoints, Snapshot};
use r6_api::{Code, Pose, Status, Unit};
use r6_controller::{AxisMotion, Button, ControllerSnapshot, Key, PanelAction, Refused};
use r6_http::Refusal;
use r6_proto::AxisIndex;
use r6_proto::alarm::AlarmCode;
use r6_proto::io_point::{IoPoint, PointKind};

use crate::handle::ControllerHandle;

/// Converts an action; the error says which name is wrong.
pub(super) fn action(action: Action) -> Result<PanelAction, String> {
    Ok(match action {
        Action::SetInput { point, on } => input(&point, on)?,
        Action::Press { button } => PanelAction::Press(match button {
            panel::Button::Start => Button::Start,
            panel::Button::Stop => Button::Stop,
            panel::Button::Pause => Button::Pause,
            panel::Button::SingleCycle => Button::SingleCycle,
            panel::Button::SingleStep => Button::SingleStep,
        }),
        Action::TurnKey { key } => PanelAction::TurnKey(match key {
            panel::Key::Manual => Key::Manual,
            panel::Key::Auto => Key::Auto,
            panel::Key::Stop => Key::Stop,
        }),
        Action::EmergencyStop {} => PanelAction::EmergencyStop,
        Action::ReleaseEmergencyStop {} => PanelAction::ReleaseEmergencyStop,
        Action::ClearAlarm {} => PanelAction::ClearAlarm,
        Action::RaiseAlarm { alarm } => PanelAction::RaiseAlarm(AlarmCode(alarm)),
        Action::Home {} => PanelAction::Home,
        Action::Jog { axis, by, speed_percent } => {
            PanelAction::Jog { axis: axis_named(&axis)?, by, percent: speed_percent }
        }
        Action::ClearPoints {} => PanelAction::ClearPoints,
        Action::SwitchProgram { program } => PanelAction::SwitchProgram(program),
    })
}

fn input(name: &str, on: bool) -> Result<PanelAction, String> {
    let IoPoint { kind, board, point } = name.parse::<IoPoint>().map_err(|error| error.to_string())?;
    match kind {
        PointKind::X => Ok(PanelAction::SetInput { board, point, on }),
        PointKind::Eux => Ok(PanelAction::SetEuInput { point, on }),
        PointKind::Y | PointKind::M | PointKind::Euy => Err(format!(
            "`{name}` is no input: inputs are X and EUX (a program or `modifyOutput` sets the others)"
        )),
    }
}

fn axis_named(name: &str) -> Result<AxisIndex, String> {
    AxisIndex::ALL
        .into_iter()
        .find(|axis| axis.to_string().eq_ignore_ascii_case(name))
        .ok_or_else(|| format!("`{name}` is no axis: there are J1 to J8"))
}

/// The answer for an action that the machine refuses.
pub(super) fn refused(refused: Refused) -> Refusal {
    let (status, code) = status_and_code(&refused);
    Refusal::new(status, code, refused.to_string())
}

/// The code for an action that the machine refuses.
#[must_use]
pub fn code(refused: &Refused) -> Code {
    status_and_code(refused).1
}

/// 409 if the machine could do it, but not now; 422 if it never could.
fn status_and_code(refused: &Refused) -> (StatusCode, Code) {
    match refused {
        Refused::PowerOff => (StatusCode::CONFLICT, Code::PowerOff),
        Refused::EmergencyStop => (StatusCode::CONFLICT, Code::EmergencyStop),
        Refused::Alarm { .. } => (StatusCode::CONFLICT, Code::Alarm),
        Refused::NotHomed => (StatusCode::CONFLICT, Code::NotHomed),
        Refused::NotAuto { .. } => (StatusCode::CONFLICT, Code::NotAuto),
        Refused::NotManual { .. } => (StatusCode::CONFLICT, Code::NotManual),
        Refused::Moving => (StatusCode::CONFLICT, Code::Moving),
        Refused::NoGlobalSpeed => (StatusCode::CONFLICT, Code::NoGlobalSpeed),
        Refused::Program { .. } => (StatusCode::CONFLICT, Code::Program),
        Refused::ProgramRuns { .. } => (StatusCode::CONFLICT, Code::ProgramRunning),
        Refused::NoRoom { .. } => (StatusCode::CONFLICT, Code::NoRoom),
        Refused::NoPath { .. } => (StatusCode::CONFLICT, Code::NoPath),
        Refused::BadProgram { .. } => (StatusCode::UNPROCESSABLE_ENTITY, Code::BadProgram),
        Refused::NoSuchInput { .. } => (StatusCode::UNPROCESSABLE_ENTITY, Code::NoSuchInput),
        Refused::NoSuchAxis { .. } => (StatusCode::UNPROCESSABLE_ENTITY, Code::NoSuchAxis),
        Refused::NoDistance => (StatusCode::UNPROCESSABLE_ENTITY, Code::NoDistance),
        Refused::BadSpeed => (StatusCode::UNPROCESSABLE_ENTITY, Code::BadSpeed),
        Refused::NoSuchAlarm { .. } => (StatusCode::UNPROCESSABLE_ENTITY, Code::NoSuchAlarm),
    }
}

/// A controller as an entry of the list.
pub(super) fn controller(number: usize, controller: &ControllerHandle) -> panel::Controller {
    let machine_name = controller.snapshot().machine_name;
    panel::Controller { number, address: controller.address().to_string(), machine_name }
}

/// The state as read over the controller's port.
pub(super) fn status(controller: &ControllerHandle) -> Status {
    let robot = controller.address().to_string();
    controller.look(|controller, now| {
        let controller = RefCell::new(controller);
        Status::read(&robot, None, false, |address| controller.borrow_mut().reading(now, address))
    })
}

/// The state of the machine that an operator can see.
pub(super) fn snapshot(number: usize, controller: &ControllerHandle) -> Snapshot {
    let state = controller.snapshot();
    Snapshot {
        number,
        address: controller.address().to_string(),
        r#virtual: true,
        axes: axes(&state),
        pose: Pose::of(&state.world.map(Some)),
        mode: state.mode.number(),
        mode_name: state.mode.to_string(),
        alarm: state.alarm.0,
        alarm_text: state.alarm.is_raised().then(|| state.alarm.decode().text),
        inputs_on: state.io.inputs_on(),
        outputs_on: state.io.outputs_on(),
        m_on: state.io.m_on(),
        ready: state.is_ready(),
        not_ready: state.not_ready(),
        step: state.step.map(|step| panel::Step {
            program: step.program,
            number: step.number,
            steps: step.steps,
            text: step.text,
        }),
        camera_points: state
            .points
            .iter()
            .map(|(camera, points)| CameraPoints { camera: *camera, points: *points })
            .collect(),
        machine_name: state.machine_name,
        firmware: state.version,
        profile: state.profile,
        model: state.model,
        emergency_stop: state.emergency_stop,
        homed: state.homed,
        moving: state.moving,
        program: state.program,
        programs: state.programs,
        list_length: state.list_length,
        global_speed_percent: state.global_speed_percent,
        cycle_seconds: state.cycle_seconds,
        last_cycle_seconds: state.last_cycle_seconds,
        connections: state.connections,
    }
}

fn axes(state: &ControllerSnapshot) -> Vec<Axis> {
    let figures = state.axis_limits.iter().zip(&state.axis_motions);
    let axes = AxisIndex::ALL.into_iter().zip(state.axes).zip(figures);
    axes.map(|((axis, position), ((lowest, highest), motion))| Axis {
        name: axis.to_string(),
        position,
        unit: match motion {
            AxisMotion::Turns => Unit::Degrees,
            AxisMotion::Slides => Unit::Millimetres,
        },
        lowest: *lowest,
        highest: *highest,
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_are_called_as_on_the_pendant() {
        assert_eq!(input("x1.020", true), Ok(PanelAction::SetInput { board: 1, point: 8, on: true }));
        assert_eq!(input("EUX013", false), Ok(PanelAction::SetEuInput { point: 3, on: false }));
        assert!(input("Y010", true).unwrap_err().contains("no input"));
        assert!(input("X08", true).unwrap_err().contains("X010"));
        assert_eq!(axis_named("j8").map(AxisIndex::number), Ok(7));
        assert!(axis_named("J9").is_err() && axis_named("").is_err());
    }
}
