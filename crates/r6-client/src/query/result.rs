//! The result of a query: the values of its addresses, and when each was requested.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use r6_proto::Reading;
use r6_proto::address::Address;
use r6_proto::error::FieldError;
use r6_proto::time::Instant;

/// Addresses with their values.
pub(crate) type Rows = Vec<(Address, Result<Reading, NoReading>)>;

/// The values of some addresses, each with its address.
///
/// Values that took several frames to read were not read at one instant. All came over one connection, so
/// they belong to one robot.
#[derive(Clone, Debug, PartialEq)]
pub struct QueryResult {
    /// The addresses asked for; each row contains its address again.
    pub(super) addresses: Arc<[Address]>,
    pub(crate) rows: Rows,
    pub(super) took: Duration,
    /// The connection over which all replies came.
    pub(super) connection: u64,
}

/// When the values of a query were requested: they are not older than this.
#[derive(Debug)]
pub(crate) enum AskedAt {
    /// All at the same time.
    Once(Instant),
    /// Each at its own time, in the order of the addresses.
    Each(Vec<Instant>),
}

impl AskedAt {
    /// The time of the value at this position.
    pub fn of(&self, position: usize) -> Option<Instant> {
        match self {
            Self::Once(at) => Some(*at),
            Self::Each(times) => times.get(position).copied(),
        }
    }

    /// When the first value was requested.
    pub fn oldest(&self) -> Instant {
        match self {
            Self::Once(at) => *at,
            Self::Each(times) => times.iter().copied().min().unwrap_or_default(),
        }
    }
}

/// Why an address has no value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoReading {
    /// The controller does not support the address, or has no such counter: it leaves the value out.
    Unsupported,
    /// The value is not valid for this address.
    Unreadable(FieldError),
}

impl fmt::Display for NoReading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsupported => f.write_str("the controller has no such value"),
            Self::Unreadable(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for NoReading {}

impl QueryResult {
    #[cfg(test)]
    pub(crate) fn for_tests(rows: Rows) -> Self {
        Self {
            addresses: rows.iter().map(|(address, _)| *address).collect(),
            rows,
            took: Duration::ZERO,
            connection: 0,
        }
    }

    /// The number of the connection over which all replies came.
    pub(crate) fn connection(&self) -> u64 {
        self.connection
    }

    /// Each address with its value, in the order of the request.
    pub fn rows(&self) -> &[(Address, Result<Reading, NoReading>)] {
        &self.rows
    }

    /// The value of an address, if it was requested and has one.
    #[must_use]
    pub fn reading(&self, address: Address) -> Option<&Reading> {
        self.rows.iter().find(|(asked, _)| *asked == address)?.1.as_ref().ok()
    }

    /// A whole number.
    #[must_use]
    pub fn integer(&self, address: Address) -> Option<i64> {
        if let Reading::Integer(number) = self.reading(address)? { Some(*number) } else { None }
    }

    /// How many instructions are left in the instruction list, if the query asked for `RemoteCmdLen`. `None`
    /// if the firmware does not report it (before 207beta25).
    ///
    /// # Errors
    /// A value came that cannot be read: the list may have instructions.
    pub fn left_in_list(&self) -> Result<Option<i64>, &FieldError> {
        let asked = self.rows.iter().find(|(address, _)| *address == Address::RemoteCmdLen);
        match asked {
            Some((_, Err(NoReading::Unreadable(error)))) => Err(error),
            Some((_, Err(NoReading::Unsupported) | Ok(_))) | None => Ok(self.integer(Address::RemoteCmdLen)),
        }
    }

    /// A decimal number, in the unit of its address.
    #[must_use]
    pub fn decimal(&self, address: Address) -> Option<f64> {
        if let Reading::Decimal(number) = self.reading(address)? { Some(*number) } else { None }
    }

    /// A flag.
    #[must_use]
    pub fn flag(&self, address: Address) -> Option<bool> {
        if let Reading::Flag(flag) = self.reading(address)? { Some(*flag) } else { None }
    }

    /// A text.
    #[must_use]
    pub fn text(&self, address: Address) -> Option<&str> {
        if let Reading::Text(text) = self.reading(address)? { Some(text) } else { None }
    }

    /// How long the slowest reply took.
    #[must_use]
    pub fn took(&self) -> Duration {
        self.took
    }
}
