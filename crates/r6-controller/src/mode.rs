//! The state of a virtual controller when it is switched on.

use r6_proto::OperationMode;

/// A position of the mode key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// Manual (`curMode` 1).
    Manual,
    /// Stop (`curMode` 3).
    Stop,
    /// Automatic (`curMode` 2); the start button then runs the program.
    Auto,
}

/// The state of a virtual controller when it is switched on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StartState {
    /// In automatic, with a program waiting for remote commands (`curMode` 7); `curMode` 2 if the machine is
    /// not homed.
    #[default]
    Waiting,
    /// In automatic, not running (`curMode` 2).
    Auto,
    /// In manual (`curMode` 1).
    Manual,
    /// In stop (`curMode` 3).
    Stopped,
}

impl StartState {
    pub(crate) fn mode(self) -> OperationMode {
        match self {
            Self::Waiting => OperationMode::Running,
            Self::Auto => OperationMode::Auto,
            Self::Manual => OperationMode::Manual,
            Self::Stopped => OperationMode::Stop,
        }
    }
}
