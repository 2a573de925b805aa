//! Reads a TOML text field by field, so that every complaint names line, field and the value it wanted.

use std::fmt;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// No model file is longer, bytes: the longest of the product's own has 4 000.
const LONGEST: usize = 65_536;

/// A complaint quotes no more of the file, characters.
const LONGEST_QUOTE: usize = 40;

/// Words longer than this are not compared: the comparison is quadratic, and no field is near.
const LONGEST_COMPARED: usize = 64;

/// What is wrong with a model file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelError {
    /// The line, counted from 1; for a field that is missing, the line of the table that lacks it.
    pub line: usize,
    /// The field, such as `geometry.d1` or `J3.soft`; empty where the text is no TOML.
    pub field: String,
    /// What is wrong, and the value that was wanted.
    pub wanted: String,
}

impl fmt::Display for ModelError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.field.is_empty() {
            write!(f, "line {}: {}", self.line, self.wanted)
        } else {
            write!(f, "line {}, `{}`: {}", self.line, self.field, self.wanted)
        }
    }
}

impl std::error::Error for ModelError {}

/// The whole file; an error when it is no TOML.
pub(super) fn parse<T>(
    text: &str,
    read: impl FnOnce(Table<'_>) -> Result<T, ModelError>,
) -> Result<T, ModelError> {
    if text.len() > LONGEST {
        let wanted = format!("the file is longer than {LONGEST} bytes");
        return Err(ModelError { line: 1, field: String::new(), wanted });
    }
    let parsed = DeTable::parse(text).map_err(|error| ModelError {
        line: line_of(text, error.span().map_or(0, |span| span.start)),
        field: String::new(),
        wanted: error.message().trim_end().replace('\n', "; "),
    })?;
    read(Table { text, name: String::new(), at: 0, entries: parsed.get_ref() })
}

/// A table of the file.
pub(super) struct Table<'t> {
    text: &'t str,
    /// Its name with a dot behind it; empty for the file itself.
    name: String,
    at: usize,
    entries: &'t DeTable<'t>,
}

impl<'t> Table<'t> {
    /// An error when the table has a field that is none of these.
    pub(super) fn only(&self, known: &[&str]) -> Result<(), ModelError> {
        let mut keys: Vec<_> = self.entries.keys().collect();
        keys.sort_by_key(|key| key.span().start);
        let Some(key) = keys.into_iter().find(|key| !known.contains(&key.get_ref().as_ref())) else {
            return Ok(());
        };
        let word = key.get_ref().as_ref();
        let wanted = format!("there is no such field; {}", suggestion(word, known));
        Err(self.error(key.span().start, word, wanted))
    }

    /// A field that may be left out.
    pub(super) fn optional(&self, field: &str) -> Option<Value<'t>> {
        let value = self.entries.get(field)?;
        Some(Value { text: self.text, name: format!("{}{field}", self.name), value })
    }

    /// A field that has to be there; `wanted` says what it has to be.
    pub(super) fn required(&self, field: &str, wanted: &str) -> Result<Value<'t>, ModelError> {
        self.optional(field).ok_or_else(|| self.error(self.at, field, format!("is missing; wanted {wanted}")))
    }

    fn error(&self, at: usize, field: &str, wanted: String) -> ModelError {
        ModelError { line: line_of(self.text, at), field: format!("{}{field}", self.name), wanted }
    }
}

/// The value of a field.
pub(super) struct Value<'t> {
    text: &'t str,
    name: String,
    value: &'t Spanned<DeValue<'t>>,
}

impl<'t> Value<'t> {
    /// Its field's name.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// The same value under another name.
    pub(super) fn called(self, name: String) -> Self {
        Self { name, ..self }
    }

    /// The complaint that it is not what was wanted.
    pub(super) fn refuse(&self, wanted: &str) -> ModelError {
        let span = self.value.span();
        let found = self.text.get(span.clone()).unwrap_or_default();
        let mut quote: String =
            found.lines().next().unwrap_or_default().chars().take(LONGEST_QUOTE).collect();
        if quote.len() < found.len() {
            quote.push('…');
        }
        let wanted = format!("wanted {wanted}, found {quote}");
        ModelError { line: line_of(self.text, span.start), field: self.name.clone(), wanted }
    }

    /// A finite number for which `fits` holds.
    pub(super) fn number(&self, wanted: &str, fits: impl FnOnce(f64) -> bool) -> Result<f64, ModelError> {
        let number = match self.value.get_ref() {
            DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str().parse().ok(),
            DeValue::Float(float) => float.as_str().parse().ok(),
            _ => None,
        };
        number.filter(|n: &f64| n.is_finite() && fits(*n)).ok_or_else(|| self.refuse(wanted))
    }

    /// A text that is not empty.
    pub(super) fn text(&self, wanted: &str) -> Result<&'t str, ModelError> {
        self.value
            .get_ref()
            .as_str()
            .filter(|text| !text.trim().is_empty())
            .ok_or_else(|| self.refuse(wanted))
    }

    /// One of these words.
    pub(super) fn word<T: Copy>(&self, known: &[(&'static str, T)]) -> Result<T, ModelError> {
        let words: Vec<_> = known.iter().map(|(word, _)| *word).collect();
        let wanted = format!("one of {}", words.join(", "));
        let text = self.text(&wanted)?;
        known.iter().find(|(word, _)| *word == text).map(|(_, meaning)| *meaning).ok_or_else(|| {
            let near = nearest(text, &words).map(|near| format!(" (nearest: {near})")).unwrap_or_default();
            self.refuse(&format!("{wanted}{near}"))
        })
    }

    /// Its elements, each under its name with a number, counted from 1.
    pub(super) fn list(&self, wanted: &str) -> Result<Vec<Value<'t>>, ModelError> {
        let list = self.value.get_ref().as_array().ok_or_else(|| self.refuse(wanted))?;
        let name = |n: usize| format!("{}.{}", self.name, n + 1);
        Ok(list
            .iter()
            .enumerate()
            .map(|(n, value)| Value { text: self.text, name: name(n), value })
            .collect())
    }

    /// A table.
    pub(super) fn table(&self, wanted: &str) -> Result<Table<'t>, ModelError> {
        let entries = self.value.get_ref().as_table().ok_or_else(|| self.refuse(wanted))?;
        Ok(Table { text: self.text, name: format!("{}.", self.name), at: self.value.span().start, entries })
    }
}

fn line_of(text: &str, at: usize) -> usize {
    1 + text.bytes().take(at).filter(|byte| *byte == b'\n').count()
}

/// What may have been meant by a word that is none of these.
pub(super) fn suggestion(word: &str, known: &[&str]) -> String {
    match nearest(word, known) {
        Some(near) => format!("nearest: `{near}`"),
        None => format!("there are: {}", known.join(", ")),
    }
}

fn nearest<'k>(word: &str, known: &[&'k str]) -> Option<&'k str> {
    if word.len() > LONGEST_COMPARED {
        return None;
    }
    let word = word.to_lowercase();
    known
        .iter()
        .map(|known| (strsim::damerau_levenshtein(&word, &known.to_lowercase()), *known))
        .min_by_key(|(distance, _)| *distance)
        // About one wrong letter in three is forgiven.
        .filter(|(distance, known)| distance * 3 <= known.len().max(word.len()))
        .map(|(_, known)| known)
}
