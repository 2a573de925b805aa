//! The table of results.

use crate::measure::{LEAST_ROUNDS, ROUNDS, Ratio};
use crate::rows::PYTHON;

/// One row: what was measured, against what, and the result.
pub struct Row {
    /// What was measured.
    pub what: String,
    /// Against what, in the same run.
    pub against: &'static str,
    /// The goal; `None` if the figure is only reported.
    pub goal: Option<Goal>,
    /// The result.
    pub figure: Figure,
    /// The reason, from a profile, why the row misses its goal, in one sentence. It is printed if the goal is
    /// missed.
    pub in_the_way: &'static str,
}

/// A result.
pub enum Figure {
    /// A ratio to another contender.
    Ratio(Ratio),
    /// A counted or directly measured amount, in this unit.
    Amount(f64, &'static str),
    /// Not measured here: the reason, and what is needed.
    NotMeasured(&'static str),
}

/// The goal of a figure.
#[derive(Clone, Copy)]
pub enum Goal {
    /// At most this multiple of the other's time.
    AtMost(f64),
    /// At least this many times as fast.
    AtLeastFast(f64),
    /// No goal; the figure is printed as a speed ratio.
    ToldFast,
    /// At most this amount.
    AmountAtMost(f64),
}

impl Row {
    /// Whether the goal is held. A ratio fails only if the whole middle half of the rounds is beyond the
    /// goal.
    fn holds(&self) -> Option<bool> {
        if self.is_disturbed() {
            return None;
        }
        match (&self.figure, self.goal?) {
            (Figure::Ratio(ratio), Goal::AtMost(limit)) => Some(ratio.quartiles()[0] <= limit),
            (Figure::Ratio(ratio), Goal::AtLeastFast(times)) => Some(1.0 / ratio.quartiles()[0] >= times),
            (Figure::Amount(amount, _), Goal::AmountAtMost(limit)) => Some(*amount <= limit),
            // This kind of goal does not apply to this kind of figure.
            (Figure::Ratio(_), Goal::AmountAtMost(_))
            | (Figure::Amount(..), Goal::AtMost(_) | Goal::AtLeastFast(_)) => None,
            (Figure::NotMeasured(_), _) | (_, Goal::ToldFast) => None,
        }
    }

    /// Whether too few of its rounds count.
    fn is_disturbed(&self) -> bool {
        matches!(&self.figure, Figure::Ratio(ratio) if ratio.rounds() < LEAST_ROUNDS)
    }

    fn goal(&self) -> String {
        match (self.goal, &self.figure) {
            (None | Some(Goal::ToldFast), _) => "–".to_owned(),
            (Some(Goal::AtMost(limit)), _) => format!("≤ {} × the time", shown(limit)),
            (Some(Goal::AtLeastFast(times)), _) => format!("≥ {} × as fast", shown(times)),
            (Some(Goal::AmountAtMost(limit)), Figure::Amount(_, unit)) if limit > 0.0 => {
                format!("≤ {limit}{unit}")
            }
            (Some(Goal::AmountAtMost(limit)), _) => format!("{limit}"),
        }
    }

    fn measured(&self) -> String {
        match &self.figure {
            Figure::Ratio(ratio) if self.is_disturbed() => {
                format!(
                    "not measured: the machine was busy, only {} of {ROUNDS} rounds count",
                    ratio.rounds()
                )
            }
            Figure::Ratio(ratio) => {
                let quartiles = ratio.quartiles();
                let fast = matches!(self.goal, Some(Goal::AtLeastFast(_) | Goal::ToldFast));
                let unit = if fast { "as fast" } else { "the time" };
                let [low, median, high] = if fast { inverse(quartiles) } else { quartiles }.map(shown);
                format!("{median} × {unit} ({low}–{high})")
            }
            Figure::Amount(amount, unit) => format!("{}{unit}", (amount * 10.0).round() / 10.0),
            Figure::NotMeasured(why) => format!("not measured: {why}"),
        }
    }
}

fn inverse([low, median, high]: [f64; 3]) -> [f64; 3] {
    [1.0 / high, 1.0 / median, 1.0 / low]
}

/// The beginning of the heading of a kind of processor.
const ON: &str = "## On ";

/// The page with all rows. It keeps the last run on each other kind of processor from the old page.
pub fn page(rows: &[Row], before: &str) -> String {
    let [model, cores, kernel, rust] = machine();
    let heading = format!("{ON}{model}\n");
    let others_before: String = sections(before)
        .filter(|section| section.starts_with(ON) && !section.starts_with(&heading))
        .collect();
    format!(
        "# How fast it is beside others\n\nWritten by `make bench`, all rows in one run on one core, only the delays of the gateway on all cores. A ratio is of two that took turns, {ROUNDS} rounds of a fifth of \
         a second each, of a second for the thousand robots; the median of the rounds and, in brackets, their middle half. A goal is missed only \
         if the whole middle half is beyond it. Rounds in which the yardstick was more than 15 % off its own median do not count, and of {ROUNDS} at \
         least {LEAST_ROUNDS} have to. Beside a fixed amount (a million, real time) the yardstick is a copy of memory. What is counted or weighed \
         (allocations, memory, processor time at rest) is so once.\n\n{WHAT_TRAVELS}\n\
         {heading}\n{cores}; {kernel}; {rust}. The code: {}. The others: {}.\n\n{}\n{}\n\n{others_before}{}{HOW_TO_READ}",
        commit(),
        others(),
        table(rows),
        sum(rows),
        reasons(rows)
    )
}

/// The sections of a page, each with its heading.
fn sections(page: &str) -> impl Iterator<Item = String> {
    let mut parts = vec![String::new()];
    for line in page.lines() {
        if line.starts_with("## ") {
            parts.push(String::new());
        }
        if let Some(part) = parts.last_mut() {
            *part += line;
            part.push('\n');
        }
    }
    parts.into_iter()
}

/// How many goals are held, and how many are missed.
fn sum(rows: &[Row]) -> String {
    let [held, missed] =
        [true, false].map(|held| rows.iter().filter(|row| row.holds() == Some(held)).count());
    format!("Of {} goals {held} are held and {missed} are missed.", held + missed)
}

/// The measured commit, with its day, and a + if files have changed since.
fn commit() -> String {
    let git = |arguments: &[&str]| {
        let output = std::process::Command::new("git").args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let changed = git(&["status", "--porcelain", "--untracked-files=no", "--", ".", ":!*.md"]);
    match (git(&["log", "-1", "--format=%h"]), git(&["log", "-1", "--format=%cs"])) {
        (Some(commit), Some(day)) => {
            format!(
                "`{commit}{}`, {day}",
                if changed.is_some_and(|files| files.is_empty()) { "" } else { "+" }
            )
        }
        _ => "of no commit that git knows".to_owned(),
    }
}

/// The fixed text below the table.
const HOW_TO_READ: &str = include_str!("how_to_read.md");

/// What is valid on other machines, and what is not.
const WHAT_TRAVELS: &str = include_str!("what_travels.md");

/// Processor, number of cores, system and compiler.
fn machine() -> [String; 4] {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let processor = read("/proc/cpuinfo");
    let model = processor.lines().find_map(|line| line.strip_prefix("model name")?.split(": ").nth(1));
    let cores = processor.lines().filter(|line| line.starts_with("processor")).count();
    let release = read("/proc/sys/kernel/osrelease");
    let rust = std::process::Command::new("rustc").arg("--version").output();
    let rust = rust.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    [
        model.unwrap_or("an unknown processor").to_owned(),
        format!("{cores} cores"),
        format!("Linux {}", release.splitn(3, '.').take(2).collect::<Vec<_>>().join(".")),
        rust.unwrap_or_else(|_| "an unknown rustc".to_owned()),
    ]
}

/// The versions of the other programs and libraries.
fn others() -> String {
    let mut versions = Vec::new();
    // In Cargo.lock the version is in the line after the name.
    let mut lines = include_str!("../../../Cargo.lock").lines();
    while let Some(line) = lines.next() {
        let name = line.strip_prefix("name = \"").and_then(|name| name.strip_suffix('"'));
        if let Some(name) =
            name.filter(|name| ["rusqlite", "serde_json", "sonic-rs", "tokio", "tokio-modbus"].contains(name))
        {
            let version = lines.next().unwrap_or_default().trim_start_matches("version = ").trim_matches('"');
            versions.push(format!("{name} {version}"));
        }
    }
    let says = |program: &str, arguments: &[&str]| {
        let output = std::process::Command::new(program).args(arguments).output().ok()?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned()).filter(|text| !text.is_empty())
    };
    let redis = says("redis-server", &["--version"]);
    versions.extend(
        redis.and_then(|text| Some(format!("redis-server {}", text.split_once("v=")?.1.split(' ').next()?))),
    );
    let modbus = says(PYTHON, &["-c", "import pymodbus; print(pymodbus.__version__)"]);
    versions.extend(modbus.map(|version| format!("pymodbus {version}")));
    versions.join(", ")
}

/// The rows as Markdown.
pub fn table(rows: &[Row]) -> String {
    let mut text =
        String::from("| what | against | goal | measured (middle half) | |\n|---|---|---|---|---|\n");
    for row in rows {
        let verdict = match row.holds() {
            None => "",
            Some(true) => "held",
            Some(false) => "missed",
        };
        let (what, against) = (&row.what, row.against);
        text += &format!("| {what} | {against} | {} | {} | {verdict} |\n", row.goal(), row.measured());
    }
    text
}

/// The README with its figures (rows `| what | against | ratio |` below `## How fast`) replaced by the new
/// ones.
pub fn quoted(readme: &str, rows: &[Row]) -> String {
    let mut is_below = false;
    let line = |line: &str| {
        is_below = if line.starts_with("## ") { line == "## How fast" } else { is_below };
        let row = rows.iter().find(|row| line.starts_with(&format!("| {} | {} | ", row.what, row.against)));
        match row.filter(|_| is_below) {
            Some(row) => {
                let measured = row.measured();
                let ratio = measured.split(" (").next().unwrap_or_default();
                format!("| {} | {} | {ratio} |\n", row.what, row.against)
            }
            None => format!("{line}\n"),
        }
    };
    readme.lines().map(line).collect()
}

/// The reasons of the missed goals, as Markdown. Rows with the same reason are grouped.
pub fn reasons(rows: &[Row]) -> String {
    let mut reasons: Vec<(&str, Vec<String>)> = Vec::new();
    for row in rows.iter().filter(|row| row.holds() == Some(false)) {
        let what = format!("{} (beside {})", row.what, row.against);
        match reasons.iter_mut().find(|(reason, _)| *reason == row.in_the_way) {
            Some((_, whats)) => whats.push(what),
            None => reasons.push((row.in_the_way, vec![what])),
        }
    }
    if reasons.is_empty() {
        return String::new();
    }
    let mut text = String::from(
        "## What is in the way\n\nOf each goal that is missed, as a profile of that row showed it:\n\n",
    );
    for (reason, whats) in reasons {
        text += &format!("- {}: {reason}\n", whats.join("; "));
    }
    text + "\n"
}

/// A ratio with three digits.
fn shown(ratio: f64) -> String {
    match ratio {
        100.0.. => format!("{ratio:.0}"),
        10.0.. => format!("{ratio:.1}"),
        _ => format!("{ratio:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_run_on_each_other_kind_of_processor_is_kept() {
        let [here, ..] = machine();
        let before = format!(
            "# Title\n\ntext\n\n{ON}{here}\n\nthe run of before\n\n{ON}Abacus\n\nkept\n\n## How to read it\n\nas it was\n"
        );
        let page = page(&[], &before);
        assert!(page.contains("## On Abacus\n\nkept\n") && !page.contains("the run of before"), "{page}");
        assert_eq!(page.matches(&format!("{ON}{here}\n")).count(), 1, "{page}");
        assert_eq!(page.matches("## How to read it").count(), 1, "{page}");
        assert_eq!(super::page(&[], &page), page, "written twice it is the same");
    }
}
