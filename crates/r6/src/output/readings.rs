//! Values of query addresses, for people and for programs.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use r6_api::AddressValue;
use r6_api::Unit;
use r6_client::{NoReading, QueryResult};
use r6_proto::address::ValueType;
use r6_proto::message::reading::Counter;
use r6_proto::{Address, Reading, printable};

use crate::exit::Failure;
use crate::output::problem::{self, Code};
use crate::output::table::Table;

/// The values of one query, of a controller or of a gateway.
#[derive(Clone, Debug)]
pub struct Readings {
    /// In the order asked.
    rows: Vec<(Address, Result<Reading, Missing>)>,
    took: Duration,
}

/// Why an address has no value.
#[derive(Clone, Debug)]
struct Missing {
    /// What stands in place of the value.
    mark: &'static str,
    /// Why, without the address.
    why: String,
    /// Why, with the address.
    told: String,
}

impl Readings {
    /// Values that a gateway told, and why others are missing, in words.
    pub fn of_gateway(rows: Vec<(Address, Result<AddressValue, String>)>, took: Duration) -> Self {
        let read = |address: Address, value: Result<AddressValue, String>| {
            let missing = |why| Missing { mark: "-", told: format!("{address}: {why}"), why };
            let value = value.and_then(|value| reading(address, value));
            (address, value.map_err(missing))
        };
        Self { rows: rows.into_iter().map(|(address, value)| read(address, value)).collect(), took }
    }

    /// The time from the request to the last reply.
    pub fn took(&self) -> Duration {
        self.took
    }
}

impl From<&QueryResult> for Readings {
    fn from(result: &QueryResult) -> Self {
        let missing = |address: Address, error: &NoReading| Missing {
            mark: match error {
                NoReading::Unsupported => "-",
                NoReading::Unreadable(_) => "?",
            },
            why: error.to_string(),
            told: match error {
                NoReading::Unsupported => format!("{address}: {error}"),
                NoReading::Unreadable(_) => error.to_string(),
            },
        };
        let row = |(address, value): &(Address, Result<Reading, NoReading>)| {
            (*address, value.clone().map_err(|error| missing(*address, &error)))
        };
        Self { rows: result.rows().iter().map(row).collect(), took: result.took() }
    }
}

/// The text of a value that a gateway told.
pub fn told(address: &str, value: AddressValue) -> String {
    let json = || serde_json::to_value(&value).map_or_else(|_| "?".to_owned(), |json| json.to_string());
    let read =
        address.parse().ok().and_then(|address| Some((address, reading(address, value.clone()).ok()?)));
    read.map_or_else(json, |(address, reading)| value_text(address, &Ok(reading)))
}

/// A value as JSON has it. JSON does not tell a whole number, a decimal one and a word of points apart; the
/// address does.
fn reading(address: Address, value: AddressValue) -> Result<Reading, String> {
    let kind = address.info().value;
    Ok(match (kind, value) {
        (ValueType::Text, AddressValue::Text(text)) => Reading::Text(text),
        (ValueType::Integer, AddressValue::Integer(number)) => Reading::Integer(number),
        (ValueType::Integer, AddressValue::Word(word)) => Reading::Integer(i64::from(word)),
        (ValueType::Decimal, AddressValue::Decimal(number)) => Reading::Decimal(number),
        // The numbers of the protocol are far below 2^53.
        (ValueType::Decimal, AddressValue::Integer(number)) => Reading::Decimal(number as f64),
        (ValueType::Word, AddressValue::Word(word)) => Reading::Word(word),
        (ValueType::Word, AddressValue::Integer(number)) => match u32::try_from(number) {
            Ok(word) => Reading::Word(word),
            Err(_) => return Err(format!("{number} is no word of 32 points")),
        },
        (ValueType::Flag, AddressValue::Flag(flag)) => Reading::Flag(flag),
        (ValueType::TextList, AddressValue::Texts(texts)) => Reading::Texts(texts),
        (ValueType::Counter, AddressValue::Counter { id, target, current, name }) => {
            Reading::Counter(Counter { id, target, current, name })
        }
        (kind, _) => return Err(format!("the value is no {kind}")),
    })
}

/// A table of each address with its value, unit and meaning.
pub fn table(result: &Readings) -> Table {
    let mut table = Table::with_right_columns(&[1]);
    for (address, value) in &result.rows {
        table.row([address, &value_text(*address, value), &unit(*address), &meaning(*address)]);
    }
    table
}

/// The heading of [`values_line`]: `time`, then each address with its unit in brackets.
pub fn heading_line(result: &Readings) -> String {
    let mut words = vec!["time".to_owned()];
    words.extend(result.rows.iter().map(|(address, _)| match unit(*address) {
        "" => address.to_string(),
        unit => format!("{address} [{unit}]"),
    }));
    words.join("  ")
}

/// One line: when the values came (UTC, RFC 3339 with milliseconds), then the values in the order asked.
pub fn values_line(at: SystemTime, result: &Readings) -> String {
    let mut words = vec![humantime::format_rfc3339_millis(at).to_string()];
    let values = result.rows.iter().map(|(address, value)| value_text(*address, value));
    words.extend(values.map(|value| printable(&value).to_string()));
    words.join("  ")
}

/// A value as text for people; `-` if there is no value.
fn value_text(address: Address, value: &Result<Reading, Missing>) -> String {
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
        Err(missing) => missing.mark.to_owned(),
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

/// The addresses without a value, each with the reason for people.
pub fn problems(result: &Readings) -> impl Iterator<Item = (Address, &str)> {
    let missing = result.rows.iter().filter_map(|(address, value)| Some((*address, value.as_ref().err()?)));
    missing.map(|(address, missing)| (address, missing.told.as_str()))
}

/// The failure for addresses without a value; `None` if all have values.
pub fn missing(result: &Readings) -> Option<Failure> {
    let words: Vec<_> = problems(result).map(|(_, why)| why).collect();
    (!words.is_empty()).then(|| Failure::refused(words.join("; ")).with_code(Code::NoValue))
}

/// The values for programs, with the current time.
pub fn sample(robot: &str, result: &Readings) -> r6_api::Sample {
    let unix = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let value = |value: &Result<Reading, Missing>| value.clone().ok().map(AddressValue::from);
    let why = |(address, value): &(Address, Result<Reading, Missing>)| {
        Some((address.to_string(), value.as_ref().err()?.why.clone()))
    };
    r6_api::Sample {
        robot: robot.to_owned(),
        unix_ms: u64::try_from(unix.as_millis()).unwrap_or(u64::MAX),
        took_ms: milliseconds(result.took),
        values: result.rows.iter().map(|(address, read)| (address.to_string(), value(read))).collect(),
        problems: result.rows.iter().filter_map(why).collect(),
        problem: missing(result).map(|failure| problem::of(&failure)),
    }
}

/// Milliseconds with three decimals.
pub fn milliseconds(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e6).round() / 1e3
}
