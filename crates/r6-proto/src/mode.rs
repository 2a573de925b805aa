//! Operation modes (`curMode`).

use std::fmt;

/// The operation mode of a controller (`curMode`, manual 4.1.1 #5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OperationMode {
    /// 0: no mode.
    None,
    /// 1: manual; the pendant controls the arm.
    Manual,
    /// 2: auto, not running.
    Auto,
    /// 3: stop.
    Stop,
    /// 7: the program runs. The controller accepts instructions while the program is in its wait step.
    Running,
    /// 8: single step.
    SingleStep,
    /// 9: single cycle.
    SingleCycle,
    /// A number that is not in the manual.
    Unknown(i64),
}

impl OperationMode {
    /// The mode with this number.
    #[must_use]
    pub fn of_number(number: i64) -> Self {
        match number {
            0 => Self::None,
            1 => Self::Manual,
            2 => Self::Auto,
            3 => Self::Stop,
            7 => Self::Running,
            8 => Self::SingleStep,
            9 => Self::SingleCycle,
            unknown => Self::Unknown(unknown),
        }
    }

    /// Its number on the wire.
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
            Self::Unknown(number) => number,
        }
    }

    /// Whether a program can be running in this mode. This is also true for an unknown mode, because other
    /// values then decide.
    #[must_use]
    pub fn may_run(self) -> bool {
        match self {
            Self::Running | Self::SingleStep | Self::SingleCycle | Self::Unknown(_) => true,
            Self::None | Self::Manual | Self::Auto | Self::Stop => false,
        }
    }
}

impl fmt::Display for OperationMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::None => "none",
            Self::Manual => "manual",
            Self::Auto => "auto",
            Self::Stop => "stop",
            Self::Running => "running",
            Self::SingleStep => "single step",
            Self::SingleCycle => "single cycle",
            Self::Unknown(_) => "unknown",
        };
        write!(f, "{name} ({})", self.number())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_comes_back() {
        for number in -1..=12 {
            assert_eq!(OperationMode::of_number(number).number(), number);
        }
        assert_eq!(OperationMode::of_number(7).to_string(), "running (7)");
        assert_eq!(OperationMode::of_number(4).to_string(), "unknown (4)");
    }
}
