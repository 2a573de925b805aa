//! Points of instructions, by their names on the pendant: `Y010` for an output, `X010` for a wait.

use std::fmt;

use super::{BoardOutput, OutputBoard, OutputKind, WaitSource};
use crate::io_point::{IoPoint, PairMask, PointKind};

/// How many points each of the two masks of action 204 has.
const HALF: u8 = 16;

/// The last board of inputs that a wait can watch (`type` 0 to 4).
const LAST_INPUT_BOARD: u8 = 4;

/// The last board of M points that a wait can watch (`type` 5 to 7).
const LAST_M_BOARD: u8 = 2;

/// The last board that action 204 sets.
const LAST_OUTPUT_BOARD: u8 = 1;

/// Why an instruction cannot use a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrongPoint {
    /// An input cannot be set.
    IsInput(IoPoint),
    /// A wait cannot watch an output.
    IsOutput(IoPoint),
    /// Only an input X of the first board can stop a move.
    StopsNoMove(IoPoint),
    /// Only outputs Y have pulses.
    HasNoPulse(IoPoint),
    /// The instruction does not reach this board.
    BeyondBoard {
        /// The point.
        point: IoPoint,
        /// The last board that it reaches, from 0.
        last: u8,
    },
    /// All points must be on one board.
    OnAnotherBoard(IoPoint),
    /// Action 204 cannot set this point: it is an EU point, or it is not on the first two boards.
    NotTogether(IoPoint),
    /// A point is named twice.
    Twice(IoPoint),
    /// No point was named.
    None,
}

impl WrongPoint {
    /// What a valid point is. The text completes a sentence after "has to be".
    #[must_use]
    pub const fn wanted(self) -> &'static str {
        match self {
            Self::IsInput(_) => "an output: Y, M or EUY",
            Self::IsOutput(_) => "an input X or EUX, or an M point",
            Self::StopsNoMove(_) => "an input of the first board, X010 to X047",
            Self::HasNoPulse(_) => "an output Y of the first board, Y010 to Y047",
            Self::BeyondBoard { .. } => "on a board that the instruction reaches",
            Self::OnAnotherBoard(_) | Self::Twice(_) => "different points of one board",
            Self::NotTogether(_) => "points of a board of Y or M",
            Self::None => "one point at least",
        }
    }
}

impl fmt::Display for WrongPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::IsInput(point) => write!(f, "{point} is an input: outputs are Y, M and EUY"),
            Self::IsOutput(point) => write!(f, "{point} is an output: a wait is for X, M or EUX"),
            Self::StopsNoMove(point) => write!(f, "{point} cannot stop a move: X010 to X047 can"),
            Self::HasNoPulse(point) => {
                write!(f, "only outputs Y of the first board have pulses, not {point}")
            }
            Self::BeyondBoard { point, last: 0 } => {
                write!(f, "a motion sets points of the first board, not {point}: use a command for it")
            }
            Self::BeyondBoard { point, last } => {
                write!(f, "{point} is on board {}, but has to be on board 0 to {last}", point.board)
            }
            Self::OnAnotherBoard(point) => write!(f, "all points have to be of one board: {point} is not"),
            Self::NotTogether(point) => {
                write!(f, "a motion sets boards of Y and M, the first two of each, not {point}")
            }
            Self::Twice(point) => write!(f, "{point} is named twice"),
            Self::None => f.write_str("no point was named"),
        }
    }
}

impl std::error::Error for WrongPoint {}

impl OutputKind {
    /// The kind and number of an output for action 200, which reaches only the first board.
    ///
    /// # Errors
    /// [`WrongPoint`] for an input, and for a point of another board.
    pub fn of(point: IoPoint) -> Result<(Self, u8), WrongPoint> {
        let kind = match point.kind {
            PointKind::Y => Self::Y,
            PointKind::M => Self::M,
            PointKind::Euy => Self::Euy,
            PointKind::X | PointKind::Eux => return Err(WrongPoint::IsInput(point)),
        };
        if point.board != 0 {
            return Err(WrongPoint::BeyondBoard { point, last: 0 });
        }
        Ok((kind, point.point))
    }
}

impl WaitSource {
    /// The source of a wait for this point (action 100): X on boards 0 to 4, M on boards 0 to 2, EUX.
    ///
    /// # Errors
    /// [`WrongPoint`] for an output, and for a point of a further board.
    pub fn of(point: IoPoint) -> Result<Self, WrongPoint> {
        let within = |last: u8| match point.board <= last {
            true => Ok(()),
            false => Err(WrongPoint::BeyondBoard { point, last }),
        };
        let IoPoint { kind, board, point: number } = point;
        match kind {
            PointKind::X => within(LAST_INPUT_BOARD).map(|()| Self::Input { board, point: number }),
            PointKind::M => within(LAST_M_BOARD).map(|()| Self::M { board, point: number }),
            PointKind::Eux => Ok(Self::Eu { point: number }),
            PointKind::Y | PointKind::Euy => Err(WrongPoint::IsOutput(point)),
        }
    }

    /// The point that the wait watches; `None` for a time.
    #[must_use]
    pub fn point(self) -> Option<IoPoint> {
        let (kind, board, point) = match self {
            Self::Input { board, point } => (PointKind::X, board, point),
            Self::M { board, point } => (PointKind::M, board, point),
            Self::Eu { point } => (PointKind::Eux, 0, point),
            Self::Time => return None,
        };
        Some(IoPoint { kind, board, point })
    }
}

impl BoardOutput {
    /// Several outputs of one board, each with its state (action 204): Y or M, the first two boards of each.
    ///
    /// # Errors
    /// [`WrongPoint`] for points that it cannot set, for points on two boards, for a repeated point,
    /// and for an empty list.
    pub fn of(points: impl IntoIterator<Item = (IoPoint, bool)>) -> Result<Self, WrongPoint> {
        let mut found: Option<Self> = None;
        let mut seen = 0_u32;
        for (point, on) in points {
            let board = match point.kind {
                PointKind::Y | PointKind::M if point.board > LAST_OUTPUT_BOARD => {
                    return Err(WrongPoint::NotTogether(point));
                }
                PointKind::Y => OutputBoard::Y(point.board),
                PointKind::M => OutputBoard::M(point.board),
                PointKind::X | PointKind::Eux => return Err(WrongPoint::IsInput(point)),
                PointKind::Euy => return Err(WrongPoint::NotTogether(point)),
            };
            let none = PairMask::default();
            let output = found.get_or_insert(Self { board, low: none, high: none });
            if output.board != board {
                return Err(WrongPoint::OnAnotherBoard(point));
            }
            let bit = 1_u32.checked_shl(u32::from(point.point)).unwrap_or(0);
            if seen & bit != 0 {
                return Err(WrongPoint::Twice(point));
            }
            seen |= bit;
            match point.point.checked_sub(HALF) {
                None => output.low = output.low.with(point.point, on),
                Some(number) => output.high = output.high.with(number, on),
            }
        }
        found.ok_or(WrongPoint::None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(name: &str) -> IoPoint {
        name.parse().unwrap()
    }

    #[test]
    fn outputs_are_of_the_first_board() {
        assert_eq!(OutputKind::of(point("Y012")), Ok((OutputKind::Y, 2)));
        assert_eq!(OutputKind::of(point("EUY047")), Ok((OutputKind::Euy, 31)));
        assert_eq!(OutputKind::of(point("X010")), Err(WrongPoint::IsInput(point("X010"))));
        let beyond = OutputKind::of(point("M1.010")).unwrap_err();
        assert_eq!(
            beyond.to_string(),
            "a motion sets points of the first board, not M1.010: use a command for it"
        );
    }

    #[test]
    fn a_wait_and_its_point_are_the_same() {
        for name in ["X010", "X4.047", "M2.011", "EUX010"] {
            assert_eq!(WaitSource::of(point(name)).unwrap().point(), Some(point(name)));
        }
        assert_eq!(
            WaitSource::of(point("X5.010")).unwrap_err().to_string(),
            "X5.010 is on board 5, but has to be on board 0 to 4"
        );
        assert_eq!(
            WaitSource::of(point("M3.010")).unwrap_err(),
            WrongPoint::BeyondBoard { point: point("M3.010"), last: 2 }
        );
        assert_eq!(WaitSource::of(point("Y010")).unwrap_err(), WrongPoint::IsOutput(point("Y010")));
        assert_eq!(WaitSource::Time.point(), None);
    }

    #[test]
    fn points_of_one_board_are_set_together() {
        let points = [("Y010", true), ("Y012", false), ("Y047", true)].map(|(name, on)| (point(name), on));
        let output = BoardOutput::of(points).unwrap();
        assert_eq!(
            (output.board, output.low.bits(), output.high.bits()),
            (OutputBoard::Y(0), 0b01_00_10, 0b10 << 30)
        );
        for (names, wrong) in [
            (&["Y010", "Y1.010"][..], WrongPoint::OnAnotherBoard(point("Y1.010"))),
            (&["Y010", "M010"], WrongPoint::OnAnotherBoard(point("M010"))),
            (&["Y2.010"], WrongPoint::NotTogether(point("Y2.010"))),
            (&["EUY010"], WrongPoint::NotTogether(point("EUY010"))),
            (&["Y010", "Y010"], WrongPoint::Twice(point("Y010"))),
            (&["X010"], WrongPoint::IsInput(point("X010"))),
            (&[], WrongPoint::None),
        ] {
            assert_eq!(
                BoardOutput::of(names.iter().map(|name| (point(name), true))),
                Err(wrong),
                "{names:?}"
            );
        }
    }
}
