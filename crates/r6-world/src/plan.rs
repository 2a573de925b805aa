//! The plan of a seed: the hosts, what they do, and which faults occur when.

mod draw;
mod drivers;
mod hall;
mod trap;

use std::time::Duration;

use r6_controller::PanelAction;
use r6_controller::scenario::Scenario;
use r6_proto::alarm::AlarmCode;
use r6_traffic::random::Random;

use crate::fault::Class;
use draw::Draw;
pub use drivers::Drivers;
pub use hall::{CallerPlan, HallPlan, Part};
pub use trap::{DWELLS, DWELLS_TEXT, TRAPS};

/// No faults occur before all clients have connected.
const CALM: Duration = Duration::from_secs(2);

/// An alarm that no manual lists.
pub const NOBODYS_ALARM: AlarmCode = AlarmCode(4711);

/// A controller, its disk and the people around it.
#[derive(Clone, Debug)]
pub struct RobotPlan {
    /// The firmware.
    pub profile: &'static str,
    /// The program that it runs.
    pub program: &'static str,
    /// Whether it has a disk.
    pub keeps: bool,
    /// The seed for its random numbers.
    pub seed: u64,
    /// The events and faults of its scenario, in the time of the world.
    pub scenario: Scenario,
    /// The actions of people at its panel.
    pub people: Vec<(Duration, PanelAction)>,
    /// When it requests a photo.
    pub photos: Vec<Duration>,
    /// How often its snapshot is read.
    pub looked_at: Duration,
    /// Whether its values are those of the machine.
    pub tells_values: bool,
    /// Whether it executes what it acknowledges.
    pub does_what_it_says: bool,
    /// Whether a list sets it in motion although no program waits for one (unit B).
    pub arms_itself: bool,
}

/// A client's program.
#[derive(Clone, Debug)]
pub struct ClientPlan {
    /// Its robot.
    pub robot: usize,
    /// The seed for its random numbers.
    pub seed: u64,
    /// The period of its subscription.
    pub every: Duration,
    /// How long it waits for replies and connections.
    pub patience: Duration,
    /// Whether it feeds the watchdog.
    pub beats: bool,
    /// Whether it moves the arm.
    pub moves: bool,
    /// Whether calls are dropped while they wait.
    pub drops: bool,
    /// The mishap of its motions.
    pub mishap: Option<Mishap>,
    /// Whether it has a subscription.
    pub watches: bool,
    /// Whether it queries values.
    pub asks: bool,
}

/// A mishap of the motions of a client's program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mishap {
    /// Each motion is stopped at a random time.
    Stopped,
    /// It streams nothing, and stops the motions of other sources.
    StopsOthers,
    /// It stops the arm as soon as its connection becomes deaf (E3).
    StopsWhenDeaf,
    /// Its own output fails, and its motion ends because of that (E7).
    OutputFails,
    /// The owner of a motion is interrupted, possibly from the first byte on (E8).
    Interrupted,
}

/// The behaviour of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Temper {
    /// It answers each request with some points.
    Honest,
    /// It is slow, or finds nothing.
    Slow,
    /// It does not answer, or answers with rubbish.
    Bad,
}

/// A camera of a robot.
#[derive(Clone, Copy, Debug)]
pub struct CameraPlan {
    /// Its robot.
    pub robot: usize,
    /// Whether the controller dials it.
    pub is_dialled: bool,
    /// Its behaviour.
    pub temper: Temper,
    /// The seed for its random numbers.
    pub seed: u64,
}

/// An event from outside, in the network, the mains or the systems.
#[expect(missing_docs, reason = "the fields are numbers in the plan")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Blow {
    /// Nothing passes between a client and its robot; packets wait until the release.
    Hold { client: usize },
    /// Packets pass again.
    Release { client: usize },
    /// The process of a controller is killed.
    Kill { robot: usize },
    /// The power of a controller fails.
    CutPower { robot: usize },
    /// The controller is started again.
    Boot { robot: usize },
    /// The process of a client is killed.
    KillClient { client: usize },
    /// The client is started again.
    StartClient { client: usize },
    /// A client stops reading, or reads again.
    Deafen { client: usize, deaf: bool },
    /// The disk is full, or has room again.
    FillDisk { robot: usize, full: bool },
    /// Another robot answers a client in place of its own, or its own answers again. The existing connections
    /// end.
    Swap { client: usize, to: Option<usize> },
    /// The process of the gateway is killed.
    KillGateway {},
    /// The gateway is started again.
    StartGateway {},
    /// The disk of the gateway takes nothing any more.
    StoreIsFull {},
    /// The disk of the gateway takes only what fits into the pages that the file has.
    StoreHasNoPages {},
    /// The disk of the gateway takes everything again.
    StoreHasRoom {},
    /// Writes to the disk of the gateway take up to half a second.
    StoreIsSlow {},
    /// They take as long as before.
    StoreIsFast {},
    /// The gateway gets no sockets.
    NoFiles {},
    /// It gets them again.
    FilesAgain {},
}

/// Everything that a seed determines.
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
    /// The events from outside, in their order.
    pub blows: Vec<(Duration, Blow)>,
    /// When all faults are over.
    pub over: Duration,
    /// The fault classes in this world.
    pub classes: Vec<Class>,
    /// The only fault class, in a world with a single one.
    pub trap: Option<Class>,
    /// How the calls of the clients drive their connections.
    pub drivers: Drivers,
    /// The gateway and its callers, in a world with one.
    pub hall: Option<HallPlan>,
}

fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

impl Plan {
    /// The plan of this seed.
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
            hall: None,
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

/// The rest of a scenario for a controller that starts at this time.
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
