//! What all robots of a gateway share.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use r6_client::Address;
use tokio::runtime::Handle;
use tokio::sync::watch;
use tokio::task::JoinHandle;

use crate::core::live::follower::Top;
use crate::fleet::config::RobotConfig;
use crate::fleet::roads::Roads;
use crate::history::Recorder;
use crate::live::board::Board;
use crate::live::far::FarRobots;
use crate::live::news::News;
use crate::ownership::owners::Owners;
use crate::store::Keeper;

/// What all robots of a gateway share.
#[derive(Debug)]
pub struct Shared {
    /// The store.
    pub keeper: Keeper,
    /// The ways to the robots.
    pub(in crate::fleet) roads: Roads,
    /// The history; `None` if none is kept.
    pub history: Option<Recorder>,
    /// What happened.
    pub news: News,
    /// Counts changes of values, so that readers can wait for the next one.
    pub pulse: watch::Sender<u64>,
    /// Which gateway owns what.
    pub owners: Owners,
    /// The robots of other gateways.
    pub far: FarRobots,
    /// When this gateway started: numbers of events and of changes count from then.
    pub epoch: u64,
    /// The last number of a change of any robot, of a robot that came or went.
    numbers: AtomicU64,
    /// The number of the last robot that went.
    removed: AtomicU64,
    /// How many robots that were let go of have records that are not written.
    writes_last: AtomicUsize,
    /// Where the tasks of robots run, also if a caller starts them: not on the threads for callers.
    runtime: Handle,
}

/// The last records of a robot are written until this is dropped.
pub(super) struct WritesLast<'s>(&'s Shared);

impl Drop for WritesLast<'_> {
    fn drop(&mut self) {
        self.0.writes_last.fetch_sub(1, Ordering::SeqCst);
    }
}

impl Shared {
    /// What robots share that none has used yet. Their tasks run on the runtime in which this is called.
    #[must_use]
    pub fn new(keeper: Keeper, roads: Roads, history: Option<Recorder>, epoch: u64) -> Self {
        let (news, pulse) = (News::default(), watch::Sender::new(0));
        let owners = Owners::alone();
        Self {
            keeper,
            roads,
            history,
            news,
            pulse,
            owners,
            far: FarRobots::default(),
            epoch,
            numbers: AtomicU64::new(0),
            removed: AtomicU64::new(0),
            writes_last: AtomicUsize::new(0),
            runtime: Handle::current(),
        }
    }

    /// Starts a task of a robot.
    pub(in crate::fleet) fn spawn<F>(&self, work: F) -> JoinHandle<F::Output>
    where
        F: Future<Output: Send + 'static> + Send + 'static,
    {
        self.runtime.spawn(work)
    }

    /// How many robots that were let go of have records that are not written.
    pub fn writes_last(&self) -> usize {
        self.writes_last.load(Ordering::SeqCst)
    }

    /// Counts a robot that is let go of while its last records are written, until this is dropped.
    pub(super) fn begin_writing_last(&self) -> WritesLast<'_> {
        self.writes_last.fetch_add(1, Ordering::SeqCst);
        WritesLast(self)
    }

    /// The same, of a gateway that shares its store.
    #[must_use]
    pub fn with_owners(self, owners: Owners) -> Self {
        Self { owners, ..self }
    }

    /// How far the numbers have come. A reader that looks after this sees all that has one of these numbers,
    /// because each is drawn under the lock of what it is about.
    pub fn top(&self) -> Top {
        // In this order: the number of the last removal is never above the other.
        let removed = self.removed.load(Ordering::SeqCst);
        Top { number: self.numbers.load(Ordering::SeqCst), removed }
    }

    /// The next number. To be called under the lock of what it is about.
    pub(crate) fn draw(&self) -> u64 {
        self.numbers.fetch_add(1, Ordering::SeqCst) + 1
    }

    /// Notes that a robot goes. To be called under the lock of the list of robots.
    pub(crate) fn note_removal(&self) {
        self.removed.store(self.draw(), Ordering::SeqCst);
    }

    /// Wakes the readers of values.
    pub fn wake_readers(&self) {
        self.pulse.send_modify(|pulse| *pulse = pulse.wrapping_add(1));
    }

    pub(super) fn new_board(&self, config: &RobotConfig) -> Board {
        let suspect_after = config.settings.liveness.suspect_after;
        let fresh_for = |address: Address| (address, config.period_of(address) + suspect_after);
        Board::new(self.draw(), config.all_addresses().into_iter().map(fresh_for))
    }
}
