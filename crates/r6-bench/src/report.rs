//! The table.

use crate::measure::Ratio;

/// One row: what was measured against what, and how it came out.
pub struct Row {
    /// What.
    pub what: String,
    /// Against what, in the same run.
    pub against: &'static str,
    /// What it should be; `None` where it is only told.
    pub goal: Option<Goal>,
    /// What it was.
    pub ratio: Ratio,
}

/// What a ratio should be.
#[derive(Clone, Copy)]
pub enum Goal {
    /// Not more than so much of the other's time.
    AtMost(f64),
    /// At least so many times as fast.
    AtLeastFast(f64),
}

impl Row {
    /// Whether it holds. It fails only if the whole middle half of the rounds is beyond it.
    fn holds(&self) -> Option<bool> {
        let [low, _, _] = self.ratio.quartiles();
        match self.goal? {
            Goal::AtMost(limit) => Some(low <= limit),
            Goal::AtLeastFast(times) => Some(1.0 / low >= times),
        }
    }
}

/// The rows as Markdown.
pub fn table(rows: &[Row]) -> String {
    let mut text =
        String::from("| what | against | goal | measured (middle half) | |\n|---|---|---|---|---|\n");
    for row in rows {
        let [low, median, high] = row.ratio.quartiles();
        let measured = |ratios: [f64; 3]| {
            let [low, median, high] = ratios.map(shown);
            format!("{median} × ({low}–{high})")
        };
        let (goal, figure) = match row.goal {
            None => ("–".to_owned(), measured([low, median, high])),
            Some(Goal::AtMost(limit)) => (format!("≤ {} ×", shown(limit)), measured([low, median, high])),
            Some(Goal::AtLeastFast(times)) => {
                (format!("≥ {} × as fast", shown(times)), measured([1.0 / high, 1.0 / median, 1.0 / low]))
            }
        };
        let verdict = match row.holds() {
            None => "",
            Some(true) => "held",
            Some(false) => "missed",
        };
        text += &format!("| {} | {} | {goal} | {figure} | {verdict} |\n", row.what, row.against);
    }
    text
}

/// A ratio with three figures.
fn shown(ratio: f64) -> String {
    match ratio {
        100.0.. => format!("{ratio:.0}"),
        10.0.. => format!("{ratio:.1}"),
        _ => format!("{ratio:.2}"),
    }
}
