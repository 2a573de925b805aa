//! Decides which thread reads, and which thread is called when something has to be done.
//!
//! ```text
//!               sit, no thread reads                 stand
//!  (a thread) ───────────────────────▶ reads ───────────────────▶ away: the next parked thread is called
//!       │  ▲                                                        ▲
//!       │  └────── called, or its time is over ──────┐              │ stand
//!       └───── sit, another reads, or no socket ──▶ parked ─────────┘
//! ```
//!
//! 1. One thread reads. A reading thread cannot be called: it returns at its own time.
//! 2. A thread that stops reading calls a parked thread. A called thread sits again, or stands and then calls
//!    the next.
//! 3. The next deadline is always covered: a parked thread or the keeper returns by then, or the reading
//!    thread returns well before. A thread that sits, stands or moves a deadline checks whether that still
//!    holds. If not, it calls the keeper.
//! 4. A thread that starts something handles it before it blocks or leaves. If that thread is a stranger to
//!    this connection, a parked thread is called, or else the keeper. Between two reads the keeper checks
//!    without a call.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_proto::time::Instant;

use super::signal::Signal;

/// The keeper reads after no call has waited for this long. Calls that follow each other faster never find it
/// reading.
const FIRST_PAUSE: Duration = Duration::from_millis(1);

/// While calls follow each other, the keeper checks this often whether they have ended.
const LONGEST_PAUSE: Duration = Duration::from_millis(10);

/// While nothing is under way, the keeper checks this often whether the connection has ended, because a
/// controller has few connections.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// A read timeout ends later than it was set, rounded up to ticks of the system: 4 ms each on most, 10 ms on
/// some. A parked thread keeps a deadline that is nearer than this.
pub(super) const READ_SLACK: Duration = Duration::from_millis(20);

/// What a thread that sits down has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    Read,
    /// Park until this time, or until it is called.
    Park(Option<Instant>),
}

/// What the keeper has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Plan {
    /// Read, and wait for bytes.
    Read,
    /// Read the bytes that are there.
    Look,
    Park(Instant),
}

/// The present situation, for deciding which thread to call.
#[derive(Clone, Copy, Debug)]
pub(super) struct Now {
    pub at: Instant,
    /// The next deadline.
    pub due: Option<Instant>,
    /// Whether there is work under way, perhaps without a call that waits.
    pub busy: bool,
    /// Whether the controller owes a reply.
    pub awaits: bool,
}

impl Now {
    /// Whether a waiting thread may read meanwhile: for a reply, or if the next deadline is far enough away.
    pub fn lets_read(&self) -> bool {
        self.awaits || self.due.is_none_or(|due| due > self.at + READ_SLACK)
    }
}

/// The memory of the keeper between two plans.
#[derive(Debug)]
pub(super) struct Rhythm {
    entries: u64,
    /// When the keeper last found that a thread had sat down.
    heard_at: Option<Instant>,
    pause: Duration,
    look_at: Instant,
}

impl Rhythm {
    pub fn begin(now: Instant) -> Self {
        Self { entries: 0, heard_at: None, pause: FIRST_PAUSE, look_at: now + LOOK_EVERY }
    }
}

/// The threads that wait on one connection.
#[derive(Debug, Default)]
pub(super) struct Turns {
    inner: Mutex<Inner>,
    /// Whether something happened that no thread has handled.
    happened: AtomicBool,
}

#[derive(Debug, Default)]
struct Inner {
    /// When the reading thread returns at the latest; `None`: no thread reads.
    reader: Option<Instant>,
    parked: Vec<(Arc<Signal>, Option<Instant>)>,
    /// The keeper, and until when it is parked. The time is `None` while the keeper is awake or reads.
    keeper: Option<(Arc<Signal>, Option<Instant>)>,
    /// How often threads have sat down.
    entries: u64,
    /// Whether a thread drives the errands.
    carrying: bool,
    /// Operations that other executors poll. The threads of those executors never read.
    strangers: usize,
    /// Whether any errand is under way.
    errands: bool,
}

impl Inner {
    fn forget(&mut self, me: &Arc<Signal>) {
        self.parked.retain(|(signal, _)| !Arc::ptr_eq(signal, me));
    }

    /// Whether a thread returns by this time.
    fn is_covered(&self, due: Option<Instant>) -> bool {
        let Some(due) = due else { return true };
        let parked = self.parked.iter().filter_map(|(_, until)| *until);
        let keeper = self.keeper.iter().filter_map(|(_, until)| *until);
        let reader = self.reader.map(|until| until + READ_SLACK);
        reader.into_iter().chain(parked).chain(keeper).any(|until| until <= due)
    }

    /// Takes a parked thread whose future still waits. That thread then sits again, or stands.
    fn call_parked(&mut self) -> Option<Arc<Signal>> {
        let at = self.parked.iter().rposition(|(signal, _)| !signal.is_woken())?;
        Some(self.parked.remove(at).0)
    }

    fn keeper_reads(&mut self, until: Option<Instant>, plan: Plan) -> Plan {
        self.reader = until;
        self.keeper.iter_mut().for_each(|(_, parked)| *parked = None);
        plan
    }

    /// The keeper, if no other thread returns by this time.
    fn cover(&self, due: Option<Instant>) -> Option<Arc<Signal>> {
        let (keeper, _) = self.keeper.as_ref()?;
        (!self.is_covered(due)).then(|| Arc::clone(keeper))
    }

    fn is_wanted(&self, busy: bool) -> bool {
        busy || self.errands || self.strangers > 0
    }

    /// The thread to call so that a thread reads and the next deadline is covered.
    fn settle(&mut self, now: Now) -> Option<Arc<Signal>> {
        if self.reader.is_none()
            && let Some(next) = self.call_parked()
        {
            return Some(next);
        }
        let (keeper, until) = self.keeper.as_ref()?;
        let alone = self.reader.is_none() && self.parked.is_empty();
        let is_far = until.is_some_and(|until| until > now.at + LONGEST_PAUSE);
        let comes_in_time = self.is_covered(now.due) && !(alone && is_far && self.is_wanted(now.busy));
        (!comes_in_time).then(|| Arc::clone(keeper))
    }
}

fn call(signal: Option<Arc<Signal>>) {
    if let Some(signal) = signal {
        signal.call();
    }
}

impl Turns {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Registers a waiting thread. `reads`: until when it would read, if there is a socket.
    pub fn sit(&self, me: &Arc<Signal>, reads: Option<Instant>, due: Option<Instant>) -> Turn {
        let mut inner = self.inner();
        inner.entries = inner.entries.wrapping_add(1);
        inner.forget(me);
        if reads.is_some() && inner.reader.is_none() {
            inner.reader = reads;
            let next = inner.cover(due);
            drop(inner);
            call(next);
            return Turn::Read;
        }
        let until = if inner.is_covered(due) { None } else { due };
        inner.parked.push((Arc::clone(me), until));
        Turn::Park(until)
    }

    /// Tells that the reading thread continues to read.
    pub fn read_on(&self, until: Instant, due: Option<Instant>) {
        let mut inner = self.inner();
        inner.reader = Some(until);
        let next = inner.cover(due);
        drop(inner);
        call(next);
    }

    /// Tells that a thread leaves. It was reading, or it was parked or called.
    pub fn stand(&self, me: &Arc<Signal>, reads: bool, now: Now) {
        let mut inner = self.inner();
        if reads {
            inner.reader = None;
        } else {
            inner.forget(me);
        }
        let next = inner.settle(now);
        drop(inner);
        call(next);
    }

    /// Takes the turn to read the bytes that are there, without waiting. Returns `false` if another thread
    /// reads.
    pub fn glance(&self, now: Instant) -> bool {
        let mut inner = self.inner();
        let free = inner.reader.is_none();
        if free {
            inner.reader = Some(now);
        }
        free
    }

    /// Ends a glance, or the keeper's reading.
    pub fn stop_reading(&self, now: Now) {
        let mut inner = self.inner();
        inner.reader = None;
        let next = inner.settle(now);
        drop(inner);
        call(next);
    }

    /// Calls the thread that is needed. Used after a deadline was moved, or a socket was opened.
    pub fn settle(&self, now: Now) {
        let next = self.inner().settle(now);
        call(next);
    }

    /// Whether something happened that no thread has handled.
    pub fn has_happened(&self) -> bool {
        self.happened.load(Ordering::SeqCst)
    }

    /// Notes that something happened. This thread handles it before it blocks or leaves.
    pub fn note(&self) {
        self.happened.store(true, Ordering::SeqCst);
    }

    /// Notes that a stranger started something: another thread has to handle it.
    pub fn summon(&self) {
        self.note();
        let mut inner = self.inner();
        if inner.carrying {
            return;
        }
        let next =
            inner.call_parked().or_else(|| inner.keeper.as_ref().map(|(keeper, _)| Arc::clone(keeper)));
        drop(inner);
        call(next);
    }

    /// Takes the right to drive the errands. Returns `false` if another thread has it; that thread looks
    /// again before it ends.
    pub fn begin(&self) -> bool {
        let mut inner = self.inner();
        if inner.carrying {
            self.note();
            return false;
        }
        inner.carrying = true;
        self.happened.store(false, Ordering::SeqCst);
        true
    }

    /// Gives back that right. Returns `false` if something happened meanwhile, which has to be handled first.
    /// `errands`: whether any is under way.
    pub fn end(&self, errands: bool) -> bool {
        let mut inner = self.inner();
        inner.errands = errands;
        inner.carrying = self.happened.swap(false, Ordering::SeqCst);
        !inner.carrying
    }

    /// Gives back that right, even if something happened meanwhile.
    pub fn interrupt(&self) {
        let mut inner = self.inner();
        inner.carrying = false;
        self.note();
    }

    /// Notes that an operation that another executor polls waits.
    pub fn stranger_came(&self) {
        self.inner().strangers += 1;
    }

    pub fn stranger_went(&self) {
        let mut inner = self.inner();
        inner.strangers = inner.strangers.saturating_sub(1);
    }

    pub fn keeper_came(&self, keeper: &Arc<Signal>) {
        self.inner().keeper = Some((Arc::clone(keeper), None));
    }

    pub fn keeper_went(&self) {
        self.inner().keeper = None;
    }

    /// Whether anything is under way for which the keeper is needed.
    pub fn is_wanted(&self, busy: bool) -> bool {
        self.inner().is_wanted(busy)
    }

    /// Decides what the keeper does next. `reads`: as in [`Self::sit`].
    pub fn plan(&self, rhythm: &mut Rhythm, reads: Option<Instant>, now: Now) -> Plan {
        let mut inner = self.inner();
        if rhythm.entries != inner.entries {
            (rhythm.entries, rhythm.heard_at) = (inner.entries, Some(now.at));
        }
        // The keeper may be called at any time, also by itself. So waking up alone does not count as
        // activity.
        let quiet = rhythm.heard_at.is_none_or(|at| now.at.since(at) >= FIRST_PAUSE);
        let alone = inner.reader.is_none() && inner.parked.is_empty();
        if inner.reader.is_none()
            && now.awaits
            && let Some(next) = inner.call_parked()
        {
            next.call();
        }
        let looks = rhythm.look_at <= now.at;
        if looks {
            rhythm.look_at = now.at + LOOK_EVERY;
        }
        let mut until = rhythm.look_at;
        let free = inner.reader.is_none() && reads.is_some();
        if inner.is_wanted(now.busy) {
            if alone && quiet && free {
                rhythm.pause = FIRST_PAUSE;
                return inner.keeper_reads(reads, Plan::Read);
            }
            // A call that waits for long calls the keeper when it leaves.
            if !quiet || alone {
                until = until.min(now.at + rhythm.pause);
                rhythm.pause = (rhythm.pause * 2).min(LONGEST_PAUSE);
            }
        }
        if looks && free {
            return inner.keeper_reads(Some(now.at), Plan::Look);
        }
        let until = now.due.map_or(until, |due| due.min(until));
        inner.keeper.iter_mut().for_each(|(_, parked)| *parked = Some(until));
        Plan::Park(until)
    }

    /// Notes that the keeper is awake.
    pub fn keeper_woke(&self) {
        self.inner().keeper.iter_mut().for_each(|(_, until)| *until = None);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use std::task::Wake;

    use super::super::system::Std;
    use super::*;

    fn at(ms: u64) -> Instant {
        Instant::ORIGIN + Duration::from_millis(ms)
    }

    fn now(due: Option<u64>) -> Now {
        Now { at: at(0), due: due.map(at), busy: false, awaits: false }
    }

    /// The state of a thread, as the test sees it.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    enum Seen {
        Away,
        Reads(u64),
        Parked(Option<Instant>),
    }

    #[derive(Clone, Debug)]
    enum Step {
        /// A thread sits down, or sits again, with this deadline ahead.
        Sit(usize, Option<u64>),
        /// The future of a thread can continue.
        Wake(usize),
        /// A thread leaves; the deadline has changed by then.
        Stand(usize, Option<u64>),
        Summon,
    }

    fn steps() -> impl Strategy<Value = Vec<Step>> {
        let due = || prop::option::weighted(0.7, 1_u64..100);
        let step = prop_oneof![
            4 => (0_usize..5, due()).prop_map(|(thread, due)| Step::Sit(thread, due)),
            2 => (0_usize..5).prop_map(Step::Wake),
            3 => (0_usize..5, due()).prop_map(|(thread, due)| Step::Stand(thread, due)),
            1 => Just(Step::Summon),
        ];
        prop::collection::vec(step, 1..60)
    }

    fn forget_calls(signal: &Arc<Signal>) {
        // The call was pending, so `park` returns at once.
        signal.call();
        signal.park(None);
    }

    proptest! {
        /// For any sequence of steps: if a thread is parked, another reads, or one was called that will read.
        /// And some thread returns by the deadline.
        #[test]
        fn the_reading_is_never_lost(steps in steps()) {
            let turns = Turns::default();
            let threads: Vec<_> = (0..5).map(|_| Signal::here(&Std::start())).collect();
            let keeper = Signal::here(&Std::start());
            turns.keeper_came(&keeper);
            let mut seen = [Seen::Away; 5];
            for step in steps {
                forget_calls(&keeper);
                let mut due_now = None;
                match step {
                    Step::Sit(thread, due) => {
                        if matches!(seen[thread], Seen::Reads(_)) || threads[thread].is_woken() {
                            continue;
                        }
                        forget_calls(&threads[thread]);
                        let until = due.unwrap_or(50).min(50);
                        seen[thread] = match turns.sit(&threads[thread], Some(at(until)), due.map(at)) {
                            Turn::Read => Seen::Reads(until),
                            Turn::Park(until) => Seen::Parked(until),
                        };
                        due_now = due;
                    }
                    Step::Wake(thread) => threads[thread].wake_by_ref(),
                    Step::Stand(thread, due) => {
                        if seen[thread] == Seen::Away {
                            continue;
                        }
                        let reads = matches!(seen[thread], Seen::Reads(_));
                        turns.stand(&threads[thread], reads, now(due));
                        seen[thread] = Seen::Away;
                        threads[thread].begin_poll();
                        forget_calls(&threads[thread]);
                        due_now = due;
                    }
                    Step::Summon => {
                        turns.summon();
                        let anybody = threads.iter().chain([&keeper]).any(|signal| signal.is_called());
                        prop_assert!(anybody, "no thread serves what a stranger caused");
                    }
                }
                let readers = seen.iter().filter(|seen| matches!(seen, Seen::Reads(_))).count();
                prop_assert!(readers <= 1);
                // A called or woken thread sits again or stands.
                let comes = |thread: usize| threads[thread].is_called() || threads[thread].is_woken();
                let waits = |thread: &usize| matches!(seen[*thread], Seen::Parked(_));
                let somebody_comes = (0..5).filter(waits).any(comes);
                prop_assert!(readers == 1 || somebody_comes || !(0..5).any(|thread| waits(&thread)), "{seen:?}");
                let covers = |seen: &Seen, due| match seen {
                    Seen::Away => false,
                    Seen::Reads(until) => at(*until) + READ_SLACK <= at(due),
                    Seen::Parked(until) => until.is_some_and(|until| until <= at(due)),
                };
                if let Some(due) = due_now {
                    let covered = seen.iter().any(|seen| covers(seen, due));
                    prop_assert!(covered || somebody_comes || keeper.is_called(), "{due} {seen:?}");
                }
            }
        }
    }

    #[test]
    fn the_keeper_reads_only_after_a_silence() {
        let turns = Turns::default();
        let (thread, keeper) = (Signal::here(&Std::start()), Signal::here(&Std::start()));
        turns.keeper_came(&keeper);
        let mut rhythm = Rhythm::begin(at(0));
        let wanted = |ms| Now { at: at(ms), due: None, busy: true, awaits: true };
        assert_eq!(turns.sit(&thread, Some(at(50)), None), Turn::Read);
        turns.stand(&thread, true, wanted(0));
        // There was a call since the keeper last checked, and another may follow soon.
        assert_eq!(turns.plan(&mut rhythm, Some(at(50)), wanted(0)), Plan::Park(at(1)));
        turns.sit(&thread, Some(at(50)), None);
        turns.stand(&thread, true, wanted(1));
        assert!(!keeper.is_called(), "it comes soon by itself");
        assert_eq!(turns.plan(&mut rhythm, Some(at(50)), wanted(1)), Plan::Park(at(3)));
        assert_eq!(turns.plan(&mut rhythm, Some(at(50)), wanted(3)), Plan::Read);
        assert!(matches!(turns.sit(&thread, Some(at(60)), None), Turn::Park(_)));
        turns.stop_reading(wanted(4));
        assert!(thread.is_called(), "a call that waits reads by itself");
        turns.stand(&thread, false, wanted(4));
        // The number of its checks does not matter.
        assert!(matches!(turns.plan(&mut rhythm, Some(at(50)), wanted(4)), Plan::Park(_)));
        assert!(matches!(turns.plan(&mut rhythm, Some(at(50)), wanted(4)), Plan::Park(_)));
        assert_eq!(turns.plan(&mut rhythm, Some(at(50)), wanted(5)), Plan::Read);
    }

    #[test]
    fn a_call_that_leaves_something_behind_calls_a_keeper_that_is_far() {
        let turns = Turns::default();
        let (thread, keeper) = (Signal::here(&Std::start()), Signal::here(&Std::start()));
        turns.keeper_came(&keeper);
        let mut rhythm = Rhythm::begin(at(0));
        assert_eq!(turns.plan(&mut rhythm, Some(at(50)), now(None)), Plan::Park(at(250)));
        turns.sit(&thread, Some(at(50)), None);
        turns.stand(&thread, true, now(None));
        assert!(!keeper.is_called(), "nothing is under way");
        turns.sit(&thread, Some(at(50)), None);
        turns.stand(&thread, true, now(Some(300)));
        assert!(!keeper.is_called(), "it comes in time");
        turns.sit(&thread, Some(at(50)), None);
        turns.stand(&thread, true, now(Some(200)));
        assert!(keeper.is_called());
    }
}
