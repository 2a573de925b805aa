//! Two observers: one at the machine, the other polling over the wire. A scenario is judged by what they see,
//! never by its own log lines.

use r6_proto::alarm::AlarmCode;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::time::Duration;

use r6_controller::Event;
use r6_controller::{ConnectionId, Controller, ControllerSnapshot};
use r6_proto::time::Instant;
use serde_json::{Value, json};

use crate::world::World;

const EVERY: Duration = Duration::from_millis(50);
const STATE: [&str; 4] = ["curMode", "curAlarm", "isMoving", "axis-0"];
const COUNTERS: [&str; 4] = ["counter-0", "counter-2", "counter-77", "counterList"];

/// The state of the machine, from a time on.
#[derive(Clone, Debug, PartialEq)]
pub struct Sight {
    pub mode: i64,
    pub alarm: AlarmCode,
    pub emergency_stop: bool,
    pub axes: [f64; 8],
    pub speed: f64,
    pub list: usize,
    pub program: String,
    /// The words of the first boards.
    pub inputs: u32,
    pub eu_inputs: u32,
    pub outputs: u32,
}

impl Sight {
    fn of(seen: &ControllerSnapshot) -> Self {
        Self {
            mode: seen.mode.number(),
            alarm: seen.alarm,
            emergency_stop: seen.emergency_stop,
            axes: seen.axes,
            speed: seen.global_speed_percent,
            list: seen.list_length,
            program: seen.program.clone(),
            inputs: seen.io.inputs[0],
            eu_inputs: seen.io.eu_inputs,
            outputs: seen.io.outputs[0],
        }
    }

    /// An input X of the first board, by its bit.
    pub fn x(&self, point: u32) -> bool {
        self.inputs >> point & 1 == 1
    }

    /// An output Y of the first board, by its bit.
    pub fn y(&self, point: u32) -> bool {
        self.outputs >> point & 1 == 1
    }
}

/// What the two observers saw, each with its time.
#[derive(Debug, Default)]
pub struct Watch {
    /// Each change of the machine.
    sights: Vec<(Instant, Sight)>,
    /// Each answer: the address and its value.
    answers: Vec<(Instant, &'static str, Value)>,
    /// The connection that polls, and when it polls next.
    asks: Option<(ConnectionId, Instant)>,
    /// How many of its connections the controller ended.
    pub ended: usize,
}

impl Watch {
    pub fn look(&mut self, now: Instant, seen: &ControllerSnapshot) {
        let sight = Sight::of(seen);
        if self.sights.last().is_none_or(|(_, last)| *last != sight) {
            self.sights.push((now, sight));
        }
    }

    pub fn begin_to_ask(&mut self, now: Instant, controller: &mut Controller) {
        self.asks = Some((controller.connect(now), now));
    }

    pub fn next(&self) -> Option<Instant> {
        self.asks.map(|(_, next)| next)
    }

    pub fn ask(&mut self, now: Instant, controller: &mut Controller) {
        let Some((id, next)) = &mut self.asks else { return };
        if controller.is_over(*id) {
            controller.disconnect(*id);
            *id = controller.connect(now);
            self.ended += 1;
        }
        if now < *next {
            return;
        }
        *next = now + EVERY;
        // A missing counter has no value, so each counter gets its own query.
        for addresses in [&STATE[..]].into_iter().chain(COUNTERS.chunks(1)) {
            let question = json!({"reqType": "query", "queryAddr": addresses}).to_string();
            controller.handle_input(now, *id, question.as_bytes());
            while let Some(frame) = controller.poll_transmit(now, *id) {
                let reply: Value = serde_json::from_slice(frame).unwrap();
                let values = reply["queryData"].as_array().cloned().unwrap_or_default();
                if reply["queryAddr"] == json!(addresses) && values.len() == addresses.len() {
                    self.answers
                        .extend(addresses.iter().zip(values).map(|(address, value)| (now, *address, value)));
                }
            }
        }
    }
}

fn at(seconds: f64) -> Instant {
    Instant::ORIGIN + Duration::from_secs_f64(seconds)
}

impl World {
    /// Whether the log has such an event.
    pub fn told(&self, is: impl Fn(&Event) -> bool) -> bool {
        self.log.iter().any(|entry| is(&entry.event))
    }

    /// The states of the machine in a period, in seconds.
    pub fn sights(&self, from: f64, to: f64) -> impl Iterator<Item = &Sight> {
        let sights = &self.watch.sights;
        let begin = sights.partition_point(|(since, _)| *since <= at(from)).saturating_sub(1);
        let end = sights.partition_point(|(since, _)| *since < at(to));
        sights[begin..end].iter().map(|(_, sight)| sight)
    }

    pub fn always(&self, from: f64, to: f64, holds: impl Fn(&Sight) -> bool) -> bool {
        self.sights(from, to).all(holds)
    }

    pub fn ever(&self, from: f64, to: f64, holds: impl Fn(&Sight) -> bool) -> bool {
        self.sights(from, to).any(holds)
    }

    /// Whether no axis moved in a period.
    pub fn stands(&self, from: f64, to: f64) -> bool {
        let mut sights = self.sights(from, to);
        let first = sights.next().expect("the machine is always seen").axes;
        sights.all(|sight| sight.axes == first)
    }

    /// Whether the arm rests in the first period and moves in the second.
    pub fn goes_on(&self, stands: Range<f64>, moves: Range<f64>) -> bool {
        self.stands(stands.start, stands.end) && !self.stands(moves.start, moves.end)
    }

    /// How often a property of the machine changed.
    pub fn edges(&self, from: f64, to: f64, what: impl Fn(&Sight) -> bool) -> usize {
        let levels: Vec<_> = self.sights(from, to).map(what).collect();
        levels.windows(2).filter(|pair| pair[0] != pair[1]).count()
    }

    /// The values of an address read over the wire in a period, as text.
    pub fn read(&self, from: f64, to: f64, address: &str) -> BTreeSet<String> {
        let within = |time: &Instant| (at(from)..at(to)).contains(time);
        let answers = self.watch.answers.iter().filter(|(time, of, _)| within(time) && *of == address);
        answers.map(|(.., value)| value.as_str().map_or_else(|| value.to_string(), str::to_owned)).collect()
    }

    /// Whether an address had only this value over the wire, and was read at least once.
    pub fn reads(&self, from: f64, to: f64, address: &str, value: &str) -> bool {
        self.read(from, to, address) == BTreeSet::from([value.to_owned()])
    }

    /// All values that were read, for a failure message.
    pub fn all_read(&self) -> BTreeMap<&'static str, BTreeSet<String>> {
        let addresses = STATE.into_iter().chain(COUNTERS).filter(|address| *address != "axis-0");
        addresses.map(|address| (address, self.read(0.0, 1e6, address))).collect()
    }
}
