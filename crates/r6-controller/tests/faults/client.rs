//! A small client that behaves as a client should. It polls, judges by the state, and sends a motion once. On
//! every new connection it reads mode, alarm and list again before it sends another motion.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use r6_controller::ConnectionId;
use r6_proto::client::{ClientSession, ClientSettings};
use r6_proto::message::instruction::{Action, BlendLevel, Coordinates, Instruction, Manner, Move};
use r6_proto::time::Instant;
use r6_proto::{Address, Command, Request};

use crate::session_events::{Said, SessionEvent, told, word};

const POLL: Duration = Duration::from_millis(100);
/// A reply after this is late. Without a fault a reply comes at once, and the reply to a list after 18 ms.
const LATE: Duration = Duration::from_millis(250);
const MOTION: Duration = Duration::from_millis(1500);

/// The first register with its own value, and how many have one (`world.rs`).
pub const FIRST: u16 = 800;
pub const REGISTERS: u16 = 60;

/// The value of a register, which identifies the register.
pub fn value_of(register: u16) -> i64 {
    i64::from(register) * 7 + 1
}

/// What a request asks for.
#[derive(Clone, Debug)]
enum Asked {
    State,
    Registers(u16),
    Motion(usize),
    Command,
}

/// A motion that was sent, once.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// The end of J1's move, and its position on the way.
    pub target: f64,
    pub half: f64,
    /// The answer: ok, err, or none.
    pub verdict: Option<bool>,
}

/// What a client has seen.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    pub replies: u32,
    pub broken: u32,
    pub rejected: u32,
    pub mismatches: u32,
    pub timeouts: u32,
    pub photos: u32,
    pub connections: u32,
    pub lost: u32,
    /// Attempts to connect that were refused, and those that got no answer.
    pub refused: u32,
    pub unanswered: u32,
    /// Pieces that end within a frame, and pieces with more than one frame.
    pub parts: u32,
    pub together: u32,
    /// Replies that took more than a quarter of a second.
    pub late: u32,
    pub longest_list: i64,
    pub strays: BTreeMap<&'static str, u32>,
}

impl Seen {
    pub fn strays(&self, reason: &str) -> u32 {
        self.strays.get(reason).copied().unwrap_or(0)
    }
}

#[derive(Clone, Copy, Debug)]
pub struct State {
    pub at: Instant,
    pub j1: f64,
    mode: i64,
    alarm: i64,
    moving: bool,
    list: i64,
}

pub struct Client {
    pub session: ClientSession,
    pub id: ConnectionId,
    /// Whether it moves the arm; otherwise it only polls.
    moves: bool,
    pub next_poll: Instant,
    next_motion: Instant,
    round: u16,
    waiting: BTreeMap<u64, (Instant, Asked)>,
    answered: BTreeSet<u64>,
    /// The state read on this connection.
    pub state: Option<State>,
    silent: u32,
    pub wants_new_connection: bool,
    /// The last frames that the controller sent on this connection, unchanged.
    frames: VecDeque<Vec<u8>>,
    pub motions: Vec<Motion>,
    pub seen: Seen,
    /// Whether the values have to belong to their own addresses. False if lists are shifted.
    pub trusts_values: bool,
    /// Whether bytes arrive as they were sent. False on a noisy link.
    pub trusts_bytes: bool,
    pub connected: bool,
    /// Whether its motions pass the point on the way without a stop.
    pub blends: bool,
    now: Instant,
}

impl Client {
    pub fn new(id: ConnectionId, moves: bool, first_pack_id: u64, now: Instant) -> Self {
        Self {
            session: session(first_pack_id),
            id,
            moves,
            next_poll: now,
            next_motion: now + MOTION,
            round: 0,
            waiting: BTreeMap::new(),
            answered: BTreeSet::new(),
            state: None,
            silent: 0,
            wants_new_connection: false,
            frames: VecDeque::new(),
            motions: Vec::new(),
            seen: Seen { connections: 1, ..Seen::default() },
            trusts_values: true,
            trusts_bytes: true,
            connected: true,
            blends: true,
            now,
        }
    }

    /// Handles the end of the connection.
    pub fn lose(&mut self, now: Instant) {
        self.session.handle_disconnect();
        self.hear(now);
        assert!(self.waiting.is_empty(), "a request was neither answered nor lost: {:?}", self.waiting);
        self.connected = false;
        self.next_poll = now;
    }

    /// Tries again later, after the connection was not accepted.
    pub fn try_later(&mut self, now: Instant) {
        self.next_poll = now + POLL;
    }

    /// Takes a new connection, and forgets everything known from the old one.
    pub fn reconnect(&mut self, now: Instant, id: ConnectionId) {
        self.connected = true;
        self.session = session(self.session.next_pack_id());
        self.id = id;
        self.state = None;
        self.silent = 0;
        self.wants_new_connection = false;
        self.frames.clear();
        self.next_poll = now;
        self.seen.connections += 1;
    }

    /// When it next does something.
    pub fn next(&self) -> Instant {
        let session = self.session.poll_timeout().filter(|_| self.connected);
        session.map_or(self.next_poll, |due| due.min(self.next_poll))
    }

    /// Handles the time: polls, and sends a motion if everything says that it can run.
    pub fn act(&mut self, now: Instant) {
        self.session.handle_timeout(now);
        self.hear(now);
        if now < self.next_poll {
            return;
        }
        self.next_poll = now + POLL;
        if self.moves
            && now >= self.next_motion
            && self.state.is_some_and(|state| {
                now.since(state.at) <= POLL * 2
                    && state.mode == 7
                    && state.alarm == 0
                    && !state.moving
                    && state.list == 0
            })
        {
            self.next_motion = now + MOTION;
            self.send_motion(now);
            return;
        }
        self.round = self.round.wrapping_add(1);
        match self.round % 7 {
            0..=2 => self.ask(now, Asked::State, &Request::Query(&state_addresses())),
            6 if self.moves => {
                let command = Command::ModifyOutput { board: 0, point: 5, on: self.round.is_multiple_of(2) };
                self.ask(now, Asked::Command, &Request::Command(&command));
            }
            _ => {
                let first = FIRST + self.round * 5 % (REGISTERS - 12);
                let addresses: Vec<_> = (first..first + 12).map(|n| address(&format!("Addr-{n}"))).collect();
                self.ask(now, Asked::Registers(first), &Request::Query(&addresses));
            }
        }
    }

    fn ask(&mut self, now: Instant, asked: Asked, request: &Request<'_>) {
        if let Ok(ticket) = self.session.send(now, request) {
            self.waiting.insert(ticket.number(), (now, asked));
        }
    }

    fn send_motion(&mut self, now: Instant) {
        let number = self.motions.len();
        #[expect(clippy::cast_precision_loss, reason = "a small number")]
        let n = number as f64;
        // Each target and each point on the way to it is different.
        let side = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
        let (target, half) = (side * (12.0 + n * 0.013), side * (4.0 + n * 0.011));
        let step = |to: f64, blend: Option<BlendLevel>| Instruction {
            oneshot: true,
            action: Action::AxisMove(Move {
                target: Coordinates::from_slice(&[to]),
                manner: Manner { speed: Some(60.0), smooth: blend, ..Manner::default() },
            }),
        };
        self.motions.push(Motion { target, half, verdict: None });
        let steps = [step(half, BlendLevel::new(5).filter(|_| self.blends)), step(target, None)];
        self.ask(now, Asked::Motion(number), &Request::AddRcc { empty_list: false, instructions: &steps });
    }

    /// Notes a frame that the controller has sent, or what was left of it.
    pub fn expect(&mut self, frame: &[u8]) {
        self.frames.push_back(frame.to_vec());
        if self.frames.len() > 400 {
            self.frames.pop_front();
        }
    }

    /// Takes bytes that arrive.
    pub fn take(&mut self, now: Instant, bytes: &[u8]) {
        self.seen.parts += u32::from(bytes.last() != Some(&b'}'));
        self.seen.together += u32::from(bytes.windows(2).any(|pair| pair == b"}{"));
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self.session.handle_input(now, rest);
            rest = &rest[taken..];
            self.hear(now);
        }
    }

    fn hear(&mut self, now: Instant) {
        self.now = now;
        while let Some(told) = self.session.poll_event(now).map(told) {
            self.note(told);
        }
    }

    fn note(&mut self, told: SessionEvent) {
        match told {
            SessionEvent::Reply { ticket, frame, body } => {
                self.was_sent(&frame);
                assert!(self.answered.insert(ticket), "request {ticket} was answered twice");
                let asked = self.waiting.remove(&ticket);
                let (asked_at, asked) =
                    asked.unwrap_or_else(|| panic!("a reply to {ticket}, which does not wait"));
                self.silent = 0;
                self.seen.replies += 1;
                self.seen.late += u32::from(self.now.since(asked_at) > LATE);
                self.judge(asked_at, &asked, body);
            }
            SessionEvent::Photo(frame) => {
                self.was_sent(&frame);
                self.seen.photos += 1;
            }
            SessionEvent::Stray(reason, frame) => {
                self.was_sent(&frame);
                *self.seen.strays.entry(word(reason)).or_default() += 1;
            }
            SessionEvent::Broken => self.seen.broken += 1,
            SessionEvent::TimedOut(ticket) => {
                assert!(self.waiting.remove(&ticket).is_some(), "{ticket} timed out and did not wait");
                self.seen.timeouts += 1;
                self.silent += 1;
                self.wants_new_connection |= self.silent >= 8;
            }
            SessionEvent::Lost(ticket) => {
                assert!(self.waiting.remove(&ticket).is_some(), "{ticket} was lost and did not wait");
                self.seen.lost += 1;
            }
            SessionEvent::OutOfStep => self.wants_new_connection = true,
        }
    }

    /// Checks that a delivered frame is a whole frame that the controller made: its bytes, from its first
    /// brace to its last.
    fn was_sent(&self, frame: &[u8]) {
        let whole = |sent: &Vec<u8>| {
            let begin = sent.iter().position(|byte| *byte == b'{');
            let end = sent.iter().rposition(|byte| *byte == b'}');
            begin.zip(end).is_some_and(|(begin, end)| sent.get(begin..=end) == Some(frame))
        };
        assert!(
            !self.trusts_bytes || self.frames.iter().rev().any(whole),
            "delivered, but never sent: {}",
            String::from_utf8_lossy(frame)
        );
    }

    fn judge(&mut self, asked_at: Instant, asked: &Asked, body: Said) {
        match (asked, body) {
            (_, Said::Rejected) => self.seen.rejected += 1,
            (Asked::State | Asked::Registers(_), Said::Values(values)) if values.len() != 12 => {
                self.seen.mismatches += 1
            }
            (Asked::State, Said::Values(values)) => {
                if self.trusts_values {
                    assert_eq!(values[5], "6", "axisNum of {values:?}");
                }
                let number = |at: usize| values[at].parse::<f64>().unwrap_or(-1.0);
                #[expect(clippy::cast_possible_truncation, reason = "small numbers")]
                let whole = |at: usize| number(at) as i64;
                self.seen.longest_list =
                    self.seen.longest_list.max(if self.trusts_values { whole(3) } else { 0 });
                self.state = Some(State {
                    at: asked_at,
                    j1: number(6),
                    mode: whole(0),
                    alarm: whole(1),
                    moving: whole(2) != 0,
                    list: whole(3),
                });
            }
            (Asked::Registers(first), Said::Values(values)) => {
                if self.trusts_values {
                    let wanted: Vec<_> = (*first..first + 12).map(|n| value_of(n).to_string()).collect();
                    assert_eq!(values, wanted, "the values of other addresses");
                }
            }
            (Asked::Motion(number), Said::Verdict(ok)) => self.motions[*number].verdict = Some(ok),
            (Asked::Command, Said::Verdict(_)) => {}
            (asked, Said::Values(_) | Said::Verdict(_)) => panic!("a reply of another kind to {asked:?}"),
        }
    }
}

fn session(first_pack_id: u64) -> ClientSession {
    let settings =
        ClientSettings { reply_timeout: Duration::from_secs(1), first_pack_id, ..ClientSettings::default() };
    ClientSession::new(settings)
}

fn address(name: &str) -> Address {
    Address::parse(name).unwrap_or_else(|error| panic!("{error}"))
}

fn state_addresses() -> Vec<Address> {
    let names = ["curMode", "curAlarm", "isMoving", "RemoteCmdLen", "origin", "axisNum"];
    let axes = (0..6).map(|axis| format!("axis-{axis}"));
    names.into_iter().map(str::to_owned).chain(axes).map(|name| address(&name)).collect()
}
