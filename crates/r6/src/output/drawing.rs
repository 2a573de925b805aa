//! Draws a recording: axis positions and speeds over time, and the path of the tool.

mod canvas;
mod scale;
mod thin;
mod time_panel;
mod tool_path;

use r6_controller::{AxisMotion, RobotModel};

use self::canvas::{Anchor, Area, Canvas};
use self::time_panel::{Curve, TimePanel, Unit};
use crate::recording::{Ending, Recording};

/// The size of the picture, pixels.
const SIZE: (f64, f64) = (1200.0, 1130.0);

/// The areas of the curves over time.
const POSITIONS: Area = Area { left: 80.0, top: 120.0, width: 1040.0, height: 270.0 };
const SPEEDS: Area = Area { left: 80.0, top: 430.0, width: 1040.0, height: 190.0 };

/// The areas of the tool's path, from above and from the side.
const TOP_VIEW: Area = Area { left: 80.0, top: 725.0, width: 480.0, height: 340.0 };
const SIDE_VIEW: Area = Area { left: 640.0, top: 725.0, width: 480.0, height: 340.0 };

/// One colour for each axis. Readers with red-green colour blindness can distinguish them too.
const AXIS_COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc3399", "#b8860b", "#56a8e0"];

/// Above this number of instructions the picture does not separate them.
const MANY_INSTRUCTIONS: usize = 80;

/// The line width of each axis, pixels.
const AXIS_WIDTHS: [f64; 6] = [3.6, 3.2, 2.8, 2.4, 1.9, 1.4];

/// Colours and styles of text and marks.
const INK: &str = "#222222";
const PALE_INK: &str = "#666666";
const GRID: &str = "stroke=\"#e6e6e6\" stroke-width=\"1\"";
const FRAME: &str = "fill=\"none\" stroke=\"#999999\" stroke-width=\"1\"";
const ALARM: &str = "#c00020";

/// The content of a picture.
pub struct Picture<'p> {
    /// The program and the arm, in large letters.
    pub title: &'p str,
    /// The figures, in small letters.
    pub subtitle: &'p str,
    /// What went wrong.
    pub trouble: Option<&'p str>,
    /// The arm.
    pub model: &'p RobotModel,
    /// What it did.
    pub recording: &'p Recording,
}

/// Returns the picture as an SVG file. The same recording gives the same bytes.
pub fn svg(picture: &Picture<'_>) -> String {
    let mut canvas = Canvas::new(SIZE.0, SIZE.1, picture.title);
    canvas.text(
        (80.0, 38.0),
        Anchor::Start,
        picture.title,
        &format!("font-size=\"20\" font-weight=\"bold\" fill=\"{INK}\""),
    );
    canvas.text(
        (80.0, 60.0),
        Anchor::Start,
        picture.subtitle,
        &format!("font-size=\"13\" fill=\"{PALE_INK}\""),
    );
    if let Some(trouble) = picture.trouble {
        canvas.text((80.0, 80.0), Anchor::Start, trouble, &format!("font-size=\"13\" fill=\"{ALARM}\""));
    }
    legend(&mut canvas, picture.model.axis_count());
    over_time(&mut canvas, picture);
    tool_path::draw(&mut canvas, picture.recording, TOP_VIEW, SIDE_VIEW);
    canvas.finish()
}

fn legend(canvas: &mut Canvas, axes: usize) {
    const WIDTH: f64 = 62.0;
    canvas.begin_group("legend");
    let mut left = POSITIONS.right();
    for (number, colour) in AXIS_COLOURS.iter().enumerate().take(axes).rev() {
        left -= WIDTH;
        canvas.line((left, 34.0), (left + 24.0, 34.0), &stroke(number, colour, false));
        canvas.text(
            (left + 30.0, 38.0),
            Anchor::Start,
            &format!("J{}", number + 1),
            &format!("fill=\"{INK}\" font-size=\"13\""),
        );
    }
    canvas.end_group();
}

/// Whether there are so many instructions that numbers and wide lines do not help.
fn is_dense(recording: &Recording) -> bool {
    recording.turns.len() > MANY_INSTRUCTIONS
}

/// The line style of an axis. Later axes have narrower lines, so that both are visible where two lines
/// coincide.
fn stroke(axis: usize, colour: &str, is_dense: bool) -> String {
    let width = if is_dense { 1.0 } else { AXIS_WIDTHS.get(axis).copied().unwrap_or(1.5) };
    format!("stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"")
}

/// Draws the two panels over time.
fn over_time(canvas: &mut Canvas, picture: &Picture<'_>) {
    let recording = picture.recording;
    let curves = |value: &dyn Fn(usize, usize) -> f64, unit: &dyn Fn(AxisMotion) -> Unit| -> Vec<Curve> {
        picture
            .model
            .drives()
            .zip(AXIS_COLOURS)
            .enumerate()
            .map(|(axis, (drive, colour))| Curve {
                stroke: stroke(axis, colour, is_dense(recording)),
                unit: unit(drive.motion),
                values: (0..recording.samples.len()).map(|sample| value(sample, axis)).collect(),
            })
            .collect()
    };
    let position = |sample: usize, axis: usize| {
        recording.samples.get(sample).and_then(|sample| sample.axes.get(axis)).copied().unwrap_or(0.0)
    };
    let full: Vec<f64> = picture.model.drives().map(|drive| drive.max_speed).collect();
    let speed = |sample: usize, axis: usize| {
        let speed = recording.samples.get(sample).and_then(|sample| sample.speeds.get(axis));
        100.0 * speed.copied().unwrap_or(0.0) / full.get(axis).copied().unwrap_or(1.0)
    };
    let positions = curves(&position, &|motion| match motion {
        AxisMotion::Turns => Unit::Degrees,
        AxisMotion::Slides => Unit::Millimetres,
    });
    let speeds = curves(&speed, &|_| Unit::Percent);
    let mark = match &recording.ending {
        Ending::Alarm(alarm) => recording.alarm_at.map(|at| (at, format!("alarm {}", alarm.code))),
        Ending::Waiting => recording.turns.last().map(|turn| (turn.begin, "waits".to_owned())),
        Ending::Done | Ending::TooLong => None,
    };
    let panel = |area, name, curves, is_lowest| TimePanel {
        area,
        name,
        recording,
        curves,
        mark: mark.clone(),
        is_lowest,
    };
    panel(POSITIONS, "axis position", positions, false).draw(canvas);
    panel(SPEEDS, "axis speed", speeds, true).draw(canvas);
}
