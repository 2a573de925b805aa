//! The identity that a controller reports, and the state found on a connection after a reconnect.

use std::fmt;

use r6_proto::address::Address;
use r6_proto::{OperationMode, printable};

use crate::query::result::QueryResult;

/// The values that distinguish controllers. There is no serial number on the wire.
pub(crate) const IDENTITY: [Address; 3] = [Address::Version, Address::MachineName, Address::AxisNum];

/// How many characters of a text an error shows; names on pendants are shorter.
const TOLD_CHARS: usize = 64;

/// Whether a query of these reads the whole identity.
pub(crate) fn asks_who_is_there(addresses: &[Address]) -> bool {
    IDENTITY.iter().all(|address| addresses.contains(address))
}

/// What a controller reports about itself. `None` if it has no such value.
///
/// Two controllers with the same model, firmware and name cannot be distinguished: give each machine its own
/// name on its pendant.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// `version`.
    pub firmware: Option<String>,
    /// `machineName`.
    pub machine_name: Option<String>,
    /// `axisNum`.
    pub axis_count: Option<i64>,
}

/// What was found after a reconnect, before anything else was sent, except a stop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// The robot that answered. If a part of it could not be read and the rest is as before, it may be
    /// another robot. Then no command is sent until a query has read all of it, such as
    /// [`crate::Robot::status`].
    pub identity: Identity,
    /// Whether it is a controller other than before: then no command is sent until
    /// [`crate::Robot::accept_identity`].
    pub another: bool,
    /// `curMode`.
    pub mode: Option<OperationMode>,
    /// `curAlarm`: 0 for none.
    pub alarm: Option<i64>,
    /// `RemoteCmdLen`: instructions left in the list. The client never resumes them.
    pub list_length: Option<i64>,
}

impl Identity {
    /// Whether `other` has the same value for every value that was read here.
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
