//! The typed value of a query address, read from any form that firmware sends.

use std::fmt;

use crate::address::{Address, ValueType};
use crate::error::{FieldError, FieldPath, Wanted};
use crate::message::fields::excerpt;
use crate::value::Value;

/// A value that was read, typed by its address.
#[derive(Clone, Debug, PartialEq)]
pub enum Reading {
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
    Counter(Counter),
}

/// A counter (manual 4.1.1 #4).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Counter {
    /// Its id.
    pub id: i64,
    /// The target count.
    pub target: i64,
    /// The current count.
    pub current: i64,
    /// Its name, which only older firmware sends.
    pub name: Option<String>,
}

impl Reading {
    /// Reads the value of an address, quoted or not. A counter may be a list or the text of older firmware.
    ///
    /// # Errors
    /// [`FieldError`] if the value is not valid for this address.
    pub fn of(address: Address, value: Value<'_>) -> Result<Self, FieldError> {
        let wrong = |wanted| FieldError {
            path: FieldPath::Member(address.to_string()),
            found: Some(excerpt(value)),
            wanted,
            nearest: None,
        };
        match address.info().value {
            ValueType::Text if value.is_list() => Err(wrong(Wanted(&["a text", "文本"]))),
            ValueType::Text => Ok(Self::Text(value.text().into_owned())),
            ValueType::Integer => {
                value.integer().map(Self::Integer).ok_or_else(|| wrong(Wanted(&["a whole number", "整数"])))
            }
            ValueType::Decimal => value
                .number()
                .map(Self::Decimal)
                .ok_or_else(|| wrong(Wanted(&["a finite number", "有限的数"]))),
            ValueType::Word => word(value)
                .map(Self::Word)
                .ok_or_else(|| wrong(Wanted(&["a number of 32 bits", "32 位的数"]))),
            ValueType::Flag => {
                value.flag().map(Self::Flag).ok_or_else(|| wrong(Wanted(&["1 or 0", "1 或 0"])))
            }
            ValueType::TextList if value.is_list() => {
                Ok(Self::Texts(value.items().map(|item| item.text().into_owned()).collect()))
            }
            ValueType::TextList => Err(wrong(Wanted(&["a list of texts", "文本列表"]))),
            ValueType::Counter => {
                let counter = Counter::of(value).ok_or_else(|| {
                    wrong(Wanted(&[
                        "a counter: [id, target, current] or name[id][T:target][C:current]",
                        "计数器：[id, target, current] 或 name[id][T:target][C:current]",
                    ]))
                })?;
                // Only a counter says which address it belongs to. Values behind an absent one move up.
                if matches!(address, Address::Counter(asked) if i64::from(asked) != counter.id) {
                    return Err(wrong(Wanted(&[
                        "the counter that was asked for; this is another one, by its id",
                        "所查询的计数器；按 id 这是另一个",
                    ])));
                }
                Ok(Self::Counter(counter))
            }
        }
    }
}

/// Reads a word of 32 points. Some firmware prints it as a signed number with the same bits.
fn word(value: Value<'_>) -> Option<u32> {
    let number = value.integer()?;
    let signed = || i32::try_from(number).ok().map(i32::cast_unsigned);
    u32::try_from(number).ok().or_else(signed)
}

impl Counter {
    fn of(value: Value<'_>) -> Option<Self> {
        if !value.is_list() {
            return Self::of_text(&value.text());
        }
        let mut items = value.items().map(|item| item.integer());
        let (id, target, current) = (items.next()??, items.next()??, items.next()??);
        items.next().is_none().then_some(Self { id, target, current, name: None })
    }

    /// Reads `name[id][T:target][C:current]` (captured, unit E, older firmware).
    fn of_text(text: &str) -> Option<Self> {
        let (rest, current) = text.strip_suffix(']')?.rsplit_once("][C:")?;
        let (rest, target) = rest.rsplit_once("][T:")?;
        let (name, id) = rest.rsplit_once('[')?;
        Some(Self {
            id: id.parse().ok()?,
            target: target.parse().ok()?,
            current: current.parse().ok()?,
            name: Some(name.to_owned()),
        })
    }
}

impl fmt::Display for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text(text) => f.write_str(text),
            Self::Integer(number) => write!(f, "{number}"),
            Self::Decimal(number) => write!(f, "{number}"),
            Self::Word(word) => write!(f, "{word}"),
            Self::Flag(flag) => f.write_str(if *flag { "1" } else { "0" }),
            Self::Texts(texts) => f.write_str(&texts.join(", ")),
            Self::Counter(counter) => {
                write!(f, "{} of {} (counter {})", counter.current, counter.target, counter.id)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::json::Cursor;

    fn read(address: &str, json: &str) -> Result<Reading, FieldError> {
        let node = Cursor::new(json.as_bytes(), 0).value().unwrap();
        Reading::of(address.parse().unwrap(), Value::new(json.as_bytes(), node))
    }

    #[test]
    fn counters_come_in_three_forms() {
        let counter = |name: Option<&str>| {
            Reading::Counter(Counter { id: 4, target: 20, current: 7, name: name.map(str::to_owned) })
        };
        assert_eq!(read("counter-4", "[4,20,7]"), Ok(counter(None)));
        assert_eq!(read("counter-4", "[\"4\",\"20\",\"7\"]"), Ok(counter(None)));
        assert_eq!(read("counter-4", "\"计数[4][T:20][C:7]\""), Ok(counter(Some("计数"))));
        assert!(read("counter-4", "[4,20]").is_err());
        for another in ["[5,20,7]", "\"计数[5][T:20][C:7]\"", "[-4,20,7]"] {
            let error = read("counter-4", another).unwrap_err().to_string();
            assert!(error.contains("counter-4") && error.contains("by its id"), "{error}");
        }
        assert!(read("counter-4", "[4,20,7,1]").is_err());
    }

    #[test]
    fn a_wrong_value_names_its_address() {
        let error = read("axis-3", "\"abc\"").unwrap_err();
        assert_eq!(error.to_string(), "`axis-3` is \"abc\", but has to be a finite number");
    }

    #[test]
    fn words_may_be_signed() {
        assert_eq!(read("output-0", "\"-1\""), Ok(Reading::Word(u32::MAX)));
        assert_eq!(read("output-0", "\"4294967295\""), Ok(Reading::Word(u32::MAX)));
        assert!(read("output-0", "\"4294967296\"").is_err());
    }
}
