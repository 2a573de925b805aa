//! Who reads along on the wires of one client, and knows what its program has asked for.

mod arrival;
mod connection;
mod departure;
mod driven;
mod lenient;

use std::collections::{BTreeMap, BTreeSet};
use std::task::{Context, Waker};
use std::time::Duration;

use r6_traffic::random::Random;
use tokio::sync::watch;

use crate::fault::Class;
use crate::floor::SKEW;
use crate::plan::ClientPlan;
use crate::record::Record;
use connection::Connection;
pub use driven::BEATS_EVERY;

/// A program hears of the end of a connection within this time.
const HEARS_WITHIN: Duration = Duration::from_millis(25);

/// A motion that is being streamed.
#[derive(Debug)]
struct Run {
    steps: BTreeSet<i64>,
    /// When it was asked for.
    begun: Duration,
    /// The connection that it began on.
    on: Option<usize>,
    /// The program dropped its handle, or the call that begins it: the client carries it to its end.
    is_dropped: bool,
}

/// All connections of one client's program, or of those that came after it when it was killed.
#[derive(Debug)]
pub struct Line {
    robot: usize,
    patience: Duration,
    connections: Vec<Connection>,
    /// Connections before the present program was started.
    before: usize,
    runs: BTreeMap<u64, Run>,
    next_run: u64,
    sent_steps: BTreeSet<i64>,
    values: BTreeMap<i64, u32>,
    /// Where each numbered step leads: J1, degrees.
    pub targets: BTreeMap<i64, f64>,
    /// Calls under way that may send steps that nobody numbered.
    pub unnumbered: u32,
    /// Starts that the program asked for, and those that left.
    pub starts_asked: u64,
    starts_sent: u64,
    /// The number that the next step has.
    pub next_step: i64,
    /// The value that was written last.
    pub next_value: i64,
    /// Whether its program has done its work, and whether all worked then.
    pub is_done: bool,
    pub is_well: bool,
    /// The number of connections, whenever it grows.
    pub news: watch::Sender<usize>,
    deaf: bool,
    /// The network is away, and nothing has left since.
    held: bool,
    /// Who waits for bytes, by the number of the connection.
    wakers: BTreeMap<usize, Waker>,
    /// The robot that answers where its own should.
    swapped: Option<usize>,
    /// Connections before this one have ended, whatever their ends say.
    cut_before: usize,
    /// When a stop, a pause or a clear left last.
    pub last_stop: Option<Duration>,
    /// What is drawn for each call: whether it is slow, or dropped.
    pub draws: Random,
    /// Calls that are under way and polled when they are woken, and those that are not for a time.
    pub awake: usize,
    pub asleep: usize,
    /// Nothing passes, or nothing is read here; or since when all passes again.
    away: bool,
    passes_since: Duration,
    /// Whether something goes on besides the calls that wait.
    depends_on_keeper: bool,
}

impl Line {
    /// Nobody has connected yet.
    #[must_use]
    pub fn new(plan: &ClientPlan) -> Self {
        let (connections, runs, sent_steps, values) = Default::default();
        Self {
            robot: plan.robot,
            patience: plan.patience,
            connections,
            before: 0,
            runs,
            next_run: 0,
            sent_steps,
            values,
            targets: BTreeMap::new(),
            unnumbered: 0,
            starts_asked: 0,
            starts_sent: 0,
            next_step: 0,
            next_value: 0,
            is_done: false,
            is_well: false,
            news: watch::Sender::new(0),
            deaf: false,
            held: false,
            wakers: BTreeMap::new(),
            swapped: None,
            cut_before: 0,
            last_stop: None,
            draws: Random::new(plan.seed ^ 0x6361_6c6c_7321),
            awake: 0,
            asleep: 0,
            away: false,
            passes_since: Duration::ZERO,
            depends_on_keeper: plan.watches || plan.beats,
        }
    }

    /// The program is killed: what it asked for is nobody's business any more.
    pub fn program_ends(&mut self) {
        self.runs.clear();
        (self.unnumbered, self.starts_asked) = (0, self.starts_sent);
        self.before = self.connections.len();
        (self.is_done, self.is_well) = (false, false);
        (self.awake, self.asleep) = (0, 0);
    }

    /// Its program streams these steps from now on.
    pub fn run_begins(&mut self, begun: Duration, steps: &[i64]) -> u64 {
        self.next_run += 1;
        let run = Run { steps: steps.iter().copied().collect(), begun, on: None, is_dropped: false };
        self.runs.insert(self.next_run, run);
        self.next_run
    }

    /// Whether nothing is under way that may send a list, and the program is not on its first connection.
    #[must_use]
    pub fn is_free_to_be_hasty(&self) -> bool {
        !self.is_moving() && self.connections.len() > self.before + 1
    }

    /// Nothing of it may leave any more.
    pub fn run_ends(&mut self, run: u64) {
        self.runs.remove(&run);
    }

    /// The program drops the motion. The rest of it may leave, until a stop is confirmed.
    pub fn run_is_dropped(&mut self, run: u64) {
        if let Some(run) = self.runs.get_mut(&run) {
            run.is_dropped = true;
        }
    }

    /// A stop is confirmed: nothing of the motions that the program dropped may leave any more.
    pub fn dropped_runs_end(&mut self) {
        self.runs.retain(|_, run| !run.is_dropped);
    }

    /// How often this value left.
    #[must_use]
    pub fn times_sent(&self, value: i64) -> u32 {
        self.values.get(&value).copied().unwrap_or(0)
    }

    /// The number of its robot.
    #[must_use]
    pub fn robot(&self) -> usize {
        self.robot
    }

    /// Whether these steps left.
    #[must_use]
    pub fn has_sent(&self, step: i64) -> bool {
        self.sent_steps.contains(&step)
    }

    /// Reads nothing from now on, or goes on.
    pub fn deafen(&mut self, deaf: bool, at: Duration) {
        (self.deaf, self.passes_since) = (deaf, at);
        self.wake();
    }

    fn wake(&mut self) {
        std::mem::take(&mut self.wakers).into_values().for_each(Waker::wake);
    }

    /// Another robot answers from now on, or its own again; the connections that are there end.
    pub fn swap(&mut self, to: Option<usize>) {
        self.swapped = to;
        self.cut_before = self.connections.len();
        self.wake();
    }

    /// The robot that answers whoever dials now.
    #[must_use]
    pub fn dials(&self) -> usize {
        self.swapped.unwrap_or(self.robot)
    }

    /// Whether this connection was ended by what is between its ends.
    #[must_use]
    pub fn is_cut(&self, number: usize) -> bool {
        number < self.cut_before
    }

    /// The program saw this connection end, or ended it.
    pub fn has_ended(&mut self, number: usize, at: Duration) {
        self.connections[number].ended.get_or_insert(at);
    }

    /// How many connections there were.
    #[must_use]
    pub fn connections(&self) -> usize {
        self.connections.len()
    }

    /// Whether a value that was asked for then may be called fresh now: it may be of a connection that is
    /// alive and leads to its own robot.
    #[must_use]
    pub fn may_be_fresh(&self, asked: Duration, at: Duration) -> bool {
        self.connections.iter().any(|connection| {
            let is_alive = connection.ended.is_none_or(|ended| at <= ended + HEARS_WITHIN);
            connection.robot == self.robot && asked + SKEW >= connection.made && is_alive
        })
    }

    /// The network is away from now on, or there again.
    pub fn hold(&mut self, held: bool, at: Duration) {
        self.held = held;
        (self.away, self.passes_since) = (held, at);
    }

    /// Something leaves: whether the network is away, and nothing else has left since.
    pub fn feels_hold(&mut self) -> bool {
        std::mem::take(&mut self.held)
    }

    /// Whether a motion that its program waits for is under way.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.runs.values().any(|run| !run.is_dropped) || self.unnumbered > 0
    }

    /// Whether nothing came over this connection yet.
    #[must_use]
    pub fn has_heard_nothing(&self, number: usize) -> bool {
        self.connections[number].marks.is_empty() && self.connections[number].forgotten == 0
    }

    /// Whether it reads nothing.
    pub fn is_deaf(&mut self, number: usize, cx: &Context<'_>) -> bool {
        self.wakers.insert(number, cx.waker().clone());
        self.deaf
    }

    /// A connection was made; its number.
    pub fn connected(&mut self, robot: usize, at: Duration, record: &mut Record) -> usize {
        if self.connections.len() > self.before {
            record.tally.reconnects += 1;
        }
        if let Some(last) = self.connections.last_mut() {
            // What came over it and was not delivered never will be.
            last.begun = Vec::new();
        }
        if robot != self.robot {
            record.strikes(Class::E6);
        }
        self.connections.push(Connection { robot, made: at, ..Connection::default() });
        self.news.send_replace(self.connections.len());
        self.connections.len() - 1
    }
}
