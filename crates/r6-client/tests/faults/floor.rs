//! An observer at the controller that counts: which instructions it carried out, where the arm was when, and
//! whether the arm moved when it must not.

use std::sync::{Arc, Mutex, MutexGuard};

use r6_controller::{Controller, Event, LogEntry};
use r6_proto::message::Action;
use r6_proto::time::Instant;
use r6_sim::ControllerHandle;

/// How long an arm takes to come to rest after a stop.
const COMES_TO_REST_NANOS: u64 = 700_000_000;

/// The number of observations kept: some minutes of a busy controller.
const KEPT: usize = 200_000;

/// What the observer saw at the controller.
#[derive(Debug, Default)]
pub struct Seen {
    /// The targets of J1 of the instructions that were carried out, in their order, in thousandths of a
    /// degree.
    pub done: Vec<i64>,
    /// The number of instructions taken into the list.
    pub taken: usize,
    /// The positions of J1 over time, degrees.
    places: Vec<(Instant, f64)>,
    completed: u64,
    current: Option<i64>,
    /// Since when nothing may move. The position at that time follows.
    halted: Option<Instant>,
    pub broken_promises: Vec<String>,
    pub log: Vec<String>,
    pub events: Vec<Event>,
}

/// The observer. All clones are the same observer.
#[derive(Clone, Debug, Default)]
pub struct Floor(Arc<Mutex<Seen>>);

/// Converts an angle of J1 to thousandths of a degree.
pub fn thousandths(degrees: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "an angle")]
    let whole = (degrees * 1000.0).round() as i64;
    whole
}

impl Floor {
    pub fn at(controller: &ControllerHandle) -> Self {
        let floor = Self::default();
        let own = floor.clone();
        controller.observe(move |now, controller, lines| own.seen().look(now, controller, lines));
        floor
    }

    pub fn seen(&self) -> MutexGuard<'_, Seen> {
        self.0.lock().unwrap()
    }

    /// From now on nothing may move, until a request is sent that may move it.
    pub fn halt(&self) {
        let mut seen = self.seen();
        let now = seen.places.last().map(|(at, _)| *at);
        seen.halted = now;
    }

    /// Allows motion again.
    pub fn release(&self) {
        self.seen().halted = None;
    }
}

impl Seen {
    fn look(&mut self, now: Instant, controller: &Controller, lines: &[LogEntry]) {
        let machine = controller.machine();
        let list = machine.list();
        let j1 = machine.motion().axes.degrees()[0];
        for _ in self.completed..list.completed() {
            // Each move takes longer than the time between two looks. So the completed instruction is the one
            // seen in the last look.
            self.done.extend(self.current.take());
        }
        self.completed = list.completed();
        self.current = list.current().and_then(|step| match &step.action {
            Action::AxisMove(step) => step.target.at(r6_proto::AxisIndex::ALL[0]).map(thousandths),
            _ => None,
        });
        for line in lines {
            self.taken += line.event.instructions_taken().unwrap_or(0);
            self.log.push(format!("{now} {line}"));
            self.events.push(line.event.clone());
        }
        if let (Some(since), Some((before, place))) = (self.halted, self.places.last())
            && before.as_nanos() > since.as_nanos() + COMES_TO_REST_NANOS
            && place.to_bits() != j1.to_bits()
        {
            self.broken_promises.push(format!("{now}: J1 moves from {place} to {j1}, stopped at {since}"));
        }
        if self.places.len() < KEPT {
            self.places.push((now, j1));
        }
    }

    /// Whether J1 was at this position at some time between the two. After the last look the arm stays where
    /// it was.
    pub fn was_at(&self, j1: f64, from: Instant, to: Instant) -> bool {
        let near = |place: f64| (place - j1).abs() < 2e-3;
        let last_before = self.places.iter().rev().find(|(at, _)| *at <= from);
        last_before.is_some_and(|(_, place)| near(*place))
            || self
                .places
                .iter()
                .rev()
                .skip_while(|(at, _)| *at > to)
                .take_while(|(at, _)| *at >= from)
                .any(|(_, place)| near(*place))
    }

    /// Checks that each instruction was carried out at most once, and in its order.
    pub fn assert_nothing_twice(&self, ours: impl Fn(i64) -> bool) {
        let ours: Vec<i64> = self.done.iter().copied().filter(|target| ours(*target)).collect();
        assert!(
            ours.windows(2).all(|pair| pair[0] < pair[1]),
            "carried out twice, or in another order: {ours:?}"
        );
    }
}
