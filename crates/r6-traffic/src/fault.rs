//! What can be broken on a link on purpose.

use std::time::Duration;

/// What happens to connections and to bytes on their way; frames are not looked into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LinkFault {
    /// T1: connections are refused.
    Refuse,
    /// T2: nothing answers an attempt to connect.
    BlackHole,
    /// T3: connections that come now are accepted, and never answered, not even later.
    Silence,
    /// T4: the connection is reset in the middle of a frame.
    ResetMidFrame {
        /// After how many bytes of the frame; all but one at most. `None`: drawn for each frame.
        after: Option<usize>,
    },
    /// T5: the connection is closed in good order where a frame should have left.
    CloseBeforeReply,
    /// T6: connections that are there go deaf for ever, without a word; they keep their places among those
    /// that are served.
    HalfOpen,
    /// T7: a frame is sent in pieces, one packet each.
    Pieces {
        /// How many bytes a piece has, from 1.
        bytes: usize,
    },
    /// T7: several frames are sent together, in one packet.
    Coalesce {
        /// How many frames wait for each other, from 2.
        frames: usize,
        /// How long the first of them waits at most, even if the others have not come.
        within: Duration,
    },
    /// T8: bytes take their time; their order stays. What is drawn is drawn for each frame to the client, and
    /// for what one read gave to the controller.
    Latency {
        /// To the controller.
        to_controller: Duration,
        /// To the client.
        to_client: Duration,
        /// How much longer it may be.
        spread: Duration,
    },
    /// T9: so few bytes a second, in each direction; what waits fills the peer's buffers.
    Slow {
        /// Bytes a second, from 1.
        bytes_per_second: u32,
    },
    /// T11: a byte to the client is changed, is lost, or is followed by another one. The chance holds for
    /// each byte.
    Noise,
    /// T14: the second half of a frame leaves that much later, as where two writes meet a peer that delays
    /// its acknowledgements.
    Stall {
        /// How much later.
        delay: Duration,
    },
}

/// A fault that is in force now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkFaultNow {
    /// Which.
    pub fault: LinkFault,
    /// How likely it strikes, 0 to 1: each frame; each byte for [`LinkFault::Noise`]; each connection, once,
    /// for [`LinkFault::Silence`], [`LinkFault::HalfOpen`] and [`LinkFault::Slow`]. The door knows no chance:
    /// [`LinkFault::Refuse`] and [`LinkFault::BlackHole`] hold for everybody.
    pub chance: f64,
}
