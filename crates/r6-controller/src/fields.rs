//! The fields of one table of a file, each read once, none overlooked.

use std::cell::RefCell;

use r6_proto::RegisterIndex;
use r6_proto::io_point::{IoPoint, PointKind};
use toml::{Table, Value};

/// A table whose fields are asked for by name.
pub(crate) struct Fields<'t> {
    table: &'t Table,
    asked: RefCell<Vec<&'static str>>,
}

impl<'t> Fields<'t> {
    pub(crate) fn of(table: &'t Table) -> Self {
        Self { table, asked: RefCell::new(Vec::new()) }
    }

    fn value(&self, name: &'static str) -> Option<&'t Value> {
        self.asked.borrow_mut().push(name);
        self.table.get(name)
    }

    /// A field read by `read`, which says what it wants otherwise.
    pub(crate) fn optional<T>(
        &self,
        name: &'static str,
        wanted: &str,
        read: impl FnOnce(&'t Value) -> Option<T>,
    ) -> Result<Option<T>, String> {
        let Some(value) = self.value(name) else { return Ok(None) };
        match read(value) {
            Some(read) => Ok(Some(read)),
            None => Err(format!("`{name}` has to be {wanted}, not {}", shown(value))),
        }
    }

    pub(crate) fn required<T>(
        &self,
        name: &'static str,
        wanted: &str,
        read: impl FnOnce(&'t Value) -> Option<T>,
    ) -> Result<T, String> {
        self.optional(name, wanted, read)?.ok_or_else(|| format!("`{name}` is missing: {wanted}"))
    }

    /// Whether the table has it, without reading it.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.table.contains_key(name)
    }

    /// An error where the table has a field that nobody asked for.
    pub(crate) fn nothing_else(&self) -> Result<(), String> {
        let asked = self.asked.borrow();
        let Some(stray) = self.table.keys().find(|key| !asked.contains(&key.as_str())) else { return Ok(()) };
        Err(match r6_proto::nearest(stray, asked.iter().copied()) {
            Some(near) => format!("`{stray}` means nothing here; nearest: `{near}`"),
            None => format!("`{stray}` means nothing here; there are: {}", asked.join(", ")),
        })
    }

    /// A number within a range.
    pub(crate) fn number(
        &self,
        name: &'static str,
        wanted: &str,
        range: std::ops::RangeInclusive<f64>,
    ) -> Result<Option<f64>, String> {
        self.optional(name, wanted, |value| number(value).filter(|number| range.contains(number)))
    }

    /// A whole number within a range.
    pub(crate) fn whole<T: TryFrom<i64> + PartialOrd>(
        &self,
        name: &'static str,
        wanted: &str,
        range: std::ops::RangeInclusive<T>,
    ) -> Result<Option<T>, String> {
        self.optional(name, wanted, |value| {
            value.as_integer().and_then(|whole| T::try_from(whole).ok()).filter(|whole| range.contains(whole))
        })
    }

    pub(crate) fn flag(&self, name: &'static str) -> Result<Option<bool>, String> {
        self.optional(name, "true or false", Value::as_bool)
    }

    pub(crate) fn text(&self, name: &'static str, wanted: &str) -> Result<Option<&'t str>, String> {
        self.optional(name, wanted, Value::as_str)
    }

    /// One of these words.
    pub(crate) fn word<T: Copy>(&self, name: &'static str, words: &[(&str, T)]) -> Result<Option<T>, String> {
        let there: Vec<_> = words.iter().map(|(word, _)| *word).collect();
        let Some(word) = self.text(name, &there.join(", "))? else { return Ok(None) };
        match words.iter().find(|(known, _)| *known == word) {
            Some((_, meant)) => Ok(Some(*meant)),
            None => Err(unknown(name, word, &there)),
        }
    }

    /// One of these words, which has to be there.
    pub(crate) fn one_of<T: Copy>(&self, name: &'static str, words: &[(&str, T)]) -> Result<T, String> {
        let there: Vec<_> = words.iter().map(|(word, _)| *word).collect();
        self.word(name, words)?.ok_or_else(|| format!("`{name}` is missing: {}", there.join(", ")))
    }

    /// A list of numbers, as many as one of `counts` says.
    pub(crate) fn numbers(&self, name: &'static str, counts: &[usize]) -> Result<Option<Vec<f64>>, String> {
        let said: Vec<_> = counts.iter().map(ToString::to_string).collect();
        let wanted = format!("{} finite numbers", said.join(" or "));
        self.optional(name, &wanted, |value| {
            let list: Option<Vec<_>> = value.as_array()?.iter().map(number).collect();
            list.filter(|list| counts.contains(&list.len()) && list.iter().all(|number| near(*number)))
        })
    }

    /// A point by its name, such as `X010`, of one of these kinds.
    pub(crate) fn point(&self, name: &'static str, kinds: &[PointKind]) -> Result<Option<IoPoint>, String> {
        let prefixes: Vec<_> = kinds.iter().map(|kind| kind.letters()).collect();
        let wanted =
            format!("a point as the pendant names it, {} and octal 010 to 047", prefixes.join(" or "));
        self.optional(name, &wanted, |value| {
            value.as_str()?.parse::<IoPoint>().ok().filter(|point| kinds.contains(&point.kind))
        })
    }

    pub(crate) fn register(&self, name: &'static str) -> Result<Option<RegisterIndex>, String> {
        self.optional(name, "a register, 800 to 900", |value| {
            u16::try_from(value.as_integer()?).ok().and_then(RegisterIndex::new)
        })
    }

    /// A list of points by their names.
    pub(crate) fn points(&self, name: &'static str, kinds: &[PointKind]) -> Result<Vec<IoPoint>, String> {
        let read = |value: &Value| {
            let point = value.as_str()?.parse::<IoPoint>().ok()?;
            kinds.contains(&point.kind).then_some(point)
        };
        let wanted = "a list of points of one board, such as [\"Y010\", \"Y011\"]";
        let found = self.optional(name, wanted, |value| value.as_array()?.iter().map(read).collect())?;
        Ok(found.unwrap_or_default())
    }
}

/// The text as a table, whichever of the two it is.
pub(crate) fn table(text: &str) -> Result<Table, String> {
    if text.trim_start().starts_with('{') {
        return serde_json::from_str(text).map_err(|error| format!("no JSON: {error}"));
    }
    text.parse::<Table>().map_err(|error| {
        let line = error
            .span()
            .map_or(1, |span| 1 + text.get(..span.start).unwrap_or_default().matches('\n').count());
        format!("no TOML: line {line}: {}", error.message().replace('\n', " "))
    })
}

/// A list of tables.
pub(crate) fn tables(value: &Value) -> Option<Vec<&Table>> {
    value.as_array()?.iter().map(Value::as_table).collect()
}

/// What to say of a word that is none of these.
pub(crate) fn unknown(field: &str, word: &str, known: &[&str]) -> String {
    match r6_proto::nearest(word, known.iter().copied()) {
        Some(near) => format!("`{field} = \"{word}\"` is not known; nearest: `{near}`"),
        None => format!("`{field} = \"{word}\"` is not known; there are: {}", known.join(", ")),
    }
}

fn number(value: &Value) -> Option<f64> {
    // A program's whole numbers are far below 2^53.
    #[expect(clippy::cast_precision_loss, reason = "a coordinate, speed or time written without a point")]
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

/// Whether a number is finite and anything an arm could be told.
fn near(number: f64) -> bool {
    (-1e6..=1e6).contains(&number)
}

/// A value as a complaint shows it: never more than a line of it.
fn shown(value: &Value) -> String {
    /// Enough to recognise it.
    const MOST: usize = 60;
    let text = value.to_string().replace('\n', " ");
    if text.chars().count() <= MOST { text } else { text.chars().take(MOST).chain("…".chars()).collect() }
}
