//! Converts between the types of HTTP and those of the controller. No other module does.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::time::Duration;

use axum::http::StatusCode;
use r6_api::panel::{self, Action, Axis, CameraPoints, Snapshot};
use r6_api::{Code, Pose, Status, Unit};
use r6_controller::scenario::Window;
use r6_controller::{
    AxisMotion, Button, ControllerSnapshot, FaultInForce, Key, PanelAction, Refused, Scenario, fault,
};
use r6_http::Refusal;
use r6_proto::AxisIndex;
use r6_proto::alarm::AlarmCode;
use r6_proto::io_point::{IoPoint, PointKind};

use serde_json::{Value, json};

use crate::handle::ControllerHandle;

/// The longest power cut, in seconds: as in a scenario.
const LONGEST_CUT: f64 = 3600.0;

/// What an action asks of a controller.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Deed {
    /// Something at the machine.
    Panel(PanelAction),
    /// A fault, from now on.
    BeginFault(Window),
    /// The end of one fault.
    EndFault(usize),
    /// The end of all faults.
    EndFaults,
    /// The mains fail for this long.
    CutPower(Duration),
}

impl Deed {
    /// Does it.
    pub(super) fn to(&self, controller: &ControllerHandle) -> Result<(), Refused> {
        match self {
            Self::Panel(action) => controller.operate(action),
            Self::BeginFault(Window { fault, chance, lasts, .. }) => {
                controller.begin_fault(fault.clone(), *chance, *lasts).map(drop)
            }
            Self::EndFault(number) => {
                controller.end_fault(*number);
                Ok(())
            }
            Self::EndFaults => {
                controller.faults().iter().for_each(|fault| controller.end_fault(fault.number));
                Ok(())
            }
            Self::CutPower(off) => {
                controller.cut_power(*off);
                Ok(())
            }
        }
    }
}

/// Converts an action; the error says what is wrong.
pub(super) fn deed(action: Action) -> Result<Deed, Refusal> {
    let wrong = |code, message| Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, code, message);
    match action {
        Action::BeginFault { fault, kind, chance, seconds, numbers } => {
            let window = window(&fault, kind, chance, seconds, &numbers);
            window.map(Deed::BeginFault).map_err(|message| wrong(Code::BadFault, message))
        }
        Action::EndFault { number } => Ok(Deed::EndFault(number)),
        Action::EndFaults {} => Ok(Deed::EndFaults),
        Action::CutPower { seconds } if (0.0..=LONGEST_CUT).contains(&seconds) => {
            Ok(Deed::CutPower(Duration::from_secs_f64(seconds)))
        }
        Action::CutPower { .. } => {
            Err(wrong(Code::BadFault, format!("a power cut lasts from 0 to {LONGEST_CUT} seconds")))
        }
        action => self::action(action).map(Deed::Panel).map_err(|message| wrong(Code::BadAction, message)),
    }
}

/// The fault that an action describes, as a scenario reads it.
fn window(
    fault: &str,
    kind: Option<String>,
    chance: f64,
    seconds: Option<f64>,
    numbers: &BTreeMap<String, f64>,
) -> Result<Window, String> {
    let known = fault::file::numbers(fault);
    if let Some(name) = numbers.keys().find(|name| !known.contains(&name.as_str())) {
        let name: String = name.chars().take(20).collect();
        return Err(match known {
            [] => format!("`{name}`: this fault has no numbers"),
            known => format!("`{name}`: the numbers of this fault are {}", known.join(", ")),
        });
    }
    // A scenario wants whole numbers without a point.
    #[expect(clippy::cast_possible_truncation, reason = "a whole number that fits")]
    let value = |number: f64| match number {
        whole if whole.fract() == 0.0 && whole.abs() < 1e15 => json!(whole as i64),
        number => json!(number),
    };
    let mut entry: serde_json::Map<String, Value> =
        numbers.iter().map(|(name, number)| (name.clone(), value(*number))).collect();
    entry.insert("fault".to_owned(), json!(fault));
    entry.insert("chance".to_owned(), json!(chance));
    entry.extend(kind.map(|kind| ("kind".to_owned(), json!(kind))));
    entry.extend(seconds.map(|seconds| ("for".to_owned(), value(seconds))));
    let scenario = Scenario::read(&json!({ "fault": [entry] }).to_string()).map_err(|mistakes| {
        // Without the place in a text that the caller did not write.
        let told = mistakes.to_string();
        told.lines()
            .next()
            .and_then(|line| line.split_once("[[fault]] 1"))
            .map_or(told.clone(), |(_, what)| what.trim_start().to_owned())
    })?;
    scenario.faults.into_iter().next().ok_or_else(|| "no fault".to_owned())
}

/// The faults that a controller can be given.
pub(super) fn faults() -> panel::Faults {
    let text = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect();
    let faults = fault::file::FAULTS.iter().map(|(word, class)| panel::FaultKind {
        fault: (*word).to_owned(),
        class: (*class).to_owned(),
        kinds: text(&fault::file::kinds(word)),
        numbers: text(fault::file::numbers(word)),
    });
    panel::Faults { faults: faults.collect() }
}

/// What an operator does at the machine; the error says which name is wrong.
fn action(action: Action) -> Result<PanelAction, String> {
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
        Action::HoldJog { axis, up, speed_percent } => {
            PanelAction::HoldJog { axis: axis_named(&axis)?, up, percent: speed_percent }
        }
        Action::KeepJog {} => PanelAction::KeepJog,
        Action::EndJog {} => PanelAction::EndJog,
        Action::ClearPoints {} => PanelAction::ClearPoints,
        Action::SwitchProgram { program } => PanelAction::SwitchProgram(program),
        Action::BeginFault { .. }
        | Action::EndFault { .. }
        | Action::EndFaults {}
        | Action::CutPower { .. } => return Err("a fault is nothing that is done at the machine".to_owned()),
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
        Refused::NotHeld => (StatusCode::CONFLICT, Code::NotHeld),
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
        faults: controller
            .faults()
            .into_iter()
            .map(|FaultInForce { number, fault, chance, left }| panel::FaultInForce {
                number,
                fault: fault.word().to_owned(),
                kind: fault.kind().map(str::to_owned),
                chance,
                seconds_left: left.map(|left| left.as_secs_f64()),
            })
            .collect(),
        power_off: state.power_off,
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
    fn a_fault_is_read_as_in_a_scenario() {
        let begin = |json: &str| {
            let action: Action = serde_json::from_str(json).unwrap();
            match deed(action) {
                Ok(Deed::BeginFault(window)) => Ok((window.fault.to_string(), window.chance, window.lasts)),
                Ok(other) => panic!("{other:?}"),
                Err(refusal) => Err(format!("{refusal:?}")),
            }
        };
        let fault = |json: &str| begin(&format!(r#"{{"do":"begin_fault",{json}}}"#));
        assert_eq!(fault(r#""fault":"silence""#), Ok(("silence".to_owned(), 1.0, None)));
        let lasts = Some(Duration::from_millis(2500));
        let bad_json = r#""fault":"bad-json","kind":"nul","chance":0.5,"seconds":2.5"#;
        assert_eq!(fault(bad_json), Ok(("bad-json (nul)".to_owned(), 0.5, lasts)));
        assert!(fault(r#""fault":"slow","numbers":{"bytes_per_second":5}"#).is_ok());
        assert!(fault(r#""fault":"latency","numbers":{"to_client":0.25}"#).is_ok());
        for (json, told) in [
            (r#""fault":"silense""#, "silence"),
            (r#""fault":"bad-json""#, "kind"),
            (r#""fault":"slow","numbers":{"from":5}"#, "bytes_per_second"),
            (r#""fault":"echo","numbers":{"from":5}"#, "no numbers"),
            (r#""fault":"echo","chance":2"#, "chance"),
            (r#""fault":"echo","seconds":-1"#, "for"),
            (r#""fault":"slow","numbers":{"bytes_per_second":0.5}"#, "bytes_per_second"),
        ] {
            let error = fault(json).unwrap_err();
            assert!(error.contains(told) && !error.contains("1:"), "{json}: {error}");
        }
        for seconds in ["-1", "3601", "1e300"] {
            let action = serde_json::from_str(&format!(r#"{{"do":"cut_power","seconds":{seconds}}}"#));
            assert!(deed(action.unwrap()).is_err(), "{seconds}");
        }
        let catalogue = faults().faults;
        assert!(catalogue.iter().any(|kind| kind.fault == "stall" && kind.numbers == ["delay"]));
    }

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
