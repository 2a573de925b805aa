//! Registers 800 to 900: read in one go, written and read back.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use r6_client::{Accepted, NoReading, RequestError, Robot};
use r6_proto::message::Command;
use r6_proto::{Address, RegisterIndex};

use crate::command::register;
use crate::errors::{Exception, Raise};
use crate::record::numpy;

/// Why registers were not read, or not written as wanted.
pub enum RegisterError {
    Request(RequestError),
    /// A register has no value.
    NoReading(NoReading),
    /// The controller said ok, and has something else.
    NotTaken {
        register: u16,
        wrote: i64,
        found: Option<i64>,
    },
}

impl From<RequestError> for RegisterError {
    fn from(error: RequestError) -> Self {
        Self::Request(error)
    }
}

impl Raise for RegisterError {
    fn exception(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Request(error) => error.exception(py),
            Self::NoReading(error) => error.exception(py),
            Self::NotTaken { register, wrote, found } => {
                let has = found.map_or("no value".to_owned(), |found| found.to_string());
                let text = format!(
                    "register {register} was written with {wrote}, the controller said ok, and it has {has}: another \
                     program may write it too, or the controller does not take this value"
                );
                Exception::new(py, "NotTaken", &text)
                    .with("register", *register)
                    .with("wrote", *wrote)
                    .with("found", *found)
                    .build()
            }
        }
    }
}

/// The addresses of registers in a row.
pub fn addresses(first: u16, count: u16) -> PyResult<Vec<Address>> {
    if count == 0 {
        return Err(PyValueError::new_err("count has to be 1 or more"));
    }
    (0..count).map(|n| Ok(Address::Addr(register(first.saturating_add(n))?))).collect()
}

/// The values of registers.
pub async fn read(robot: &Robot, addresses: &[Address]) -> Result<Vec<i64>, RegisterError> {
    let result = robot.query(addresses).await?;
    let value = |address| match result.integer(address) {
        Some(value) => Ok(value),
        None => {
            let row = result.rows().iter().find(|(asked, _)| *asked == address);
            let why = row.and_then(|(_, value)| value.clone().err());
            Err(RegisterError::NoReading(why.unwrap_or(NoReading::Unsupported)))
        }
    };
    addresses.iter().map(|address| value(*address)).collect()
}

/// An int64 array.
pub fn to_array<'py>(py: Python<'py>, values: Vec<i64>) -> PyResult<Bound<'py, PyAny>> {
    numpy(py)?.getattr("array")?.call1((values, "int64"))
}

/// Values for registers in a row.
pub struct Write {
    first: RegisterIndex,
    values: Vec<i64>,
    savable: bool,
    /// The addresses to read back; none if that is not wanted.
    verify: Vec<Address>,
}

impl Write {
    /// Checks that the registers exist.
    pub fn new(first: u16, values: Vec<i64>, savable: bool, verify: bool) -> PyResult<Self> {
        let count = u16::try_from(values.len()).unwrap_or(u16::MAX);
        let addresses = addresses(first, count)?;
        let verify = if verify { addresses } else { Vec::new() };
        Ok(Self { first: register(first)?, values, savable, verify })
    }

    /// Writes them, and reads them back.
    pub async fn send(self, robot: &Robot) -> Result<Accepted, RegisterError> {
        let (first, savable) = (self.first, self.savable);
        let command = match *self.values.as_slice() {
            [value] => Command::RewriteData { register: first, value, savable },
            _ => Command::RewriteDataList { first, savable, values: self.values.clone() },
        };
        let accepted = robot.command(command).await?;
        if self.verify.is_empty() {
            return Ok(accepted);
        }
        let result = robot.query(&self.verify).await?;
        for (address, wrote) in self.verify.iter().zip(self.values) {
            let found = result.integer(*address);
            if found != Some(wrote) {
                let Address::Addr(register) = *address else { continue };
                return Err(RegisterError::NotTaken { register: register.number(), wrote, found });
            }
        }
        Ok(accepted)
    }
}
