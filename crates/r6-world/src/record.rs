//! The record of a world: a checksum of all events, the last events as text, and the first broken promise.

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use crate::fault::{CLASSES, Class, PROMISES, Promise};

/// How many events are printed with a failure.
const TOLD: usize = 60;

/// The first broken promise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// The promise.
    pub promise: Promise,
    /// When, since the world began.
    pub at: Duration,
    /// The observation.
    pub text: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (_, says) = PROMISES[self.promise.index()];
        write!(f, "{:?} ({says}) at {:.6} s: {}", self.promise, self.at.as_secs_f64(), self.text)
    }
}

/// The counts of one fault class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults {
    /// Worlds whose seed includes this class.
    pub drawn_in: u64,
    /// Worlds in which it took effect.
    pub felt_in: u64,
    /// How often it took effect, as [`CLASSES`] counts it.
    pub strikes: u64,
}

/// Counts for the table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tally {
    /// How often each promise was checked.
    pub checks: [u64; PROMISES.len()],
    /// The counts of each fault class.
    pub faults: [Faults; CLASSES.len()],
    /// Simulated time in milliseconds.
    pub millis: u64,
    /// Frames to and from the clients.
    pub frames: u64,
    /// Motions that succeeded, and motions that failed.
    pub motions: [u64; 2],
    /// Stops that were confirmed, and stops that were not.
    pub stops: [u64; 2],
    /// Requests with a reply, requests not sent or refused, and requests with an unknown outcome.
    pub requests: [u64; 3],
    /// Executed instructions.
    pub instructions: u64,
    /// Controllers that were killed, and whose power was cut.
    pub restarts: [u64; 2],
    /// Reconnects of clients.
    pub reconnects: u64,
    /// Replies that did not come in time, and frames that answered nothing or could not be read.
    pub felt: [u64; 2],
    /// Points of cameras that arrived.
    pub points: u64,
    /// Calls that were dropped while they waited.
    pub dropped: u64,
    /// Emergency stops, and other alarms.
    pub alarms: [u64; 2],
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            checks: [0; PROMISES.len()],
            faults: [Faults::default(); CLASSES.len()],
            millis: 0,
            frames: 0,
            motions: [0; 2],
            stops: [0; 2],
            requests: [0; 3],
            instructions: 0,
            restarts: [0; 2],
            reconnects: 0,
            felt: [0; 2],
            points: 0,
            dropped: 0,
            alarms: [0; 2],
        }
    }
}

impl Tally {
    /// Adds the counts of another world.
    pub fn add(&mut self, other: &Self) {
        for (sum, more) in self.faults.iter_mut().zip(&other.faults) {
            sum.drawn_in += more.drawn_in;
            sum.felt_in += more.felt_in;
            sum.strikes += more.strikes;
        }
        let pairs = self.checks.iter_mut().zip(&other.checks);
        let small =
            self.motions.iter_mut().zip(&other.motions).chain(self.stops.iter_mut().zip(&other.stops));
        let more =
            self.requests.iter_mut().zip(&other.requests).chain(self.alarms.iter_mut().zip(&other.alarms));
        let rest = self.restarts.iter_mut().zip(&other.restarts).chain(self.felt.iter_mut().zip(&other.felt));
        let singles = [
            (&mut self.millis, &other.millis),
            (&mut self.frames, &other.frames),
            (&mut self.instructions, &other.instructions),
            (&mut self.reconnects, &other.reconnects),
            (&mut self.points, &other.points),
            (&mut self.dropped, &other.dropped),
        ];
        pairs.chain(small).chain(more).chain(rest).chain(singles).for_each(|(sum, more)| *sum += more);
    }
}

/// The events of one world.
#[derive(Debug)]
pub struct Record {
    told: VecDeque<String>,
    sum: u64,
    aloud: bool,
    /// The first broken promise.
    pub violation: Option<Violation>,
    /// Counts.
    pub tally: Tally,
}

impl Record {
    /// Creates an empty record. `aloud`: every event is printed.
    #[must_use]
    pub fn new(aloud: bool) -> Self {
        let (told, tally) = Default::default();
        Self { told, sum: 0xcbf2_9ce4_8422_2325, aloud, violation: None, tally }
    }

    /// Records an event.
    pub fn tell(&mut self, at: Duration, what: fmt::Arguments<'_>) {
        let text = format!("{:>12.6} {what}", at.as_secs_f64());
        // FNV-1a is enough, because a different event only needs to give a different sum.
        for byte in text.bytes() {
            self.sum = (self.sum ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
        if self.aloud {
            println!("{text}");
        }
        if self.told.len() >= TOLD {
            self.told.pop_front();
        }
        self.told.push_back(text);
    }

    /// Records the check of a promise.
    pub fn check(&mut self, promise: Promise, at: Duration, holds: bool, text: impl FnOnce() -> String) {
        self.tally.checks[promise.index()] += 1;
        if !holds && self.violation.is_none() {
            let violation = Violation { promise, at, text: text() };
            self.tell(at, format_args!("BROKEN {violation}"));
            self.violation = Some(violation);
        }
    }

    /// Records that the seed includes a fault of this class.
    pub fn draws(&mut self, class: Class) {
        self.tally.faults[class.index()].drawn_in = 1;
    }

    /// Records that a fault of this class took effect.
    pub fn strikes(&mut self, class: Class) {
        let faults = &mut self.tally.faults[class.index()];
        (faults.felt_in, faults.strikes) = (1, faults.strikes + 1);
    }

    /// A checksum of all events in their order.
    #[must_use]
    pub fn sum(&self) -> u64 {
        self.sum
    }

    /// The last events.
    #[must_use]
    pub fn last(&self) -> Vec<String> {
        self.told.iter().cloned().collect()
    }
}
