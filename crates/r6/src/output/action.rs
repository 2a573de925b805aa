//! Instructions in short text.

use r6_proto::io_point::{IoPoint, PointKind};
use r6_proto::message::Action;
use r6_proto::message::instruction::{Output, OutputKind, Wait, WaitCondition, WaitSource};

/// `1 instruction`, `2 instructions`.
pub fn instructions(count: usize) -> String {
    super::counted(count, "instruction")
}

/// What an action does, with its signal if it has one: `wait until X010 is on`.
pub fn text(action: &Action) -> String {
    match action {
        Action::Wait(wait) => wait_text(wait),
        Action::Output(output) => output_text(output),
        Action::StopOnSignal(_)
        | Action::AxisMove(_)
        | Action::LinearMove(_)
        | Action::CurveMove(_)
        | Action::PathSpeed(_)
        | Action::BoardOutput(_)
        | Action::Workbench(_)
        | Action::Unknown(_) => action.name().into_owned(),
    }
}

fn wait_text(wait: &Wait) -> String {
    let (kind, board, point) = match wait.source {
        WaitSource::Time => return format!("wait {} s", wait.limit),
        WaitSource::Input { board, point } => (PointKind::X, board, point),
        WaitSource::M { board, point } => (PointKind::M, board, point),
        WaitSource::Eu { point } => (PointKind::Eux, 0, point),
    };
    let condition = match wait.condition {
        WaitCondition::Off => "is off",
        WaitCondition::On => "is on",
        WaitCondition::RisingEdge => "goes on",
        WaitCondition::FallingEdge => "goes off",
    };
    let limit = if wait.unlimited { String::new() } else { format!(", at most {} s", wait.limit) };
    format!("wait until {} {condition}{limit}", IoPoint { kind, board, point })
}

fn output_text(output: &Output) -> String {
    let (kind, timed) = match output.kind {
        OutputKind::Y => (PointKind::Y, false),
        OutputKind::M => (PointKind::M, false),
        OutputKind::Euy => (PointKind::Euy, false),
        OutputKind::TimedY => (PointKind::Y, true),
    };
    // Point 32 is the first point of the next board.
    let (board, point) = (output.point / 32, output.point % 32);
    let state = if output.on { "on" } else { "off" };
    let time = match (timed, output.delay > 0.0) {
        (true, _) => format!(" for {} s", output.delay),
        (false, true) => format!(" after {} s", output.delay),
        (false, false) => String::new(),
    };
    format!("{} {state}{time}", IoPoint { kind, board, point })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_have_the_names_on_their_terminals() {
        let wait = Wait {
            source: WaitSource::Input { board: 0, point: 2 },
            condition: WaitCondition::On,
            limit: 0.0,
            unlimited: true,
        };
        assert_eq!(text(&Action::Wait(wait)), "wait until X012 is on");
        let wait = Wait { condition: WaitCondition::FallingEdge, limit: 1.5, unlimited: false, ..wait };
        assert_eq!(text(&Action::Wait(wait)), "wait until X012 goes off, at most 1.5 s");
        let wait = Wait { source: WaitSource::Time, ..wait };
        assert_eq!(text(&Action::Wait(wait)), "wait 1.5 s");
        let output = Output { kind: OutputKind::TimedY, point: 32, on: true, delay: 0.5 };
        assert_eq!(text(&Action::Output(output)), "Y1.010 on for 0.5 s");
    }
}
