//! `r6 up`: a whole cell on this machine, with its live state.

mod demo;
mod gateway;
mod hall;
mod hall_file;

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use r6_gateway::Panel;
use r6_proto::Language;
use r6_sim::panel::DEFAULT_PORT;
use r6_sim::{ControllerHandle, SimError, SimSettings, Simulation};
use tokio::sync::broadcast::error::TryRecvError;

use self::gateway::{Cell, CellGateway};
use crate::cmd::sim::{self, CellArgs, LangArg};
use crate::exit::{Exit, Failure};
use crate::output;
use crate::output::screen::{Screen, View};
use crate::signals::Ending;
use crate::units;

/// How often the screen is drawn: smooth to the eye, and little work.
const DRAW_INTERVAL: Duration = Duration::from_millis(50);

/// The port of the real controllers, and the default port of `r6 up`.
const DEFAULT_LISTEN_PORT: u16 = 9760;

/// The options that describe one robot. The file of a hall has them for each of its robots.
const ONE_ROBOT: [&str; 12] = [
    "listen",
    "panel",
    "panel_open",
    "model",
    "profile",
    "start",
    "program",
    "camera",
    "scenario",
    "seed",
    "state",
    "demo",
];

/// Where to offer the panel or the gateway.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Off,
    At(SocketAddr),
}

fn panel_place(text: &str) -> Result<Place, String> {
    place(text, units::panel_address)
}

fn gateway_place(text: &str) -> Result<Place, String> {
    place(text, units::listen_address)
}

fn place(text: &str, read: fn(&str) -> Result<SocketAddr, String>) -> Result<Place, String> {
    match text {
        "off" => Ok(Place::Off),
        _ => read(text).map(Place::At).map_err(|wanted| format!("{wanted}; or `off`")),
    }
}

/// Start a whole virtual cell on this machine and show its live state
#[derive(Debug, Args)]
#[command(after_help = "\
On a terminal the state is shown live; q or Ctrl-C ends it. Elsewhere there is one line for each \
thing that happens.

Examples:
  r6 up
  r6 up --listen 0.0.0.0:9760                   reachable from other machines: it has no login
  r6 up --profile r6-pendant --start stopped
  r6 up --panel off --gateway off
  r6 up --cell examples/hall.toml               twelve robots, with trouble: to look at the dashboard
  r6 up --cell examples/hall.toml --data demo   the same, and tomorrow it has a yesterday

Then, in a second shell:
  r6 status
  r6 move axes 10 0 0 0 30 0 --speed 50 --wait
  r6 panel input X010 on                        what a person does at the machine")]
pub struct UpArgs {
    /// Where to listen; port 0 takes any free port
    #[arg(long, value_name = "ADDR:PORT", default_value = sim::DEFAULT_LISTEN, value_parser = units::listen_address)]
    listen: SocketAddr,
    /// Where to offer the panel over HTTP, or off [default: 127.0.0.1:9770 with --listen on port 9760 and if
    /// it is free, else any free port]
    #[arg(long, value_name = "ADDR:PORT|off", value_parser = panel_place)]
    panel: Option<Place>,
    /// Where to offer the gateway over HTTP, or off. Its raw port, for socket scripts of this machine, is
    /// beside it [default: 127.0.0.1:9780, raw port 9781, with --listen on port 9760 and if both are free,
    /// else any free ports]
    #[arg(long, value_name = "ADDR:PORT|off", value_parser = gateway_place)]
    gateway: Option<Place>,
    /// Keep what the gateway knows in this folder, also when this ends: programs, users, the history. The
    /// next start with it goes on with them. Without it, the folder of the gateway goes when this ends
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Let --panel be an address that other machines can reach: it has no login
    #[arg(long, requires = "panel")]
    panel_open: bool,
    /// A whole hall in place of one robot: a .toml file with robots, what happens to them, and shifts
    /// (docs/SIMULATOR.md). Each robot has a twin, as with `r6 gateway --twins`
    #[arg(id = "hall", long = "cell", value_name = "FILE", conflicts_with_all = ONE_ROBOT)]
    hall: Option<PathBuf>,
    /// Also start a second robot, `demo`, which runs a program from the start. `make run` does so
    #[arg(long)]
    demo: bool,
    #[command(flatten)]
    lang: LangArg,
    #[command(flatten)]
    cell: CellArgs,
}

impl UpArgs {
    /// Whether the state is shown on a full screen.
    pub fn has_screen(&self) -> bool {
        output::is_terminal()
    }
}

/// Runs the cell until it is ended.
pub async fn run(args: UpArgs) -> Result<Exit, Failure> {
    let has_screen = args.has_screen();
    let mut ending = Ending::watch()?;
    let lang = args.lang;
    if let Some(path) = &args.hall {
        let clock = args.cell.clock();
        let data = args.data.as_deref();
        let options = hall::Options { gateway: args.gateway, data, clock, lang, has_screen };
        return hall::run(path, options, ending).await;
    }
    let (place, usual_port) = (args.gateway, args.listen.port() == DEFAULT_LISTEN_PORT);
    let data = args.data.clone();
    let model = args.cell.known_model();
    let demo = match args.demo {
        true => Some(demo::start(args.cell.clock()).await?),
        false => None,
    };
    let simulation = start(args).await?;
    let panel = simulation.panel().and_then(|panel| Panel::new(panel, 1));
    let gateway = match simulation.controllers().first() {
        Some(robot) => {
            let mut cell = Cell::of_one(robot.local_address(), panel, model)?;
            if let Some(demo) = &demo {
                demo::add_to(&mut cell, demo)?;
            }
            CellGateway::start(place, cell, usual_port, data.as_deref()).await?
        }
        None => None,
    };
    let result = tokio::select! {
        shown = show(&simulation, gateway.as_ref(), has_screen, lang) => shown,
        () = ending.signalled() => Ok(()),
    };
    let ended = match gateway {
        Some(gateway) => gateway.end().await,
        None => Ok(()),
    };
    let kept = sim::end(simulation).await;
    let kept = match demo {
        Some(demo) => sim::end(demo).await.and(kept),
        None => kept,
    };
    result.and(kept).and(ended).map(|()| Exit::Done)
}

async fn show(
    simulation: &Simulation,
    gateway: Option<&CellGateway>,
    has_screen: bool,
    lang: LangArg,
) -> Result<(), Failure> {
    let Some(controller) = simulation.controllers().first() else { return Ok(()) };
    let doors = Doors { panel: simulation.panel(), gateway };
    match has_screen {
        true => show_screen(controller, doors, lang.language()).await,
        false => show_lines(controller, doors, lang).await,
    }
}

/// What is offered over HTTP.
#[derive(Clone, Copy, Debug)]
struct Doors<'a> {
    panel: Option<SocketAddr>,
    gateway: Option<&'a CellGateway>,
}

/// Starts the cell. Without `--panel`, the panel takes its usual port if that is free, else any free port.
async fn start(args: UpArgs) -> Result<Simulation, Failure> {
    let settings =
        SimSettings { listen: vec![args.listen], panel_open: args.panel_open, ..args.cell.settings()? };
    let any = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let panel = match args.panel {
        Some(Place::Off) => None,
        Some(Place::At(address)) => Some(address),
        None if args.listen.port() == DEFAULT_LISTEN_PORT => {
            let usual = SocketAddr::from((Ipv4Addr::LOCALHOST, DEFAULT_PORT));
            match Simulation::start(SimSettings { panel: Some(usual), ..settings.clone() }).await {
                Err(SimError::ListenPanel { .. }) => Some(any),
                started => return started.map_err(Failure::usage),
            }
        }
        None => Some(any),
    };
    sim::start(SimSettings { panel, ..settings }).await
}

/// Commands to try in a second shell.
fn hints(controller: &ControllerHandle, doors: Doors<'_>) -> Vec<String> {
    let address = controller.address();
    let robot =
        if address.to_string() == "127.0.0.1:9760" { String::new() } else { format!(" -r {address}") };
    let panel = doors.panel.map(|address| match address.to_string().as_str() {
        crate::hint::DEFAULT_PANEL => "r6 panel status".to_owned(),
        _ => format!("r6 panel --panel {address} status"),
    });
    // A program that takes no motions from a PC would refuse it, and be stopped.
    let motion = (controller.snapshot().program == "remote")
        .then(|| format!("r6{robot} move axes 10 0 0 0 30 0 --speed 50 --wait"));
    let commands = [Some(format!("r6{robot} status")), motion].into_iter().flatten();
    // A very low screen leaves the last ones out.
    let watch = format!("r6{robot} watch axis-0 axis-4 isMoving --every 100ms");
    let gateway = doors.gateway.map(CellGateway::hint);
    commands.chain(panel).chain(gateway).chain([watch]).collect()
}

async fn show_lines(controller: &ControllerHandle, doors: Doors<'_>, lang: LangArg) -> Result<(), Failure> {
    let log = controller.log_from_start();
    let state = controller.snapshot();
    let lines = output::lines();
    let language = lang.language();
    lines.line(sim::listening_line(controller.address(), language));
    let (name, profile, mode) = (&state.machine_name, &state.profile, state.mode);
    lines.line(match language {
        Language::English => format!("{name}, profile {profile}, mode {mode}"),
        Language::Chinese => format!("{name}，控制器配置 {profile}，模式 {}", mode.number()),
    });
    if let Some(panel) = doors.panel {
        lines.line(sim::panel_line(panel, language));
    }
    for line in doors.gateway.into_iter().flat_map(|gateway| gateway.lines(language)) {
        lines.line(line);
    }
    for hint in hints(controller, doors) {
        lines.line(match language {
            Language::English => format!("try: {hint}"),
            Language::Chinese => format!("可以试试：{hint}"),
        });
    }
    sim::print_log(controller.clone(), log, None, sim::LogArgs::text(lang), lines).await;
    Ok(())
}

async fn show_screen(
    controller: &ControllerHandle,
    doors: Doors<'_>,
    language: Language,
) -> Result<(), Failure> {
    let failed = |error: std::io::Error| Failure::usage(format!("the terminal cannot be drawn on: {error}"));
    let mut log = controller.log_from_start();
    // The page and the raw port come first: a very low screen leaves the last hints out.
    let page = doors.gateway.map(|gateway| format!("open {}", gateway.link()));
    let raw = doors.gateway.and_then(CellGateway::raw_hint);
    let hints = page.into_iter().chain(raw).chain(hints(controller, doors)).collect();
    let mut view = View::new(controller.address(), hints);
    let mut screen = Screen::open().map_err(failed)?;
    let mut ticks = tokio::time::interval(DRAW_INTERVAL);
    loop {
        ticks.tick().await;
        loop {
            match log.try_recv() {
                Ok(line) => view.add_line(sim::log_text(&line, language)),
                Err(TryRecvError::Lagged(lost)) => view.add_line(output::lost_lines(lost)),
                Err(TryRecvError::Empty | TryRecvError::Closed) => break,
            }
        }
        screen.draw(&view, &controller.snapshot()).map_err(failed)?;
        while event::poll(Duration::ZERO).map_err(failed)? {
            if ends(&event::read().map_err(failed)?) {
                return Ok(());
            }
        }
    }
}

fn ends(event: &Event) -> bool {
    let Event::Key(key) = event else { return false };
    let control_c = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
    key.kind == KeyEventKind::Press && (control_c || matches!(key.code, KeyCode::Char('q') | KeyCode::Esc))
}
