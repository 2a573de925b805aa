//! What a seed says: who is there, what they do, and what goes wrong when.

mod draw;
mod drivers;
mod trap;

use std::time::Duration;

use r6_controller::PanelAction;
use r6_controller::scenario::Scenario;
use r6_traffic::random::Random;

use crate::fault::Class;
use draw::Draw;
pub use drivers::Drivers;
pub use trap::{DWELLS, DWELLS_TEXT, TRAPS};

/// Nothing goes wrong before all have connected.
const CALM: Duration = Duration::from_secs(2);

/// An alarm that no manual has.
pub const NOBODYS_ALARM: u32 = 4711;

/// A controller, its disk and the people around it.
#[derive(Clone, Debug)]
pub struct RobotPlan {
    /// The firmware.
    pub profile: &'static str,
    /// The program that it runs.
    pub program: &'static str,
    /// Whether it has a disk.
    pub keeps: bool,
    /// The seed of what it draws.
    pub seed: u64,
    /// What its scenario does, in the time of the world.
    pub scenario: Scenario,
    /// What people do.
    pub people: Vec<(Duration, PanelAction)>,
    /// When a photo is wanted.
    pub photos: Vec<Duration>,
    /// How often somebody looks at it besides.
    pub looked_at: Duration,
    /// Whether the values that it tells are those of the machine.
    pub tells_values: bool,
    /// Whether what it acknowledges is done.
    pub does_what_it_says: bool,
    /// Whether a list sets it in motion where no program waits for one (unit B).
    pub arms_itself: bool,
}

/// A client's program.
#[derive(Clone, Debug)]
pub struct ClientPlan {
    /// Its robot.
    pub robot: usize,
    /// The seed of what it draws.
    pub seed: u64,
    /// The period of its subscription.
    pub every: Duration,
    /// How long it waits for replies and connections.
    pub patience: Duration,
    /// Whether it keeps the watchdog fed.
    pub beats: bool,
    /// Whether it moves the arm.
    pub moves: bool,
    /// Whether calls are dropped where they wait.
    pub drops: bool,
    /// What befalls its motions.
    pub mishap: Option<Mishap>,
    /// Whether it has a subscription.
    pub watches: bool,
    /// Whether it asks for values.
    pub asks: bool,
}

/// What befalls the motions of a client's program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mishap {
    /// Each is stopped, at some time.
    Stopped,
    /// It streams nothing: it stops what others have set in motion.
    StopsOthers,
    /// It stops the arm as soon as its connection has gone deaf (E3).
    StopsWhenDeaf,
    /// Its own output fails, and it ends with that (E7).
    OutputFails,
    /// Whoever owns a motion is interrupted, from the first byte on (E8).
    Interrupted,
}

/// How a camera is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Temper {
    /// It answers each request with some points.
    Honest,
    /// It takes its time, or sees nothing.
    Slow,
    /// It answers nothing, or rubbish.
    Bad,
}

/// A camera of a robot.
#[derive(Clone, Copy, Debug)]
pub struct CameraPlan {
    /// Its robot.
    pub robot: usize,
    /// Whether the controller dials it.
    pub is_dialled: bool,
    /// How it is.
    pub temper: Temper,
    /// The seed of what it draws.
    pub seed: u64,
}

/// Something that the network, the mains or the systems do.
#[expect(missing_docs, reason = "the fields are numbers in the plan")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Blow {
    /// Nothing passes between a client and its robot: it waits until that is over.
    Hold { client: usize },
    /// It passes again.
    Release { client: usize },
    /// The process of a controller is killed.
    Kill { robot: usize },
    /// The power of a controller fails.
    CutPower { robot: usize },
    /// It is started again.
    Boot { robot: usize },
    /// The process of a client is killed.
    KillClient { client: usize },
    /// It is started again.
    StartClient { client: usize },
    /// A client reads nothing, or reads again.
    Deafen { client: usize, deaf: bool },
    /// The disk is full, or has room again.
    FillDisk { robot: usize, full: bool },
    /// Another robot answers a client where its own should, or its own again; the connections that are there
    /// end.
    Swap { client: usize, to: Option<usize> },
}

/// All that a seed says.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The seed.
    pub seed: u64,
    /// The longest time that a packet takes.
    pub latency: Duration,
    /// The controllers.
    pub robots: Vec<RobotPlan>,
    /// The clients.
    pub clients: Vec<ClientPlan>,
    /// The cameras.
    pub cameras: Vec<CameraPlan>,
    /// What strikes from outside, in its order.
    pub blows: Vec<(Duration, Blow)>,
    /// When everything that goes wrong is over.
    pub over: Duration,
    /// The classes that are there.
    pub classes: Vec<Class>,
    /// In a world where nothing else goes wrong: the one class that does.
    pub trap: Option<Class>,
    /// How the calls of the clients drive their connections.
    pub drivers: Drivers,
}

fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

impl Plan {
    /// What this seed says.
    #[must_use]
    pub fn of(seed: u64) -> Self {
        let mut random = Random::new(seed ^ 0x7236_776f_726c_6421);
        let over = CALM + ms(8000) + random.up_to(ms(8000));
        let mut plan = Self {
            seed,
            latency: ms(2) + random.up_to(ms(18)),
            robots: Vec::new(),
            clients: Vec::new(),
            cameras: Vec::new(),
            blows: Vec::new(),
            over,
            classes: Vec::new(),
            trap: None,
            drivers: Drivers::AsTheyCome,
        };
        let robots = [1, 1, 1, 1, 2, 2, 2, 3, 4][random.below(9)];
        for robot in 0..robots {
            let clients = if robots > 2 { 1 } else { 1 + random.below(3) };
            let has_camera = random.strikes(0.4);
            Draw { plan: &mut plan, random: &mut random, robot, clients }.robot(has_camera);
        }
        plan.blows.sort_by_key(|(at, _)| *at);
        plan
    }
}

/// What is left of a scenario when a controller is started at this time.
#[must_use]
pub fn rest_of(scenario: &Scenario, since: Duration) -> Scenario {
    let mut rest = scenario.clone();
    rest.timeline.retain(|entry| entry.at >= since);
    rest.timeline.iter_mut().for_each(|entry| entry.at -= since);
    rest.faults.retain(|window| window.from + window.lasts.unwrap_or_default() > since);
    for window in &mut rest.faults {
        let end = window.from + window.lasts.unwrap_or_default();
        window.from = window.from.saturating_sub(since);
        window.lasts = Some(end - since - window.from);
    }
    rest
}
