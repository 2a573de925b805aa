//! One world from its start to its end.

use std::cell::RefCell;
use std::time::{Duration, SystemTime};

use r6_gateway::simulation::Fullness;

use crate::disk::{MOST_BYTES, MOST_FILES};
use crate::fault::{Class, Promise};
use crate::floor::Door;
use crate::hall::{caller, gate};
use crate::plan::{Blow, Drivers, Plan};
use crate::pulse::Pulse;
use crate::record::{Tally, Violation};
use crate::shared::{Shared, State};
use crate::{cabinet, camera, client};

/// One step of the world. Each host runs this long before the next one runs.
const STEP: Duration = Duration::from_millis(1);

/// Packets held up by a fault arrive within this time after it.
const HELD_UP: Duration = Duration::from_millis(3500);

/// After the faults are over, everything must work again, one client after the other, within this time.
const ENDS_WITHIN: Duration = Duration::from_secs(200);

/// How many segments can wait at one end of a connection before its writer has to wait.
const SEGMENTS: usize = 512;

/// The same in worlds with a gateway, whose readers may read nothing for some seconds.
const SEGMENTS_OF_A_GATEWAY: usize = 16;

/// The promises that only worlds with a gateway check.
const OF_GATEWAYS: [Promise; 2] = [Promise::I8, Promise::I12];

thread_local! {
    static PANICS: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

/// The result of a world.
#[derive(Debug)]
pub struct Outcome {
    /// The seed.
    pub seed: u64,
    /// The class, in a world with one trap.
    pub trap: Option<Class>,
    /// The drivers of its clients' calls.
    pub drivers: Drivers,
    /// Whether it has a gateway.
    pub has_gateway: bool,
    /// The first broken promise.
    pub violation: Option<Violation>,
    /// A checksum of all events.
    pub sum: u64,
    /// Counts.
    pub tally: Tally,
    /// The last events.
    pub last: Vec<String>,
}

/// Turns panics of this process into broken promises of the world where they occur.
pub fn catch_panics() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        std::panic::set_hook(Box::new(|panic| {
            PANICS.with(|panics| panics.borrow_mut().push(panic.to_string()));
        }));
    });
}

/// Runs the world of a seed. `aloud`: prints every event.
#[must_use]
pub fn run(seed: u64, aloud: bool) -> Outcome {
    run_plan(Plan::of(seed), aloud)
}

/// Runs the world of a plan. `aloud`: prints every event.
#[must_use]
pub fn run_plan(plan: Plan, aloud: bool) -> Outcome {
    let (seed, trap, drivers, has_gateway) = (plan.seed, plan.trap, plan.drivers, plan.hall.is_some());
    let _entered = r6_gateway::simulation::enter(crate::shared::now, seed);
    let shared = Shared::new(plan, aloud);
    PANICS.with(|panics| panics.borrow_mut().clear());
    let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| World::new(&shared).run()));
    let mut state = shared.state();
    let at = Duration::from_millis(state.record.tally.millis);
    let panics = PANICS.with(|panics| panics.borrow_mut().drain(..).collect::<Vec<_>>());
    let problem = match ended {
        Ok(Ok(())) => panics.first().cloned(),
        Ok(Err(error)) => Some(error),
        Err(_) => Some(panics.join("; ")),
    };
    state.record.check(Promise::NoPanic, at, problem.is_none(), || problem.unwrap_or_default());
    Outcome {
        seed,
        trap,
        drivers,
        has_gateway,
        violation: state.record.violation.clone(),
        sum: state.record.sum(),
        tally: state.record.tally.clone(),
        last: state.record.last(),
    }
}

struct World<'s> {
    shared: &'s Shared,
    sim: turmoil::Sim<'s>,
    hosts: Vec<String>,
    /// Controllers whose connections end with the next step, and which are gone after it.
    dying: Vec<usize>,
}

fn robot_name(robot: usize) -> String {
    format!("robot-{robot}")
}

fn client_name(client: usize) -> String {
    format!("client-{client}")
}

impl<'s> World<'s> {
    fn new(shared: &'s Shared) -> Self {
        let plan = &shared.plan;
        let mut builder = turmoil::Builder::new();
        builder
            .epoch(SystemTime::UNIX_EPOCH)
            .tick_duration(STEP)
            .simulation_duration(Duration::from_secs(3600))
            .min_message_latency(STEP)
            .max_message_latency(plan.latency)
            .tcp_capacity(if plan.hall.is_some() { SEGMENTS_OF_A_GATEWAY } else { SEGMENTS })
            .rng_seed(plan.seed);
        let mut world = Self { shared, sim: builder.build(), hosts: Vec::new(), dying: Vec::new() };
        for robot in 0..plan.robots.len() {
            let name = robot_name(robot);
            world.sim.host(name.as_str(), move || cabinet::run(shared.clone(), robot));
            world.hosts.push(name);
        }
        for number in 0..plan.cameras.len() {
            let name = format!("camera-{number}");
            world.sim.host(name.as_str(), move || camera::run(shared.clone(), number));
            world.hosts.push(name);
        }
        for number in 0..plan.clients.len() {
            let name = client_name(number);
            world.sim.host(name.as_str(), move || client::run(shared.clone(), number));
            world.hosts.push(name);
        }
        if let Some(hall) = &plan.hall {
            world.sim.host(gate::GATEWAY, move || gate::run(shared.clone()));
            world.hosts.push(gate::GATEWAY.to_owned());
            for number in 0..hall.callers.len() {
                let name = format!("caller-{number}");
                world.sim.host(name.as_str(), move || caller::run(shared.clone(), number));
                world.hosts.push(name);
            }
        }
        world
    }

    fn run(mut self) -> Result<(), String> {
        let plan = std::sync::Arc::clone(&self.shared.plan);
        for class in &plan.classes {
            self.shared.state().record.draws(*class);
        }
        let mut blows = plan.blows.iter().peekable();
        let pulse = Pulse::of(plan.seed, crate::report::kind(plan.trap, plan.drivers, plan.hall.is_some()));
        let quiet = plan.over + HELD_UP;
        loop {
            let at = self.sim.elapsed();
            while let Some((_, blow)) = blows.next_if(|(due, _)| *due <= at) {
                self.strike(*blow);
            }
            self.sim.step().map_err(|error| error.to_string())?;
            pulse.beat();
            for robot in std::mem::take(&mut self.dying) {
                self.crash(&robot_name(robot));
            }
            let mut state = self.shared.state();
            state.record.tally.millis += 1;
            state.quiet = at >= quiet;
            if at.as_millis() % 10 == 0 {
                let State { lines, pipes, record, .. } = &mut *state;
                for (client, line) in lines.iter().enumerate() {
                    line.look_at_drivers(client, at, plan.latency, pipes, record);
                }
            }
            if at.as_millis() % 50 == 0 {
                let State { disks, record, .. } = &mut *state;
                for _ in 0..disks.iter().map(crate::disk::SimDisk::take_refused).sum() {
                    record.strikes(Class::S1);
                }
                let extents: Vec<_> = state.disks.iter().map(crate::disk::SimDisk::extent).collect();
                for (files, longest) in extents {
                    let holds = files <= MOST_FILES && longest <= MOST_BYTES;
                    state.record.check(Promise::I6, at, holds, || {
                        format!("{files} files on a disk, up to {longest} bytes")
                    });
                }
            }
            if let State { hall: Some(hall), record, .. } = &mut *state {
                hall.count_refused(record);
            }
            let well = state.lines.iter().all(|line| line.is_well)
                && state.hall.as_ref().is_none_or(|hall| hall.is_well);
            if state.record.violation.is_some() || well {
                return Ok(());
            }
            if at > quiet + ENDS_WITHIN {
                let waits: Vec<_> = state.lines.iter().map(|line| (line.is_done, line.is_well)).collect();
                state
                    .record
                    .check(Promise::Recovery, at, false, || format!("clients (done, well): {waits:?}"));
                return Ok(());
            }
        }
    }

    /// Removes a host at once, without notice to the others. Packets in transit are lost, and so is what its
    /// sockets would send when they close.
    fn crash(&mut self, name: &str) {
        let others: Vec<_> = self.hosts.iter().filter(|host| *host != name).cloned().collect();
        others.iter().for_each(|other| self.sim.partition(name, other.as_str()));
        self.sim.crash(name);
        self.shared.state().pipes.lost(self.sim.lookup(name));
        others.iter().for_each(|other| self.sim.repair(name, other.as_str()));
    }

    /// Sets what the disk of the gateway takes.
    fn set_store(&self, at: Duration, fullness: Fullness) {
        if let Some(hall) = &mut self.shared.state().hall {
            let set = hall.disk.fill(fullness);
            debug_assert!(set.is_ok(), "{set:?}");
            hall.disk_fills(at, fullness != Fullness::HasRoom);
        }
    }

    /// Applies an event from outside.
    fn strike(&mut self, blow: Blow) {
        let at = self.sim.elapsed();
        self.shared.state().record.tell(at, format_args!("{blow:?}"));
        let plan = &self.shared.plan;
        match blow {
            Blow::Hold { client } => {
                self.shared.state().lines[client].hold(true, at);
                self.sim.hold(client_name(client), robot_name(plan.clients[client].robot));
            }
            Blow::Release { client } => {
                self.shared.state().lines[client].hold(false, at);
                self.sim.release(client_name(client), robot_name(plan.clients[client].robot));
            }
            Blow::Kill { robot } => {
                let mut state = self.shared.state();
                state.floors[robot].door.send_replace(Door::Dies);
                state.record.tally.restarts[0] += 1;
                state.record.strikes(Class::C4);
                self.dying.push(robot);
            }
            Blow::CutPower { robot } => {
                self.crash(&robot_name(robot));
                let mut state = self.shared.state();
                state.record.tally.restarts[1] += 1;
                state.record.strikes(Class::C4);
                state.disks[robot].cut_power();
            }
            Blow::Boot { robot } => self.sim.bounce(robot_name(robot)),
            Blow::KillClient { client } => {
                self.sim.crash(client_name(client));
                self.shared.state().record.strikes(Class::K2);
            }
            Blow::StartClient { client } => self.sim.bounce(client_name(client)),
            Blow::Deafen { client, deaf } => self.shared.state().lines[client].deafen(deaf, at),
            Blow::Swap { client, to } => self.shared.state().lines[client].swap(to),
            Blow::KillGateway {} => {
                self.crash(gate::GATEWAY);
                let mut state = self.shared.state();
                let State { hall, record, .. } = &mut *state;
                record.strikes(Class::S4);
                record.tally.restarts[0] += 1;
                hall.iter_mut().for_each(|hall| hall.is_killed(at, record));
            }
            Blow::StartGateway {} => self.sim.bounce(gate::GATEWAY),
            Blow::StoreIsFull {} => self.set_store(at, Fullness::Nothing),
            Blow::StoreHasNoPages {} => self.set_store(at, Fullness::NoPages),
            Blow::StoreHasRoom {} => self.set_store(at, Fullness::HasRoom),
            Blow::StoreIsSlow {} | Blow::StoreIsFast {} => {
                let is_slow = blow == Blow::StoreIsSlow {};
                let mut state = self.shared.state();
                let State { hall: Some(hall), record, .. } = &mut *state else { return };
                let (least, most) = if is_slow { (20, 500) } else { (0, 4) };
                hall.disk.set_takes(Duration::from_millis(least), Duration::from_millis(most));
                hall.disk_slows(at, is_slow);
                if is_slow {
                    record.strikes(Class::S5);
                }
            }
            Blow::NoFiles {} | Blow::FilesAgain {} => {
                if let Some(hall) = &mut self.shared.state().hall {
                    hall.has_no_files = blow == Blow::NoFiles {};
                }
            }
            Blow::FillDisk { robot, full } => self.shared.state().disks[robot].set_full(full),
        }
    }
}

/// What these drivers must show at least once but did not: faults that took effect, and promises that were
/// checked.
#[must_use]
pub fn never_seen(tally: &Tally, drivers: Drivers) -> Vec<String> {
    let classes = crate::fault::CLASSES
        .iter()
        .filter(|(class, ..)| !drivers.never_bring(*class))
        .map(|(class, ..)| (format!("{class:?}"), tally.faults[class.index()].strikes));
    let promises = crate::fault::PROMISES
        .iter()
        .filter(|(promise, _)| drivers == Drivers::AsTheyCome || !OF_GATEWAYS.contains(promise))
        .map(|(promise, _)| (format!("{promise:?}"), tally.checks[promise.index()]));
    classes.chain(promises).filter(|(_, times)| *times == 0).map(|(name, _)| name).collect()
}
