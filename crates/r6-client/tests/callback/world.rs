//! An event loop with its own clock, wires in memory, and a hostile controller at their other end.

use std::io;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, Weak};
use std::time::Duration;

use r6_client::callback::{Another, Call, CallbackHand, EventLoop};
use r6_client::{LostReason, Robot, RobotSettings};
use r6_testkit::hostile::{Arm, Character, Entry, Kind};
use tokio::sync::oneshot;

/// No test takes more turns of the loop than this.
const MOST_TURNS: usize = 200_000;

/// Clock and controller.
pub struct Cell {
    pub now: Duration,
    pub arm: Arm,
}

/// The part of the loop for one connection.
pub struct Line {
    cell: Arc<Mutex<Cell>>,
    own: Mutex<Own>,
    /// The driver to which answers are reported from within `write`.
    at_once: OnceLock<Weak<CallbackHand>>,
}

/// The loop's state of one connection.
pub struct Own {
    pub connection: Option<u32>,
    pub soon: bool,
    pub call_at: Option<Duration>,
    /// The number of bytes that one write accepts.
    pub room: usize,
    full: bool,
    wanted: bool,
    ended: bool,
    others: Vec<Another>,
    /// Whether attempts to connect end.
    pub answers: bool,
    pub let_go: u32,
    pub asked_soon: u32,
}

/// The loop.
pub struct World {
    pub cell: Arc<Mutex<Cell>>,
    pub lines: Vec<(Arc<Line>, Arc<CallbackHand>)>,
}

impl Line {
    fn over(cell: &Arc<Mutex<Cell>>, connection: Option<u32>) -> Arc<Self> {
        let own = Own {
            connection,
            soon: false,
            call_at: None,
            room: usize::MAX,
            full: false,
            wanted: false,
            ended: false,
            others: Vec::new(),
            answers: true,
            let_go: 0,
            asked_soon: 0,
        };
        Arc::new(Self { cell: Arc::clone(cell), own: Mutex::new(own), at_once: OnceLock::new() })
    }

    pub fn own(&self) -> MutexGuard<'_, Own> {
        self.own.lock().unwrap()
    }

    /// Reads what the controller sends now. Returns `true` if something came.
    fn read(&self, hand: &CallbackHand) -> bool {
        let Some(connection) = self.own().connection else { return false };
        let out = {
            let mut cell = self.cell.lock().unwrap();
            let now = cell.now;
            cell.arm.poll(now, connection)
        };
        out.frames.iter().for_each(|frame| hand.received(frame));
        if out.ended && self.own().connection.take().is_some() {
            hand.lost(LostReason::ClosedByPeer);
        }
        out.ended || !out.frames.is_empty()
    }

    /// Runs one turn. Returns whether anything happened.
    fn turn(&self, hand: &CallbackHand) -> bool {
        let (soon, wanted, full, ended) = {
            let mut own = self.own();
            let wanted = own.answers && std::mem::take(&mut own.wanted);
            let full = own.room > 0 && std::mem::take(&mut own.full);
            (std::mem::take(&mut own.soon), wanted, full, std::mem::take(&mut own.ended))
        };
        if soon {
            hand.run();
        }
        if wanted {
            let opened = {
                let mut cell = self.cell.lock().unwrap();
                let now = cell.now;
                cell.arm.open(now)
            };
            self.own().connection = opened;
            match opened {
                Some(_) => hand.connected(),
                None => hand.not_connected(io::ErrorKind::ConnectionRefused.into()),
            }
        }
        if full {
            hand.writable();
        }
        if ended && let Some(connection) = self.own().connection.take() {
            let mut cell = self.cell.lock().unwrap();
            let now = cell.now;
            cell.arm.close(now, connection);
            drop(cell);
            hand.lost(LostReason::ClosedByPeer);
        }
        self.read(hand) || soon || wanted || full || ended
    }
}

impl EventLoop for Line {
    fn now(&self) -> Duration {
        self.cell.lock().unwrap().now
    }

    fn soon(&self) {
        let mut own = self.own();
        own.soon = true;
        own.asked_soon += 1;
    }

    fn write(&self, bytes: &[u8]) -> usize {
        let (taken, connection) = {
            let mut own = self.own();
            let taken = bytes.len().min(own.room);
            own.full = taken < bytes.len();
            (taken, own.connection.expect("there is a connection"))
        };
        {
            let mut cell = self.cell.lock().unwrap();
            let now = cell.now;
            cell.arm.receive(now, connection, &bytes[..taken]);
        }
        if let Some(hand) = self.at_once.get().and_then(Weak::upgrade) {
            self.read(&hand);
        }
        taken
    }

    fn connect(&self) {
        self.own().wanted = true;
    }

    fn end(&self) {
        self.own().ended = true;
    }

    fn let_go(&self) {
        let mut own = self.own();
        own.let_go += 1;
        own.wanted = false;
        if let Some(connection) = own.connection.take() {
            let mut cell = self.cell.lock().unwrap();
            let now = cell.now;
            cell.arm.close(now, connection);
        }
    }

    fn call_at(&self, at: Duration) {
        self.own().call_at = Some(at);
    }

    fn another(&self, another: Another) {
        self.own().others.push(another);
    }
}

impl World {
    pub fn new(character: Character) -> (Self, Robot) {
        Self::with(character, RobotSettings::default())
    }

    pub fn with(character: Character, settings: RobotSettings) -> (Self, Robot) {
        let mut arm = Arm::new(character);
        let connection = arm.open(Duration::ZERO);
        let cell = Arc::new(Mutex::new(Cell { now: Duration::ZERO, arm }));
        let line = Line::over(&cell, connection);
        let (hand, robot) =
            CallbackHand::start("the robot", settings, Arc::clone(&line) as Arc<dyn EventLoop>);
        (Self { cell, lines: vec![(line, Arc::new(hand))] }, robot)
    }

    pub fn hand(&self) -> &CallbackHand {
        &self.lines[0].1
    }

    pub fn line(&self) -> &Line {
        &self.lines[0].0
    }

    /// From now on the controller's answers are reported from within `write`.
    pub fn answer_at_once(&self) {
        let (line, hand) = &self.lines[0];
        line.at_once.set(Arc::downgrade(hand)).expect("once");
    }

    pub fn arm<T>(&self, look: impl FnOnce(&mut Arm, Duration) -> T) -> T {
        let mut cell = self.cell.lock().unwrap();
        let now = cell.now;
        look(&mut cell.arm, now)
    }

    /// Lets time pass while the loop does nothing.
    pub fn pass(&self, time: Duration) {
        self.cell.lock().unwrap().now += time;
    }

    /// Runs one turn of the loop.
    pub fn turn(&mut self) {
        let mut happened = false;
        for (line, hand) in &self.lines {
            happened |= line.turn(hand);
        }
        let others = std::mem::take(&mut self.line().own().others);
        for another in others {
            happened = true;
            match self.arm(|arm, now| arm.open(now)) {
                Some(connection) => {
                    let line = Line::over(&self.cell, Some(connection));
                    let hand = another.connected(Arc::clone(&line) as Arc<dyn EventLoop>);
                    self.lines.extend(hand.map(|hand| (line, Arc::new(hand))));
                }
                None => another.not_connected(&io::ErrorKind::ConnectionRefused.into()),
            }
        }
        if !happened {
            self.wait();
        }
    }

    /// Nothing is due before the next deadline: moves the clock there.
    fn wait(&self) {
        let next_of = |line: &Line| {
            let own = line.own();
            let reply =
                own.connection.and_then(|connection| self.arm(|arm, now| arm.poll(now, connection).next));
            [own.call_at, reply].into_iter().flatten().min()
        };
        let Some(next) = self.lines.iter().filter_map(|(line, _)| next_of(line)).min() else {
            // Another thread may have work.
            return std::thread::sleep(Duration::from_millis(1));
        };
        {
            let mut cell = self.cell.lock().unwrap();
            cell.now = cell.now.max(next);
        }
        for (line, hand) in &self.lines {
            let due = {
                let mut own = line.own();
                let due = own.call_at.is_some_and(|at| at <= next);
                if due {
                    own.call_at = None;
                }
                due
            };
            if due {
                hand.due();
            }
        }
    }

    /// Begins an operation in the loop.
    pub fn begin<T, F>(&self, operation: F) -> (Call, oneshot::Receiver<T>)
    where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
    {
        let (tell, told) = oneshot::channel();
        let call = self.hand().call(async move {
            tell.send(operation.await).ok();
        });
        (call, told)
    }

    /// Runs turns until the operation has ended.
    pub fn end<T>(&mut self, mut told: oneshot::Receiver<T>) -> T {
        for _ in 0..MOST_TURNS {
            match told.try_recv() {
                Ok(value) => return value,
                Err(oneshot::error::TryRecvError::Empty) => self.turn(),
                Err(oneshot::error::TryRecvError::Closed) => panic!("it was given up"),
            }
        }
        panic!("it never ends");
    }

    pub fn call<T, F>(&mut self, operation: F) -> T
    where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
    {
        let (_call, told) = self.begin(operation);
        self.end(told)
    }

    /// The requests of this kind that arrived.
    pub fn arrived(&self, kind: Kind) -> Vec<Entry> {
        self.arm(|arm, _| arm.log().iter().filter(|entry| entry.kind == kind).cloned().collect())
    }
}
