//! Operation modes.

use std::fmt;

/// What the cabinet is doing, as `curMode` tells it (manual 4.1.1 #5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OperationMode {
    /// 0: none.
    None,
    /// 1: manual.
    Manual,
    /// 2: automatic, not running.
    Auto,
    /// 3: stop.
    Stop,
    /// 7: automatic, running: a program runs, or waits for remote commands.
    Running,
    /// 8: single step.
    SingleStep,
    /// 9: single cycle.
    SingleCycle,
}

impl OperationMode {
    /// The number on the wire.
    #[must_use]
    pub fn number(self) -> i64 {
        match self {
            Self::None => 0,
            Self::Manual => 1,
            Self::Auto => 2,
            Self::Stop => 3,
            Self::Running => 7,
            Self::SingleStep => 8,
            Self::SingleCycle => 9,
        }
    }

    /// Whether a program runs: only then are remote instructions executed.
    #[must_use]
    pub fn runs(self) -> bool {
        match self {
            Self::Running | Self::SingleStep | Self::SingleCycle => true,
            Self::None | Self::Manual | Self::Auto | Self::Stop => false,
        }
    }
}

impl fmt::Display for OperationMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "none",
            Self::Manual => "manual",
            Self::Auto => "automatic, not running",
            Self::Stop => "stop",
            Self::Running => "automatic, running",
            Self::SingleStep => "single step",
            Self::SingleCycle => "single cycle",
        })
    }
}

/// How a virtual controller stands when it is switched on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StartState {
    /// Homed, in automatic, with a program waiting for remote commands (`curMode` 7).
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
