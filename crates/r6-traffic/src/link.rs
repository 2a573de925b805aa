//! Applies the faults of a link to one connection: bytes and times in, pieces with their times out.
//!
//! ```text
//! frames of the controller → send → … → poll_to_client     → the client
//! the controller ← poll_to_controller ← … ← receive        ← bytes of the client
//! ```
//!
//! A [`Link`] has no clock and no socket. The same seed and calls give the same deliveries. Without a fault
//! it passes everything on at once. Several faults are applied in this order:
//!
//! 1. a deaf link ([`LinkFault::Silence`], [`LinkFault::HalfOpen`]) loses everything, in both directions;
//! 2. [`LinkFault::CloseBeforeReply`] closes the link in place of the frame;
//! 3. [`LinkFault::ResetMidFrame`] cuts the frame, and resets the link after it;
//! 4. [`LinkFault::Noise`] changes the bytes that are left of the frame;
//! 5. [`LinkFault::Stall`] splits it in half, and sends the second half later;
//! 6. [`LinkFault::Coalesce`] gathers it with other frames; a frame that will be cut or split is not
//!    gathered, and the group before it leaves;
//! 7. [`LinkFault::Latency`] delays it;
//! 8. [`LinkFault::Pieces`] delivers it in pieces;
//! 9. [`LinkFault::Slow`] limits the bytes a second.
//!
//! With two faults of one kind, each draws separately, and the first that strikes counts. Four kinds differ:
//! latencies add up, every noise applies, and the smallest piece and the lowest speed count. The order always
//! stays: nothing leaves before bytes that were given earlier. When a fault ends, bytes in transit keep their
//! times, but a gathered group leaves, and the speed returns to normal.

mod door;
mod fate;
mod way;

use r6_proto::time::Instant;

use crate::fault::{LinkFault, LinkFaultNow};
use crate::random::Random;

pub use door::Door;
use fate::{DrawnFor, Fate, InForce, StrikeReport, disturbed, drawn_for, speed};
use way::{Group, Parcel, Way};

/// How many bytes can wait in one direction; beyond this a link takes no more. An empty link takes one frame
/// of any length. This is enough to fill the buffers of a peer's system, and small enough for a thousand
/// links.
pub const MAX_WAITING_BYTES: usize = 256 * 1024;

/// How many parcels can wait in one direction. A parcel is a frame, or the bytes of one read. A frame rarely
/// has less than 64 bytes.
pub const MAX_WAITING_PARCELS: usize = 4096;

/// What a link delivers to the client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// Bytes to write as one piece.
    Bytes(Vec<u8>),
    /// The connection is closed in an orderly way; nothing follows.
    Close,
    /// The connection is reset; nothing follows.
    Reset,
}

/// Whether a link still carries bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// It carries them.
    Alive,
    /// It loses them. It notices when the peer ends the connection.
    Silent,
    /// It loses them. It does not notice when the peer ends the connection.
    HalfOpen,
    /// The link was closed or reset.
    Over,
}

/// One connection under the faults of its link.
#[derive(Clone, Debug)]
pub struct Link {
    in_force: Vec<InForce>,
    state: State,
    to_client: Way,
    to_controller: Way,
    // Each direction has a generator of its own, so that one direction does not depend on when the other is
    // polled.
    random: Random,
    client_random: Random,
    controller_random: Random,
}

impl Link {
    /// Creates the link of a connection that opens now, while these faults are in force. For a connection
    /// that opened before the faults began, pass no faults here and call [`Self::set_faults`] later.
    #[must_use]
    pub fn new(seed: u64, now: Instant, faults: &[LinkFaultNow]) -> Self {
        // Derives three seeds from one. Neighbouring seeds of this generator give unrelated numbers.
        let of = |nth: u64| Random::new(seed.wrapping_mul(3).wrapping_add(nth));
        let mut link = Self {
            in_force: Vec::new(),
            state: State::Alive,
            to_client: Way::default(),
            to_controller: Way::default(),
            random: of(0),
            client_random: of(1),
            controller_random: of(2),
        };
        if link.begin(now, faults).contains(&LinkFault::Silence) {
            link.deafen(State::Silent, LinkFault::Silence);
        }
        link
    }

    /// Puts these faults in force from now on. A fault that was in force before continues; a new one begins.
    pub fn set_faults(&mut self, now: Instant, faults: &[LinkFaultNow]) {
        if self.begin(now, faults).contains(&LinkFault::HalfOpen) {
            self.deafen(State::HalfOpen, LinkFault::HalfOpen);
        }
    }

    /// Replaces the faults in force. Returns the new faults that strike this connection.
    fn begin(&mut self, now: Instant, faults: &[LinkFaultNow]) -> Vec<LinkFault> {
        let before = std::mem::take(&mut self.in_force);
        let mut begun = Vec::new();
        for fault in faults {
            let known = before.iter().find(|one| one.now == *fault).copied();
            let one = known.unwrap_or_else(|| {
                let strikes = self.random.strikes(fault.chance);
                begun.extend(strikes.then_some(fault.fault));
                InForce { now: *fault, strikes, felt: StrikeReport::NotYet }
            });
            self.in_force.push(one);
        }
        let speed = self.in_force.iter().filter(|one| one.strikes).filter_map(speed).min();
        self.to_client.set_speed(now, speed);
        self.to_controller.set_speed(now, speed);
        if !self.in_force.iter().any(|one| matches!(one.now.fault, LinkFault::Coalesce { .. })) {
            self.to_client.close_group(now);
        }
        begun
    }

    fn deafen(&mut self, state: State, by: LinkFault) {
        // Deafness is permanent. The fault that struck first decides whether the end of the connection is
        // noticed.
        if self.state == State::Alive {
            self.end(state);
            self.in_force
                .iter_mut()
                .filter(|one| one.now.fault == by && one.strikes)
                .for_each(InForce::is_felt);
        }
    }

    /// Returns the next fault that has struck this connection or its bytes. Each fault is reported once while
    /// it is in force.
    pub fn poll_strike(&mut self) -> Option<LinkFault> {
        let one = self.in_force.iter_mut().find(|one| one.felt == StrikeReport::ToBeTold)?;
        one.felt = StrikeReport::Told;
        Some(one.now.fault)
    }

    /// Records that bytes pass and a slow line delays them.
    fn slows(&mut self) {
        self.in_force.iter_mut().filter(|one| one.strikes && speed(one).is_some()).for_each(InForce::is_felt);
    }

    fn end(&mut self, state: State) {
        self.state = state;
        self.to_client.clear();
        self.to_controller.clear();
    }

    /// Whether the link currently has no effect: it passes on everything at once and unchanged, and nothing
    /// is in transit.
    #[must_use]
    pub fn is_transparent(&self) -> bool {
        self.state == State::Alive
            && self.is_idle()
            && !self.in_force.iter().any(|one| match drawn_for(one.now.fault) {
                DrawnFor::Door => false,
                DrawnFor::Connection => one.strikes && speed(one).is_some(),
                DrawnFor::Frame | DrawnFor::Byte => one.now.chance > 0.0,
            })
    }

    /// Whether nothing is in transit, in either direction.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.to_client.is_empty() && self.to_controller.is_empty()
    }

    /// Whether the link loses everything for ever.
    #[must_use]
    pub fn is_deaf(&self) -> bool {
        matches!(self.state, State::Silent | State::HalfOpen)
    }

    /// Whether the controller notices that the peer closed or reset the connection. A half-open link hides
    /// this. The shell then still drops its socket, and reports to the controller that the peer is lost
    /// instead of gone.
    #[must_use]
    pub fn notices_end(&self) -> bool {
        self.state != State::HalfOpen
    }

    /// Whether [`Self::send`] accepts a frame.
    #[must_use]
    pub fn takes_frames(&self) -> bool {
        self.to_client.has_room(MAX_WAITING_BYTES)
    }

    /// Accepts a frame to the client. Returns `false` if too much is waiting; the caller then has to send it
    /// again later.
    #[must_use = "a frame that was not taken has to be sent again"]
    pub fn send(&mut self, now: Instant, frame: &[u8]) -> bool {
        if self.state != State::Alive || self.to_client.is_ending() || frame.is_empty() {
            return true;
        }
        if !self.takes_frames() {
            return false;
        }
        self.slows();
        let fate = Fate::draw(&mut self.in_force, &mut self.client_random, frame.len());
        if fate.close {
            self.to_client.end(now + fate.latency, Delivery::Close);
            return true;
        }
        let kept = frame.get(..fate.cut.unwrap_or(frame.len())).unwrap_or(frame);
        let mut bytes = disturbed(&mut self.in_force, &mut self.client_random, kept);
        let due = now + fate.latency;
        if let Some(delay) = fate.stall {
            let later = bytes.split_off(bytes.len() / 2);
            self.to_client.push(due, Parcel::new(bytes, fate.piece));
            self.to_client.push(due + delay, Parcel::new(later, fate.piece));
        } else if let (Some((frames, within)), None) = (fate.gather, fate.cut) {
            let group = Group { frames, until: now + within, latency: fate.latency };
            self.to_client.gather(now, group, Parcel::new(bytes, fate.piece));
        } else {
            self.to_client.push(due, Parcel::new(bytes, fate.piece));
        }
        if fate.cut.is_some() {
            self.to_client.end(due, Delivery::Reset);
        }
        true
    }

    /// Returns what to write to the client now. Call it until it returns `None`.
    pub fn poll_to_client(&mut self, now: Instant) -> Option<Delivery> {
        let delivery = self.to_client.poll(now)?;
        if matches!(delivery, Delivery::Close | Delivery::Reset) {
            self.end(State::Over);
        }
        Some(delivery)
    }

    /// How many bytes [`Self::receive`] takes now. Do not read more from the peer: what it sends then fills
    /// the buffers of its own system, and it has to wait.
    #[must_use]
    pub fn room(&self) -> usize {
        self.to_controller.room(MAX_WAITING_BYTES)
    }

    /// Takes bytes from the client and returns how many fit.
    #[must_use = "bytes that were not taken have to be given again"]
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) -> usize {
        if self.state != State::Alive {
            return bytes.len();
        }
        let taken = bytes.get(..self.room()).unwrap_or(bytes);
        self.slows();
        let mut due = now;
        for one in &mut self.in_force {
            if let LinkFault::Latency { to_controller, spread, .. } = one.now.fault
                && self.controller_random.strikes(one.now.chance)
            {
                one.is_felt();
                due = due + to_controller + self.controller_random.up_to(spread);
            }
        }
        self.to_controller.push(due, Parcel::new(taken.to_vec(), None));
        taken.len()
    }

    /// Returns bytes for the controller. Call it until it returns `None`.
    pub fn poll_to_controller(&mut self, now: Instant) -> Option<Vec<u8>> {
        match self.to_controller.poll(now)? {
            Delivery::Bytes(bytes) => Some(bytes),
            Delivery::Close | Delivery::Reset => None,
        }
    }

    /// When one of the polls returns something next; `None` while nothing is in transit.
    #[must_use]
    pub fn next_due(&self) -> Option<Instant> {
        self.to_client.next_due().into_iter().chain(self.to_controller.next_due()).min()
    }
}
