//! `r6 watch`: reads values again and again.

use std::io::Write;
use std::time::Duration;

use clap::Args;
use crossterm::{cursor, queue, terminal};
use r6_client::{QueryResult, RequestError, Robot};
use r6_proto::Address;
use tokio::time::MissedTickBehavior;

use crate::exit::{Exit, Failure};
use crate::output::{self, readings};
use crate::robot::RobotArgs;
use crate::signals::Ending;
use crate::units;
use crate::words::AddressWord;

/// Read values again and again, until Ctrl-C
#[derive(Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
On a terminal one table is refreshed in place; elsewhere there is one line for each reading, with \
--json one object. A reading that fails is reported, and watching goes on; with \
--times the exit code is then that of the last failure, mostly 3.

Examples:
  r6 watch axis-0 axis-1 isMoving --every 100ms
  r6 watch world-0 world-1 world-2 --json | tee path.jsonl
  r6 watch curMode curAlarm RemoteCmdLen --times 10"
)]
pub struct WatchArgs {
    /// Query addresses, as for `r6 query`
    #[arg(value_name = "ADDRESS", required = true, value_parser = AddressWord, hide_possible_values = true)]
    addresses: Vec<Address>,
    /// Time from one reading to the next: 100ms, 1s; a number alone is seconds
    #[arg(long, value_name = "TIME", default_value = "500ms", value_parser = units::duration)]
    every: Duration,
    /// End after so many readings
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    times: Option<u64>,
    /// Print one JSON object per line
    #[arg(long)]
    json: bool,
}

/// Reads and prints until Ctrl-C or the last of `--times`.
pub async fn run(args: WatchArgs, robot: RobotArgs) -> Result<Exit, Failure> {
    let mut ending = Ending::watch()?;
    robot
        .with(async |robot| {
            tokio::select! {
                result = watch(&args, robot) => result,
                () = ending.signalled() => Ok(Exit::Done),
            }
        })
        .await
}

async fn watch(args: &WatchArgs, robot: &Robot) -> Result<Exit, Failure> {
    let mut view = View::of(args);
    let mut ticks = tokio::time::interval(args.every);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut readings = 0;
    let mut seen = false;
    let mut failed = 0_u64;
    let mut exit = Exit::Done;
    loop {
        ticks.tick().await;
        match robot.query(&args.addresses).await {
            Ok(result) => {
                seen = true;
                view.show(robot.address(), &result);
            }
            // It was never reached: there is no robot here. Later on it may come back.
            Err(error @ (RequestError::NotSent(_) | RequestError::Invalid(_))) if !seen => {
                return Err(error.into());
            }
            Err(error) => {
                let failure = Failure::from(error);
                view.show_failure(&failure);
                failed += 1;
                exit = failure.exit();
            }
        }
        readings += 1;
        if args.times.is_some_and(|times| readings >= times) {
            if failed > 0 {
                output::note(format_args!("r6: {failed} of {readings} readings failed"));
            }
            return Ok(exit);
        }
    }
}

/// How the readings are shown.
enum View {
    Json,
    /// A table in place; the number of lines to go back up.
    Screen {
        lines: u16,
    },
    /// A line each, under a heading that is printed once.
    Lines {
        headed: bool,
    },
}

impl View {
    fn of(args: &WatchArgs) -> Self {
        match (args.json, output::is_terminal()) {
            (true, _) => Self::Json,
            (false, true) => Self::Screen { lines: 0 },
            (false, false) => Self::Lines { headed: false },
        }
    }

    fn show(&mut self, robot: &str, result: &QueryResult) {
        match self {
            Self::Json => output::json(&readings::Sample::now(robot, result)),
            Self::Screen { lines } => {
                let table = readings::table(result);
                let text =
                    format!("{robot}, answered in {:.1} ms\n{table}\n", result.took().as_secs_f64() * 1e3);
                redraw(*lines, &text);
                *lines = u16::try_from(table.height() + 1).unwrap_or(u16::MAX);
            }
            Self::Lines { headed } => {
                if !*headed {
                    let names: Vec<_> =
                        result.rows().iter().map(|(address, _)| address.to_string()).collect();
                    output::line(names.join("  "));
                    *headed = true;
                }
                output::line(readings::values_line(result));
            }
        }
    }

    fn show_failure(&mut self, failure: &Failure) {
        match self {
            Self::Screen { lines } => {
                let text = format!("{failure}\n");
                redraw(*lines, &text);
                *lines = u16::try_from(text.lines().count()).unwrap_or(u16::MAX);
            }
            Self::Json | Self::Lines { .. } => output::note(failure),
        }
    }
}

/// Writes over the last lines of the terminal.
fn redraw(lines: u16, text: &str) {
    let mut screen = Vec::new();
    // Writing to memory cannot fail.
    let _ = match lines {
        0 => Ok(()),
        lines => queue!(screen, cursor::MoveToPreviousLine(lines)),
    };
    // A line that wraps would take two, and going back up would end in the wrong one.
    let width = terminal::size().map_or(usize::MAX, |(columns, _)| usize::from(columns));
    for line in output::clean(text).lines() {
        let line: String = line.chars().take(width).collect();
        let _ = queue!(screen, terminal::Clear(terminal::ClearType::CurrentLine))
            .and_then(|()| writeln!(screen, "{line}"));
    }
    let _ = queue!(screen, terminal::Clear(terminal::ClearType::FromCursorDown));
    output::bytes(&screen);
}
