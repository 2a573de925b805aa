//! The program of a client: it watches, asks, writes, moves and stops, until all is quiet; then it shows that all works again.

mod moving;

use std::time::Duration;

use r6_client::{
    Address, AxisIndex, Command, Heartbeat, OperationMode, Quality, Reading, Reconnect, RegisterIndex,
    RequestError, Robot, RobotSettings, Snapshot, Unmet,
};
use r6_controller::random::Random;
use tokio::time::{sleep, timeout};

use crate::fault::{Class, Promise};
use crate::kept::look_at_disk;
use crate::plan::{ClientPlan, RobotPlan};
use crate::shared::{Shared, State, now};
use crate::wire::{Dialler, End};

/// No call takes longer, whatever is broken.
const LONGEST_CALL: Duration = Duration::from_secs(60);

/// When the faults are over and the machine is seen to, all works again within this time.
const RECOVERS_WITHIN: Duration = Duration::from_secs(45);

/// No program of a client has more tasks than these: its own, those of its handle, and those of its motion.
const MOST_TASKS: usize = 16;

/// The registers that clients write: one each that is kept, and one each that is not.
const KEPT: u16 = 860;
const WRITTEN: u16 = 880;

fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

/// What each task of the program has.
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
        heartbeat: if plan.beats { Heartbeat::Managed { every: ms(2000) } } else { Heartbeat::Off },
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
    let watching = tokio::spawn(work.part(1).watch());
    let asking = tokio::spawn(work.part(2).ask());
    let writing = tokio::spawn(work.part(3).write());
    let keeping = tokio::spawn(work.part(4).keep());
    let moving = tokio::spawn(work.part(5).move_about());
    let hasty = tokio::spawn(work.part(7).be_hasty());
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
    watching.abort();
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

    /// Whether nobody else commands the robot.
    fn is_alone(&self) -> bool {
        let clients = self.shared.plan.clients.iter().filter(|other| other.robot == self.plan.robot).count();
        clients == 1 && self.robot_plan().scenario.timeline.is_empty()
    }

    /// Waits for a call, but no longer than any may take.
    async fn bounded<T>(&self, what: &str, call: impl Future<Output = T>) -> T {
        match timeout(LONGEST_CALL, call).await {
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

    /// The same; where its program is so, the call is dropped now and then, wherever it waits.
    async fn perhaps<T>(&mut self, what: &str, call: impl Future<Output = T>) -> Option<T> {
        if self.plan.drops && self.random.strikes(0.15) {
            let patience = self.random.up_to(ms(120));
            let done = timeout(patience, call).await.ok();
            if done.is_none() {
                let record = &mut self.shared.state().record;
                record.tally.dropped += 1;
                record.strikes(Class::K1);
            }
            return done;
        }
        Some(self.bounded(what, call).await)
    }

    fn count<T>(&self, result: &Result<T, RequestError>) {
        let place = match result {
            Ok(_) => 0,
            Err(RequestError::NotSent(_) | RequestError::Refused(_)) => 1,
            Err(RequestError::OutcomeUnknown(_)) => 2,
        };
        self.shared.state().record.tally.requests[place] += 1;
    }

    async fn watch(self) {
        let addresses: Vec<_> = [Address::CurMode, Address::CurAlarm, Address::RemoteCmdLen]
            .into_iter()
            .chain(AxisIndex::ALL.into_iter().take(3).map(Address::Axis))
            .collect();
        let Ok(mut subscription) = self.robot.subscribe(&addresses, self.plan.every) else { return };
        loop {
            let news = timeout(self.plan.every * 2, subscription.next()).await;
            match news {
                Ok(Some(snapshot)) => self.check(&snapshot),
                Ok(None) => return,
                Err(_) => self.check(&subscription.latest()),
            }
        }
    }

    /// Whatever is shown has an age and a quality; what is shown as fresh came over the wire, and is what the machine was.
    fn check(&self, snapshot: &Snapshot) {
        let at = now();
        let mut state = self.shared.state();
        let State { record, lines, floors, .. } = &mut *state;
        let liveness = self.robot.link_quality().state;
        for value in snapshot.values() {
            let fits = match value.quality {
                Quality::Fresh => {
                    value.reading.is_some() && value.age.is_some_and(|age| age <= self.plan.every + ms(1000))
                }
                Quality::Stale | Quality::Dead => value.reading.is_some() && value.age.is_some(),
                Quality::NotRead => value.reading.is_none() && value.age.is_none(),
                Quality::Unsupported | Quality::Unreadable(_) => value.reading.is_none(),
            };
            record.check(Promise::I5, at, fits, || format!("client-{}: {value:?}, {liveness:?}", self.index));
            let (Quality::Fresh, Some(reading), Some(age)) = (&value.quality, &value.reading, value.age)
            else {
                continue;
            };
            lines[self.index].delivered((value.address, reading), at.saturating_sub(age), at, record);
            let was = floors[self.plan.robot].was(value.address, reading, at.saturating_sub(age), at);
            if let Some(was) = was.filter(|_| self.robot_plan().tells_values) {
                record.check(Promise::I10, at, was, || {
                    format!(
                        "client-{}: {} is {reading} they say, {age:?} old, and was not",
                        self.index, value.address
                    )
                });
            }
        }
    }

    /// Asks for values, other ones each time.
    async fn ask(mut self) {
        let mut round: usize = 0;
        while !self.is_over() {
            let first = round % 3;
            let asked: Vec<_> = AxisIndex::ALL
                .into_iter()
                .skip(first)
                .take(3)
                .map(Address::Axis)
                .chain([Address::CurMode])
                .collect();
            let begun = now();
            let robot = self.robot.clone();
            if let Some(read) = self.perhaps("a query", robot.query(&asked)).await {
                self.count(&read);
                if let Ok(read) = read {
                    self.check_read(read.rows(), begun);
                }
            }
            round += 1;
            sleep(ms(90) + self.random.up_to(ms(200))).await;
        }
    }

    fn check_read(&self, rows: &[(Address, Result<Reading, r6_client::NoReading>)], begun: Duration) {
        let at = now();
        let mut state = self.shared.state();
        let State { record, lines, floors, .. } = &mut *state;
        for (address, reading) in rows {
            let Ok(reading) = reading else { continue };
            lines[self.index].delivered((*address, reading), begun, at, record);
            let was = floors[self.plan.robot].was(*address, reading, begun, at);
            if let Some(was) = was.filter(|_| self.robot_plan().tells_values) {
                record.check(Promise::I10, at, was, || {
                    format!("client-{}: {address} was not {reading}", self.index)
                });
            }
        }
    }

    /// A value that nobody else writes, and that no client writes twice.
    fn next_value(&self) -> i64 {
        let mut state = self.shared.state();
        let line = &mut state.lines[self.index];
        line.next_value += 1;
        i64::try_from(self.index).unwrap_or(0) * 1_000_000 + 1_000_000 + line.next_value
    }

    async fn write_value(&mut self, first: u16, savable: bool) {
        let number = first + u16::try_from(self.index).unwrap_or(0);
        let Some(register) = RegisterIndex::new(number) else { return };
        let value = self.next_value();
        if savable {
            self.shared.state().floors[self.plan.robot].kept.entry(register.number()).or_default().sent =
                value;
        }
        let begun = now();
        let robot = self.robot.clone();
        let command = robot.command(Command::RewriteData { register, savable, value });
        let Some(result) = self.perhaps("a command", command).await else { return };
        self.count(&result);
        let at = now();
        let says_truly = self.robot_plan().does_what_it_says;
        {
            let mut state = self.shared.state();
            let State { record, lines, floors, disks, .. } = &mut *state;
            let line = &mut lines[self.index];
            let times = line.times_sent(value);
            let holds = match &result {
                Err(RequestError::NotSent(_)) => times == 0,
                Ok(_) | Err(RequestError::Refused(_)) => times == 1,
                // It may have left in part.
                Err(RequestError::OutcomeUnknown(_)) => times <= 1,
            };
            record.check(Promise::Once, at, holds, || {
                format!("{value} left {times} times, and they say {result:?}")
            });
            if result.is_ok() {
                line.answered(value, begun, at, record);
                if savable && says_truly {
                    let number = register.number();
                    floors[self.plan.robot].kept.entry(number).or_default().acknowledged = value;
                    if self.robot_plan().keeps {
                        look_at_disk(&disks[self.plan.robot], (number, value), at, record);
                    }
                }
            }
        }
        if result.is_err() {
            // After a reconnect somebody has to look before a command leaves.
            let robot = self.robot.clone();
            drop(self.bounded("a look", robot.query(&[Address::CurMode, Address::CurAlarm])).await);
        }
    }

    async fn write(mut self) {
        while !self.is_over() {
            self.write_value(WRITTEN, false).await;
            sleep(ms(100) + self.random.up_to(ms(300))).await;
        }
    }

    async fn keep(mut self) {
        while !self.is_over() {
            self.write_value(KEPT, true).await;
            sleep(ms(200) + self.random.up_to(ms(500))).await;
        }
    }

    /// Waits until all programs of this robot have done their work, and those before it are well.
    async fn wait_for_turn(&self) {
        loop {
            let my_turn = {
                let state = self.shared.state();
                let mut others = self.shared.plan.clients.iter().zip(&state.lines).enumerate();
                state.floors[self.plan.robot].is_seen_to
                    && others.all(|(number, (plan, line))| {
                        plan.robot != self.plan.robot
                            || (line.is_done && (number >= self.index || line.is_well))
                    })
            };
            if my_turn {
                return;
            }
            sleep(ms(20)).await;
        }
    }

    /// The faults are over and somebody has seen to the machine: a query, a command, a motion and a stop succeed on the handle that was there
    /// all the time.
    async fn all_is_well(mut self) -> Result<(), String> {
        self.make_ready().await?;
        let register = RegisterIndex::new(WRITTEN).ok_or("no register")?;
        let value = self.next_value();
        let written = self.robot.command(Command::RewriteData { register, savable: false, value }).await;
        written.map_err(|error| format!("a command: {error}"))?;
        self.move_to_the_end().await?;
        let report = self.robot.stop().await.map_err(|error| format!("a stop: {error}"))?;
        if report.confirmed { Ok(()) } else { Err(format!("a stop: {report}")) }
    }

    /// Brings the machine to where it takes motions, by what a program may do.
    async fn make_ready(&mut self) -> Result<(), String> {
        let mut last = String::new();
        // A person needs about a second to see to it.
        for _ in 0..60 {
            sleep(ms(250)).await;
            let status = match self.robot.status().await {
                Ok(status) => status,
                Err(error) => {
                    last = error.to_string();
                    continue;
                }
            };
            let unmet = status.unmet();
            let Some(first) = unmet.first() else { return Ok(()) };
            last = format!("{unmet:?}");
            match first {
                Unmet::LeftoverList { .. } => drop(self.robot.clear_list().await),
                Unmet::Mode { found: OperationMode::Auto } => self.start().await,
                Unmet::Alarm { .. } => drop(self.robot.command(Command::ClearAlarm).await),
                Unmet::Mode { .. } | Unmet::NotHomed | Unmet::Moving | Unmet::Unknown { .. } => {}
            }
        }
        Err(format!("never ready: {last}"))
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
