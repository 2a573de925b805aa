//! The table.

use crate::measure::{ROUNDS, Ratio};

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

/// The page about all rows.
pub fn page(rows: &[Row]) -> String {
    let [model, kernel, rust] = machine();
    format!(
        "# How fast it is beside others\n\nWritten by `make bench`, all rows in one run on one core. Each row is a ratio of two that took turns, {ROUNDS} rounds \
         of a fifth of a second each; the median of the rounds and, in brackets, their middle half. A goal is missed only if the \
         whole middle half is beyond it. Rounds in which the yardstick was more than 15 % off its own median do not count.\n\n\
         Ratios travel between machines, times do not: {model}; {kernel}; {rust}.\n\n{}\n\
         Why goals are missed where they are, and what was measured in more detail, is in [how to read it](#how-to-read-it).\n\n{HOW_TO_READ}",
        table(rows)
    )
}

/// What stands below the table whatever is in it.
const HOW_TO_READ: &str = include_str!("how_to_read.md");

/// Processor, system and compiler.
fn machine() -> [String; 3] {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let processor = read("/proc/cpuinfo");
    let model = processor.lines().find_map(|line| line.strip_prefix("model name")?.split(": ").nth(1));
    let cores = processor.lines().filter(|line| line.starts_with("processor")).count();
    let rust = std::process::Command::new("rustc").arg("--version").output();
    let rust = rust.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    [
        format!("{cores} cores of {}", model.unwrap_or("an unknown processor")),
        format!("Linux {}", read("/proc/sys/kernel/osrelease").trim()),
        rust.unwrap_or_else(|_| "an unknown rustc".to_owned()),
    ]
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
