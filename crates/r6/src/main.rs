//! The command line of r6: virtual controllers, queries, commands and motion.
//!
//! This file is a table of contents. Every subcommand is one file in `cmd`; what people see is laid out in `output`.

mod cmd;
mod exit;
mod limits;
mod logs;
mod output;
mod recording;
mod robot;
mod signals;
mod text_file;
mod words;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use r6::units;

use crate::exit::{Exit, Failure};
use crate::robot::RobotArgs;

/// Virtual controllers, queries, commands and motion for Huacheng R6 / HC1 robots.
#[derive(Debug, Parser)]
#[command(
    name = "r6",
    version,
    max_term_width = 110,
    arg_required_else_help = true,
    after_help = exit::CODES,
    after_long_help = exit::EXAMPLES_AND_CODES
)]
struct Cli {
    #[command(flatten)]
    robot: RobotArgs,
    #[command(flatten)]
    logs: logs::LogArgs,
    #[command(subcommand)]
    subcommand: Subcommands,
}

#[derive(Debug, Subcommand)]
enum Subcommands {
    Up(cmd::up::UpArgs),
    Sim(cmd::sim::SimArgs),
    Status(cmd::status::StatusArgs),
    Query(cmd::query::QueryArgs),
    Watch(cmd::watch::WatchArgs),
    Command(cmd::command::CommandArgs),
    Move(cmd::r#move::MoveArgs),
    Run(cmd::run::RunArgs),
    Plot(cmd::plot::PlotArgs),
    Stop(cmd::stop::StopArgs),
    Panel(cmd::panel::PanelArgs),
    Alarm(cmd::alarm::AlarmArgs),
    Inspect(cmd::inspect::InspectArgs),
    Completions(cmd::completions::CompletionsArgs),
}

/// Subcommands that ask no robot: their help does not offer `--robot`.
const OFFLINE: [&str; 7] = ["up", "sim", "plot", "panel", "alarm", "inspect", "completions"];

/// The whole command line, as the parser and the completions want it.
fn command_line() -> clap::Command {
    let mut command = Cli::command();
    let robot = command.get_arguments().find(|argument| argument.get_id() == "robot").cloned();
    for (name, robot) in OFFLINE.into_iter().zip(std::iter::repeat(robot)) {
        if let Some(robot) = robot {
            command = command.mut_subcommand(name, |subcommand| subcommand.arg(robot.hide(true)));
        }
    }
    command
}

fn main() -> ExitCode {
    let cli = Cli::from_arg_matches(&command_line().get_matches()).unwrap_or_else(|error| error.exit());
    let has_screen = matches!(&cli.subcommand, Subcommands::Up(args) if args.has_screen());
    let logs = match logs::begin(&cli.logs, has_screen) {
        Ok(logs) => logs,
        Err(error) => return Failure::usage(format!("the system gives no threads: {error}")).report(),
    };
    let ended = run(cli);
    logs.flush();
    match ended {
        Ok(exit) => exit.code(),
        Err(failure) => failure.report(),
    }
}

fn run(cli: Cli) -> Result<Exit, Failure> {
    let robot = cli.robot;
    match cli.subcommand {
        Subcommands::Up(args) => cmd::block_on(cmd::up::run(args)),
        Subcommands::Sim(args) => cmd::block_on(cmd::sim::run(args)),
        Subcommands::Status(args) => cmd::block_on(cmd::status::run(args, robot)),
        Subcommands::Query(args) => cmd::block_on(cmd::query::run(args, robot)),
        Subcommands::Watch(args) => cmd::block_on(cmd::watch::run(args, robot)),
        Subcommands::Command(args) => cmd::block_on(cmd::command::run(args, robot)),
        Subcommands::Move(args) => cmd::block_on(cmd::r#move::run(args, robot)),
        Subcommands::Run(args) => cmd::block_on(cmd::run::run(args, robot)),
        Subcommands::Plot(args) => cmd::plot::run(args),
        Subcommands::Stop(args) => cmd::block_on(cmd::stop::run(args, robot)),
        Subcommands::Panel(args) => cmd::block_on(cmd::panel::run(args)),
        Subcommands::Alarm(args) => cmd::alarm::run(&args),
        Subcommands::Inspect(args) => cmd::inspect::run(&args),
        Subcommands::Completions(args) => cmd::completions::run(&args),
    }
}
