//! A virtual controller, and a record of what it did.

use std::sync::Arc;
use std::time::Duration;

use r6_client::{Robot, RobotSettings};
use r6_controller::{Event, LogEntry, Program, StartState};
use r6_sim::{ControllerHandle, VirtualController};
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::TryRecvError;
use tokio::time::{Instant, sleep};

/// An event that has not happened after this time never will. The clock of these tests jumps to the next
/// event.
pub const PATIENCE: Duration = Duration::from_secs(600);

pub struct Cell {
    pub controller: VirtualController,
    pub robot: Robot,
    log: Receiver<Arc<LogEntry>>,
    lists: Vec<(usize, bool)>,
}

impl Cell {
    pub async fn new() -> Self {
        Self::of(VirtualController::builder()).await
    }

    pub async fn standing(start: StartState) -> Self {
        Self::of(VirtualController::builder().stands(start)).await
    }

    /// A controller that runs one of the programs that come with every controller.
    pub async fn running(program: &str) -> Self {
        let text = match program {
            "register-move" => include_str!("../../../r6-controller/programs/register-move.toml"),
            "pick-and-place" => include_str!("../../../r6-controller/programs/pick-and-place.toml"),
            other => panic!("{other}?"),
        };
        let program = Program::read(program, text).unwrap();
        Self::of(VirtualController::builder().program(program).unwrap()).await
    }

    async fn of(builder: r6_sim::Builder) -> Self {
        let controller = builder.start().await.unwrap();
        let log = controller.handle().log();
        let address = controller.address().to_string();
        let robot = Robot::connect(&address, RobotSettings::default()).await.unwrap();
        Self { controller, robot, log, lists: Vec::new() }
    }

    pub fn handle(&self) -> &ControllerHandle {
        self.controller.handle()
    }

    /// The lists that it has accepted so far: how many instructions each had, and whether it replaced the
    /// list before it.
    pub fn lists(&mut self) -> Vec<(usize, bool)> {
        loop {
            match self.log.try_recv() {
                Ok(line) => {
                    if let Event::ListTaken { instructions, replaced, .. } = line.event {
                        self.lists.push((instructions, replaced));
                    }
                }
                Err(TryRecvError::Empty | TryRecvError::Closed) => return self.lists.clone(),
                Err(TryRecvError::Lagged(lines)) => panic!("{lines} lines were missed"),
            }
        }
    }

    /// How far the axis that is farthest from its target is from it.
    pub fn error(&self, target: &[f64]) -> f64 {
        let axes = self.handle().snapshot().axes;
        axes.iter().zip(target).map(|(at, wanted)| (at - wanted).abs()).fold(0.0, f64::max)
    }
}

/// Looks at a machine every 10 ms while something else runs.
pub async fn look_on<T>(
    handle: &ControllerHandle,
    mut look: impl FnMut(&r6_controller::ControllerSnapshot),
    what: impl Future<Output = T>,
) -> T {
    tokio::pin!(what);
    let begun = Instant::now();
    loop {
        tokio::select! {
            biased;
            done = &mut what => return done,
            () = sleep(Duration::from_millis(10)) => look(&handle.snapshot()),
        }
        assert!(begun.elapsed() < PATIENCE, "it never ends");
    }
}
