//! Runs a hall for a day of simulated time: `make day`.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use r6_world::day::{self, DayPlan, Seen};

/// Runs one gateway with its history, virtual robots and callers for a day of simulated time, and looks at
/// what grows: memory, tasks, files (docs/SIMULATION.md).
#[derive(Parser)]
#[command(after_help = "Examples:\n  day\n  day --robots 50 --hours 2 --period-ms 200\n\n\
    Exit codes: 0 nothing grew and everything was answered, 1 otherwise, 2 a wrong argument.")]
struct Wanted {
    /// How many robots.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u16).range(4..=1000))]
    robots: u16,
    /// How many hours of simulated time.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u64).range(1..=240))]
    hours: u64,
    /// How often each robot is read, in milliseconds.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(20..=60_000))]
    period_ms: u64,
    /// How much the files of the history may take, in MiB.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u64).range(64..=65_536))]
    history_mib: u64,
    /// The seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn main() -> ExitCode {
    let wanted = Wanted::parse();
    let plan = DayPlan {
        robots: wanted.robots,
        lasts: Duration::from_secs(wanted.hours * 3600),
        period: Duration::from_millis(wanted.period_ms),
        max_bytes: wanted.history_mib << 20,
        seed: wanted.seed,
    };
    let folder = std::env::temp_dir().join(format!("r6-day-{}", std::process::id()));
    if let Err(error) = std::fs::create_dir_all(&folder) {
        eprintln!("{}: {error}", folder.display());
        return ExitCode::FAILURE;
    }
    let begun = Instant::now();
    println!("   time  memory  tasks  history   answers   took");
    let tell = |seen: &Seen| {
        let minutes = seen.at.as_secs() / 60;
        let memory = seen.memory.map_or("-".to_owned(), |bytes| format!("{} MiB", bytes >> 20));
        let (hours, minutes, history) = (minutes / 60, minutes % 60, seen.history >> 20);
        if minutes == 0 {
            let took = begun.elapsed().as_secs();
            println!(
                "{hours:>4}:{minutes:02} {memory:>8} {:>6} {history:>4} MiB {:>9} {took:>4} s",
                seen.tasks, seen.answers
            );
        }
    };
    let day = day::run(&plan, &folder, tell);
    let _ = std::fs::remove_dir_all(&folder);
    let day = match day {
        Ok(day) => day,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::FAILURE;
        }
    };
    println!(
        "{} MB of streams read; {} cut connections; {} confirmed stops; {} entries in the audit log; the oldest \
         file of the history was another one {} times",
        day.streamed / 1_000_000,
        day.cuts,
        day.stops,
        day.entries,
        day.removed
    );
    for wrong in &day.wrong {
        println!("{wrong}");
    }
    let (hours, robots, took) = (wanted.hours, wanted.robots, begun.elapsed().as_secs());
    if day.wrong.is_empty() {
        println!(
            "{hours} h with {robots} robots: the memory is flat, and the history keeps its bound; in {took} s"
        );
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
