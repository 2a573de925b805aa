//! What a program did, in figures: for people and for programs.

use r6_controller::{AxisMotion, RobotModel};
use r6_proto::message::Instruction;
use serde_json::{Value, json};

use crate::output::table::Table;
use crate::output::{action, alarm};
use crate::recording::{Ending, Recording};

/// The most rows of the table. More would scroll the figures off the screen.
const MAX_ROWS: usize = 40;

/// The unit of an axis.
fn unit(motion: AxisMotion) -> &'static str {
    match motion {
        AxisMotion::Turns => "deg",
        AxisMotion::Slides => "mm",
    }
}

/// `1 stop`, `2 stops`, `no stop`.
fn stops_text(stops: usize) -> String {
    match stops {
        0 => "no stop".to_owned(),
        1 => "1 stop".to_owned(),
        stops => format!("{stops} stops"),
    }
}

/// A summary in one line.
pub fn summary(recording: &Recording) -> String {
    format!(
        "{:.3} s, {}, tool path {:.1} mm, {}",
        recording.duration,
        action::instructions(recording.instructions),
        recording.tool_path,
        stops_text(recording.stops)
    )
}

/// What went wrong, in one line; `None` if nothing did.
pub fn trouble(recording: &Recording, program: &[Instruction]) -> Option<String> {
    let number = recording.ended_at()?;
    let step = number.checked_sub(1).and_then(|index| program.get(index));
    let name = step.map_or_else(String::new, |step| format!(" ({})", action::text(&step.action)));
    Some(match &recording.ending {
        Ending::Done => return None,
        Ending::Alarm(raised) => format!(
            "instruction {number}{name} ends with alarm {} at {:.3} s: {}",
            alarm::short(raised.code),
            recording.alarm_at.unwrap_or(recording.duration),
            raised.why
        ),
        Ending::Waiting => format!(
            "instruction {number}{name} waits for ever from {:.3} s on: nothing sets what it waits for",
            recording.duration
        ),
        Ending::TooLong => format!("instruction {number}{name} is not done after a week"),
    })
}

/// A table with one row for each axis.
pub fn axis_table(recording: &Recording, model: &RobotModel) -> Table {
    let mut table = Table::with_right_columns(&[1, 2, 3, 4, 5, 7, 8]);
    table.row([&"AXIS", &"FROM", &"TO", &"LOWEST", &"HIGHEST", &"WAY", &"", &"TOP SPEED", &"OF FULL"]);
    for (number, (axis, drive)) in (1..).zip(recording.axes.iter().zip(model.drives())) {
        let cell = |value: f64| format!("{value:.3}");
        let unit = unit(drive.motion);
        table.row([
            &format!("J{number}"),
            &cell(axis.ends.0),
            &cell(axis.ends.1),
            &cell(axis.range.0),
            &cell(axis.range.1),
            &cell(axis.way),
            &unit,
            &format!("{:.1} {unit}/s", axis.top_speed),
            &format!("{:.1} %", percent(axis.top_speed, drive.max_speed)),
        ]);
    }
    table
}

/// A table with one row for each instruction that began.
pub fn turn_table(recording: &Recording, program: &[Instruction]) -> Table {
    let mut table = Table::with_right_columns(&[0, 2, 3, 4]);
    table.row([&"N", &"INSTRUCTION", &"BEGIN", &"END", &"TOOK"]);
    let rows = recording.turns.iter().zip(program).enumerate();
    for (index, (turn, step)) in rows.take(MAX_ROWS) {
        let end = turn.end.map_or_else(|| "-".to_owned(), |end| format!("{end:.3} s"));
        let took = turn.end.map_or_else(|| "-".to_owned(), |end| format!("{:.3} s", end - turn.begin));
        let begin = format!("{:.3} s", turn.begin);
        table.row([&(index + 1), &action::text(&step.action), &begin, &end, &took]);
    }
    if recording.turns.len() > MAX_ROWS {
        let more = recording.turns.len() - MAX_ROWS;
        table.row([&"…", &format!("{more} more: --json has them all"), &"", &"", &""]);
    }
    table
}

/// The figures and the series as JSON, units in the names.
pub fn json(recording: &Recording, model: &RobotModel, program: &[Instruction]) -> Value {
    let axes: Vec<_> = (1..)
        .zip(recording.axes.iter().zip(model.drives()))
        .map(|(number, (axis, drive))| {
            json!({
                "axis": format!("J{number}"), "unit": unit(drive.motion),
                "from": rounded(axis.ends.0), "to": rounded(axis.ends.1),
                "lowest": rounded(axis.range.0), "highest": rounded(axis.range.1),
                "way": rounded(axis.way), "top_speed_per_s": rounded(axis.top_speed),
                "top_speed_percent": rounded(percent(axis.top_speed, drive.max_speed)),
            })
        })
        .collect();
    let turns: Vec<_> = (1..)
        .zip(recording.turns.iter().zip(program))
        .map(|(number, (turn, step))| {
            json!({
                "number": number, "action": step.action.number(), "text": action::text(&step.action),
                "begin_s": rounded(turn.begin), "end_s": turn.end.map(rounded),
            })
        })
        .collect();
    let (ended, alarm, why) = match &recording.ending {
        Ending::Done => ("done", None, None),
        Ending::Alarm(alarm) => ("alarm", Some(alarm.code), Some(alarm.why.as_str())),
        Ending::Waiting => ("waiting", None, None),
        Ending::TooLong => ("too_long", None, None),
    };
    json!({
        "model": &*model.name,
        "duration_s": rounded(recording.duration),
        "instruction_count": recording.instructions,
        "tool_path_mm": rounded(recording.tool_path),
        "stops": recording.stops,
        "ended": ended,
        "ended_at_instruction": recording.ended_at(),
        "alarm": alarm,
        "alarm_text": alarm.map(alarm::short),
        "alarm_why": why,
        "alarm_s": recording.alarm_at.map(rounded),
        "axes": axes,
        "instructions": turns,
        "samples": samples(recording),
    })
}

/// The series, one list for each column.
fn samples(recording: &Recording) -> Value {
    let count = recording.axes.len();
    let rows = |values: &dyn Fn(&crate::recording::Sample) -> Vec<f64>| -> Vec<Vec<f64>> {
        recording.samples.iter().map(|sample| values(sample).into_iter().map(rounded).collect()).collect()
    };
    json!({
        "t_s": recording.samples.iter().map(|sample| rounded(sample.at)).collect::<Vec<_>>(),
        "axes": rows(&|sample| sample.axes.iter().take(count).copied().collect()),
        "speeds_per_s": rows(&|sample| sample.speeds.iter().take(count).copied().collect()),
        "tool_mm": rows(&|sample| sample.tool.to_vec()),
    })
}

fn percent(speed: f64, full: f64) -> f64 {
    100.0 * speed / full
}

/// Rounds to six decimals: microseconds and nanometres, without noise.
fn rounded(value: f64) -> f64 {
    let rounded = (value * 1e6).round() / 1e6;
    if rounded == 0.0 { 0.0 } else { rounded }
}
