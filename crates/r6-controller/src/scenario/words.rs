//! Happenings in the words of a scenario's text, for the log.

use std::fmt;

use r6_proto::io_point::{IoPoint, PointKind};

use super::{Bounce, Happening, InputPoint};
use crate::mode::Key;
use crate::panel::{Button, PanelAction};

impl Happening {
    /// The same without the texts that a log line does not show.
    pub(crate) fn for_the_log(&self) -> Self {
        match self {
            Self::Request(_) => Self::Request(Vec::new()),
            Self::Panel(PanelAction::LoadProgram { name, .. }) => {
                Self::Panel(PanelAction::LoadProgram { name: name.clone(), text: String::new() })
            }
            Self::Panel(_)
            | Self::Output(..)
            | Self::Bounce(_)
            | Self::Counter { .. }
            | Self::Photo(_)
            | Self::PowerCut { .. } => self.clone(),
        }
    }
}

impl fmt::Display for Happening {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Panel(action) => panel(f, action),
            Self::Output(point, on) => write!(f, "output {} {}", point.name(), level(*on)),
            Self::Bounce(Bounce { input, times, on, .. }) => {
                write!(f, "input {input} changes {times} times and ends {}", level(*on))
            }
            Self::Counter { id, current, target: None } => write!(f, "counter {id} is set to {current}"),
            Self::Counter { id, current, target: Some(target) } => {
                write!(f, "counter {id} is set to {current}, its target to {target}")
            }
            Self::Photo(camera) => write!(f, "a photo of camera {camera}"),
            Self::Request(_) => f.write_str("another master speaks"),
            Self::PowerCut { off, .. } => write!(f, "the mains fail for {} s", off.as_secs_f64()),
        }
    }
}

impl fmt::Display for InputPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kind, board, point) = match *self {
            Self::X(board, point) => (PointKind::X, board, point),
            Self::Eu(point) => (PointKind::Eux, 0, point),
        };
        IoPoint { kind, board, point }.fmt(f)
    }
}

fn panel(f: &mut fmt::Formatter<'_>, action: &PanelAction) -> fmt::Result {
    match action {
        PanelAction::SetInput { board, point, on } => {
            write!(f, "input {} {}", InputPoint::X(*board, *point), level(*on))
        }
        PanelAction::SetEuInput { point, on } => write!(f, "input {} {}", InputPoint::Eu(*point), level(*on)),
        PanelAction::Press(button) => write!(
            f,
            "button {}",
            match button {
                Button::Start => "start",
                Button::Stop => "stop",
                Button::Pause => "pause",
                Button::SingleCycle => "single-cycle",
                Button::SingleStep => "single-step",
            }
        ),
        PanelAction::TurnKey(key) => write!(
            f,
            "key to {}",
            match key {
                Key::Manual => "manual",
                Key::Stop => "stop",
                Key::Auto => "auto",
            }
        ),
        PanelAction::EmergencyStop => f.write_str("emergency-stop"),
        PanelAction::ReleaseEmergencyStop => f.write_str("release-emergency-stop"),
        PanelAction::ClearAlarm => f.write_str("clear-alarm"),
        PanelAction::RaiseAlarm(number) => write!(f, "alarm {number}"),
        PanelAction::Home => f.write_str("home"),
        PanelAction::Jog { axis, by, .. } => write!(f, "jog {axis} by {by}"),
        PanelAction::HoldJog { axis, up, .. } => {
            write!(f, "jog {axis}{} is held", if *up { '+' } else { '-' })
        }
        PanelAction::KeepJog => f.write_str("jog is still held"),
        PanelAction::EndJog => f.write_str("jog is let go"),
        PanelAction::ClearPoints => f.write_str("points of cameras are removed"),
        PanelAction::SwitchProgram(name) => write!(f, "program `{name}` is chosen"),
        PanelAction::LoadProgram { name, .. } => write!(f, "program `{name}` is loaded"),
    }
}

fn level(on: bool) -> &'static str {
    if on { "on" } else { "off" }
}
