//! A hall for a day: one gateway with its history, many robots, and callers who work, stop, read, read too
//! slowly, or have no right to. `make day` runs it.
//!
//! Nothing is broken here but connections, which are cut again and again. What is looked at is what grows:
//! memory, tasks, the files of the history. The robots and the network are in memory (`day/network.rs`), and
//! time is tokio's, paused: it moves when nothing else is left to do. The control data is in memory too; the
//! files of the history are real.

mod callers;
mod network;

use std::cell::Cell;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_api::gateway::Role;
use r6_client::RobotSettings;
use r6_controller::{Button, Library, PanelAction};
use r6_gateway::simulation::{self, Disk};
use r6_gateway::{AuditSettings, HistorySettings, RobotConfig, RobotName};
use r6_sim::{SimSettings, Simulation};
use tokio::time::{Instant, sleep};

use self::network::Network;

/// What the arms do all day: a move of some seconds, a pause, and back.
const WORK: &str = "\
[[step]]\ndo = \"axis-move\"\nto = [30, -3, 4, 0, 5, 0]\nspeed = 10\n\
[[step]]\ndo = \"wait\"\nseconds = 4\n\
[[step]]\ndo = \"axis-move\"\nto = [0, -1, 4, 0, 5, 0]\nspeed = 10\n\
[[step]]\ndo = \"wait\"\nseconds = 6\n";

/// How often everything is looked at.
const LOOK: Duration = Duration::from_secs(600);

/// How many entries of the audit log are kept: fewer than a day makes.
const MOST_ENTRIES: u64 = 1_000;

/// How much more memory the last quarter of the time may need than the second one: a tenth, and what the
/// control data in memory and the allocator take.
const MORE_MEMORY: (u64, u64) = (10, 16 << 20);

/// Tasks beside those of robots: those of the gateway, the callers, their connections.
const OTHER_TASKS: usize = 200;

/// Tasks for each robot, on both sides of its connection.
const TASKS_A_ROBOT: usize = 20;

thread_local! {
    static BEGAN: Cell<Option<Instant>> = const { Cell::new(None) };
}

/// The time since the day began.
fn now() -> Duration {
    BEGAN.get().map_or(Duration::ZERO, |began| began.elapsed())
}

/// How long, how many, how much.
#[derive(Clone, Debug)]
pub struct DayPlan {
    /// How many robots.
    pub robots: u16,
    /// How long it lasts.
    pub lasts: Duration,
    /// How often each robot is read.
    pub period: Duration,
    /// How much the files of the history may take, in bytes.
    pub max_bytes: u64,
    /// The seed.
    pub seed: u64,
}

/// What was seen at one look.
#[derive(Clone, Debug)]
pub struct Seen {
    /// When.
    pub at: Duration,
    /// The memory of this process, robots and callers included, in bytes; `None` where the system does not
    /// tell.
    pub memory: Option<u64>,
    /// The tasks of all.
    pub tasks: usize,
    /// What the files of the history take, in bytes.
    pub history: u64,
    /// The requests that were answered as they should be.
    pub answers: u64,
}

/// What all callers together know.
#[derive(Debug, Default)]
pub struct Notes {
    /// The requests that were answered as they should be.
    answers: u64,
    /// The bytes that were read of streams.
    streamed: u64,
    /// How often a connection to a robot was cut.
    cuts: u64,
    /// How many stops were confirmed.
    stops: u64,
    /// What was not as it should be.
    wrong: Vec<String>,
}

/// The notes, for all callers.
#[derive(Clone, Debug, Default)]
pub struct SharedNotes(Arc<Mutex<Notes>>);

impl SharedNotes {
    fn notes(&self) -> MutexGuard<'_, Notes> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wrong(&self, what: String) {
        let mut notes = self.notes();
        // The first ones say enough.
        if notes.wrong.len() < 20 {
            notes.wrong.push(format!("at {:.1} s: {what}", now().as_secs_f64()));
        }
    }
}

/// How a day was.
#[derive(Debug)]
pub struct Day {
    /// What was seen.
    pub seen: Vec<Seen>,
    /// How many files of the history were removed, because it took too much.
    pub removed: u64,
    /// How many entries the audit log got; the oldest may be gone. The rest is chained.
    pub entries: u64,
    /// The bytes that were read of streams, the connections that were cut, the stops that were confirmed.
    pub streamed: u64,
    /// How often a connection to a robot was cut.
    pub cuts: u64,
    /// How many stops were confirmed.
    pub stops: u64,
    /// What was not as it should be.
    pub wrong: Vec<String>,
}

/// Runs a day, with the history in this folder. `tell` gets what is seen at each look.
///
/// # Errors
/// The day could not be begun or ended.
pub fn run(plan: &DayPlan, folder: &Path, tell: impl FnMut(&Seen)) -> Result<Day, String> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().start_paused(true).build();
    let runtime = runtime.map_err(|error| error.to_string())?;
    runtime.block_on(async {
        BEGAN.set(Some(Instant::now()));
        let _entered = simulation::enter(now, plan.seed);
        let day = day(plan, folder, tell).await;
        BEGAN.set(None);
        day.map_err(|error| error.to_string())
    })
}

async fn day(
    plan: &DayPlan,
    folder: &Path,
    mut tell: impl FnMut(&Seen),
) -> Result<Day, Box<dyn std::error::Error>> {
    let robots = switch_on(plan).await?;
    let network = Network::new(robots.controllers().to_vec());
    let disk = Disk::new(plan.seed)?;
    let [viewer, operator] = [(Role::Viewer, "viewer"), (Role::Operator, "operator")].map(|(role, name)| {
        let token = format!("r6_{:064x}", role as u64 + 1);
        disk.add_token(&token, role, name).map(|_| token)
    });
    let (viewer, operator) = (viewer?, operator?);
    let (listener, door) = network::listener();
    let history = HistorySettings { max_bytes: plan.max_bytes, min_free: 0, ..HistorySettings::default() };
    let settings = simulation::Settings {
        address: SocketAddr::from((Ipv4Addr::LOCALHOST, r6_gateway::DEFAULT_PORT)),
        names: vec![crate::hall::gate::GATEWAY.to_owned()],
        robots: configs(plan)?,
        robot_settings: RobotSettings::default(),
        audit: Some(AuditSettings { max_entries: MOST_ENTRIES }),
        history: Some((folder.to_owned(), history)),
    };
    let running = simulation::start(&disk, listener, network.roads(), settings).await?;
    let notes = SharedNotes::default();
    let hall = callers::Callers { door, viewer, operator, robots: plan.robots, notes: notes.clone() };
    let working = hall.begin(&network);
    let mut seen = Vec::new();
    let mut bound = Bound { most: plan.max_bytes, removed: 0, oldest: None };
    while now() < plan.lasts {
        sleep(LOOK.min(plan.lasts.saturating_sub(now()))).await;
        let look = look(plan, folder, &notes, &mut bound)?;
        hall.look().await;
        tell(&look);
        seen.push(look);
    }
    drop(working);
    if let Some(more) = grown(&seen) {
        notes.wrong(more);
    }
    let entries = disk.verify().map_err(|error| format!("the audit log: {error}"))?;
    drop(running);
    robots.shutdown().await?;
    let mut notes = notes.notes();
    Ok(Day {
        seen,
        removed: bound.removed,
        entries,
        streamed: notes.streamed,
        cuts: notes.cuts,
        stops: notes.stops,
        wrong: std::mem::take(&mut notes.wrong),
    })
}

/// Switches the robots on, and starts their programs one after the other.
async fn switch_on(plan: &DayPlan) -> Result<Simulation, Box<dyn std::error::Error>> {
    let mut library = Library::default();
    library.load("work", WORK).map_err(|error| error.to_string())?;
    let settings = SimSettings { count: plan.robots, library, seed: plan.seed, ..SimSettings::default() };
    let robots = Simulation::start_in_memory(settings).await?;
    for robot in robots.controllers() {
        for action in [
            PanelAction::Press(Button::Stop),
            PanelAction::SwitchProgram("work".to_owned()),
            PanelAction::Press(Button::Start),
        ] {
            robot.operate(&action)?;
            sleep(Duration::from_millis(50)).await;
        }
    }
    Ok(robots)
}

fn name_of(robot: u16) -> String {
    format!("robot-{robot}")
}

fn configs(plan: &DayPlan) -> Result<Vec<RobotConfig>, String> {
    let config = |robot| {
        let name = RobotName::new(&name_of(robot)).ok_or("a name")?;
        Ok(RobotConfig { period: plan.period, ..RobotConfig::new(name, name_of(robot)) })
    };
    (0..plan.robots).map(config).collect()
}

/// The bound of the history.
struct Bound {
    most: u64,
    /// How often its oldest file was another one than before.
    removed: u64,
    oldest: Option<PathBuf>,
}

fn look(
    plan: &DayPlan,
    folder: &Path,
    notes: &SharedNotes,
    bound: &mut Bound,
) -> Result<Seen, Box<dyn std::error::Error>> {
    let mut files = Vec::new();
    for file in std::fs::read_dir(folder)? {
        let file = file?;
        files.push((file.path(), file.metadata()?.len()));
    }
    files.sort();
    let history = files.iter().map(|(_, bytes)| bytes).sum();
    let oldest =
        files.into_iter().map(|(path, _)| path).find(|path| path.extension().is_some_and(|of| of == "db"));
    if bound.oldest.is_some() && oldest != bound.oldest {
        bound.removed += 1;
    }
    bound.oldest = oldest;
    if history > bound.most {
        notes.wrong(format!("the history takes {history} bytes, more than {}", bound.most));
    }
    let tasks = tokio::runtime::Handle::current().metrics().num_alive_tasks();
    let most_tasks = usize::from(plan.robots) * TASKS_A_ROBOT + OTHER_TASKS;
    if tasks > most_tasks {
        notes.wrong(format!("there are {tasks} tasks, more than {most_tasks}"));
    }
    Ok(Seen { at: now(), memory: memory(), tasks, history, answers: notes.notes().answers })
}

/// The memory of this process, in bytes.
fn memory() -> Option<u64> {
    let told = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = told.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().trim_end_matches("kB").trim().parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}

/// Whether the memory grew: the last quarter of the looks beside the second one.
fn grown(seen: &[Seen]) -> Option<String> {
    let quarter = seen.len() / 4;
    let median = |of: &[Seen]| {
        let mut memory: Vec<u64> = of.iter().filter_map(|seen| seen.memory).collect();
        memory.sort_unstable();
        memory.get(memory.len() / 2).copied()
    };
    let before = median(seen.get(quarter..2 * quarter)?)?;
    let after = median(seen.get(seen.len() - quarter..)?)?;
    let (percent, flat) = MORE_MEMORY;
    let most = before + before * percent / 100 + flat;
    (after > most).then(|| format!("the memory grew from {before} to {after} bytes, more than {most}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(memory: impl Fn(u64) -> u64) -> Vec<Seen> {
        let look = |hour| Seen { at: LOOK, memory: Some(memory(hour)), tasks: 1, history: 0, answers: 0 };
        (0..24).map(look).collect()
    }

    #[test]
    fn memory_that_grows_slowly_is_found_and_the_first_hours_do_not_count() {
        assert_eq!(grown(&seen(|hour| if hour < 6 { hour << 20 } else { 500 << 20 })), None);
        assert_eq!(grown(&seen(|hour| (500 << 20) + hour * (1 << 20))), None, "within the tolerance");
        assert!(grown(&seen(|hour| (100 << 20) + hour * (4 << 20))).is_some());
    }
}
