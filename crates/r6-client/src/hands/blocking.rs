//! The driver ("hand") of programs without async: blocking sockets, driven by the threads that wait for a
//! reply.
//!
//! ```text
//!  a call:   polls its operation, which writes ──▶ reads until its reply is there, or waits while another
//!            thread reads
//!  no call:  the keeper, a thread of the connection, reads and keeps the deadlines if anything is under way;
//!            otherwise it checks now and then whether the connection has ended
//! ```
//!
//! Only reading needs a turn; [`Turns`] decides which thread reads. Any thread may do everything else:
//! [`StdHand::serve`] writes and keeps the deadlines of the connection, under its lock. [`StdHand::attend`]
//! drives the errands, one thread at a time.
//!
//! ```text
//!  read ──▶ serve ──▶ errands, if something happened ──▶ own reply there? ──▶ yes: stand, call the next
//!   ▲                                                           │ no
//!   └───────────────────────────────────────────────────────────┘
//! ```
//!
//! A thread that reads does not poll its caller's future, so a slow caller delays no other thread: by then it
//! has given up its turn to read. A "stranger" is a thread that does not drive this connection, such as one
//! that waits for something else, or another executor. When a stranger starts something, a parked thread or
//! the keeper handles it. If both are reading at that moment, they handle it when they return, after 50 ms at
//! most.

mod line;
mod signal;
pub(crate) mod system;
mod turns;

use std::cell::Cell;
use std::fmt;
use std::future::{Future, poll_fn};
use std::io;
use std::pin::{Pin, pin};
use std::ptr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::task::{Context, Poll, Wake, Waker};
use std::time::Duration;

use r6_proto::time::Instant;
use tokio::sync::oneshot;

use self::line::{Came, Line, Socket};
use self::signal::Signal;
use self::system::{Std, Stream, System};
use self::turns::{Now, Plan, Rhythm, Turn, Turns};
use crate::connection::Wants;
use crate::drive::{Driven, Hand, Second, SharedConnection};
use crate::errands::Errands;
use crate::error::{NotSent, RequestError};
use crate::hands::connect::Tcp;
use crate::hands::tokio::seed_from_clock;
use crate::identity::Identity;
use crate::robot::Robot;
use crate::seats::Seat;
use crate::settings::RobotSettings;

/// Replies are shorter than 4 KiB; a longer one is read in pieces.
const READ_BUFFER: usize = 4096;

/// The same thread looks again at most this often before it does anything else.
const MOST_LOOKS: usize = 64;

/// If no thread has read for this long, the client reads what has arrived before it writes, because a
/// connection that has ended accepts no bytes.
const UNREAD_FOR: Duration = Duration::from_millis(5);

/// Time given to the thread that reads when a deadline is over: that thread may just have been asleep, like
/// the whole computer, and the bytes that it has read come first.
const READER_FIRST: Duration = Duration::from_millis(1);

/// Stands for "no deadline".
const NEVER: u64 = u64::MAX;

/// Drives one connection over a blocking socket.
pub(crate) struct StdHand {
    me: Weak<Self>,
    shared: Arc<SharedConnection>,
    system: Arc<dyn System>,
    target: Tcp,
    turns: Turns,
    line: Mutex<Line>,
    /// Only for the thread that reads.
    buffer: Mutex<Box<[u8; READ_BUFFER]>>,
    errands: Mutex<Errands>,
    /// The waker of the errands.
    waker: Waker,
    /// The next deadline of connection and line, in nanoseconds.
    due: AtomicU64,
    busy: AtomicBool,
    awaits: AtomicBool,
    /// When a thread last read.
    read_at: AtomicU64,
}

impl fmt::Debug for StdHand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StdHand").field("shared", &self.shared).finish_non_exhaustive()
    }
}

/// Wakes this driver on behalf of the errands.
struct Summons(Weak<StdHand>);

impl Wake for Summons {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        if let Some(hand) = self.0.upgrade() {
            hand.nudge();
        }
    }
}

thread_local! {
    /// The driver that this thread runs now. This thread itself handles what it starts there.
    static HERE: Cell<*const StdHand> = const { Cell::new(ptr::null()) };
    /// Whether this thread has just updated the time and polls its future next.
    static TOLD: Cell<bool> = const { Cell::new(false) };
}

/// The first or the second connection of a robot.
enum Which {
    First,
    /// Opened by a stop beside the first connection, and never reconnected. The identity of the robot that
    /// has to be at its other end may be known.
    Second(Option<Identity>),
}

/// Marks this thread as driving a connection. Dropping it restores what the thread drove before.
struct Here<'h> {
    hand: &'h StdHand,
    before: *const StdHand,
}

impl<'h> Here<'h> {
    fn begin(hand: &'h StdHand) -> Self {
        Self { hand, before: HERE.replace(hand) }
    }
}

impl Drop for Here<'_> {
    fn drop(&mut self) {
        TOLD.set(false);
        if !ptr::eq(self.before, self.hand) {
            self.hand.attend_if_needed();
            self.hand.turns.settle(self.hand.now());
        }
        HERE.set(self.before);
    }
}

/// Marks this thread as driving the errands. Dropping it ends that, also on a panic.
struct Carrying<'h> {
    turns: &'h Turns,
    over: bool,
}

impl Drop for Carrying<'_> {
    fn drop(&mut self) {
        if !self.over {
            self.turns.interrupt();
        }
    }
}

impl StdHand {
    /// Connects, on the calling thread.
    pub fn connect(address: &str, settings: RobotSettings) -> Result<(Robot, Arc<Self>), RequestError> {
        Self::connect_in(Arc::new(Std::start()), address, settings)
    }

    /// Connects in another system; see [`System`].
    pub fn connect_in(
        system: Arc<dyn System>,
        address: &str,
        settings: RobotSettings,
    ) -> Result<(Robot, Arc<Self>), RequestError> {
        let target = Tcp::parse(address)?;
        let stream = line::dial_within(&system, &target, settings.connect_timeout)?;
        let (driven, hand) = Self::start(target, stream, &settings, Which::First, system)?;
        Ok((Robot::on(driven, settings), hand))
    }

    fn start(
        target: Tcp,
        stream: Box<dyn Stream>,
        settings: &RobotSettings,
        which: Which,
        system: Arc<dyn System>,
    ) -> Result<(Driven, Arc<Self>), NotSent> {
        let now = Instant::ORIGIN + system.now();
        let (expected, only_once) = match which {
            Which::First => (None, false),
            Which::Second(expected) => (expected, true),
        };
        let shared =
            SharedConnection::open((target.to_string(), false), settings, expected, now, seed_from_clock);
        let hand = Arc::new_cyclic(|me: &Weak<Self>| Self {
            me: Weak::clone(me),
            shared: Arc::clone(&shared),
            system: Arc::clone(&system),
            target: target.clone(),
            turns: Turns::default(),
            line: Mutex::new(Line::new(
                target,
                Arc::clone(&system),
                stream,
                settings.connect_timeout,
                only_once,
            )),
            buffer: Mutex::new(Box::new([0; READ_BUFFER])),
            errands: Mutex::default(),
            waker: Waker::from(Arc::new(Summons(Weak::clone(me)))),
            due: AtomicU64::new(NEVER),
            busy: AtomicBool::new(false),
            awaits: AtomicBool::new(false),
            read_at: AtomicU64::new(now.as_nanos()),
        });
        // The first heartbeat is sent before anything else.
        hand.serve(None);
        let keeper = Arc::clone(&hand);
        line::spawn(&*system, "r6-keeper", move || keeper.keep())?;
        Ok((Driven { shared, hand: Arc::clone(&hand) as Arc<dyn Hand> }, hand))
    }

    /// Runs a future to its end on this thread, and drives the connection meanwhile.
    pub fn block_on<F: Future>(&self, future: F) -> F::Output {
        let mut future = pin!(future);
        loop {
            // `run` waits inside.
            if let Poll::Ready(output) = self.run(future.as_mut(), None) {
                return output;
            }
        }
    }

    /// Runs a future on this thread for at most this time. Returns `None` if the future has not ended by
    /// then, or when a signal came to this thread. The future can continue later, here or elsewhere.
    pub fn block_on_for<F: Future + ?Sized>(&self, time: Duration, future: Pin<&mut F>) -> Option<F::Output> {
        self.tell_time();
        match self.run(future, Some(self.shared.hub.time.now() + time)) {
            Poll::Ready(output) => Some(output),
            Poll::Pending => None,
        }
    }

    fn run<F: Future + ?Sized>(&self, mut future: Pin<&mut F>, until: Option<Instant>) -> Poll<F::Output> {
        let _here = Here::begin(self);
        // `unconstrained`, because inside a tokio runtime, tokio's way to let other tasks run would make this
        // thread wait for ever.
        let whole = tokio::task::unconstrained(poll_fn(|_| {
            Signal::with(&*self.system, |me, waker| {
                loop {
                    me.begin_poll();
                    if let Poll::Ready(output) = future.as_mut().poll(&mut Context::from_waker(waker)) {
                        return Poll::Ready(output);
                    }
                    TOLD.set(false);
                    if !self.wait(me, until) {
                        return Poll::Pending;
                    }
                }
            })
        }));
        pin!(whole).poll(&mut Context::from_waker(Waker::noop()))
    }

    /// Reads, or waits for the thread that reads, until the future of this thread can continue. Returns
    /// `false` if the time or a signal came first.
    fn wait(&self, me: &Arc<Signal>, until: Option<Instant>) -> bool {
        let mut reads = false;
        let mut sits = false;
        while !me.is_woken() {
            if self.turns.has_happened() && self.attend() {
                continue;
            }
            let now = self.now();
            if until.is_some_and(|until| until <= now.at) {
                break;
            }
            if now.due.is_some_and(|due| due <= now.at) {
                self.tick(reads);
                continue;
            }
            let socket = self.line().socket().filter(|_| now.lets_read()).cloned();
            let reads_until = socket.as_ref().map(|socket| socket.reads_until(now, until));
            match (reads, reads_until) {
                (true, Some(reads_until)) => self.turns.read_on(reads_until, now.due),
                (true, None) => {
                    // There is no connection, or a read would miss a near deadline. Other threads can call
                    // this thread while it is parked.
                    reads = false;
                    self.turns.stop_reading(now);
                }
                (false, _) => {}
            }
            if !reads {
                sits = true;
                match self.turns.sit(me, reads_until, now.due) {
                    Turn::Read => reads = true,
                    Turn::Park(called_by) => {
                        let called_by = [called_by, until].into_iter().flatten().min();
                        me.park(called_by.map(|time| time.since(now.at)));
                        self.pass_time();
                        continue;
                    }
                }
            }
            if let Some(socket) = &socket
                && self.read(socket, now, until)
                && until.is_some()
            {
                // A caller with a time limit has something else to do after a signal.
                break;
            }
        }
        if sits {
            self.turns.stand(me, reads, self.now());
        }
        me.is_woken()
    }

    /// Waits for bytes until the given time at most, and takes them in. Returns whether a signal came to this
    /// thread instead. The caller must hold the turn to read.
    fn read(&self, socket: &Arc<Socket>, now: Now, until: Option<Instant>) -> bool {
        socket.set_time_out(now, until);
        let mut buffer = self.buffer();
        let came = socket.read(buffer.as_mut_slice());
        self.pass_time();
        TOLD.set(true);
        self.note_read();
        match came {
            Came::Read(read) => {
                let read = read.map(|bytes| buffer.get(..bytes).unwrap_or_default());
                self.serve(Some((socket, read)));
                false
            }
            Came::Nothing => false,
            Came::Signal => true,
        }
    }

    /// Takes in the bytes that are there, without waiting. The caller must hold the turn to read.
    fn glance(&self) {
        for _ in 0..MOST_LOOKS {
            let mut buffer = self.buffer();
            self.note_read();
            // No thread writes meanwhile, because the line is locked.
            let glanced = self.line().glance(buffer.as_mut_slice());
            let Some((socket, read)) = glanced else { return };
            let goes_on = read.as_ref().is_ok_and(|bytes| *bytes > 0);
            let read = read.map(|bytes| buffer.get(..bytes).unwrap_or_default());
            self.serve(Some((&socket, read)));
            if !goes_on {
                return;
            }
        }
    }

    /// Takes in the bytes that are there, if no thread reads now and none has read for a while.
    fn glance_if_unread(&self) {
        let read_at = Instant::from_nanos(self.read_at.load(Ordering::Relaxed));
        let now = self.shared.hub.time.now();
        if now.since(read_at) >= UNREAD_FOR && self.turns.glance(now) {
            self.glance();
            self.turns.stop_reading(self.now());
        }
    }

    /// Handles a deadline that is over. Bytes that have arrived by then count first.
    fn tick(&self, reads: bool) {
        self.pass_time();
        if reads {
            self.glance();
        } else if self.turns.glance(self.shared.hub.time.now()) {
            self.glance();
            self.turns.stop_reading(self.now());
        } else {
            self.system.sleep(READER_FIRST);
        }
        self.serve(None);
    }

    /// Takes in what was read, and does what is due on the connection now.
    fn serve(&self, read: Option<(&Arc<Socket>, io::Result<&[u8]>)>) {
        let mut connection = self.shared.connection();
        let now = self.shared.hub.time.now();
        let mut line = self.line();
        // Bytes that were read over an earlier socket do not count.
        if let Some((socket, read)) = read
            && line.is(socket)
        {
            match read {
                Ok(bytes) if !bytes.is_empty() => connection.received(bytes, now),
                ended => {
                    line.close();
                    connection.lost(line::reason(ended.map(<[u8]>::len)), now);
                }
            }
        }
        let mut came = false;
        let mut more = true;
        for _ in 0..MOST_LOOKS {
            connection.tick(now);
            connection.go_on(now);
            more = match connection.wants() {
                wants @ (Wants::Carry | Wants::Goodbye) => {
                    line.give_up();
                    line.write(&mut connection, wants, now)
                }
                Wants::Connect => {
                    line.close();
                    match line.connect(now, self.summoning()) {
                        Some(Ok(stream)) => {
                            line.open(stream);
                            connection.connected(now);
                            came = true;
                            true
                        }
                        Some(Err(error)) => {
                            connection.not_connected(&error);
                            true
                        }
                        None => false,
                    }
                }
                Wants::Nothing => {
                    line.close();
                    line.give_up();
                    false
                }
            };
            if !more {
                break;
            }
        }
        let deadlines = [connection.deadline(), line.deadline(), more.then_some(now)];
        let due = deadlines.into_iter().flatten().min().map_or(NEVER, Instant::as_nanos);
        self.due.store(due, Ordering::SeqCst);
        self.busy.store(connection.is_busy(), Ordering::SeqCst);
        self.awaits.store(connection.awaits_reply(), Ordering::SeqCst);
        drop(line);
        drop(connection);
        if came {
            self.note_read();
            self.turns.settle(self.now());
        }
    }

    /// Returns the function that a connecting thread calls at its end.
    fn summoning(&self) -> impl FnOnce() + Send + 'static {
        let me = Weak::clone(&self.me);
        move || {
            if let Some(hand) = me.upgrade() {
                hand.nudge();
            }
        }
    }

    /// Drives the errands as far as possible without waiting, and serves what they started. Returns `false`
    /// if another thread drives them.
    fn attend(&self) -> bool {
        if !self.turns.begin() {
            return false;
        }
        let mut carrying = Carrying { turns: &self.turns, over: false };
        for _ in 0..MOST_LOOKS {
            let any = {
                let mut errands = self.errands.lock().unwrap_or_else(PoisonError::into_inner);
                errands.drive(&self.shared.errands, &mut Context::from_waker(&self.waker));
                errands.any()
            };
            self.serve(None);
            if self.turns.end(any) {
                carrying.over = true;
                break;
            }
        }
        true
    }

    /// The main function of the keeper's thread. It ends with the connection.
    fn keep(&self) {
        let _here = Here::begin(self);
        let me = Signal::here(&*self.system);
        self.turns.keeper_came(&me);
        self.turns.note();
        let mut rhythm = Rhythm::begin(self.shared.hub.time.now());
        loop {
            self.pass_time();
            self.attend_if_needed();
            if self.shared.connection().is_closed() && !self.turns.is_wanted(false) {
                break;
            }
            let now = self.now();
            if now.due.is_some_and(|due| due <= now.at) {
                self.tick(false);
                continue;
            }
            let now = Now { busy: now.busy || self.shared.hub.is_watched(), ..now };
            let socket = self.line().socket().filter(|_| now.lets_read()).cloned();
            let until = socket.as_ref().map(|socket| socket.reads_until(now, None));
            match (self.turns.plan(&mut rhythm, until, now), &socket) {
                (Plan::Read, Some(socket)) => {
                    self.read(socket, now, None);
                    self.turns.stop_reading(self.now());
                }
                (Plan::Look, Some(_)) => {
                    self.glance();
                    self.turns.stop_reading(self.now());
                }
                (Plan::Park(until), _) => {
                    me.park(Some(until.since(now.at)));
                    self.turns.keeper_woke();
                }
                (Plan::Read | Plan::Look, None) => self.turns.stop_reading(now),
            }
        }
        self.turns.keeper_went();
    }

    fn attend_if_needed(&self) {
        if self.turns.has_happened() {
            self.attend();
        }
    }

    /// Handles at once what this thread, a stranger, started.
    pub fn look_after(&self) {
        self.turns.note();
        drop(Here::begin(self));
    }

    fn now(&self) -> Now {
        let time = &self.shared.hub.time;
        let own = match self.due.load(Ordering::SeqCst) {
            NEVER => None,
            nanos => Some(Instant::from_nanos(nanos)),
        };
        let due = [own, time.deadline()].into_iter().flatten().min();
        let (busy, awaits) = (self.busy.load(Ordering::SeqCst), self.awaits.load(Ordering::SeqCst));
        Now { at: time.now(), due, busy, awaits }
    }

    fn clock(&self) -> Instant {
        Instant::ORIGIN + self.system.now()
    }

    /// Updates the time after this thread has waited.
    fn pass_time(&self) {
        TOLD.set(false);
        self.shared.hub.time.pass(self.clock());
    }

    fn note_read(&self) {
        self.read_at.store(self.shared.hub.time.now().as_nanos(), Ordering::Relaxed);
    }

    fn is_here(&self) -> bool {
        ptr::eq(HERE.get(), self)
    }

    /// Locks the line. A caller that needs the connection too must lock that first.
    fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn buffer(&self) -> MutexGuard<'_, Box<[u8; READ_BUFFER]>> {
        self.buffer.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Hand for StdHand {
    fn tell_time(&self) {
        // The thread that has just read has already updated the time.
        if !(TOLD.take() && self.is_here()) {
            self.pass_time();
        }
    }

    fn carry(&self, seat: &mut Seat, _cx: &mut Context<'_>) -> bool {
        if self.is_here() {
            self.glance_if_unread();
            self.serve(None);
            self.attend_if_needed();
            return false;
        }
        // Another executor polls this operation; the keeper reads for it.
        if seat.0.replace(0).is_none() {
            self.turns.stranger_came();
        }
        let _here = Here::begin(self);
        self.glance_if_unread();
        self.serve(None);
        false
    }

    fn leave(&self, seat: &mut Seat) {
        if seat.0.take().is_some() {
            self.turns.stranger_went();
        }
    }

    fn nudge(&self) {
        if self.is_here() {
            self.turns.note();
        } else {
            self.turns.summon();
        }
    }

    fn second(&self, settings: RobotSettings, expected: Option<Identity>) -> Second<'_> {
        Box::pin(async move {
            let (tell, told) = oneshot::channel();
            let (target, within) = (self.target.clone(), settings.connect_timeout);
            let system = Arc::clone(&self.system);
            line::spawn(&*self.system, "r6-connect", move || {
                // If the receiver is gone, the connection is closed.
                tell.send(line::dial(&*system, &target, within)).ok();
            })?;
            let over = NotSent::ConnectTimedOut { address: self.target.to_string(), after: within };
            let time = &self.shared.hub.time;
            let stream = match time.timeout_at(self.clock() + within, told).await {
                Ok(Ok(made)) => made?,
                Ok(Err(_)) | Err(_) => return Err(over),
            };
            let system = Arc::clone(&self.system);
            let which = Which::Second(expected);
            let (driven, _hand) = Self::start(self.target.clone(), stream, &settings, which, system)?;
            Ok(driven)
        })
    }
}
