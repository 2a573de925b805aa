//! The names of input and output points, and the two-bit masks of action 204.

use std::fmt;
use std::str::FromStr;

use crate::printable::printable;

/// How many boards an address can name (`input-0` … `input-7`).
const BOARDS: u8 = 8;

/// How many characters of a wrong name an error message quotes.
const LONGEST_QUOTED: usize = 40;

/// The kind of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointKind {
    /// Input, `X`.
    X,
    /// Output, `Y`.
    Y,
    /// Internal point, `M`.
    M,
    /// Input of the EU board, `EUX`.
    Eux,
    /// Output of the EU board, `EUY`.
    Euy,
}

impl PointKind {
    /// The letters at the beginning of its names.
    #[must_use]
    pub fn letters(self) -> &'static str {
        match self {
            Self::X => "X",
            Self::Y => "Y",
            Self::M => "M",
            Self::Eux => "EUX",
            Self::Euy => "EUY",
        }
    }
}

/// One point of one board. It is written as its kind and octal(point + 8): `X010` to `X047`.
///
/// Points of further boards have the board before the number: `Y1.010`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IoPoint {
    /// Its kind.
    pub kind: PointKind,
    /// Its board, from 0.
    pub board: u8,
    /// Its number on the board, 0 to 31.
    pub point: u8,
}

impl IoPoint {
    /// The point for the numbers in `modifyOutput`: boards 0 to 3 are Y, 4 to 6 M, 7 EUY (manual 4.2.1 #8).
    /// `None` for another board or point.
    #[must_use]
    pub const fn of_command(board: u8, point: u8) -> Option<Self> {
        let (kind, board) = match board {
            0..=3 => (PointKind::Y, board),
            4..=6 => (PointKind::M, board - 4),
            7 => (PointKind::Euy, 0),
            _ => return None,
        };
        if point > 31 { None } else { Some(Self { kind, board, point }) }
    }

    /// The board and point numbers in `modifyOutput` for this point. `None` for an input, and for a board
    /// that the command does not reach.
    #[must_use]
    pub const fn for_command(self) -> Option<(u8, u8)> {
        match (self.kind, self.board) {
            (PointKind::Y, 0..=3) => Some((self.board, self.point)),
            (PointKind::M, 0..=2) => Some((self.board + 4, self.point)),
            (PointKind::Euy, 0) => Some((7, self.point)),
            _ => None,
        }
    }
}

impl fmt::Display for IoPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind.letters())?;
        if self.board > 0 {
            write!(f, "{}.", self.board)?;
        }
        write!(f, "{:03o}", u16::from(self.point) + 8)
    }
}

/// A text that is not the name of a point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadPoint {
    text: String,
}

impl fmt::Display for BadPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = printable(&self.text);
        write!(
            f,
            "`{text}` names no point: the first one is X010, then X011 … X017, X020 … X047 (octal), on board 1 X1.010; \
             the letters are X, Y, M, EUX and EUY"
        )
    }
}

impl std::error::Error for BadPoint {}

impl FromStr for IoPoint {
    type Err = BadPoint;

    /// Reads a name as it is written, in upper or lower case. Boards 0 to 7; the EU board has no number.
    fn from_str(text: &str) -> Result<Self, BadPoint> {
        read(text).ok_or_else(|| BadPoint { text: text.chars().take(LONGEST_QUOTED).collect() })
    }
}

fn read(text: &str) -> Option<IoPoint> {
    let upper = text.to_ascii_uppercase();
    // The order does not matter, because the letters of no kind begin with those of another.
    let kinds = [PointKind::Eux, PointKind::Euy, PointKind::X, PointKind::Y, PointKind::M];
    let (kind, rest) =
        kinds.into_iter().find_map(|kind| Some((kind, upper.strip_prefix(kind.letters())?)))?;
    let (board, digits) = rest.split_once('.').unwrap_or(("0", rest));
    let eu = matches!(kind, PointKind::Eux | PointKind::Euy);
    let board = digit(board)?.parse::<u8>().ok().filter(|board| *board < if eu { 1 } else { BOARDS })?;
    let number = u8::from_str_radix(digit(digits).filter(|digits| digits.len() == 3)?, 8).ok()?;
    let point = number.checked_sub(8).filter(|point| *point < 32)?;
    Some(IoPoint { kind, board, point })
}

/// Returns the text if it consists of digits only, without a sign.
fn digit(text: &str) -> Option<&str> {
    text.bytes().all(|byte| byte.is_ascii_digit()).then_some(text)
}

/// Two bits for each of 16 points, with the lowest bits for the lowest point: 01 off, 10 on, 00 unchanged
/// (action 204).
///
/// No manual gives the fourth pair, 11, a meaning. A point with 11 is left unchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PairMask(u32);

impl PairMask {
    /// The mask with exactly these bits.
    #[must_use]
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// The bits.
    #[must_use]
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// The mask that also sets this point, 0 to 15. A higher point changes nothing.
    #[must_use]
    pub const fn with(self, point: u8, on: bool) -> Self {
        if point > 15 {
            return self;
        }
        let shift = 2 * point as u32;
        let pair: u32 = if on { 0b10 } else { 0b01 };
        Self(self.0 & !(0b11 << shift) | pair << shift)
    }

    /// The points that are set, with their state, lowest first.
    pub fn points(self) -> impl Iterator<Item = (u8, bool)> {
        (0..16_u8).filter_map(move |point| match self.0 >> (2 * u32::from(point)) & 0b11 {
            0b01 => Some((point, false)),
            0b10 => Some((point, true)),
            _ => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::address::Address;

    fn name(kind: PointKind, point: u8) -> String {
        IoPoint { kind, board: 0, point }.to_string()
    }

    fn names(mask: u32, first: u8, wanted: bool) -> Vec<String> {
        let points = PairMask::from_bits(mask).points();
        points.filter(|(_, on)| *on == wanted).map(|(point, _)| name(PointKind::Y, point + first)).collect()
    }

    #[test]
    fn names_are_octal_from_010() {
        assert_eq!(name(PointKind::M, 0), "M010");
        assert_eq!(name(PointKind::M, 1), "M011");
        assert_eq!(name(PointKind::X, 8), "X020");
        assert_eq!(name(PointKind::Euy, 31), "EUY047");
        assert_eq!(IoPoint { kind: PointKind::Y, board: 1, point: 0 }.to_string(), "Y1.010");
    }

    #[test]
    fn a_command_and_the_name_of_its_point_are_the_same() {
        for (board, point) in (0..=7).flat_map(|board| (0..32).map(move |point| (board, point))) {
            let named = IoPoint::of_command(board, point).unwrap();
            assert_eq!(named.for_command(), Some((board, point)), "{named}");
        }
        let named = |text: &str| text.parse::<IoPoint>().unwrap();
        assert_eq!(IoPoint::of_command(5, 1), Some(named("M1.011")));
        assert_eq!((IoPoint::of_command(8, 0), IoPoint::of_command(0, 32)), (None, None));
        for name in ["X010", "EUX010", "Y4.010", "M3.010"] {
            assert_eq!(named(name).for_command(), None, "{name}");
        }
        assert_eq!(named("M1.011").address(), Some(Address::M(1)));
        assert_eq!(named("EUX010").address(), None);
    }

    #[test]
    fn every_name_is_read_back() {
        for kind in [PointKind::X, PointKind::Y, PointKind::M, PointKind::Eux, PointKind::Euy] {
            let boards = if matches!(kind, PointKind::Eux | PointKind::Euy) { 1 } else { BOARDS };
            for (board, point) in (0..boards).flat_map(|board| (0..32).map(move |point| (board, point))) {
                let named = IoPoint { kind, board, point };
                assert_eq!(named.to_string().parse(), Ok(named));
                assert_eq!(named.to_string().to_lowercase().parse(), Ok(named));
            }
        }
        assert_eq!("X0.010".parse(), Ok(IoPoint { kind: PointKind::X, board: 0, point: 0 }));
    }

    #[test]
    fn what_names_no_point_is_quoted_with_the_names_there_are() {
        for wrong in [
            "", "X", "X10", "X007", "X050", "X018", "Z010", "X8.010", "X+1.010", "X+10", "EUX1.010", "X.010",
            "010",
        ] {
            let error = wrong.parse::<IoPoint>().unwrap_err().to_string();
            assert!(error.contains(&format!("`{wrong}`")) && error.contains("X047"), "{error}");
        }
        assert!("X".repeat(9_999).parse::<IoPoint>().unwrap_err().to_string().len() < 300);
    }

    #[test]
    fn the_later_manuals_examples_of_204_check_out() {
        assert_eq!(names(151_388_258, 0, true), ["Y010", "Y012", "Y020", "Y025"]);
        assert_eq!(names(151_388_258, 0, false), ["Y013", "Y021", "Y024"]);
        assert_eq!(names(393_222, 16, true), ["Y030", "Y040"]);
        assert_eq!(names(393_222, 16, false), ["Y031", "Y041"]);
        assert_eq!(names(10, 0, true), ["Y010", "Y011"]);
    }

    #[test]
    fn a_mask_is_built_point_by_point() {
        let on = [0, 2, 8, 13].into_iter().fold(PairMask::default(), |mask, point| mask.with(point, true));
        let mask = [3, 9, 12].into_iter().fold(on, |mask, point| mask.with(point, false));
        assert_eq!(mask.bits(), 151_388_258);
        assert_eq!(mask.with(16, true), mask);
        assert_eq!(PairMask::from_bits(0b11).points().count(), 0);
    }
}
