//! The table.

use crate::measure::Ratio;

/// One row: what was measured against what, and how it came out.
pub struct Row {
    /// What.
    pub what: String,
    /// Against what, in the same run.
    pub against: String,
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
    /// The other takes at least so many times as long.
    AtLeastTimesAsFast(f64),
}

impl Row {
    /// Whether it holds. It fails only if the whole middle half of the rounds is beyond it.
    fn holds(&self) -> Option<bool> {
        let [low, _, high] = self.ratio.quartiles();
        match self.goal? {
            Goal::AtMost(limit) => Some(low <= limit),
            Goal::AtLeastTimesAsFast(limit) => Some(high >= limit),
        }
    }
}

/// The rows as Markdown.
pub fn table(rows: &[Row]) -> String {
    let mut text =
        String::from("| what | against | goal | measured (middle half) | |\n|---|---|---|---|---|\n");
    for row in rows {
        let [low, median, high] = row.ratio.quartiles();
        let goal = match row.goal {
            None => "–".to_owned(),
            Some(Goal::AtMost(limit)) => format!("≤ {limit:.2} ×"),
            Some(Goal::AtLeastTimesAsFast(limit)) => format!("≥ {limit:.1} × as fast"),
        };
        let verdict = match row.holds() {
            None => "",
            Some(true) => "held",
            Some(false) => "missed",
        };
        text += &format!(
            "| {} | {} | {goal} | {median:.2} × ({low:.2}–{high:.2}) | {verdict} |\n",
            row.what, row.against
        );
    }
    text
}
