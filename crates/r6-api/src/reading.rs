//! The values of a query.

use r6_proto::Reading;
use r6_proto::message::reading::Counter;
use serde::ser::{Serialize, Serializer};

use crate::CommandProblem;

/// The values of one query, with the time when they came.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Sample {
    /// The address of the robot.
    pub robot: String,
    /// When the values came, in milliseconds since 1970 (UTC).
    pub unix_ms: u64,
    /// How long the reply took.
    pub took_ms: f64,
    /// Each address with its value, in the order asked; `null` if it has none.
    #[serde(serialize_with = "as_map")]
    pub values: Vec<(String, Option<AddressValue>)>,
    /// Each address without a value, with the reason.
    #[serde(serialize_with = "as_map")]
    pub problems: Vec<(String, String)>,
    /// Why the query failed; absent if every address has a value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub problem: Option<CommandProblem>,
}

/// The value of an address: a text, a number, a flag, a list of texts or an object.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(untagged)]
pub enum AddressValue {
    /// Text: versions, names.
    Text(String),
    /// A whole number.
    Integer(i64),
    /// A decimal number, in the unit of its address.
    Decimal(f64),
    /// 32 points; bit 0 is the first.
    Word(u32),
    /// A flag.
    Flag(bool),
    /// A list of texts.
    Texts(Vec<String>),
    /// A counter.
    Counter {
        /// Its id.
        id: i64,
        /// The target count.
        target: i64,
        /// The current count.
        current: i64,
        /// Its name; absent if the firmware sends none.
        #[serde(skip_serializing_if = "Option::is_none")]
        name: Option<String>,
    },
}

impl From<Reading> for AddressValue {
    fn from(reading: Reading) -> Self {
        match reading {
            Reading::Text(text) => Self::Text(text),
            Reading::Integer(number) => Self::Integer(number),
            Reading::Decimal(number) => Self::Decimal(number),
            Reading::Word(word) => Self::Word(word),
            Reading::Flag(flag) => Self::Flag(flag),
            Reading::Texts(texts) => Self::Texts(texts),
            Reading::Counter(Counter { id, target, current, name }) => {
                Self::Counter { id, target, current, name }
            }
        }
    }
}

fn as_map<V: Serialize, S: Serializer>(rows: &[(String, V)], to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(rows.iter().map(|(name, value)| (name, value)))
}
