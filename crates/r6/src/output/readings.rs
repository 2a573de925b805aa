//! Values of query addresses, for people and for programs.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use r6_api::Unit;
use r6_client::{NoReading, QueryResult};
use r6_proto::{Address, Reading, printable};
use serde::ser::{Serialize, SerializeMap, SerializeSeq, Serializer};

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
    match (address, Unit::of(address)) {
        (_, Some(unit)) => unit.word(),
        (Address::Axis(_) | Address::Faxis(_), None) => "deg or mm",
        (_, None) => address.info().unit,
    }
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

/// A reading as a JSON object: time, duration, values by address, and why some are missing.
pub struct Sample<'r> {
    robot: &'r str,
    at: SystemTime,
    result: &'r QueryResult,
}

impl<'r> Sample<'r> {
    /// A sample with the current time.
    pub fn now(robot: &'r str, result: &'r QueryResult) -> Self {
        Self { robot, at: SystemTime::now(), result }
    }
}

impl Serialize for Sample<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("robot", self.robot)?;
        let unix = self.at.duration_since(UNIX_EPOCH).unwrap_or_default();
        map.serialize_entry("unix_ms", &u64::try_from(unix.as_millis()).unwrap_or(u64::MAX))?;
        map.serialize_entry("took_ms", &milliseconds(self.result.took()))?;
        map.serialize_entry("values", &Values(self.result))?;
        map.serialize_entry("problems", &Problems(self.result))?;
        if let Some(failure) = missing(self.result) {
            map.serialize_entry("problem", &problem::object(&failure))?;
        }
        map.end()
    }
}

struct Values<'r>(&'r QueryResult);

impl Serialize for Values<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.rows().len()))?;
        for (address, value) in self.0.rows() {
            map.serialize_entry(&address.to_string(), &value.as_ref().ok().map(Value))?;
        }
        map.end()
    }
}

struct Problems<'r>(&'r QueryResult);

impl Serialize for Problems<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (address, error) in problems(self.0) {
            map.serialize_entry(&address.to_string(), &error.to_string())?;
        }
        map.end()
    }
}

struct Value<'r>(&'r Reading);

impl Serialize for Value<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Reading::Text(text) => serializer.serialize_str(text),
            Reading::Integer(number) => serializer.serialize_i64(*number),
            Reading::Decimal(number) => serializer.serialize_f64(*number),
            Reading::Word(word) => serializer.serialize_u32(*word),
            Reading::Flag(flag) => serializer.serialize_bool(*flag),
            Reading::Texts(texts) => {
                let mut list = serializer.serialize_seq(Some(texts.len()))?;
                for text in texts {
                    list.serialize_element(text)?;
                }
                list.end()
            }
            Reading::Counter(counter) => {
                let mut map = serializer.serialize_map(None)?;
                map.serialize_entry("id", &counter.id)?;
                map.serialize_entry("target", &counter.target)?;
                map.serialize_entry("current", &counter.current)?;
                if let Some(name) = &counter.name {
                    map.serialize_entry("name", name)?;
                }
                map.end()
            }
        }
    }
}

/// Milliseconds with three decimals.
pub fn milliseconds(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e6).round() / 1e3
}
