//! The thread of the history.

#[cfg(feature = "simulation")]
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{self, Thread};
use std::time::{Duration, Instant as Monotonic};

use r6_proto::Address;
use r6_proto::time::Instant;
use tokio::sync::oneshot;

use super::counts::{HistoryCounts, RobotCounts};
use super::journal::Journal;
use super::{HistorySettings, query};
use crate::clock;
use crate::core::history::event::Event;
use crate::core::history::sample::{Interval, Micros, Sample};
use crate::core::history::wall::WallClock;
use crate::core::name::RobotName;
use crate::core::owner::Claim;
use crate::core::watch::Before;
use crate::store::StoreError;
#[cfg(feature = "simulation")]
use crate::store::history::Days;
use crate::store::history::{HistoryStore, Place};

/// How often what came is written: what is younger is lost with the process.
const EVERY: Duration = Duration::from_millis(250);

/// How long a disk that failed is left alone before the next attempt.
const AFTER_FAILURE: Duration = Duration::from_secs(1);

/// How often the limits are looked at, even if little is written: a day ends.
const LIMITS_EVERY: Duration = Duration::from_secs(10);

/// How long the thread may take for one turn before the history counts as paused: a write hangs.
const HANGS: Duration = Duration::from_secs(2);

/// What the averages of days that are over may cost in one turn, in samples that are decoded: about the day
/// of two signals.
const AVERAGES_A_TURN: u64 = 400_000;

/// For how long a turn goes on with averages: files that are in no cache take longer.
const AVERAGES_TIME: Duration = Duration::from_millis(20);

/// How long a query waits for the thread.
const ANSWER_TIME: Duration = Duration::from_secs(2);

/// How many batches wait: 0.4 s of a thousand robots that are read ten times a second. A batch has some
/// kilobytes at most, so this is some megabytes.
const MAX_WAITING: usize = 4096;

/// At how many waiting batches the thread is woken before the next write. To wake it for each would cost as
/// much as to keep it.
const MANY: usize = MAX_WAITING / 8;

/// What was read of a robot and is to be kept.
#[derive(Debug)]
pub struct Batch {
    /// The robot.
    pub robot: RobotName,
    /// Everything of this robot that was read until this time is in this batch or in one before.
    pub time: Micros,
    /// The samples, with the interval of their signal.
    pub samples: Vec<(Address, Interval, Sample)>,
    /// What was seen to happen.
    pub events: Vec<Event>,
    /// Its counts.
    pub counts: Arc<RobotCounts>,
}

/// What a batch had that is not kept.
#[derive(Debug, Default)]
pub struct NotKept {
    /// The samples, which are lost.
    pub samples: Vec<(Address, Interval, Sample)>,
    /// The events, to be handed over again.
    pub events: Vec<Event>,
}

/// The samples of a signal that are not in a chunk on the disk, by block.
pub type Open = Vec<(Interval, Vec<Sample>)>;

enum Job {
    Keep(Batch),
    Open(RobotName, Address, oneshot::Sender<Open>),
    LastSeen(RobotName, oneshot::Sender<Before>),
    TakeOver(Vec<Claim>),
    End(oneshot::Sender<Result<(), StoreError>>),
}

/// A handle on the thread of the history. The thread ends with the last handle, after all that was asked for.
#[derive(Clone, Debug)]
pub struct Recorder {
    jobs: SyncSender<Job>,
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    settings: HistorySettings,
    counts: Arc<HistoryCounts>,
    clock: Mutex<WallClock>,
    reader: query::Reader,
    /// When the thread began its last turn.
    turn: Mutex<Monotonic>,
    /// How many batches wait.
    waiting: AtomicUsize,
    /// The thread, which is woken by this handle. A simulation has no thread.
    thread: OnceLock<Thread>,
}

impl Recorder {
    /// Starts the thread for the history in this place.
    ///
    /// # Errors
    /// [`StoreError`]: the system gives no thread.
    pub fn start(place: Place, settings: HistorySettings) -> Result<Self, StoreError> {
        let store = place.to_write(settings.max_bytes)?;
        let (recorder, worker, jobs) = Self::new(store, place, settings);
        let thread = thread::Builder::new()
            .name("history".to_owned())
            .spawn(move || work(worker, &jobs))
            .map_err(|error| StoreError::Unavailable(format!("the system gives no thread: {error}")))?;
        recorder.shared.thread.get_or_init(|| thread.thread().clone());
        Ok(recorder)
    }

    /// The history of a simulated world: a task on its time does the work. What is asked for waits up to
    /// 250 ms.
    #[cfg(feature = "simulation")]
    pub fn in_task(folder: &Path, settings: HistorySettings) -> Self {
        let store: Box<dyn HistoryStore> = Box::new(Days::to_write(folder, settings.max_bytes));
        let (recorder, worker, jobs) = Self::new(store, Place::Folder(folder.to_owned()), settings);
        tokio::spawn(work_in_task(worker, jobs));
        recorder
    }

    fn new(
        store: Box<dyn HistoryStore>,
        place: Place,
        settings: HistorySettings,
    ) -> (Self, Worker, Receiver<Job>) {
        let reader = query::Reader::new(place.clone());
        let counts = Arc::<HistoryCounts>::default();
        let clock = Mutex::new(WallClock::new(clock::now(), clock::system()));
        let shared = Shared {
            settings: settings.clone(),
            counts: Arc::clone(&counts),
            clock,
            reader,
            turn: Mutex::new(Monotonic::now()),
            waiting: AtomicUsize::new(0),
            thread: OnceLock::new(),
        };
        let shared = Arc::new(shared);
        let (jobs, waiting) = sync_channel(MAX_WAITING);
        let is_shared = matches!(place, Place::Database { .. });
        let journal = Journal::new(store, settings, counts);
        let journal = if is_shared { journal.shared() } else { journal };
        let worker = Worker { journal, shared: Arc::clone(&shared), failed: false };
        (Self { jobs, shared }, worker, waiting)
    }

    /// Hands over what is to be kept; never waits.
    ///
    /// # Errors
    /// Too much waits already. What is not kept comes back.
    pub fn keep(&self, batch: Batch) -> Result<(), NotKept> {
        // What happened is asked for sooner than samples.
        let has_events = !batch.events.is_empty();
        // Before it is sent: the thread takes off what it has taken.
        let waiting = self.shared.waiting.fetch_add(1, Ordering::Relaxed) + 1;
        self.jobs.try_send(Job::Keep(batch)).map_err(|error| {
            self.shared.waiting.fetch_sub(1, Ordering::Relaxed);
            match error {
                TrySendError::Full(Job::Keep(batch)) | TrySendError::Disconnected(Job::Keep(batch)) => {
                    NotKept { samples: batch.samples, events: batch.events }
                }
                // Only a batch was sent.
                TrySendError::Full(_) | TrySendError::Disconnected(_) => NotKept::default(),
            }
        })?;
        if has_events || waiting == MANY {
            self.shared.wake();
        }
        Ok(())
    }

    /// This gateway owns these from now on. It waits while there is no room: what comes next is written under
    /// these claims.
    pub async fn take_over(&self, claims: Vec<Claim>) {
        let jobs = self.jobs.clone();
        // A thread that waits holds up no task. Without the thread of the history nothing is written anyway.
        let shared = Arc::clone(&self.shared);
        let send = move || jobs.send(Job::TakeOver(claims)).map(|()| shared.wake());
        drop(tokio::task::spawn_blocking(send).await);
    }

    /// When a robot was read last, in this process or before. It is not known if the disk does not answer.
    pub async fn last_seen(&self, robot: RobotName) -> Before {
        let (answer, answered) = oneshot::channel();
        if self.jobs.try_send(Job::LastSeen(robot, answer)).is_err() {
            return Before::Seen(None);
        }
        self.shared.wake();
        match tokio::time::timeout(ANSWER_TIME, answered).await {
            Ok(Ok(before)) => before,
            Ok(Err(_)) | Err(_) => Before::Seen(None),
        }
    }

    /// The samples of a signal that are not in a chunk on the disk yet.
    ///
    /// # Errors
    /// [`StoreError`]: too much waits, or the thread has ended.
    pub async fn open(&self, robot: RobotName, address: Address) -> Result<Open, StoreError> {
        let (answer, answered) = oneshot::channel();
        self.jobs.try_send(Job::Open(robot, address, answer)).map_err(|error| match error {
            TrySendError::Full(_) => StoreError::Unavailable("too many samples wait for the disk".to_owned()),
            TrySendError::Disconnected(_) => StoreError::Closed,
        })?;
        self.shared.wake();
        match tokio::time::timeout(ANSWER_TIME, answered).await {
            Ok(answered) => answered.map_err(|_| StoreError::Closed),
            Err(_) => Err(StoreError::Unavailable("the disk of the history does not answer".to_owned())),
        }
    }

    /// Whether the disk does not take samples: it refuses them, or a write hangs.
    pub fn is_paused(&self) -> bool {
        let turn = *self.shared.turn.lock().unwrap_or_else(PoisonError::into_inner);
        self.shared.counts.paused.load(Ordering::Relaxed) || turn.elapsed() > HANGS
    }

    /// Writes what is left, and ends the thread.
    ///
    /// # Errors
    /// [`StoreError`]: not everything was written.
    pub async fn end(&self) -> Result<(), StoreError> {
        let (answer, answered) = oneshot::channel();
        let jobs = self.jobs.clone();
        // There may be no room for the moment. A thread that waits for it holds up no task.
        let shared = Arc::clone(&self.shared);
        let send = move || jobs.send(Job::End(answer)).map(|()| shared.wake()).is_ok();
        let sent = tokio::task::spawn_blocking(send).await;
        if !sent.unwrap_or(false) {
            return Err(StoreError::Closed);
        }
        answered.await.unwrap_or(Err(StoreError::Closed))
    }

    /// What is kept.
    pub fn settings(&self) -> &HistorySettings {
        &self.shared.settings
    }

    /// The counts of all robots.
    pub fn counts(&self) -> &HistoryCounts {
        &self.shared.counts
    }

    /// The time of day at a moment, as it is kept.
    pub fn time(&self, at: Instant) -> Micros {
        self.shared.clock().time(at).kept()
    }

    /// What reads the history.
    pub fn reader(&self) -> &query::Reader {
        &self.shared.reader
    }
}

impl Shared {
    /// Lets the thread do what waits, and not only with its next write.
    fn wake(&self) {
        self.thread.get().into_iter().for_each(Thread::unpark);
    }

    fn clock(&self) -> MutexGuard<'_, WallClock> {
        self.clock.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What the thread does. In a simulation a task does it.
struct Worker {
    journal: Journal<Box<dyn HistoryStore>>,
    shared: Arc<Shared>,
    /// Whether the last write failed.
    failed: bool,
}

impl Worker {
    /// Does a job. `None` if it was the last one: then the files are closed.
    fn handle(mut self, job: Job) -> Option<Self> {
        match job {
            Job::Keep(batch) => {
                self.shared.waiting.fetch_sub(1, Ordering::Relaxed);
                self.journal.take(clock::now(), batch);
            }
            // A caller that has gone needs no answer.
            Job::Open(robot, address, answer) => drop(answer.send(self.journal.open(&robot, address))),
            Job::LastSeen(robot, answer) => {
                let time = self.shared.clock().time(clock::now());
                let _ = answer.send(self.journal.last_seen(clock::now(), time, &robot));
            }
            Job::TakeOver(claims) => self.journal.take_over(&claims),
            Job::End(answer) => {
                let flushed = self.flush();
                // Before the caller goes on, who may end the process: the files need no log beside them then.
                drop(self);
                let _ = answer.send(flushed);
                return None;
            }
        }
        Some(self)
    }

    fn begin_turn(&self) {
        *self.shared.turn.lock().unwrap_or_else(PoisonError::into_inner) = Monotonic::now();
    }

    fn flush(&mut self) -> Result<(), StoreError> {
        let time = self.shared.clock().time(clock::now());
        self.journal.flush(clock::now(), time)
    }

    /// Writes what came, and looks at the limits first if it is time for that. Returns when to write again.
    fn write(&mut self, limits: bool) -> Duration {
        look_at_clock(&mut self.journal, &self.shared);
        let time = self.shared.clock().time(clock::now());
        let looked = if limits { self.journal.look_at_limits(time) } else { Ok(()) };
        let flushed = self.flush();
        match looked.and(flushed) {
            Err(error) if !self.failed => {
                tracing::error!(%error, "the history pauses: samples wait in memory, and are lost once it is full");
                self.failed = true;
            }
            Ok(()) if self.failed => {
                tracing::info!("the history goes on");
                self.failed = false;
            }
            Ok(()) | Err(_) => {}
        }
        if self.failed {
            return AFTER_FAILURE;
        }
        self.average(time);
        EVERY
    }

    /// Computes some averages of days that are over.
    fn average(&mut self, time: Micros) {
        // The time of a simulated world stands still meanwhile: there the cost alone counts.
        let begun = self.shared.thread.get().map(|_| Monotonic::now());
        let mut cost = 0;
        while cost < AVERAGES_A_TURN && begun.is_none_or(|begun| begun.elapsed() < AVERAGES_TIME) {
            match self.journal.average(time) {
                Ok(Some(more)) => cost += more,
                Ok(None) => return,
                Err(error) => {
                    tracing::error!(%error, "averages of a day cannot be computed");
                    return;
                }
            }
        }
    }
}

fn work(mut worker: Worker, jobs: &Receiver<Job>) {
    let mut next_write = Monotonic::now();
    let mut next_limits = next_write + LIMITS_EVERY;
    loop {
        worker.begin_turn();
        match jobs.try_recv() {
            Ok(job) => {
                let Some(goes_on) = worker.handle(job) else { return };
                worker = goes_on;
            }
            // A wake-up from before this call ends it at once.
            Err(TryRecvError::Empty) => {
                thread::park_timeout(next_write.saturating_duration_since(Monotonic::now()));
            }
            Err(TryRecvError::Disconnected) => return drop(worker.flush()),
        }
        if Monotonic::now() < next_write {
            continue;
        }
        let limits = Monotonic::now() >= next_limits;
        if limits {
            next_limits = Monotonic::now() + LIMITS_EVERY;
        }
        next_write = Monotonic::now() + worker.write(limits);
    }
}

/// The same on the time of a simulated world.
#[cfg(feature = "simulation")]
async fn work_in_task(mut worker: Worker, jobs: Receiver<Job>) {
    use tokio::time::{Instant, sleep};

    let mut next_limits = Instant::now() + LIMITS_EVERY;
    loop {
        worker.begin_turn();
        loop {
            match jobs.try_recv() {
                Ok(job) => {
                    let Some(goes_on) = worker.handle(job) else { return };
                    worker = goes_on;
                }
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return drop(worker.flush()),
            }
        }
        let limits = Instant::now() >= next_limits;
        if limits {
            next_limits = Instant::now() + LIMITS_EVERY;
        }
        let wait = worker.write(limits);
        sleep(wait).await;
    }
}

/// Notices that somebody set the clock of the system.
fn look_at_clock<S: HistoryStore>(journal: &mut Journal<S>, shared: &Shared) {
    let stepped = shared.clock().look(clock::now(), clock::system());
    if let Some(by_us) = stepped {
        tracing::warn!(by_us, "the clock of the system was set: times in the history step too");
        shared.counts.clock_steps.fetch_add(1, Ordering::Relaxed);
        journal.seal_all();
    }
}
