//! Draws a recording: axis positions and speeds over time, the points that changed, and the path of the tool.

mod canvas;
#[cfg(test)]
mod colours;
mod points_panel;
mod scale;
mod thin;
mod time_panel;
mod tool_path;

use r6_controller::{AxisMotion, RobotModel};

use self::canvas::{Anchor, Area, Canvas};
use self::points_panel::PointsPanel;
use self::time_panel::{Curve, TimeFrame, TimePanel, Unit};
use crate::recording::{Ending, Played, Recording};

/// The size of a picture without points, pixels.
const SIZE: (f64, f64) = (1200.0, 1130.0);

/// The areas of the curves over time.
const POSITIONS: Area = Area { left: 80.0, top: 120.0, width: 1040.0, height: 270.0 };
const SPEEDS: Area = Area { left: 80.0, top: 430.0, width: 1040.0, height: 190.0 };

/// The upper edge of the panel of points.
const POINTS_TOP: f64 = 674.0;

/// The areas of the tool's path, from above and from the side, in a picture without points.
const TOP_VIEW: Area = Area { left: 80.0, top: 725.0, width: 480.0, height: 340.0 };
const SIDE_VIEW: Area = Area { left: 640.0, top: 725.0, width: 480.0, height: 340.0 };

/// One colour for each axis, from the design tokens of the light theme. Any two of them differ clearly, and
/// all are dark enough on white: `colours.rs` tests it.
const AXIS_COLOURS: [&str; 6] = ["#2719e6", "#6d8f1e", "#5a2163", "#3e8eea", "#184517", "#a97e94"];

/// Above this number of instructions or steps the picture does not separate them.
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
    let points = points_panel::height(picture.recording);
    let shift = if points > 0.0 { points + POINTS_TOP - SPEEDS.bottom() } else { 0.0 };
    let mut canvas = Canvas::new(SIZE.0, SIZE.1 + shift, picture.title);
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
    over_time(&mut canvas, picture, points);
    let [top_view, side_view] = [TOP_VIEW, SIDE_VIEW].map(|view| Area { top: view.top + shift, ..view });
    tool_path::draw(&mut canvas, picture.recording, top_view, side_view);
    canvas.finish()
}

/// What the numbers of the picture count.
fn counted(recording: &Recording) -> &'static str {
    match recording.played {
        Played::Motion(_) => "instruction",
        Played::Program { .. } => "step",
    }
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

/// Draws the panels over time; the panel of points is so high, 0 for none.
fn over_time(canvas: &mut Canvas, picture: &Picture<'_>, points: f64) {
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
        Ending::Alarm(alarm) => Some((alarm.at, format!("alarm {}", alarm.code))),
        Ending::Waiting => recording.turns.last().map(|turn| (turn.begin, "waits".to_owned())),
        Ending::Done | Ending::TooLong | Ending::Endless => None,
    };
    let frame =
        |area, is_top, is_lowest| TimeFrame { area, recording, mark: mark.clone(), is_top, is_lowest };
    let has_points = points > 0.0;
    TimePanel { frame: frame(POSITIONS, true, false), name: "axis position", curves: positions }.draw(canvas);
    TimePanel { frame: frame(SPEEDS, false, !has_points), name: "axis speed", curves: speeds }.draw(canvas);
    if has_points {
        let area = Area { top: POINTS_TOP, height: points, ..SPEEDS };
        PointsPanel { frame: frame(area, false, true) }.draw(canvas);
    }
}
