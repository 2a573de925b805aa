//! The work of a client, and the results that it was given.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use r6_client::units::{AxisPosition, Percent};
use r6_client::{
    AxisIndex, Cause, Motion, MotionError, OperationMode, Quality, RequestError, Robot, RunOptions, Snapshot,
    StepState, Unmet,
};
use r6_proto::{Address, Command, Reading, RegisterIndex};
use tokio::time::{Instant, timeout};

use crate::floor::{Floor, thousandths};
use crate::hands::pause;
use crate::tap::Line;
use crate::world::{FIRST, REGISTERS, Setup, WRITTEN, bounded, controller_time, ms, value_of};

/// Steps of one motion.
const STEPS: usize = 6;

/// How far J1 moves with each step, degrees. Each target is different, and the targets only grow.
const STEP: f64 = 0.25;

/// The start position of J1, degrees. No other client sends J1 to a multiple of the steps from there.
const FIRST_PLACE: i64 = 100;

/// J1 does not move beyond this, degrees.
const FURTHEST: f64 = 150.0;

/// The outcome of one request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fate {
    Ok,
    Refused,
    NotSent,
    Unknown,
}

impl Fate {
    pub fn of<T>(result: &Result<T, RequestError>) -> Self {
        match result {
            Ok(_) => Self::Ok,
            Err(RequestError::NotSent(_) | RequestError::Invalid(_)) => Self::NotSent,
            Err(RequestError::Refused(_)) => Self::Refused,
            Err(RequestError::OutcomeUnknown(_)) => Self::Unknown,
        }
    }
}

/// A motion, and its reported result.
#[derive(Clone, Debug)]
pub struct Run {
    pub targets: Vec<i64>,
    pub states: Vec<StepState>,
    /// `None`: it ended successfully.
    pub error: Option<MotionError>,
}

/// All results that the client was given.
#[derive(Debug, Default)]
pub struct Notes {
    pub targets: BTreeSet<i64>,
    pub runs: Vec<Run>,
    pub commands: Vec<(i64, Fate)>,
    pub queries: Vec<Fate>,
    /// The result of each stop: whether the arm was seen to stand, or `None` if no stop was answered.
    pub stops: Vec<Option<bool>>,
    /// The time of each news of the subscription, and whether all of it was fresh and answered.
    pub news: Vec<(Instant, bool)>,
    pub failures: u32,
    pub not_fresh: u32,
    pub unreadable: u32,
    pub longest_list: i64,
}

/// The state that every task of the client shares.
#[derive(Clone)]
pub struct Work {
    pub robot: Robot,
    pub floor: Floor,
    pub notes: Arc<Mutex<Notes>>,
    pub over: Arc<AtomicBool>,
    pub begun: Instant,
    pub setup: Setup,
}

fn register(number: u16) -> Address {
    Address::Addr(RegisterIndex::new(number).unwrap())
}

fn j1() -> Address {
    Address::Axis(AxisIndex::ALL[0])
}

impl Work {
    fn is_over(&self) -> bool {
        self.over.load(Ordering::SeqCst)
    }

    fn has_registers(&self) -> bool {
        self.setup.profile == "hc1"
    }

    fn note(&self, note: impl FnOnce(&mut Notes)) {
        note(&mut self.notes.lock().unwrap());
    }

    /// Watches the state. Every value shown as fresh has to be true.
    pub async fn watch(self) {
        let addresses: Vec<_> = [Address::CurMode, Address::CurAlarm, j1()]
            .into_iter()
            .chain((FIRST..FIRST + 4).map(register).filter(|_| self.has_registers()))
            .collect();
        let mut subscription = self.robot.subscribe(&addresses, self.setup.every).unwrap();
        while !self.is_over() {
            let snapshot = bounded("the subscription", subscription.next()).await.expect("it is open");
            self.check(&snapshot, true);
            // Values without news grow old.
            if timeout(self.setup.every, subscription.next()).await.is_err() {
                self.check(&subscription.latest(), false);
            } else {
                self.check(&subscription.latest(), true);
            }
        }
    }

    fn check(&self, snapshot: &Snapshot, is_news: bool) {
        let now = Instant::now();
        let mut all_fresh = true;
        for value in snapshot.values() {
            let fresh = value.quality == Quality::Fresh;
            all_fresh &= fresh;
            if matches!(value.quality, Quality::Unreadable(_) | Quality::Unsupported) {
                self.note(|notes| notes.unreadable += 1);
            }
            let Some(reading) = value.reading.as_ref().filter(|_| fresh) else { continue };
            let age = value.age.expect("what was read has an age");
            let most = self.setup.every + self.setup.settings.liveness.suspect_after;
            assert!(age <= most, "{} is shown as fresh and is {age:?} old", value.address);
            if self.setup.trusts_values {
                self.check_value(value.address, reading, now - age, now);
            }
        }
        self.note(|notes| {
            notes.not_fresh += u32::from(!all_fresh);
            if is_news {
                notes.failures += u32::from(snapshot.failure().is_some());
                notes.news.push((now, all_fresh && snapshot.failure().is_none()));
            }
        });
    }

    fn check_value(&self, address: Address, reading: &Reading, from: Instant, to: Instant) {
        match (address, reading) {
            // All axes but the first stay at their start position.
            (Address::Axis(axis), Reading::Decimal(at)) if axis.index() > 0 => {
                assert!(!self.setup.alone || at.abs() < 1e-6, "{address} at {at}: the value of another");
            }
            (Address::Axis(_), Reading::Decimal(at)) => {
                let [from, to] = [from, to].map(|at| controller_time(self.begun, at));
                let was_there = self.floor.seen().was_at(*at, from, to);
                assert!(was_there, "J1 is shown as fresh at {at}, and was not there from {from} to {to}");
            }
            (Address::Addr(number), Reading::Integer(value)) => {
                let of = number.number();
                assert_eq!(*value, value_of(of), "the value of another register than {address}");
            }
            _ => {}
        }
    }

    /// Returns when the subscription first reported all values as known since then.
    pub async fn first_answer_since(&self, back: Instant) -> Duration {
        loop {
            let found = self
                .notes
                .lock()
                .unwrap()
                .news
                .iter()
                .find(|(at, fresh)| *at >= back && *fresh)
                .map(|(at, _)| *at);
            if let Some(at) = found {
                return at - back;
            }
            pause(ms(5)).await;
        }
    }

    /// Queries registers, different ones each time, so that a reply matched to another request is noticed.
    pub async fn ask(self) {
        let mut round: u16 = 0;
        while !self.is_over() {
            let first = FIRST + round * 7 % (REGISTERS - 6);
            let count = 3 + round % 3;
            let asked: Vec<_> = if self.has_registers() {
                (first..first + count).map(register).collect()
            } else {
                AxisIndex::ALL.into_iter().skip(1).take(usize::from(count)).map(Address::Axis).collect()
            };
            let read = bounded("a query", self.robot.query(&asked)).await;
            self.note(|notes| notes.queries.push(Fate::of(&read)));
            if let Ok(read) = &read
                && self.setup.trusts_values
            {
                for (address, value) in read.rows() {
                    if let Ok(reading) = value {
                        self.check_value(*address, reading, Instant::now(), Instant::now());
                    }
                }
            }
            round += 1;
            pause(ms(90)).await;
        }
    }

    /// Writes a register, a different value each time, and each value once.
    pub async fn command(self) {
        let mut value = 1_000_000;
        while !self.is_over() {
            value += 1;
            let sent = bounded("a command", self.write(value)).await;
            self.note(|notes| notes.commands.push((value, Fate::of(&sent))));
            if sent.is_err() {
                // After a reconnection a caller has to read the state before a command is sent.
                drop(bounded("a look", self.robot.query(&[Address::CurMode, Address::CurAlarm])).await);
            }
            pause(ms(130)).await;
        }
    }

    async fn write(&self, value: i64) -> Result<(), RequestError> {
        let register = RegisterIndex::new(WRITTEN).unwrap();
        self.robot.command(Command::RewriteData { register, savable: false, value }).await.map(|_| ())
    }

    /// Acts as another master: sends commands, moves to its own positions, sometimes stops and starts.
    pub async fn interfere(self) {
        let mut number = 0;
        while !self.is_over() {
            number += 1;
            let register = RegisterIndex::new(WRITTEN + 1).unwrap();
            let command = match number % 24 {
                // Only while the fault lasts, because everything has to work after it.
                7 if self.begun.elapsed() < self.setup.over => Command::ActionStop,
                9 => Command::StartButton,
                _ => Command::RewriteData { register, savable: false, value: number },
            };
            let sent = bounded("a command", self.robot.command(command)).await;
            if number % 12 == 5 && self.begun.elapsed() < self.setup.over {
                #[expect(clippy::cast_precision_loss, reason = "a small number")]
                let place = AxisPosition::degrees([-(number as f64) / 100.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
                let one = Motion::new().axis_move(place, Percent::new(60.0).unwrap());
                let step = one.instructions().unwrap().to_vec();
                drop(bounded("a list", self.robot.add_rcc(false, step)).await);
            }
            if sent.is_err() {
                drop(bounded("a look", self.robot.query(&[Address::CurMode, Address::CurAlarm])).await);
            }
            pause(ms(170)).await;
        }
    }

    /// Runs one motion after the other. Stops some of them, and then requires the arm to stand.
    pub async fn move_and_stop(self) {
        let mut number = 0;
        while !self.is_over() {
            self.move_once(number).await;
            number += 1;
            pause(ms(60)).await;
        }
    }

    fn motion(&self) -> Option<(Vec<i64>, Motion)> {
        let mut notes = self.notes.lock().unwrap();
        let last = notes.targets.last().copied().unwrap_or(FIRST_PLACE);
        #[expect(clippy::cast_precision_loss, reason = "a small number")]
        let from = last as f64 / 1000.0;
        let mut motion = Motion::new();
        let mut targets = Vec::new();
        for n in 1..=STEPS {
            #[expect(clippy::cast_precision_loss, reason = "a small number")]
            let to = from + STEP * n as f64;
            if to > FURTHEST {
                return None;
            }
            targets.push(thousandths(to));
            let place = AxisPosition::degrees([to, 0.0, 0.0, 0.0, 0.0, 0.0]);
            motion = motion.axis_move(place, Percent::new(60.0).unwrap());
        }
        notes.targets.extend(targets.iter().copied());
        Some((targets, motion))
    }

    async fn move_once(&self, number: usize) {
        let status = bounded("the status", self.robot.status()).await;
        let Ok(status) = status else { return };
        self.note(|notes| notes.longest_list = notes.longest_list.max(status.list_length.unwrap_or(0)));
        for unmet in status.unmet() {
            match unmet {
                // A person has to decide each of these; here the answer is always yes.
                Unmet::LeftoverList { .. } => drop(bounded("clearing", self.robot.clear_list()).await),
                Unmet::Alarm { .. } => {
                    drop(bounded("clearing", self.robot.command(Command::ClearAlarm)).await);
                }
                Unmet::Mode { .. } if status.list_length.unwrap_or(0) == 0 => {
                    // Instructions that a stop could not clear may run now.
                    self.floor.release();
                    drop(bounded("starting", self.robot.command(Command::StartButton)).await);
                }
                Unmet::Mode { .. }
                | Unmet::NotHomed
                | Unmet::Moving
                | Unmet::OtherProgram
                | Unmet::Unknown { .. } => {}
            }
        }
        if !status.unmet().is_empty() {
            return;
        }
        let Some((targets, motion)) = self.motion() else { return };
        self.floor.release();
        let options =
            RunOptions { frame_instructions: 2, room: 4, interval: ms(30), ..RunOptions::default() };
        let handle = match bounded("a motion", self.robot.run(&motion, options)).await {
            Ok(handle) => handle,
            Err(error) => {
                let states = vec![StepState::Queued; targets.len()];
                return self.note(|notes| notes.runs.push(Run { targets, states, error: Some(error) }));
            }
        };
        let steps: Vec<_> = (1..=targets.len()).filter_map(|step| handle.step(step)).collect();
        // Every fourth motion is stopped while it runs.
        let (error, stopped) = if number % 4 == 3 {
            pause(ms(40 * (self.setup.seed % 7 + 1))).await;
            let stopped = bounded("a stop", handle.stop()).await;
            (Some(None), Some(stopped))
        } else {
            match bounded("a motion", handle.finished()).await {
                Ok(_) => (None, None),
                Err(error) => {
                    let stop = error.stop.clone().map(|stop| *stop);
                    (Some(Some(error)), stop)
                }
            }
        };
        if let Some(stopped) = &stopped {
            let confirmed = stopped.as_ref().ok().map(|report| report.confirmed);
            if confirmed == Some(true) && self.setup.alone {
                self.floor.halt();
                // Long enough to see that the arm stands, and that it stays at rest.
                pause(ms(1200)).await;
            }
            self.note(|notes| notes.stops.push(confirmed));
        }
        let states: Vec<_> = steps.iter().map(r6_client::StepHandle::state).collect();
        let stopped_here =
            MotionError { cause: Cause::StoppedHere, progress: r6_client::Progress::default(), stop: None };
        let error = error.map(|error| error.unwrap_or(stopped_here));
        self.note(|notes| notes.runs.push(Run { targets, states, error }));
    }

    /// The fault is over, and an operator has handled the machine: checks that everything works.
    pub async fn assert_all_is_well(&self) {
        let mut status = bounded("the status", self.robot.status()).await.expect("it can be read");
        // A stop ends the program and clears what was left.
        if status.unmet() == [(Unmet::Mode { found: OperationMode::Auto })] {
            assert_eq!(status.list_length.unwrap_or(0), 0, "{status:?}");
            self.robot.command(Command::StartButton).await.expect("it takes a start");
            status = bounded("the status", self.robot.status()).await.expect("it can be read");
        }
        assert_eq!(status.unmet(), Vec::new(), "{status:?}");
        self.write(7).await.expect("it takes commands");
        let options = RunOptions::default();
        if let Some((targets, motion)) = self.motion() {
            self.floor.release();
            let handle = self.robot.run(&motion, options).await.expect("it takes motions");
            bounded("a motion", handle.finished()).await.expect("it comes to its end");
            let done = self.floor.seen().done.clone();
            assert!(done.ends_with(&targets), "{done:?} without {targets:?}");
        }
        let report = bounded("a stop", self.robot.stop()).await.expect("it is answered");
        assert!(report.confirmed, "{report}");
    }
}

impl Notes {
    /// The number of motions that ended with such a cause.
    pub fn ended(&self, how: impl Fn(&Cause) -> bool) -> usize {
        self.runs.iter().filter_map(|run| run.error.as_ref()).filter(|error| how(&error.cause)).count()
    }

    pub fn finished(&self) -> usize {
        self.runs.iter().filter(|run| run.error.is_none()).count()
    }

    pub fn commands(&self, fate: &Fate) -> usize {
        self.commands.iter().filter(|(_, found)| found == fate).count()
    }

    /// Checks that the reported results agree with the traffic and with what was carried out.
    pub fn assert_consistent(&self, line: &Line, done: &[i64], executes: bool) {
        line.assert_introduced();
        let text = line.text();
        let frames = line.frames();
        let sent = |value: i64| {
            let word = format!("\"{value}\"");
            text.matches(&word).count()
        };
        for (value, fate) in &self.commands {
            let times = sent(*value);
            match fate {
                Fate::NotSent => assert_eq!(times, 0, "{value} was not sent, they say"),
                Fate::Ok | Fate::Refused => assert_eq!(times, 1, "{value}: {fate:?}"),
                // A part of it may have been sent.
                Fate::Unknown => assert!(times <= 1, "{value} was sent {times} times"),
            }
        }
        let mut steps: Vec<i64> = Vec::new();
        for frame in frames.iter().filter(|frame| frame["reqType"] == "AddRCC") {
            for step in frame["instructions"].as_array().into_iter().flatten() {
                let to: f64 = step["m0"].as_str().and_then(|to| to.parse().ok()).expect("a target");
                steps.push(thousandths(to));
            }
        }
        let distinct: BTreeSet<_> = steps.iter().collect();
        assert_eq!(distinct.len(), steps.len(), "a step was sent twice: {steps:?}");
        for run in &self.runs {
            for (target, state) in run.targets.iter().zip(&run.states) {
                let (left, done) = (steps.contains(target), done.contains(target));
                match state {
                    StepState::Queued => assert!(!left, "{target} is queued, they say: {run:?}"),
                    StepState::Done => assert!(left, "{target} is done, they say: {run:?}"),
                    StepState::Sent | StepState::Running | StepState::Lost => {}
                }
                assert!(left || !done, "{target} was carried out and never sent");
                // If the controller accepts steps and does not carry them out, only the end of the path can
                // show it.
                let is_last = run.targets.last() == Some(target);
                if run.error.is_none() && (executes || is_last) {
                    assert!(done && *state == StepState::Done, "{target}: {run:?}");
                }
            }
        }
    }
}
