//! Reads raw bytes and logs: frames with anything between them.

use r6_proto::Decoder;
use r6_proto::frame::{FrameBuffer, FrameError, Limits, READ_ROOM};

use super::{BrokenFrame, Captured, Place, Recording, TooLong, is_printed_python};

/// Reads raw bytes or a log, with at most `most` frames.
pub(super) fn read(input: &[u8], most: usize) -> Result<Recording, TooLong> {
    let mut recording = Recording::default();
    let mut frames = FrameBuffer::new(Limits::default());
    let mut decoder = Decoder::new();
    let mut lines = Lines::new(input);
    let mut at = 0;
    let mut resync = false;
    while let Some(start) = next_start(input, at, resync) {
        recording.other_bytes += if resync { 0 } else { weight(input.get(at..start)) };
        let rest = input.get(start..).unwrap_or_default();
        let place = Place { offset: start as u64, line: lines.of(start) };
        let frame = match first_frame(&mut frames, rest) {
            Ok(length) => {
                at = start + length;
                resync = false;
                Ok(rest.get(..length).unwrap_or_default().to_vec())
            }
            Err(error) => {
                at = start + 1;
                resync = true;
                Err(explain(rest, error, &mut decoder))
            }
        };
        recording.push(Captured { place, from: None, time: None, frame }, most)?;
    }
    recording.other_bytes += if resync { 0 } else { weight(input.get(at..)) };
    Ok(recording)
}

/// Number of bytes that are not blanks or zeros.
fn weight(bytes: Option<&[u8]>) -> usize {
    bytes.unwrap_or_default().iter().filter(|byte| !byte.is_ascii_whitespace() && **byte != 0).count()
}

/// Keys that occur only first in a frame, never in a nested object.
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

/// Where the next frame begins, from `at` on. Inside a broken frame, only a `{` with one of [`FIRST_KEYS`]
/// counts.
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
fn first_frame(frames: &mut FrameBuffer, bytes: &[u8]) -> Result<usize, FrameError> {
    frames.reset();
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
    // The first byte is a brace, so the rest is a part of a frame.
    match frames.abandon_partial() {
        Some(error) => Err(error),
        None => Ok(bytes.len()),
    }
}

/// The error of a broken frame: the first JSON error, if it comes before the bracket error.
fn explain(bytes: &[u8], error: FrameError, decoder: &mut Decoder) -> BrokenFrame {
    if is_printed_python(bytes) {
        return BrokenFrame::PrintedPython;
    }
    let seen =
        usize::try_from(error.fault_offset).map_or(usize::MAX, |at| at.saturating_add(1)).min(bytes.len());
    match decoder.decode(bytes.get(..seen).unwrap_or_default()) {
        Err(json) if json.found.is_some() => BrokenFrame::NoJson(json),
        Err(_) | Ok(_) => BrokenFrame::Frame(error),
    }
}

/// Counts lines, forward only.
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

    fn read(input: &str) -> Recording {
        super::read(input.as_bytes(), 100).unwrap()
    }

    /// For each frame: its line, and the error of a broken one.
    fn shape(input: &str) -> Vec<(usize, Option<String>)> {
        let told = |captured: Captured| {
            if let Ok(bytes) = &captured.frame {
                assert!(bytes.starts_with(b"{") && bytes.ends_with(b"}"));
            }
            (captured.place.line, captured.frame.err().map(|error| error.to_string()))
        };
        read(input).frames.into_iter().map(told).collect()
    }

    #[test]
    fn frames_stand_close_together_or_in_a_log() {
        assert_eq!(shape(&format!("{QUERY}{QUERY}")), [(1, None), (1, None)]);
        let log = format!("10:00:01 TX: {QUERY} ok\n10:00:02 Foo {{ a: 1 }}\nrx {QUERY}\n");
        assert_eq!(shape(&log), [(1, None), (3, None)]);
        assert_eq!(read(&log).other_bytes, "10:00:01TX:ok10:00:02Foo{a:1}rx".len());
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
        // A reader that only counts brackets would take the next frame for a nested object, because of the
        // log's colon.
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
        assert_eq!(shape("{'reqType': 'query'}\n"), [(1, None)]);
        let found = shape("{'reqType': 'que\n");
        assert_eq!(found.len(), 1);
        assert!(found[0].1.as_ref().unwrap().contains("single quotes"));
    }
}
