//! Events of a connection that no request asked for.

use std::fmt;
use std::io::ErrorKind;
use std::sync::Arc;

use r6_proto::client::StrayReason;
use r6_proto::error::JsonError;
use r6_proto::frame::FrameError;

use crate::identity::Found;

/// How many events are kept for a subscriber that lags behind. After that it misses the oldest and learns how
/// many.
pub(crate) const KEPT_FOR_SUBSCRIBERS: usize = 64;

/// The bytes kept of a stray frame, at most: no known frame of a controller is longer.
const KEPT_OF_A_FRAME: usize = 4096;

/// Something that happened on the connection and that no request asked for.
#[derive(Clone, Debug)]
pub enum Pushed {
    /// The controller asks for a photo (manual 5.1); answer it with [`crate::Robot::answer_photo`].
    Photo {
        /// The camera.
        cam_id: i64,
    },
    /// A frame that answers no waiting request.
    Stray {
        /// Why it answers nothing.
        reason: StrayReason,
        /// Its bytes, cut at 4 096.
        frame: Arc<[u8]>,
    },
    /// Bytes that are not a frame.
    BadFrame(FrameError),
    /// A frame that is not JSON.
    NotJson(JsonError),
    /// The connection ended.
    ConnectionLost(LostReason),
    /// The client reconnected, and the controller has reported its identity and state.
    Reconnected(Found),
}

impl Pushed {
    pub(crate) fn stray(reason: StrayReason, frame: &[u8]) -> Self {
        Self::Stray { reason, frame: frame.get(..KEPT_OF_A_FRAME).unwrap_or(frame).into() }
    }
}

/// How a connection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LostReason {
    /// The controller closed it.
    ClosedByPeer,
    /// The operating system reported a failure.
    Io(ErrorKind),
    /// A frame could not be sent: the controller takes no more bytes.
    Stalled,
    /// Several requests in a row timed out, without a reply in between.
    Unresponsive,
    /// Replies could no longer be matched to requests with certainty.
    OutOfStep,
    /// The client closed it.
    ClosedHere,
}

impl fmt::Display for LostReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ClosedByPeer => f.write_str("the controller closed it"),
            Self::Io(kind) => write!(f, "{kind}"),
            Self::Stalled => f.write_str("the controller takes no more bytes"),
            Self::Unresponsive => f.write_str("the controller stopped answering"),
            Self::ClosedHere => f.write_str("this side closed it"),
            Self::OutOfStep => f.write_str("it could no longer be told which reply answers which request"),
        }
    }
}
