//! The form of a document in TOML, or in JSON with the same keys: tables and values with their places.
//!
//! [`parse`] returns a [`Table`] and the mistakes [`Found`] so far. [`Fields`] reads the values of a table.
//! It notes every value of the wrong kind or out of range, and every key that was not asked for.

mod fields;
mod json;

use std::fmt;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

pub use fields::Fields;

use crate::lines;
use crate::mistakes::{MAX_MISTAKES, Mistake, Mistakes};

/// The maximum nesting of tables and lists. No file of ours needs more than four levels, and the reader is
/// recursive.
const MAX_DEPTH: usize = 16;

/// The longest text, in bytes, in which the reader continues after invalid TOML. Each invalid place takes
/// memory, and a text of many megabytes can consist only of such places. In a longer text only the first one
/// is reported.
const MAX_RECOVERED_BYTES: usize = 256 * 1024;

/// The keys and values of a table, in the order of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    at: usize,
    entries: Vec<Entry>,
}

#[derive(Clone, Debug, PartialEq)]
struct Entry {
    key: String,
    at: usize,
    value: Node,
}

impl Table {
    /// The byte offset of the table in the text.
    pub(crate) fn offset(&self) -> usize {
        self.at
    }

    /// The value of a key.
    #[must_use]
    pub fn value(&self, key: &str) -> Option<&Node> {
        self.entries.iter().find(|entry| entry.key == key).map(|entry| &entry.value)
    }
}

/// A value and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    at: usize,
    value: Value,
}

#[derive(Clone, Debug, PartialEq)]
enum Value {
    Text(String),
    Number(Number),
    Flag(bool),
    Date,
    Null,
    List(Vec<Node>),
    Table(Table),
    TooDeep,
}

/// A number as a whole number, as any number, and as written.
#[derive(Clone, Debug, PartialEq)]
struct Number {
    whole: Option<i64>,
    real: Option<f64>,
    written: String,
}

impl Node {
    /// The value as a text.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        if let Value::Text(text) = &self.value { Some(text) } else { None }
    }

    /// The value as a number, whole or not; infinity and `nan` are excluded.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        let Value::Number(number) = &self.value else { return None };
        number.real.filter(|number| number.is_finite())
    }

    /// The value as a whole number, in any notation.
    #[must_use]
    pub fn whole(&self) -> Option<i64> {
        if let Value::Number(number) = &self.value { number.whole } else { None }
    }

    /// The value as `true` or `false`.
    #[must_use]
    pub fn flag(&self) -> Option<bool> {
        if let Value::Flag(flag) = self.value { Some(flag) } else { None }
    }

    /// The values of a list.
    #[must_use]
    pub fn list(&self) -> Option<&[Node]> {
        if let Value::List(list) = &self.value { Some(list) } else { None }
    }

    /// The value as a table.
    #[must_use]
    pub fn table(&self) -> Option<&Table> {
        if let Value::Table(table) = &self.value { Some(table) } else { None }
    }
}

/// Displays a value in words; texts are quoted and cut.
impl fmt::Display for Node {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// Maximum length of a quote, in characters.
        const LONGEST_QUOTE: usize = 40;
        let quoted = |text: &str| text.chars().take(LONGEST_QUOTE).collect::<String>();
        match &self.value {
            Value::Text(text) => write!(f, "the text \"{}\"", quoted(text)),
            Value::Number(number) => f.write_str(&quoted(&number.written)),
            Value::Flag(flag) => flag.fmt(f),
            Value::Date => f.write_str("a date"),
            Value::Null => f.write_str("null"),
            Value::List(values) if values.is_empty() => f.write_str("an empty list"),
            Value::List(_) => f.write_str("a list"),
            Value::Table(_) => f.write_str("a table"),
            Value::TooDeep => write!(f, "nested more than {MAX_DEPTH} levels deep"),
        }
    }
}

/// A mistake at a place of a document, while the document is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wrong {
    /// Byte offset; `None` stands for the table that is being read.
    at: Option<usize>,
    what: String,
    advice: Option<String>,
    /// The missing key, if the mistake is a missing key.
    missing: Option<&'static str>,
}

impl Wrong {
    /// Adds advice.
    #[must_use]
    pub fn advise(mut self, advice: impl Into<String>) -> Self {
        self.advice = Some(advice.into());
        self
    }

    /// A mistake for a missing key. `due` says what the key needs.
    #[must_use]
    pub fn missing(key: &'static str, due: &str) -> Self {
        let what =
            if due.is_empty() { format!("`{key}` is missing") } else { format!("`{key}` is missing: {due}") };
        Self { missing: Some(key), ..Self::from(what) }
    }
}

impl<T: Into<String>> From<T> for Wrong {
    fn from(what: T) -> Self {
        Self { at: None, what: what.into(), advice: None, missing: None }
    }
}

/// The mistakes of a document so far, and hints for its author.
#[derive(Debug)]
pub struct Found<'t> {
    text: &'t str,
    wrong: Vec<Wrong>,
    more: usize,
    /// Old spellings that are still read: the byte offset, and what to write instead.
    hints: Vec<(usize, String)>,
    /// The lines with invalid TOML. Other mistakes there are only consequences.
    broken: Vec<usize>,
}

impl Found<'static> {
    /// The mistakes of a part that is read for itself, whose places do not count.
    pub(crate) fn aside() -> Self {
        Self { text: "", wrong: Vec::new(), more: 0, hints: Vec::new(), broken: Vec::new() }
    }
}

impl Found<'_> {
    /// Notes a mistake.
    pub fn note(&mut self, wrong: Wrong) {
        if self.is_full() {
            self.more += 1;
        } else {
            self.wrong.push(wrong);
        }
    }

    /// A hint about old spellings in the document: the first one, and how many more there are.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        let (at, today) = self.hints.iter().min_by_key(|(at, _)| *at)?;
        let (line, column) = lines::position(self.text, *at);
        let others = match self.hints.len() - 1 {
            0 => String::new(),
            1 => ", and once more in this file".to_owned(),
            others => format!(", and {others} times more in this file"),
        };
        Some(format!("{line}:{column}: an older spelling, which is still read: {today}{others}"))
    }

    /// Returns the result if there is no mistake.
    ///
    /// # Errors
    /// All mistakes that were noted.
    pub fn finish<T>(self, read: Option<T>) -> Result<T, Mistakes> {
        let placed = self.wrong.into_iter().map(|wrong| Mistake {
            at: wrong.at.map(|at| lines::position(self.text, at)),
            what: wrong.what,
            advice: wrong.advice,
        });
        match (Mistakes::new(placed.collect(), self.more), read) {
            (None, Some(read)) => Ok(read),
            (Some(mistakes), _) => Err(mistakes),
            (None, None) => Err(Mistake::of_the_file("it cannot be read", None).into()),
        }
    }

    /// Whether the list of mistakes is full. Further mistakes are only counted.
    fn is_full(&self) -> bool {
        self.wrong.len() >= MAX_MISTAKES
    }

    fn is_broken(&self, at: usize) -> bool {
        !self.broken.is_empty() && self.broken.contains(&lines::position(self.text, at).0)
    }
}

/// Reads a document. A document that begins with `{` is JSON. The reader notes invalid TOML and reads the
/// rest. It reads nothing of invalid JSON.
#[must_use]
pub fn parse(text: &str) -> (Table, Found<'_>) {
    let mut found = Found { text, wrong: Vec::new(), more: 0, hints: Vec::new(), broken: Vec::new() };
    if text.trim_start().starts_with('{') {
        let table = json::parse(text).unwrap_or_else(|(at, what)| {
            found.broken.push(lines::position(text, at).0);
            found.note(Wrong { at: Some(at), ..what.into() });
            Table::default()
        });
        return (table, found);
    }
    let (document, errors) = if text.len() <= MAX_RECOVERED_BYTES {
        DeTable::parse_recoverable(text)
    } else {
        match DeTable::parse(text) {
            Ok(document) => (document, Vec::new()),
            Err(error) => (Spanned::new(0..0, DeTable::new()), vec![error]),
        }
    };
    for error in errors {
        if found.is_full() {
            found.more += 1;
            continue;
        }
        let at = error.span().map_or(0, |span| span.start);
        let line = lines::position(text, at).0;
        // The parser often reports one mistake several times.
        if found.broken.last() == Some(&line) {
            continue;
        }
        found.broken.push(line);
        let what = error.message().lines().collect::<Vec<_>>().join(" ");
        found.note(Wrong { at: Some(at), ..what.into() });
    }
    (table(0, document.get_ref(), 0), found)
}

fn table(at: usize, table: &DeTable<'_>, depth: usize) -> Table {
    let mut entries: Vec<_> = table
        .iter()
        .map(|(key, value)| Entry {
            key: key.get_ref().to_string(),
            at: key.span().start,
            value: node(value, depth + 1),
        })
        .collect();
    entries.sort_by_key(|entry| entry.at);
    Table { at, entries }
}

fn node(value: &Spanned<DeValue<'_>>, depth: usize) -> Node {
    let at = value.span().start;
    let value = match value.get_ref() {
        DeValue::Array(_) | DeValue::Table(_) if depth > MAX_DEPTH => Value::TooDeep,
        DeValue::String(text) => Value::Text(text.to_string()),
        DeValue::Integer(integer) => {
            let whole = i64::from_str_radix(integer.as_str(), integer.radix()).ok();
            // Whole numbers in files are far below 2^53.
            #[expect(clippy::cast_precision_loss, reason = "a coordinate, speed or time without a point")]
            let real = whole.map(|whole| whole as f64);
            Value::Number(Number { whole, real, written: integer.to_string() })
        }
        DeValue::Float(float) => Value::Number(Number {
            whole: None,
            real: float.as_str().parse().ok(),
            written: float.as_str().to_owned(),
        }),
        DeValue::Boolean(flag) => Value::Flag(*flag),
        DeValue::Datetime(_) => Value::Date,
        DeValue::Array(values) => Value::List(values.iter().map(|value| node(value, depth + 1)).collect()),
        DeValue::Table(inner) => Value::Table(table(at, inner, depth)),
    };
    Node { at, value }
}

#[cfg(test)]
mod tests;
