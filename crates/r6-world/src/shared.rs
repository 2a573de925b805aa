//! The shared state of a world: one record, one `Floor` for each controller, one `Line` for each client.

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::Context;
use std::time::Duration;

use crate::disk::SimDisk;
use crate::fault::{Class, Promise};
use crate::floor::Floor;
use crate::hall::Hall;
use crate::line::Line;
use crate::pipes::{Ends, Pipes};
use crate::plan::{Plan, RobotPlan};
use crate::record::Record;
use crate::wire::End;

/// The state of a world. Clones share it. No task may hold its lock while it waits.
#[derive(Clone, Debug)]
pub struct Shared {
    /// The plan of the seed.
    pub plan: Arc<Plan>,
    state: Arc<Mutex<State>>,
}

/// The locked state.
#[derive(Debug)]
pub struct State {
    /// The events.
    pub record: Record,
    /// The controllers.
    pub floors: Vec<Floor>,
    /// Their disks.
    pub disks: Vec<SimDisk>,
    /// The clients.
    pub lines: Vec<Line>,
    /// Connections that their controllers reset: (from, to).
    pub resets: BTreeSet<(SocketAddr, SocketAddr)>,
    /// Bytes that controllers wrote and clients did not read.
    pub pipes: Pipes,
    /// The gateway and its callers, in a world with one.
    pub hall: Option<Hall>,
    /// Whether the faults are over.
    pub quiet: bool,
}

/// The time of the world on the calling host.
#[must_use]
pub fn now() -> Duration {
    turmoil::sim_elapsed().unwrap_or_default()
}

impl Shared {
    /// A world before its first event.
    #[must_use]
    pub fn new(plan: Plan, aloud: bool) -> Self {
        let state = State {
            record: Record::new(aloud),
            floors: (0..plan.robots.len()).map(Floor::new).collect(),
            disks: plan.robots.iter().map(|robot| SimDisk::new(robot.seed)).collect(),
            lines: plan.clients.iter().map(Line::new).collect(),
            resets: BTreeSet::new(),
            pipes: Pipes::default(),
            hall: plan.hall.as_ref().map(|hall| Hall::new(hall, plan.seed)),
            quiet: false,
        };
        Self { plan: Arc::new(plan), state: Arc::new(Mutex::new(state)) }
    }

    /// Locks the state.
    pub fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Records an event.
    pub fn tell(&self, what: std::fmt::Arguments<'_>) {
        self.state().record.tell(now(), what);
    }

    /// Records the check of a promise.
    pub fn check(&self, promise: Promise, holds: bool, text: impl FnOnce() -> String) {
        self.state().record.check(promise, now(), holds, text);
    }

    /// Whether the faults are over.
    #[must_use]
    pub fn is_quiet(&self) -> bool {
        self.state().quiet
    }

    /// A connection was made. Returns its number.
    pub fn connected(&self, end: End, robot: usize, ends: Option<Ends>) -> usize {
        let at = now();
        let mut state = self.state();
        let State { record, lines, pipes, .. } = &mut *state;
        record.tell(at, format_args!("{end:?} is connected"));
        let End::Client(client) = end else { return 0 };
        let number = lines[client].connected(robot, at, record);
        if let Some(ends) = ends {
            pipes.opened(ends, client, number);
        }
        number
    }

    /// Bytes were sent.
    pub fn sent(&self, end: End, number: usize, bytes: &[u8]) {
        let at = now();
        let mut state = self.state();
        let State { record, lines, floors, .. } = &mut *state;
        record.tell(at, format_args!("{end:?}/{number} > {}", String::from_utf8_lossy(bytes)));
        let End::Client(client) = end else { return };
        let commands = lines[client].sent(at, number, bytes, floors, record);
        if lines[client].feels_hold() {
            record.strikes(Class::T13);
        }
        let plans = &self.plan.clients;
        let others = plans
            .iter()
            .zip(lines)
            .enumerate()
            .filter(|(other, (plan, _))| *other != client && plan.robot == plans[client].robot);
        if commands && others.into_iter().any(|(_, (_, line))| line.is_moving()) {
            record.strikes(Class::P14);
        }
    }

    /// Bytes arrived.
    pub fn received(&self, end: End, number: usize, bytes: &[u8]) {
        let at = now();
        let mut state = self.state();
        let State { record, lines, .. } = &mut *state;
        record.tell(at, format_args!("{end:?}/{number} < {}", String::from_utf8_lossy(bytes)));
        let End::Client(client) = end else { return };
        if lines[client].has_heard_nothing(number) && self.robot_of(end).profile != "hc1" {
            record.strikes(Class::P8);
        }
        lines[client].received(at, number, bytes, record);
    }

    /// The number of the robot that this end is connected to.
    #[must_use]
    pub fn robot_number(&self, end: End) -> usize {
        match end {
            End::Client(client) => self.plan.clients[client].robot,
            End::Camera(camera) => self.plan.cameras[camera].robot,
        }
    }

    fn robot_of(&self, end: End) -> &RobotPlan {
        &self.plan.robots[self.robot_number(end)]
    }

    /// A connection ended.
    pub fn ended(&self, end: End, number: usize, how: &str) {
        self.tell(format_args!("{end:?}/{number}: {how}"));
        if let End::Client(client) = end {
            self.state().lines[client].has_ended(number, now());
        }
    }

    /// The robot that answers a connection attempt from this end now.
    #[must_use]
    pub fn dials(&self, end: End) -> usize {
        match end {
            End::Client(client) => self.state().lines[client].dials(),
            End::Camera(_) => self.robot_number(end),
        }
    }

    /// Whether the network ended this connection.
    #[must_use]
    pub fn is_cut(&self, end: End, number: usize) -> bool {
        match end {
            End::Client(client) => self.state().lines[client].is_cut(number),
            End::Camera(_) => false,
        }
    }

    /// Whether nothing is read at this end now. If so, the task is woken when that is over.
    pub fn is_deaf(&self, end: End, number: usize, cx: &Context<'_>) -> bool {
        match end {
            End::Client(client) => self.state().lines[client].is_deaf(number, cx),
            End::Camera(_) => false,
        }
    }
}
