//! Transcripts: the bytes of one connection, in order and with their times.
//!
//! A transcript is a file `vectors/transcripts/*.jsonl`. It has an optional first line `{"about":"..."}`,
//! then one line for each write, `{"from":"pc"|"controller","ms":n,"bytes":"..."}`. A frame may span several
//! writes, and a write may contain several frames.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::workspace;

/// One end of the link between a PC and a controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// The host. It sends requests, and answers a `photo`.
    Pc,
    /// The robot controller. It replies, and sends `photo` without a request (manual 5.1).
    Controller,
}

/// A recorded connection.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Transcript {
    /// The name of the file without `.jsonl`.
    pub stem: String,
    /// What was recorded, and where; empty if the file does not say.
    pub about: String,
    /// The writes, in order of time.
    pub writes: Vec<Write>,
}

/// The bytes that one side wrote at one time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Write {
    /// The side that sent the bytes.
    pub from: Side,
    /// Milliseconds since the connection was made.
    pub ms: u64,
    /// The bytes: never empty, and not always a complete frame.
    pub bytes: Vec<u8>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct About {
    about: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    from: Side,
    ms: u64,
    bytes: String,
}

impl Transcript {
    /// Reads the text of one transcript. The error gives the wrong line and the reason.
    pub fn parse(stem: &str, text: &str) -> Result<Self, String> {
        let mut lines = text.lines().enumerate().peekable();
        let about = match lines.peek() {
            Some((_, first)) if first.contains("\"about\"") && !first.contains("\"bytes\"") => {
                let about: About = serde_json::from_str(first).map_err(|error| format!("line 1: {error}"))?;
                lines.next();
                about.about
            }
            Some(_) | None => String::new(),
        };

        let mut writes: Vec<Write> = Vec::new();
        for (index, line) in lines {
            let write =
                parse_write(line, writes.last()).map_err(|fault| format!("line {}: {fault}", index + 1))?;
            writes.push(write);
        }
        if writes.is_empty() {
            return Err("nothing was sent".to_owned());
        }
        Ok(Self { stem: stem.to_owned(), about, writes })
    }
}

fn parse_write(line: &str, previous: Option<&Write>) -> Result<Write, String> {
    let line: Line = serde_json::from_str(line).map_err(|error| error.to_string())?;
    if line.bytes.is_empty() {
        return Err("`bytes` is empty".to_owned());
    }
    match previous {
        Some(previous) if previous.ms > line.ms => {
            Err(format!("{} ms lies before the {} ms of the line above", line.ms, previous.ms))
        }
        Some(_) | None => Ok(Write { from: line.from, ms: line.ms, bytes: line.bytes.into_bytes() }),
    }
}

/// The transcript in `vectors/transcripts/` whose file is called `stem` plus `.jsonl`.
pub fn load(stem: &str) -> Transcript {
    let files = files();
    let Some(path) = files.iter().find(|path| workspace::stem(path) == stem) else {
        let names: Vec<String> = files.iter().map(|path| workspace::stem(path)).collect();
        panic!("no transcript `{stem}` in vectors/transcripts/; there are: {}", names.join(", "));
    };
    read(path)
}

/// Every transcript in `vectors/transcripts/`, in the order of their names.
pub fn all() -> Vec<Transcript> {
    files().iter().map(|path| read(path)).collect()
}

fn files() -> Vec<PathBuf> {
    workspace::files(&workspace::root().join("vectors/transcripts"), "jsonl")
}

fn read(path: &Path) -> Transcript {
    Transcript::parse(&workspace::stem(path), &workspace::read(path))
        .unwrap_or_else(|fault| panic!("{}: {fault}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUERY: &str = r#"{"from":"pc","ms":5,"bytes":"{\"reqType\":\"query\"}"}"#;
    const REPLY: &str = r#"{"from":"controller","ms":9,"bytes":"{}\r\n"}"#;

    #[test]
    fn writes_keep_their_order_side_time_and_bytes() {
        let text = format!("{{\"about\":\"made up\"}}\n{QUERY}\n{REPLY}\n");
        let transcript = Transcript::parse("made_up", &text).unwrap();
        assert_eq!(transcript.stem, "made_up");
        assert_eq!(transcript.about, "made up");
        assert_eq!(
            transcript.writes,
            [
                Write { from: Side::Pc, ms: 5, bytes: br#"{"reqType":"query"}"#.to_vec() },
                Write { from: Side::Controller, ms: 9, bytes: b"{}\r\n".to_vec() },
            ]
        );
    }

    #[test]
    fn the_first_line_may_be_data_even_when_it_says_about() {
        let text = r#"{"from":"pc","ms":0,"bytes":"{\"about\":1}"}"#;
        let transcript = Transcript::parse("made_up", text).unwrap();
        assert_eq!((transcript.about.as_str(), transcript.writes.len()), ("", 1));
    }

    #[test]
    fn a_fault_is_named_with_its_line() {
        let fault = |text: &str| Transcript::parse("made_up", text).unwrap_err();
        assert!(fault(&format!("{REPLY}\n{QUERY}")).contains("line 2: 5 ms lies before the 9 ms"));
        assert!(fault(&QUERY.replace("ms", "sm")).contains("line 1: unknown field `sm`"));
        assert!(fault(&QUERY.replace("\"pc\"", "\"robot\"")).contains("unknown variant `robot`"));
        assert!(fault(&format!("{QUERY}\n{{\"about\":\"late\"}}")).contains("line 2: unknown field `about`"));
        assert!(fault(r#"{"from":"pc","ms":0,"bytes":""}"#).contains("`bytes` is empty"));
        assert!(fault(&format!("{QUERY}\n\n{REPLY}")).contains("line 2"));
        assert!(fault("").contains("nothing was sent"));
    }
}
