//! The fields of one table, each read by name. No key is overlooked.

use std::cell::RefCell;
use std::ops::RangeInclusive;

use r6_proto::RegisterIndex;
use r6_proto::io_point::{IoPoint, PointKind};

use super::{Entry, Found, Node, Table, Value, Wrong};
use crate::mistakes::MAX_MISTAKES;

/// A table whose fields are read by name.
///
/// A wrong value is noted and then counts as absent, so that the rest of the table is read.
/// [`Fields::finish`] returns a result only if nothing was noted.
#[derive(Debug)]
pub struct Fields<'d> {
    table: &'d Table,
    /// Every key that a table of this sort can have. If it is empty, the keys that the code asks for are
    /// known.
    known: &'d [&'static str],
    /// The prefix of each mistake, which names the table: `instruction 3: `.
    label: String,
    asked: RefCell<Vec<&'static str>>,
    noted: RefCell<Vec<Wrong>>,
    hints: RefCell<Vec<(usize, String)>>,
}

impl<'d> Fields<'d> {
    /// The fields of a table. `known` has every key of tables of this sort; `label` is the prefix of each
    /// mistake.
    #[must_use]
    pub fn of(table: &'d Table, known: &'d [&'static str], label: impl Into<String>) -> Self {
        Self {
            table,
            known,
            label: label.into(),
            asked: RefCell::default(),
            noted: RefCell::default(),
            hints: RefCell::default(),
        }
    }

    /// Notes an old spelling, of a key or because a key is absent. `today` is what to write instead.
    pub fn older(&self, name: &str, today: impl Into<String>) {
        let at = self.table.value(name).map_or(self.table.at, |value| value.at);
        self.hints.borrow_mut().push((at, today.into()));
    }

    fn note(&self, wrong: Wrong) {
        self.noted.borrow_mut().push(wrong);
    }

    fn at(&self, name: &str, what: impl Into<String>) -> Wrong {
        Wrong { at: self.table.value(name).map(|value| value.at), ..Wrong::from(what) }
    }

    /// Notes a wrong value of a key. The returned value ends the reading of the table and adds no other
    /// mistake.
    pub fn wrong(&self, name: &str, what: impl Into<String>) -> Wrong {
        self.note(self.at(name, what));
        Wrong::from("")
    }

    /// Whether the table has the key, without reading it.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.table.value(name).is_some()
    }

    /// The value of a key.
    pub fn value(&self, name: &'static str) -> Option<&'d Node> {
        let mut asked = self.asked.borrow_mut();
        if !asked.contains(&name) {
            asked.push(name);
        }
        self.table.value(name)
    }

    /// Reads a value with `read`; `wanted` says what a valid value is. An invalid value is noted.
    pub fn optional<T>(
        &self,
        name: &'static str,
        wanted: &str,
        read: impl FnOnce(&'d Node) -> Option<T>,
    ) -> Option<T> {
        let value = self.value(name)?;
        let read = read(value);
        if read.is_none() {
            self.note(self.at(name, format!("`{name}` is {value}, but has to be {wanted}")));
        }
        read
    }

    /// Requires a value. A missing key is noted, unless the key is present and already noted as wrong.
    ///
    /// # Errors
    /// The value is `None`: the reading of the table ends.
    pub fn required<T>(&self, name: &'static str, value: Option<T>) -> Result<T, Wrong> {
        value.ok_or_else(|| {
            self.note(Wrong::missing(name, ""));
            Wrong::from("")
        })
    }

    /// Reads a required value with `read`; `wanted` says what a valid value is.
    ///
    /// # Errors
    /// The value is absent or invalid: the reading of the table ends.
    pub fn due<T>(
        &self,
        name: &'static str,
        wanted: &str,
        read: impl FnOnce(&'d Node) -> Option<T>,
    ) -> Result<T, Wrong> {
        let is_there = self.has(name);
        self.optional(name, wanted, read).ok_or_else(|| {
            if !is_there {
                self.note(Wrong::missing(name, wanted));
            }
            Wrong::from("")
        })
    }

    /// Reads any number.
    pub fn number(&self, name: &'static str) -> Option<f64> {
        self.optional(name, "a number", Node::number)
    }

    /// Reads a number within a range; `wanted` describes the range.
    pub fn number_in(&self, name: &'static str, wanted: &str, range: RangeInclusive<f64>) -> Option<f64> {
        self.optional(name, wanted, |value| value.number().filter(|number| range.contains(number)))
    }

    /// Reads a whole number from 0 to `last`.
    pub fn whole<T: TryFrom<i64> + PartialOrd + Default + std::fmt::Display>(
        &self,
        name: &'static str,
        last: T,
    ) -> Option<T> {
        let wanted = format!("a whole number from 0 to {last}");
        self.whole_in(name, &wanted, T::default()..=last)
    }

    /// Reads a whole number within a range; `wanted` describes the range.
    pub fn whole_in<T: TryFrom<i64> + PartialOrd>(
        &self,
        name: &'static str,
        wanted: &str,
        range: RangeInclusive<T>,
    ) -> Option<T> {
        self.optional(name, wanted, |value| whole_in(value, &range))
    }

    /// Reads a required whole number within a range; `wanted` describes the range.
    ///
    /// # Errors
    /// The value is absent or out of range: the reading of the table ends.
    pub fn due_in<T: TryFrom<i64> + PartialOrd>(
        &self,
        name: &'static str,
        wanted: &str,
        range: RangeInclusive<T>,
    ) -> Result<T, Wrong> {
        self.due(name, wanted, |value| whole_in(value, &range))
    }

    /// Reads a text.
    pub fn text(&self, name: &'static str, wanted: &str) -> Option<&'d str> {
        self.optional(name, wanted, Node::text)
    }

    /// Reads a point by its name on the pendant, of one of these kinds; `wanted` describes the kinds.
    pub fn point(&self, name: &'static str, wanted: &str, kinds: &[PointKind]) -> Option<IoPoint> {
        self.optional(name, &as_the_pendant_names_it(wanted), |value| point(value, kinds))
    }

    /// Reads a required point by its name on the pendant.
    ///
    /// # Errors
    /// The value is absent or of another kind: the reading of the table ends.
    pub fn due_point(&self, name: &'static str, wanted: &str, kinds: &[PointKind]) -> Result<IoPoint, Wrong> {
        self.due(name, &as_the_pendant_names_it(wanted), |value| point(value, kinds))
    }

    /// Reads a register.
    pub fn register(&self, name: &'static str) -> Option<RegisterIndex> {
        self.optional(name, A_REGISTER, register)
    }

    /// Reads a required register.
    ///
    /// # Errors
    /// The value is absent or not a register: the reading of the table ends.
    pub fn due_register(&self, name: &'static str) -> Result<RegisterIndex, Wrong> {
        self.due(name, A_REGISTER, register)
    }

    /// Reads a required `true` or `false`.
    ///
    /// # Errors
    /// The value is absent or something else: the reading of the table ends.
    pub fn due_flag(&self, name: &'static str) -> Result<bool, Wrong> {
        self.due(name, "true or false", Node::flag)
    }

    /// Reads one of these words, which is required.
    ///
    /// # Errors
    /// The value is absent or another word: the reading of the table ends.
    pub fn due_word<T: Copy>(&self, name: &'static str, words: &[(&'static str, T)]) -> Result<T, Wrong> {
        if self.has(name) {
            return self.word(name, words).ok_or_else(|| Wrong::from(""));
        }
        self.due(name, &one_of(words), |_| None)
    }

    /// Reads `true` or `false`.
    pub fn flag(&self, name: &'static str) -> Option<bool> {
        self.optional(name, "true or false", Node::flag)
    }

    /// Reads numbers in brackets.
    pub fn numbers(&self, name: &'static str) -> Option<Vec<f64>> {
        self.optional(name, "numbers in brackets, such as [10, -20.5]", |value| {
            value.list()?.iter().map(Node::number).collect()
        })
    }

    /// Reads one of these words.
    pub fn word<T: Copy>(&self, name: &'static str, words: &[(&'static str, T)]) -> Option<T> {
        let wanted = one_of(words);
        let Some(word) = self.value(name).and_then(Node::text) else {
            return self.optional(name, &wanted, |_| None);
        };
        let meant = words.iter().find(|(known, _)| *known == word).map(|(_, meant)| *meant);
        if meant.is_none() {
            let word: String = word.chars().take(40).collect();
            let near = r6_proto::nearest(&word, words.iter().map(|(word, _)| *word));
            self.note(match near {
                // A long list of words would hide the nearest one.
                Some(near) if words.len() > MOST_WORDS => self
                    .at(name, format!("`{name}` is \"{word}\", which means nothing here"))
                    .advise(format!("nearest: \"{near}\"")),
                Some(near) => self
                    .at(name, format!("`{name}` is \"{word}\", but has to be {wanted}"))
                    .advise(format!("nearest: \"{near}\"")),
                None => self.at(name, format!("`{name}` is \"{word}\", but has to be {wanted}")),
            });
        }
        meant
    }

    /// The tables of a list `[[name]]`; empty if the key is absent.
    pub fn tables(&self, name: &'static str) -> Vec<&'d Table> {
        let Some(value) = self.value(name) else { return Vec::new() };
        let Some(list) = value.list() else {
            let what = format!("`{name}` is written as [[{name}]], in two pairs of brackets");
            self.note(self.at(name, what));
            return Vec::new();
        };
        let mut tables = Vec::with_capacity(list.len());
        for (number, node) in list.iter().enumerate() {
            match &node.value {
                Value::Table(table) => tables.push(table),
                _ => self.note(Wrong {
                    at: Some(node.at),
                    ..format!("{name} {} is {node}, but has to be a table [[{name}]]", number + 1).into()
                }),
            }
        }
        tables
    }

    /// Returns the result if the table has no mistake. Moves the mistakes to `found`: the noted mistakes, the
    /// mistake that ended the reading, and the keys without a meaning.
    pub fn finish<T>(self, read: Result<T, Wrong>, found: &mut Found<'_>) -> Option<T> {
        self.finish_with(read, found, |_| None)
    }

    /// Like [`Fields::finish`]. `advice` can give advice for an unknown key.
    pub fn finish_with<T>(
        self,
        read: Result<T, Wrong>,
        found: &mut Found<'_>,
        advice: impl Fn(&str) -> Option<String>,
    ) -> Option<T> {
        let asked = self.asked.into_inner();
        let known = if self.known.is_empty() { asked.as_slice() } else { self.known };
        // A table whose kind is known has fewer keys than all tables of this sort.
        let listed = if read.is_ok() && !asked.is_empty() { asked.as_slice() } else { known };
        let mut noted = self.noted.into_inner();
        let mut meant = Vec::new();
        let mut unlisted = false;
        for Entry { key, at, .. } in &self.table.entries {
            let is_known = known.contains(&key.as_str());
            if !is_known && (found.is_full() || noted.len() > MAX_MISTAKES) {
                // The search for the nearest word takes time, so it is skipped for mistakes that are not
                // listed.
                found.more += 1;
                unlisted = true;
            } else if !is_known {
                let near = r6_proto::nearest(key, known.iter().copied());
                meant.push(near);
                let advice = advice(key)
                    .or_else(|| near.map(|near| format!("nearest: `{near}`")))
                    .unwrap_or_else(|| format!("there are: {}", listed.join(", ")));
                let key: String = key.chars().take(40).collect();
                noted.push(Wrong {
                    at: Some(*at),
                    ..Wrong::from(format!("there is no key `{key}`")).advise(advice)
                });
            } else if read.is_ok() && !asked.contains(&key.as_str()) {
                let used: Vec<_> = asked.iter().copied().filter(|name| *name != "do").collect();
                let what =
                    format!("`{key}` has no meaning here; the keys that are used here: {}", used.join(", "));
                noted.push(Wrong { at: Some(*at), ..what.into() });
            }
        }
        // If a key is misspelt, its absence is not a second mistake.
        noted.retain(|wrong| match wrong.missing {
            Some(name) => self.table.value(name).is_none() && !meant.contains(&Some(name)),
            None => true,
        });
        let read = match read {
            Ok(read) => Some(read),
            Err(wrong) => {
                // The mistake that ended the reading may be noted already.
                if noted.is_empty() && !wrong.what.is_empty() {
                    noted.push(wrong);
                }
                None
            }
        };
        let good = noted.is_empty() && !unlisted;
        found.hints.append(&mut self.hints.into_inner());
        for mut wrong in noted {
            // After a line of invalid TOML, values can seem absent although the file has them.
            if found.is_full() {
                found.more += 1;
                continue;
            }
            let follows = wrong.at.map_or(!found.broken.is_empty(), |at| found.is_broken(at));
            if follows {
                continue;
            }
            wrong.at = wrong.at.or(Some(self.table.at));
            wrong.what.insert_str(0, &self.label);
            found.note(wrong);
        }
        read.filter(|_| good)
    }
}

/// The maximum number of words to list when there is a nearest one.
const MOST_WORDS: usize = 10;

const A_REGISTER: &str = "a register, 800 to 900";

fn register(value: &Node) -> Option<RegisterIndex> {
    u16::try_from(value.whole()?).ok().and_then(RegisterIndex::new)
}

fn whole_in<T: TryFrom<i64> + PartialOrd>(value: &Node, range: &RangeInclusive<T>) -> Option<T> {
    value.whole().and_then(|whole| T::try_from(whole).ok()).filter(|whole| range.contains(whole))
}

fn as_the_pendant_names_it(wanted: &str) -> String {
    format!("{wanted}, as the pendant names it (octal, 010 to 047; on board 1 with 1. before that)")
}

fn point(value: &Node, kinds: &[PointKind]) -> Option<IoPoint> {
    value.text()?.parse::<IoPoint>().ok().filter(|point| kinds.contains(&point.kind))
}

fn one_of<T>(words: &[(&'static str, T)]) -> String {
    let quoted: Vec<_> = words.iter().map(|(word, _)| format!("\"{word}\"")).collect();
    format!("one of {}", quoted.join(", "))
}
