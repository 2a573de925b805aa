//! Query addresses: the name of every readable value, in one table.
//!
//! The 22 addresses of manual 4.1.1 come first, in its order; the later ones follow.

use std::fmt;

use crate::io_point::{IoPoint, PointKind};
use crate::printable::printable;
use crate::spelling;

mod item;
mod map;
mod table;

pub use map::{AddressMap, Walk};
pub use table::{ADDRESSES, Address};

/// Which network port of the cabinet offers a query address or a command (manual 4.1.1, 4.2.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ports {
    /// The mainboard's port and the hand panel's port.
    Both,
    /// Only the mainboard's port.
    Mainboard,
    /// Only the hand panel's (pendant's) port.
    Pendant,
}

impl Ports {
    /// Whether `port` offers it.
    #[must_use]
    pub fn has(self, port: Port) -> bool {
        match self {
            Self::Both => true,
            Self::Mainboard => port == Port::Mainboard,
            Self::Pendant => port == Port::Pendant,
        }
    }
}

/// One of the two network ports of a cabinet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Port {
    /// The port on the mainboard ("host").
    Mainboard,
    /// The port on the hand panel.
    Pendant,
}

/// The type of a value, whether or not the wire puts it in quotes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueType {
    /// Text.
    Text,
    /// A whole number.
    Integer,
    /// A decimal number; captured controllers send six decimals.
    Decimal,
    /// 32 points as the bits of one unsigned number; bit 0 is the first point.
    Word,
    /// 1 or 0.
    Flag,
    /// A list of texts.
    TextList,
    /// A counter: id, target, current.
    Counter,
}

impl fmt::Display for ValueType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Text => "text",
            Self::Integer => "integer",
            Self::Decimal => "decimal",
            Self::Word => "32-bit word",
            Self::Flag => "0 or 1",
            Self::TextList => "list of texts",
            Self::Counter => "counter (id, target, current)",
        })
    }
}

/// One row of the table of addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AddressInfo {
    /// The name as the manual writes it; `-n` stands for the index.
    pub name: &'static str,
    /// The lowest and highest index, or `None` for an address without one.
    pub indices: Option<(u32, u32)>,
    /// The type of the value.
    pub value: ValueType,
    /// The unit; empty if the value has no unit.
    pub unit: &'static str,
    /// What the value means.
    pub meaning: &'static str,
    /// Which port offers it.
    pub ports: Ports,
    /// The first manual or firmware that knows it.
    pub since: &'static str,
    /// The source: the number in the manual's table 4.1.1, or the evidence for a later address.
    pub source: &'static str,
}

impl AddressInfo {
    /// Whether the oldest manual (V6.0) lists the address, so that every firmware knows it.
    #[must_use]
    pub fn is_in_first_manual(&self) -> bool {
        self.source.starts_with("4.1.1 #")
    }
}

/// Spellings that are accepted besides those of the table: (accepted spelling, spelling in the table).
pub const ACCEPTED_SPELLINGS: [(&str, &str); 2] = [("boardIONum", "boardIOnum"), ("Version", "version")];

/// A register that the PC may read and write: 800 to 900.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RegisterIndex(u16);

impl RegisterIndex {
    /// The first register.
    pub const FIRST: u16 = 800;
    /// The last register.
    pub const LAST: u16 = 900;

    /// The register with this number; `None` outside 800–900.
    #[must_use]
    pub const fn new(number: u16) -> Option<Self> {
        if number >= Self::FIRST && number <= Self::LAST { Some(Self(number)) } else { None }
    }

    /// The number, 800 to 900.
    #[must_use]
    pub const fn number(self) -> u16 {
        self.0
    }
}

impl Address {
    /// Returns the address with exactly this name, or `None`. Misspellings and leading zeros are not
    /// accepted.
    #[must_use]
    pub fn exact(name: &[u8]) -> Option<Self> {
        let stem = name.iter().position(|byte| *byte == b'-').map_or(name.len(), |dash| dash + 1);
        let (stem, digits) = name.split_at_checked(stem)?;
        Self::of(stem, |(first, last)| index(digits, last).filter(|number| *number >= first))
    }

    /// Returns the address that a peer meant by this name: an exact name, or one of [`ACCEPTED_SPELLINGS`].
    ///
    /// # Errors
    /// [`UnknownAddress`] with the nearest name of the table, or with the index that is out of range.
    pub fn parse(name: &str) -> Result<Self, UnknownAddress> {
        let canonical =
            ACCEPTED_SPELLINGS.iter().find(|(spelling, _)| *spelling == name).map_or(name, |(_, name)| name);
        Self::exact(canonical.as_bytes()).ok_or_else(|| UnknownAddress::of(name))
    }

    /// The row of the table for this address.
    #[must_use]
    pub fn info(self) -> &'static AddressInfo {
        #[expect(clippy::indexing_slicing, reason = "a constant below the table's length in every arm")]
        &ADDRESSES[self.row()]
    }

    /// The name up to and including the dash, without its index.
    fn stem(self) -> &'static [u8] {
        let name = self.info().name.as_bytes();
        match self.index() {
            None => name,
            Some(_) => name.strip_suffix(b"n").unwrap_or(name),
        }
    }

    /// Appends the name as the wire spells it.
    pub fn write_name(self, out: &mut Vec<u8>) {
        out.extend_from_slice(self.stem());
        match self.index() {
            None => {}
            Some(index @ 0..=9) => out.push(b'0' + u8::try_from(index).unwrap_or(0)),
            Some(index) => crate::encode::write_integer(out, i64::from(index)),
        }
    }

    /// Length in bytes of the name that [`Self::write_name`] appends.
    #[must_use]
    pub fn name_len(self) -> usize {
        let digits =
            self.index().map_or(0, |index| index.checked_ilog10().map_or(1, |power| power as usize + 1));
        self.stem().len() + digits
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.info().name;
        match self.index() {
            None => f.write_str(name),
            Some(index) => write!(f, "{}{index}", name.strip_suffix('n').unwrap_or(name)),
        }
    }
}

impl std::str::FromStr for Address {
    type Err = UnknownAddress;

    fn from_str(name: &str) -> Result<Self, UnknownAddress> {
        Self::parse(name)
    }
}

/// Reads decimal digits without a leading zero; `None` above `last`.
fn index(digits: &[u8], last: u32) -> Option<u32> {
    let canonical = matches!(digits, [b'0'] | [b'1'..=b'9', ..]);
    // A counter id has at most nine digits, which fit in 32 bits. No other index has more.
    if !canonical || digits.len() > 9 || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let value = digits.iter().fold(0, |value, digit| value * 10 + u32::from(digit - b'0'));
    (value <= last).then_some(value)
}

impl IoPoint {
    /// The query address of the word that contains this point. `None` for EU points, which have no address.
    #[must_use]
    pub const fn address(self) -> Option<Address> {
        match self.kind {
            PointKind::X => Some(Address::Input(self.board)),
            PointKind::Y => Some(Address::Output(self.board)),
            PointKind::M => Some(Address::M(self.board)),
            PointKind::Eux | PointKind::Euy => None,
        }
    }
}

/// A name that is not a query address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownAddress {
    /// The name, cut at 64 characters.
    pub name: String,
}

impl UnknownAddress {
    fn of(name: &str) -> Self {
        Self { name: name.chars().take(64).collect() }
    }

    /// Finds the nearest row of the table. The search runs only when the caller asks for it, because a
    /// hostile peer can send thousands of unknown names in one frame.
    #[must_use]
    pub fn nearest(&self) -> Option<&'static AddressInfo> {
        let stem = self.name.trim_end_matches(|c: char| c.is_ascii_digit());
        let wanted = if stem.len() < self.name.len() { format!("{stem}n") } else { self.name.clone() };
        let nearest = |word: &str| spelling::nearest(word, ADDRESSES.iter().map(|row| row.name));
        let name = nearest(&wanted).or_else(|| nearest(stem.trim_end_matches('-')))?;
        ADDRESSES.iter().find(|row| row.name == name)
    }
}

impl fmt::Display for UnknownAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is no query address", printable(&self.name))?;
        if let Ok(point) = self.name.parse::<IoPoint>() {
            return match point.address() {
                Some(word) => write!(f, " but a point: `{word}` has it, as bit {}", point.point),
                None => write!(f, " but a point of the EU board, which has none"),
            };
        }
        match self.nearest() {
            None => Ok(()),
            Some(row) => match row.indices {
                None => write!(f, "; nearest: `{}`", row.name),
                Some((first, last)) => write!(f, "; nearest: `{}` with n from {first} to {last}", row.name),
            },
        }
    }
}

impl std::error::Error for UnknownAddress {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::AxisIndex;

    #[test]
    fn a_name_is_as_long_as_it_is_told() {
        let axis = AxisIndex::new(7).unwrap();
        let register = RegisterIndex::new(850).unwrap();
        for address in [
            Address::Version,
            Address::Axis(axis),
            Address::Addr(register),
            Address::Counter(0),
            Address::Counter(9),
            Address::Counter(10),
            Address::Counter(999_999_999),
        ] {
            let mut name = Vec::new();
            address.write_name(&mut name);
            assert_eq!(
                (String::from_utf8(name.clone()).unwrap(), name.len()),
                (address.to_string(), address.name_len())
            );
        }
    }

    /// One address for every row: the row's name with its lowest index.
    fn first_of_each_row() -> Vec<(String, &'static AddressInfo)> {
        ADDRESSES
            .iter()
            .map(|row| {
                (
                    row.indices.map_or(row.name.to_owned(), |(first, _)| {
                        row.name.replace("-n", &format!("-{first}"))
                    }),
                    row,
                )
            })
            .collect()
    }

    #[test]
    fn every_variant_has_its_own_row() {
        for (name, row) in first_of_each_row() {
            let address = Address::parse(&name).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(address.info().name, row.name);
            assert_eq!(address.to_string(), name);
            let mut wire = Vec::new();
            address.write_name(&mut wire);
            assert_eq!(wire, name.as_bytes());
        }
    }

    #[test]
    fn the_last_index_is_known_and_the_next_is_not() {
        for row in ADDRESSES.iter() {
            let Some((_, last)) = row.indices else { continue };
            assert!(Address::parse(&row.name.replace("-n", &format!("-{last}"))).is_ok(), "{}", row.name);
            let beyond = Address::parse(&row.name.replace("-n", &format!("-{}", last + 1)));
            assert_eq!(beyond.unwrap_err().nearest().map(|near| near.name), Some(row.name));
        }
    }

    #[test]
    fn accepted_spellings_are_understood() {
        assert_eq!(Address::parse("boardIONum"), Ok(Address::BoardIoNum));
        assert_eq!(Address::parse("Version"), Ok(Address::Version));
        assert_eq!(Address::exact(b"Version"), None);
    }

    #[test]
    fn an_unknown_address_names_the_nearest() {
        let error = Address::parse("axis-9").unwrap_err();
        assert_eq!(error.to_string(), "`axis-9` is no query address; nearest: `axis-n` with n from 0 to 7");
        assert_eq!(Address::parse("curAlrm").unwrap_err().nearest().map(|row| row.name), Some("curAlarm"));
        assert_eq!(Address::parse("axis-01").unwrap_err().nearest().map(|row| row.name), Some("axis-n"));
        assert_eq!(Address::parse("qqqq").unwrap_err().nearest().map(|row| row.name), None);
        let told = |name: &str| Address::parse(name).unwrap_err().to_string();
        assert_eq!(told("Y012"), "`Y012` is no query address but a point: `output-0` has it, as bit 2");
        assert!(told("x1.010").ends_with("`input-1` has it, as bit 0"), "{}", told("x1.010"));
        assert!(told("EUY010").ends_with("a point of the EU board, which has none"), "{}", told("EUY010"));
    }
}
