//! `r6 sim`: virtual controllers, for programs to talk to.

use std::net::SocketAddr;
use std::path::Path;

use clap::{Args, ValueEnum};
use r6_controller::{LogLine, Profile, StartState};
use r6_sim::{ControllerHandle, SimError, SimSettings, Simulation};
use tokio::sync::broadcast::error::RecvError;
use tokio::task::JoinSet;

use crate::exit::{Exit, Failure};
use crate::output;
use crate::signals::Ending;

/// What a virtual controller is and how it stands.
#[derive(Debug, Args)]
pub struct CellArgs {
    /// Where to listen, may be given several times; port 0 takes any free port
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:9760")]
    listen: Vec<SocketAddr>,
    /// The arm, by its model name
    #[arg(long, default_value = "BRTIRUS0707A")]
    model: String,
    /// The firmware: hc1, r6-host, r6-pendant, legacy, or a .toml file that changes one of them
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "hc1", value_parser = profile)]
    profile: Profile,
    /// How it stands when it is switched on
    #[arg(long, value_enum, default_value = "waiting")]
    start: Start,
    /// Seed of whatever is random
    #[arg(long, default_value = "0")]
    seed: u64,
}

/// How a virtual controller stands when it is switched on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Start {
    /// Homed, in automatic, a program waits for remote commands: ready for motion
    Waiting,
    /// In stop
    Stopped,
    /// In manual
    Manual,
    /// In automatic, not running
    Auto,
}

/// Run virtual controllers, without a screen
#[derive(Debug, Args)]
#[command(after_help = "\
The first lines name the addresses that the controllers listen on; then comes one line for each \
thing that happens. Ctrl-C ends it.

Examples:
  r6 sim
  r6 sim --listen 127.0.0.1:0                   on any free port
  r6 sim --count 10 --listen 127.0.0.1:10000    ten controllers on ports 10000 to 10009
  r6 sim --profile legacy --start stopped
  r6 sim --profile my-cell.toml")]
pub struct SimArgs {
    #[command(flatten)]
    cell: CellArgs,
    /// How many controllers for each --listen, on ports that follow one another
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u16).range(1..))]
    count: u16,
}

/// Runs the controllers until a signal ends them.
pub async fn run(args: SimArgs) -> Result<Exit, Failure> {
    let mut ending = Ending::watch()?;
    let simulation = start(args.cell, args.count).await?;
    for controller in simulation.controllers() {
        output::line(format_args!("listening on {}", controller.address()));
    }
    let named = simulation.controllers().len() > 1;
    let mut logs = JoinSet::new();
    for controller in simulation.controllers() {
        logs.spawn(print_log(controller.clone(), named));
    }
    ending.signalled().await;
    logs.shutdown().await;
    simulation.shutdown().await;
    Ok(Exit::Done)
}

/// Starts the controllers that the arguments describe.
pub async fn start(cell: CellArgs, count: u16) -> Result<Simulation, Failure> {
    let CellArgs { listen, model, profile, start, seed } = cell;
    let start = match start {
        Start::Waiting => StartState::Waiting,
        Start::Stopped => StartState::Stopped,
        Start::Manual => StartState::Manual,
        Start::Auto => StartState::Auto,
    };
    let settings = SimSettings { listen, count, profile, model, start, seed };
    Simulation::start(settings).await.map_err(|error| match &error {
        SimError::UnknownModel { .. }
        | SimError::BadCount { .. }
        | SimError::NoSuchPort { .. }
        | SimError::Listen { .. } => Failure::usage(&error),
    })
}

/// The profile of this name, or of this file.
fn profile(text: &str) -> Result<Profile, String> {
    if let Some(profile) = Profile::named(text) {
        return Ok(profile);
    }
    if Path::new(text).extension().is_some_and(|extension| extension == "toml") {
        let file =
            std::fs::read_to_string(text).map_err(|error| format!("the file cannot be read: {error}"))?;
        return Profile::from_toml(&file).map_err(|error| error.to_string());
    }
    let names = Profile::names();
    Err(match r6_proto::nearest(text, names) {
        Some(near) => format!("there is no such profile; nearest: `{near}`"),
        None => format!("there is no such profile; there are: {}, or a .toml file", names.join(", ")),
    })
}

async fn print_log(controller: ControllerHandle, named: bool) {
    let mut log = controller.log();
    loop {
        match log.recv().await {
            Ok(line) if named => output::line(format_args!("{}  {}", controller.address(), log_text(&line))),
            Ok(line) => output::line(log_text(&line)),
            Err(RecvError::Lagged(lost)) => output::line(format_args!("({lost} lines were lost)")),
            Err(RecvError::Closed) => return,
        }
    }
}

/// A line of a controller's log with its time since it was switched on.
pub fn log_text(line: &LogLine) -> String {
    format!("{:10.3} s  {line}", line.at.as_secs_f64())
}
