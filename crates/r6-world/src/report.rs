//! The results of many seeds, as tables.

use std::fmt::Write;
use std::time::Duration;

use crate::fault::{CLASSES, Class, PROMISES};
use crate::plan::Drivers;
use crate::record::{Faults, Tally};
use crate::world::Outcome;

/// How many worlds were run, and how.
#[derive(Clone, Debug)]
pub struct Course {
    /// The first requested seed.
    pub from: u64,
    /// The number of requested seeds.
    pub wanted: u64,
    /// The number of worlds that ran to their end.
    pub done: u64,
    /// Whether each seed ran a world with any faults, one with one trap, and one with a gateway.
    pub is_mixed: bool,
    /// Whether all worlds had a gateway.
    pub gateways: bool,
    /// The drivers of the clients' calls.
    pub drivers: Drivers,
    /// The number of failed worlds.
    pub failed: usize,
    /// The number of worlds at the same time.
    pub jobs: usize,
    /// How long it took, in real time.
    pub took: Duration,
}

/// The section of `docs/SIMULATION.md` about a run, ready for that page.
#[must_use]
pub fn section(course: &Course, tally: &Tally) -> String {
    let Course { from, wanted, done, is_mixed, gateways, drivers, failed, jobs, took } = course;
    let drivers = chosen(*drivers) + if *gateways { " GATEWAY=1" } else { "" };
    let begins = if *from == 1 { String::new() } else { format!(" FROM={from}") };
    let profile = if cfg!(debug_assertions) { "dev" } else { "release" };
    let holds = if *failed == 0 { "all hold".to_owned() } else { format!("{failed} fail") };
    let mixed = if *is_mixed { " (a third of them with one trap, a third with a gateway)" } else { "" };
    let minutes = took.as_secs().div_ceil(60);
    let mut out = format!(
        "`make sim SEEDS={wanted}{begins}{drivers}` in the {profile} profile, {jobs} at a time, {minutes} minutes. Of {done} worlds{mixed} {holds}.\n\n"
    );
    out.push_str(&what_was_done(*done, tally));
    let checks = PROMISES.map(|(promise, _)| format!("{promise:?} {}", tally.checks[promise.index()]));
    let faults = CLASSES.map(|(class, ..)| {
        let Faults { drawn_in, felt_in, strikes } = tally.faults[class.index()];
        format!("{class:?} {felt_in} of {drawn_in} ({strikes})")
    });
    let _ = write!(
        out,
        "\nChecks: {}.\n\nFaults, in how many worlds they took effect of those that drew them, and how often in all: {}.\n",
        checks.join("; "),
        faults.join("; ")
    );
    out
}

/// The table of this many worlds, for a terminal.
#[must_use]
pub fn table(worlds: u64, tally: &Tally) -> String {
    let mut out = what_was_done(worlds, tally);
    out.push_str("\n| promise | what | checks |\n|---|---|---|\n");
    for (promise, what) in PROMISES {
        let _ = writeln!(out, "| {promise:?} | {what} | {} |", tally.checks[promise.index()]);
    }
    out.push_str("\n| fault | what | worlds that drew it | that felt it | strikes | one of them is |\n");
    out.push_str("|---|---|---|---|---|---|\n");
    for (class, what, one) in CLASSES {
        let Faults { drawn_in, felt_in, strikes } = tally.faults[class.index()];
        let _ = writeln!(out, "| {class:?} | {what} | {drawn_in} | {felt_in} | {strikes} | {one} |");
    }
    out
}

fn what_was_done(worlds: u64, tally: &Tally) -> String {
    let mut out = String::new();
    #[expect(clippy::cast_precision_loss, reason = "for people")]
    let hours = tally.millis as f64 / 3_600_000.0;
    let rows = [
        ("worlds", worlds.to_string()),
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
        ("calls dropped where they waited", tally.dropped.to_string()),
        ("emergency stops, other alarms", listed(&tally.alarms)),
    ];
    out.push_str("| what | how many |\n|---|---|\n");
    for (what, many) in rows {
        let _ = writeln!(out, "| {what} | {many} |");
    }
    out
}

fn listed(numbers: &[u64]) -> String {
    numbers.iter().map(u64::to_string).collect::<Vec<_>>().join(", ")
}

/// The report of a failed seed, with the command that shows all its events.
#[must_use]
pub fn failure(outcome: &Outcome) -> Option<String> {
    let violation = outcome.violation.as_ref()?;
    let mut out = format!("seed {}{}: {violation}\n", outcome.seed, kind_of(outcome));
    for line in &outcome.last {
        let short: String = line.chars().take(220).collect();
        let _ = writeln!(out, "  {short}");
    }
    let _ = writeln!(out, "the whole of it: {}", command(outcome));
    Some(out)
}

/// The command that runs only this world and shows all its events.
#[must_use]
pub fn command(outcome: &Outcome) -> String {
    format!("make sim SEED={}{}", outcome.seed, kind_of(outcome))
}

fn kind_of(outcome: &Outcome) -> String {
    kind(outcome.trap, outcome.drivers, outcome.has_gateway)
}

/// The arguments of `make sim` besides the seed.
#[must_use]
pub fn kind(trap: Option<Class>, drivers: Drivers, has_gateway: bool) -> String {
    let gateway = if has_gateway { " GATEWAY=1" } else { "" };
    trap.map_or(String::new(), |trap| format!(" TRAP={trap:?}")) + &chosen(drivers) + gateway
}

/// The argument of `make sim` for these drivers.
#[must_use]
pub fn chosen(drivers: Drivers) -> String {
    if drivers == Drivers::AsTheyCome { String::new() } else { format!(" DRIVERS={drivers}") }
}
