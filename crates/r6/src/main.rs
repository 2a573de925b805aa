//! The command line of r6: virtual controllers, queries, commands and motion.
//!
//! This file is a table of contents. Every subcommand is one file in `cmd`; `output` lays out what users see.

mod by_gateway;
mod cmd;
mod exit;
mod hint;
mod http_client;
mod limits;
mod logs;
mod output;
mod robot;
mod signals;
mod text_file;
mod waiting;
mod words;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::error::{ContextKind, ContextValue};
use clap::parser::ValueSource;
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use r6::units;

use crate::by_gateway::ByGateway;
use crate::exit::{Exit, Failure};
use crate::logs::Usual;
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
    gateway: ByGateway,
    #[command(flatten)]
    logs: logs::LogArgs,
    #[command(subcommand)]
    subcommand: Subcommands,
}

#[derive(Debug, Subcommand)]
enum Subcommands {
    Up(cmd::up::UpArgs),
    Sim(cmd::sim::SimArgs),
    Discover(cmd::discover::DiscoverArgs),
    Status(cmd::status::StatusArgs),
    Query(cmd::query::QueryArgs),
    Watch(cmd::watch::WatchArgs),
    Command(cmd::command::CommandArgs),
    Move(cmd::r#move::MoveArgs),
    Run(cmd::run::RunArgs),
    Plot(cmd::plot::PlotArgs),
    Stop(cmd::stop::StopArgs),
    Panel(cmd::panel::PanelArgs),
    Gateway(cmd::gateway::GatewayArgs),
    Alarms(cmd::alarms::AlarmsArgs),
    History(cmd::history::HistoryArgs),
    Audit(cmd::audit::AuditArgs),
    Whoami(cmd::whoami::WhoamiArgs),
    Alarm(cmd::alarm::AlarmArgs),
    Inspect(cmd::inspect::InspectArgs),
    Completions(cmd::completions::CompletionsArgs),
    Man(cmd::man::ManArgs),
}

/// Subcommands that do not use `--robot`: their help hides it.
const OFFLINE: [&str; 9] =
    ["up", "sim", "discover", "plot", "panel", "alarm", "inspect", "completions", "man"];

/// Options that say which robot is asked, and how.
const OF_ROBOTS: [&str; 7] =
    ["robot", "type_key", "ds_id", "gateway_url", "token_file", "ca_file", "insecure_http"];

/// The whole command line, for the parser, the completions and the man pages.
fn command_line() -> clap::Command {
    let mut command = Cli::command();
    let of_robots = |argument: &&clap::Arg| OF_ROBOTS.contains(&argument.get_id().as_str());
    let of_robots: Vec<_> = command.get_arguments().filter(of_robots).cloned().collect();
    for name in OFFLINE {
        // `discover` asks robots, but not the robot of --robot.
        let hidden = of_robots.iter().filter(|argument| name != "discover" || argument.get_id() == "robot");
        let hidden: Vec<_> = hidden.map(|argument| argument.clone().hide(true)).collect();
        command = command.mut_subcommand(name, |subcommand| subcommand.args(hidden));
    }
    command
}

fn main() -> ExitCode {
    if output::begin().is_err() {
        // Without the threads that write, there is no way to report the error.
        return Exit::Usage.code();
    }
    let (ended, as_json) = match parse() {
        Ok((cli, matches)) => (start(cli, is_typed(&matches, "robot")), wants_json(&matches)),
        Err(error) => (refuse(&error), asks_for_json(std::env::args_os())),
    };
    output::ending::conclude(ended, as_json).code()
}

/// Reads the command line.
fn parse() -> Result<(Cli, ArgMatches), Box<clap::Error>> {
    let matches = command_line().try_get_matches().map_err(without_moves)?;
    Ok((Cli::from_arg_matches(&matches)?, matches))
}

/// Starts the log and runs the subcommand.
fn start(cli: Cli, robot_typed: bool) -> Result<Exit, Failure> {
    let options = cli.robot.wire_options() + &cli.gateway.options();
    hint::remember(cli.robot.address(), robot_typed, &options);
    cli.robot.remember();
    let by_gateway = cli.gateway.url().is_some();
    if robot_typed && let Some(refused) = asks_no_robot(&cli.subcommand, cli.robot.address(), by_gateway) {
        return Err(refused);
    }
    let usual = match &cli.subcommand {
        Subcommands::Up(args) if args.has_screen() => Usual::Nothing,
        Subcommands::Up(_) => Usual::Warnings,
        _ => Usual::Full,
    };
    let format = match (logs::Format::of_environment(), &cli.subcommand) {
        (Ok(format), _) => format,
        (Err(wrong), Subcommands::Gateway(_) | Subcommands::Sim(_) | Subcommands::Up(_)) => {
            return Err(wrong);
        }
        // A stop must not fail for this.
        (Err(_), _) => logs::Format::Text,
    };
    #[cfg(feature = "otel")]
    let traces = traces(&cli.subcommand)?;
    let logs = logs::begin(
        &cli.logs,
        usual,
        format,
        #[cfg(feature = "otel")]
        traces.as_ref(),
    );
    let logs = logs.map_err(|error| Failure::usage(format!("the system gives no threads: {error}")))?;
    let ended = run(cli, robot_typed);
    #[cfg(feature = "otel")]
    if let Some(traces) = traces {
        traces.end();
    }
    logs.flush();
    ended
}

/// Begins to send traces, if this subcommand has a gateway and the environment names a collector.
#[cfg(feature = "otel")]
fn traces(subcommand: &Subcommands) -> Result<Option<r6_traces::Traces>, Failure> {
    if !matches!(subcommand, Subcommands::Gateway(_) | Subcommands::Up(_)) {
        return Ok(None);
    }
    r6_gateway::traces::join_callers(r6_traces::join_caller);
    r6_traces::Traces::begin("r6-gateway").map_err(|error| Failure::usage(error.to_string()))
}

/// Why `--robot` on the command line makes no sense for this subcommand. `None` where it does.
///
/// A person who writes `r6 -r ADDR up` may think that the screen is about the robot at ADDR.
fn asks_no_robot(subcommand: &Subcommands, robot: &str, by_gateway: bool) -> Option<Failure> {
    let (name, advice) = match subcommand {
        // Here it is the name of a robot of the gateway.
        Subcommands::Panel(_) if by_gateway => return None,
        Subcommands::Panel(_) => return Some(cmd::panel::no_robot(robot)),
        Subcommands::Up(_) => (
            "up",
            format!(
                "`r6 up --listen {robot}` starts it there; `r6 -r {robot} status` shows a robot that is there"
            ),
        ),
        Subcommands::Sim(_) => {
            ("sim", format!("`r6 sim --listen {robot}` starts a virtual controller there"))
        }
        Subcommands::Discover(_) => {
            ("discover", format!("write the addresses as arguments: `r6 discover {robot}`"))
        }
        Subcommands::Plot(_) => ("plot", "leave --robot out".to_owned()),
        Subcommands::Alarm(_) => ("alarm", "leave --robot out".to_owned()),
        Subcommands::Inspect(_) => ("inspect", "leave --robot out".to_owned()),
        Subcommands::Completions(_) => ("completions", "leave --robot out".to_owned()),
        Subcommands::Man(_) => ("man", "leave --robot out".to_owned()),
        Subcommands::Status(_)
        | Subcommands::Query(_)
        | Subcommands::Watch(_)
        | Subcommands::Command(_)
        | Subcommands::Move(_)
        | Subcommands::Run(_)
        | Subcommands::Stop(_)
        // Their --robot has names.
        | Subcommands::Gateway(_)
        | Subcommands::Alarms(_)
        | Subcommands::History(_)
        | Subcommands::Audit(_)
        | Subcommands::Whoami(_) => return None,
    };
    Some(
        Failure::usage(format!("`r6 {name}` asks no robot, so --robot {robot} means nothing here"))
            .advise(advice),
    )
}

/// Prints what the parser reports: help on stdout, or an error of the command line on stderr.
fn refuse(error: &clap::Error) -> Result<Exit, Failure> {
    let text = error.render();
    if !error.use_stderr() {
        let text = if output::is_terminal() { text.ansi().to_string() } else { text.to_string() };
        output::bytes(text.as_bytes());
        return Ok(Exit::Done);
    }
    let plain = text.to_string();
    let is_coloured = output::has_colours(&std::io::stderr());
    output::note_as_it_is(&if is_coloured { text.ansi().to_string() } else { plain.clone() });
    // The first paragraph is the error, the second may be a suggestion. Usage and a pointer to the help
    // follow.
    let mut paragraphs =
        plain.split("\n\n").map(|part| part.split_whitespace().collect::<Vec<_>>().join(" "));
    let wrong = paragraphs.next().unwrap_or_default();
    let failure = Failure::usage(wrong.strip_prefix("error: ").unwrap_or(&wrong)).said();
    match paragraphs.next().as_deref().and_then(|part| part.strip_prefix("tip: ")) {
        Some(tip) => Err(failure.advise(tip)),
        None => Err(failure),
    }
}

/// Whether `--json` was given.
fn wants_json(matches: &ArgMatches) -> bool {
    let own = matches.try_get_one::<bool>("json").ok().flatten().copied().unwrap_or_default();
    own || matches.subcommand().is_some_and(|(_, matches)| wants_json(matches))
}

/// Whether `--json` is on a command line that the parser refused.
fn asks_for_json(arguments: impl Iterator<Item = OsString>) -> bool {
    arguments.skip(1).take_while(|argument| argument != "--").any(|argument| argument == "--json")
}

/// Whether an option is on the command line itself, not from a default or the environment.
fn is_typed(matches: &ArgMatches, option: &str) -> bool {
    matches.value_source(option) == Some(ValueSource::CommandLine)
}

/// Subcommands that move an arm. They are never suggested for an unknown word.
const MOVING: [&str; 2] = ["move", "run"];

/// Removes suggestions of subcommands that move the arm.
fn without_moves(mut error: clap::Error) -> Box<clap::Error> {
    let moves = |word: &String| MOVING.contains(&word.as_str());
    match error.remove(ContextKind::SuggestedSubcommand) {
        Some(ContextValue::Strings(mut words)) => {
            words.retain(|word| !moves(word));
            if !words.is_empty() {
                error.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(words));
            }
        }
        Some(ContextValue::String(word)) if !moves(&word) => {
            error.insert(ContextKind::SuggestedSubcommand, ContextValue::String(word));
        }
        Some(_) | None => {}
    }
    Box::new(error)
}

/// Runs a subcommand that asks a gateway in place of a controller.
fn run_by_gateway(cli: Cli, robot_typed: bool) -> Result<Exit, Failure> {
    let options = cli.robot.wire_options();
    if !options.is_empty() {
        return Err(Failure::usage(format!("{} is for a controller, and not for a gateway", options.trim())));
    }
    let name = robot_typed.then(|| cli.robot.address().to_owned());
    let gateway = cli.gateway.for_robot(name);
    match cli.subcommand {
        Subcommands::Status(args) => cmd::block_on(cmd::status::run_by_gateway(args, gateway)),
        Subcommands::Query(args) => cmd::block_on(cmd::query::run_by_gateway(args, gateway)),
        Subcommands::Watch(args) => cmd::block_on(cmd::watch::run_by_gateway(args, gateway)),
        Subcommands::Command(args) => cmd::block_on(cmd::command::run_by_gateway(args, gateway)),
        Subcommands::Stop(args) => cmd::block_on(cmd::stop::run_by_gateway(args, gateway)),
        Subcommands::Run(args) => cmd::block_on(cmd::run::by_gateway::run(args, gateway)),
        Subcommands::Panel(args) => cmd::block_on(cmd::panel::run_by_gateway(args, gateway)),
        Subcommands::Alarms(args) => cmd::block_on(cmd::alarms::run_by_gateway(args, gateway)),
        Subcommands::History(args) => cmd::block_on(cmd::history::run_by_gateway(args, gateway)),
        Subcommands::Audit(args) => cmd::block_on(cmd::audit::run_by_gateway(args, gateway)),
        Subcommands::Whoami(args) => cmd::block_on(cmd::whoami::run_by_gateway(args, gateway)),
        Subcommands::Move(_) => Err(Failure::usage("a single move does not go over a gateway")
            .advise("put it into a file for `run`; without --gateway-url, leases and stops of the gateway do not hold")),
        _ => Err(Failure::usage("this command does not go over a gateway")
            .advise("status, query, watch, command, run, stop, panel, alarms, history, audit and whoami do")),
    }
}

fn run(cli: Cli, robot_typed: bool) -> Result<Exit, Failure> {
    if cli.gateway.url().is_some() {
        return run_by_gateway(cli, robot_typed);
    }
    let robot = cli.robot;
    match cli.subcommand {
        Subcommands::Up(args) => cmd::block_on(cmd::up::run(args)),
        Subcommands::Sim(args) => cmd::block_on(cmd::sim::run(args)),
        Subcommands::Discover(args) => cmd::block_on(cmd::discover::run(args)),
        Subcommands::Status(args) => cmd::block_on(cmd::status::run(args, robot)),
        Subcommands::Query(args) => cmd::block_on(cmd::query::run(args, robot)),
        Subcommands::Watch(args) => cmd::block_on(cmd::watch::run(args, robot)),
        Subcommands::Command(args) => cmd::block_on(cmd::command::run(args, robot)),
        Subcommands::Move(args) => cmd::block_on(cmd::r#move::run(args, robot)),
        Subcommands::Run(args) => cmd::block_on(cmd::run::run(args, robot)),
        Subcommands::Plot(args) => cmd::plot::run(args),
        Subcommands::Stop(args) => cmd::block_on(cmd::stop::run(args, robot)),
        Subcommands::Panel(args) => cmd::block_on(cmd::panel::run(args)),
        Subcommands::Gateway(args) => cmd::gateway::run(args, robot_typed),
        Subcommands::Alarms(_) => Err(cmd::needs_gateway("alarms")),
        Subcommands::History(_) => Err(cmd::needs_gateway("history")),
        Subcommands::Audit(_) => Err(cmd::needs_gateway("audit")),
        Subcommands::Whoami(_) => Err(cmd::needs_gateway("whoami")),
        Subcommands::Alarm(args) => cmd::alarm::run(&args),
        Subcommands::Inspect(args) => cmd::inspect::run(&args),
        Subcommands::Completions(args) => cmd::completions::run(&args),
        Subcommands::Man(args) => cmd::man::run(&args),
    }
}
