//! Fuzzes the server session. Whatever a peer sends, in any pieces and with any pauses, the messages are the
//! same. Replies are sent complete, once, in the order of their times, and none is lost.
//!
//! An input is a byte for the limits, then operations: a byte each, with the bytes that it needs.

use std::collections::VecDeque;
use std::time::Duration;

use r6_proto::frame::{FrameBuffer, Limits};
use r6_proto::server::{InputError, MAX_UNSENT_BYTES, PARTIAL_FRAME_TIMEOUT, ServerSession};
use r6_proto::time::Instant;
use r6_proto::{Decoder, Message};

use crate::input::Input;
use crate::messages::look_at_everything;

/// The maximum number of operations of an input, so that each input takes microseconds.
const MOST_OPERATIONS: usize = 300;

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let max_frame_bytes = input.pick(&[65_536, 2, 64, 2048]);
    let limits = Limits { max_frame_bytes, ..Limits::default() };
    let mut pair = Pair {
        session: ServerSession::new(limits),
        plain: FrameBuffer::new(limits),
        last_byte: Instant::ORIGIN,
        out: Queue::default(),
        now: Instant::ORIGIN,
    };
    for _ in 0..MOST_OPERATIONS {
        if input.is_empty() {
            break;
        }
        pair.step(&mut input);
    }
    pair.take_out(&mut input);
}

/// A session and its expected behaviour.
struct Pair {
    session: ServerSession,
    /// The received bytes in a separate buffer.
    plain: FrameBuffer,
    last_byte: Instant,
    out: Queue,
    now: Instant,
}

/// The replies in their expected order.
#[derive(Default)]
struct Queue {
    ready: VecDeque<Vec<u8>>,
    /// In order of time. Replies with the same time keep the order in which they were sent.
    delayed: Vec<(Instant, Vec<u8>)>,
    in_turn: Instant,
}

impl Queue {
    fn send_at(&mut self, due: Instant, frame: Vec<u8>) {
        let at = self.delayed.iter().take_while(|(other, _)| *other <= due).count();
        self.delayed.insert(at, (due, frame));
    }

    fn release(&mut self, now: Instant) {
        let due = self.delayed.iter().take_while(|(due, _)| *due <= now).count();
        self.ready.extend(self.delayed.drain(..due).map(|(_, frame)| frame));
    }

    fn bytes(&self) -> usize {
        let delayed = self.delayed.iter().map(|(_, frame)| frame.len());
        self.ready.iter().map(Vec::len).chain(delayed).sum()
    }
}

impl Pair {
    fn step(&mut self, input: &mut Input<'_>) {
        match input.byte() % 12 {
            0..=2 => self.receive(input.piece()),
            3 => {
                let count = usize::from(input.number());
                self.receive(input.bytes(count));
            }
            4 => self.pass(Duration::from_millis(u64::from(input.byte()))),
            5 => self.pass(Duration::from_millis(u64::from(input.number()))),
            6 => {
                let frame = frame(input);
                self.session.split().1.send(|out| out.extend_from_slice(&frame));
                self.out.ready.push_back(frame);
            }
            7 => {
                let due = self.now + Duration::from_millis(u64::from(input.byte()));
                let frame = frame(input);
                self.session.split().1.send_at(due, |out| out.extend_from_slice(&frame));
                self.out.send_at(due, frame);
            }
            8 => {
                let due = self.now + Duration::from_millis(u64::from(input.byte()));
                let frame = frame(input);
                self.session.split().1.send_in_turn(due, |out| out.extend_from_slice(&frame));
                self.out.in_turn = self.out.in_turn.max(due);
                self.out.send_at(self.out.in_turn, frame);
            }
            9 => self.transmit(),
            10 => {
                self.session.split().1.release(self.now);
                self.out.release(self.now);
            }
            _ => {
                // Skipped time does not count against the peer.
                let by = Duration::from_millis(u64::from(input.number()));
                self.session.postpone(by);
                self.last_byte += by;
                self.now += by;
            }
        }
        let due = (self.plain.pending() > 0).then(|| self.last_byte + PARTIAL_FRAME_TIMEOUT);
        assert_eq!(self.session.poll_timeout(), due);
        assert_eq!(self.session.next_transmit(), self.out.delayed.first().map(|(due, _)| *due));
        assert_eq!(self.session.split().1.is_overfull(), self.out.bytes() > MAX_UNSENT_BYTES);
    }

    fn receive(&mut self, mut bytes: &[u8]) {
        if !bytes.is_empty() {
            self.last_byte = self.now;
        }
        let (inbox, _) = self.session.split();
        loop {
            let taken = inbox.push(self.now, bytes);
            let mut plain = &bytes[..taken];
            while let Some(message) = inbox.next_message() {
                assert_eq!(told(&message), next_plain(&mut self.plain, &mut plain));
                if let Ok(message) = &message {
                    look_at_everything(message);
                }
            }
            assert_eq!(next_plain(&mut self.plain, &mut plain), None, "the session did not tell all");
            bytes = &bytes[taken..];
            if bytes.is_empty() {
                return;
            }
            assert!(taken > 0, "a session that has told everything takes bytes");
        }
    }

    fn pass(&mut self, time: Duration) {
        self.now += time;
        let stalled = self.plain.pending() > 0 && self.now.since(self.last_byte) >= PARTIAL_FRAME_TIMEOUT;
        let given_up = self.session.split().0.handle_timeout(self.now);
        let plain = if stalled { self.plain.abandon_partial() } else { None };
        assert_eq!(given_up, plain);
        let due = self.session.poll_timeout();
        assert!(due.is_none_or(|due| due > self.now), "what was due is still due: {due:?}");
    }

    fn transmit(&mut self) {
        self.out.release(self.now);
        let (_, outbox) = self.session.split();
        loop {
            // A reply without bytes is not sent.
            let due = std::iter::from_fn(|| self.out.ready.pop_front()).find(|frame| !frame.is_empty());
            assert_eq!(outbox.poll_transmit(self.now), due.as_deref());
            if due.is_none() {
                return;
            }
        }
    }

    fn take_out(mut self, input: &mut Input<'_>) {
        if input.flag() {
            let (_, outbox) = self.session.split();
            let frames = std::mem::take(outbox).into_frames();
            let ready =
                self.out.ready.into_iter().filter(|frame| !frame.is_empty()).map(|frame| (None, frame));
            let delayed = self.out.delayed.into_iter().map(|(due, frame)| (Some(due), frame));
            assert_eq!(frames, ready.chain(delayed).collect::<Vec<_>>());
        } else {
            self.now += Duration::from_secs(3600);
            self.transmit();
            assert_eq!(self.session.next_transmit(), None);
        }
    }
}

/// A reply from two bytes of input, so that long replies cost no input.
fn frame(input: &mut Input<'_>) -> Vec<u8> {
    let length = [0, 1, 20, 300, 5_000, 300_000][input.below(6)];
    vec![input.byte(); length]
}

fn told(message: &Result<Message<'_>, InputError>) -> Option<String> {
    Some(match message {
        Ok(message) => message.frame().escape_ascii().to_string(),
        Err(InputError::Frame(error)) => error.to_string(),
        Err(InputError::Json(error)) => error.to_string(),
    })
}

/// The next frame or fault of the same bytes, pushed one by one.
fn next_plain(buffer: &mut FrameBuffer, bytes: &mut &[u8]) -> Option<String> {
    loop {
        if let Some(next) = buffer.next() {
            return Some(match next {
                Ok(frame) => match Decoder::new().decode(frame.bytes) {
                    Ok(message) => message.frame().escape_ascii().to_string(),
                    Err(error) => error.to_string(),
                },
                Err(error) => error.to_string(),
            });
        }
        let (first, rest) = bytes.split_first()?;
        assert_eq!(buffer.push(&[*first]), 1);
        *bytes = rest;
    }
}
