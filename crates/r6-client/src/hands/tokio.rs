//! The driver ("hand") of async programs: tokio's sockets and timers, and a task as keeper.

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

/// Replies are shorter than 4 KiB; a longer one is read in pieces.
const READ_BUFFER: usize = 4096;

/// The same call looks at most this often before other tasks on its thread run.
const MOST_LOOKS: usize = 32;

/// Drives one connection over tokio.
pub(crate) struct TokioHand {
    shared: Arc<SharedConnection>,
    clock: Clock,
    dial: Arc<dyn Dial>,
    settings: RobotSettings,
    runtime: Handle,
    seats: Arc<Seats>,
    /// The waker of the seats: sockets, timers and errands wake it.
    waker: Waker,
    io: Mutex<Io>,
}

/// At most this many reads follow each other before something is written, so that a flood of input does not
/// delay a stop any longer.
const MOST_READS: usize = 4;

/// The result of reading.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Read {
    Nothing,
    Something,
    /// There may be more.
    More,
}

/// The state that only the call at work has.
struct Io {
    stream: Option<Box<dyn Carrier>>,
    /// Whether our side of the connection was shut down.
    shut: bool,
    attempt: Option<Attempt>,
    errands: Errands,
    /// One timer for all waits. It is set again only for an earlier deadline: a reply that arrived leaves the
    /// timer unchanged. Then the timer wakes once per reply timeout for nothing, which is cheaper than
    /// setting it for each request.
    timer: Pin<Box<Sleep>>,
    /// Whether the timer wakes the seats when it expires.
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
    /// Starts to drive this connection on the present runtime.
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

    /// Works until nothing more can be done without waiting. Returns whether anything came in.
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

    /// Only the call at work locks it.
    fn io(&self) -> MutexGuard<'_, Io> {
        self.io.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Marks the work of one call. Dropping it ends that work, also on a panic.
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
    /// Handles errands, bytes and time. Returns whether anything came in. `looks`: how many rounds are left.
    /// `busy`: whether work is left for which perhaps no call waits.
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
            // Input first: a connection that has ended accepts no bytes.
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

    /// Reads until no bytes are left, or [`MOST_READS`] times.
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

    /// Writes what waits. Returns whether this ended the connection.
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

    /// Continues an attempt to connect. Returns whether it is over.
    fn connect(&mut self, hand: &TokioHand, now: Instant, cx: &mut Context<'_>) -> bool {
        let attempt = self.attempt.get_or_insert_with(|| {
            let (dial, within) = (Arc::clone(&hand.dial), hand.settings.connect_timeout);
            Box::pin(async move { dial.dial(within).await })
        });
        let polled = {
            // The calling thread may have no runtime.
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

    /// Whether the next deadline is over. If not, sets the timer for it.
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
        // `unconstrained`, because the caller's task may have used up its share of this turn. Then the timer
        // would be pending without a waker registered.
        while pin!(unconstrained(self.timer.as_mut())).poll(cx).is_ready() {
            if deadline <= self.timer.deadline() {
                // More time has passed than the client knew.
                hand.tell_time();
                return true;
            }
            self.timer.as_mut().reset(deadline);
        }
        self.armed = true;
        false
    }
}

/// Why a connection ended that can no longer be read or written.
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
    /// Connects to a controller: `host` or `host:port`. The default port is 9760.
    ///
    /// This sends nothing. The client asks for the identity of the controller with the first
    /// [`Robot::status`], or else before the first query or command. Needs a tokio runtime with time and
    /// network.
    ///
    /// # Errors
    /// [`Invalid::BadAddress`](crate::Invalid::BadAddress) if the text is not an address,
    /// [`RequestError::NotSent`] if no connection can be opened within [`RobotSettings::connect_timeout`].
    pub async fn connect(address: &str, settings: RobotSettings) -> Result<Self, RequestError> {
        Self::connect_with(Tcp::parse(address)?, settings).await
    }

    /// Connects over connections that the caller opens.
    ///
    /// # Errors
    /// The same errors as [`Self::connect`].
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

/// The background task: drives the connection while no call waits, and does what the calls do not.
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
        // Operations that wait on another runtime get an error.
        let (errands, stream) = {
            let mut io = self.0.io();
            (std::mem::take(&mut io.errands), io.stream.take())
        };
        self.0.shared.connection().abandoned();
        drop((errands, stream, self.0.shared.errands.take()));
        self.0.seats.keeper_left();
    }
}
