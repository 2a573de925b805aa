//! Draws the path of the tool, from above and from the side, in the same scale.

use super::canvas::{Anchor, Area, Canvas, Place};
use super::scale::{Scale, Ticks};
use super::thin::thin;
use super::{ALARM, FRAME, GRID, INK, PALE_INK, counted, is_dense};
use crate::recording::{Ending, Recording, distance};

/// The smallest range that is drawn, mm. The path of a tool that only turns stays a point.
const SMALLEST: f64 = 10.0;

/// The share of a view that stays free around the path.
const MARGIN: f64 = 0.08;

/// Numbers of instructions that are closer than this are left out, pixels.
const CLOSEST_NUMBERS: f64 = 16.0;

/// Samples that are closer in time than this have no speed of their own, seconds.
const INSTANT: f64 = 1e-7;

/// From slow to fast.
const SPEED_COLOURS: [&str; 5] = ["#d7301f", "#e08020", "#a0a030", "#31a060", "#2060c0"];

/// Style of the numbers on the path. The white edge makes them readable on a line.
const NUMBER: &str =
    "fill=\"#333366\" font-size=\"11\" stroke=\"#ffffff\" stroke-width=\"3\" paint-order=\"stroke\"";

/// A view: the component that it shows to the right and the one upwards.
#[derive(Clone, Copy)]
struct View<'v> {
    area: Area,
    name: &'v str,
    across: usize,
    up: usize,
}

/// Draws both views.
pub fn draw(canvas: &mut Canvas, recording: &Recording, top: Area, side: Area) {
    let speeds = tool_speeds(recording);
    let fastest = speeds.iter().copied().fold(0.0, f64::max);
    let heading = format!("fill=\"{INK}\" font-size=\"13\"");
    canvas.text((top.left, top.top - 34.0), Anchor::Start, "tool path, mm", &heading);
    draw_legend(canvas, side.right(), top.top - 34.0, fastest);
    draw_marks_legend(canvas, recording, top.left, top.bottom() + 44.0);
    let bounds = bounds(recording);
    let top = View { area: top, name: "from above: X to the right, Y upwards", across: 0, up: 1 };
    let side = View { area: side, name: "from the side: X to the right, Z upwards", across: 0, up: 2 };
    let millimetres =
        [top, side].map(|view| view.millimetres_per_pixel(&bounds)).into_iter().fold(0.0, f64::max);
    for view in [top, side] {
        view.draw(canvas, recording, &speeds, fastest, &bounds, millimetres);
    }
}

/// The speed of the tool before each sample, mm/s.
fn tool_speeds(recording: &Recording) -> Vec<f64> {
    let mut speeds = vec![0.0];
    for pair in recording.samples.windows(2) {
        let [before, now] = pair else { continue };
        let time = now.at - before.at;
        let last = speeds.last().copied().unwrap_or(0.0);
        speeds.push(if time > INSTANT { distance(before.tool, now.tool) / time } else { last });
    }
    speeds
}

/// The smallest and largest X, Y and Z.
fn bounds(recording: &Recording) -> [(f64, f64); 3] {
    let mut bounds = [(f64::INFINITY, f64::NEG_INFINITY); 3];
    for sample in &recording.samples {
        for (bound, value) in bounds.iter_mut().zip(sample.tool) {
            *bound = (bound.0.min(value), bound.1.max(value));
        }
    }
    bounds.map(|bound| if bound.0 <= bound.1 { bound } else { (0.0, 0.0) })
}

/// The colour of a speed, as an index into [`SPEED_COLOURS`].
fn shade(speed: f64, fastest: f64) -> usize {
    if fastest <= 0.0 {
        return 0;
    }
    let count = SPEED_COLOURS.len();
    (1..count).take_while(|edge| speed > fastest * to_f64(*edge) / to_f64(count)).count()
}

fn to_f64(count: usize) -> f64 {
    f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}

fn draw_legend(canvas: &mut Canvas, right: f64, y: f64, fastest: f64) {
    if fastest <= 0.0 {
        return;
    }
    const WIDTH: f64 = 44.0;
    let style = format!("fill=\"{PALE_INK}\"");
    canvas.begin_group("legend");
    let end = format!("{fastest:.0} mm/s");
    canvas.text((right, y), Anchor::End, &end, &style);
    let mut left = right - 80.0 - WIDTH * to_f64(SPEED_COLOURS.len());
    canvas.text((left - 8.0, y), Anchor::End, "tool speed 0", &style);
    for colour in SPEED_COLOURS {
        let area = Area { left, top: y - 9.0, width: WIDTH, height: 9.0 };
        canvas.rectangle(area, &format!("fill=\"{colour}\""));
        left += WIDTH;
    }
    canvas.end_group();
}

/// Explains the marks on the path.
fn draw_marks_legend(canvas: &mut Canvas, recording: &Recording, left: f64, y: f64) {
    let style = format!("fill=\"{PALE_INK}\"");
    canvas.begin_group("legend");
    draw_begin(canvas, (left + 6.0, y - 4.0));
    canvas.text((left + 16.0, y), Anchor::Start, "begin", &style);
    draw_end(canvas, (left + 76.0, y - 4.0), recording);
    canvas.text((left + 86.0, y), Anchor::Start, "end", &style);
    if is_dense(recording) {
        canvas.end_group();
        return;
    }
    canvas.circle((left + 136.0, y - 4.0), 2.5, &format!("fill=\"{INK}\""));
    let text = format!(
        "with a number: the controller counts this {} as done (behind its corner where that is rounded)",
        counted(recording)
    );
    canvas.text((left + 146.0, y), Anchor::Start, &text, &style);
    canvas.end_group();
}

fn component(tool: [f64; 3], number: usize) -> f64 {
    tool.get(number).copied().unwrap_or(0.0)
}

impl View<'_> {
    /// The scale at which the whole path fits into this view.
    fn millimetres_per_pixel(&self, bounds: &[(f64, f64); 3]) -> f64 {
        let need = |number: usize, pixels: f64| {
            let (low, high) = bounds.get(number).copied().unwrap_or_default();
            (high - low).max(SMALLEST) * (1.0 + 2.0 * MARGIN) / pixels
        };
        need(self.across, self.area.width).max(need(self.up, self.area.height))
    }

    fn scales(&self, bounds: &[(f64, f64); 3], millimetres: f64) -> (Scale, Scale) {
        let range = |number: usize, pixels: f64| {
            let (low, high) = bounds.get(number).copied().unwrap_or_default();
            let (middle, half) = (f64::midpoint(low, high), pixels * millimetres / 2.0);
            (middle - half, middle + half)
        };
        (
            Scale::new(range(self.across, self.area.width), (self.area.left, self.area.right())),
            Scale::new(range(self.up, self.area.height), (self.area.bottom(), self.area.top)),
        )
    }

    fn draw(
        &self,
        canvas: &mut Canvas,
        recording: &Recording,
        speeds: &[f64],
        fastest: f64,
        bounds: &[(f64, f64); 3],
        millimetres: f64,
    ) {
        let (across, up) = self.scales(bounds, millimetres);
        canvas.begin_group("view");
        self.draw_frame(canvas, &across, &up);
        let place =
            |tool: [f64; 3]| (across.at(component(tool, self.across)), up.at(component(tool, self.up)));
        let places: Vec<Place> = recording.samples.iter().map(|sample| place(sample.tool)).collect();
        draw_way(canvas, &places, speeds, fastest);
        draw_numbers(canvas, recording, place);
        draw_ends(canvas, recording, &places);
        canvas.end_group();
    }

    fn draw_frame(&self, canvas: &mut Canvas, across: &Scale, up: &Scale) {
        let area = self.area;
        let style = format!("fill=\"{PALE_INK}\"");
        let (right, upward) = (Ticks::within(across.values(), 7), Ticks::within(up.values(), 6));
        for value in &right.values {
            let x = across.at(*value);
            canvas.line((x, area.top), (x, area.bottom()), GRID);
            canvas.text((x, area.bottom() + 17.0), Anchor::Middle, &right.label(*value), &style);
        }
        for value in &upward.values {
            let y = up.at(*value);
            canvas.line((area.left, y), (area.right(), y), GRID);
            canvas.text((area.left - 8.0, y + 4.0), Anchor::End, &upward.label(*value), &style);
        }
        canvas.rectangle(area, FRAME);
        canvas.text((area.left, area.top - 10.0), Anchor::Start, self.name, &style);
    }
}

/// Draws the path, in pieces of one colour each.
fn draw_way(canvas: &mut Canvas, places: &[Place], speeds: &[f64], fastest: f64) {
    let mut begin = 0;
    while begin + 1 < places.len() {
        let shade_at = |n: usize| shade(speeds.get(n).copied().unwrap_or(0.0), fastest);
        let colour = shade_at(begin + 1);
        let end =
            (begin + 1..places.len()).take_while(|n| shade_at(*n) == colour).last().unwrap_or(begin + 1);
        let piece = thin(places.get(begin..=end).unwrap_or_default());
        if piece.iter().any(|place| Some(place) != piece.first()) {
            let stroke = SPEED_COLOURS.get(colour).copied().unwrap_or(INK);
            let style = format!(
                "stroke=\"{stroke}\" stroke-width=\"2.2\" stroke-linecap=\"round\" stroke-linejoin=\"round\""
            );
            canvas.polyline(&piece, &style);
        }
        begin = end;
    }
}

/// Draws the ends of instructions, with their numbers.
fn draw_numbers(canvas: &mut Canvas, recording: &Recording, place: impl Fn([f64; 3]) -> Place) {
    if is_dense(recording) {
        return;
    }
    let mut drawn: Vec<Place> = Vec::new();
    let mut before = recording.samples.first().map(|sample| sample.tool);
    for turn in &recording.turns {
        let Some(tool) = turn.tool() else { continue };
        let moved = before.is_none_or(|before| distance(before, tool) > 0.5);
        before = Some(tool);
        let at = place(tool);
        let is_free = drawn.iter().all(|other| (other.0 - at.0).hypot(other.1 - at.1) >= CLOSEST_NUMBERS);
        if moved && is_free {
            canvas.circle(at, 2.5, &format!("fill=\"{INK}\""));
            canvas.text((at.0 + 6.0, at.1 - 6.0), Anchor::Start, &turn.step.number.to_string(), NUMBER);
            drawn.push(at);
        }
    }
}

/// Draws where the tool began and where it ended.
fn draw_ends(canvas: &mut Canvas, recording: &Recording, places: &[Place]) {
    let (Some(first), Some(last)) = (places.first(), places.last()) else { return };
    draw_begin(canvas, *first);
    draw_end(canvas, *last, recording);
}

fn draw_begin(canvas: &mut Canvas, place: Place) {
    canvas.circle(place, 5.0, "fill=\"#ffffff\" stroke=\"#222222\" stroke-width=\"2\"");
}

fn draw_end(canvas: &mut Canvas, last: Place, recording: &Recording) {
    let stopped = match recording.ending {
        Ending::Done => INK,
        Ending::Alarm(_) | Ending::Waiting | Ending::TooLong | Ending::Endless => ALARM,
    };
    let end = Area { left: last.0 - 4.0, top: last.1 - 4.0, width: 8.0, height: 8.0 };
    canvas.rectangle(end, &format!("fill=\"{stopped}\""));
}
