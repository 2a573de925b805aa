//! The hall of `r6 up --cell`: virtual robots and their twins behind one gateway.

use std::collections::{BTreeMap, BTreeSet};
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::time::Duration;

use crossterm::event;
use r6_api::gateway::Role;
use r6_controller::settings::REMOTE_MOLD;
use r6_gateway::{Panel, RobotConfig, RobotName};
use r6_proto::Language;
use r6_sim::{Clock, ControllerHandle, SimSettings, Simulation};
use tokio::sync::broadcast::error::TryRecvError;
use tokio::task::JoinSet;

use super::gateway::{Cell, CellGateway};
use super::hall_file::{self, HallFile, HallRobot};
use super::{DRAW_INTERVAL, Place, ends};
use crate::cmd::gateway::twins::Twins;
use crate::cmd::sim::{self, LangArg};
use crate::exit::{Exit, Failure};
use crate::output;
use crate::output::hall_screen::HallView;
use crate::output::screen::Screen;
use crate::signals::Ending;

/// How to run the hall.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Where to offer the gateway.
    pub gateway: Option<Place>,
    /// The folder of the gateway, if it is kept.
    pub data: Option<&'a Path>,
    /// How fast time passes for the robots of the file. Twins have the time of the world.
    pub clock: Clock,
    /// The language of the log.
    pub lang: LangArg,
    /// Whether the state is shown on a full screen.
    pub has_screen: bool,
}

/// A virtual robot that runs.
struct Running {
    name: RobotName,
    model: String,
    profile: String,
    simulation: Simulation,
}

impl Running {
    fn controller(&self) -> Option<&ControllerHandle> {
        self.simulation.controllers().first()
    }

    /// The line that names it.
    fn line(&self, language: Language) -> Option<String> {
        let Self { name, model, profile, .. } = self;
        let address = self.controller()?.address();
        Some(match language {
            Language::English => format!("{name} on {address}, {model}, profile {profile}"),
            Language::Chinese => format!("{name} 监听地址 {address}，{model}，控制器配置 {profile}"),
        })
    }
}

/// Runs the hall of this file until it is ended.
pub async fn run(path: &Path, options: Options<'_>, mut ending: Ending) -> Result<Exit, Failure> {
    let HallFile { robots, hall, library } = hall_file::read(path)?;
    crate::limits::open_as_many_files_as_allowed();
    let profiles: BTreeMap<_, _> =
        robots.iter().map(|robot| (robot.config.name.clone(), robot.settings.profile.clone())).collect();
    // Old scripts need a robot that takes remote commands.
    let takes_remote = robots.iter().find(|robot| robot.settings.mold == REMOTE_MOLD);
    let raw = takes_remote.map(|robot| robot.config.name.clone());
    let mut running = Vec::new();
    let mut configs = Vec::new();
    for robot in robots {
        let (robot, config) = start(robot, options.clock).await?;
        running.push(robot);
        configs.push(config);
    }
    let mut twins = Twins::default();
    let gateway = match options.gateway {
        Some(Place::Off) => None,
        place => {
            let avoided: BTreeSet<_> = match place {
                Some(Place::At(address)) => [address.port()].into(),
                Some(Place::Off) | None => BTreeSet::new(),
            };
            let (robots, prepared) = twins.prepare(configs, &profiles, &avoided).await?;
            // An admin, so that every page of the dashboard shows something.
            let cell = Cell { robots, raw, hall, role: Role::Admin };
            let gateway = CellGateway::start(place, cell, true, options.data).await?;
            drop(twins.commit(prepared).await);
            // A library that was kept may have other versions by now.
            if let Some(gateway) = gateway.as_ref().filter(|gateway| gateway.is_new()) {
                for (name, text) in &library {
                    gateway.store_program(name, text).await?;
                }
            }
            gateway
        }
    };
    let result = tokio::select! {
        shown = show(&running, gateway.as_ref(), options) => shown,
        () = ending.signalled() => Ok(()),
    };
    let ended = match gateway {
        Some(gateway) => gateway.end().await,
        None => Ok(()),
    };
    twins.end().await;
    for robot in running {
        sim::end(robot.simulation).await?;
    }
    result.and(ended).map(|()| Exit::Done)
}

/// Starts one robot and its panel, on free ports of this machine.
async fn start(
    HallRobot { config, settings }: HallRobot,
    clock: Clock,
) -> Result<(Running, RobotConfig), Failure> {
    let here = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let (model, profile) = (settings.model.name.to_string(), settings.profile.name.clone());
    let settings = SimSettings { listen: vec![here], panel: Some(here), clock, ..settings };
    let simulation = Simulation::start(settings).await.map_err(Failure::usage)?;
    let address = simulation.controllers().first().map(ControllerHandle::local_address);
    let panel = simulation.panel().and_then(|panel| Panel::new(panel, 1));
    let address = address.map(|address| address.to_string()).unwrap_or_default();
    let name = config.name.clone();
    Ok((Running { name, model, profile, simulation }, RobotConfig { address, panel, ..config }))
}

async fn show(
    robots: &[Running],
    gateway: Option<&CellGateway>,
    options: Options<'_>,
) -> Result<(), Failure> {
    match options.has_screen {
        true => show_screen(robots, gateway, options.lang.language()).await,
        false => {
            show_lines(robots, gateway, options.lang).await;
            Ok(())
        }
    }
}

async fn show_lines(robots: &[Running], gateway: Option<&CellGateway>, lang: LangArg) {
    let lines = output::lines();
    let language = lang.language();
    let controllers = robots.iter().filter_map(|robot| Some((robot, robot.controller()?)));
    let logs: Vec<_> = controllers
        .map(|(robot, controller)| (robot.name.to_string(), controller.clone(), controller.log_from_start()))
        .collect();
    for line in robots.iter().filter_map(|robot| robot.line(language)) {
        lines.line(line);
    }
    for line in gateway.into_iter().flat_map(|gateway| gateway.lines(language)) {
        lines.line(line);
    }
    for hint in gateway.into_iter().flat_map(|gateway| [gateway.robots_hint(), gateway.hint()]) {
        lines.line(match language {
            Language::English => format!("try: {hint}"),
            Language::Chinese => format!("可以试试：{hint}"),
        });
    }
    let mut printing = JoinSet::new();
    for (name, controller, log) in logs {
        printing.spawn(sim::print_log(
            controller,
            log,
            Some(format!("{name:14}")),
            sim::LogArgs::text(lang),
            lines.clone(),
        ));
    }
    printing.join_all().await;
}

async fn show_screen(
    robots: &[Running],
    gateway: Option<&CellGateway>,
    language: Language,
) -> Result<(), Failure> {
    let failed = |error: std::io::Error| Failure::usage(format!("the terminal cannot be drawn on: {error}"));
    let controllers: Vec<_> =
        robots.iter().filter_map(|robot| Some((robot.name.as_str(), robot.controller()?))).collect();
    let mut logs: Vec<_> =
        controllers.iter().map(|(name, controller)| (*name, controller.log_from_start())).collect();
    let title = match gateway {
        Some(gateway) => gateway.robots_text(language),
        None => output::counted(robots.len(), "robot"),
    };
    let hints = gateway.map_or_else(Vec::new, |gateway| {
        let raw = gateway.raw_hint();
        let first = [format!("open {}", gateway.link()), gateway.robots_hint(), gateway.hint()];
        first.into_iter().chain(raw).collect()
    });
    let mut view = HallView::new(title, hints);
    let mut screen = Screen::open().map_err(failed)?;
    let mut ticks = tokio::time::interval(DRAW_INTERVAL);
    loop {
        ticks.tick().await;
        for (name, log) in &mut logs {
            loop {
                match log.try_recv() {
                    Ok(line) => view.add_line(format!("{name:14} {}", sim::log_text(&line, language))),
                    Err(TryRecvError::Lagged(lost)) => view.add_line(output::lost_lines(lost)),
                    Err(TryRecvError::Empty | TryRecvError::Closed) => break,
                }
            }
        }
        let states: Vec<_> =
            controllers.iter().map(|(name, controller)| (*name, controller.snapshot())).collect();
        screen.draw_hall(&view, &states).map_err(failed)?;
        while event::poll(Duration::ZERO).map_err(failed)? {
            if ends(&event::read().map_err(failed)?) {
                return Ok(());
            }
        }
    }
}
