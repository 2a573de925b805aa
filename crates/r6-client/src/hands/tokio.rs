//! The hand of async programs: tokio's sockets and timers, and a task as keeper.

use std::fmt;
use std::future::{Future, poll_fn};
use std::io;
use std::pin::{Pin, pin};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::SystemTime;

use r6_proto::time::Instant;
use tokio::io::ReadBuf;
use tokio::runtime::Handle;
use tokio::task::coop::unconstrained;
use tokio::time::{Sleep, sleep_until};

use crate::connection::{Connection, Wants};
use crate::drive::{Driven, Hand, Second, SharedConnection};
use crate::errands::Errands;
use crate::error::{NotSent, RequestError};
use crate::hands::clock::Clock;
use crate::hands::connect::{Carrier, Connect, Dial, Dialer, Once, Tcp};
use crate::identity::Identity;
use crate::pushed::LostReason;
use crate::robot::Robot;
use crate::seats::{Seat, Seats};
use crate::settings::{Heartbeat, RobotSettings};

/// Replies are below 4 KiB; a longer one is read in pieces.
const READ_BUFFER: usize = 4096;

/// So often the same call looks before others on its thread have a turn.
const MOST_LOOKS: usize = 32;

/// Drives one connection over tokio.
pub(crate) struct TokioHand {
    shared: Arc<SharedConnection>,
    clock: Clock,
    dial: Arc<dyn Dial>,
    settings: RobotSettings,
    runtime: Handle,
    seats: Arc<Seats>,
    /// Of the seats: what sockets, timers and errands wake.
    waker: Waker,
    io: Mutex<Io>,
}

/// So many reads follow each other before anything is written: no flood of input delays a stop for longer.
const MOST_READS: usize = 4;

/// What came of reading.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Read {
    Nothing,
    Something,
    /// There may be more.
    More,
}

/// What only the one who carries has.
struct Io {
    stream: Option<Box<dyn Carrier>>,
    /// Whether our side of the connection was ended.
    shut: bool,
    attempt: Option<Attempt>,
    errands: Errands,
    /// One timer for all waits. It is set again only for an earlier deadline: a request whose reply came leaves the timer as
    /// it is, and the timer's waking for nothing, once in a reply's time-out, is cheaper than setting it for each.
    timer: Pin<Box<Sleep>>,
    /// Whether the timer wakes the seats when it goes off.
    armed: bool,
    buffer: Box<[u8; READ_BUFFER]>,
}

/// An attempt to connect.
type Attempt = Pin<Box<dyn Future<Output = Result<Box<dyn Carrier>, NotSent>> + Send>>;

impl fmt::Debug for TokioHand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TokioHand").field("shared", &self.shared).finish_non_exhaustive()
    }
}

impl TokioHand {
    /// Drives this connection from now on, on the present runtime.
    fn start(
        dial: Arc<dyn Dial>,
        stream: Box<dyn Carrier>,
        settings: &RobotSettings,
        expected: Option<Identity>,
        clock: Clock,
    ) -> Driven {
        let target = (dial.name().to_owned(), dial.takes_whoever_comes());
        let shared = SharedConnection::open(target, settings, expected, clock.now(), seed_from_clock);
        let seats = Arc::<Seats>::default();
        let io = Io {
            stream: Some(stream),
            shut: false,
            attempt: None,
            errands: Errands::default(),
            timer: Box::pin(sleep_until(clock.at(None))),
            armed: false,
            buffer: Box::new([0; READ_BUFFER]),
        };
        let hand = Arc::new(Self {
            shared: Arc::clone(&shared),
            clock,
            dial,
            settings: settings.clone(),
            runtime: Handle::current(),
            waker: Waker::from(Arc::clone(&seats)),
            seats,
            io: Mutex::new(io),
        });
        hand.runtime.spawn(Keeper(Arc::clone(&hand)));
        Driven { shared, hand }
    }

    /// Carries until nothing more can be done without waiting; whether anything came in.
    fn carry_all(&self) -> bool {
        if !self.seats.begin() {
            return false;
        }
        let mut carrying = Carrying { seats: &self.seats, over: false };
        let mut came_in = false;
        let mut looks = MOST_LOOKS;
        while looks > 0 {
            let mut busy = false;
            let errands = {
                let mut io = self.io();
                came_in |= io.carry(self, &mut looks, &mut busy);
                io.errands.any()
            };
            let heartbeat = self.settings.heartbeat != Heartbeat::Off;
            if self.seats.end(busy || errands || heartbeat || self.shared.hub.is_watched()) {
                carrying.over = true;
                break;
            }
        }
        came_in
    }

    /// Only who carries has it.
    fn io(&self) -> MutexGuard<'_, Io> {
        self.io.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Until the one who carries has ended, in whatever way.
struct Carrying<'s> {
    seats: &'s Seats,
    over: bool,
}

impl Drop for Carrying<'_> {
    fn drop(&mut self) {
        if !self.over {
            self.seats.interrupt();
        }
    }
}

impl Io {
    /// Carries errands, bytes and time; whether anything came in. `looks`: how
    /// often it may still look; `busy`: whether anything is left to do for which nobody may wait.
    fn carry(&mut self, hand: &TokioHand, looks: &mut usize, busy: &mut bool) -> bool {
        let shared = &*hand.shared;
        let cx = &mut Context::from_waker(&hand.waker);
        let mut came_in = false;
        while *looks > 0 {
            *looks -= 1;
            self.errands.drive(&shared.errands, cx);
            let now = shared.hub.time.now();
            let mut connection = shared.connection();
            connection.tick(now);
            // What came in first: a connection that has ended takes nothing any more.
            let read = self.read(&mut connection, now, cx);
            connection.go_on(now);
            let wants = connection.wants();
            let mut again = match wants {
                Wants::Carry | Wants::Goodbye => self.write(&mut connection, wants, now, cx),
                Wants::Connect | Wants::Nothing => {
                    (self.stream, self.shut) = (None, false);
                    false
                }
            };
            let deadline = connection.deadline();
            *busy = connection.is_busy();
            drop(connection);
            if wants == Wants::Connect {
                again |= self.connect(hand, now, cx);
            } else {
                self.attempt = None;
            }
            again |= read == Read::More || self.is_due(deadline, hand, cx);
            came_in |= again || read != Read::Nothing;
            if !again {
                return came_in;
            }
        }
        hand.seats.happened();
        came_in
    }

    /// Reads until there is nothing more, or so often.
    fn read(&mut self, connection: &mut Connection, now: Instant, cx: &mut Context<'_>) -> Read {
        for turn in 0..MOST_READS {
            let seen = if turn == 0 { Read::Nothing } else { Read::Something };
            let Some(stream) = &mut self.stream else { return seen };
            let mut buffer = ReadBuf::new(self.buffer.as_mut_slice());
            match Pin::new(&mut **stream).poll_read(cx, &mut buffer) {
                Poll::Ready(Ok(())) if !buffer.filled().is_empty() => {
                    connection.received(buffer.filled(), now);
                }
                Poll::Ready(ended) => {
                    self.stream = None;
                    connection.lost(reason(ended.map(|()| 0)), now);
                }
                Poll::Pending => return seen,
            }
        }
        Read::More
    }

    /// Writes what waits; whether the connection ended by that.
    fn write(
        &mut self,
        connection: &mut Connection,
        wants: Wants,
        now: Instant,
        cx: &mut Context<'_>,
    ) -> bool {
        let ended = loop {
            let Some(stream) = &mut self.stream else { break Ok(0) };
            let mut stream = Pin::new(&mut **stream);
            let output = connection.output(now);
            if output.is_empty() {
                if wants == Wants::Carry || self.shut {
                    return false;
                }
                match stream.poll_shutdown(cx) {
                    Poll::Ready(Ok(())) => self.shut = true,
                    Poll::Ready(Err(error)) => break Err(error),
                    Poll::Pending => return false,
                }
                continue;
            }
            match stream.as_mut().poll_write(cx, output) {
                Poll::Ready(Ok(bytes)) if bytes > 0 => connection.written(bytes),
                Poll::Ready(ended) => break ended,
                Poll::Pending => return false,
            }
            connection.go_on(now);
            if connection.wants() != wants {
                return true;
            }
        };
        self.stream = None;
        connection.lost(reason(ended), now);
        true
    }

    /// Goes on with an attempt to connect; whether it is over.
    fn connect(&mut self, hand: &TokioHand, now: Instant, cx: &mut Context<'_>) -> bool {
        let attempt = self.attempt.get_or_insert_with(|| {
            let (dial, within) = (Arc::clone(&hand.dial), hand.settings.connect_timeout);
            Box::pin(async move { dial.dial(within).await })
        });
        let polled = {
            // The call may be on a thread without a runtime.
            let _inside = hand.runtime.enter();
            attempt.as_mut().poll(cx)
        };
        let Poll::Ready(made) = polled else { return false };
        self.attempt = None;
        let mut connection = hand.shared.connection();
        match made {
            Ok(stream) => {
                self.stream = Some(stream);
                connection.connected(now);
            }
            Err(error) => connection.not_connected(&error),
        }
        true
    }

    /// Whether the next deadline is over; if not, the timer is set for it.
    fn is_due(&mut self, deadline: Option<Instant>, hand: &TokioHand, cx: &mut Context<'_>) -> bool {
        let time = &hand.shared.hub.time;
        let Some(deadline) = [deadline, time.deadline()].into_iter().flatten().min() else { return false };
        if deadline <= time.now() {
            return true;
        }
        let deadline = hand.clock.at(Some(deadline));
        if deadline < self.timer.deadline() {
            self.timer.as_mut().reset(deadline);
            self.armed = false;
        }
        if self.armed && !self.timer.is_elapsed() {
            return false;
        }
        // Whatever the caller's task has used up of its turn: otherwise the timer would wait without knowing whom to wake.
        while pin!(unconstrained(self.timer.as_mut())).poll(cx).is_ready() {
            if deadline <= self.timer.deadline() {
                // It is later than it was told.
                hand.tell_time();
                return true;
            }
            self.timer.as_mut().reset(deadline);
        }
        self.armed = true;
        false
    }
}

/// How a connection ended that takes or gives nothing any more.
fn reason(ended: io::Result<usize>) -> LostReason {
    ended.map_or_else(|error| LostReason::Io(error.kind()), |_none| LostReason::ClosedByPeer)
}

impl Hand for TokioHand {
    fn tell_time(&self) {
        self.shared.hub.time.pass(self.clock.now());
    }

    fn carry(&self, seat: &mut Seat, cx: &mut Context<'_>) -> bool {
        self.seats.sit(seat, cx.waker());
        self.carry_all()
    }

    fn leave(&self, seat: &mut Seat) {
        self.seats.leave(seat);
    }

    fn nudge(&self) {
        self.seats.nudge();
    }

    fn second(&self, settings: RobotSettings, expected: Option<Identity>) -> Second<'_> {
        Box::pin(async move {
            let mut made = pin!(self.dial.dial(settings.connect_timeout));
            let made = poll_fn(|cx| {
                let _inside = self.runtime.enter();
                made.as_mut().poll(cx)
            });
            let made = made.await;
            let _inside = self.runtime.enter();
            let stream = made?;
            let once = Dialer::new(Once::new(self.dial.name()));
            Ok(Self::start(Arc::new(once), stream, &settings, expected, self.clock))
        })
    }
}

impl Robot {
    /// Connects to a controller: `host` or `host:port`, port 9760 where none is given.
    ///
    /// Nothing is sent: who is there is asked with the first [`Robot::status`], or else before the first query or command. Needs
    /// a tokio runtime with time and network.
    ///
    /// # Errors
    /// [`Invalid::BadAddress`](crate::Invalid::BadAddress) if the text is no address, [`RequestError::NotSent`] if no connection can
    /// be made within [`RobotSettings::connect_timeout`].
    pub async fn connect(address: &str, settings: RobotSettings) -> Result<Self, RequestError> {
        Self::connect_with(Tcp::parse(address)?, settings).await
    }

    /// The same over connections that the caller makes.
    ///
    /// # Errors
    /// As [`Self::connect`].
    pub async fn connect_with<C: Connect>(target: C, settings: RobotSettings) -> Result<Self, RequestError> {
        let dialer = Dialer::new(target);
        let stream = dialer.connect(settings.connect_timeout).await?;
        let driven = TokioHand::start(Arc::new(dialer), Box::new(stream), &settings, None, Clock::start());
        Ok(Self::on(driven, settings))
    }
}

pub(super) fn seed_from_clock() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    since.as_secs() ^ u64::from(since.subsec_nanos()) << 32
}

/// Drives while nobody waits, and whatever callers do not.
struct Keeper(Arc<TokioHand>);

impl Future for Keeper {
    type Output = ();

    fn poll(self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<()> {
        let hand = &self.0;
        hand.seats.keep(cx.waker());
        hand.tell_time();
        hand.carry_all();
        let over = hand.shared.connection().is_closed() && !hand.io().errands.any();
        if over { Poll::Ready(()) } else { Poll::Pending }
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        // Whoever waits on another runtime is told.
        let (errands, stream) = {
            let mut io = self.0.io();
            (std::mem::take(&mut io.errands), io.stream.take())
        };
        self.0.shared.connection().abandoned();
        drop((errands, stream, self.0.shared.errands.take()));
        self.0.seats.keeper_left();
    }
}
