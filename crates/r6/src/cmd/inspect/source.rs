//! Finds the frames in what was captured: raw bytes, logs with text around the frames, transcripts.

mod transcript;

use r6_proto::Decoder;
use r6_proto::frame::{FrameBuffer, FrameError, Limits, READ_ROOM};
use serde::Deserialize;

/// Who sent something, as far as the capture says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// The PC, or a camera.
    Pc,
    /// The controller.
    Controller,
}

/// Where something stands in the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct At {
    /// Bytes from the beginning of the input; in a transcript, of that side's stream.
    pub offset: usize,
    /// Line of the input, counted from 1.
    pub line: usize,
}

/// A stretch of the input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Piece {
    /// A whole frame.
    Frame { at: At, from: Option<Side>, bytes: Vec<u8> },
    /// What began as a frame and is none.
    Broken { at: At, from: Option<Side>, error: String },
}

/// What an input holds.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Pieces {
    /// The frames, whole and broken, in order.
    pub list: Vec<Piece>,
    /// How many bytes belong to no frame, blanks apart.
    pub other_bytes: usize,
}

/// Takes the input apart.
pub fn pieces(input: &[u8]) -> Pieces {
    transcript::read(input).unwrap_or_else(|| captured(input))
}

/// Reads raw bytes or a log: frames, with anything between them.
fn captured(input: &[u8]) -> Pieces {
    let mut pieces = Pieces::default();
    let mut decoder = Decoder::new();
    let mut lines = Lines::new(input);
    let mut at = 0;
    let mut resync = false;
    while let Some(start) = next_start(input, at, resync) {
        pieces.other_bytes += if resync { 0 } else { weight(input.get(at..start)) };
        let rest = input.get(start..).unwrap_or_default();
        let place = At { offset: start, line: lines.of(start) };
        match first_frame(rest) {
            Ok(length) => {
                let bytes = rest.get(..length).unwrap_or_default().to_vec();
                pieces.list.push(Piece::Frame { at: place, from: None, bytes });
                at = start + length;
                resync = false;
            }
            Err(error) => {
                let error = explain(rest, &error, &mut decoder);
                pieces.list.push(Piece::Broken { at: place, from: None, error });
                at = start + 1;
                resync = true;
            }
        }
    }
    pieces.other_bytes += if resync { 0 } else { weight(input.get(at..)) };
    pieces
}

/// How many bytes are no blanks.
fn weight(bytes: Option<&[u8]>) -> usize {
    bytes.unwrap_or_default().iter().filter(|byte| !byte.is_ascii_whitespace() && **byte != 0).count()
}

/// Keys that only stand first in a frame, never in an object inside one.
const FIRST_KEYS: [&[u8]; 10] = [
    b"dsID",
    b"reqType",
    b"cmdType",
    b"packID",
    b"queryAddr",
    b"queryData",
    b"cmdData",
    b"cmdReply",
    b"emptyList",
    b"instructions",
];

/// Where the next frame begins, from `at` on. In the midst of a broken frame only a `{` with a key of its own kind counts.
fn next_start(input: &[u8], at: usize, resync: bool) -> Option<usize> {
    let mut at = at;
    loop {
        at += input.get(at..)?.iter().position(|byte| *byte == b'{')?;
        let rest = input.get(at + 1..)?.trim_ascii_start();
        let quoted = rest.first().is_some_and(|byte| matches!(byte, b'"' | b'\''));
        let key = rest.get(usize::from(quoted)..)?;
        let first_key = FIRST_KEYS.iter().any(|first| key.starts_with(first));
        if first_key || (!resync && matches!(rest.first(), Some(b'"' | b'}') | None)) {
            return Some(at);
        }
        at += 1;
    }
}

/// The length of the frame that begins at the first byte.
fn first_frame(bytes: &[u8]) -> Result<usize, FrameError> {
    let mut frames = FrameBuffer::new(Limits::default());
    for chunk in bytes.chunks(READ_ROOM) {
        let mut rest = chunk;
        while !rest.is_empty() {
            let taken = frames.push(rest);
            rest = rest.get(taken..).unwrap_or_default();
            match frames.next() {
                Some(Ok(frame)) => return Ok(frame.bytes.len()),
                Some(Err(error)) => return Err(error),
                None => {}
            }
        }
    }
    // The first byte is a brace, so what is left is a part of a frame.
    match frames.abandon_partial() {
        Some(error) => Err(error),
        None => Ok(bytes.len()),
    }
}

/// What is wrong with a broken frame: the first thing that is no JSON, where the brackets only tell later.
fn explain(bytes: &[u8], error: &FrameError, decoder: &mut Decoder) -> String {
    if is_python(bytes) {
        return PYTHON.to_owned();
    }
    let seen =
        usize::try_from(error.fault_offset).map_or(usize::MAX, |at| at.saturating_add(1)).min(bytes.len());
    match decoder.decode(bytes.get(..seen).unwrap_or_default()) {
        Err(json) if json.found.is_some() => format!("no JSON: {json}"),
        Err(_) | Ok(_) => error.to_string(),
    }
}

/// What is wrong with a printed Python dictionary.
pub const PYTHON: &str = "single quotes: a printed Python dictionary, not what was on the wire";

/// Whether this is a printed Python dictionary.
pub fn is_python(frame: &[u8]) -> bool {
    frame.get(1..).unwrap_or_default().trim_ascii_start().starts_with(b"'")
}

/// Counts lines, going forward only.
struct Lines<'i> {
    input: &'i [u8],
    at: usize,
    line: usize,
}

impl<'i> Lines<'i> {
    fn new(input: &'i [u8]) -> Self {
        Self { input, at: 0, line: 1 }
    }

    fn of(&mut self, offset: usize) -> usize {
        let skipped = self.input.get(self.at..offset).unwrap_or_default();
        self.line += skipped.iter().filter(|byte| **byte == b'\n').count();
        self.at = self.at.max(offset);
        self.line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUERY: &str =
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddr":["version"]}"#;

    /// For each piece its line and, of a broken one, the error.
    fn shape(input: &str) -> Vec<(usize, Option<String>)> {
        let pieces = pieces(input.as_bytes());
        pieces
            .list
            .into_iter()
            .map(|piece| match piece {
                Piece::Frame { at, bytes, .. } => {
                    assert!(bytes.starts_with(b"{") && bytes.ends_with(b"}"));
                    (at.line, None)
                }
                Piece::Broken { at, error, .. } => (at.line, Some(error)),
            })
            .collect()
    }

    #[test]
    fn frames_stand_close_together_or_in_a_log() {
        assert_eq!(shape(&format!("{QUERY}{QUERY}")), [(1, None), (1, None)]);
        let log = format!("10:00:01 TX: {QUERY} ok\n10:00:02 Foo {{ a: 1 }}\nrx {QUERY}\n");
        assert_eq!(shape(&log), [(1, None), (3, None)]);
        assert_eq!(pieces(log.as_bytes()).other_bytes, "10:00:01TX:ok10:00:02Foo{a:1}rx".len());
        let pretty = QUERY.replace(',', ",\n  ");
        assert_eq!(shape(&format!("{pretty}\n{pretty}")), [(1, None), (4, None)]);
    }

    #[test]
    fn a_broken_frame_costs_only_itself() {
        let cut = &QUERY[..40];
        let found = shape(&format!("{cut}\n{QUERY}\n"));
        assert_eq!(found.len(), 2);
        assert!(found[0].1.is_some());
        assert_eq!(found[1], (2, None));
        // The log's colon would make a nested object of the next frame to a reader that only counts brackets.
        let found = shape(&format!("tx: {{\"reqType\",\"query\"\nrx: {QUERY}"));
        assert_eq!(found.len(), 2);
        assert!(found[0].1.as_ref().unwrap().contains("`reqType` has no value"), "{found:?}");
        assert_eq!(found[1], (2, None));
    }

    #[test]
    fn a_broken_instruction_list_is_one_broken_frame() {
        let text = "{\"reqType\":\"AddRCC\",\"instructions\":[{\"action\":\"4\",\"ckStatus\",\"m0\":\"1\"},{\"action\":\"4\"}}";
        let found = shape(text);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].1.as_ref().unwrap().contains("`ckStatus` has no value"));
    }

    #[test]
    fn python_dictionaries_are_recognised() {
        let found = shape("{'reqType': 'que\n");
        assert_eq!(found.len(), 1);
        assert_eq!(shape("{'reqType': 'query'}\n"), [(1, None)]);
        assert!(is_python(b"{ 'reqType': 'query'}") && !is_python(b"{\"a\":'"));
        assert!(found[0].1.as_ref().unwrap().contains("single quotes"));
    }

    #[test]
    fn transcripts_have_two_sides() {
        let (half, rest) = QUERY.split_at(20);
        let line =
            |from: &str, bytes: &str| serde_json::json!({"from": from, "ms": 0, "bytes": bytes}).to_string();
        let text =
            ["{\"about\":\"x\"}".to_owned(), line("pc", half), line("controller", QUERY), line("pc", rest)]
                .join("\n");
        let sides: Vec<_> = pieces(text.as_bytes())
            .list
            .iter()
            .map(|piece| match piece {
                Piece::Frame { at, from, .. } => (at.line, *from),
                Piece::Broken { error, .. } => panic!("{error}"),
            })
            .collect();
        assert_eq!(sides, [(3, Some(Side::Controller)), (4, Some(Side::Pc))]);
    }

    #[test]
    fn any_bytes_are_taken_apart() {
        for input in [&b""[..], b"{", b"{{{{", b"\xff{\"a\":\xfe}", b"}}}", b"{\"", b"{ }", b"{'"] {
            let pieces = pieces(input);
            assert!(pieces.list.len() <= input.len());
        }
    }
}
