//! What many seeds came to, as a table.

use std::fmt::Write;

use crate::fault::{CLASSES, PROMISES};
use crate::record::Tally;
use crate::world::Outcome;

/// What was done in so many worlds.
#[must_use]
pub fn table(seeds: u64, tally: &Tally) -> String {
    let mut out = String::new();
    #[expect(clippy::cast_precision_loss, reason = "for people")]
    let hours = tally.millis as f64 / 3_600_000.0;
    let rows = [
        ("seeds", seeds.to_string()),
        ("hours of the worlds", format!("{hours:.1}")),
        ("frames to and from clients", tally.frames.to_string()),
        ("requests: answered, refused or not sent, unknown", listed(&tally.requests)),
        ("motions: to their end, otherwise", listed(&tally.motions)),
        ("instructions carried out", tally.instructions.to_string()),
        ("stops: confirmed, otherwise", listed(&tally.stops)),
        ("controllers killed, power cut", listed(&tally.restarts)),
        ("connections made anew", tally.reconnects.to_string()),
        ("time-outs and losses, frames of no use", listed(&tally.felt)),
        ("points of cameras", tally.points.to_string()),
    ];
    out.push_str("| what | how many |\n|---|---|\n");
    for (what, many) in rows {
        let _ = writeln!(out, "| {what} | {many} |");
    }
    out.push_str("\n| promise | what | checks |\n|---|---|---|\n");
    for (promise, what) in PROMISES {
        let _ = writeln!(out, "| {promise:?} | {what} | {} |", tally.checks[promise.index()]);
    }
    out.push_str("\n| fault | what | times |\n|---|---|---|\n");
    for (class, what) in CLASSES {
        let _ = writeln!(out, "| {class:?} | {what} | {} |", tally.faults[class.index()]);
    }
    out
}

fn listed(numbers: &[u64]) -> String {
    numbers.iter().map(u64::to_string).collect::<Vec<_>>().join(", ")
}

/// What is told of a seed that failed, with the one command that shows all of it.
#[must_use]
pub fn failure(outcome: &Outcome) -> Option<String> {
    let violation = outcome.violation.as_ref()?;
    let mut out = format!("seed {}: {violation}\n", outcome.seed);
    for line in &outcome.last {
        let short: String = line.chars().take(220).collect();
        let _ = writeln!(out, "  {short}");
    }
    let _ = writeln!(out, "the whole of it: make sim SEED={}", outcome.seed);
    Some(out)
}
