//! Values of query addresses, for people and for programs.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use r6_api::Unit;
use r6_client::{NoReading, QueryResult};
use r6_proto::{Address, Reading, printable};

use crate::exit::Failure;
use crate::output::problem::{self, Code};
use crate::output::table::Table;

/// A table of each address with its value, unit and meaning.
pub fn table(result: &QueryResult) -> Table {
    let mut table = Table::with_right_columns(&[1]);
    for (address, value) in result.rows() {
        table.row([address, &value_text(*address, value), &unit(*address), &meaning(*address)]);
    }
    table
}

/// The heading of [`values_line`]: `time`, then each address with its unit in brackets.
pub fn heading_line(result: &QueryResult) -> String {
    let mut words = vec!["time".to_owned()];
    words.extend(result.rows().iter().map(|(address, _)| match unit(*address) {
        "" => address.to_string(),
        unit => format!("{address} [{unit}]"),
    }));
    words.join("  ")
}

/// One line: when the values came (UTC, RFC 3339 with milliseconds), then the values in the order asked.
pub fn values_line(at: SystemTime, result: &QueryResult) -> String {
    let mut words = vec![humantime::format_rfc3339_millis(at).to_string()];
    let values = result.rows().iter().map(|(address, value)| value_text(*address, value));
    words.extend(values.map(|value| printable(&value).to_string()));
    words.join("  ")
}

/// A value as text for people; `-` if there is no value.
fn value_text(address: Address, value: &Result<Reading, NoReading>) -> String {
    match value {
        Ok(Reading::Word(word)) => format!("0x{word:08X}"),
        Ok(Reading::Decimal(number)) => format!("{number:.3}"),
        Ok(Reading::Integer(mode)) if address == Address::CurMode => {
            r6_client::OperationMode::of_number(*mode).to_string()
        }
        Ok(
            reading @ (Reading::Text(_)
            | Reading::Integer(_)
            | Reading::Flag(_)
            | Reading::Texts(_)
            | Reading::Counter(_)),
        ) => reading.to_string(),
        Err(NoReading::Unsupported) => "-".to_owned(),
        Err(NoReading::Unreadable(_)) => "?".to_owned(),
    }
}

/// The unit of an address. A pose has mm for its first three components and degrees for the others. The wire
/// does not say the unit of an axis.
pub fn unit(address: Address) -> &'static str {
    Unit::word_of(address).unwrap_or(match address {
        Address::Axis(_) | Address::Faxis(_) => "deg or mm",
        _ => "",
    })
}

/// The meaning of an address: the text of the table, with the index of this address.
fn meaning(address: Address) -> String {
    let words = address.info().meaning;
    match (address, address.index()) {
        (Address::World(component), _) => format!("pose, {}", component.world_name()),
        (
            Address::Axis(axis) | Address::CurTorque(axis) | Address::CurSpeed(axis) | Address::Faxis(axis),
            _,
        ) => words.replace("axis n", &axis.to_string()),
        (Address::CurMode, _) => "operation mode".to_owned(),
        (Address::Addr(register), _) => format!("register {}", register.number()),
        (_, Some(word)) => {
            let last = 32 * u64::from(word) + 32;
            words.replace("32n+32", &last.to_string()).replace("32n+1", &(last - 31).to_string())
        }
        (_, None) => words.to_owned(),
    }
}

/// The addresses without a value, each with the reason.
pub fn problems(result: &QueryResult) -> impl Iterator<Item = (Address, &NoReading)> {
    result.rows().iter().filter_map(|(address, value)| value.as_ref().err().map(|error| (*address, error)))
}

/// The failure for addresses without a value; `None` if all have values.
pub fn missing(result: &QueryResult) -> Option<Failure> {
    let words: Vec<_> = problems(result).map(|(address, error)| problem_text(address, error)).collect();
    (!words.is_empty()).then(|| Failure::refused(words.join("; ")).with_code(Code::NoValue))
}

/// Why an address has no value.
pub fn problem_text(address: Address, error: &NoReading) -> String {
    match error {
        NoReading::Unsupported => format!("{address}: {error}"),
        NoReading::Unreadable(_) => error.to_string(),
    }
}

/// The values for programs, with the current time.
pub fn sample(robot: &str, result: &QueryResult) -> r6_api::Sample {
    let unix = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let value = |value: &Result<Reading, NoReading>| value.clone().ok().map(r6_api::AddressValue::from);
    r6_api::Sample {
        robot: robot.to_owned(),
        unix_ms: u64::try_from(unix.as_millis()).unwrap_or(u64::MAX),
        took_ms: milliseconds(result.took()),
        values: result.rows().iter().map(|(address, read)| (address.to_string(), value(read))).collect(),
        problems: problems(result).map(|(address, why)| (address.to_string(), why.to_string())).collect(),
        problem: missing(result).map(|failure| problem::of(&failure)),
    }
}

/// Milliseconds with three decimals.
pub fn milliseconds(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e6).round() / 1e3
}
