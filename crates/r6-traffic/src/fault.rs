//! Faults that can be injected into a link.

use std::time::Duration;

/// A fault that acts on connections or on bytes in transit. It does not depend on the content of frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LinkFault {
    /// T1: connections are refused.
    Refuse,
    /// T2: attempts to connect get no answer.
    BlackHole,
    /// T3: connections made now are accepted but never get an answer, not even later.
    Silence,
    /// T4: the connection is reset in the middle of a frame.
    ResetMidFrame {
        /// After how many bytes of the frame; at most all but one. `None`: drawn for each frame.
        after: Option<usize>,
    },
    /// T5: the connection is closed in an orderly way in place of a frame.
    CloseBeforeReply,
    /// T6: existing connections become deaf for ever without any sign. They still count as served
    /// connections.
    HalfOpen,
    /// T7: a frame is sent in pieces, each in a packet of its own.
    Pieces {
        /// Length of a piece in bytes, from 1.
        bytes: usize,
    },
    /// T7: several frames are sent together in one packet.
    Coalesce {
        /// How many frames are sent together, from 2.
        frames: usize,
        /// How long the first frame waits at most, even if the others have not come.
        within: Duration,
    },
    /// T8: bytes are delayed; their order stays. The delay is drawn for each frame to the client, and for
    /// each read of bytes to the controller.
    Latency {
        /// To the controller.
        to_controller: Duration,
        /// To the client.
        to_client: Duration,
        /// The maximum additional delay.
        spread: Duration,
    },
    /// T9: a limited number of bytes a second in each direction. Waiting bytes fill the peer's buffers.
    Slow {
        /// Bytes a second, from 1.
        bytes_per_second: u32,
    },
    /// T11: a byte to the client is changed, lost, or followed by an extra byte. The chance applies to each
    /// byte.
    Noise,
    /// T14: the second half of a frame leaves later by `delay`, as with two writes to a peer that delays its
    /// acknowledgements.
    Stall {
        /// The delay of the second half.
        delay: Duration,
    },
}

/// A fault that is in force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkFaultNow {
    /// The fault.
    pub fault: LinkFault,
    /// The chance that it strikes, 0 to 1. It applies to each frame; for [`LinkFault::Noise`] to each byte;
    /// for [`LinkFault::Silence`], [`LinkFault::HalfOpen`] and [`LinkFault::Slow`] once to each connection.
    /// [`LinkFault::Refuse`] and [`LinkFault::BlackHole`] ignore it and apply to every attempt to connect.
    pub chance: f64,
}
