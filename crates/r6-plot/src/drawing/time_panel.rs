//! Draws curves over time, with the instructions or steps they belong to.

use super::canvas::{Anchor, Area, Canvas, Place};
use super::scale::{Scale, Ticks, round_range};
use super::thin::{by_column, thin};
use super::{ALARM, FRAME, GRID, INK, PALE_INK, counted, is_dense};
use crate::recording::Recording;

/// Boundaries of instructions that are closer than this are left out, pixels. They would look like one grey
/// area.
const CLOSEST_BOUNDARIES: f64 = 3.0;

/// The width of a digit, pixels, to keep numbers apart.
const DIGIT: f64 = 7.0;

/// How far above the panel the numbers of the steps stand, pixels: clear of the highest value at its side.
const NUMBERS_ABOVE: f64 = 13.0;

/// The unit of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Degrees.
    Degrees,
    /// Millimetres.
    Millimetres,
    /// Percent of the full speed.
    Percent,
}

impl Unit {
    fn name(self) -> &'static str {
        match self {
            Self::Degrees => "degrees",
            Self::Millimetres => "mm",
            Self::Percent => "% of full speed",
        }
    }

    /// The smallest range that is drawn. A curve within less looks like a straight line.
    fn smallest_range(self) -> f64 {
        match self {
            Self::Degrees | Self::Millimetres => 1.0,
            Self::Percent => 4.0,
        }
    }
}

/// One axis over time.
pub struct Curve {
    /// Colour and width, as SVG attributes.
    pub stroke: String,
    /// Its unit.
    pub unit: Unit,
    /// The values, one for each sample.
    pub values: Vec<f64>,
}

/// The frame of a panel over time.
pub struct TimeFrame<'p> {
    /// Its place on the canvas.
    pub area: Area,
    /// The recording with the times of samples and steps.
    pub recording: &'p Recording,
    /// When something went wrong, and what.
    pub mark: Option<(f64, String)>,
    /// Whether it shows the numbers of the steps above.
    pub is_top: bool,
    /// Whether it shows the unit of time below.
    pub is_lowest: bool,
}

impl TimeFrame<'_> {
    /// Draws what lies behind the content, and returns the scale of time.
    pub fn draw_ground(&self, canvas: &mut Canvas) -> Scale {
        let duration = self.recording.duration;
        // Leaves room within the frame for the mark of what went wrong.
        let room = if self.mark.is_some() { 1.05 } else { 1.0 };
        let end = if duration > 0.0 { duration * room } else { 1.0 };
        let time = Scale::new((0.0, end), (self.area.left, self.area.right()));
        self.draw_time(canvas, &time);
        self.draw_boundaries(canvas, &time);
        time
    }

    /// Draws what lies above the content.
    pub fn draw_edge(&self, canvas: &mut Canvas, time: &Scale) {
        canvas.rectangle(self.area, FRAME);
        self.draw_mark(canvas, time);
    }

    fn draw_time(&self, canvas: &mut Canvas, time: &Scale) {
        let ticks = Ticks::within(time.values(), 12);
        canvas.begin_group("time");
        for value in &ticks.values {
            let x = time.at(*value);
            canvas.line((x, self.area.top), (x, self.area.bottom()), GRID);
            let style = format!("fill=\"{PALE_INK}\"");
            canvas.text((x, self.area.bottom() + 17.0), Anchor::Middle, &ticks.label(*value), &style);
        }
        if self.is_lowest {
            let middle = self.area.left + self.area.width / 2.0;
            let place = (middle, self.area.bottom() + 36.0);
            canvas.text(place, Anchor::Middle, "seconds", &format!("fill=\"{INK}\" font-size=\"13\""));
        }
        canvas.end_group();
    }

    /// Draws the boundaries between steps, with their numbers above.
    fn draw_boundaries(&self, canvas: &mut Canvas, time: &Scale) {
        if is_dense(self.recording) {
            return;
        }
        canvas.begin_group("instructions");
        let mut last = time.at(0.0);
        let mut free_from = self.area.left;
        for turn in &self.recording.turns {
            let end = turn.end.unwrap_or(time.values().1);
            let (from, to) = (time.at(turn.begin), time.at(end));
            let is_inside = to < self.area.right() - 1.0;
            if turn.end.is_some() && is_inside && to - last >= CLOSEST_BOUNDARIES {
                let style = "stroke=\"#8888aa\" stroke-width=\"1\" stroke-dasharray=\"2 3\"";
                canvas.line((to, self.area.top), (to, self.area.bottom()), style);
                last = to;
            }
            let text = turn.step.number.to_string();
            let width = DIGIT * f64::from(u8::try_from(text.len()).unwrap_or(u8::MAX));
            let middle = f64::midpoint(from, to);
            let fits = to - from >= width && middle - width / 2.0 >= free_from;
            if self.is_top && fits {
                let style = "fill=\"#555588\" font-size=\"11\"";
                canvas.text((middle, self.area.top - NUMBERS_ABOVE), Anchor::Middle, &text, style);
                free_from = middle + width / 2.0 + 3.0;
            }
        }
        if self.is_top {
            let place = (self.area.left - 8.0, self.area.top - NUMBERS_ABOVE);
            canvas.text(place, Anchor::End, counted(self.recording), "fill=\"#555588\" font-size=\"11\"");
        }
        canvas.end_group();
    }

    fn draw_mark(&self, canvas: &mut Canvas, time: &Scale) {
        let Some((at, text)) = &self.mark else { return };
        let x = time.at(*at);
        canvas.line(
            (x, self.area.top),
            (x, self.area.bottom()),
            &format!("stroke=\"{ALARM}\" stroke-width=\"2\""),
        );
        if self.is_top {
            let style = format!("fill=\"{ALARM}\" font-weight=\"bold\"");
            let is_late = x > self.area.left + self.area.width / 2.0;
            let (x, anchor) = if is_late { (x - 6.0, Anchor::End) } else { (x + 6.0, Anchor::Start) };
            canvas.text((x, self.area.top + 16.0), anchor, text, &style);
        }
    }
}

/// A panel of curves over the same time.
pub struct TimePanel<'p> {
    /// Its frame.
    pub frame: TimeFrame<'p>,
    /// Its title.
    pub name: &'static str,
    /// One curve for each axis.
    pub curves: Vec<Curve>,
}

impl TimePanel<'_> {
    /// Draws the panel.
    pub fn draw(&self, canvas: &mut Canvas) {
        let time = self.frame.draw_ground(canvas);
        let mut units: Vec<Unit> = self.curves.iter().map(|curve| curve.unit).collect();
        units.sort_by_key(|unit| *unit as u8);
        units.dedup();
        for (place, unit) in units.iter().enumerate().take(2) {
            let scale = self.value_scale(*unit);
            self.draw_values(canvas, &scale, *unit, place == 0);
            self.draw_curves(canvas, &time, &scale, *unit);
        }
        self.frame.draw_edge(canvas, &time);
    }

    fn value_scale(&self, unit: Unit) -> Scale {
        let values = self.curves.iter().filter(|curve| curve.unit == unit).flat_map(|curve| &curve.values);
        let range = values.fold((f64::INFINITY, f64::NEG_INFINITY), |range, value| {
            (range.0.min(*value), range.1.max(*value))
        });
        let range = if range.0 <= range.1 { range } else { (0.0, 0.0) };
        let range = round_range(range, unit.smallest_range(), self.wanted_ticks());
        Scale::new(range, (self.frame.area.bottom(), self.frame.area.top))
    }

    fn wanted_ticks(&self) -> u32 {
        if self.frame.area.height > 200.0 { 7 } else { 5 }
    }

    /// Draws the values at the left edge or at the right edge.
    fn draw_values(&self, canvas: &mut Canvas, scale: &Scale, unit: Unit, is_left: bool) {
        let ticks = Ticks::within(scale.values(), self.wanted_ticks());
        canvas.begin_group("values");
        for value in &ticks.values {
            let y = scale.at(*value);
            let style = format!("fill=\"{PALE_INK}\"");
            if is_left {
                let grid = if *value == 0.0 { "stroke=\"#bbbbbb\" stroke-width=\"1\"" } else { GRID };
                canvas.line((self.frame.area.left, y), (self.frame.area.right(), y), grid);
                canvas.text((self.frame.area.left - 8.0, y + 4.0), Anchor::End, &ticks.label(*value), &style);
            } else {
                canvas.text(
                    (self.frame.area.right() + 8.0, y + 4.0),
                    Anchor::Start,
                    &ticks.label(*value),
                    &style,
                );
            }
        }
        let name = format!("{}, {}", self.name, unit.name());
        let x = if is_left { self.frame.area.left - 52.0 } else { self.frame.area.right() + 58.0 };
        let place = (x, self.frame.area.top + self.frame.area.height / 2.0);
        canvas.upright_text(place, &name, &format!("fill=\"{INK}\" font-size=\"13\""));
        canvas.end_group();
    }

    fn draw_curves(&self, canvas: &mut Canvas, time: &Scale, scale: &Scale, unit: Unit) {
        canvas.begin_group("curves");
        for curve in self.curves.iter().filter(|curve| curve.unit == unit) {
            let samples = self.frame.recording.samples.iter().zip(&curve.values);
            let places: Vec<Place> =
                samples.map(|(sample, value)| (time.at(sample.at), scale.at(*value))).collect();
            let style = curve.stroke.as_str();
            canvas.polyline(&thin(&by_column(&places)), style);
        }
        canvas.end_group();
    }
}
