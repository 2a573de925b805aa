//! Draws when inputs, outputs and M points are on.

use r6_proto::io_point::PointKind;

use super::canvas::{Anchor, Area, Canvas};
use super::time_panel::TimeFrame;
use super::{INK, PALE_INK};
use crate::points::PointTrack;
use crate::recording::Recording;

/// How many points have a row. The others are named.
const MAX_ROWS: usize = 12;

/// How many of the others are named, as far as the line is long.
const MAX_NAMES: usize = 10;

/// The height of a row, and of its bar, pixels.
const ROW: f64 = 20.0;
const BAR: f64 = 12.0;

/// A shorter time is drawn this wide, pixels.
const NARROWEST: f64 = 2.0;

/// Bars that are closer than this are drawn as one, pixels.
const CLOSEST: f64 = 0.5;

/// Colours of bars: of inputs, and of points that the program changes.
const INPUT: &str = "#8a7a3c";
const OUTPUT: &str = "#4a5a6e";

/// How high the panel of a recording is; 0 if no point changed.
pub fn height(recording: &Recording) -> f64 {
    let rows = recording.points.len().min(MAX_ROWS);
    ROW * f64::from(u32::try_from(rows).unwrap_or(0))
}

/// A panel with one row for each point that changed.
pub struct PointsPanel<'p> {
    /// Its frame.
    pub frame: TimeFrame<'p>,
}

impl PointsPanel<'_> {
    /// Draws the panel.
    pub fn draw(&self, canvas: &mut Canvas) {
        let area = self.frame.area;
        let time = self.frame.draw_ground(canvas);
        canvas.begin_group("points");
        let heading = format!("fill=\"{INK}\" font-size=\"13\"");
        canvas.text((area.left, area.top - 10.0), Anchor::Start, "points, with a bar while on", &heading);
        let mut top = area.top;
        for track in self.frame.recording.points.iter().take(MAX_ROWS) {
            let name = track.point.to_string();
            let place = (area.left - 8.0, top + ROW / 2.0 + 4.0);
            canvas.text(place, Anchor::End, &name, &format!("fill=\"{PALE_INK}\""));
            let style = format!("fill=\"{}\"", colour(track));
            for (from, to) in self.bars(track, |at| time.at(at)) {
                let width = (to - from).max(NARROWEST);
                // A change at the very end stays within the frame.
                let left = from.min(area.right() - width);
                let bar = Area { left, top: top + (ROW - BAR) / 2.0, width, height: BAR };
                canvas.rectangle(bar, &style);
            }
            top += ROW;
        }
        if let Some(others) = others(&self.frame.recording.points) {
            let place = (area.left, area.bottom() + 36.0);
            canvas.text(place, Anchor::Start, &others, &format!("fill=\"{PALE_INK}\""));
        }
        canvas.end_group();
        self.frame.draw_edge(canvas, &time);
    }

    /// The bars of a point, from left to right in pixels. Those that nearly touch are one.
    fn bars(&self, track: &PointTrack, pixel: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        let mut bars: Vec<(f64, f64)> = Vec::new();
        for (from, to) in track.on(self.frame.recording.duration) {
            let (from, to) = (pixel(from), pixel(to));
            match bars.last_mut() {
                Some(last) if from - last.1 < CLOSEST => last.1 = to,
                _ => bars.push((from, to)),
            }
        }
        bars
    }
}

fn colour(track: &PointTrack) -> &'static str {
    match track.point.kind {
        PointKind::X | PointKind::Eux => INPUT,
        PointKind::Y | PointKind::M | PointKind::Euy => OUTPUT,
    }
}

/// Names the points that have no row.
fn others(points: &[PointTrack]) -> Option<String> {
    let others = points.get(MAX_ROWS..).filter(|others| !others.is_empty())?;
    let names: Vec<_> = others.iter().take(MAX_NAMES).map(|track| track.point.to_string()).collect();
    let more = others.len() - names.len();
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    Some(format!("changed, too: {}{more}", names.join(", ")))
}
