//! What a scenario does to a controller, and the faults that are in force.

use std::sync::Arc;

use r6_proto::message::RequestType;
use r6_proto::server::Outbox;
use r6_proto::time::Instant;

use super::desk::Desk;
use super::{ConnectionId, Controller, Service};
use crate::fault::reply::{self, Fate, Outgoing};
use crate::fault::{Fault, LinkFault, LinkFaultNow, ReplyFault, TaskFault};
use crate::io::OutputPoint;
use crate::log::Level;
use crate::machine::{CounterState, Machine};
use crate::panel::PanelAction;
use crate::scenario::{Happening, Scenario, ScenarioRun, Turn};
use crate::settings::ControllerSettings;

/// The scenario of a controller, and what is broken now.
#[derive(Debug)]
pub(super) struct Breakage {
    run: ScenarioRun,
    /// What the machine is built from anew when the mains are back.
    settings: ControllerSettings,
    replies: Vec<(ReplyFault, f64)>,
    tasks: Vec<(TaskFault, f64)>,
    /// The values that queries get while they are frozen.
    frozen: Option<Box<Machine>>,
    /// Replies that come after the next one, one for each connection at most.
    held: Vec<(ConnectionId, Vec<u8>)>,
    off: bool,
}

impl Breakage {
    pub fn new(scenario: Arc<Scenario>, settings: &ControllerSettings, now: Instant) -> Self {
        Self {
            run: ScenarioRun::new(scenario, settings.seed, now),
            settings: settings.clone(),
            replies: Vec::new(),
            tasks: Vec::new(),
            frozen: None,
            held: Vec::new(),
            off: false,
        }
    }

    /// Whether requests are to be dealt with by [`Controller::serve_broken`].
    pub fn is_in_the_way(&self) -> bool {
        let quiet = self.replies.is_empty() && self.tasks.is_empty() && self.held.is_empty();
        !quiet
    }

    /// What is wrong with the next request: drawn anew for each.
    fn strikes(&mut self) -> Strikes {
        let mut strikes = Strikes::default();
        for (task, chance) in &self.tasks {
            let hit = self.run.random().strikes(*chance);
            match task {
                TaskFault::NotExecuted => strikes.not_executed |= hit,
                TaskFault::NotAcknowledged => strikes.not_acknowledged |= hit,
                TaskFault::ListFull => strikes.list_full |= hit,
                TaskFault::RejectedMidBatch => strikes.rejected_mid_batch |= hit,
                TaskFault::TaskDead => strikes.task_dead |= hit,
                TaskFault::ListFrozen | TaskFault::FrozenValues => {}
            }
        }
        strikes
    }

    /// What becomes of the replies to a request: each fault in force may strike each of them, one after the other.
    fn fate_of(
        &mut self,
        asked: &Asked,
        frames: Vec<(Option<Instant>, Vec<u8>)>,
    ) -> Vec<(Option<Instant>, Fate)> {
        let mut fates = Vec::with_capacity(frames.len());
        for (due, frame) in frames {
            let mut fate = Fate { to_asker: vec![Outgoing::at_once(frame)], ..Fate::default() };
            for (fault, chance) in &self.replies {
                if self.run.random().strikes(*chance) {
                    for outgoing in std::mem::take(&mut fate.to_asker) {
                        let next = reply::strike(fault, &asked.frame, outgoing.bytes, self.run.random());
                        fate.take(next, outgoing.later);
                    }
                }
            }
            fates.push((due, fate));
        }
        fates
    }
}

/// What is wrong with one request.
#[derive(Clone, Copy, Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "faults that may strike at once, each by itself")]
pub(super) struct Strikes {
    pub not_executed: bool,
    pub not_acknowledged: bool,
    pub list_full: bool,
    pub rejected_mid_batch: bool,
    pub task_dead: bool,
}

/// The request that is being dealt with.
#[derive(Debug, Default)]
pub(super) struct Asked {
    /// Its frame.
    pub frame: Vec<u8>,
    /// What it asks for.
    pub request: Option<RequestType>,
}

impl Controller {
    /// Brings the machine to a point in time, with whatever the scenario has happen on the way.
    pub(super) fn advance(&mut self, now: Instant) {
        while let Some(at) = self.next_turn().filter(|at| *at <= now) {
            let at = at.max(self.machine.now());
            self.machine.advance(at);
            self.react(at);
            while let Some(turn) = self.breakage.as_mut().and_then(|breakage| breakage.run.take(at)) {
                self.happen(at, turn);
                self.react(at);
            }
        }
        self.machine.advance(now);
        self.react(now);
    }

    /// When the scenario has its next turn: something is due, or an output may change that an input reacts to.
    fn next_turn(&self) -> Option<Instant> {
        let run = &self.breakage.as_ref()?.run;
        let machine = if run.reacts() { self.machine.next_event() } else { None };
        run.next_due().into_iter().chain(machine).min()
    }

    /// When something of the scenario is due next.
    pub(super) fn next_of_scenario(&self) -> Option<Instant> {
        self.breakage.as_ref()?.run.next_due()
    }

    /// When an input follows that is on its way already.
    pub(super) fn next_reaction(&self) -> Option<Instant> {
        self.breakage.as_ref()?.run.next_under_way()
    }

    /// Inputs follow what has changed of the outputs.
    pub(super) fn react(&mut self, now: Instant) {
        let Some(breakage) = &mut self.breakage else { return };
        if breakage.run.reacts() && !breakage.run.react(now, self.machine.io()) {
            let text = "so many inputs are about to react already that one does not".to_owned();
            self.log.add(now, None, Level::Warning, text);
        }
    }

    fn happen(&mut self, now: Instant, turn: Turn) {
        match turn {
            Turn::FaultsChange => self.change_faults(now),
            Turn::PowerIsBack => self.power_up(now),
            Turn::Happens(what) => self.happens(now, &what),
        }
        self.collect_machine_events();
    }

    fn happens(&mut self, now: Instant, what: &Happening) {
        match what {
            Happening::Panel(action) => {
                if let Err(refused) = self.machine.operate(action) {
                    self.tell(now, Level::Warning, format!("{action:?}: {refused}"));
                }
            }
            Happening::Output(point, on) => self.machine.set_output(*point, *on),
            Happening::Bounce(bounce) => {
                if let Some(breakage) = &mut self.breakage {
                    breakage.run.bounce(now, bounce);
                }
            }
            Happening::Counter { id, current, target } => {
                let before = self.machine.counters.get(id).copied().unwrap_or_default();
                let target = target.unwrap_or(before.target);
                self.machine.counters.insert(*id, CounterState { target, current: *current });
            }
            Happening::Photo(camera) => self.push_photo(now, *camera),
            Happening::Request(frame) => self.hear_another_master(now, frame),
            Happening::PowerCut { off, program } => {
                if let Some(breakage) = &mut self.breakage {
                    breakage.run.power_is_back(now + *off);
                }
                self.power_down(now, program.as_deref());
            }
        }
    }

    fn tell(&mut self, now: Instant, level: Level, text: String) {
        self.log.add(now, None, level, format!("scenario: {text}"));
    }

    /// Another master comes, says this, and goes.
    fn hear_another_master(&mut self, now: Instant, frame: &[u8]) {
        let id = self.next_id();
        self.insert(id, Service::Served, true);
        self.tell(now, Level::Info, format!("another master speaks, on connection {}", id.number()));
        let mut rest = frame;
        while !rest.is_empty() {
            let taken = self.take_input(now, id, rest);
            if taken == 0 {
                break;
            }
            rest = rest.get(taken..).unwrap_or_default();
            while self.serve_next(now, id) {}
        }
        self.disconnect(id);
    }

    /// The machine is what a power cut leaves, and nobody hears it until the mains are back.
    fn power_down(&mut self, now: Instant, program: Option<&str>) {
        let Some(breakage) = &mut self.breakage else { return };
        let saved = self.machine.saved();
        let mut machine = Machine::restored(breakage.settings.clone(), &saved, now);
        let chosen = program
            .map_or(Ok(()), |program| machine.operate(&PanelAction::SwitchProgram(program.to_owned())));
        self.machine = machine;
        breakage.off = true;
        breakage.held.clear();
        self.tell(now, Level::Warning, "the mains fail".to_owned());
        if let Err(refused) = chosen {
            self.tell(now, Level::Warning, refused.to_string());
        }
        self.change_faults(now);
    }

    fn power_up(&mut self, now: Instant) {
        let Some(breakage) = &mut self.breakage else { return };
        breakage.off = false;
        // The places of those that were lost are free again, and nobody is left who would end them.
        self.connections.retain(|_, connection| connection.service != Service::Wedged);
        // It knows nothing of these connections: whatever comes on one of them is answered with a reset.
        for (id, connection) in &mut self.connections {
            connection.service = Service::Over;
            self.woken.push_back(*id);
        }
        self.tell(now, Level::Info, "the mains are back".to_owned());
        self.change_faults(now);
    }

    /// Whether the mains have failed.
    pub(super) fn is_off(&self) -> bool {
        self.breakage.as_ref().is_some_and(|breakage| breakage.off)
    }

    /// A fault begins or ends.
    fn change_faults(&mut self, now: Instant) {
        let Some(breakage) = &mut self.breakage else { return };
        let (mut links, mut replies, mut tasks) = (Vec::new(), Vec::new(), Vec::new());
        for (fault, chance) in breakage.run.in_force(now) {
            match fault {
                Fault::Link(fault) => links.push(LinkFaultNow { fault: *fault, chance }),
                Fault::Reply(fault) => replies.push((*fault, chance)),
                Fault::Task(fault) => tasks.push((*fault, chance)),
            }
        }
        if breakage.off {
            let dark = [LinkFault::BlackHole, LinkFault::HalfOpen];
            links.extend(dark.map(|fault| LinkFaultNow { fault, chance: 1.0 }));
        }
        let is_in_force = |wanted| tasks.iter().any(|(task, _)| *task == wanted);
        match (is_in_force(TaskFault::FrozenValues), &breakage.frozen) {
            (true, None) => breakage.frozen = Some(Box::new(self.machine.clone())),
            (false, Some(_)) => breakage.frozen = None,
            (true, Some(_)) | (false, None) => {}
        }
        let list_frozen = is_in_force(TaskFault::ListFrozen);
        breakage.replies = replies;
        breakage.tasks = tasks;
        // What waited for a next reply waits no more.
        for (id, frame) in std::mem::take(&mut breakage.held) {
            if let Some(connection) = self.connections.get_mut(&id) {
                connection.session.split().1.send(|out| out.extend_from_slice(&frame));
                self.woken.push_back(id);
            }
        }
        self.machine.freeze_list(list_frozen);
        if links != self.link_faults {
            self.set_link_faults(links);
        }
    }

    /// Carries out the next message of a connection while something is broken.
    pub(super) fn serve_broken(&mut self, now: Instant, id: ConnectionId) -> bool {
        let Some(breakage) = &mut self.breakage else { return false };
        let Some(connection) = self.connections.get_mut(&id) else { return false };
        let strikes = breakage.strikes();
        let (inbox, outbox) = connection.session.split();
        let mut replies = Outbox::default();
        let mut desk = Desk {
            now,
            id,
            machine: &mut self.machine,
            log: &mut self.log,
            cameras: &mut self.cameras,
            reset: false,
            strikes,
            frozen: breakage.frozen.as_deref(),
            asked: Some(Asked::default()),
        };
        let served = desk.serve_next(inbox, &mut replies);
        let (reset, asked) = (desk.reset, desk.asked.take().unwrap_or_default());
        let is_order = matches!(asked.request, Some(RequestType::Command | RequestType::AddRcc));
        let frames = if strikes.not_acknowledged && is_order { Vec::new() } else { replies.into_frames() };
        let mut to_others = Vec::new();
        for (due, fate) in breakage.fate_of(&asked, frames) {
            for Outgoing { later, bytes } in fate.to_asker {
                match due.or((!later.is_zero()).then_some(now)) {
                    Some(due) => outbox.send_in_turn(due + later, |out| out.extend_from_slice(&bytes)),
                    None => outbox.send(|out| out.extend_from_slice(&bytes)),
                }
                if let Some(at) = breakage.held.iter().position(|(holder, _)| *holder == id) {
                    let (_, held) = breakage.held.swap_remove(at);
                    outbox.send(|out| out.extend_from_slice(&held));
                }
            }
            breakage.held.extend(fate.held.map(|held| (id, held)));
            to_others.extend(fate.to_others);
        }
        if reset || outbox.is_overfull() {
            connection.service = Service::Over;
        }
        for (other, connection) in &mut self.connections {
            if *other != id && connection.service == Service::Served {
                for frame in &to_others {
                    connection.session.split().1.send(|out| out.extend_from_slice(frame));
                    self.woken.push_back(*other);
                }
            }
        }
        self.collect_machine_events();
        self.react(now);
        served
    }
}

impl Outgoing {
    fn at_once(bytes: Vec<u8>) -> Self {
        Self { later: std::time::Duration::ZERO, bytes }
    }
}

impl Fate {
    /// Adds what became of one frame that was this late already.
    fn take(&mut self, next: Self, later: std::time::Duration) {
        let frames = next.to_asker.into_iter();
        self.to_asker.extend(frames.map(|frame| Outgoing { later: frame.later + later, ..frame }));
        self.to_others.extend(next.to_others);
        if next.held.is_some() {
            self.held = next.held;
        }
    }
}

impl Machine {
    /// Sets an output as a person does at the pendant.
    fn set_output(&mut self, point: OutputPoint, on: bool) {
        self.io.set(point, on);
        self.io_changed();
        self.note(format!("scenario: {point:?} is {}", if on { "on" } else { "off" }));
    }
}
