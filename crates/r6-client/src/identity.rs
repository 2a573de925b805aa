//! Who a controller says that it is, and what was found on a connection that was made anew.

use std::fmt;

use r6_proto::address::Address;
use r6_proto::{OperationMode, printable};

use crate::query::result::QueryResult;

/// What tells one controller from another. There is no serial number on the wire.
pub(crate) const IDENTITY: [Address; 3] = [Address::Version, Address::MachineName, Address::AxisNum];

/// So many characters of a text are told in an error; names on pendants are shorter.
const TOLD_CHARS: usize = 64;

/// Whether a query of these tells who is there.
pub(crate) fn asks_who_is_there(addresses: &[Address]) -> bool {
    IDENTITY.iter().all(|address| addresses.contains(address))
}

/// What a controller says of itself. `None` where it has no such value.
///
/// Two controllers of one model, firmware and name cannot be told apart: give each machine a name of its own on its
/// pendant.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// `version`.
    pub firmware: Option<String>,
    /// `machineName`.
    pub machine_name: Option<String>,
    /// `axisNum`.
    pub axis_count: Option<i64>,
}

/// What was found on a connection that was made anew, before anything else was sent on it, a stop apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Who answered. If a part of it could not be read and the rest is the same as before, it is not known whether this is the same
    /// robot: no command leaves until a query has read all of it, such as [`crate::Robot::status`].
    pub identity: Identity,
    /// Whether that is another controller than before: then no command leaves until [`crate::Robot::accept_identity`].
    pub another: bool,
    /// `curMode`.
    pub mode: Option<OperationMode>,
    /// `curAlarm`: 0 for none.
    pub alarm: Option<i64>,
    /// `RemoteCmdLen`: instructions that are left in the list, which nobody resumes by himself.
    pub list_length: Option<i64>,
}

impl Identity {
    /// Whether every value that was read here is the same there.
    pub(crate) fn is_part_of(&self, other: &Self) -> bool {
        let same = |mine: &Option<String>, other: &Option<String>| mine.is_none() || mine == other;
        same(&self.firmware, &other.firmware)
            && same(&self.machine_name, &other.machine_name)
            && (self.axis_count.is_none() || self.axis_count == other.axis_count)
    }

    /// From a query that had all three values; `None` if one is missing.
    pub(crate) fn of(read: &QueryResult) -> Option<Self> {
        IDENTITY.iter().all(|address| read.reading(*address).is_some()).then(|| Self {
            firmware: read.text(Address::Version).map(str::to_owned),
            machine_name: read.text(Address::MachineName).map(str::to_owned),
            axis_count: read.integer(Address::AxisNum),
        })
    }
}

impl fmt::Display for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = |name: &str, value: &Option<String>| match value {
            Some(value) => {
                let value: String = value.chars().take(TOLD_CHARS).collect();
                write!(f, "{name} `{}`, ", printable(&value))
            }
            None => write!(f, "no {name}, "),
        };
        text("machineName", &self.machine_name)?;
        text("version", &self.firmware)?;
        match self.axis_count {
            Some(axes) => write!(f, "{axes} axes"),
            None => f.write_str("no axisNum"),
        }
    }
}
