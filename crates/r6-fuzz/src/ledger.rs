//! How long each target has been fuzzed, and at which commit last: `fuzz/ledger.tsv`, shown in
//! `docs/RELIABILITY.md`.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use crate::{TARGETS, corpus};

/// The sums of all runs of one target.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Row {
    /// The target.
    pub target: String,
    /// Processor time, s.
    pub seconds: u64,
    /// Executed inputs.
    pub executions: u64,
    /// Edges of the program that were reached; the maximum of all runs.
    pub coverage: u64,
    /// Runs that ended with a finding.
    pub findings: u64,
    /// The commit of the last run, with a `+` if files were changed.
    pub code: String,
    /// The day of that commit, such as 2026-11-22.
    pub day: String,
}

/// The file with the figures.
#[must_use]
pub fn file() -> PathBuf {
    corpus::folder().join("ledger.tsv")
}

/// The page that shows them.
#[must_use]
pub fn page() -> PathBuf {
    corpus::folder().join("../docs/RELIABILITY.md")
}

const BEGIN: &str = "<!-- ledger: written by `make fuzz RECORD=1` -->\n";
const END: &str = "<!-- end of the ledger -->\n";

/// The stored rows.
#[must_use]
pub fn rows() -> Vec<Row> {
    let text = fs::read_to_string(file()).unwrap_or_default();
    text.lines().filter(|line| !line.starts_with('#')).filter_map(row).collect()
}

fn row(line: &str) -> Option<Row> {
    let mut fields = line.split('\t');
    let mut text = || fields.next().map(str::to_owned);
    let target = text()?;
    let mut number = || text()?.parse().ok();
    let (seconds, executions, coverage, findings) = (number()?, number()?, number()?, number()?);
    Some(Row {
        target,
        seconds,
        executions,
        coverage,
        findings,
        code: fields.next()?.to_owned(),
        day: fields.next()?.to_owned(),
    })
}

/// Adds a run to the stored rows.
pub fn record(run: Row) {
    let mut rows: Vec<Row> = rows().into_iter().filter(|row| row.target != run.target).collect();
    let before = self::rows().into_iter().find(|row| row.target == run.target).unwrap_or_default();
    rows.push(Row {
        seconds: before.seconds + run.seconds,
        executions: before.executions + run.executions,
        coverage: before.coverage.max(run.coverage),
        findings: before.findings + run.findings,
        ..run
    });
    rows.sort_by_key(|row| TARGETS.iter().position(|(name, _)| *name == row.target));
    let mut text = "# target\tprocessor seconds\texecutions\tcoverage\tfindings\tcode\tday\n".to_owned();
    for Row { target, seconds, executions, coverage, findings, code, day } in &rows {
        let _ = writeln!(text, "{target}\t{seconds}\t{executions}\t{coverage}\t{findings}\t{code}\t{day}");
    }
    fs::write(file(), text).unwrap_or_else(|error| panic!("{}: {error}", file().display()));
    show();
}

/// Writes the table into the page.
pub fn show() {
    let text = fs::read_to_string(page()).unwrap_or_else(|error| panic!("{}: {error}", page().display()));
    let shown = shown(&text).unwrap_or_else(|| panic!("{} has no place for the ledger", page().display()));
    fs::write(page(), shown).unwrap_or_else(|error| panic!("{}: {error}", page().display()));
}

/// The page with the current table; `None` if it has no place for the table.
#[must_use]
pub fn shown(page: &str) -> Option<String> {
    let (before, rest) = page.split_once(BEGIN)?;
    let (_, behind) = rest.split_once(END)?;
    Some(format!("{before}{BEGIN}{}{END}{behind}", table()))
}

fn table() -> String {
    let mut table =
        "| target | minutes of processor | executions | coverage (edges) | runs that found something | code of the last run |\n\
        |---|---:|---:|---:|---:|---|\n"
            .to_owned();
    for row in rows() {
        let minutes = format!("{}.{}", row.seconds / 60, row.seconds % 60 / 6);
        let executions = thousands(row.executions);
        let _ = writeln!(
            table,
            "| {} | {minutes} | {executions} | {} | {} | `{}`, {} |",
            row.target, row.coverage, row.findings, row.code, row.day
        );
    }
    table
}

/// `12 345 678`.
fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}
