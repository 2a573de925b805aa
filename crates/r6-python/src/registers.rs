//! Registers 800 to 900: read in one request, written and read back by the client.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use r6_client::{Keep, RegisterError, Robot};
use r6_proto::RegisterIndex;
use r6_proto::message::Command;

use crate::command::register;
use crate::raising::{Exception, Raise, raise};
use crate::record::numpy;

impl Raise for RegisterError {
    fn exception(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Request(error) => error.exception(py),
            Self::NoSuchRegisters { .. } => PyValueError::new_err(self.to_string()),
            Self::NotReadable { .. } => Exception::new(py, "NoReading", self).build(),
            Self::Differs { register, wrote, found } => {
                not_taken(py, self, *register, i64::from(*wrote), Some(*found))
            }
        }
    }
}

fn not_taken(
    py: Python<'_>,
    error: &RegisterError,
    register: RegisterIndex,
    wrote: i64,
    found: Option<i64>,
) -> PyErr {
    Exception::new(py, "NotTaken", error)
        .with("register", register.number())
        .with("wrote", wrote)
        .with("found", found)
        .build()
}

/// Converts degrees or millimetres to the value of a register, for programs that take positions from
/// registers: times 1000, rounded to the nearest whole number. ``OutOfRange`` for a value that does not
/// fit into the 32 bits of a register.
#[pyfunction]
pub fn to_thousandths(py: Python<'_>, value: f64) -> PyResult<i32> {
    raise(py, r6_client::to_thousandths(value))
}

/// Converts the value of a register to degrees or millimetres.
#[pyfunction]
pub fn from_thousandths(value: i64) -> f64 {
    r6_client::from_thousandths(value)
}

/// The first of `count` registers, if all of them exist.
pub fn first(first: u16, count: usize) -> PyResult<RegisterIndex> {
    let beyond = count.checked_sub(1).ok_or_else(|| PyValueError::new_err("count has to be 1 or more"))?;
    // The first register is checked before the last, so that the error names the number that the caller gave.
    let found = register(first)?;
    register(first.saturating_add(u16::try_from(beyond).unwrap_or(u16::MAX)))?;
    Ok(found)
}

/// An int64 array.
pub fn to_array<'py>(py: Python<'py>, values: Vec<i64>) -> PyResult<Bound<'py, PyAny>> {
    numpy(py)?.getattr("array")?.call1((values, "int64"))
}

/// Values for consecutive registers.
pub struct Write {
    first: RegisterIndex,
    values: Vec<i64>,
    savable: bool,
    verify: bool,
}

impl Write {
    /// Checks that the registers exist.
    pub fn new(first: u16, values: Vec<i64>, savable: bool, verify: bool) -> PyResult<Self> {
        Ok(Self { first: self::first(first, values.len())?, values, savable, verify })
    }

    /// Writes the values, and reads them back if `verify` is set.
    pub async fn send(&self, robot: &Robot) -> Result<(), RegisterError> {
        let narrow: Result<Vec<i32>, _> = self.values.iter().copied().map(i32::try_from).collect();
        match narrow {
            Ok(values) if self.verify => {
                let keep = if self.savable { Keep::Always } else { Keep::UntilPowerCut };
                robot.write_registers(self.first, &values, keep).await
            }
            // A value that does not fit is not sent: encoding the frame fails.
            Ok(_) | Err(_) => {
                robot.command(self.command()).await?;
                Ok(())
            }
        }
    }

    fn command(&self) -> Command<'static> {
        let (first, savable) = (self.first, self.savable);
        match *self.values.as_slice() {
            [value] => Command::RewriteData { register: first, value, savable },
            _ => Command::RewriteDataList { first, savable, values: self.values.clone() },
        }
    }

    /// The exception for an error of `send`. A value that cannot be read back counts as not taken.
    pub fn exception(&self, py: Python<'_>, error: &RegisterError) -> PyErr {
        match error {
            RegisterError::NotReadable { register } => {
                let place = register.number().saturating_sub(self.first.number());
                let wrote = self.values.get(usize::from(place)).copied().unwrap_or_default();
                not_taken(py, error, *register, wrote, None)
            }
            RegisterError::Request(_)
            | RegisterError::NoSuchRegisters { .. }
            | RegisterError::Differs { .. } => error.exception(py),
        }
    }
}
