//! Query addresses: the name of every readable value, in one table.
//!
//! The 22 addresses of manual 4.1.1 come first, in its order; the later ones follow.

use std::fmt;

use crate::axis::AxisIndex;
use crate::printable::printable;
use crate::spelling;

mod item;
mod known;

/// Which network port of the cabinet a thing exists on (manual 4.1.1, 4.2.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ports {
    /// On the mainboard's port and on the hand panel's.
    Both,
    /// Only on the mainboard's port.
    Mainboard,
    /// Only on the hand panel's (pendant's) port.
    Pendant,
}

impl Ports {
    /// Whether the given port has it.
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

/// What a value is, whatever the wire quotes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueType {
    /// Text.
    Text,
    /// A whole number.
    Integer,
    /// A decimal number, six decimals as captured.
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
    /// What the value is.
    pub value: ValueType,
    /// The unit, empty where there is none.
    pub unit: &'static str,
    /// What it tells.
    pub meaning: &'static str,
    /// Which port has it.
    pub ports: Ports,
    /// The first manual or firmware that knows it.
    pub since: &'static str,
    /// Where it is written: the number in the manual's table 4.1.1, or the evidence for a later one.
    pub source: &'static str,
}

/// Input and output words: one board has 32 points, and boards 0 to 7 can be named in a command.
const LAST_WORD: u32 = 7;
/// Counter ids are not bounded by the manual; nine digits are more than any pendant shows.
const LAST_COUNTER: u32 = 999_999_999;

/// Every address, in the manual's order, then the later ones.
pub const ADDRESSES: [AddressInfo; 26] = {
    use Ports::{Both, Mainboard, Pendant};
    use ValueType::{Counter, Decimal, Flag, Integer, Text, TextList, Word};
    const AXIS: Option<(u32, u32)> = Some((0, 7));
    const WORD: Option<(u32, u32)> = Some((0, LAST_WORD));
    #[rustfmt::skip]
    #[expect(clippy::too_many_arguments, reason = "a row of a table")]
    const fn row(
        name: &'static str, indices: Option<(u32, u32)>, value: ValueType, unit: &'static str,
        meaning: &'static str, ports: Ports, since: &'static str, source: &'static str,
    ) -> AddressInfo {
        AddressInfo { name, indices, value, unit, meaning, ports, since, source }
    }
    #[rustfmt::skip]
    let table = [
        row("version", None, Text, "", "firmware version", Both, "V6.0", "4.1.1 #1"),
        row("curMold", None, Text, "", "name of the program (mold) in use", Pendant, "V6.0", "4.1.1 #2"),
        row("counterList", None, TextList, "", "ids of the counters", Both, "V6.0", "4.1.1 #3"),
        row("counter-n", Some((0, LAST_COUNTER)), Counter, "", "one counter: id, target, current", Both, "V6.0", "4.1.1 #4"),
        row("curMode", None, Integer, "", "operation mode: 0 none, 1 manual, 2 auto, 3 stop, 7 running, 8 single step, 9 single cycle", Both, "V6.0", "4.1.1 #5"),
        row("boardIOnum", None, Integer, "", "number of IO boards", Both, "V6.0", "4.1.1 #6"),
        row("input-n", WORD, Word, "", "inputs 32n+1 to 32n+32", Both, "V6.0", "4.1.1 #7"),
        row("output-n", WORD, Word, "", "outputs 32n+1 to 32n+32", Both, "V6.0", "4.1.1 #8"),
        row("axisNum", None, Integer, "", "number of axes", Both, "V6.0", "4.1.1 #9"),
        row("axis-n", AXIS, Decimal, "deg", "position of axis n (mm on a linear axis)", Both, "V6.0", "4.1.1 #10"),
        row("world-n", AXIS, Decimal, "mm, deg", "pose: X, Y, Z in mm, U, V, W in degrees, M7, M8", Both, "V6.0", "4.1.1 #11"),
        row("curAlarm", None, Integer, "", "number of the present alarm, 0 for none", Both, "V6.0", "4.1.1 #12"),
        row("curCycle", None, Decimal, "s", "time of the present cycle", Both, "V6.0", "4.1.1 #13"),
        row("lastCycle", None, Decimal, "s", "time of the last cycle", Both, "V6.0", "4.1.1 #14"),
        row("machineName", None, Text, "", "name of the machine", Both, "V6.0", "4.1.1 #15"),
        row("curTorque-n", AXIS, Integer, "1/2580 of rated", "torque of axis n; 2580 is the rated torque", Mainboard, "V6.0", "4.1.1 #16"),
        row("curSpeed-n", AXIS, Integer, "RPM", "motor speed of axis n", Mainboard, "V6.0", "4.1.1 #17"),
        row("curAccount", None, Text, "", "user logged in at the pendant", Pendant, "V6.0", "4.1.1 #18"),
        row("origin", None, Flag, "", "1 once the machine is homed", Both, "V6.0", "4.1.1 #19"),
        row("moldList", None, TextList, "", "names of the programs (molds)", Both, "V6.0", "4.1.1 #20"),
        row("isMoving", None, Flag, "", "1 while moving, 0 at rest", Both, "V6.0", "4.1.1 #21"),
        row("M-n", WORD, Word, "", "M points 32n+1 to 32n+32", Both, "V6.0", "4.1.1 #22"),
        row("Addr-n", Some((800, 900)), Integer, "", "register n, a whole number", Both, "206 master F1", "later manual; captured, unit C"),
        row("RemoteCmdLen", None, Integer, "", "instructions left in the instruction list", Both, "207beta25", "later manual; used by units A, B, C"),
        row("toolCoord", None, TextList, "", "tool, workbench and collaborative desk in use", Both, "207beta91", "later manual"),
        row("faxis-n", AXIS, Decimal, "deg", "undocumented; taken for the commanded position of axis n", Both, "unknown", "asked for by the maker's viewer"),
    ];
    table
};

/// Spellings that are accepted besides the table's: (spelling, the table's).
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

/// The name of one readable value (manual 4.1.1 and later manuals).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[expect(missing_docs, reason = "each variant is a row of ADDRESSES, which says what it is")]
pub enum Address {
    Version,
    CurMold,
    CounterList,
    Counter(u32),
    CurMode,
    BoardIoNum,
    Input(u8),
    Output(u8),
    AxisNum,
    Axis(AxisIndex),
    World(AxisIndex),
    CurAlarm,
    CurCycle,
    LastCycle,
    MachineName,
    CurTorque(AxisIndex),
    CurSpeed(AxisIndex),
    CurAccount,
    Origin,
    MoldList,
    IsMoving,
    M(u8),
    Addr(RegisterIndex),
    RemoteCmdLen,
    ToolCoord,
    Faxis(AxisIndex),
}

impl Address {
    /// The address with exactly this name, or `None`: no accepted misspellings, no leading zeros.
    #[must_use]
    pub fn exact(name: &[u8]) -> Option<Self> {
        if let Some(digits) = name.strip_prefix(b"axis-") {
            return axis(digits).map(Self::Axis);
        }
        if let Some(digits) = name.strip_prefix(b"world-") {
            return axis(digits).map(Self::World);
        }
        Some(match name {
            b"version" => Self::Version,
            b"curMold" => Self::CurMold,
            b"counterList" => Self::CounterList,
            b"curMode" => Self::CurMode,
            b"boardIOnum" => Self::BoardIoNum,
            b"axisNum" => Self::AxisNum,
            b"curAlarm" => Self::CurAlarm,
            b"curCycle" => Self::CurCycle,
            b"lastCycle" => Self::LastCycle,
            b"machineName" => Self::MachineName,
            b"curAccount" => Self::CurAccount,
            b"origin" => Self::Origin,
            b"moldList" => Self::MoldList,
            b"isMoving" => Self::IsMoving,
            b"RemoteCmdLen" => Self::RemoteCmdLen,
            b"toolCoord" => Self::ToolCoord,
            _ => return Self::exact_indexed(name),
        })
    }

    fn exact_indexed(name: &[u8]) -> Option<Self> {
        if let Some(digits) = name.strip_prefix(b"counter-") {
            return index(digits, LAST_COUNTER).map(Self::Counter);
        }
        let dash = name.iter().position(|byte| *byte == b'-')?;
        let (stem, digits) = (name.get(..dash)?, name.get(dash + 1..)?);
        Some(match stem {
            b"input" => Self::Input(word(digits)?),
            b"output" => Self::Output(word(digits)?),
            b"M" => Self::M(word(digits)?),
            b"curTorque" => Self::CurTorque(axis(digits)?),
            b"curSpeed" => Self::CurSpeed(axis(digits)?),
            b"faxis" => Self::Faxis(axis(digits)?),
            b"Addr" => Self::Addr(RegisterIndex::new(u16::try_from(index(digits, 900)?).ok()?)?),
            _ => return None,
        })
    }

    /// The address whose name stands from `start` to `end`, as [`Self::exact`] has it.
    #[inline]
    pub(crate) fn exact_at(bytes: &[u8], start: usize, end: usize) -> Option<Self> {
        known::address(bytes, start, end).or_else(|| Self::exact(bytes.get(start..end)?))
    }

    /// The address a peer meant by this name: exact, or one of [`ACCEPTED_SPELLINGS`].
    ///
    /// # Errors
    /// [`UnknownAddress`] with the nearest name of the table, or the index that is out of range.
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

    /// The number of the row.
    #[inline]
    fn row(self) -> usize {
        // The variants stand in the table's order; `every_variant_has_its_own_row` checks it.
        match self {
            Self::Version => 0,
            Self::CurMold => 1,
            Self::CounterList => 2,
            Self::Counter(_) => 3,
            Self::CurMode => 4,
            Self::BoardIoNum => 5,
            Self::Input(_) => 6,
            Self::Output(_) => 7,
            Self::AxisNum => 8,
            Self::Axis(_) => 9,
            Self::World(_) => 10,
            Self::CurAlarm => 11,
            Self::CurCycle => 12,
            Self::LastCycle => 13,
            Self::MachineName => 14,
            Self::CurTorque(_) => 15,
            Self::CurSpeed(_) => 16,
            Self::CurAccount => 17,
            Self::Origin => 18,
            Self::MoldList => 19,
            Self::IsMoving => 20,
            Self::M(_) => 21,
            Self::Addr(_) => 22,
            Self::RemoteCmdLen => 23,
            Self::ToolCoord => 24,
            Self::Faxis(_) => 25,
        }
    }

    /// The index of an indexed address.
    #[must_use]
    pub fn index(self) -> Option<u32> {
        match self {
            Self::Counter(id) => Some(id),
            Self::Input(n) | Self::Output(n) | Self::M(n) => Some(u32::from(n)),
            Self::Axis(axis)
            | Self::World(axis)
            | Self::CurTorque(axis)
            | Self::CurSpeed(axis)
            | Self::Faxis(axis) => Some(u32::from(axis.number())),
            Self::Addr(register) => Some(u32::from(register.number())),
            Self::Version
            | Self::CurMold
            | Self::CounterList
            | Self::CurMode
            | Self::BoardIoNum
            | Self::AxisNum
            | Self::CurAlarm
            | Self::CurCycle
            | Self::LastCycle
            | Self::MachineName
            | Self::CurAccount
            | Self::Origin
            | Self::MoldList
            | Self::IsMoving
            | Self::RemoteCmdLen
            | Self::ToolCoord => None,
        }
    }

    /// The name without its index, up to and with the dash.
    fn stem(self) -> &'static [u8] {
        let name = self.info().name.as_bytes();
        match self.index() {
            None => name,
            Some(_) => name.strip_suffix(b"n").unwrap_or(name),
        }
    }

    /// Appends the name as it stands on the wire.
    pub fn write_name(self, out: &mut Vec<u8>) {
        out.extend_from_slice(self.stem());
        match self.index() {
            None => {}
            Some(index @ 0..=9) => out.push(b'0' + u8::try_from(index).unwrap_or(0)),
            Some(index) => crate::encode::write_integer(out, i64::from(index)),
        }
    }

    /// How long the name is that [`Self::write_name`] appends, bytes.
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

/// Decimal digits without a leading zero, at most `last`.
fn index(digits: &[u8], last: u32) -> Option<u32> {
    let canonical = matches!(digits, [b'0'] | [b'1'..=b'9', ..]);
    // No index has more digits than a counter's nine, which 32 bits hold.
    if !canonical || digits.len() > 9 || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let value = digits.iter().fold(0, |value, digit| value * 10 + u32::from(digit - b'0'));
    (value <= last).then_some(value)
}

fn axis(digits: &[u8]) -> Option<AxisIndex> {
    match digits {
        [digit @ b'0'..=b'7'] => AxisIndex::new(digit - b'0'),
        _ => None,
    }
}

fn word(digits: &[u8]) -> Option<u8> {
    index(digits, LAST_WORD).and_then(|value| u8::try_from(value).ok())
}

/// A name that is no query address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownAddress {
    /// The name, cut at 64 characters.
    pub name: String,
}

impl UnknownAddress {
    fn of(name: &str) -> Self {
        Self { name: name.chars().take(64).collect() }
    }

    /// The row of the table that comes nearest. It is looked for when it is asked for: a hostile peer can send
    /// thousands of unknown names in one frame.
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
            Address::Counter(LAST_COUNTER),
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
    }
}
