//! Golden vectors: one frame each, what it means, and what encoding it again must write.
//!
//! A vector is a JSON file below `vectors/messages/`, read by the tests of every language;
//! `vectors/README.md` says what its members mean. A member that is not known, or that contradicts another,
//! is an error.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;

use crate::workspace;

/// Which way a frame goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// From the PC to the controller.
    ToController,
    /// From the controller to the PC.
    FromController,
}

/// One golden vector.
#[derive(Debug, Clone, PartialEq)]
pub struct Vector {
    /// The name of the file without `.json`: what [`load`] takes and what a failing test should print.
    pub stem: String,
    /// Where the frame comes from: a section of the manual, a capture and its unit, or ourselves.
    pub source: String,
    /// What is special about the frame; empty where nothing is.
    pub note: String,
    /// Which way the frame goes.
    pub direction: Direction,
    /// What the manual prints, comments included, where that is not itself the frame.
    pub printed: Option<String>,
    /// The bytes on the wire.
    pub frame: Vec<u8>,
    /// Why the frame cannot be read; `None` where it can.
    pub error: Option<ExpectedError>,
    /// The repaired frame, which is what `decoded` describes; only where the frame cannot be read.
    pub reading: Option<String>,
    /// What we send for this message.
    pub canonical: Option<String>,
    /// Whether encoding what was decoded gives exactly `frame`.
    pub reencodes: bool,
    /// What the frame, or the reading in its place, means; [`Value::Null`] where there is nothing to decode.
    pub decoded: Value,
}

/// What the error for a bad frame must say.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpectedError {
    /// Where the fault is, in bytes from the first byte of the frame.
    pub offset: usize,
    /// Text the error's message must contain, such as the name of the bad member.
    pub names: String,
}

/// The file as it is written, before it is checked.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    source: String,
    #[serde(default)]
    note: String,
    direction: Direction,
    printed: Option<String>,
    frame: Option<String>,
    frame_hex: Option<String>,
    error: Option<ExpectedError>,
    reading: Option<String>,
    canonical: Option<String>,
    #[serde(default)]
    reencodes: bool,
    decoded: Option<Value>,
}

impl Vector {
    /// Reads the text of one vector file; the error says what is wrong with it.
    pub fn parse(stem: &str, text: &str) -> Result<Self, String> {
        let file: File = serde_json::from_str(text).map_err(|error| error.to_string())?;
        let frame = match (&file.frame, &file.frame_hex) {
            (Some(text), None) => text.clone().into_bytes(),
            (None, Some(digits)) => bytes_from_hex(digits)?,
            (Some(_), Some(_)) => return Err("`frame` and `frame_hex` exclude each other".to_owned()),
            (None, None) => return Err("`frame` or `frame_hex` is missing".to_owned()),
        };
        check(&file, frame.len())?;
        Ok(Self {
            stem: stem.to_owned(),
            source: file.source,
            note: file.note,
            direction: file.direction,
            printed: file.printed,
            frame,
            error: file.error,
            reading: file.reading,
            canonical: file.canonical,
            reencodes: file.reencodes,
            decoded: file.decoded.unwrap_or(Value::Null),
        })
    }

    /// The bytes that `decoded` describes: the reading, else the frame; `None` where nothing can be decoded.
    pub fn decodable(&self) -> Option<&[u8]> {
        match (&self.reading, &self.error) {
            (Some(reading), _) => Some(reading.as_bytes()),
            (None, None) => Some(&self.frame),
            (None, Some(_)) => None,
        }
    }
}

/// What no JSON parser can know: which members go together.
fn check(file: &File, frame_length: usize) -> Result<(), String> {
    let readable = file.error.is_none() || file.reading.is_some();
    let fault = match (&file.error, &file.reading) {
        (None, Some(_)) => "a frame without `error` needs no `reading`",
        (Some(error), _) if error.offset > frame_length => "`error.offset` lies past the end of the frame",
        (Some(error), _) if error.names.is_empty() => "`error.names` is empty, so every message would do",
        (Some(_), _) if file.reencodes => "a frame that cannot be read does not reencode",
        _ if readable && file.decoded.is_none() => "`decoded` is missing",
        _ if !readable && file.decoded.is_some() => {
            "`decoded` needs a frame that can be read, or a `reading`"
        }
        _ if file.reencodes && file.direction == Direction::ToController => "`reencodes` is for replies",
        _ if file.canonical.is_some() && file.direction == Direction::FromController => {
            "`canonical` is for requests"
        }
        _ => return Ok(()),
    };
    Err(fault.to_owned())
}

/// The vector whose file is called `stem` plus `.json`, in whatever folder below `vectors/messages/`.
pub fn load(stem: &str) -> Vector {
    let files = files_by_stem();
    let Some(path) = files.get(stem) else {
        panic!("no vector `{stem}` below vectors/messages/; there are: {}", names(&files));
    };
    read(stem, path)
}

/// Every vector below `vectors/messages/`, in the order of their stems.
pub fn all() -> Vec<Vector> {
    files_by_stem().iter().map(|(stem, path)| read(stem, path)).collect()
}

fn read(stem: &str, path: &Path) -> Vector {
    Vector::parse(stem, &workspace::read(path)).unwrap_or_else(|fault| panic!("{}: {fault}", path.display()))
}

fn files_by_stem() -> BTreeMap<String, PathBuf> {
    by_stem(workspace::files(&workspace::root().join("vectors/messages"), "json"))
}

/// A stem is the vector's name in tests and tables, so two files may not share one.
fn by_stem(files: Vec<PathBuf>) -> BTreeMap<String, PathBuf> {
    let mut by_stem = BTreeMap::new();
    for path in files {
        if let Some(twin) = by_stem.insert(workspace::stem(&path), path.clone()) {
            panic!("two vectors have one name: {} and {}", twin.display(), path.display());
        }
    }
    by_stem
}

fn names(files: &BTreeMap<String, PathBuf>) -> String {
    files.keys().map(String::as_str).collect::<Vec<_>>().join(", ")
}

/// Pairs of hexadecimal digits; white space between them is for the reader.
fn bytes_from_hex(text: &str) -> Result<Vec<u8>, String> {
    let digits: Vec<u32> = text
        .chars()
        .filter(|symbol| !symbol.is_ascii_whitespace())
        .map(|symbol| symbol.to_digit(16).ok_or_else(|| format!("{symbol:?} is no hexadecimal digit")))
        .collect::<Result<_, _>>()?;
    if !digits.len().is_multiple_of(2) {
        return Err(format!("{} hexadecimal digits are no whole number of bytes", digits.len()));
    }
    let byte =
        |pair: &[u32]| u8::try_from(pair[0] * 16 + pair[1]).expect("two hexadecimal digits make one byte");
    Ok(digits.chunks_exact(2).map(byte).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Vector, String> {
        Vector::parse("made_up", text)
    }

    const GOOD: &str =
        r#"{"source":"ours","direction":"to-controller","frame":"{ }","decoded":{"kind":"unknown"}}"#;

    #[test]
    fn a_plain_vector_is_its_frame() {
        let vector = parse(GOOD).unwrap();
        assert_eq!(
            (vector.stem.as_str(), vector.source.as_str(), vector.note.as_str()),
            ("made_up", "ours", "")
        );
        assert_eq!(vector.direction, Direction::ToController);
        assert_eq!(vector.frame, b"{ }");
        assert_eq!(vector.decodable(), Some(b"{ }".as_slice()));
        assert_eq!(vector.decoded["kind"], "unknown");
        assert!(!vector.reencodes);
    }

    #[test]
    fn a_misprint_is_described_by_its_reading() {
        let misprint =
            GOOD.replace("{ }\"", "{\",\"error\":{\"offset\":1,\"names\":\"}\"},\"reading\":\"{}\"");
        let vector = parse(&misprint).unwrap();
        assert_eq!(vector.frame, b"{");
        assert_eq!(vector.error, Some(ExpectedError { offset: 1, names: "}".to_owned() }));
        assert_eq!(vector.decodable(), Some(b"{}".as_slice()));
    }

    #[test]
    fn bytes_that_mean_nothing_have_only_an_error() {
        let text = r#"{"source":"ours","direction":"from-controller","frame_hex":"7B 22 61 ff",
                       "error":{"offset":3,"names":"UTF-8"}}"#;
        let vector = parse(text).unwrap();
        assert_eq!(vector.frame, [0x7b, 0x22, 0x61, 0xff]);
        assert_eq!(vector.decodable(), None);
        assert_eq!(vector.decoded, Value::Null);
    }

    /// Replaces one part of a good vector and says what the loader then complains about.
    fn fault(part: &str, replacement: &str) -> String {
        assert!(GOOD.contains(part), "nothing to replace");
        parse(&GOOD.replace(part, replacement)).unwrap_err()
    }

    #[test]
    fn a_typo_in_a_member_is_found() {
        assert!(fault(r#""decoded":"#, r#""decode":"#).contains("unknown field `decode`"));
        assert!(fault(r#""decoded":"#, r#""error":{"offset":0,"name":"x"},"decoded":"#).contains("`name`"));
        assert!(fault("to-controller", "to-pc").contains("unknown variant `to-pc`"));
        assert!(
            fault(r#""decoded":"#, r#""source":"twice","decoded":"#).contains("duplicate field `source`")
        );
    }

    #[test]
    fn contradictions_are_found() {
        let with = |members: &str| fault(r#""decoded""#, &format!(r#"{members},"decoded""#));
        assert!(fault(r#""frame":"{ }","#, "").contains("`frame` or `frame_hex` is missing"));
        assert!(with(r#""frame_hex":"7b7d""#).contains("exclude each other"));
        assert!(fault(r#","decoded":{"kind":"unknown"}"#, "").contains("`decoded` is missing"));
        assert!(with(r#""error":{"offset":0,"names":"x"}"#).contains("or a `reading`"));
        assert!(with(r#""error":{"offset":4,"names":"x"},"reading":"{}""#).contains("past the end"));
        assert!(with(r#""error":{"offset":0,"names":""},"reading":"{}""#).contains("is empty"));
        assert!(
            with(r#""error":{"offset":0,"names":"x"},"reading":"{}","reencodes":true"#)
                .contains("cannot be read")
        );
        assert!(with(r#""reading":"{}""#).contains("needs no `reading`"));
        assert!(with(r#""reencodes":true"#).contains("is for replies"));
        let reply = GOOD.replace("to-controller", "from-controller");
        let reply = parse(&reply.replace(r#""decoded""#, r#""canonical":"{}","decoded""#));
        assert!(reply.unwrap_err().contains("is for requests"));
    }

    #[test]
    fn bad_hexadecimal_digits_are_found() {
        assert_eq!(bytes_from_hex("7b 7D\n00"), Ok(vec![0x7b, 0x7d, 0]));
        assert!(bytes_from_hex("7b7").unwrap_err().contains("3 hexadecimal digits"));
        assert!(bytes_from_hex("7x").unwrap_err().contains("'x'"));
    }

    #[test]
    #[should_panic(expected = "two vectors have one name")]
    fn two_vectors_of_one_name_are_found() {
        by_stem(vec![PathBuf::from("query/simple.json"), PathBuf::from("command/simple.json")]);
    }
}
