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
    /// The modes of the manual, each with its number and its name.
    const TABLE: [(i64, Self, &'static str); 7] = [
        (0, Self::None, "none"),
        (1, Self::Manual, "manual"),
        (2, Self::Auto, "auto"),
        (3, Self::Stop, "stop"),
        (7, Self::Running, "running"),
        (8, Self::SingleStep, "single step"),
        (9, Self::SingleCycle, "single cycle"),
    ];

    /// The mode with this number.
    #[must_use]
    pub fn of_number(number: i64) -> Self {
        let row = Self::TABLE.iter().find(|(its, ..)| *its == number);
        row.map_or(Self::Unknown(number), |(_, mode, _)| *mode)
    }

    /// Its number on the wire, and its name.
    fn told(self) -> (i64, &'static str) {
        if let Self::Unknown(number) = self {
            return (number, "unknown");
        }
        let row = Self::TABLE.iter().find(|(_, mode, _)| *mode == self);
        row.map_or((0, "none"), |(number, _, name)| (*number, name))
    }

    /// Its number on the wire.
    #[must_use]
    pub fn number(self) -> i64 {
        self.told().0
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
        let (number, name) = self.told();
        write!(f, "{name} ({number})")
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
