//! Golden vectors: one frame each, its meaning, and the bytes of encoding it again.
//!
//! A vector is a JSON file below `vectors/messages/`, which the tests of every language read.
//! `vectors/README.md` describes its members. An unknown member is an error, and so is a contradiction
//! between members.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;

use crate::workspace;

/// The direction of a frame.
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
    /// The name of the file without `.json`. [`load`] takes it, and a failing test should print it.
    pub stem: String,
    /// The origin of the frame: a section of the manual, a capture with its unit, or our own construction.
    pub source: String,
    /// What is special about the frame; empty if nothing is.
    pub note: String,
    /// The direction of the frame.
    pub direction: Direction,
    /// The printed text of the manual, with its comments, if it differs from the frame.
    pub printed: Option<String>,
    /// The bytes on the wire.
    pub frame: Vec<u8>,
    /// Why the frame cannot be read; `None` if it can.
    pub error: Option<ExpectedError>,
    /// The repaired frame, which `decoded` describes; only if the frame cannot be read.
    pub reading: Option<String>,
    /// The bytes that we send for this message.
    pub canonical: Option<String>,
    /// Whether encoding the decoded message gives exactly `frame`.
    pub reencodes: bool,
    /// The meaning of the frame or of its reading; [`Value::Null`] if there is nothing to decode.
    pub decoded: Value,
}

/// What the error for a bad frame must contain.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpectedError {
    /// Position of the fault, in bytes from the first byte of the frame.
    pub offset: usize,
    /// Text that the error message must contain, such as the name of the bad member.
    pub names: String,
}

/// The file as written, before the checks.
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
    /// Reads the text of one vector file. The error gives the reason.
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

    /// The bytes that `decoded` describes: the reading, or else the frame; `None` if nothing can be decoded.
    pub fn decodable(&self) -> Option<&[u8]> {
        match (&self.reading, &self.error) {
            (Some(reading), _) => Some(reading.as_bytes()),
            (None, None) => Some(&self.frame),
            (None, Some(_)) => None,
        }
    }
}

/// Checks which members go together, which a JSON parser cannot know.
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

/// The vector whose file is called `stem` plus `.json`, in any folder below `vectors/messages/`.
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

/// Two files must not have the same stem, because the stem is the vector's name in tests and tables.
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

/// Reads pairs of hexadecimal digits, with optional white space.
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

    /// Replaces one part of a good vector and returns the loader's error.
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
