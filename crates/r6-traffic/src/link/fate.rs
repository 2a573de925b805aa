//! Which of the faults in force strike, and what becomes of a frame then.

use std::time::Duration;

use crate::fault::{LinkFault, LinkFaultNow};
use crate::random::Random;

/// A fault, and what was drawn for this connection when it began.
#[derive(Clone, Copy, Debug)]
pub(super) struct InForce {
    pub now: LinkFaultNow,
    pub strikes: bool,
    pub felt: StrikeReport,
}

/// Whether anything of this connection was struck since the fault began.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StrikeReport {
    NotYet,
    ToBeTold,
    Told,
}

impl InForce {
    /// It has struck something of this connection.
    pub fn is_felt(&mut self) {
        if self.felt == StrikeReport::NotYet {
            self.felt = StrikeReport::ToBeTold;
        }
    }
}

/// What it is drawn for whether a fault strikes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DrawnFor {
    /// For none: it is about attempts to connect ([`super::Door`]).
    Door,
    /// For each connection, when the fault begins.
    Connection,
    Frame,
    Byte,
}

pub(super) fn drawn_for(fault: LinkFault) -> DrawnFor {
    match fault {
        LinkFault::Refuse | LinkFault::BlackHole => DrawnFor::Door,
        LinkFault::Silence | LinkFault::HalfOpen | LinkFault::Slow { .. } => DrawnFor::Connection,
        LinkFault::ResetMidFrame { .. }
        | LinkFault::CloseBeforeReply
        | LinkFault::Pieces { .. }
        | LinkFault::Coalesce { .. }
        | LinkFault::Latency { .. }
        | LinkFault::Stall { .. } => DrawnFor::Frame,
        LinkFault::Noise => DrawnFor::Byte,
    }
}

/// Bytes a second, where that is what the fault is.
pub(super) fn speed(one: &InForce) -> Option<u32> {
    if let LinkFault::Slow { bytes_per_second } = one.now.fault {
        Some(bytes_per_second.max(1))
    } else {
        None
    }
}

/// What is to become of one frame.
#[derive(Debug, Default)]
pub(super) struct Fate {
    /// The connection is closed in its place.
    pub close: bool,
    /// After how many bytes it breaks off.
    pub cut: Option<usize>,
    /// How much later its second half leaves.
    pub stall: Option<Duration>,
    /// With how many it leaves, and how long it waits for them.
    pub gather: Option<(usize, Duration)>,
    /// How long it takes.
    pub latency: Duration,
    /// In pieces of how many bytes.
    pub piece: Option<usize>,
}

impl Fate {
    /// Draws it for a frame of so many bytes.
    pub fn draw(in_force: &mut [InForce], random: &mut Random, length: usize) -> Self {
        let mut fate = Self::default();
        for one in in_force {
            if drawn_for(one.now.fault) != DrawnFor::Frame || !random.strikes(one.now.chance) {
                continue;
            }
            one.is_felt();
            match one.now.fault {
                LinkFault::CloseBeforeReply => fate.close = true,
                LinkFault::ResetMidFrame { after } => {
                    let most = length.saturating_sub(1);
                    let drawn = 1 + random.below(most);
                    fate.cut.get_or_insert(after.unwrap_or(drawn).min(most));
                }
                LinkFault::Stall { delay } => _ = fate.stall.get_or_insert(delay),
                LinkFault::Coalesce { frames, within } => _ = fate.gather.get_or_insert((frames, within)),
                LinkFault::Latency { to_client, spread, .. } => {
                    fate.latency =
                        fate.latency.saturating_add(to_client).saturating_add(random.up_to(spread));
                }
                LinkFault::Pieces { bytes } => fate.piece = Some(fate.piece.unwrap_or(bytes).min(bytes)),
                LinkFault::Refuse | LinkFault::BlackHole | LinkFault::Silence | LinkFault::HalfOpen => {}
                LinkFault::Slow { .. } | LinkFault::Noise => {}
            }
        }
        fate
    }
}

/// The bytes, as noise lets them be.
pub(super) fn disturbed(in_force: &mut [InForce], random: &mut Random, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for noise in in_force.iter_mut().filter(|one| one.now.fault == LinkFault::Noise) {
        let mut heard = Vec::with_capacity(bytes.len());
        for byte in &bytes {
            let byte = *byte;
            match random.strikes(noise.now.chance).then(|| random.below(3)) {
                None => heard.push(byte),
                Some(0) => {}
                Some(1) => heard.extend([byte, drawn_byte(random, 0)]),
                // Never the byte that it was.
                Some(_) => heard.push(byte ^ drawn_byte(random, 1)),
            }
        }
        if heard != bytes {
            noise.is_felt();
        }
        bytes = heard;
    }
    bytes
}

/// A byte that is not below `least`.
fn drawn_byte(random: &mut Random, least: u8) -> u8 {
    let above = u8::try_from(random.below(usize::from(u8::MAX - least) + 1)).unwrap_or_default();
    least.saturating_add(above)
}
