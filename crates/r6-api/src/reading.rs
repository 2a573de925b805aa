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

/// Its schema has one form of number: JSON does not tell a whole number, a decimal one and a word of
/// points apart, so that `oneOf` would match twice.
#[cfg(feature = "openapi")]
mod schema {
    use utoipa::openapi::schema::{AnyOfBuilder, ArrayBuilder, ObjectBuilder, Type};
    use utoipa::openapi::{RefOr, Schema};

    use super::AddressValue;

    impl utoipa::PartialSchema for AddressValue {
        fn schema() -> RefOr<Schema> {
            let of = |kind: Type, what: &str| ObjectBuilder::new().schema_type(kind).description(Some(what));
            let counter = of(Type::Object, "A counter.")
                .property("id", of(Type::Integer, "Its id."))
                .property("target", of(Type::Integer, "The target count."))
                .property("current", of(Type::Integer, "The current count."))
                .property("name", of(Type::String, "Its name; absent if the firmware sends none."))
                .required("id")
                .required("target")
                .required("current");
            AnyOfBuilder::new()
                .description(Some(
                    "The value of an address: a text, a number, a flag, a list of texts or an object.",
                ))
                .item(of(Type::String, "Text: versions, names."))
                .item(of(
                    Type::Number,
                    "A number in the unit of its address, or a word of 32 points (bit 0 is the first).",
                ))
                .item(of(Type::Boolean, "A flag."))
                .item(ArrayBuilder::new().items(of(Type::String, "")).description(Some("A list of texts.")))
                .item(counter)
                .into()
        }
    }

    impl utoipa::ToSchema for AddressValue {}
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
