//! Recordings and instructions in English.

use r6_proto::io_point::{IoPoint, PointKind};
use r6_proto::message::Action;
use r6_proto::message::instruction::{Output, OutputKind, Wait, WaitCondition, WaitSource};

use crate::recording::{Ending, Played, Recording, Step};

/// A summary in one line: the duration, how many steps, the length of the tool's path, how many stops.
pub fn summary(recording: &Recording) -> String {
    let count = match recording.played {
        Played::Motion(instructions) => counted(instructions, "instruction"),
        Played::Program { steps, .. } => counted(steps, "step"),
    };
    let stops = match recording.stops {
        0 => "no stop".to_owned(),
        stops => counted(stops, "stop"),
    };
    format!("{:.3} s, {count}, tool path {:.1} mm, {stops}", recording.duration, recording.tool_path)
}

fn counted(count: usize, word: &str) -> String {
    if count == 1 { format!("1 {word}") } else { format!("{count} {word}s") }
}

/// What went wrong, in one line; `None` if it ran to its end.
pub fn trouble(recording: &Recording) -> Option<String> {
    let place = recording.ended_at.as_ref().map_or_else(|| "it".to_owned(), place);
    Some(match &recording.ending {
        Ending::Done => return None,
        Ending::Alarm(alarm) => {
            let text = alarm.code.decode().text;
            format!("{place} ends with alarm {} ({text}) at {:.3} s: {}", alarm.code, alarm.at, alarm.why)
        }
        Ending::Waiting => format!(
            "{place} waits for ever from {:.3} s on: nothing sets what it waits for",
            recording.duration
        ),
        Ending::TooLong => format!("{place} is not done after a week"),
        Ending::Endless => {
            format!("the program goes round without an end: at {:.3} s it is at {place}", recording.duration)
        }
    })
}

/// `instruction 2 (wait until X012 is on)`; a step of a taught program with the name of the program.
fn place(step: &Step) -> String {
    let what = match &step.program {
        None => format!("instruction {}", step.number),
        Some(program) => format!("program `{program}`, step {}", step.number),
    };
    if step.text.is_empty() { what } else { format!("{what} ({})", step.text) }
}

/// What an action does, with its signal if it has one: `wait until X010 is on`.
pub fn action(action: &Action) -> String {
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
        assert_eq!(action(&Action::Wait(wait)), "wait until X012 is on");
        let wait = Wait { condition: WaitCondition::FallingEdge, limit: 1.5, unlimited: false, ..wait };
        assert_eq!(action(&Action::Wait(wait)), "wait until X012 goes off, at most 1.5 s");
        let wait = Wait { source: WaitSource::Time, ..wait };
        assert_eq!(action(&Action::Wait(wait)), "wait 1.5 s");
        let output = Output { kind: OutputKind::TimedY, point: 32, on: true, delay: 0.5 };
        assert_eq!(action(&Action::Output(output)), "Y1.010 on for 0.5 s");
    }
}
