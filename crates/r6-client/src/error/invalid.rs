//! Requests that cannot be sent as they are.

use std::fmt;

use r6_proto::client::SendError;
use r6_proto::error::EncodeError;

use super::{NotSent, RequestError};
use crate::guard::violation::Violation;
use crate::moves::step_error::StepError;

/// Why a request cannot be sent as it is. Nothing was sent, and sending it again fails again: the caller has
/// to change it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Invalid {
    /// The text is not an address.
    BadAddress {
        /// As given.
        address: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// The wire cannot carry a value.
    Value(EncodeError),
    /// The frame is longer than [`crate::RobotSettings::max_frame_bytes`] allows.
    TooLong {
        /// Its length.
        bytes: usize,
        /// The limit.
        limit: usize,
    },
    /// A step of the motion is wrong.
    Step(StepError),
    /// A list goes beyond the envelope of this handle's guard.
    OutsideEnvelope(Violation),
    /// The request was a stop ([`crate::Robot::stop`]): the arm may continue with what is in its list.
    NotStopped(Box<Invalid>),
}

impl From<Invalid> for RequestError {
    fn from(error: Invalid) -> Self {
        Self::Invalid(error)
    }
}

impl From<SendError> for RequestError {
    fn from(error: SendError) -> Self {
        match error {
            SendError::Encode(error) => Invalid::Value(error).into(),
            SendError::TooLong { bytes, limit } => Invalid::TooLong { bytes, limit }.into(),
            // Room comes back as the connection takes bytes and replies arrive.
            SendError::OutputFull { .. } | SendError::TooManyInFlight { .. } => NotSent::NoRoom(error).into(),
        }
    }
}

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Self::NotStopped(why) = self {
            return write!(f, "{}; {why}", NotSent::NOT_STOPPED);
        }
        f.write_str("nothing was sent: ")?;
        match self {
            Self::BadAddress { address, problem } => {
                write!(f, "`{address}` is no address: {problem}; write host or host:port")
            }
            Self::Value(error) => error.fmt(f),
            Self::TooLong { bytes, limit } => SendError::TooLong { bytes: *bytes, limit: *limit }.fmt(f),
            Self::Step(error) => error.fmt(f),
            Self::OutsideEnvelope(violation) => violation.fmt(f),
            Self::NotStopped(why) => why.fmt(f),
        }
    }
}

impl std::error::Error for Invalid {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Value(error) => Some(error),
            Self::Step(error) => Some(error),
            Self::OutsideEnvelope(violation) => Some(violation),
            Self::NotStopped(why) => Some(&**why),
            Self::BadAddress { .. } | Self::TooLong { .. } => None,
        }
    }
}
