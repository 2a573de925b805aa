//! Reads a document in JSON.

use std::fmt;

use serde::Deserialize;
use serde::de::{MapAccess, Visitor};
use serde_json::value::RawValue;

use super::{Entry, MAX_DEPTH, Node, Number, Table, Value};
use crate::lines;

/// The byte offset and the text of a mistake.
type NoJson = (usize, String);

/// Reads a JSON text as a table. The places are offsets in the text, because `serde_json` returns each value
/// as the piece of text that it was read from.
pub fn parse(text: &str) -> Result<Table, NoJson> {
    let raw: &RawValue = serde_json::from_str(text).map_err(|error| {
        let at = lines::offset(text, error.line(), error.column());
        let what = error.to_string();
        let (what, _) = what.rsplit_once(" at line ").unwrap_or((&what, ""));
        (at, format!("this is no JSON: {what}"))
    })?;
    Document { text }.table(raw, 0)
}

/// The text; the values are pieces of it.
struct Document<'t> {
    text: &'t str,
}

impl<'t> Document<'t> {
    fn at(&self, raw: &RawValue) -> usize {
        raw.get().as_ptr().addr().saturating_sub(self.text.as_ptr().addr())
    }

    fn table(&self, raw: &'t RawValue, depth: usize) -> Result<Table, NoJson> {
        let Pairs(pairs) = self.read(raw)?;
        let mut entries: Vec<Entry> = Vec::with_capacity(pairs.len());
        for (key, value) in pairs {
            let at = self.at(key);
            let key: String = self.read(key)?;
            entries.push(Entry { key, at, value: self.node(value, depth + 1)? });
        }
        self.unique(&entries)?;
        Ok(Table { at: self.at(raw), entries })
    }

    /// Rejects a repeated key. TOML forbids repeated keys, and readers of JSON may use either of the two
    /// values.
    fn unique(&self, entries: &[Entry]) -> Result<(), NoJson> {
        let mut keys: Vec<_> = entries.iter().map(|entry| (entry.key.as_str(), entry.at)).collect();
        keys.sort_unstable();
        let twice = keys.iter().zip(keys.iter().skip(1)).find(|((one, _), (other, _))| one == other);
        match twice {
            Some((_, (key, at))) => {
                let key: String = key.chars().take(40).collect();
                Err((*at, format!("the key `{key}` is there twice")))
            }
            None => Ok(()),
        }
    }

    fn node(&self, raw: &'t RawValue, depth: usize) -> Result<Node, NoJson> {
        let text = raw.get();
        let value = match text.as_bytes().first() {
            Some(b'{' | b'[') if depth > MAX_DEPTH => Value::TooDeep,
            Some(b'{') => Value::Table(self.table(raw, depth)?),
            Some(b'[') => {
                let values: Vec<&RawValue> = self.read(raw)?;
                let nodes = values.into_iter().map(|value| self.node(value, depth + 1));
                Value::List(nodes.collect::<Result<_, _>>()?)
            }
            Some(b'"') => Value::Text(self.read(raw)?),
            Some(b't') => Value::Flag(true),
            Some(b'f') => Value::Flag(false),
            Some(b'n') | None => Value::Null,
            Some(_) => Value::Number(Number {
                whole: text.parse().ok(),
                real: text.parse().ok(),
                written: text.to_owned(),
            }),
        };
        Ok(Node { at: self.at(raw), value })
    }

    fn read<T: Deserialize<'t>>(&self, raw: &'t RawValue) -> Result<T, NoJson> {
        serde_json::from_str(raw.get()).map_err(|error| (self.at(raw), format!("this is no JSON: {error}")))
    }
}

/// The keys and values of an object, in their order.
struct Pairs<'t>(Vec<(&'t RawValue, &'t RawValue)>);

impl<'de> Deserialize<'de> for Pairs<'de> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Object;

        impl<'de> Visitor<'de> for Object {
            type Value = Pairs<'de>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut pairs = Vec::new();
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Pairs(pairs))
            }
        }

        deserializer.deserialize_map(Object)
    }
}
