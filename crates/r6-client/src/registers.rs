//! Registers: the numbers that a PC and a taught program share, written and read back.

use std::fmt;

use r6_proto::address::{Address, RegisterIndex};
use r6_proto::message::Command;

use crate::error::RequestError;
use crate::link::Lane;
use crate::robot::Robot;
use crate::units::OutOfRange;

/// The register value of one degree or one millimetre, if a program takes positions from registers.
const PER_UNIT: f64 = 1000.0;

/// Whether a register survives a power cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Keep {
    /// It does not. Use it for values that change often: the memory that keeps them wears out with writes.
    #[default]
    UntilPowerCut,
    /// It does.
    Always,
}

/// Why registers were not read, or not seen to be written.
#[derive(Clone, Debug, PartialEq)]
pub enum RegisterError {
    /// The request failed.
    Request(RequestError),
    /// No value, or more values than the registers from this one to 900 hold; nothing was sent.
    NoSuchRegisters {
        /// The first register.
        first: RegisterIndex,
        /// How many registers were meant.
        count: usize,
    },
    /// The controller reports no value of this register. A written value was accepted, but it cannot be
    /// verified: firmware before 206 master F1 has registers and does not read them.
    NotReadable {
        /// The register.
        register: RegisterIndex,
    },
    /// The controller said ok, but the register has another value: another program writes it too, or the
    /// firmware converts it.
    Differs {
        /// The register.
        register: RegisterIndex,
        /// What was written.
        wrote: i32,
        /// What was read back.
        found: i64,
    },
}

impl Robot {
    /// Reads `count` registers (`Addr-n`) from `first` on.
    ///
    /// # Errors
    /// [`RegisterError`], never [`RegisterError::Differs`].
    pub async fn read_registers(
        &self,
        first: RegisterIndex,
        count: usize,
    ) -> Result<Vec<i64>, RegisterError> {
        self.drive(self.read_in_a_row(first, count)).await
    }

    async fn read_in_a_row(&self, first: RegisterIndex, count: usize) -> Result<Vec<i64>, RegisterError> {
        let registers = in_a_row(first, count)?;
        let asked: Vec<Address> = registers.iter().copied().map(Address::Addr).collect();
        let read = self.query_in(Lane::Ordinary, &asked).await?;
        let value = |register: RegisterIndex| {
            read.integer(Address::Addr(register)).ok_or(RegisterError::NotReadable { register })
        };
        registers.into_iter().map(value).collect()
    }

    /// Writes registers from `first` on, and reads them back, because controllers say ok to values that they
    /// do not take.
    ///
    /// If a program waits for these registers, writing them moves the arm; no guard checks that. A register
    /// that the program itself changes at once is read back as changed: for such a register send
    /// [`Command::RewriteData`] alone.
    ///
    /// ```
    /// # #[tokio::main(flavor = "current_thread")]
    /// # async fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let controller = r6_sim::VirtualController::start().await?;
    /// # let address = controller.address().to_string();
    /// use r6_client::{Keep, RegisterIndex, Robot, RobotSettings, from_thousandths, to_thousandths};
    ///
    /// let robot = Robot::connect(&address, RobotSettings::default()).await?;
    /// let first = RegisterIndex::new(800).expect("800 to 900");
    /// let axes = [10.0, -20.5, 30.0].map(|degrees| to_thousandths(degrees).expect("a few degrees"));
    /// robot.write_registers(first, &axes, Keep::UntilPowerCut).await?;
    /// let read = robot.read_registers(first, 3).await?;
    /// assert_eq!(read, [10_000, -20_500, 30_000]);
    /// assert_eq!(from_thousandths(read[1]), -20.5);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// [`RegisterError`]. The client never resends it: after an unknown outcome read the registers, then
    /// decide.
    pub async fn write_registers(
        &self,
        first: RegisterIndex,
        values: &[i32],
        keep: Keep,
    ) -> Result<(), RegisterError> {
        let registers = in_a_row(first, values.len())?;
        let savable = keep == Keep::Always;
        let command = match values {
            [value] => Command::RewriteData { register: first, value: i64::from(*value), savable },
            several => {
                let values = several.iter().copied().map(i64::from).collect();
                Command::RewriteDataList { first, savable, values }
            }
        };
        let write_and_read = async {
            self.command_now(command).await?;
            self.read_in_a_row(first, values.len()).await
        };
        let found = self.drive(write_and_read).await?;
        for ((register, wrote), found) in registers.into_iter().zip(values).zip(found) {
            if i64::from(*wrote) != found {
                return Err(RegisterError::Differs { register, wrote: *wrote, found });
            }
        }
        Ok(())
    }
}

/// This many registers from `first` on, if there are enough.
fn in_a_row(first: RegisterIndex, count: usize) -> Result<Vec<RegisterIndex>, RegisterError> {
    let registers: Vec<_> =
        (first.number()..=RegisterIndex::LAST).filter_map(RegisterIndex::new).take(count).collect();
    if count == 0 || registers.len() < count {
        return Err(RegisterError::NoSuchRegisters { first, count });
    }
    Ok(registers)
}

/// Converts degrees or millimetres to a register value: times 1000, rounded to the nearest whole number. A
/// position is computed, and rounding changes it by less than half a thousandth. Write a setting that must
/// not be rounded as a whole number.
///
/// # Errors
/// [`OutOfRange`] for NaN and for a value that does not fit into the 32 bits of a register.
pub fn to_thousandths(value: f64) -> Result<i32, OutOfRange> {
    let thousandths = (value * PER_UNIT).round();
    if (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&thousandths) {
        #[expect(clippy::cast_possible_truncation, reason = "a whole number within the range")]
        Ok(thousandths as i32)
    } else {
        Err(OutOfRange::new(value, "from -2147483.648 to 2147483.647"))
    }
}

/// Converts a register value to degrees or millimetres.
#[must_use]
pub fn from_thousandths(value: i64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "registers have 32 bits, which an f64 holds")]
    let value = value as f64;
    value / PER_UNIT
}

impl From<RequestError> for RegisterError {
    fn from(error: RequestError) -> Self {
        Self::Request(error)
    }
}

impl fmt::Display for RegisterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Request(error) => error.fmt(f),
            Self::NoSuchRegisters { count: 0, .. } => f.write_str("nothing was sent: no value was given"),
            Self::NoSuchRegisters { first, count } => write!(
                f,
                "nothing was sent: {count} registers from {} on go beyond {}, the last one",
                first.number(),
                RegisterIndex::LAST
            ),
            Self::NotReadable { register } => write!(
                f,
                "register {} cannot be read: this firmware does not tell registers (Addr-n came with 206 master F1); what \
                 was written may be there",
                register.number()
            ),
            Self::Differs { register, wrote, found } => write!(
                f,
                "register {} has {found} and not {wrote}, although the controller said ok: find out who else writes it, the \
                 running program included",
                register.number()
            ),
        }
    }
}

impl std::error::Error for RegisterError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Request(error) => Some(error),
            Self::NoSuchRegisters { .. } | Self::NotReadable { .. } | Self::Differs { .. } => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn register(number: u16) -> RegisterIndex {
        RegisterIndex::new(number).unwrap()
    }

    #[test]
    fn registers_in_a_row_end_at_the_last() {
        assert_eq!(in_a_row(register(899), 2).unwrap(), [register(899), register(900)]);
        assert_eq!(in_a_row(register(800), 101).unwrap().len(), 101);
        for (first, count) in [(899, 3), (800, 102), (850, 0), (900, usize::MAX)] {
            let error = in_a_row(register(first), count).unwrap_err();
            assert!(error.to_string().starts_with("nothing was sent"), "{error}");
        }
    }

    #[test]
    fn thousandths_are_rounded_and_bounded() {
        // 0.001 times 1000 is not a whole number in binary: truncation would lose the last digit.
        for (value, wanted) in [(16.001, 16_001), (-0.0004, 0), (-90.0, -90_000), (2_147_483.647, i32::MAX)] {
            assert_eq!(to_thousandths(value), Ok(wanted));
        }
        for bad in [2_147_483.648, -2_147_483.649, f64::NAN, f64::INFINITY] {
            assert!(to_thousandths(bad).is_err(), "{bad}");
        }
        assert_eq!(from_thousandths(-20_500), -20.5);
    }
}
