//! Who stands at a controller and counts: what it carried out, what it was when, and whether it moved when
//! nothing may.

mod list;
mod observed;

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use r6_controller::event::ListRefusal;
use r6_controller::fault::{LinkFault, LinkFaultNow};
use r6_controller::panel::EMERGENCY_STOP;
use r6_controller::scenario::Happening;
use r6_controller::{Button, Controller, Event, LogEntry, PanelAction};
use tokio::sync::watch;

use crate::fault_effects::FaultEffects;
use crate::line::Line;
use crate::record::Record;
use crate::saved_registers::SavedRegister;
use observed::Sight;

/// An arm that is stopped rests after this long at the latest (`docs/FIDELITY.md`: a pause takes half a
/// second).
const COMES_TO_REST: Duration = Duration::from_millis(700);

/// After `actionStop` it rests this long after it at the latest (78 ms); it may be seen to stand when it is
/// not quite at rest.
const STOPS_WITHIN: Duration = Duration::from_millis(100);

/// Clocks of hosts stand this far apart at most: each runs a step of the world by itself.
pub const SKEW: Duration = Duration::from_millis(3);

/// Of the axes so many are looked at.
const AXES: usize = 6;

/// How the door is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Door {
    /// Whoever comes is served.
    #[default]
    Open,
    /// Whoever comes is refused.
    Refuses,
    /// Nobody gets an answer.
    Silent,
    /// The process is being killed: all connections end.
    Dies,
}

/// What was seen at one controller.
#[derive(Debug)]
pub struct Floor {
    name: String,
    robot: usize,
    /// When its present process was started.
    booted: Duration,
    sights: VecDeque<Sight>,
    /// What it carried out, by the number of the step.
    done: BTreeSet<i64>,
    /// What left its list undone: it was cleared, replaced, or lost with the mains.
    gone: BTreeSet<i64>,
    completed: u64,
    /// The steps that were in its list when it was last seen.
    ahead: VecDeque<i64>,
    /// Lists that it took, and those that left for it.
    taken: u64,
    pub lists_sent: u64,
    /// From when on no program may run: an alarm, an emergency stop or a start from the disk has ended it.
    rests: Option<Duration>,
    /// From when on nothing may move, and where it then stood.
    halted: Option<(Duration, Option<[f64; AXES]>)>,
    last_stop: Duration,
    last_start: Duration,
    /// From when on it stands, as its only client was told, and where it then stood.
    told: Option<(Duration, Option<[f64; AXES]>)>,
    /// When somebody set it in motion last, or sent what may.
    last_moved: Duration,
    /// When an alarm was raised last.
    last_alarm: Option<Duration>,
    /// The last three instants at which it was fast enough to compare.
    pace: VecDeque<Sight>,
    points: usize,
    numbers: BTreeSet<i64>,
    /// What was acknowledged as kept is to be looked at when it is next seen.
    is_new: bool,
    starts: u64,
    pub door: watch::Sender<Door>,
    /// What its scenario has in force.
    pub felt: FaultEffects,
    /// Whether somebody has seen to the machine after all that went wrong.
    pub is_seen_to: bool,
    /// Acknowledged and sent values of the registers that are kept, by register.
    pub kept: std::collections::BTreeMap<u16, SavedRegister>,
}

/// What kept the machine at rest before somebody tried to set it in motion.
#[derive(Clone, Copy, Debug)]
pub struct AtRest {
    rests: Option<Duration>,
    halted: Option<(Duration, Option<[f64; AXES]>)>,
    last_start: Duration,
}

/// What an instruction is known by: J2 in thousandths of a degree. Nobody sends the same twice, nought apart.
#[must_use]
pub fn number_of(degrees: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "an angle")]
    let whole = (degrees * 1000.0).round() as i64;
    whole
}

impl Floor {
    /// Nobody has looked yet.
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

    /// It was started; `again`: from what a disk had; `keeps`: it has one.
    pub fn boots(&mut self, at: Duration, again: bool, keeps: bool) {
        if !keeps {
            self.kept.values_mut().for_each(|kept| kept.acknowledged = 0);
        }
        // A stop before it says nothing about what runs now.
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

    /// Somebody who may sets it in motion; tells what was before, in case that it is refused.
    pub fn starts(&mut self, at: Duration) -> AtRest {
        let before = AtRest { rests: self.rests, halted: self.halted, last_start: self.last_start };
        self.last_start = at;
        (self.halted, self.rests) = (None, None);
        before
    }

    /// Somebody at the machine sets it in motion.
    pub fn is_moved_by_hand(&mut self, at: Duration) {
        (self.told, self.last_moved) = (None, at);
    }

    /// A frame leaves for it that may set it in motion.
    pub fn is_commanded(&mut self, at: Duration) {
        self.last_moved = at;
        if self.told.is_some_and(|(since, _)| at + SKEW >= since) {
            self.told = None;
        }
    }

    /// The only program that commands it was told that it stands: nothing that left before its stop may move
    /// it now. A program that hears of it late says nothing of what was sent or done after the stop.
    pub fn is_told_to_stand(&mut self, at: Duration) {
        if self.last_moved < self.last_stop {
            // It may be seen to stand when it is not quite at rest.
            self.told = Some((at.max(self.last_stop + STOPS_WITHIN), None));
        }
    }

    /// When it was told to stop last.
    #[must_use]
    pub fn last_stop(&self) -> Duration {
        self.last_stop
    }

    /// When an alarm was raised last.
    #[must_use]
    pub fn last_alarm(&self) -> Option<Duration> {
        self.last_alarm
    }

    /// It was refused: all is as it was before.
    pub fn was_refused(&mut self, before: AtRest) {
        (self.rests, self.halted, self.last_start) = (before.rests, before.halted, before.last_start);
    }

    /// A client saw it stand after its stop: unless somebody started it since, it stands until somebody does.
    pub fn stands(&mut self, at: Duration) {
        if self.last_start < self.last_stop && self.halted.is_none() {
            self.halted = Some((at.max(self.last_stop + STOPS_WITHIN), None));
        }
    }

    /// Looks at a controller after something happened to it, with those who are connected to it.
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
                record.tally.alarms[usize::from(alarm != EMERGENCY_STOP)] += 1;
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

    /// What the log says that sets it in motion, or ends that.
    fn read(&mut self, at: Duration, event: &Event) {
        const STARTS: [&str; 5] =
            ["startButton", "actionSingleCycle", "clearAlarmRunNext", "clearAlarmContinue", "switchMold"];
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
            Event::CommandAccepted { command, done: true, .. } if STARTS.contains(&command.as_str()) => {
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
                // The brakes catch it at once, and nothing runs when they are back.
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
