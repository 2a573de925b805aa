//! Fuzzes the client session. Each reply belongs to at most one request, a late reply to none. Nothing grows
//! without bound, and no motion is sent twice.
//!
//! An input is a byte for the settings, then operations: a byte each, with the bytes that it needs.
//! Operations send requests, transmit bytes, deliver replies (right, wrong, repeated or late), and let time
//! pass.

mod ledger;

use std::time::Duration;

use ledger::Ledger;
use r6_proto::client::{ClientSession, ClientSettings, Event, MAX_OUTPUT_BYTES, SendError};
use r6_proto::dialect::DsIdForm;
use r6_proto::message::instruction::{Coordinates, Manner, Move};
use r6_proto::message::{Action, Body, Instruction, PhotoAnswer, Point, TypeKey};
use r6_proto::request::CameraPoints;
use r6_proto::time::Instant;
use r6_proto::{Address, Command, Request, RequestType};

use crate::input::Input;
use crate::messages::look_at_everything;

/// The maximum number of operations of an input, so that each input takes microseconds.
const MOST_OPERATIONS: usize = 200;

/// Queries that can be distinguished.
const QUERIES: [&[Address]; 4] =
    [&[Address::CurMode], &[Address::CurAlarm], &[Address::CurMode, Address::CurAlarm], &[]];

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let settings = input.byte();
    let settings = ClientSettings {
        max_in_flight: [64, 1, 4, 0][usize::from(settings & 3)],
        // With the longest limit, a full window can fill the output.
        max_frame_bytes: [2048, 120, 65_536, 120][usize::from(settings >> 2 & 1 | settings >> 6 & 2)],
        type_key: if settings & 8 == 0 { TypeKey::ReqType } else { TypeKey::CmdType },
        first_pack_id: [1, 0, 1 << 40, 9][usize::from(settings >> 4 & 3)],
        ds_id: if settings & 64 == 0 { DsIdForm::Long } else { DsIdForm::Short },
        ..ClientSettings::default()
    };
    let mut peer = Peer {
        ledger: Ledger::new(settings),
        session: ClientSession::new(settings),
        max_frame_bytes: settings.max_frame_bytes,
        now: Instant::ORIGIN,
    };
    for _ in 0..MOST_OPERATIONS {
        if input.is_empty() {
            break;
        }
        peer.step(&mut input);
        peer.hold();
    }
    peer.session.handle_disconnect();
    peer.listen();
    peer.ledger.all_have_ended();
    assert_eq!(peer.session.poll_timeout().filter(|due| *due <= peer.now), None);
}

/// A session and its peer.
struct Peer {
    session: ClientSession,
    ledger: Ledger,
    max_frame_bytes: usize,
    now: Instant,
}

impl Peer {
    fn step(&mut self, input: &mut Input<'_>) {
        match input.byte() % 16 {
            0..=2 => self.send(input),
            3 | 4 => self.transmit(usize::from(input.number())),
            5 => self.transmit(usize::MAX),
            6..=8 => {
                let reply = self.ledger.reply(input);
                self.receive(&reply);
            }
            9 => {
                let reply = self.ledger.reply(input);
                self.receive(&crate::mutation::change(&reply, input));
            }
            10 => self.receive(input.piece()),
            11 => self.pass(Duration::from_millis(u64::from(input.number()))),
            12 => self.pass(Duration::from_millis(u64::from(input.byte()))),
            13 => {
                if let Some(ticket) = self.ledger.waiting(input)
                    && self.session.withdraw(ticket)
                {
                    self.ledger.withdrawn(ticket);
                }
            }
            14 => {
                let reply = self.ledger.last_reply().to_vec();
                self.receive(&reply);
            }
            _ => self.receive(br#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0}"#),
        }
    }

    fn send(&mut self, input: &mut Input<'_>) {
        let target = Coordinates::from_slice(&[input.decimal(180.0); 6]);
        let step = Instruction {
            oneshot: true,
            action: Action::AxisMove(Move {
                target,
                manner: Manner { speed: Some(10.0), ..Manner::default() },
            }),
        };
        let steps = vec![step; input.below(9)];
        let many = if self.max_frame_bytes > 2048 { 400 } else { 1 };
        let points = vec![Point { x: input.decimal(1000.0), ..Point::default() }; many];
        let cameras = [CameraPoints { cam_id: 0, points: &points }];
        let request = match input.below(8) {
            0 | 1 => Request::Query(input.pick(&QUERIES)),
            2 => Request::Command(&Command::ActionStop),
            3 => Request::Command(&Command::StartButton),
            4 => Request::AddRcc { empty_list: input.flag(), instructions: &steps },
            5 => Request::AddPoints(&cameras),
            6 => Request::Heartbreak,
            _ => Request::PhotoAnswer(PhotoAnswer { cam_id: 0, ret: 1 }),
        };
        let before = self.session.poll_transmit().map_or(0, <[u8]>::len);
        match self.session.send(self.now, &request) {
            Ok(ticket) => self.ledger.sent(ticket, &request, self.now),
            Err(error) => {
                assert!(!error.to_string().is_empty());
                let after = self.session.poll_transmit().map_or(0, <[u8]>::len);
                assert_eq!(before, after, "what was not sent left bytes behind: {error}");
                // The output drops transmitted bytes once they are half of it.
                let full = matches!(error, SendError::OutputFull { .. });
                assert!(!full || before > MAX_OUTPUT_BYTES / 2, "full, with {before} bytes that wait");
            }
        }
    }

    fn transmit(&mut self, most: usize) {
        let Some(bytes) = self.session.poll_transmit() else { return };
        let leaves = &bytes[..bytes.len().min(most)];
        let count = leaves.len();
        self.ledger.left(leaves);
        self.session.transmitted(count);
    }

    fn receive(&mut self, mut bytes: &[u8]) {
        loop {
            let taken = self.session.handle_input(self.now, bytes);
            bytes = &bytes[taken..];
            self.listen();
            if bytes.is_empty() {
                return;
            }
            assert!(taken > 0, "a session that has told everything takes bytes");
        }
    }

    fn pass(&mut self, time: Duration) {
        self.now += time;
        self.session.handle_timeout(self.now);
        self.listen();
        self.ledger.time_has_passed(self.now);
        assert!(self.session.poll_timeout().is_none_or(|due| due > self.now), "what was due is still due");
    }

    fn listen(&mut self) {
        let now = self.now;
        while let Some(event) = self.session.poll_event(now) {
            match event {
                Event::Reply { ticket, message, after } => {
                    look_at_everything(&message);
                    let request = self.ledger.answered(ticket, &message);
                    assert_eq!(after, now.since(request.sent_at));
                    let fits = match &message.body {
                        Body::QueryReply(_) => request.kind == RequestType::Query,
                        Body::CommandReply(reply) => {
                            request.kind != RequestType::Query
                                && reply.command().is_none_or(|word| word == request.word)
                        }
                        Body::Rejected(_) => true,
                        _ => false,
                    };
                    assert!(fits, "{message:?} answers {request:?}");
                }
                Event::TimedOut(ticket) => self.ledger.timed_out(ticket, now),
                Event::Lost { ticket, left } => self.ledger.lost(ticket, left),
                Event::Photo { message, .. } => look_at_everything(&message),
                Event::Stray { message, .. } => {
                    look_at_everything(&message);
                    self.ledger.stray(&message);
                }
                Event::BadFrame(error) => assert!(!error.to_string().is_empty()),
                Event::NotJson(error) => assert!(!error.to_string().is_empty()),
                Event::OutOfStep => self.ledger.out_of_step(),
            }
        }
    }

    /// Checks what must hold between any two operations.
    fn hold(&self) {
        let output = self.session.poll_transmit().map_or(0, <[u8]>::len);
        assert!(output <= MAX_OUTPUT_BYTES + self.max_frame_bytes, "{output} bytes wait to leave");
        self.ledger.hold(output);
    }
}
