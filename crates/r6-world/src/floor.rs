//! Who stands at a controller and counts: what it carried out, what it was when, and whether it moved when nothing may.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use r6_controller::fault::{LinkFault, LinkFaultNow};
use r6_controller::{Controller, LogLine};
use r6_proto::message::{Action, Reading};
use r6_proto::{Address, AxisIndex};
use tokio::sync::watch;

use crate::fault::Promise;
use crate::felt::Felt;
use crate::kept::Kept;
use crate::line::Line;
use crate::record::Record;

/// An arm that is stopped rests after this long at the latest (`docs/FIDELITY.md`: a pause takes half a second).
const COMES_TO_REST: Duration = Duration::from_millis(700);

/// After `actionStop` it rests this long after it at the latest (78 ms); it may be seen to stand when it is not quite at rest.
const STOPS_WITHIN: Duration = Duration::from_millis(100);

/// What was seen longer ago is of no use: no client calls it fresh.
const REMEMBERED: Duration = Duration::from_secs(8);

/// Clocks of hosts stand this far apart at most: each runs a step of the world by itself.
pub const SKEW: Duration = Duration::from_millis(3);

/// Speeds are compared over no shorter and no longer time: a difference of two instants is nothing but rounding, and over a longer
/// one a peak is lost.
const COMPARED: [f64; 2] = [0.0009, 0.030];

/// Acceleration and jerk that no axis exceeds, for one unit of its full speed: those of a stop from full speed within 78 ms, twice, as where
/// one move is blended into the next (`docs/FIDELITY.md`).
const MOST_ACCELERATION: f64 = 2.0 * 2.0 / 0.078;
const MOST_JERK: f64 = 2.0 * 8.0 / (0.078 * 0.078);

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

/// The machine at one instant.
#[derive(Clone, Copy, Debug)]
struct Sight {
    at: Duration,
    mode: i64,
    alarm: u32,
    list: usize,
    axes: [f64; AXES],
    speeds: [f64; AXES],
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
    /// The last three instants at which it was fast enough to compare.
    pace: VecDeque<Sight>,
    points: usize,
    numbers: BTreeSet<i64>,
    /// What was acknowledged as kept is to be looked at when it is next seen.
    is_new: bool,
    starts: u64,
    pub door: watch::Sender<Door>,
    /// What its scenario has in force.
    pub felt: Felt,
    /// Whether somebody has seen to the machine after all that went wrong.
    pub is_seen_to: bool,
    /// Acknowledged and sent values of the registers that are kept, by register.
    pub kept: std::collections::BTreeMap<u16, Kept>,
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
            pace,
            points: 0,
            numbers,
            is_new: false,
            starts: 0,
            door: watch::Sender::new(Door::Open),
            felt: Felt::default(),
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
        (self.booted, self.last_start) = (at, at);
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

    /// Whether these steps were carried out.
    #[must_use]
    pub fn has_done(&self, numbers: &[i64]) -> bool {
        numbers.iter().all(|number| self.done.contains(number))
    }

    /// Whether each of these steps was carried out, or left the list undone.
    #[must_use]
    pub fn is_through_with(&self, numbers: &[i64]) -> bool {
        numbers.iter().all(|number| self.done.contains(number) || self.gone.contains(number))
    }

    /// Whether it has begun with this step, or is through with it.
    #[must_use]
    pub fn has_begun(&self, number: i64) -> bool {
        self.ahead.front() == Some(&number) || self.is_through_with(&[number])
    }

    fn lose_list(&mut self) {
        self.gone.extend(self.ahead.drain(..).filter(|number| *number > 0));
    }

    /// Looks at a controller after something happened to it, with those who are connected to it.
    pub fn look(
        &mut self,
        controller: &Controller,
        lines: &[LogLine],
        clients: &[Line],
        record: &mut Record,
    ) {
        let machine = controller.machine();
        let at = self.booted + machine.now().since(r6_proto::time::Instant::ORIGIN);
        let moves = machine.motion().axis_speeds.iter().any(|speed| *speed != 0.0);
        for line in lines {
            record.tell(at, format_args!("{}: {line}", self.name));
            self.felt.read(line, moves, record);
            self.read(at, &line.text);
            if line.text.starts_with("alarm ") && !line.text.ends_with("cleared") {
                record.tally.alarms[usize::from(!line.text.starts_with("alarm 7:"))] += 1;
            }
        }
        if machine.mode().may_run() && machine.list().len() > 0 {
            self.felt.has_instructions(record);
        }
        self.count(at, controller, clients, record);
        self.see(at, controller, record);
        let door = door_of(controller.link_faults());
        self.door.send_if_modified(|before| *before != Door::Dies && std::mem::replace(before, door) != door);
        let saved = machine.saved_mark();
        if std::mem::take(&mut self.is_new) || self.starts != saved {
            self.starts = saved;
            crate::kept::compare((&self.name, &machine.saved().to_json()), &self.kept, at, record);
        }
    }

    /// What the log says that sets it in motion, or ends that.
    fn read(&mut self, at: Duration, text: &str) {
        const STARTS: [&str; 8] = [
            "startButton",
            "actionSingleCycle",
            "clearAlarmRunNext",
            "clearAlarmContinue",
            "scenario: button start",
            "scenario: button single",
            "AddRCC refused: an instruction in the middle",
            "switchMold",
        ];
        let takes = text.starts_with("AddRCC: ") && !text.starts_with("AddRCC: 0 ");
        self.taken += u64::from(takes);
        let is_done = !text.contains("not carried out");
        if is_done && (takes || STARTS.iter().any(|start| text.starts_with(start))) {
            self.starts(at);
        } else if text.starts_with("actionStop") {
            self.last_stop = at;
        } else if text.starts_with("alarm ") {
            self.halted.get_or_insert((at + COMES_TO_REST, None));
            self.rests.get_or_insert(at);
        }
        if text.contains("the mains fail") {
            // The brakes catch it at once, and nothing runs when they are back.
            self.pace.clear();
            self.rests.get_or_insert(at);
        }
    }

    fn count(&mut self, at: Duration, controller: &Controller, clients: &[Line], record: &mut Record) {
        let machine = controller.machine();
        let list = machine.list();
        if list.completed() < self.completed {
            // It was switched off and on.
            self.completed = 0;
            self.lose_list();
        }
        for _ in self.completed..list.completed() {
            // Whatever changes the list is an event of its own, after which somebody looked.
            if let Some(number) = self.ahead.pop_front().filter(|number| *number > 0) {
                let first = self.done.insert(number);
                record.tally.instructions += 1;
                record.check(Promise::Once, at, first, || {
                    format!("{} carries out step {number} twice", self.name)
                });
                // Each client has numbers of its own.
                let is_theirs =
                    clients.iter().any(|line| line.robot() == self.robot && line.has_sent(number));
                record.check(Promise::Once, at, is_theirs, || {
                    format!("{} carries out step {number}, which its client never sent", self.name)
                });
            }
        }
        self.completed = list.completed();
        let number = |step: &r6_proto::message::Instruction| match &step.action {
            Action::AxisMove(step) => step.target.at(AxisIndex::ALL[1]).map_or(0, number_of),
            _ => 0,
        };
        let ahead: VecDeque<_> = (0..list.len()).map_while(|ahead| list.ahead(ahead)).map(number).collect();
        let before = std::mem::replace(&mut self.ahead, ahead);
        self.gone.extend(before.into_iter().filter(|number| *number > 0 && !self.ahead.contains(number)));
        let length = list.len();
        let most = r6_controller::instruction_list::MAX_INSTRUCTIONS;
        record.check(Promise::I6, at, length <= most, || format!("{} has {length} instructions", self.name));
        let (taken, sent) = (self.taken, self.lists_sent);
        record.check(Promise::Once, at, taken <= sent, || {
            format!("{} took {taken} lists of {sent}", self.name)
        });
        let points = machine.points();
        if points.len() != self.points {
            let count = points.len();
            let fresh: Vec<i64> = points.skip(self.points).map(|(_, point)| number_of(point.x)).collect();
            self.points = count;
            for number in fresh.into_iter().filter(|number| *number > 1000) {
                record.tally.points += 1;
                let first = self.numbers.insert(number);
                record.check(Promise::Once, at, first, || format!("{} got point {number} twice", self.name));
            }
            let most = r6_controller::machine::MAX_POINTS;
            record.check(Promise::I6, at, count <= most, || format!("{} has {count} points", self.name));
        }
    }

    fn see(&mut self, at: Duration, controller: &Controller, record: &mut Record) {
        let machine = controller.machine();
        let motion = machine.motion();
        let mut sight = Sight {
            at,
            mode: machine.mode().number(),
            alarm: machine.alarm(),
            list: machine.list().len(),
            axes: [0.0; AXES],
            speeds: [0.0; AXES],
        };
        sight.axes.copy_from_slice(&motion.axes.degrees()[..AXES]);
        sight.speeds.copy_from_slice(&motion.axis_speeds[..AXES]);
        if let Some((since, place)) = &mut self.halted
            && at > *since
        {
            let place = *place.get_or_insert(sight.axes);
            record.check(Promise::I4, at, place == sight.axes, || {
                format!("{} moves from {place:?} to {:?}, and nobody started it", self.name, sight.axes)
            });
        }
        if let Some(since) = self.rests {
            let (name, mode) = (&self.name, machine.mode());
            record.check(Promise::I4, at, !mode.may_run(), || {
                format!("{name} is in mode {mode}, and nobody started it since {since:?}")
            });
        }
        self.limit(&sight, controller, record);
        while self.sights.front().is_some_and(|sight| sight.at + REMEMBERED < at) && self.sights.len() > 1 {
            self.sights.pop_front();
        }
        self.sights.push_back(sight);
    }

    /// Soft limits, speed, acceleration and jerk.
    fn limit(&mut self, sight: &Sight, controller: &Controller, record: &mut Record) {
        let model = controller.machine().model();
        for (number, (axis, (place, speed))) in
            model.drives().zip(sight.axes.iter().zip(sight.speeds)).enumerate()
        {
            let within = *place >= axis.soft.min - 1e-6 && *place <= axis.soft.max + 1e-6;
            record.check(Promise::I11, sight.at, within, || {
                format!("{}: J{} is at {place}", self.name, number + 1)
            });
            let slow = speed.abs() <= axis.max_speed * 1.0001 + 1e-6;
            record.check(Promise::I11, sight.at, slow, || {
                format!("{}: J{} has {speed} °/s", self.name, number + 1)
            });
        }
        if self.pace.back().is_some_and(|last| (sight.at.saturating_sub(last.at)).as_secs_f64() < COMPARED[0])
        {
            return;
        }
        self.pace.push_back(*sight);
        if self.pace.len() > 3 {
            self.pace.pop_front();
        }
        let [Some(first), Some(second), Some(third)] = [0, 1, 2].map(|n| self.pace.get(n)) else { return };
        let (before, after) = ((second.at - first.at).as_secs_f64(), (third.at - second.at).as_secs_f64());
        if before.max(after) > COMPARED[1] {
            return;
        }
        for (number, axis) in model.drives().enumerate() {
            let rise = |from: &Sight, to: &Sight, time: f64| (to.speeds[number] - from.speeds[number]) / time;
            let (one, other) = (rise(first, second, before), rise(second, third, after));
            let jerk = (other - one) / ((before + after) / 2.0);
            let (most, most_jerk) = (axis.max_speed * MOST_ACCELERATION, axis.max_speed * MOST_JERK);
            let way = (third.axes[number] - second.axes[number]).abs();
            let far = way <= axis.max_speed * after * 1.001 + 1e-6;
            record.check(Promise::I11, sight.at, far, || {
                format!("{}: J{} jumps by {way}", self.name, number + 1)
            });
            record.check(Promise::I11, sight.at, other.abs() <= most, || {
                format!("{}: J{} accelerates by {other} °/s², of {most}", self.name, number + 1)
            });
            record.check(Promise::I11, sight.at, jerk.abs() <= most_jerk, || {
                format!("{}: J{} has a jerk of {jerk} °/s³, of {most_jerk}", self.name, number + 1)
            });
        }
    }

    /// Whether the machine was so at some time between the two; after the last look it stays as it was.
    #[must_use]
    pub fn was(&self, address: Address, reading: &Reading, from: Duration, to: Duration) -> Option<bool> {
        let (from, to) = (from.saturating_sub(SKEW), to + SKEW);
        if from <= self.booted || self.sights.front().is_none_or(|first| first.at > from) {
            return None;
        }
        #[expect(clippy::cast_possible_wrap, reason = "a short list")]
        let is_so = |sight: &Sight| match (address, reading) {
            (Address::CurMode, Reading::Integer(mode)) => Some(sight.mode == *mode),
            (Address::CurAlarm, Reading::Integer(alarm)) => Some(i64::from(sight.alarm) == *alarm),
            (Address::RemoteCmdLen, Reading::Integer(length)) => Some(sight.list as i64 == *length),
            (Address::Axis(axis), Reading::Decimal(place)) => {
                sight.axes.get(axis.index()).map(|was| (was - place).abs() < 2e-3)
            }
            _ => None,
        };
        let first = self.sights.iter().rev().find(|sight| sight.at <= from)?;
        let later =
            self.sights.iter().rev().skip_while(|sight| sight.at > to).take_while(|sight| sight.at > from);
        is_so(first)?;
        Some(std::iter::once(first).chain(later).any(|sight| is_so(sight) == Some(true)))
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
