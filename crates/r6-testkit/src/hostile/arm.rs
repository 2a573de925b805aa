//! The core: connections, robots and time.

use std::time::Duration;

use serde_json::Value;

use super::agenda::{Agenda, Due};
use super::body::Body;
use super::character::{Cabinet, Character, Foreign, Links, SwapWhen};
use super::log::{Carried, Did, Entry};
use super::step::Step;
use super::{AXES, Kind};

/// How many bytes without a complete frame a connection may hold. Beyond this, it ends.
const MAX_UNREAD: usize = 1 << 20;

/// The maximum number of entries in the log. Later events are not logged.
const MAX_LOG: usize = 200_000;

/// A hostile controller without sockets and clocks.
///
/// Times count from its start and never go back. Connections are numbered in the order in which they open,
/// from 1. Robots are numbered in the same way.
#[derive(Debug)]
pub struct Arm {
    pub(super) character: Character,
    pub(super) now: Duration,
    pub(super) bodies: Vec<Body>,
    pub(super) agenda: Agenda,
    pub(super) connections: Vec<Connection>,
    pub(super) log: Vec<Entry>,
    /// The number of requests of each kind so far, without lists that clear.
    pub(super) counts: std::collections::BTreeMap<Kind, u32>,
    pub(super) lists_taken: u32,
    present: usize,
    away_until: Duration,
}

/// One connection.
#[derive(Clone, Debug)]
pub(super) struct Connection {
    pub robot: usize,
    pub open: bool,
    unread: Vec<u8>,
    replies: Vec<(Duration, Vec<u8>)>,
}

impl Connection {
    pub(super) fn reply(&mut self, at: Duration, bytes: Vec<u8>) {
        let place = self.replies.partition_point(|(other, _)| *other <= at);
        self.replies.insert(place, (at, bytes));
    }

    /// The next complete frame. Invalid JSON ends the connection.
    fn frame(&mut self) -> Option<Value> {
        let mut frames = serde_json::Deserializer::from_slice(&self.unread).into_iter::<Value>();
        match frames.next()? {
            Ok(frame) => {
                let used = frames.byte_offset();
                self.unread.drain(..used);
                Some(frame)
            }
            Err(error) => {
                self.open = error.is_eof() && self.unread.len() <= MAX_UNREAD;
                None
            }
        }
    }
}

/// What a connection has to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outgoing {
    /// The frames to send now.
    pub frames: Vec<Vec<u8>>,
    /// Whether the connection ends after them.
    pub ended: bool,
    /// When to poll again at the latest.
    pub next: Option<Duration>,
}

impl Arm {
    /// An arm at time 0.
    pub fn new(character: Character) -> Self {
        let mut bodies = vec![Body::new(character.cabinet.clone(), character.dwell)];
        let mut agenda = Agenda::default();
        if let Some(swap) = &character.swap {
            bodies.push(Body::new(swap.to.clone(), character.dwell));
            if let SwapWhen::At(at) = swap.when {
                agenda.put(at, Due::Swap);
            }
        }
        for foreign in &character.foreign {
            agenda.put(foreign.at, Due::Foreign(foreign.clone()));
        }
        if let Some(program) = &character.program {
            agenda.put(program.at, Due::Program(program.steps.clone()));
        }
        if let Some(reboot) = character.reboot {
            agenda.put(reboot.at, Due::Reboot);
        }
        Self {
            character,
            now: Duration::ZERO,
            bodies,
            agenda,
            connections: Vec::new(),
            log: Vec::new(),
            counts: std::collections::BTreeMap::new(),
            lists_taken: 0,
            present: 0,
            away_until: Duration::ZERO,
        }
    }

    /// Lets time pass until `now`.
    pub fn advance(&mut self, now: Duration) {
        while let Some((at, due)) = self.agenda.take(now) {
            self.pass(at);
            self.happen(due);
        }
        self.pass(now);
    }

    fn pass(&mut self, now: Duration) {
        self.now = self.now.max(now);
        let (now, dwell) = (self.now, self.character.dwell);
        self.bodies.iter_mut().for_each(|body| body.pass(now, dwell));
    }

    fn happen(&mut self, due: Due) {
        match due {
            Due::Halt { robot, reaction } => {
                self.bodies[robot].halt();
                self.bodies[robot].show(&reaction);
            }
            Due::Clear { robot, reaction } => {
                self.bodies[robot].clear();
                self.bodies[robot].show(&reaction);
            }
            Due::Take { robot, replace, steps } => {
                self.bodies[robot].take(replace, steps);
            }
            Due::Foreign(foreign) => self.foreign(&foreign),
            Due::Program(steps) => {
                let steps = steps.iter().zip(1..).map(|(step, place)| Step::read(0, place, step)).collect();
                self.bodies[self.present].run_taught(steps);
            }
            Due::Swap => self.swap_now(),
            Due::Reboot => self.reboot_now(),
        }
    }

    /// Opens a connection. Returns its number, or `None` if it is refused.
    pub fn open(&mut self, now: Duration) -> Option<u32> {
        self.advance(now);
        if self.now < self.away_until {
            self.note(0, Did::NotOpened);
            return None;
        }
        let number = u32::try_from(self.connections.len() + 1).expect("fewer connections than numbers");
        if let Some(SwapWhen::Connection(which)) = self.character.swap.as_ref().map(|swap| swap.when)
            && which == number
        {
            self.present = 1 - self.present;
            self.note(0, Did::Swapped);
        }
        self.connections.push(Connection {
            robot: self.present,
            open: true,
            unread: Vec::new(),
            replies: Vec::new(),
        });
        self.note(number, Did::Opened);
        Some(number)
    }

    /// The client ended a connection.
    pub fn close(&mut self, now: Duration, connection: u32) {
        self.advance(now);
        if std::mem::take(&mut self.at(connection).open) {
            self.note(connection, Did::Closed);
        }
    }

    /// Bytes arrived.
    pub fn receive(&mut self, now: Duration, connection: u32, bytes: &[u8]) {
        self.advance(now);
        let deaf = self.character.deaf.iter().find(|deaf| deaf.covers(connection, self.now)).copied();
        self.at(connection).unread.extend_from_slice(bytes);
        while let Some(frame) = self.at(connection).open.then(|| self.at(connection).frame()).flatten() {
            match deaf {
                Some(deaf) if !deaf.obeys => {
                    let kind = super::request::kind(&frame);
                    self.write(connection, frame, kind, Did::NotHeard, None);
                }
                deaf => self.handle(connection, frame, deaf.is_none()),
            }
        }
    }

    /// What a connection has to send, and when to poll again.
    pub fn poll(&mut self, now: Duration, connection: u32) -> Outgoing {
        self.advance(now);
        let deaf = self.character.deaf.iter().any(|deaf| deaf.covers(connection, now));
        let agenda = self.agenda.next();
        let at = self.at(connection);
        let due = at.replies.partition_point(|(time, _)| *time <= now);
        let frames = at.replies.drain(..due).map(|(_, frame)| frame).filter(|_| !deaf).collect();
        let reply = at.replies.first().map(|(time, _)| *time);
        let next = [agenda, reply].into_iter().flatten().min();
        Outgoing { frames, ended: !at.open, next }
    }

    /// Another client sends a list to the robot that currently answers.
    pub fn foreign_list(&mut self, now: Duration, replace: bool, instructions: Vec<Value>) {
        self.advance(now);
        self.foreign(&Foreign { at: now, replace, instructions });
    }

    fn foreign(&mut self, foreign: &Foreign) {
        let robot = self.present;
        let steps = self.read_list(robot, &foreign.instructions);
        let did = if steps.is_empty() && foreign.replace {
            self.bodies[robot].clear();
            Did::Cleared
        } else if self.bodies[robot].take(foreign.replace, steps) {
            Did::Took
        } else {
            Did::Refused
        };
        let frame = Value::from(foreign.instructions.clone());
        self.push(Entry {
            at: self.now,
            connection: 0,
            robot: robot + 1,
            frame,
            kind: Kind::List,
            did,
            answered: None,
        });
    }

    /// Lets the other robot answer from now on. A second call brings the first one back. If the character has
    /// no second robot, it is "cell 5".
    pub fn swap(&mut self, now: Duration) {
        self.advance(now);
        if self.bodies.len() == 1 {
            let other = Cabinet { name: "cell 5".to_owned(), ..Cabinet::default() };
            self.bodies.push(Body::new(other, self.character.dwell));
            self.pass(now);
        }
        self.swap_now();
    }

    fn swap_now(&mut self) {
        self.present = 1 - self.present;
        self.note(0, Did::Swapped);
        match self.character.swap.as_ref().map_or(Links::End, |swap| swap.links) {
            Links::End => self.end_all(),
            Links::Carried => {
                let present = self.present;
                self.connections.iter_mut().for_each(|connection| connection.robot = present);
            }
        }
    }

    /// Restarts the controller, as in [`Character::reboot`] or with the default.
    pub fn reboot(&mut self, now: Duration) {
        self.advance(now);
        self.reboot_now();
    }

    fn reboot_now(&mut self) {
        let reboot = self.character.reboot.unwrap_or_default();
        let robot = self.present;
        self.bodies[robot].reboot(reboot.mode, reboot.alarm, reboot.homed);
        self.agenda.forget(robot);
        self.away_until = self.now + reboot.away;
        self.note(0, Did::Rebooted);
        self.end_all();
    }

    /// Ends all connections and nothing else, like a pulled cable or a switch that restarts.
    pub fn break_links(&mut self, now: Duration) {
        self.advance(now);
        self.end_all();
    }

    fn end_all(&mut self) {
        for connection in &mut self.connections {
            connection.open = false;
            connection.replies.clear();
        }
    }

    /// The character, which can be changed. Fields that schedule events (`foreign`, `program`, `swap`,
    /// `reboot`) only count in [`Arm::new`].
    pub fn character_mut(&mut self) -> &mut Character {
        &mut self.character
    }

    /// Everything that happened.
    pub fn log(&self) -> &[Entry] {
        &self.log
    }

    /// How many robots there are.
    pub fn robots(&self) -> usize {
        self.bodies.len()
    }

    /// The number of the robot that answers new connections, from 1.
    pub fn present(&self) -> usize {
        self.present + 1
    }

    /// Where the axes of a robot were at a past time.
    pub fn position_at(&self, robot: usize, time: Duration) -> [f64; AXES] {
        self.bodies[robot - 1].track.position_at(time)
    }

    /// How far each axis of a robot has moved since a time, with both directions added up.
    pub fn path_since(&self, robot: usize, since: Duration) -> [f64; AXES] {
        self.bodies[robot - 1].track.path(since, self.now)
    }

    /// The steps that a robot began, in order.
    pub fn carried(&self, robot: usize) -> &[Carried] {
        &self.bodies[robot - 1].carried
    }

    /// The number of steps that wait or run in the list of a robot.
    pub fn list_length(&self, robot: usize) -> usize {
        self.bodies[robot - 1].list_length()
    }

    /// The time to which the arm has advanced.
    pub fn now(&self) -> Duration {
        self.now
    }

    pub(super) fn at(&mut self, connection: u32) -> &mut Connection {
        let index = usize::try_from(connection).expect("u32 fits") - 1;
        self.connections.get_mut(index).expect("a connection that was opened")
    }

    fn note(&mut self, connection: u32, did: Did) {
        let kind = Kind::Other;
        let robot = self.present + 1;
        self.push(Entry { at: self.now, connection, robot, frame: Value::Null, kind, did, answered: None });
    }

    /// Logs what was done about a frame.
    pub(super) fn write(
        &mut self,
        connection: u32,
        frame: Value,
        kind: Kind,
        did: Did,
        answered: Option<Duration>,
    ) {
        let robot = self.at(connection).robot + 1;
        self.push(Entry { at: self.now, connection, robot, frame, kind, did, answered });
    }

    fn push(&mut self, entry: Entry) {
        if self.log.len() < MAX_LOG {
            self.log.push(entry);
        }
    }
}
