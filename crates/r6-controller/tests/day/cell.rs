//! A palletising cell that runs by itself: a camera that finds parts, pallets that come and go, a PC that reads along.
//! Used by a test for an hour, and by a bench for a day.

use std::time::Duration;

use r6_controller::io::OutputPoint;
use r6_controller::{ConnectionId, Controller, ControllerSettings, Profile, RobotModel, StartState};
use r6_proto::time::Instant;

const PROGRAM: &str = include_str!("palletise-with-camera.toml");

/// How often the PC asks, seconds.
const POLL: Duration = Duration::from_secs(10);

const QUERY: &str = r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddr":["curMode","curAlarm","isMoving","axis-0","axis-1","axis-2","world-0","world-1","world-2","counter-0","counter-2","output-0"]}"#;

/// What a cell did.
#[derive(Debug, PartialEq)]
pub struct Day {
    /// Every byte that the controller sent, one sum of them all (FNV-1a).
    pub bytes: u64,
    /// How many frames that was.
    pub frames: u64,
    /// How many parts were put on pallets.
    pub parts: u64,
    /// How many pallets were filled.
    pub pallets: u64,
    /// How often the target of counter 2 was reached.
    pub targets: u64,
    /// The alarm at the end.
    pub alarm: String,
}

struct Cell {
    controller: Controller,
    now: Instant,
    id: ConnectionId,
    random: u64,
    day: Day,
    outputs: [bool; 3],
    last_reply: String,
}

/// Lets the cell run for so long.
pub fn run(seed: u64, time: Duration) -> Day {
    let model = RobotModel::named("BRTIRUS0707A").cloned().unwrap_or_default();
    let mut settings = ControllerSettings {
        start: StartState::Auto,
        seed,
        "day".to_owned().clone_into_mold(),
        ..ControllerSettings::new(Profile::hc1(), model)
    };
    settings.library.load("day", PROGRAM).unwrap_or_else(|error| panic!("{error}"));
    let mut controller = Controller::new(settings, Instant::ORIGIN);
    let id = controller.connect(Instant::ORIGIN);
    let day = Day { bytes: 0xcbf2_9ce4_8422_2325, frames: 0, parts: 0, pallets: 0, targets: 0, alarm: String::new() };
    let mut cell =
        Cell { controller, now: Instant::ORIGIN, id, random: seed | 1, day, outputs: [false; 3], last_reply: String::new() };
    cell.work(time)
}
