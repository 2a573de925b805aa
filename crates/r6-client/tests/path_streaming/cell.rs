//! A controller, a client, and a record of what they did.

use r6_controller::Event;
use std::sync::Arc;
use std::time::Duration;

use r6_client::units::{AxisPosition, Percent};
use r6_client::{Motion, Robot, RobotSettings};
use r6_controller::{LogEntry, Profile, Scenario};
use r6_sim::{Clock, ControllerHandle, VirtualController};
use tokio::sync::broadcast::{Receiver, error::TryRecvError};

/// An event that has not happened after this time never will.
pub const PATIENCE: Duration = Duration::from_secs(600);

pub struct Cell {
    pub controller: VirtualController,
    pub robot: Robot,
    log: Receiver<Arc<LogEntry>>,
    lists: Vec<(usize, bool)>,
}

impl Cell {
    pub async fn new(profile: Profile, clock: Clock) -> Self {
        Self::with(profile, clock, "", RobotSettings::default()).await
    }

    pub async fn with(profile: Profile, clock: Clock, scenario: &str, settings: RobotSettings) -> Self {
        let builder = VirtualController::builder().profile(profile).clock(clock);
        let controller = builder.scenario(Scenario::read(scenario).unwrap()).start().await.unwrap();
        let robot = Robot::connect(&controller.address().to_string(), settings).await.unwrap();
        let log = controller.handle().log();
        Self { controller, robot, log, lists: Vec::new() }
    }

    pub fn handle(&self) -> &ControllerHandle {
        self.controller.handle()
    }

    /// All lists that the controller has accepted: how many instructions, and whether they replaced the list.
    pub fn lists(&mut self) -> &[(usize, bool)] {
        loop {
            match self.log.try_recv() {
                Ok(line) => {
                    if let Event::ListTaken { instructions, replaced, .. } = line.event {
                        self.lists.push((instructions, replaced));
                    }
                }
                Err(TryRecvError::Empty | TryRecvError::Closed) => return &self.lists,
                Err(TryRecvError::Lagged(lines)) => panic!("{lines} lines were missed"),
            }
        }
    }

    /// The total number of instructions that the controller has accepted.
    pub fn taken(&mut self) -> usize {
        self.lists().iter().map(|(count, _)| count).sum()
    }

    /// How far the axis that is farthest from its target is from it.
    pub fn error(&self, target: &[f64; 6]) -> f64 {
        let axes = self.handle().snapshot().axes;
        axes.iter().zip(target).map(|(at, wanted)| (at - wanted).abs()).fold(0.0, f64::max)
    }
}

/// Waits with a time limit.
pub async fn soon<T>(what: impl Future<Output = T>) -> T {
    tokio::time::timeout(PATIENCE, what).await.expect("it never happened")
}

pub fn percent(speed: f64) -> Percent {
    Percent::new(speed).unwrap()
}

/// A wave: every axis sways with its own period, so that no two points are the same.
pub fn wave(points: u32) -> Vec<[f64; 6]> {
    (1..=points)
        .map(|n| {
            let t = f64::from(n) / 12.0;
            [40.0, 15.0, 20.0, 30.0, 25.0, 60.0].map(|size| size * (t / (1.0 + size / 40.0)).sin())
        })
        .collect()
}

/// Moves through these points with rounded corners.
pub fn through(points: &[[f64; 6]], speed: f64, blend: u8) -> Motion {
    points.iter().fold(Motion::new(), |motion, point| {
        motion.axis_move(AxisPosition::degrees(*point), percent(speed)).blend(blend)
    })
}

pub fn profile(name: &str) -> Profile {
    Profile::named(name).unwrap()
}
