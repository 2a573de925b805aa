//! What a motion or a program did, in figures: for people and for programs.

use r6_controller::{AxisMotion, RobotModel};
use r6_plot::{Ending, Played, PointTrack, Recording, Sample, Step};
use serde_json::{Map, Value, json};

use crate::output::alarm;
use crate::output::table::Table;

/// The most rows of the table. More would scroll the figures off the screen.
const MAX_ROWS: usize = 40;

/// The unit of an axis.
fn unit(motion: AxisMotion) -> &'static str {
    match motion {
        AxisMotion::Turns => "deg",
        AxisMotion::Slides => "mm",
    }
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

/// A table with one row for each step that took time, or each instruction that began.
pub fn turn_table(recording: &Recording) -> Table {
    let mut table = Table::with_right_columns(&[0, 2, 3, 4]);
    let (heading, main) = match &recording.played {
        Played::Motion(_) => ("INSTRUCTION", None),
        Played::Program { name, .. } => ("STEP", Some(name)),
    };
    table.row([&"N", &heading, &"BEGIN", &"END", &"TOOK"]);
    for turn in recording.turns.iter().take(MAX_ROWS) {
        let end = turn.end.map_or_else(|| "-".to_owned(), |end| format!("{end:.3} s"));
        let took = turn.end.map_or_else(|| "-".to_owned(), |end| format!("{:.3} s", end - turn.begin));
        let begin = format!("{:.3} s", turn.begin);
        let Step { number, program, text, .. } = &turn.step;
        let called = program.as_ref().filter(|program| Some(*program) != main);
        let text = called.map_or_else(|| text.clone(), |called| format!("{text}, in `{called}`"));
        table.row([number, &text, &begin, &end, &took]);
    }
    if recording.turns.len() > MAX_ROWS {
        let more = recording.turns.len() - MAX_ROWS;
        table.row([&"…", &format!("{more} more: --json has them all"), &"", &"", &""]);
    }
    table
}

/// The figures and the series as JSON, units in the names.
pub fn json(recording: &Recording, model: &RobotModel) -> Map<String, Value> {
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
    let turns: Vec<_> = recording
        .turns
        .iter()
        .map(|turn| {
            let mut told = json!({
                "number": turn.step.number, "action": turn.step.action, "text": turn.step.text,
                "begin_s": rounded(turn.begin), "end_s": turn.end.map(rounded),
            });
            if let (Some(told), Some(program)) = (told.as_object_mut(), &turn.step.program) {
                told.insert("program".to_owned(), program.as_str().into());
            }
            told
        })
        .collect();
    let ended = match &recording.ending {
        Ending::Done => "done",
        Ending::Alarm(_) => "alarm",
        Ending::Waiting => "waiting",
        Ending::TooLong => "too_long",
        Ending::Endless => "endless",
    };
    let (program, count) = match &recording.played {
        Played::Motion(count) => (None, count),
        Played::Program { name, steps } => (Some(name), steps),
    };
    let alarm = recording.alarm();
    let figures = json!({
        "model": &*model.name,
        "program": program,
        "duration_s": rounded(recording.duration),
        "instruction_count": count,
        "tool_path_mm": rounded(recording.tool_path),
        "stops": recording.stops,
        "ended": ended,
        "ended_at_instruction": recording.ended_at.as_ref().map(|step| step.number),
        "alarm": alarm.map(|alarm| alarm.code.0),
        "alarm_text": alarm.map(|alarm| alarm::short(i64::from(alarm.code))),
        "alarm_why": alarm.map(|alarm| alarm.why.as_str()),
        "alarm_s": alarm.map(|alarm| rounded(alarm.at)),
        "axes": axes,
        "instructions": turns,
        "points": recording.points.iter().map(|track| point(track, recording.duration)).collect::<Vec<_>>(),
        "samples": samples(recording),
    });
    match figures {
        Value::Object(figures) => figures,
        _ => Map::new(),
    }
}

/// A point and the times at which it is on, each from its beginning to its end.
fn point(track: &PointTrack, until: f64) -> Value {
    let on: Vec<_> = track.on(until).into_iter().map(|(from, to)| [rounded(from), rounded(to)]).collect();
    json!({ "point": track.point.to_string(), "on_s": on })
}

/// The series, one list for each column.
fn samples(recording: &Recording) -> Value {
    let count = recording.axes.len();
    let rows = |values: &dyn Fn(&Sample) -> Vec<f64>| -> Vec<Vec<f64>> {
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
