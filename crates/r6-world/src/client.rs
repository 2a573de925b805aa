//! The program of a client. It watches, queries, writes, moves and stops until the faults are over. Then it
//! shows that everything works again.

mod driving;
mod mishaps;
mod moving;
mod reading;
mod recovery;
mod statements;
mod writing;

use std::time::Duration;

use r6_client::{Command, Heartbeat, Reconnect, RequestError, Robot, RobotSettings};
use r6_traffic::random::Random;
use tokio::time::{sleep, timeout};

use crate::fault::{Class, Promise};
use crate::line::BEATS_EVERY;
use crate::plan::{ClientPlan, Drivers, RobotPlan};
use crate::shared::{Shared, now};
use crate::wire::{Dialler, End};

/// The maximum time of a call, whatever is broken.
const LONGEST_CALL: Duration = Duration::from_secs(60);

/// After the faults are over and the machine is restored, everything must work again within this time.
const RECOVERS_WITHIN: Duration = Duration::from_secs(45);

/// The maximum number of tasks of a client's program: its own, those of its handle, and those of its motion.
const MOST_TASKS: usize = 16;

fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

/// The data of each task of the program.
#[derive(Clone)]
struct Work {
    shared: Shared,
    index: usize,
    robot: Robot,
    plan: ClientPlan,
    random: Random,
}

/// The program of the host.
pub async fn run(shared: Shared, index: usize) -> turmoil::Result {
    let plan = shared.plan.clients[index].clone();
    shared.state().lines[index].program_ends();
    let settings = RobotSettings {
        reply_timeout: plan.patience,
        connect_timeout: plan.patience,
        heartbeat: if plan.beats { Heartbeat::Managed { every: BEATS_EVERY } } else { Heartbeat::Off },
        reconnect: Reconnect { jitter_seed: Some(plan.seed), ..Reconnect::default() },
        ..RobotSettings::default()
    };
    let robot = loop {
        let robot = format!("robot-{}", plan.robot);
        let dialler = Dialler { shared: shared.clone(), end: End::Client(index), robot, listener: None };
        match Robot::connect_with(dialler, settings.clone()).await {
            Ok(robot) => break robot,
            Err(_) => sleep(ms(300)).await,
        }
    };
    let random = Random::new(plan.seed);
    let work = Work { shared: shared.clone(), index, robot, plan, random };
    let watching = work.plan.watches.then(|| tokio::spawn(work.part(1).watch()));
    let asking = tokio::spawn(work.part(2).ask());
    let writing = tokio::spawn(work.part(3).write());
    let keeping = tokio::spawn(work.part(4).keep());
    let moving = tokio::spawn(work.part(5).move_about());
    let hasty = tokio::spawn(work.part(7).be_hasty());
    let between = if shared.plan.drivers == Drivers::AsTheyCome { Vec::new() } else { vec![8, 9] };
    let between: Vec<_> =
        between.into_iter().map(|number| tokio::spawn(work.part(number).come_between())).collect();
    for task in [asking, writing, keeping, moving, hasty] {
        task.await?;
    }
    shared.tell(format_args!("client-{index}: its work is done"));
    shared.state().lines[index].is_done = true;
    work.wait_for_turn().await;
    let begun = now();
    let well = timeout(RECOVERS_WITHIN, work.part(6).all_is_well()).await;
    let problem = match well {
        Ok(Ok(())) => None,
        Ok(Err(problem)) => Some(problem),
        Err(_) => Some(format!("not within {RECOVERS_WITHIN:?}")),
    };
    shared.check(Promise::Recovery, problem.is_none(), || {
        format!("client-{index}, since {begun:?}: {}", problem.unwrap_or_default())
    });
    watching.into_iter().chain(between).for_each(|task| task.abort());
    work.sum_up();
    shared.state().lines[index].is_well = true;
    std::future::pending().await
}

impl Work {
    fn part(&self, number: u64) -> Self {
        Self { random: Random::new(self.plan.seed.rotate_left(16) ^ number), ..self.clone() }
    }

    fn robot_plan(&self) -> &RobotPlan {
        &self.shared.plan.robots[self.plan.robot]
    }

    fn is_over(&self) -> bool {
        self.shared.is_quiet()
    }

    /// Its number among the clients of its robot.
    fn place(&self) -> usize {
        self.shared.plan.clients[..self.index].iter().filter(|other| other.robot == self.plan.robot).count()
    }

    /// Whether no other client commands the robot.
    fn is_alone(&self) -> bool {
        let clients = self.shared.plan.clients.iter().filter(|other| other.robot == self.plan.robot).count();
        let nobody_speaks = self.robot_plan().scenario.timeline.is_empty();
        clients == 1 && (nobody_speaks || self.shared.plan.trap == Some(Class::E5))
    }

    /// Waits for a call, at most for the time that any call may take.
    async fn bounded<T>(&self, what: &str, call: impl Future<Output = T>) -> T {
        match timeout(LONGEST_CALL, self.driven(call)).await {
            Ok(done) => {
                let tasks = tokio::runtime::Handle::current().metrics().num_alive_tasks();
                self.shared.check(Promise::I6, tasks <= MOST_TASKS, || {
                    format!("client-{} has {tasks} tasks", self.index)
                });
                done
            }
            Err(_) => {
                self.shared.check(Promise::NoPanic, false, || format!("client-{}: {what} hangs", self.index));
                std::future::pending().await
            }
        }
    }

    /// Like [`Self::bounded`], but if the program drops calls, it sometimes drops this one at any await.
    async fn perhaps<T>(&mut self, what: &str, call: impl Future<Output = T>) -> Option<T> {
        if self.plan.drops && self.random.strikes(0.15) {
            let patience = self.random.up_to(ms(120));
            let done = timeout(patience, self.driven(call)).await.ok();
            if done.is_none() {
                let record = &mut self.shared.state().record;
                record.tally.dropped += 1;
                record.strikes(Class::K1);
            }
            return done;
        }
        self.bounded(what, self.perhaps_dropped(call)).await
    }

    fn count<T>(&self, result: &Result<T, RequestError>) {
        let place = match result {
            Ok(_) => 0,
            Err(RequestError::Invalid(_) | RequestError::NotSent(_) | RequestError::Refused(_)) => 1,
            Err(RequestError::OutcomeUnknown(_)) => 2,
        };
        self.shared.state().record.tally.requests[place] += 1;
    }

    async fn start(&self) {
        self.shared.state().lines[self.index].starts_asked += 1;
        drop(self.bounded("a start", self.robot.command(Command::StartButton)).await);
    }

    fn sum_up(&self) {
        let quality = self.robot.link_quality();
        let mut state = self.shared.state();
        let felt = &mut state.record.tally.felt;
        felt[0] += quality.timeouts + quality.lost;
        felt[1] += quality.strays + quality.garbled;
        let at = now();
        state.record.tell(at, format_args!("client-{}: {quality}", self.index));
    }
}
