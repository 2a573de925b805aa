//! Runs worlds: `make sim SEEDS=1000`, or one world with all its events: `make sim SEED=7`.

use std::io::{IsTerminal, Write};
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use clap::Parser;
use r6_world::fault::{Class, Promise};
use r6_world::plan::{Drivers, Plan, TRAPS};
use r6_world::record::{Tally, Violation};
use r6_world::report::{self, Course};
use r6_world::world::{self, Outcome};

/// Every tenth seed runs twice, and must give the same result both times.
const TWICE_EVERY: u64 = 10;

/// This many seeds show every fault and every promise.
const ENOUGH_SEEDS: u64 = 1000;

/// The upper limit, which no run needs.
const MOST_SEEDS: u64 = 1_000_000_000;

/// The maximum number of reported failures.
const MOST_FAILURES: usize = 5;

/// Simulates clients, controllers, cameras and disks in one process, with faults from a seed, and checks the
/// promises (docs/SIMULATION.md).
#[derive(Parser)]
#[command(
    after_help = "Examples:\n  r6-world --seeds 1000\n  r6-world --seeds 500 --drivers all\n  r6-world --seed 7 > seed-7.log    everything that happens, some thousand lines\n\n\
    Exit codes: 0 all hold, 1 one does not, 2 a wrong argument."
)]
struct Wanted {
    /// How many seeds to run. Each seed runs three worlds: one with any faults, one with one trap, and one
    /// with a gateway.
    #[arg(long, default_value_t = ENOUGH_SEEDS, value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(..=u64::MAX - MOST_SEEDS))]
    from: u64,
    /// Run one seed only, and print all its events.
    #[arg(long, value_name = "SEED", conflicts_with_all = ["seeds", "from", "jobs", "markdown"])]
    seed: Option<u64>,
    /// How many worlds run at the same time; default: the number of cores.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=64))]
    jobs: Option<u16>,
    /// Run only worlds with a single fault class: E1 to E8, P10. `all`: each seed has one of them.
    #[arg(long, value_name = "CLASS", value_parser = trap_of)]
    trap: Option<Trap>,
    /// Make calls drive the connection badly for the others: `dropped` at any await, `slow` to be polled
    /// again, or `all` for both.
    #[arg(long, value_name = "DRIVERS", value_parser = drivers_of)]
    drivers: Option<Drivers>,
    /// Run only worlds with a gateway.
    #[arg(long, conflicts_with_all = ["trap", "drivers"])]
    gateway: bool,
    /// With one seed, print only the outcome.
    #[arg(long)]
    quiet: bool,
    /// Print the section of docs/SIMULATION.md about the last run.
    #[arg(long)]
    markdown: bool,
}

impl Wanted {
    fn drivers(&self) -> Drivers {
        self.drivers.unwrap_or_default()
    }

    /// The kind of all worlds; `None` if they are mixed.
    fn only_kind(&self) -> Option<Kind> {
        self.trap.map(Kind::Trapped).or(self.gateway.then_some(Kind::Gateway))
    }

    /// The kinds of worlds that each seed runs. Drivers are for clients of robots, so with them there are no
    /// worlds with a gateway.
    fn kinds(&self) -> Vec<Kind> {
        let mixed = [Kind::Any, Kind::Trapped(Trap::Each), Kind::Gateway];
        match self.only_kind() {
            Some(kind) => vec![kind],
            None => mixed.into_iter().take(if self.drivers.is_some() { 2 } else { 3 }).collect(),
        }
    }
}

/// What a world is.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// It has any faults.
    Any,
    /// It has a single fault class.
    Trapped(Trap),
    /// It has a gateway.
    Gateway,
}

/// The single fault class.
#[derive(Clone, Copy, Debug)]
enum Trap {
    One(Class),
    /// One class after the other, by the seed.
    Each,
}

fn trap_of(name: &str) -> Result<Trap, String> {
    if name == "all" {
        return Ok(Trap::Each);
    }
    let found = TRAPS.into_iter().find(|class| format!("{class:?}") == name);
    found.map(Trap::One).ok_or_else(|| format!("`all`, or one of {TRAPS:?}"))
}

fn drivers_of(name: &str) -> Result<Drivers, String> {
    let found = Drivers::NAMED.into_iter().find(|(named, _)| *named == name);
    found.map(|(_, drivers)| drivers).ok_or_else(|| "`dropped`, `slow` or `all`".to_owned())
}

/// The plan of a seed.
fn plan_of(seed: u64, kind: Kind, drivers: Drivers) -> Plan {
    let plan = match kind {
        Kind::Any => Plan::of(seed),
        Kind::Trapped(Trap::One(class)) => Plan::trapped(class, seed),
        Kind::Trapped(Trap::Each) => Plan::any_trap(seed),
        Kind::Gateway => return Plan::with_gateway(seed),
    };
    plan.driven_by(drivers)
}

fn main() -> ExitCode {
    let wanted = Wanted::parse();
    world::catch_panics();
    match wanted.seed {
        Some(seed) => {
            let kind = wanted.only_kind().unwrap_or(Kind::Any);
            one(plan_of(seed, kind, wanted.drivers()), !wanted.quiet)
        }
        None => many(&wanted),
    }
}

fn one(plan: Plan, aloud: bool) -> ExitCode {
    let outcome = world::run_plan(plan, aloud);
    let (seed, kind) = (outcome.seed, report::kind(outcome.trap, outcome.drivers, outcome.has_gateway));
    match report::failure(&outcome) {
        Some(told) => {
            println!("{told}");
            ExitCode::FAILURE
        }
        None => {
            println!("{}", report::table(1, &outcome.tally));
            println!("seed {seed}{kind} holds; the sum of all that happened is {:016x}", outcome.sum);
            ExitCode::SUCCESS
        }
    }
}

/// Runs a seed; every tenth seed runs twice.
fn run(seed: u64, kind: Kind, drivers: Drivers) -> Outcome {
    let plan = plan_of(seed, kind, drivers);
    let mut outcome = world::run_plan(plan.clone(), false);
    if seed.is_multiple_of(TWICE_EVERY) && outcome.violation.is_none() {
        let again = world::run_plan(plan, false);
        outcome.tally.checks[Promise::I9.index()] += 1;
        if (again.sum, &again.violation) != (outcome.sum, &None) {
            let text = format!("{:016x}, then {:016x}: {:?}", outcome.sum, again.sum, again.violation);
            outcome.violation = Some(Violation { promise: Promise::I9, at: Duration::ZERO, text });
        }
    }
    outcome
}

fn many(wanted: &Wanted) -> ExitCode {
    let begun = Instant::now();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = wanted.jobs.map_or(cores, usize::from);
    // On a terminal the progress line is overwritten. In a log each would be a new line, so there are fewer.
    let in_place = std::io::stderr().is_terminal();
    let between = Duration::from_secs(if in_place { 1 } else { 30 });
    let next = AtomicU64::new(0);
    let kinds = wanted.kinds();
    let of_a_seed = kinds.len() as u64;
    let worlds = wanted.seeds * of_a_seed;
    let (tell, told) = mpsc::channel();
    let (mut tally, mut failures, mut done) = (Tally::default(), Vec::new(), 0_u64);
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            let (next, kinds, tell) = (&next, &kinds, tell.clone());
            scope.spawn(move || {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= worlds {
                        return;
                    }
                    // The remainder is below the number of kinds.
                    let at = usize::try_from(number % of_a_seed).unwrap_or(0);
                    let (seed, kind) = (wanted.from + number / of_a_seed, kinds[at]);
                    if tell.send(run(seed, kind, wanted.drivers())).is_err() {
                        return;
                    }
                }
            });
        }
        drop(tell);
        let mut shown = Instant::now();
        for outcome in told {
            done += 1;
            tally.add(&outcome.tally);
            if let Some(failure) = report::failure(&outcome) {
                println!("{failure}");
                failures.push(report::command(&outcome));
                if failures.len() >= MOST_FAILURES {
                    next.store(worlds, Ordering::Relaxed);
                }
            }
            if shown.elapsed() > between {
                shown = Instant::now();
                let (start, end) = if in_place { ("\r", " ") } else { ("", "\n") };
                let (took, failed) = (begun.elapsed().as_secs(), failures.len());
                eprint!("{start}{done} of {worlds} worlds, {took} s, {failed} failed{end}");
                let _ = std::io::stderr().flush();
            }
        }
    });
    if in_place {
        eprintln!();
    }
    if wanted.markdown {
        let course = Course {
            from: wanted.from,
            wanted: wanted.seeds,
            is_mixed: kinds.len() == 3,
            gateways: wanted.gateway,
            drivers: wanted.drivers(),
            done,
            failed: failures.len(),
            jobs,
            took: begun.elapsed(),
        };
        println!("{}", report::section(&course, &tally));
    } else {
        println!("{}", report::table(done, &tally));
    }
    let never = world::never_seen(&tally, wanted.drivers());
    let incomplete =
        wanted.seeds >= ENOUGH_SEEDS && kinds.len() > 1 && failures.is_empty() && !never.is_empty();
    if incomplete {
        println!("never seen in {done} worlds: {}", never.join(", "));
    }
    if failures.is_empty() && !incomplete {
        let what = if done == 1 { "world holds" } else { "worlds hold" };
        let drivers = report::chosen(wanted.drivers());
        println!("{done} {what}{drivers}, in {} s", begun.elapsed().as_secs());
        return ExitCode::SUCCESS;
    }
    if failures.is_empty() {
        return ExitCode::FAILURE;
    }
    println!("failed: {}", failures.join(", "));
    ExitCode::FAILURE
}
