//! One direction of a link: the bytes in transit, in their order.

use std::collections::VecDeque;
use std::time::Duration;

use r6_proto::time::Instant;

use super::{Delivery, MAX_WAITING_PARCELS};

/// A slow line delivers the bytes of this period at once, but at least one byte. A timer for each byte would
/// cost more than it shows.
const SLICE: Duration = Duration::from_millis(20);

/// Bytes that were given together.
#[derive(Clone, Debug)]
pub(super) struct Parcel {
    bytes: Vec<u8>,
    /// How many bytes were delivered.
    taken: usize,
    /// How many bytes are delivered at once.
    piece: Option<usize>,
}

impl Parcel {
    pub fn new(bytes: Vec<u8>, piece: Option<usize>) -> Self {
        Self { bytes, taken: 0, piece }
    }

    fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.taken)
    }

    /// Returns the next piece, of at most `most` bytes.
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
    /// How many frames.
    pub frames: usize,
    /// The latest time at which they leave.
    pub until: Instant,
    /// Their delay from then on.
    pub latency: Duration,
}

/// The group in the last parcel.
#[derive(Clone, Copy, Debug)]
struct Gathering {
    group: Group,
    missing: usize,
    /// When the bytes given before the group are due.
    after: Instant,
}

/// One direction of a link.
#[derive(Clone, Debug, Default)]
pub(super) struct Way {
    parcels: VecDeque<(Instant, Parcel)>,
    /// How it ends after the last parcel.
    end: Option<(Instant, Delivery)>,
    /// How many bytes wait.
    bytes: usize,
    /// When the bytes given last are due. Nothing overtakes them.
    last_due: Instant,
    gathering: Option<Gathering>,
    /// Bytes a second.
    speed: Option<u32>,
    /// When a slow line has carried the bytes that it was given last.
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

    /// How many bytes it takes. At most `most` bytes wait, and on a slow line at most the bytes of one
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

    /// Ends the direction after the bytes given so far. Later bytes are lost.
    pub fn end(&mut self, due: Instant, how: Delivery) {
        self.gathering = None;
        if self.end.is_none() {
            self.last_due = self.last_due.max(due);
            self.end = Some((self.last_due, how));
        }
    }

    /// Adds a frame to the current group, or begins a new group.
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
                // Noise may have removed all of its bytes.
                let is_there = self.parcels.len() > before;
                self.gathering =
                    is_there.then_some(Gathering { group, missing: group.frames.saturating_sub(1), after });
            }
        }
        if self.gathering.is_some_and(|gathering| gathering.missing == 0) {
            self.close_group(now);
        }
    }

    /// Releases an incomplete group.
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
            // The delivered parcel can take no more frames.
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

    /// Drops everything in transit.
    pub fn clear(&mut self) {
        self.parcels = VecDeque::new();
        self.end = None;
        self.gathering = None;
        self.bytes = 0;
    }
}

/// How many bytes are carried in `time`, at `speed` bytes a second.
fn carried(speed: u32, time: Duration) -> usize {
    usize::try_from(u128::from(speed) * time.as_nanos() / 1_000_000_000).unwrap_or(usize::MAX)
}

/// How long `bytes` bytes take, at `speed` bytes a second.
fn time_for(bytes: usize, speed: u32) -> Duration {
    let nanos = u128::try_from(bytes).unwrap_or(u128::MAX).saturating_mul(1_000_000_000);
    Duration::from_nanos(u64::try_from(nanos.div_ceil(u128::from(speed.max(1)))).unwrap_or(u64::MAX))
}
