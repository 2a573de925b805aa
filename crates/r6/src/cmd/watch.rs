//! `r6 watch`: reads values again and again.

use std::io::Write;
use std::time::{Duration, SystemTime};

use clap::Args;
use crossterm::{cursor, queue, terminal};
use r6_client::{RequestError, Robot};
use r6_proto::{Address, printable};
use tokio::time::MissedTickBehavior;

use crate::by_gateway::{ByGateway, GatewayRobot};
use crate::cmd::query;
use crate::exit::{Exit, Failure};
use crate::output;
use crate::output::problem::{self, Code};
use crate::output::readings::{self, Readings};
use crate::robot::{self, RobotArgs};
use crate::signals::Ending;
use crate::units;
use crate::words::AddressWord;

/// Read values again and again, until Ctrl-C
#[derive(Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
On a terminal one table is refreshed in place. Elsewhere there is one line for each reading, with its \
time (UTC) and the values under a heading that has their units; with --json one object. A reading that fails is reported, and watching goes on; with \
--times the exit code is then that of the last failure, mostly 3. A value that the controller does not \
have is shown as `-`, and the exit code is then 1. If stdout cannot be written, watching ends \
with exit code 1.

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
    let mut seen = Seen::default();
    robot
        .with(async |robot| {
            let source = Source::Controller(robot);
            tokio::select! {
                result = watch(&args, &source, &mut seen) => result,
                () = ending.signalled() => Ok(seen.last),
                () = output::fails() => Ok(seen.last),
            }
        })
        .await
}

/// Reads through a gateway and prints until Ctrl-C or the last of `--times`.
pub async fn run_by_gateway(args: WatchArgs, gateway: ByGateway) -> Result<Exit, Failure> {
    let mut ending = Ending::watch()?;
    let mut seen = Seen::default();
    let robot = gateway.robot().await?;
    let source = Source::Gateway(&robot);
    tokio::select! {
        result = watch(&args, &source, &mut seen) => result,
        () = ending.signalled() => Ok(seen.last),
        () = output::fails() => Ok(seen.last),
    }
}

/// Where the values come from.
enum Source<'a> {
    Controller(&'a Robot),
    Gateway(&'a GatewayRobot),
}

impl Source<'_> {
    /// The robot, as the output names it.
    fn name(&self) -> &str {
        match self {
            Self::Controller(robot) => robot.address(),
            Self::Gateway(robot) => robot.name(),
        }
    }

    /// Reads once. The failure comes with whether there is no sense in another try, if nothing was read yet.
    async fn query(&self, addresses: &[Address]) -> Result<Readings, (Failure, bool)> {
        match self {
            Self::Controller(robot) => match robot.query(addresses).await {
                Ok(result) => Ok(Readings::from(&result)),
                Err(error @ (RequestError::NotSent(_) | RequestError::Invalid(_))) => {
                    Err((error.into(), true))
                }
                Err(error) => Err((error.into(), false)),
            },
            Self::Gateway(robot) => robot.query(addresses).await.map_err(|failure| {
                // The gateway answers, and its robot may come back.
                let may_pass = failure.exit() == Exit::NoReply && failure.code() != Code::Unreachable;
                (failure, !may_pass)
            }),
        }
    }

    /// A failure after a reading, with the advice for this robot.
    fn told_of(&self, failure: Failure) -> Failure {
        match self {
            Self::Controller(robot) => robot::told_of(robot, failure),
            Self::Gateway(_) => failure,
        }
    }
}

/// The results of the readings so far.
#[derive(Default)]
struct Seen {
    readings: u64,
    failed: u64,
    /// Whether the robot ever answered.
    reached: bool,
    /// The addresses without a value that were reported.
    missing: Vec<Address>,
    /// How the last reading ended.
    last: Exit,
    /// How the last reading that did not give every value ended.
    worst: Exit,
}

async fn watch(args: &WatchArgs, robot: &Source<'_>, seen: &mut Seen) -> Result<Exit, Failure> {
    let mut view = View::of(args);
    let mut ticks = tokio::time::interval(args.every);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        ticks.tick().await;
        match robot.query(&args.addresses).await {
            Ok(result) => {
                seen.reached = true;
                view.show(robot.name(), &result);
                seen.last = query::report_missing(&result, &seen.missing);
                seen.missing.extend(readings::problems(&result).map(|(address, _)| address));
                seen.missing.sort_unstable();
                seen.missing.dedup();
            }
            // The robot never answered, so there is no robot here. A robot that answered before may come
            // back.
            Err((failure, true)) if !seen.reached => return Err(failure),
            Err((failure, _)) => {
                let failure = robot.told_of(failure);
                view.show_failure(robot.name(), &failure);
                seen.failed += 1;
                seen.last = failure.exit();
            }
        }
        seen.readings += 1;
        // A reader that does not read must not delay Ctrl-C.
        output::settled().await;
        if seen.last != Exit::Done {
            seen.worst = seen.last;
        }
        if args.times.is_some_and(|times| seen.readings >= times) {
            if seen.failed > 0 {
                output::note(format_args!("r6: {} of {} readings failed", seen.failed, seen.readings));
            }
            return Ok(seen.worst);
        }
    }
}

/// How the readings are shown.
enum View {
    Json,
    /// A table that is overwritten; the number of lines to go back up.
    Screen {
        lines: u16,
    },
    /// One line per reading, under a heading that is printed once.
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

    fn show(&mut self, robot: &str, result: &Readings) {
        match self {
            Self::Json => output::json(&readings::sample(robot, result)),
            Self::Screen { lines } => {
                let table = readings::table(result);
                let text = format!(
                    "{}, answered in {:.1} ms\n{table}\n",
                    printable(robot),
                    result.took().as_secs_f64() * 1e3
                );
                redraw(*lines, &text);
                *lines = u16::try_from(table.height() + 1).unwrap_or(u16::MAX);
            }
            Self::Lines { headed } => {
                if !*headed {
                    output::line(readings::heading_line(result));
                    *headed = true;
                }
                output::line(readings::values_line(SystemTime::now(), result));
            }
        }
    }

    fn show_failure(&mut self, robot: &str, failure: &Failure) {
        match self {
            Self::Json => {
                output::note(failure);
                let mut object = problem::object(failure);
                object["robot"] = robot.into();
                output::json(&object);
            }
            Self::Screen { lines } => {
                let text = format!("{failure}\n");
                redraw(*lines, &text);
                *lines = u16::try_from(text.lines().count()).unwrap_or(u16::MAX);
            }
            Self::Lines { .. } => output::note(failure),
        }
    }
}

/// Overwrites the last lines of the terminal.
fn redraw(lines: u16, text: &str) {
    let mut screen = Vec::new();
    // Writing to memory cannot fail.
    let _ = match lines {
        0 => Ok(()),
        lines => queue!(screen, cursor::MoveToPreviousLine(lines)),
    };
    // A line that wraps would take two lines, and the cursor would go back to the wrong one.
    let width = terminal::size().map_or(usize::MAX, |(columns, _)| usize::from(columns));
    for line in output::clean(text).lines() {
        let line: String = line.chars().take(width).collect();
        let _ = queue!(screen, terminal::Clear(terminal::ClearType::CurrentLine))
            .and_then(|()| writeln!(screen, "{line}"));
    }
    let _ = queue!(screen, terminal::Clear(terminal::ClearType::FromCursorDown));
    output::bytes(&screen);
}
