//! A controller with a scenario and three clients, from deadline to deadline on a virtual clock. After every
//! step the world checks that the arm kept its limits and moved only after a command.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use r6_controller::scenario::{Happening, Scenario};
use r6_controller::{
    Button, ConnectionId, Controller, ControllerSettings, ControllerSnapshot, Event, Key, LogEntry,
    PanelAction, Profile, RobotModel,
};
use r6_proto::time::Instant;
use r6_traffic::link::{Delivery, Door, Link};
use serde_json::json;

use crate::client::{Client, FIRST, REGISTERS, value_of};
use crate::session_events::{is_started, operator_starts};
use crate::watch::Watch;

/// The longest time until an arm rests: half a second after a pause, and a step.
const COMES_TO_REST: Duration = Duration::from_millis(650);

/// The link between a client and the controller.
#[derive(Clone, Debug)]
struct Line {
    link: Link,
    /// The number of link changes that it has applied.
    changes: u64,
}

impl Line {
    fn new(seed: u64, now: Instant, controller: &Controller) -> Self {
        Self { link: Link::new(seed, now, controller.link_faults()), changes: controller.link_changes() }
    }

    fn follow(&mut self, now: Instant, controller: &Controller) {
        if self.changes != controller.link_changes() {
            self.changes = controller.link_changes();
            self.link.set_faults(now, controller.link_faults());
        }
    }
}

/// The arm after the last step.
#[derive(Clone, Copy, Debug)]
struct Arm {
    at: Instant,
    axes: [f64; 8],
    runs: bool,
    moves: bool,
}

pub struct World {
    pub controller: Controller,
    pub now: Instant,
    /// The client that moves the arm.
    pub client: Client,
    /// The client that only polls.
    pub other: Client,
    /// The links of the two clients.
    lines: [Line; 2],
    seed: u64,
    /// The connection that sends queries and reads nothing.
    deaf: ConnectionId,
    next_deaf: Instant,
    arm: Arm,
    /// Since when nothing may move, and whether at once.
    halted: Option<(Instant, bool)>,
    /// The positions at which J1 came to rest, in order.
    pub rests: Vec<f64>,
    /// The distance of J1 in all, and up to its last rest, in degrees.
    travel: f64,
    pub travel_to_rest: f64,
    /// Whether it has left the last of these positions.
    left: bool,
    /// Since when it rests there.
    rests_since: Instant,
    /// How often the client's latest reading of J1 was not its position.
    pub stale: u32,
    pub log: Vec<LogEntry>,
    /// The observers, at the machine and over the wire.
    pub watch: Watch,
    speeds: Vec<(f64, f64, f64)>,
    hash: DefaultHasher,
    pub steps: usize,
    size: usize,
}

impl World {
    pub fn new(scenario: Scenario, seed: u64) -> Self {
        Self::with(scenario, seed, "remote", true)
    }

    pub fn with(scenario: Scenario, seed: u64, program: &str, moves: bool) -> Self {
        let model = RobotModel::named("BRTIRUS0707A").unwrap().clone();
        let speeds = model.drives().map(|axis| (axis.soft.min, axis.soft.max, axis.max_speed)).collect();
        let mut profile = Profile::hc1();
        // Only the scenario may draw random numbers.
        profile.add_rcc_ack_spread = Duration::ZERO;
        let settings = ControllerSettings {
            seed,
            mold: program.to_owned(),
            scenario: Some(Arc::new(scenario)),
            ..ControllerSettings::new(profile, model)
        };
        let now = Instant::ORIGIN;
        let mut controller = Controller::new(settings, now);
        let values: Vec<_> = (FIRST..FIRST + REGISTERS).map(|n| value_of(n).to_string()).collect();
        let head = ["rewriteDataList".to_owned(), FIRST.to_string(), REGISTERS.to_string(), "1".to_owned()];
        let words: Vec<_> = head.into_iter().chain(values).collect();
        let id = controller.connect(now);
        controller.handle_input(
            now,
            id,
            json!({"reqType": "command", "cmdData": words}).to_string().as_bytes(),
        );
        controller.disconnect(id);
        let (client, other) = (controller.connect(now), controller.connect(now));
        let deaf = controller.connect(now);
        let size = format!("{controller:?}").len();
        Self {
            client: Client::new(client, moves, 1, now),
            other: Client::new(other, false, 1_000_000, now),
            lines: [Line::new(seed, now, &controller), Line::new(seed ^ 1, now, &controller)],
            seed,
            deaf,
            next_deaf: now,
            arm: arm(&controller.snapshot(now), now),
            controller,
            now,
            halted: None,
            rests: Vec::new(),
            travel: 0.0,
            travel_to_rest: 0.0,
            left: false,
            rests_since: now,
            stale: 0,
            log: Vec::new(),
            watch: Watch::default(),
            speeds,
            hash: DefaultHasher::new(),
            steps: 0,
            size,
        }
    }

    /// Stops the clients' checks of bytes and values.
    pub fn distrust(&mut self) {
        for client in [&mut self.client, &mut self.other] {
            (client.trusts_values, client.trusts_bytes) = (false, false);
        }
    }

    /// Begins to poll over the wire, on another connection.
    pub fn watch(&mut self) {
        self.watch.begin_to_ask(self.now, &mut self.controller);
    }

    /// Lets time pass up to this time.
    pub fn run_to(&mut self, end: Instant) {
        while self.now < end {
            let held_back = |line: &Line, client: &Client| {
                let takes = client.connected && line.link.takes_frames();
                self.controller.next_transmit(client.id).filter(|_| takes)
            };
            let [line, others] = &self.lines;
            let due = [
                self.controller.poll_timeout(),
                held_back(line, &self.client),
                held_back(others, &self.other),
                line.link.next_due().filter(|_| self.client.connected),
                others.link.next_due().filter(|_| self.other.connected),
                Some(self.client.next()),
                Some(self.other.next()),
                Some(self.next_deaf),
                self.watch.next(),
            ];
            let due = due.into_iter().flatten().min().unwrap_or(end);
            self.now = due.max(self.now).min(end);
            self.step();
        }
    }

    fn step(&mut self) {
        self.steps += 1;
        assert!(self.steps < 1_000_000, "time stands still");
        let logged = self.log.len();
        self.controller.handle_timeout(self.now);
        self.pump();
        if self.now >= self.next_deaf {
            self.next_deaf = self.now + Duration::from_millis(100);
            let question = br#"{"reqType":"query","queryAddr":["version","axis-0"]}"#;
            self.controller.handle_input(self.now, self.deaf, question);
            if self.controller.is_over(self.deaf) {
                self.controller.disconnect(self.deaf);
                self.deaf = self.controller.connect(self.now);
            }
        }
        self.watch.ask(self.now, &mut self.controller);
        while self.controller.poll_woken().is_some() {}
        while let Some(line) = self.controller.poll_log() {
            line.to_string().hash(&mut self.hash);
            self.log.push(line);
        }
        self.check(logged);
    }

    /// Carries bytes both ways until neither side sends more.
    fn pump(&mut self) {
        let (now, controller, hash) = (self.now, &mut self.controller, &mut self.hash);
        for (client, line) in [&mut self.client, &mut self.other].into_iter().zip(&mut self.lines) {
            loop {
                if !client.connected {
                    if now < client.next_poll || !connects(now, controller, client) {
                        break;
                    }
                    *line = Line::new(self.seed ^ (client.id.number() << 8), now, controller);
                }
                client.act(now);
                line.follow(now, controller);
                if controller.is_over(client.id) || client.wants_new_connection {
                    end(now, controller, client, line);
                    continue;
                }
                let mut quiet = true;
                while let Some(bytes) = client.session.poll_transmit() {
                    let taken = line.link.receive(now, bytes);
                    if taken == 0 {
                        break;
                    }
                    client.session.transmitted(taken);
                }
                while let Some(bytes) = line.link.poll_to_controller(now) {
                    (now.as_secs_f64().to_bits(), &bytes).hash(hash);
                    controller.handle_input(now, client.id, &bytes);
                    quiet = false;
                }
                while line.link.takes_frames()
                    && let Some(frame) = controller.poll_transmit(now, client.id)
                {
                    client.expect(frame);
                    assert!(line.link.send(now, frame), "it takes frames");
                    quiet = false;
                }
                let mut ended = false;
                while let Some(delivery) = line.link.poll_to_client(now) {
                    match delivery {
                        Delivery::Bytes(bytes) => {
                            (now.as_secs_f64().to_bits(), &bytes).hash(hash);
                            client.take(now, &bytes);
                        }
                        Delivery::Close | Delivery::Reset => ended = true,
                    }
                    quiet = false;
                }
                if ended {
                    end(now, controller, client, line);
                }
                if quiet {
                    break;
                }
            }
        }
    }

    fn check(&mut self, logged: usize) {
        let seen = self.controller.snapshot(self.now);
        self.watch.look(self.now, &seen);
        let before = std::mem::replace(&mut self.arm, arm(&seen, self.now));
        let entries = &self.log[logged..];
        let told_to = is_started(entries);
        let mains_fail = entries
            .iter()
            .any(|entry| matches!(&entry.event, Event::Happens { what: Happening::PowerCut { .. } }));
        let told: Vec<_> = entries.iter().map(LogEntry::to_string).collect();
        let after = self.arm;
        let seconds = after.at.since(before.at).as_secs_f64();
        for (axis, (min, max, speed)) in self.speeds.iter().enumerate() {
            let (from, to) = (before.axes[axis], after.axes[axis]);
            assert!((min - 1e-6..=max + 1e-6).contains(&to), "J{} at {to}, outside {min} to {max}", axis + 1);
            let most = speed * seconds * (1.0 + 1e-6) + 1e-6;
            assert!((to - from).abs() <= most, "J{} went from {from} to {to} in {seconds} s", axis + 1);
        }
        if after.runs && !before.runs {
            assert!(told_to, "it runs, and no start was logged: {told:?}");
        }
        assert!(!(after.runs && mains_fail), "it runs without mains");
        if after.runs || told_to {
            self.halted = None;
        } else if mains_fail {
            self.halted = Some((after.at, true));
        } else if self.halted.is_none() {
            self.halted = Some((after.at, false));
        } else if let Some((since, at_once)) = self.halted {
            let rests = at_once || before.at.since(since) > COMES_TO_REST;
            let stands = before.axes.map(f64::to_bits) == after.axes.map(f64::to_bits);
            assert!(
                stands || !rests,
                "it moves since {since:?}: {:?} to {:?}, {told:?}",
                before.axes,
                after.axes
            );
        }
        let elsewhere = self.rests.last().is_none_or(|last| (last - after.axes[0]).abs() > 1e-6);
        self.travel += (after.axes[0] - before.axes[0]).abs();
        self.left |= elsewhere;
        if !after.moves && self.left {
            self.left = false;
            self.travel_to_rest = self.travel;
            self.rests.push(after.axes[0]);
        }
        if after.moves {
            self.rests_since = after.at;
        }
        let known = self.client.state.filter(|state| state.at > self.rests_since);
        self.stale += u32::from(known.is_some_and(|state| (state.j1 - after.axes[0]).abs() > 1e-4));
    }

    /// Makes the machine ready again, as an operator does.
    pub fn make_ready(&mut self) {
        let mut actions = vec![PanelAction::ReleaseEmergencyStop];
        actions.push(PanelAction::TurnKey(Key::Auto));
        for action in actions {
            self.controller.operate(self.now, &action).unwrap();
        }
        self.run_to(self.now + Duration::from_secs(1));
        self.controller.operate(self.now, &PanelAction::ClearAlarm).unwrap();
        self.controller.operate(self.now, &PanelAction::SwitchProgram("remote".to_owned())).unwrap();
        let id = self.controller.connect(self.now);
        self.controller.handle_input(
            self.now,
            id,
            br#"{"reqType":"command","cmdData":["modifyGSPD","1000"]}"#,
        );
        self.controller.handle_input(
            self.now,
            id,
            br#"{"reqType":"AddRCC","emptyList":"1","instructions":[]}"#,
        );
        self.controller.disconnect(id);
        self.controller.log(self.now, None, operator_starts());
        self.controller.operate(self.now, &PanelAction::Press(Button::Start)).unwrap();
    }

    /// How much the debug form of the controller has grown since the beginning, in characters, without the
    /// connection that does not read.
    pub fn growth(&mut self) -> usize {
        self.controller.disconnect(self.deaf);
        self.deaf = self.controller.connect(self.now);
        format!("{:?}", self.controller).len().saturating_sub(self.size)
    }

    /// A hash of the conversation and its times.
    pub fn conversation(&self) -> u64 {
        self.hash.finish()
    }

    /// How often J1 came to rest at this position.
    pub fn visits(&self, place: f64) -> usize {
        self.rests.iter().filter(|rest| (**rest - place).abs() < 1e-6).count()
    }
}

/// Lets a client connect again, if the door is open.
fn connects(now: Instant, controller: &mut Controller, client: &mut Client) -> bool {
    match Door::of(controller.link_faults()) {
        Door::Open => {
            client.reconnect(now, controller.connect(now));
            return true;
        }
        Door::Refuses => client.seen.refused += 1,
        Door::BlackHole => client.seen.unanswered += 1,
    }
    client.try_later(now);
    false
}

/// Ends a connection, from either end.
fn end(now: Instant, controller: &mut Controller, client: &mut Client, line: &Line) {
    if line.link.notices_end() {
        controller.disconnect(client.id);
    } else {
        controller.lose(client.id);
    }
    client.lose(now);
}

fn arm(seen: &ControllerSnapshot, now: Instant) -> Arm {
    Arm { at: now, axes: seen.axes, runs: seen.mode.may_run() && seen.alarm == 0, moves: seen.moving }
}

/// The time of the last event that a scenario plans.
pub fn end_of(scenario: &Scenario) -> Duration {
    let entries = scenario.timeline.iter().map(|entry| {
        let times = entry.times.expect("an end");
        let lasts = match &entry.what {
            Happening::PowerCut { off, .. } => *off,
            _ => Duration::ZERO,
        };
        entry.at + entry.spread + entry.every.unwrap_or_default() * (times - 1) + lasts
    });
    let windows = scenario.faults.iter().map(|window| window.from + window.lasts.expect("an end"));
    entries.chain(windows).max().unwrap_or_default()
}
