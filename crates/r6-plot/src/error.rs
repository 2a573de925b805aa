//! Why a motion or a program cannot be played.

use std::fmt;

use r6_client::StepError;
use r6_controller::{LibraryError, Refused};
use r6_proto::alarm::AlarmCode;

/// Why a motion or a program cannot be played.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum PlayError {
    /// The motion is wrong.
    Step(StepError),
    /// The motion is too long for a picture.
    TooManyInstructions {
        /// How many it has.
        count: usize,
        /// How many are played at most.
        most: usize,
    },
    /// The arm cannot reach the start.
    StartNotReached {
        /// The alarm that was raised on the way.
        alarm: AlarmCode,
        /// Its cause, in the controller's words.
        why: String,
    },
    /// The controller refuses a frame.
    FrameRefused {
        /// Its number, from 1.
        frame: u64,
        /// Why, in the controller's words.
        why: String,
    },
    /// The taught program has no steps.
    NoSteps,
    /// The taught program calls a program that does not exist. The text says which.
    MissingCall(String),
    /// The controller has no room for the program.
    Library(LibraryError),
    /// The controller does not start the program.
    NotStarted(Refused),
}

impl fmt::Display for PlayError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Step(error) => error.fmt(f),
            Self::TooManyInstructions { count, most } => {
                write!(f, "{count} instructions are too many to play: at most {most}")
            }
            Self::StartNotReached { alarm, why } => {
                write!(f, "the start cannot be reached: alarm {alarm}: {why}")
            }
            Self::FrameRefused { frame, why } => {
                write!(f, "the controller does not take frame {frame}: {why}")
            }
            Self::NoSteps => f.write_str("the program has no steps"),
            Self::MissingCall(missing) => f.write_str(missing),
            Self::Library(error) => error.fmt(f),
            Self::NotStarted(refused) => write!(f, "the program does not start: {refused}"),
        }
    }
}

impl std::error::Error for PlayError {}

impl From<StepError> for PlayError {
    fn from(error: StepError) -> Self {
        Self::Step(error)
    }
}
