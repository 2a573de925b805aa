//! The names of input and output points, and the two-bit masks of action 204.

use std::fmt;
use std::str::FromStr;

/// Which kind of point.
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
    /// Every kind, the longer names first.
    pub const ALL: [Self; 5] = [Self::Eux, Self::Euy, Self::X, Self::Y, Self::M];

    /// The letters before a point's number.
    #[must_use]
    pub const fn prefix(self) -> &'static str {
        match self {
            Self::X => "X",
            Self::Y => "Y",
            Self::M => "M",
            Self::Eux => "EUX",
            Self::Euy => "EUY",
        }
    }
}

/// One point of one board: written as its kind and octal(point + 8), `X010` to `X047`.
///
/// Points of further boards have the board in front: `Y1.010`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IoPoint {
    /// Its kind.
    pub kind: PointKind,
    /// Its board, from 0.
    pub board: u8,
    /// Its number on the board, 0 to 31.
    pub point: u8,
}

impl fmt::Display for IoPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind.prefix())?;
        if self.board > 0 {
            write!(f, "{}.", self.board)?;
        }
        write!(f, "{:03o}", u16::from(self.point) + 8)
    }
}

/// The text is no name of a point: it is the kind, a board with a full stop behind it unless it is board 0, and octal 010
/// to 047.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoPoint;

impl fmt::Display for NoPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("no point: a point is X, Y, M, EUX or EUY and octal 010 to 047, such as X010 or, on board 1, Y1.010")
    }
}

impl std::error::Error for NoPoint {}

impl FromStr for IoPoint {
    type Err = NoPoint;

    /// The point of this name, in upper or lower case; boards 0 to 7.
    fn from_str(name: &str) -> Result<Self, NoPoint> {
        let after = |kind: PointKind| {
            let head = name.get(..kind.prefix().len())?;
            head.eq_ignore_ascii_case(kind.prefix())
                .then(|| (kind, name.get(head.len()..).unwrap_or_default()))
        };
        let (kind, rest) = PointKind::ALL.into_iter().find_map(after).ok_or(NoPoint)?;
        let (board, number) = match rest.split_once('.') {
            Some((board, number)) => (board.parse().ok().filter(|board| *board < 8).ok_or(NoPoint)?, number),
            None => (0, rest),
        };
        if number.len() != 3 || !number.bytes().all(|digit| digit.is_ascii_digit()) {
            return Err(NoPoint);
        }
        let number = u8::from_str_radix(number, 8).map_err(|_| NoPoint)?;
        let point = number.checked_sub(8).filter(|point| *point < 32).ok_or(NoPoint)?;
        Ok(Self { kind, board, point })
    }
}

/// Two bits for each of 16 points, the lowest bits for the lowest point: 01 off, 10 on, 00 untouched (action 204).
///
/// The fourth pair, 11, has no meaning in any manual; such a point is left untouched.
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

    /// The mask that also sets this point, 0 to 15; a point beyond changes nothing.
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
    fn a_point_is_read_as_it_is_written() {
        for kind in PointKind::ALL {
            for (board, point) in [(0, 0), (0, 31), (1, 8), (7, 1)] {
                let point = IoPoint { kind, board, point };
                assert_eq!(point.to_string().parse(), Ok(point));
            }
        }
        assert_eq!("x010".parse(), Ok(IoPoint { kind: PointKind::X, board: 0, point: 0 }));
        for wrong in [
            "", "X", "X10", "X007", "X050", "X018", "Z010", "Y8.010", "Y-1.010", "Y.010", "X+10", "EU010",
            "ÄX010",
        ] {
            assert_eq!(wrong.parse::<IoPoint>(), Err(NoPoint), "{wrong}");
        }
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
