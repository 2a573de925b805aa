//! `r6 sim`: virtual controllers for client programs.

pub mod given;
mod stdin;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

use clap::{Args, ValueEnum};
use r6_controller::{ControllerSnapshot, Level, LogEntry, RobotModel, StartState};
use r6_proto::Language;
use r6_sim::{Camera, Clock, ControllerHandle, SimSettings, Simulation};
use serde::Serialize;
use tokio::sync::broadcast;
use tokio::sync::broadcast::error::RecvError;
use tokio::task::JoinSet;

use crate::exit::{Exit, Failure};
use crate::output::queue::{LineQueue, WhenFull};
use crate::output::{self, alarm};
use crate::signals::Ending;
use crate::units;

/// The default address of `r6 sim` and `r6 up`: the port of the real controllers, on this machine only.
pub const DEFAULT_LISTEN: &str = "127.0.0.1:9760";

/// Kind and initial state of a virtual controller.
#[derive(Debug, Args)]
pub struct CellArgs {
    /// The arm: BRTIRUS0707A, 0805A, 1510A, 1820A or 2030A, GENERIC-SCARA, GENERIC-CARTESIAN, or a .toml file
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "BRTIRUS0707A")]
    model: String,
    /// The firmware: hc1, r6-host, r6-pendant, legacy, or a .toml file that changes one of them
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "hc1")]
    profile: String,
    /// The state when it is switched on
    #[arg(long, value_enum, default_value = "waiting")]
    start: Start,
    /// The program it runs: a built-in one (remote, register-move, register-follow, pick-and-place,
    /// palletise, default), or a .toml or .json file; may be given several times: the first one runs, all are
    /// there
    #[arg(long, value_name = "NAME|FILE")]
    program: Vec<String>,
    /// A camera that listens: the controller connects to it, and connects again whenever the connection is
    /// lost; 1=ADDR:PORT, several times, for cameras with a camID of their own
    #[arg(long, value_name = "[ID=]ADDR:PORT")]
    camera: Vec<Camera>,
    /// What happens during the run: people, other masters, power cuts, inputs that follow outputs, and faults
    /// of link, replies and controller; a .toml or .json file
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// How fast time passes: real, 10x (0.01x to 1000x), or max: it jumps from event to event, and waits
    /// while no client sends anything
    #[arg(long, value_name = "real|Nx|max", default_value = "real")]
    clock: Clock,
    /// Seed of random values, such as how long AddRCC takes to be acknowledged; a scenario has its own seed
    #[arg(long, default_value = "0")]
    seed: u64,
    /// Folder that keeps what survives a power cut, one file for each controller; --start then counts only
    /// for a controller without a file
    #[arg(long, value_name = "DIR")]
    state: Option<PathBuf>,
}

/// The state of a virtual controller when it is switched on.
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

/// Form and language of the log.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct LogArgs {
    /// The form of each log line
    #[arg(long, value_enum, default_value = "text")]
    log: Form,
    #[command(flatten)]
    lang: LangArg,
}

/// The language of what a virtual controller prints.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct LangArg {
    /// The language of the log
    #[arg(long, value_enum, default_value = "en")]
    lang: Lang,
}

/// The form of a log line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Form {
    /// A line for people
    #[default]
    Text,
    /// A JSON object: `event` names the event, its fields stand beside it, `text` describes it
    Json,
}

/// The language of a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Lang {
    /// English
    #[default]
    En,
    /// 简体中文 (Simplified Chinese)
    Zh,
}

impl LogArgs {
    /// Lines for people, in this language.
    pub fn text(lang: LangArg) -> Self {
        Self { log: Form::Text, lang }
    }
}

impl LangArg {
    pub fn language(self) -> Language {
        match self.lang {
            Lang::En => Language::English,
            Lang::Zh => Language::Chinese,
        }
    }
}

/// Run virtual controllers, without a screen
#[derive(Debug, Args)]
#[command(after_help = "\
The first lines name the addresses that the controllers listen on; then comes one line for each \
thing that happens. Ctrl-C ends it. Lines that are not read in time are lost: controllers do not wait for a reader.

A line on stdin does what a person or a machine in the cell would do:
  input BOARD POINT on|off    sets an input, board 0-7, point 0-31
  photo CAM                   asks the camera for a photo
  key auto|manual|stop        turns the mode key; auto, then `r6 command startButton`, runs
With several controllers it begins with the number of one: 2: input 0 3 on. The end of stdin ends \
nothing. While --state cannot be written, the log says so and nothing that changes the state is \
acknowledged; an end with an unwritten state has exit code 1. With --panel, `r6 panel` and any HTTP client do all that a person does at the machine.

Examples:
  r6 sim
  r6 sim --listen 127.0.0.1:0                   on any free port
  r6 sim --count 10 --listen 127.0.0.1:10000    ten controllers on ports 10000 to 10009
  r6 sim --profile legacy --start stopped
  r6 sim --profile my-cell.toml
  r6 sim --model GENERIC-SCARA
  r6 sim --model my-arm.toml
  r6 sim --program cell.toml                    a program of your own (docs/PROGRAMS.md)
  r6 sim --program pick-and-place --camera 127.0.0.1:9000    dials a camera that listens
  r6 sim --scenario examples/scenarios/cell.toml    what happens by itself (docs/SCENARIOS.md)
  r6 sim --clock max                            moves take no time; the same requests, the same bytes
  r6 sim --state my-cell                        counters, tools and the like survive a restart
  echo input 0 3 on | r6 sim                    input 3 is on from the start
  r6 sim --log json | jq 'select(.event == \"alarm_raised\")'
  r6 sim --lang zh                              日志用中文
  r6 sim --panel 127.0.0.1:9770                 then: r6 panel status")]
pub struct SimArgs {
    /// Where to listen, may be given several times; port 0 takes any free port
    #[arg(long, value_name = "ADDR:PORT", default_value = DEFAULT_LISTEN, value_parser = units::listen_address)]
    listen: Vec<SocketAddr>,
    #[command(flatten)]
    cell: CellArgs,
    /// How many controllers for each --listen, on ports that follow one another
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u16).range(1..))]
    count: u16,
    #[command(flatten)]
    told: LogArgs,
    /// Where to offer the panel over HTTP, which acts as the operator of the machine; port 0 takes any free
    /// port
    #[arg(long, value_name = "ADDR:PORT", value_parser = units::panel_address)]
    panel: Option<SocketAddr>,
    /// Let --panel be an address that other machines can reach: it has no login
    #[arg(long, requires = "panel")]
    panel_open: bool,
}

/// Runs the controllers until a signal ends them.
pub async fn run(args: SimArgs) -> Result<Exit, Failure> {
    let mut ending = Ending::watch()?;
    let settings = SimSettings {
        listen: args.listen,
        count: args.count,
        panel: args.panel,
        panel_open: args.panel_open,
        ..args.cell.settings()?
    };
    let simulation = start(settings).await?;
    let controllers = simulation.controllers();
    let lines = output::lines();
    let language = args.told.lang.language();
    let listening = controllers.iter().map(|controller| listening_line(controller.address(), language));
    let panel = simulation.panel().map(|address| panel_line(address, language));
    let listening: Vec<_> = listening.chain(panel).collect();
    let named = controllers.len() > 1;
    let mut logs = JoinSet::new();
    match args.told.log {
        Form::Text => lines.line(listening.join("\n")),
        Form::Json => say_where(&simulation, &lines),
    }
    for controller in controllers {
        logs.spawn(print_log(
            controller.clone(),
            controller.log_from_start(),
            named.then(|| controller.address().to_string()),
            args.told,
            lines.clone(),
        ));
    }
    stdin::listen(controllers.to_vec())?;
    ending.signalled().await;
    logs.shutdown().await;
    let kept = end(simulation).await;
    lines.flush();
    kept.map(|()| Exit::Done)
}

/// Ends the controllers. Fails if a state cannot be written.
pub async fn end(simulation: Simulation) -> Result<(), Failure> {
    simulation.shutdown().await.map_err(|error| {
        Failure::refused(error)
            .advise("the file, if there is one, has the state before: what changed since is lost")
    })
}

impl CellArgs {
    /// The name of the arm, if the model comes with r6.
    pub fn known_model(&self) -> Option<String> {
        RobotModel::named(&self.model).map(|model| model.name.to_string())
    }

    /// How fast time passes.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// The settings of one controller of this kind.
    pub fn settings(self) -> Result<SimSettings, Failure> {
        let Self { model, profile, start, program, camera, scenario, clock, seed, state } = self;
        let (library, mold) = given::library(&program)?;
        let start = match start {
            Start::Waiting => StartState::Waiting,
            Start::Stopped => StartState::Stopped,
            Start::Manual => StartState::Manual,
            Start::Auto => StartState::Auto,
        };
        Ok(SimSettings {
            profile: given::profile(&profile)?,
            model: given::model(&model)?,
            start,
            library,
            mold,
            cameras: camera,
            scenario: scenario.as_deref().map(given::scenario).transpose()?,
            clock,
            seed,
            state,
            ..SimSettings::default()
        })
    }
}

/// Starts the controllers.
pub async fn start(settings: SimSettings) -> Result<Simulation, Failure> {
    crate::limits::open_as_many_files_as_allowed();
    let simulation = Simulation::start(settings).await.map_err(Failure::usage)?;
    for controller in simulation.controllers() {
        if let Some(told) = alarm_at_start(&controller.snapshot(), controller.address()) {
            output::note(told);
        }
    }
    Ok(simulation)
}

/// The message for a controller that has an alarm as soon as it is switched on. One reason is that the first
/// step of its program cannot be carried out.
fn alarm_at_start(state: &ControllerSnapshot, address: SocketAddr) -> Option<String> {
    let code = i64::from(state.alarm);
    (code != 0).then(|| {
        format!(
            "r6: {address}: alarm {} from the start (program `{}`); {}",
            alarm::short(code),
            state.program,
            alarm::advice(code)
        )
    })
}

/// The line that names the address of a controller.
pub fn listening_line(address: SocketAddr, language: Language) -> String {
    match language {
        Language::English => format!("listening on {address}"),
        Language::Chinese => format!("监听地址 {address}"),
    }
}

/// The line that names the address of the panel.
pub fn panel_line(address: SocketAddr, language: Language) -> String {
    match language {
        Language::English => format!("panel on http://{address}"),
        Language::Chinese => format!("面板地址 http://{address}"),
    }
}

/// Prints as JSON where the controllers and the panel listen.
fn say_where(simulation: &Simulation, lines: &LineQueue) {
    for controller in simulation.controllers() {
        let address = controller.address().to_string();
        json_line(&serde_json::json!({ "event": "listening", "controller": address }), lines);
    }
    if let Some(panel) = simulation.panel() {
        json_line(&serde_json::json!({ "event": "panel", "url": format!("http://{panel}") }), lines);
    }
}

fn json_line(line: &impl Serialize, lines: &LineQueue) {
    // The line has only numbers, words and lists, so this cannot fail.
    if let Ok(text) = serde_json::to_string(line) {
        lines.push(format!("{text}\n").into_bytes(), WhenFull::DropJson);
    }
}

/// A line of the log as JSON.
#[derive(Serialize)]
struct Line<'l> {
    controller: String,
    level: Level,
    #[serde(flatten)]
    entry: &'l LogEntry,
    text: String,
}

/// Prints the events of a controller until it ends. `name` stands before each line for people.
pub async fn print_log(
    controller: ControllerHandle,
    mut log: broadcast::Receiver<Arc<LogEntry>>,
    name: Option<String>,
    told: LogArgs,
    lines: LineQueue,
) {
    let address = controller.address();
    loop {
        match (log.recv().await, told.log) {
            (Ok(entry), Form::Json) => {
                let text = entry.event.text(told.lang.language());
                let line =
                    Line { controller: address.to_string(), level: entry.level(), entry: &entry, text };
                json_line(&line, &lines);
            }
            (Ok(entry), Form::Text) => {
                let text = log_text(&entry, told.lang.language());
                match &name {
                    Some(name) => lines.line(format_args!("{name}  {text}")),
                    None => lines.line(text),
                }
            }
            (Err(RecvError::Lagged(count)), Form::Json) => {
                json_line(&serde_json::json!({ "event": "lost", "lines": count }), &lines);
            }
            (Err(RecvError::Lagged(lost)), Form::Text) => lines.lose(lost),
            (Err(RecvError::Closed), _) => return,
        }
    }
}

/// A line of a controller's log, with the seconds since it was switched on.
pub fn log_text(entry: &LogEntry, language: Language) -> String {
    format!("{:10.3} s  {}", entry.at.as_secs_f64(), entry.text(language))
}
