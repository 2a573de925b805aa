//! What a scenario does to a controller, and the faults that are in force.

mod broken;
mod given;
mod power;

use std::sync::Arc;

use r6_proto::time::Instant;

use super::{ConnectionId, Controller, Service};
use crate::event::{AlarmCause, DidNot, Event};
use crate::fault::{Fault, LinkFault, LinkFaultNow, ReplyFault, TaskFault};
use crate::machine::{CounterState, Machine, NotTaken};
use crate::panel::{PanelAction, Refused};
use crate::saved::MAX_COUNTERS;
use crate::scenario::{Happening, LateList, Scenario, ScenarioRun, Turn};

pub(super) use broken::{Asked, RequestFaults};
pub use given::FaultInForce;

/// The scenario of a controller, and the faults in force.
#[derive(Debug)]
pub(super) struct Breakage {
    pub run: ScenarioRun,
    /// The numbers of the faults in force.
    in_force: Vec<usize>,
    replies: Vec<(ReplyFault, f64)>,
    tasks: Vec<(TaskFault, f64)>,
    /// The frozen machine that queries read from, while the values are frozen.
    frozen: Option<Box<Machine>>,
    /// Replies that are sent after the next one: per connection at most those to one request.
    held: Vec<(ConnectionId, Vec<u8>)>,
    /// The list starts no instruction. This is drawn when that fault begins.
    list_frozen: bool,
    off: bool,
}

impl Breakage {
    pub fn new(scenario: Arc<Scenario>, seed: u64, now: Instant) -> Self {
        Self {
            run: ScenarioRun::new(scenario, seed, now),
            in_force: Vec::new(),
            replies: Vec::new(),
            tasks: Vec::new(),
            frozen: None,
            held: Vec::new(),
            list_frozen: false,
            off: false,
        }
    }

    /// Drops the held replies of a connection that has ended.
    pub fn disconnect(&mut self, id: ConnectionId) {
        self.held.retain(|(holder, _)| *holder != id);
    }

    /// Whether [`Controller::serve_broken`] has to handle the requests.
    pub fn is_in_the_way(&self) -> bool {
        !(self.replies.is_empty() && self.tasks.is_empty() && self.held.is_empty())
    }
}

impl Controller {
    /// Carries out a due event of the scenario.
    pub(super) fn happen(&mut self, now: Instant, turn: Turn) {
        match turn {
            Turn::FaultsChange => self.change_faults(now),
            Turn::PowerIsBack => self.power_up(now),
            Turn::Happens(what) if self.is_off() && !needs_no_power(&what) => {
                self.tell_not(now, &what, DidNot::Refused { why: Refused::PowerOff });
            }
            Turn::Happens(what) => self.happens(now, &what),
            Turn::ListIsTaken(list) => self.take_late(now, &list),
            Turn::Follows(input, on) => {
                let action = input.set(on);
                self.tell(now, Event::Happens { what: Happening::Panel(action.clone()) });
                let _ = self.machine.operate(&action);
            }
            Turn::Bounces(input, on) => {
                let _ = self.machine.operate(&input.set(on));
            }
        }
        self.collect_machine_events();
    }

    fn happens(&mut self, now: Instant, what: &Happening) {
        self.tell(now, Event::Happens { what: what.for_the_log() });
        match what {
            Happening::Panel(action) => {
                let done = match action {
                    PanelAction::RaiseAlarm(alarm) => {
                        self.machine.raise(*alarm, AlarmCause::Scenario);
                        Ok(())
                    }
                    action => self.machine.operate(action),
                };
                if let Err(why) = done {
                    self.tell_not(now, what, DidNot::Refused { why });
                }
            }
            Happening::Output(point, on) => {
                self.machine.io.set(*point, *on);
                self.machine.io_changed();
            }
            Happening::Bounce(bounce) => {
                if let Some(breakage) = &mut self.breakage
                    && !breakage.run.bounce(now, bounce)
                {
                    self.tell_not(now, what, DidNot::TooManyInputs);
                }
            }
            Happening::Counter { id, current, target } => {
                let counters = &mut self.machine.counters;
                if !counters.contains_key(id) && counters.len() >= MAX_COUNTERS {
                    self.tell_not(now, what, DidNot::TooManyCounters { limit: MAX_COUNTERS });
                    return;
                }
                let before = counters.get(id).copied().unwrap_or_default();
                let target = target.unwrap_or(before.target);
                counters.insert(*id, CounterState { target, current: *current });
            }
            Happening::Photo(camera) => self.push_photo(now, *camera),
            Happening::Request(frame) => self.hear_another_master(now, frame),
            Happening::PowerCut { off, program } => self.power_down(now, *off, program.as_deref()),
        }
    }

    /// Takes a list long after it came.
    fn take_late(&mut self, now: Instant, list: &LateList) {
        let event = match self.machine.add_instructions(list.replace, &list.steps) {
            Ok(()) => Event::LateListTaken { instructions: list.steps.len() },
            Err(NotTaken::Refused(why) | NotTaken::Silent(why)) => Event::LateListNotTaken { why },
        };
        self.log.add(now, None, event);
    }

    /// Logs what the scenario did.
    pub(super) fn tell(&mut self, now: Instant, event: Event) {
        self.log.add(now, None, event);
    }

    fn tell_not(&mut self, now: Instant, what: &Happening, why: DidNot) {
        self.tell(now, Event::DidNotHappen { what: what.for_the_log(), why });
    }

    /// Plays another master, which connects, sends this frame and disconnects.
    fn hear_another_master(&mut self, now: Instant, frame: &[u8]) {
        let id = self.next_id();
        self.insert(id, Service::Served, true);
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

    /// Applies the faults that are in force now, after one began or ended.
    fn change_faults(&mut self, now: Instant) {
        let begun = self.tell_of_faults(now);
        let Some(breakage) = &mut self.breakage else { return };
        let (mut links, mut replies, mut tasks) = (Vec::new(), Vec::new(), Vec::new());
        for (fault, chance) in breakage.in_force.iter().filter_map(|number| breakage.run.fault(*number)) {
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
        breakage.list_frozen &= is_in_force(TaskFault::ListFrozen);
        for number in begun {
            if let Some((Fault::Task(TaskFault::ListFrozen), chance)) = breakage.run.fault(number) {
                breakage.list_frozen |= breakage.run.random().strikes(chance);
            }
        }
        let list_frozen = breakage.list_frozen;
        let rest = tasks.iter().filter_map(|(task, _)| match task {
            TaskFault::Dwell { rest } => Some(*rest),
            TaskFault::NotExecuted
            | TaskFault::NotAcknowledged
            | TaskFault::ListFull
            | TaskFault::ListFrozen
            | TaskFault::RejectedMidBatch
            | TaskFault::TaskDead
            | TaskFault::FrozenValues
            | TaskFault::StopIgnored(_)
            | TaskFault::LateList { .. } => None,
        });
        self.machine.dwell_at_points(rest.max());
        breakage.replies = replies;
        breakage.tasks = tasks;
        // Replies that were held back for the next one are sent now.
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

    /// Notes which faults are in force now, logs which begin and end, and returns the numbers of those that
    /// begin.
    fn tell_of_faults(&mut self, now: Instant) -> Vec<usize> {
        let Some(breakage) = &mut self.breakage else { return Vec::new() };
        let in_force = breakage.run.in_force(now);
        let before = std::mem::replace(&mut breakage.in_force, in_force.clone());
        let without = |numbers: &[usize], others: &[usize]| -> Vec<usize> {
            numbers.iter().filter(|number| !others.contains(number)).copied().collect()
        };
        let (ended, begun) = (without(&before, &in_force), without(&in_force, &before));
        let faults = |numbers: &[usize]| -> Vec<Fault> {
            numbers
                .iter()
                .filter_map(|number| breakage.run.fault(*number))
                .map(|(fault, _)| fault.clone())
                .collect()
        };
        let (ends, begins) = (faults(&ended), faults(&begun));
        breakage.run.forget_given(now);
        ends.into_iter().for_each(|fault| self.tell(now, Event::FaultEnds { fault }));
        begins.into_iter().for_each(|fault| self.tell(now, Event::FaultBegins { fault }));
        begun
    }
}

/// Whether a happening needs no mains.
fn needs_no_power(what: &Happening) -> bool {
    match what {
        Happening::Panel(action) => action.needs_no_power(),
        Happening::Bounce(_) | Happening::PowerCut { .. } => true,
        Happening::Output(..) | Happening::Counter { .. } | Happening::Photo(_) | Happening::Request(_) => {
            false
        }
    }
}
