//! The controller's side of one connection, without I/O: bytes in, messages out; replies in, frames out.

use std::collections::VecDeque;
use std::time::Duration;

use crate::error::JsonError;
use crate::frame::{FrameBuffer, FrameError, Limits};
use crate::message::{Decoder, Message};
use crate::time::Instant;

/// The session gives up a frame that stays incomplete this long after its last byte, so that it can read what
/// follows.
///
/// This is long enough for a peer that sends one byte a second. It is short enough that a cut-off frame does
/// not swallow the next attempt of a person at the keyboard.
pub const PARTIAL_FRAME_TIMEOUT: Duration = Duration::from_secs(5);

/// Unread replies of a peer accumulate up to this many bytes; then the connection is given up.
///
/// A reply is below 4 KiB, and clients keep a handful of requests in flight. A peer this far behind is not
/// reading.
pub const MAX_UNSENT_BYTES: usize = 1 << 20;

/// The controller's side of one connection.
#[derive(Debug)]
pub struct ServerSession {
    inbox: Inbox,
    outbox: Outbox,
}

/// The receiving half: bytes in, messages out.
#[derive(Debug)]
pub struct Inbox {
    frames: FrameBuffer,
    decoder: Decoder,
    last_byte: Instant,
}

/// Why bytes did not become a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum InputError {
    /// The bytes are not a complete JSON object where one should be.
    Frame(FrameError),
    /// The object is not well-formed JSON.
    Json(JsonError),
}

impl std::fmt::Display for InputError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Frame(error) => error.fmt(f),
            Self::Json(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for InputError {}

impl ServerSession {
    /// Creates a session for a new connection.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        Self {
            inbox: Inbox {
                frames: FrameBuffer::new(limits),
                decoder: Decoder::new(),
                last_byte: Instant::ORIGIN,
            },
            outbox: Outbox::default(),
        }
    }

    /// Returns both halves, so that a reply can be written while its request is still borrowed.
    pub fn split(&mut self) -> (&mut Inbox, &mut Outbox) {
        (&mut self.inbox, &mut self.outbox)
    }

    /// When [`Inbox::handle_timeout`] is due.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        self.inbox.poll_timeout()
    }

    /// Moves the deadline of an incomplete frame, because time was skipped in which the peer could send
    /// nothing.
    pub fn postpone(&mut self, by: Duration) {
        self.inbox.last_byte += by;
    }

    /// When the next delayed frame may leave.
    #[must_use]
    pub fn next_transmit(&self) -> Option<Instant> {
        self.outbox.delayed.front().map(|(due, _)| *due)
    }
}

impl Inbox {
    /// Takes bytes from the peer and returns how many fit. Push the rest again after [`Self::next_message`]
    /// has returned `None`.
    #[must_use = "bytes that were not taken have to be pushed again"]
    pub fn push(&mut self, now: Instant, bytes: &[u8]) -> usize {
        // A read of zero bytes is not a sign of life.
        if !bytes.is_empty() {
            self.last_byte = now;
        }
        self.frames.push(bytes)
    }

    /// Returns the next message or error, or `None` if more bytes are needed.
    pub fn next_message(&mut self) -> Option<Result<Message<'_>, InputError>> {
        Some(match self.frames.next()? {
            Err(error) => Err(InputError::Frame(error)),
            Ok(frame) => self.decoder.decode(frame.bytes).map_err(InputError::Json),
        })
    }

    /// Gives up a frame that has stayed incomplete for [`PARTIAL_FRAME_TIMEOUT`].
    pub fn handle_timeout(&mut self, now: Instant) -> Option<FrameError> {
        if self.poll_timeout().is_some_and(|due| due <= now) { self.frames.abandon_partial() } else { None }
    }

    fn poll_timeout(&self) -> Option<Instant> {
        (self.frames.pending() > 0).then(|| self.last_byte + PARTIAL_FRAME_TIMEOUT)
    }
}

/// The sending half: frames that leave at once or at a later time.
#[derive(Debug, Default)]
pub struct Outbox {
    /// Frames that may leave now, one after the other.
    ready: Vec<u8>,
    /// How many bytes of `ready` were taken.
    taken: usize,
    /// Where each frame in `ready` ends.
    ends: VecDeque<usize>,
    /// Frames that leave later, earliest first.
    delayed: VecDeque<(Instant, Vec<u8>)>,
    delayed_bytes: usize,
    /// When the last frame of [`Self::send_in_turn`] leaves.
    last_in_turn: Instant,
}

impl Outbox {
    /// Appends one frame with `write`; it leaves at once.
    pub fn send(&mut self, write: impl FnOnce(&mut Vec<u8>)) {
        // Drop the taken bytes once they are at least half of `ready`, so that each byte moves at most once.
        if self.taken > 0 && self.taken * 2 >= self.ready.len() {
            self.ready.drain(..self.taken);
            self.ends.iter_mut().for_each(|end| *end -= self.taken);
            self.taken = 0;
        }
        let before = self.ready.len();
        write(&mut self.ready);
        if self.ready.len() > before {
            self.ends.push_back(self.ready.len());
        }
    }

    /// Creates one frame with `write`; it leaves at `due`. Frames due at the same time leave in the order of
    /// the calls.
    pub fn send_at(&mut self, due: Instant, write: impl FnOnce(&mut Vec<u8>)) {
        let mut frame = Vec::new();
        write(&mut frame);
        self.delayed_bytes += frame.len();
        let at = self.delayed.partition_point(|(other, _)| *other <= due);
        self.delayed.insert(at, (due, frame));
    }

    /// Like [`Self::send_at`], but not before the last frame sent this way, so that replies to one kind of
    /// request leave in the order of the requests.
    pub fn send_in_turn(&mut self, due: Instant, write: impl FnOnce(&mut Vec<u8>)) {
        self.last_in_turn = self.last_in_turn.max(due);
        self.send_at(self.last_in_turn, write);
    }

    /// Releases all due frames, so that they leave before any frame sent later.
    pub fn release(&mut self, now: Instant) {
        while self.delayed.front().is_some_and(|(due, _)| *due <= now) {
            if let Some((_, frame)) = self.delayed.pop_front() {
                self.delayed_bytes -= frame.len();
                self.send(|out| out.extend_from_slice(&frame));
            }
        }
    }

    /// Returns the next whole frame to write to the peer, and marks it as taken.
    pub fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        self.release(now);
        let end = self.ends.pop_front()?;
        let start = std::mem::replace(&mut self.taken, end);
        self.ready.get(start..end)
    }

    /// Returns every frame not yet taken, in order, with the time at which a delayed frame may leave.
    #[must_use]
    pub fn into_frames(mut self) -> Vec<(Option<Instant>, Vec<u8>)> {
        let mut frames = Vec::with_capacity(self.ends.len() + self.delayed.len());
        let mut start = self.taken;
        for end in self.ends.drain(..) {
            frames.push((None, self.ready.get(start..end).unwrap_or_default().to_vec()));
            start = end;
        }
        frames.extend(self.delayed.into_iter().map(|(due, frame)| (Some(due), frame)));
        frames
    }

    /// Whether the peer is so far behind that the connection must be given up ([`MAX_UNSENT_BYTES`]).
    #[must_use]
    pub fn is_overfull(&self) -> bool {
        self.ready.len() - self.taken + self.delayed_bytes > MAX_UNSENT_BYTES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session() -> ServerSession {
        ServerSession::new(Limits::default())
    }

    fn at(ms: u64) -> Instant {
        Instant::ORIGIN + Duration::from_millis(ms)
    }

    #[test]
    fn frames_leave_one_by_one_in_order_of_their_time() {
        let mut session = session();
        let (_, out) = session.split();
        out.send_at(at(18), |out| out.extend_from_slice(b"{\"late\":1}"));
        out.send(|out| out.extend_from_slice(b"{\"a\":1}"));
        out.send(|out| out.extend_from_slice(b"{\"b\":1}"));
        assert_eq!(out.poll_transmit(at(0)), Some(&b"{\"a\":1}"[..]));
        assert_eq!(out.poll_transmit(at(0)), Some(&b"{\"b\":1}"[..]));
        assert_eq!(out.poll_transmit(at(17)), None);
        assert_eq!(session.next_transmit(), Some(at(18)));
        assert_eq!(session.split().1.poll_transmit(at(18)), Some(&b"{\"late\":1}"[..]));
        assert_eq!(session.next_transmit(), None);
    }

    #[test]
    fn only_frames_sent_in_turn_wait_for_one_another() {
        let mut session = session();
        let (_, out) = session.split();
        out.send_at(at(3_000), |out| out.extend_from_slice(b"{\"late\":1}"));
        out.send_in_turn(at(20), |out| out.extend_from_slice(b"{\"a\":1}"));
        out.send_in_turn(at(18), |out| out.extend_from_slice(b"{\"b\":1}"));
        assert_eq!(out.poll_transmit(at(19)), None);
        assert_eq!(out.poll_transmit(at(20)), Some(&b"{\"a\":1}"[..]));
        assert_eq!(out.poll_transmit(at(20)), Some(&b"{\"b\":1}"[..]));
        assert_eq!(out.poll_transmit(at(20)), None);
        assert_eq!(session.next_transmit(), Some(at(3_000)));
    }

    #[test]
    fn frames_are_taken_out_with_their_times() {
        let mut session = session();
        let (_, out) = session.split();
        out.send(|out| out.extend_from_slice(b"{\"a\":1}"));
        out.send(|out| out.extend_from_slice(b"{\"b\":1}"));
        out.send_at(at(18), |out| out.extend_from_slice(b"{\"late\":1}"));
        assert_eq!(out.poll_transmit(at(0)), Some(&b"{\"a\":1}"[..]));
        let frames = std::mem::take(out).into_frames();
        assert_eq!(frames, [(None, b"{\"b\":1}".to_vec()), (Some(at(18)), b"{\"late\":1}".to_vec())]);
    }

    #[test]
    fn a_frame_that_stays_incomplete_is_given_up() {
        let mut session = session();
        let (inbox, _) = session.split();
        assert_eq!(inbox.push(at(0), b"{\"reqType\":\"query\""), 18);
        assert!(inbox.next_message().is_none());
        assert!(inbox.handle_timeout(at(4_999)).is_none());
        assert!(inbox.handle_timeout(at(5_000)).is_some());
        assert_eq!(inbox.push(at(5_001), b"{\"reqType\":\"heartbreak\"}"), 24);
        assert!(matches!(inbox.next_message(), Some(Ok(_))));
        assert!(inbox.next_message().is_none());
    }

    #[test]
    fn what_was_taken_is_forgotten_although_something_always_waits() {
        let mut session = session();
        let (_, out) = session.split();
        out.send(|out| out.extend_from_slice(b"{\"n\":0}"));
        for n in 1..10_000 {
            out.send(|out| out.extend_from_slice(format!("{{\"n\":{n}}}").as_bytes()));
            let before = format!("{{\"n\":{}}}", n - 1);
            assert_eq!(out.poll_transmit(at(0)), Some(before.as_bytes()));
        }
        assert!(out.ready.capacity() < 256, "{}", out.ready.capacity());
    }

    #[test]
    fn a_peer_that_reads_nothing_is_noticed() {
        let mut session = session();
        let (_, out) = session.split();
        out.send_at(at(1), |out| out.resize(MAX_UNSENT_BYTES, b' '));
        assert!(!out.is_overfull());
        out.send(|out| out.push(b' '));
        assert!(out.is_overfull());
    }
}
