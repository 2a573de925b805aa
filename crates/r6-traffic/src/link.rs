//! What the faults of a link do to one connection: bytes and times in, pieces with their times out.
//!
//! ```text
//! frames of the controller → send → … → poll_to_client     → the client
//! the controller ← poll_to_controller ← … ← receive        ← bytes of the client
//! ```
//!
//! A [`Link`] has no clock and no socket, and the same seed and calls give the same deliveries. Without a
//! fault it hands on at once what it was given. Several faults at once strike in this order:
//!
//! 1. a deaf link ([`LinkFault::Silence`], [`LinkFault::HalfOpen`]) loses everything, in both directions;
//! 2. [`LinkFault::CloseBeforeReply`] ends the link where the frame would be;
//! 3. [`LinkFault::ResetMidFrame`] cuts the frame, and ends the link behind it;
//! 4. [`LinkFault::Noise`] changes what is left of the frame;
//! 5. [`LinkFault::Stall`] halves it, and lets the second half follow later;
//! 6. [`LinkFault::Coalesce`] gathers it with others; a frame that is to be cut or halved is not gathered,
//!    and lets go those before it;
//! 7. [`LinkFault::Latency`] lets it leave later;
//! 8. [`LinkFault::Pieces`] hands it over in pieces;
//! 9. [`LinkFault::Slow`] says how many bytes leave in which time.
//!
//! Two faults of one kind: each draws whether it strikes, and the first that does counts; but latencies add
//! up, every noise is heard, and of pieces and speeds the smallest counts. Order is always kept: nothing
//! leaves before what was given earlier. What is on its way when a fault ends keeps its time, but a group
//! that is gathered leaves, and the speed is as before.

mod door;
mod fate;
mod way;

use r6_proto::time::Instant;

use crate::fault::{LinkFault, LinkFaultNow};
use crate::random::Random;

pub use door::Door;
use fate::{DrawnFor, Fate, InForce, StrikeReport, disturbed, drawn_for, speed};
use way::{Group, Parcel, Way};

/// How many bytes wait in one direction; then a link takes no more. An empty link takes one frame of any
/// length. Enough to fill the buffers of a peer's system, and little enough for a thousand links.
pub const MAX_WAITING_BYTES: usize = 256 * 1024;

/// How many parcels, each a frame or what was read at once, wait in one direction: a frame has seldom less
/// than 64 bytes.
pub const MAX_WAITING_PARCELS: usize = 4096;

/// What a link hands to the client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// Bytes, to be written as one piece.
    Bytes(Vec<u8>),
    /// The connection is closed in good order; nothing follows.
    Close,
    /// The connection is reset; nothing follows.
    Reset,
}

/// Whether a link still carries bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// It does.
    Alive,
    /// It loses them; that the peer ends the connection is noticed.
    Silent,
    /// It loses them; that the peer ends the connection is not noticed.
    HalfOpen,
    /// It was closed or reset.
    Over,
}

/// One connection, as the faults of its link let it be.
#[derive(Clone, Debug)]
pub struct Link {
    in_force: Vec<InForce>,
    state: State,
    to_client: Way,
    to_controller: Way,
    // Each draws by itself, so that one direction does not depend on when the other is looked at.
    random: Random,
    client_random: Random,
    controller_random: Random,
}

impl Link {
    /// The link of a connection that is opened now, while these faults are in force. For one that was opened
    /// before they began, give none here, and [`Self::set_faults`] then.
    #[must_use]
    pub fn new(seed: u64, now: Instant, faults: &[LinkFaultNow]) -> Self {
        // Three seeds out of one: neighbouring seeds of this generator have nothing in common.
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

    /// These faults are in force from now on. One that was before goes on; one that was not begins.
    pub fn set_faults(&mut self, now: Instant, faults: &[LinkFaultNow]) {
        if self.begin(now, faults).contains(&LinkFault::HalfOpen) {
            self.deafen(State::HalfOpen, LinkFault::HalfOpen);
        }
    }

    /// Puts these in the place of those in force; tells which of them begin, and strike this connection.
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
        // Deaf for good, and what was lost first decides what is noticed.
        if self.state == State::Alive {
            self.end(state);
            self.in_force
                .iter_mut()
                .filter(|one| one.now.fault == by && one.strikes)
                .for_each(InForce::is_felt);
        }
    }

    /// The next fault that has struck this connection, or a byte of it: each is told once for as long as it
    /// is in force.
    pub fn poll_strike(&mut self) -> Option<LinkFault> {
        let one = self.in_force.iter_mut().find(|one| one.felt == StrikeReport::ToBeTold)?;
        one.felt = StrikeReport::Told;
        Some(one.now.fault)
    }

    /// Bytes pass: a slow line makes them wait.
    fn slows(&mut self) {
        self.in_force.iter_mut().filter(|one| one.strikes && speed(one).is_some()).for_each(InForce::is_felt);
    }

    fn end(&mut self, state: State) {
        self.state = state;
        self.to_client.clear();
        self.to_controller.clear();
    }

    /// Whether it is as good as none: whatever is given now is handed on at once and unchanged, and nothing
    /// is under way.
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

    /// Whether nothing is under way, in either direction.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.to_client.is_empty() && self.to_controller.is_empty()
    }

    /// Whether it loses everything, for ever.
    #[must_use]
    pub fn is_deaf(&self) -> bool {
        matches!(self.state, State::Silent | State::HalfOpen)
    }

    /// Whether the controller gets to know that the peer has closed or reset the connection: not over a
    /// half-open link. The shell drops its socket then all the same, and tells the controller that the peer
    /// is lost, in place of that it has left.
    #[must_use]
    pub fn notices_end(&self) -> bool {
        self.state != State::HalfOpen
    }

    /// Whether [`Self::send`] takes a frame.
    #[must_use]
    pub fn takes_frames(&self) -> bool {
        self.to_client.has_room(MAX_WAITING_BYTES)
    }

    /// Takes a frame to the client; false if so much is waiting that it has to be sent again later.
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

    /// What is to be written to the client now; call it until there is nothing.
    pub fn poll_to_client(&mut self, now: Instant) -> Option<Delivery> {
        let delivery = self.to_client.poll(now)?;
        if matches!(delivery, Delivery::Close | Delivery::Reset) {
            self.end(State::Over);
        }
        Some(delivery)
    }

    /// How many bytes [`Self::receive`] takes now. Read no more from the peer: what it sends then fills the
    /// buffers of its own system, and it has to wait.
    #[must_use]
    pub fn room(&self) -> usize {
        self.to_controller.room(MAX_WAITING_BYTES)
    }

    /// Takes bytes from the client and tells how many there was room for.
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

    /// What is to be given to the controller now; call it until there is nothing.
    pub fn poll_to_controller(&mut self, now: Instant) -> Option<Vec<u8>> {
        match self.to_controller.poll(now)? {
            Delivery::Bytes(bytes) => Some(bytes),
            Delivery::Close | Delivery::Reset => None,
        }
    }

    /// When one of the polls has something next; `None` while nothing is under way.
    #[must_use]
    pub fn next_due(&self) -> Option<Instant> {
        self.to_client.next_due().into_iter().chain(self.to_controller.next_due()).min()
    }
}
