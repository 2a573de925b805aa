//! Between what goes over HTTP and what the controller knows: the one place where the two meet.

use r6_controller::io::Io;
use r6_controller::{AxisMotion, Button, ControllerSnapshot, Key, PanelAction};
use r6_proto::AxisIndex;
use r6_proto::alarm::AlarmCode;
use r6_proto::io_point::{IoPoint, PointKind};

use super::dto::{ActionDto, AxisDto, ButtonDto, ControllerDto, KeyDto, PoseDto, SnapshotDto};
use crate::handle::ControllerHandle;

impl TryFrom<ActionDto> for PanelAction {
    /// What is wrong with a name, in words.
    type Error = String;

    fn try_from(action: ActionDto) -> Result<Self, String> {
        Ok(match action {
            ActionDto::SetInput { point, on } => input(&point, on)?,
            ActionDto::Press { button } => Self::Press(button.into()),
            ActionDto::TurnKey { key } => Self::TurnKey(key.into()),
            ActionDto::EmergencyStop {} => Self::EmergencyStop,
            ActionDto::ReleaseEmergencyStop {} => Self::ReleaseEmergencyStop,
            ActionDto::ClearAlarm {} => Self::ClearAlarm,
            ActionDto::RaiseAlarm { alarm } => Self::RaiseAlarm(alarm),
            ActionDto::Home {} => Self::Home,
            ActionDto::Jog { axis, by, speed_percent } => {
                Self::Jog { axis: axis_named(&axis)?, by, percent: speed_percent }
            }
            ActionDto::SwitchProgram { program } => Self::SwitchProgram(program),
        })
    }
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

impl From<ButtonDto> for Button {
    fn from(button: ButtonDto) -> Self {
        match button {
            ButtonDto::Start => Self::Start,
            ButtonDto::Stop => Self::Stop,
            ButtonDto::Pause => Self::Pause,
            ButtonDto::SingleCycle => Self::SingleCycle,
            ButtonDto::SingleStep => Self::SingleStep,
        }
    }
}

impl From<KeyDto> for Key {
    fn from(key: KeyDto) -> Self {
        match key {
            KeyDto::Manual => Self::Manual,
            KeyDto::Auto => Self::Auto,
            KeyDto::Stop => Self::Stop,
        }
    }
}

impl ControllerDto {
    pub(super) fn of(number: usize, controller: &ControllerHandle) -> Self {
        let machine_name = controller.snapshot().machine_name;
        Self { number, address: controller.address().to_string(), machine_name }
    }
}

impl SnapshotDto {
    pub(super) fn of(number: usize, controller: &ControllerHandle) -> Self {
        let state = controller.snapshot();
        let [x_mm, y_mm, z_mm, u_deg, v_deg, w_deg] = state.world;
        Self {
            number,
            address: controller.address().to_string(),
            r#virtual: true,
            axes: axes(&state),
            pose: PoseDto { x_mm, y_mm, z_mm, u_deg, v_deg, w_deg },
            mode: state.mode.number(),
            mode_name: state.mode.to_string(),
            alarm: state.alarm,
            alarm_text: (state.alarm != 0).then(|| AlarmCode(state.alarm).decode().text),
            inputs_on: inputs_on(&state.io),
            outputs_on: outputs_on(&state.io),
            m_on: names(PointKind::M, &state.io.m),
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
}

fn axes(state: &ControllerSnapshot) -> Vec<AxisDto> {
    let figures = state.axis_limits.iter().zip(&state.axis_motions);
    let axes = AxisIndex::ALL.into_iter().zip(state.axes).zip(figures);
    axes.map(|((axis, position), ((lowest, highest), motion))| AxisDto {
        name: axis.to_string(),
        position,
        unit: match motion {
            AxisMotion::Turns => "deg".to_owned(),
            AxisMotion::Slides => "mm".to_owned(),
        },
        lowest: *lowest,
        highest: *highest,
    })
    .collect()
}

fn inputs_on(io: &Io) -> Vec<String> {
    let mut on = names(PointKind::X, &io.inputs);
    on.extend(names(PointKind::Eux, &[io.eu_inputs]));
    on
}

fn outputs_on(io: &Io) -> Vec<String> {
    let mut on = names(PointKind::Y, &io.outputs);
    on.extend(names(PointKind::Euy, &[io.eu_outputs]));
    on
}

/// The names of the points that are on, board by board.
fn names(kind: PointKind, words: &[u32]) -> Vec<String> {
    let boards = (0_u8..).zip(words);
    let points = boards.flat_map(|(board, word)| (0..32_u8).map(move |point| (board, point, word >> point)));
    points
        .filter(|(_, _, bits)| bits & 1 == 1)
        .map(|(board, point, _)| IoPoint { kind, board, point }.to_string())
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

    #[test]
    fn points_that_are_on_have_names() {
        assert_eq!(names(PointKind::Y, &[1 | 1 << 31, 0, 2]), ["Y010", "Y047", "Y2.011"]);
        assert_eq!(names(PointKind::Eux, &[0]), [""; 0]);
    }
}
