//! One direction of a link: what is on its way, in its order.

use std::collections::VecDeque;
use std::time::Duration;

use r6_proto::time::Instant;

use super::{Delivery, MAX_WAITING_PARCELS};

/// A slow line hands over what it carries in this time at once, but at least a byte: a timer for each byte
/// would cost more than it shows.
const SLICE: Duration = Duration::from_millis(20);

/// Bytes that were given together.
#[derive(Clone, Debug)]
pub(super) struct Parcel {
    bytes: Vec<u8>,
    /// How many of them were handed over.
    taken: usize,
    /// How many of them are handed over at once.
    piece: Option<usize>,
}

impl Parcel {
    pub fn new(bytes: Vec<u8>, piece: Option<usize>) -> Self {
        Self { bytes, taken: 0, piece }
    }

    fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.taken)
    }

    /// The next piece, of at most so many bytes.
    fn take(&mut self, most: usize) -> Vec<u8> {
        let count = self.piece.unwrap_or(usize::MAX).min(most).max(1).min(self.left());
        let begin = self.taken;
        self.taken += count;
        if count == self.bytes.len() {
            return std::mem::take(&mut self.bytes);
        }
        self.bytes.get(begin..self.taken).unwrap_or_default().to_vec()
    }
}

/// Frames that leave together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    /// How many.
    pub frames: usize,
    /// When at the latest.
    pub until: Instant,
    /// How long they take from then on.
    pub latency: Duration,
}

/// The group that the last parcel is.
#[derive(Clone, Copy, Debug)]
struct Gathering {
    group: Group,
    missing: usize,
    /// When what was given before it is due.
    after: Instant,
}

/// One direction of a link.
#[derive(Clone, Debug, Default)]
pub(super) struct Way {
    parcels: VecDeque<(Instant, Parcel)>,
    /// How it ends behind the last parcel.
    end: Option<(Instant, Delivery)>,
    /// How many bytes wait.
    bytes: usize,
    /// When what was given last is due: nothing overtakes it.
    last_due: Instant,
    gathering: Option<Gathering>,
    /// Bytes a second.
    speed: Option<u32>,
    /// When a slow line has carried what it was given last.
    free: Instant,
}

impl Way {
    pub fn is_empty(&self) -> bool {
        self.parcels.is_empty() && self.end.is_none()
    }

    pub fn is_ending(&self) -> bool {
        self.end.is_some()
    }

    pub fn has_room(&self, most: usize) -> bool {
        self.room(most) > 0
    }

    /// How many bytes it takes: no more than `most` wait, and on a slow line no more than it carries in a
    /// second.
    pub fn room(&self, most: usize) -> usize {
        if self.parcels.len() >= MAX_WAITING_PARCELS {
            return 0;
        }
        let carried = self.speed.and_then(|speed| usize::try_from(speed).ok()).unwrap_or(usize::MAX);
        most.min(carried).saturating_sub(self.bytes)
    }

    pub fn set_speed(&mut self, now: Instant, speed: Option<u32>) {
        if speed != self.speed {
            self.speed = speed;
            self.free = now;
        }
    }

    pub fn push(&mut self, due: Instant, parcel: Parcel) {
        self.gathering = None;
        self.append(due, parcel);
    }

    fn append(&mut self, due: Instant, parcel: Parcel) {
        if parcel.left() > 0 && self.end.is_none() {
            self.last_due = self.last_due.max(due);
            self.bytes += parcel.left();
            self.parcels.push_back((self.last_due, parcel));
        }
    }

    /// Ends it behind what was given; what comes later is lost.
    pub fn end(&mut self, due: Instant, how: Delivery) {
        self.gathering = None;
        if self.end.is_none() {
            self.last_due = self.last_due.max(due);
            self.end = Some((self.last_due, how));
        }
    }

    /// Adds a frame to the group that is gathered, or begins one.
    pub fn gather(&mut self, now: Instant, group: Group, frame: Parcel) {
        if self.gathering.is_some_and(|gathering| gathering.group.until <= now) {
            self.gathering = None;
        }
        match (&mut self.gathering, self.parcels.back_mut()) {
            (Some(gathering), Some((_, parcel))) => {
                self.bytes += frame.bytes.len();
                parcel.bytes.extend_from_slice(&frame.bytes);
                gathering.missing = gathering.missing.saturating_sub(1);
            }
            (_, _) => {
                let after = self.last_due;
                let before = self.parcels.len();
                self.append(group.until + group.latency, frame);
                // Noise may have left nothing of it.
                let is_there = self.parcels.len() > before;
                self.gathering =
                    is_there.then_some(Gathering { group, missing: group.frames.saturating_sub(1), after });
            }
        }
        if self.gathering.is_some_and(|gathering| gathering.missing == 0) {
            self.close_group(now);
        }
    }

    /// Lets a group leave that is not complete.
    pub fn close_group(&mut self, now: Instant) {
        if let (Some(gathering), Some((due, _))) = (self.gathering.take(), self.parcels.back_mut()) {
            *due = (*due).min(now + gathering.group.latency).max(gathering.after);
            self.last_due = *due;
        }
    }

    pub fn poll(&mut self, now: Instant) -> Option<Delivery> {
        if self.next_due()? > now {
            return None;
        }
        let is_last = self.parcels.len() == 1;
        let Some((_, parcel)) = self.parcels.front_mut() else {
            return self.end.take().map(|(_, how)| how);
        };
        let most = match self.speed {
            None => usize::MAX,
            Some(speed) => carried(speed, SLICE).max(1),
        };
        let bytes = parcel.take(most);
        self.bytes = self.bytes.saturating_sub(bytes.len());
        if let Some(speed) = self.speed {
            self.free = now + time_for(bytes.len(), speed);
        }
        if parcel.left() == 0 {
            self.parcels.pop_front();
        }
        if is_last {
            // What is handed over gathers nothing any more.
            self.gathering = None;
        }
        Some(Delivery::Bytes(bytes))
    }

    pub fn next_due(&self) -> Option<Instant> {
        match self.parcels.front() {
            Some((due, _)) if self.speed.is_some() => Some(self.free.max(*due)),
            Some((due, _)) => Some(*due),
            None => self.end.as_ref().map(|(due, _)| *due),
        }
    }

    /// Whatever is on its way is lost.
    pub fn clear(&mut self) {
        self.parcels = VecDeque::new();
        self.end = None;
        self.gathering = None;
        self.bytes = 0;
    }
}

/// How many bytes are carried in a time, at so many a second.
fn carried(speed: u32, time: Duration) -> usize {
    usize::try_from(u128::from(speed) * time.as_nanos() / 1_000_000_000).unwrap_or(usize::MAX)
}

/// How long so many bytes take, at so many a second.
fn time_for(bytes: usize, speed: u32) -> Duration {
    let nanos = u128::try_from(bytes).unwrap_or(u128::MAX).saturating_mul(1_000_000_000);
    Duration::from_nanos(u64::try_from(nanos.div_ceil(u128::from(speed.max(1)))).unwrap_or(u64::MAX))
}
