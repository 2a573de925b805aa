//! Decides which faults strike, and what happens to a frame.

use std::time::Duration;

use crate::fault::{LinkFault, LinkFaultNow};
use crate::random::Random;

/// A fault, with the result that was drawn for this connection when it began.
#[derive(Clone, Copy, Debug)]
pub(super) struct InForce {
    pub now: LinkFaultNow,
    pub strikes: bool,
    pub felt: StrikeReport,
}

/// Whether the fault has struck anything of this connection since it began, and whether that was reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StrikeReport {
    NotYet,
    ToBeTold,
    Told,
}

impl InForce {
    /// Records that the fault has struck something of this connection.
    pub fn is_felt(&mut self) {
        if self.felt == StrikeReport::NotYet {
            self.felt = StrikeReport::ToBeTold;
        }
    }
}

/// The unit for which the chance of a fault is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DrawnFor {
    /// Not drawn: the fault concerns attempts to connect ([`super::Door`]).
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

/// Bytes a second, if the fault is [`LinkFault::Slow`].
pub(super) fn speed(one: &InForce) -> Option<u32> {
    if let LinkFault::Slow { bytes_per_second } = one.now.fault {
        Some(bytes_per_second.max(1))
    } else {
        None
    }
}

/// What happens to one frame.
#[derive(Debug, Default)]
pub(super) struct Fate {
    /// The connection is closed in place of the frame.
    pub close: bool,
    /// The number of bytes after which the frame is cut.
    pub cut: Option<usize>,
    /// The delay of its second half.
    pub stall: Option<Duration>,
    /// The number of frames in its group, and how long it waits for them.
    pub gather: Option<(usize, Duration)>,
    /// Its delay.
    pub latency: Duration,
    /// The length of its pieces in bytes.
    pub piece: Option<usize>,
}

impl Fate {
    /// Draws the fate of a frame of this length.
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

/// Applies noise to the bytes.
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
                // The changed byte always differs from the original.
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

/// Draws a byte of at least `least`.
fn drawn_byte(random: &mut Random, least: u8) -> u8 {
    let above = u8::try_from(random.below(usize::from(u8::MAX - least) + 1)).unwrap_or_default();
    least.saturating_add(above)
}
