//! Checks the form of a TOML program before it is read: every complaint names line, key, and the value it wanted.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::super::{FileError, lines};
use super::syntax;

/// What a key wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wanted {
    /// A number, whole or not.
    Number,
    /// A whole number from 0 up to this.
    Whole(u32),
    /// `true` or `false`.
    Flag,
    /// One of these words.
    Word(&'static [&'static str]),
    /// Numbers in brackets.
    Numbers,
    /// Whole numbers from 0 up to this, in brackets.
    Wholes(u32),
    /// A mask, as a number or as a text.
    Mask,
    /// A point, as a whole number from 0 up to this or as a text.
    Point(u32),
}

/// The keys of the file itself, `instruction` apart.
const FILE_KEYS: [(&str, Wanted); 2] = [("repeat", Wanted::Flag), ("append", Wanted::Flag)];

/// The table that a program consists of.
const INSTRUCTION: &str = "instruction";

/// Checks every key of the file and of its instructions.
pub fn check(text: &str) -> Result<(), FileError> {
    let file = DeTable::parse(text).map_err(|error| syntax(text, &error))?;
    let names: Vec<_> = FILE_KEYS.iter().map(|(name, _)| *name).chain([INSTRUCTION]).collect();
    let place = Place { text, number: None };
    for (key, value) in in_order(file.get_ref()) {
        match FILE_KEYS.iter().find(|(name, _)| *name == key.get_ref().as_ref()) {
            Some((name, wanted)) => place.check(name, value, *wanted)?,
            None if key.get_ref().as_ref() == INSTRUCTION => check_instructions(text, value)?,
            None => {
                // It may be the key of an instruction, above the first of them.
                let is_step = super::step::KEYS.iter().any(|(name, _)| *name == key.get_ref().as_ref());
                let advice = is_step.then(|| "it belongs below a line [[instruction]]".to_owned());
                return Err(place.unknown(key, &names, advice));
            }
        }
    }
    Ok(())
}

/// The keys of a table as they stand in the file.
fn in_order<K, V>(table: &toml::map::Map<Spanned<K>, V>) -> Vec<(&Spanned<K>, &V)>
where
    K: Ord + std::hash::Hash,
{
    let mut entries: Vec<_> = table.iter().collect();
    entries.sort_by_key(|(key, _)| key.span().start);
    entries
}

fn check_instructions(text: &str, value: &Spanned<DeValue<'_>>) -> Result<(), FileError> {
    let steps =
        value.get_ref().as_array().map(|steps| steps.iter().enumerate()).ok_or_else(|| FileError {
            at: Some(lines::position(text, value.span().start)),
            what: "an instruction is written as [[instruction]], in two pairs of brackets".to_owned(),
            advice: None,
        })?;
    let names: Vec<_> = super::step::KEYS.iter().map(|(name, _)| *name).collect();
    for (index, step) in steps {
        let place = Place { text, number: Some(index + 1) };
        let Some(keys) = step.get_ref().as_table() else {
            let what =
                format!("instruction {} is {}, but has to be a table [[instruction]]", index + 1, kind(step));
            return Err(FileError { at: Some(lines::position(text, step.span().start)), what, advice: None });
        };
        for (key, value) in in_order(keys) {
            match super::step::KEYS.iter().find(|(name, _)| *name == key.get_ref().as_ref()) {
                Some((name, wanted)) => place.check(name, value, *wanted)?,
                None => return Err(place.unknown(key, &names, None)),
            }
        }
        if !keys.contains_key("do") {
            let what = format!("instruction {}: `do` is missing: what it does", index + 1);
            let advice = Some("such as do = \"axis-move\"".to_owned());
            return Err(FileError { at: Some(lines::position(text, step.span().start)), what, advice });
        }
    }
    Ok(())
}

/// Where a key stands.
#[derive(Clone, Copy)]
struct Place<'t> {
    text: &'t str,
    /// The instruction, counted from 1; `None` for the file itself.
    number: Option<usize>,
}

impl Place<'_> {
    fn error(&self, at: usize, what: String, advice: Option<String>) -> FileError {
        let what = match self.number {
            Some(number) => format!("instruction {number}: {what}"),
            None => what,
        };
        FileError { at: Some(lines::position(self.text, at)), what, advice }
    }

    fn unknown<K: AsRef<str>>(
        &self,
        key: &Spanned<K>,
        names: &[&'static str],
        advice: Option<String>,
    ) -> FileError {
        let word = key.get_ref().as_ref();
        let near = || r6_proto::nearest(word, names.iter().copied()).map(|near| format!("nearest: `{near}`"));
        let taught = || {
            let taught = self.number.is_none() && matches!(word, "step" | "stack" | "counter");
            taught.then(|| {
                "a taught program runs on the controller: `r6 sim --program FILE`, or `r6 panel load FILE` \
                 (docs/PROGRAMS.md)"
                    .to_owned()
            })
        };
        let advice =
            advice.or_else(taught).or_else(near).or_else(|| Some(format!("there are: {}", names.join(", "))));
        self.error(key.span().start, format!("there is no key `{word}`"), advice)
    }

    fn check(&self, name: &str, value: &Spanned<DeValue<'_>>, wanted: Wanted) -> Result<(), FileError> {
        let at = value.span().start;
        if let Wanted::Word(words) = wanted
            && let Some(word) = value.get_ref().as_str()
            && !words.contains(&word)
        {
            let near = r6_proto::nearest(word, words.iter().copied());
            let advice = near.map(|near| format!("nearest: \"{near}\""));
            let what = format!("`{name}` is \"{word}\", but has to be {}", wanted.text());
            return Err(self.error(at, what, advice));
        }
        if wanted.takes(value.get_ref()) {
            return Ok(());
        }
        Err(self.error(at, format!("`{name}` is {}, but has to be {}", kind(value), wanted.text()), None))
    }
}

impl Wanted {
    /// Whether a value is what is wanted.
    fn takes(self, value: &DeValue<'_>) -> bool {
        match self {
            Self::Number => number(value).is_some(),
            Self::Whole(last) => whole(value).is_some_and(|value| value <= u64::from(last)),
            Self::Flag => value.is_bool(),
            Self::Word(words) => value.as_str().is_some_and(|word| words.contains(&word)),
            Self::Numbers => {
                value.as_array().is_some_and(|all| all.iter().all(|one| number(one.get_ref()).is_some()))
            }
            Self::Wholes(last) => value
                .as_array()
                .is_some_and(|all| all.iter().all(|one| Self::Whole(last).takes(one.get_ref()))),
            Self::Mask => value.is_str() || Self::Whole(255).takes(value),
            Self::Point(last) => value.is_str() || Self::Whole(last).takes(value),
        }
    }

    /// What is wanted, in words.
    fn text(self) -> String {
        match self {
            Self::Number => "a number".to_owned(),
            Self::Whole(u32::MAX) => "a whole number from 0".to_owned(),
            Self::Whole(last) => format!("a whole number from 0 to {last}"),
            Self::Flag => "true or false".to_owned(),
            Self::Word(words) => {
                let quoted: Vec<_> = words.iter().map(|word| format!("\"{word}\"")).collect();
                format!("one of {}", quoted.join(", "))
            }
            Self::Numbers => "numbers in brackets, such as [10, -20.5]".to_owned(),
            Self::Wholes(last) => format!("whole numbers from 0 to {last} in brackets, such as [1, 2]"),
            Self::Mask => "a mask such as 0x3F or \"0x3F\"".to_owned(),
            Self::Point(last) => format!("a whole number from 0 to {last}, or a name such as \"Y010\""),
        }
    }
}

/// Any number.
fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(_) => whole_or_negative(value),
        DeValue::Float(float) => float.as_str().parse().ok(),
        DeValue::String(_)
        | DeValue::Boolean(_)
        | DeValue::Datetime(_)
        | DeValue::Array(_)
        | DeValue::Table(_) => None,
    }
}

fn whole_or_negative(value: &DeValue<'_>) -> Option<f64> {
    let integer = value.as_integer()?;
    i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|_| 0.0)
}

/// A whole number from 0, in any notation.
fn whole(value: &DeValue<'_>) -> Option<u64> {
    let integer = value.as_integer()?;
    u64::from_str_radix(integer.as_str(), integer.radix()).ok()
}

/// What a value is, in words; numbers and words are quoted.
fn kind(value: &Spanned<DeValue<'_>>) -> String {
    /// What is quoted of a text, characters.
    const LONGEST_QUOTE: usize = 40;
    match value.get_ref() {
        DeValue::String(text) => {
            format!("the text \"{}\"", text.chars().take(LONGEST_QUOTE).collect::<String>())
        }
        DeValue::Integer(integer) => integer.to_string(),
        DeValue::Float(float) => float.as_str().to_owned(),
        DeValue::Boolean(flag) => flag.to_string(),
        DeValue::Datetime(_) => "a date".to_owned(),
        DeValue::Array(values) if values.is_empty() => "an empty list".to_owned(),
        DeValue::Array(_) => "a list".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The complaint about an instruction with this line: line, what, advice.
    fn complaint(line: &str) -> (usize, String, String) {
        let error = check(&format!("[[instruction]]\ndo = \"axis-move\"\n{line}\n")).unwrap_err();
        (error.at.unwrap().0, error.what, error.advice.unwrap_or_default())
    }

    #[test]
    fn wrong_values_are_told_in_words() {
        for (line, what) in [
            ("speed = \"fast\"", "`speed` is the text \"fast\", but has to be a number"),
            ("blend = 2.5", "`blend` is 2.5, but has to be a whole number from 0 to 9"),
            ("blend = -1", "`blend` is -1, but has to be a whole number from 0 to 9"),
            ("to = 5", "`to` is 5, but has to be numbers in brackets, such as [10, -20.5]"),
            ("to = [1, \"2\"]", "`to` is a list, but has to be numbers in brackets, such as [10, -20.5]"),
            ("on = 1", "`on` is 1, but has to be true or false"),
            ("mask = []", "`mask` is an empty list, but has to be a mask such as 0x3F or \"0x3F\""),
            ("mask = 0x1FF", "`mask` is 0x1FF, but has to be a mask such as 0x3F or \"0x3F\""),
            (
                "until = true",
                "`until` is true, but has to be one of \"on\", \"off\", \"rising\", \"falling\"",
            ),
            (
                "set = [300]",
                "`set` is a list, but has to be whole numbers from 0 to 31 in brackets, such as [1, 2]",
            ),
            ("number = 2026-01-01", "`number` is a date, but has to be a whole number from 0"),
        ] {
            let found = complaint(line);
            assert_eq!((found.0, found.1.as_str()), (3, format!("instruction 1: {what}").as_str()), "{line}");
        }
    }

    #[test]
    fn wrong_words_and_keys_have_their_nearest() {
        let (line, what, advice) = complaint("sped = 5");
        assert_eq!(
            (line, what.as_str(), advice.as_str()),
            (3, "instruction 1: there is no key `sped`", "nearest: `speed`")
        );
        let (_, what, advice) = complaint("source = \"inputs\"");
        assert_eq!(
            what,
            "instruction 1: `source` is \"inputs\", but has to be one of \"input\", \"m\", \"eu\""
        );
        assert_eq!(advice, "nearest: \"input\"");
        let error = check("speed = 5\n[[instruction]]\ndo = \"wait\"").unwrap_err();
        assert_eq!((error.at, error.what.as_str()), (Some((1, 1)), "there is no key `speed`"));
        assert_eq!(error.advice.as_deref(), Some("it belongs below a line [[instruction]]"));
        let error = check("[instruction]\ndo = \"wait\"").unwrap_err();
        assert!(error.what.contains("two pairs of brackets"), "{}", error.what);
        let error = check("instruction = [5]").unwrap_err();
        assert_eq!(error.what, "instruction 1 is 5, but has to be a table [[instruction]]");
        let error = check("\n[[instruction]]\nto = [1]").unwrap_err();
        assert_eq!(
            (error.at.unwrap().0, error.what.as_str()),
            (2, "instruction 1: `do` is missing: what it does")
        );
        assert_eq!(check("repeat = 1").unwrap_err().what, "`repeat` is 1, but has to be true or false");
    }

    #[test]
    fn good_values_pass() {
        let text = "repeat = true\n[[instruction]]\ndo = \"axis-move\"\nto = [1, -2.5, 1e2, +3]\nspeed = 20\nmask = 0x3F\n\
                    [[instruction]]\ndo = \"output\"\npoint = 3\non = false\nmask = \"0x01\"\nset = []\nnumber = 70000";
        assert_eq!(check(text), Ok(()));
    }
}
