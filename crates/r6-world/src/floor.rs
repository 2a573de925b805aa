//! The observer of a controller. It records what the controller executed and its values over time, and checks
//! that it does not move when it must not.

mod list;
mod observed;

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use r6_controller::event::ListRefusal;
use r6_controller::fault::{LinkFault, LinkFaultNow};
use r6_controller::scenario::Happening;
use r6_controller::{Button, Controller, Event, LogEntry, PanelAction};
use r6_proto::CommandName;
use r6_proto::alarm::AlarmCode;
use tokio::sync::watch;

use crate::fault_effects::FaultEffects;
use crate::line::Line;
use crate::record::Record;
use crate::saved_registers::SavedRegister;
use observed::Sight;

/// The maximum time until a stopped arm is at rest (`docs/FIDELITY.md`: a pause takes half a second).
const COMES_TO_REST: Duration = Duration::from_millis(700);

/// The maximum time from `actionStop` to rest (78 ms). The arm can appear to stand just before it is at rest.
const STOPS_WITHIN: Duration = Duration::from_millis(100);

/// The maximum difference between the clocks of hosts, because each host runs a step of the world alone.
pub const SKEW: Duration = Duration::from_millis(3);

/// How many axes are observed.
const AXES: usize = 6;

/// The state of the door.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Door {
    /// Connections are accepted.
    #[default]
    Open,
    /// Connections are refused.
    Refuses,
    /// Attempts to connect get no answer.
    Silent,
    /// The process is being killed, and all connections end.
    Dies,
}

/// The observations of one controller.
#[derive(Debug)]
pub struct Floor {
    name: String,
    robot: usize,
    /// When its current process started.
    booted: Duration,
    sights: VecDeque<Sight>,
    /// The steps that it executed, by number.
    done: BTreeSet<i64>,
    /// The steps that left its list without being executed: the list was cleared, replaced, or lost with the
    /// mains.
    gone: BTreeSet<i64>,
    completed: u64,
    /// The steps that were in its list at the last observation.
    ahead: VecDeque<i64>,
    /// The number of lists that it took, and of those sent to it.
    taken: u64,
    pub lists_sent: u64,
    /// Since when no program may run, because of an alarm, an emergency stop or a start from the disk.
    rests: Option<Duration>,
    /// Since when nothing may move, and where the arm stood then.
    halted: Option<(Duration, Option<[f64; AXES]>)>,
    last_stop: Duration,
    last_start: Duration,
    /// Since when it stands according to its only client, and where it stood then.
    told: Option<(Duration, Option<[f64; AXES]>)>,
    /// When it was last set in motion, or was sent something that can do so.
    last_moved: Duration,
    /// When an alarm was raised last.
    last_alarm: Option<Duration>,
    /// The last three observations that are far enough apart to compare.
    pace: VecDeque<Sight>,
    points: usize,
    numbers: BTreeSet<i64>,
    /// Whether the acknowledged registers must be checked at the next observation.
    is_new: bool,
    starts: u64,
    pub door: watch::Sender<Door>,
    /// The faults of its scenario that are in force.
    pub felt: FaultEffects,
    /// Whether a person has restored the machine after the faults.
    pub is_seen_to: bool,
    /// The acknowledged and the sent values of the saved registers, by register.
    pub kept: std::collections::BTreeMap<u16, SavedRegister>,
}

/// What kept the machine at rest before an attempt to set it in motion.
#[derive(Clone, Copy, Debug)]
pub struct AtRest {
    rests: Option<Duration>,
    halted: Option<(Duration, Option<[f64; AXES]>)>,
    last_start: Duration,
}

/// The number that identifies an instruction: J2 in thousandths of a degree. No client sends a number twice,
/// except 0.
#[must_use]
pub fn number_of(degrees: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "an angle")]
    let whole = (degrees * 1000.0).round() as i64;
    whole
}

impl Floor {
    /// An observer that has seen nothing yet.
    #[must_use]
    pub fn new(robot: usize) -> Self {
        let (sights, done, gone, pace, numbers, kept) = Default::default();
        Self {
            name: format!("robot-{robot}"),
            robot,
            booted: Duration::ZERO,
            sights,
            done,
            gone,
            completed: 0,
            ahead: VecDeque::new(),
            taken: 0,
            lists_sent: 0,
            rests: None,
            halted: None,
            last_stop: Duration::ZERO,
            last_start: Duration::ZERO,
            told: None,
            last_moved: Duration::ZERO,
            last_alarm: None,
            pace,
            points: 0,
            numbers,
            is_new: false,
            starts: 0,
            door: watch::Sender::new(Door::Open),
            felt: FaultEffects::default(),
            is_seen_to: false,
            kept,
        }
    }

    /// The controller started. `again`: from the state on its disk. `keeps`: it has a disk.
    pub fn boots(&mut self, at: Duration, again: bool, keeps: bool) {
        if !keeps {
            self.kept.values_mut().for_each(|kept| kept.acknowledged = 0);
        }
        // An earlier stop says nothing about what runs now.
        (self.booted, self.last_start, self.told) = (at, at, None);
        (self.completed, self.points, self.is_seen_to) = (0, 0, false);
        self.lose_list();
        self.pace.clear();
        self.sights.clear();
        self.felt.boots();
        self.is_new = again;
        (self.halted, self.rests) = (again.then_some((at, None)), again.then_some(at));
        self.door.send_replace(Door::Open);
    }

    /// An authorised source sets the machine in motion. Returns the earlier state, in case the request is
    /// refused.
    pub fn starts(&mut self, at: Duration) -> AtRest {
        let before = AtRest { rests: self.rests, halted: self.halted, last_start: self.last_start };
        self.last_start = at;
        (self.halted, self.rests) = (None, None);
        before
    }

    /// A person at the machine sets it in motion.
    pub fn is_moved_by_hand(&mut self, at: Duration) {
        (self.told, self.last_moved) = (None, at);
    }

    /// Whether something set it in motion, or may have, since this time.
    #[must_use]
    pub fn was_moved_since(&self, since: Duration) -> bool {
        self.last_moved >= since
    }

    /// A frame that may set it in motion is sent to it.
    pub fn is_commanded(&mut self, at: Duration) {
        self.last_moved = at;
        if self.told.is_some_and(|(since, _)| at + SKEW >= since) {
            self.told = None;
        }
    }

    /// Its only commanding program heard that the arm stands. Nothing sent before the stop may move it now.
    /// If the program hears this late, it says nothing about what was sent or done after the stop.
    pub fn is_told_to_stand(&mut self, at: Duration) {
        if self.last_moved < self.last_stop {
            // The arm can appear to stand just before it is at rest.
            self.told = Some((at.max(self.last_stop + STOPS_WITHIN), None));
        }
    }

    /// When it last received a stop.
    #[must_use]
    pub fn last_stop(&self) -> Duration {
        self.last_stop
    }

    /// When an alarm was raised last.
    #[must_use]
    pub fn last_alarm(&self) -> Option<Duration> {
        self.last_alarm
    }

    /// The request was refused: restores the earlier state.
    pub fn was_refused(&mut self, before: AtRest) {
        (self.rests, self.halted, self.last_start) = (before.rests, before.halted, before.last_start);
    }

    /// A client saw the arm stand after its stop. Unless something started it since, it stands until it is
    /// started again.
    pub fn stands(&mut self, at: Duration) {
        if self.last_start < self.last_stop && self.halted.is_none() {
            self.halted = Some((at.max(self.last_stop + STOPS_WITHIN), None));
        }
    }

    /// Observes a controller after an event, together with the clients that are connected to it.
    pub fn look(
        &mut self,
        controller: &Controller,
        lines: &[LogEntry],
        clients: &[Line],
        record: &mut Record,
    ) {
        let machine = controller.machine();
        let at = self.booted + machine.now().since(r6_proto::time::Instant::ORIGIN);
        let moves = machine.motion().axis_speeds.iter().any(|speed| *speed != 0.0);
        for line in lines {
            record.tell(at, format_args!("{}: {line}", self.name));
            self.felt.read(line, moves, record);
            self.read(at, &line.event);
            if let Event::AlarmRaised { alarm, .. } = line.event {
                record.tally.alarms[usize::from(alarm != AlarmCode::EMERGENCY_STOP)] += 1;
            }
        }
        if machine.mode().may_run() && !machine.list().is_empty() {
            self.felt.has_instructions(record);
        }
        self.count(at, controller, clients, record);
        self.see(at, controller, record);
        let door = door_of(controller.link_faults());
        self.door.send_if_modified(|before| *before != Door::Dies && std::mem::replace(before, door) != door);
        let saved = machine.saved_mark();
        if std::mem::take(&mut self.is_new) || self.starts != saved {
            self.starts = saved;
            crate::saved_registers::compare((&self.name, &machine.saved().to_json()), &self.kept, at, record);
        }
    }

    /// Reads from the log what sets the machine in motion or stops it.
    fn read(&mut self, at: Duration, event: &Event) {
        // A program that is switched to while another one runs begins at once.
        let starts = |command: &str| {
            let name = CommandName::exact(command.as_bytes());
            name.is_some_and(|name| name.starts() || name == CommandName::SwitchMold)
        };
        match event {
            Event::ListTaken { instructions: 0, .. } => {}
            Event::ListTaken { done, .. } => {
                self.taken += 1;
                if *done {
                    self.starts(at);
                }
            }
            Event::ListAnsweredErr { .. } | Event::LateListTaken { .. } => {
                self.taken += 1;
                self.starts(at);
            }
            Event::CommandAccepted { command, done: true, .. } if starts(command.as_str()) => {
                self.starts(at);
            }
            Event::ListRefused { why: ListRefusal::InTheMiddle }
            | Event::Happens {
                what:
                    Happening::Panel(PanelAction::Press(Button::Start | Button::SingleCycle | Button::SingleStep)),
            } => {
                self.starts(at);
            }
            Event::CommandAccepted { command, .. } | Event::StopIgnored { request: command, .. }
                if command.as_str() == "actionStop" =>
            {
                self.last_stop = at;
            }
            Event::AlarmRaised { .. } | Event::AlarmCleared { .. } => {
                self.halted.get_or_insert((at + COMES_TO_REST, None));
                self.rests.get_or_insert(at);
                self.last_alarm = Some(at);
            }
            Event::Happens { what: Happening::PowerCut { .. } } => {
                // The brakes stop it at once, and nothing runs when the power is back.
                self.pace.clear();
                self.rests.get_or_insert(at);
            }
            _ => {}
        }
    }
}

fn door_of(faults: &[LinkFaultNow]) -> Door {
    let strikes = |wanted| faults.iter().any(|now| now.fault == wanted && now.chance > 0.0);
    if strikes(LinkFault::BlackHole) {
        Door::Silent
    } else if strikes(LinkFault::Refuse) {
        Door::Refuses
    } else {
        Door::Open
    }
}
