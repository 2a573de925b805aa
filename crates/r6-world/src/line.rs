//! The observer of one client's wires. It knows what the client's program asked for.

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

/// The maximum time until a program hears that a connection ended.
const HEARS_WITHIN: Duration = Duration::from_millis(25);

/// A motion that is being streamed.
#[derive(Debug)]
struct Run {
    steps: BTreeSet<i64>,
    /// When the program asked for it.
    begun: Duration,
    /// The connection on which it began.
    on: Option<usize>,
    /// The program dropped its handle, or the call that starts it. The client completes the motion.
    is_dropped: bool,
}

/// All connections of one client's program, including the programs that replaced it after it was killed.
#[derive(Debug)]
pub struct Line {
    robot: usize,
    patience: Duration,
    connections: Vec<Connection>,
    /// The number of connections before the current program started.
    before: usize,
    runs: BTreeMap<u64, Run>,
    next_run: u64,
    sent_steps: BTreeSet<i64>,
    values: BTreeMap<i64, u32>,
    /// The target of each numbered step: J1, degrees.
    pub targets: BTreeMap<i64, f64>,
    /// Number of calls in progress that may send steps without a number.
    pub unnumbered: u32,
    /// The number of starts that the program asked for, and of those sent.
    pub starts_asked: u64,
    starts_sent: u64,
    /// The number of the next step.
    pub next_step: i64,
    /// The last written value.
    pub next_value: i64,
    /// Whether its program has finished its work, and whether everything worked then.
    pub is_done: bool,
    pub is_well: bool,
    /// The number of connections; it is sent whenever it grows.
    pub news: watch::Sender<usize>,
    deaf: bool,
    /// The network is held, and nothing was sent since.
    held: bool,
    /// The wakers that wait for bytes, by the number of the connection.
    wakers: BTreeMap<usize, Waker>,
    /// The robot that answers in place of its own.
    swapped: Option<usize>,
    /// Connections with a lower number than this have ended, whatever their two ends report.
    cut_before: usize,
    /// When the last stop, pause or clear was sent.
    pub last_stop: Option<Duration>,
    /// The random numbers that decide for each call whether it is slow or dropped.
    pub draws: Random,
    /// The number of calls in progress that are polled when woken, and of those that sleep.
    pub awake: usize,
    pub asleep: usize,
    /// Whether nothing passes or nothing is read here; and since when everything passes again.
    away: bool,
    passes_since: Duration,
    /// Whether there is activity besides the waiting calls.
    depends_on_keeper: bool,
}

impl Line {
    /// An observer without connections.
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

    /// The program was killed. What it asked for does not count any more.
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

    /// Whether no call that may send a list is in progress, and the program is past its first connection.
    #[must_use]
    pub fn is_free_to_be_hasty(&self) -> bool {
        !self.is_moving() && self.connections.len() > self.before + 1
    }

    /// The motion ended: nothing of it may be sent any more.
    pub fn run_ends(&mut self, run: u64) {
        self.runs.remove(&run);
    }

    /// The program drops the motion. The rest of it may be sent until a stop is confirmed.
    pub fn run_is_dropped(&mut self, run: u64) {
        if let Some(run) = self.runs.get_mut(&run) {
            run.is_dropped = true;
        }
    }

    /// A stop is confirmed: nothing of the dropped motions may be sent any more.
    pub fn dropped_runs_end(&mut self) {
        self.runs.retain(|_, run| !run.is_dropped);
    }

    /// How often this value was sent.
    #[must_use]
    pub fn times_sent(&self, value: i64) -> u32 {
        self.values.get(&value).copied().unwrap_or(0)
    }

    /// The number of its robot.
    #[must_use]
    pub fn robot(&self) -> usize {
        self.robot
    }

    /// Whether this step was sent.
    #[must_use]
    pub fn has_sent(&self, step: i64) -> bool {
        self.sent_steps.contains(&step)
    }

    /// Stops or resumes reading.
    pub fn deafen(&mut self, deaf: bool, at: Duration) {
        (self.deaf, self.passes_since) = (deaf, at);
        self.wake();
    }

    fn wake(&mut self) {
        std::mem::take(&mut self.wakers).into_values().for_each(Waker::wake);
    }

    /// Another robot answers from now on, or its own again. The existing connections end.
    pub fn swap(&mut self, to: Option<usize>) {
        self.swapped = to;
        self.cut_before = self.connections.len();
        self.wake();
    }

    /// The robot that answers a connection attempt now.
    #[must_use]
    pub fn dials(&self) -> usize {
        self.swapped.unwrap_or(self.robot)
    }

    /// Whether the network ended this connection.
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

    /// Whether a value queried at `asked` may be fresh now. It must come from a connection that is alive and
    /// leads to the client's own robot.
    #[must_use]
    pub fn may_be_fresh(&self, asked: Duration, at: Duration) -> bool {
        self.connections.iter().any(|connection| {
            let is_alive = connection.ended.is_none_or(|ended| at <= ended + HEARS_WITHIN);
            connection.robot == self.robot && asked + SKEW >= connection.made && is_alive
        })
    }

    /// The network is held from now on, or released.
    pub fn hold(&mut self, held: bool, at: Duration) {
        self.held = held;
        (self.away, self.passes_since) = (held, at);
    }

    /// Something is sent. Returns whether the network is held and this is the first thing sent since.
    pub fn feels_hold(&mut self) -> bool {
        std::mem::take(&mut self.held)
    }

    /// Whether a motion that its program waits for is in progress.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.runs.values().any(|run| !run.is_dropped) || self.unnumbered > 0
    }

    /// Whether nothing has arrived over this connection yet.
    #[must_use]
    pub fn has_heard_nothing(&self, number: usize) -> bool {
        self.connections[number].marks.is_empty() && self.connections[number].forgotten == 0
    }

    /// Whether it reads nothing.
    pub fn is_deaf(&mut self, number: usize, cx: &Context<'_>) -> bool {
        self.wakers.insert(number, cx.waker().clone());
        self.deaf
    }

    /// A connection was made. Returns its number.
    pub fn connected(&mut self, robot: usize, at: Duration, record: &mut Record) -> usize {
        if self.connections.len() > self.before {
            record.tally.reconnects += 1;
        }
        if let Some(last) = self.connections.last_mut() {
            // Bytes that were not yet delivered never will be.
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
