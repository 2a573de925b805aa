//! Transcripts: complete conversations, one write of one side a line.
//!
//! A line is `{"from":"pc","ms":17,"bytes":"{…}"}`, as `vectors/README.md` describes. If the bytes are not
//! UTF-8 (GBK, or a write that ends within a character), the line has `bytes_hex` instead of `bytes`: two
//! hexadecimal digits a byte.

use std::time::Duration;

use r6_proto::frame::{Frame, FrameBuffer, FrameError, Limits};
use r6_proto::time::Instant;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{BrokenFrame, Captured, Place, Recording, TooLong};
use crate::conversation::Side;

/// One write of one side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Write {
    /// Its line, counted from 1.
    pub line: usize,
    /// The side that wrote.
    pub from: Side,
    /// When, in whole milliseconds. The origin is the time when the connection was made. `None` if the line
    /// has no time.
    pub time: Option<Instant>,
    /// The bytes: a part of a frame, a frame, or several frames.
    pub bytes: Vec<u8>,
}

/// One line of the file.
#[derive(Serialize, Deserialize)]
struct Line {
    from: Side,
    /// If the time is not a whole number, only the time is ignored, not the transcript.
    #[serde(default)]
    ms: Value,
    #[serde(skip_serializing_if = "Option::is_none")]
    bytes: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    bytes_hex: Option<String>,
}

/// The first line of a transcript, and any other line with only a description.
#[derive(Serialize, Deserialize)]
struct About {
    about: String,
}

/// The line that says what the transcript shows, with its end of line. It comes first.
#[must_use]
pub fn about(text: &str) -> String {
    line_of(&About { about: text.to_owned() })
}

/// The line of one write, with its end of line. The time since the connection was made is written in whole
/// milliseconds.
#[must_use]
pub fn line(from: Side, time: Instant, bytes: &[u8]) -> String {
    let ms = Value::from(time.as_nanos() / 1_000_000);
    let (bytes, bytes_hex) = match std::str::from_utf8(bytes) {
        Ok(text) => (Some(text.to_owned()), None),
        Err(_) => (None, Some(bytes.iter().map(|byte| format!("{byte:02x}")).collect())),
    };
    line_of(&Line { from, ms, bytes, bytes_hex })
}

fn line_of(line: &impl Serialize) -> String {
    // Both kinds of line contain only values that JSON can express, so this never fails.
    let text = serde_json::to_string(line).unwrap_or_default();
    text + "\n"
}

/// How many writes of a transcript are read: hours of traffic. Every write takes memory, even one without
/// bytes.
pub const MAX_WRITES: usize = 1 << 20;

/// Returns the writes of a transcript. Returns `None` if a line is not one of a transcript, or if there are
/// no writes or more than [`MAX_WRITES`]. Such a file is read as a log.
#[must_use]
pub fn writes(input: &[u8]) -> Option<Vec<Write>> {
    writes_within(input, MAX_WRITES)
}

fn writes_within(input: &[u8], most: usize) -> Option<Vec<Write>> {
    let text = std::str::from_utf8(input).ok()?;
    let mut writes = Vec::new();
    for (line, text) in (1..).zip(text.lines()) {
        if writes.len() > most {
            return None;
        }
        if text.trim().is_empty() || serde_json::from_str::<About>(text).is_ok() {
            continue;
        }
        let Line { from, ms, bytes, bytes_hex } = serde_json::from_str(text).ok()?;
        let bytes = match (bytes, bytes_hex) {
            (Some(text), None) => text.into_bytes(),
            (None, Some(digits)) => from_hex(&digits)?,
            (Some(_), Some(_)) | (None, None) => return None,
        };
        let time = ms.as_u64().map(|ms| Instant::ORIGIN + Duration::from_millis(ms));
        writes.push(Write { line, from, time, bytes });
    }
    (1..=most).contains(&writes.len()).then_some(writes)
}

fn from_hex(digits: &str) -> Option<Vec<u8>> {
    let value = |digit: u8| char::from(digit).to_digit(16).and_then(|value| u8::try_from(value).ok());
    let (pairs, rest) = digits.as_bytes().as_chunks::<2>();
    let bytes = pairs.iter().map(|[high, low]| Some(value(*high)? * 16 + value(*low)?));
    if rest.is_empty() { bytes.collect() } else { None }
}

/// Returns the frames of a transcript, at most `most`.
pub(super) fn frames(writes: &[Write], most: usize) -> Result<Recording, TooLong> {
    let mut recording = Recording::default();
    let mut sides = [Stream::new(Side::Pc), Stream::new(Side::Controller)];
    for write in writes {
        for stream in sides.iter_mut().filter(|stream| stream.side == write.from) {
            stream.take(write, &mut recording, most)?;
        }
    }
    for stream in &mut sides {
        stream.end(&mut recording, most)?;
    }
    Ok(recording)
}

/// The bytes of one side.
struct Stream {
    side: Side,
    frames: FrameBuffer,
    /// Line and time of the last write.
    line: usize,
    time: Option<Instant>,
}

impl Stream {
    fn new(side: Side) -> Self {
        Self { side, frames: FrameBuffer::new(Limits::default()), line: 0, time: None }
    }

    fn take(&mut self, write: &Write, recording: &mut Recording, most: usize) -> Result<(), TooLong> {
        (self.line, self.time) = (write.line, write.time);
        let mut rest = &write.bytes[..];
        while !rest.is_empty() {
            let taken = self.frames.push(rest);
            rest = rest.get(taken..).unwrap_or_default();
            while let Some(found) = self.frames.next() {
                let captured = captured(found, self.side, self.line, self.time);
                recording.push(captured, most)?;
            }
        }
        Ok(())
    }

    fn end(&mut self, recording: &mut Recording, most: usize) -> Result<(), TooLong> {
        match self.frames.abandon_partial() {
            Some(error) => recording.push(captured(Err(error), self.side, self.line, self.time), most),
            None => Ok(()),
        }
    }
}

fn captured(
    found: Result<Frame<'_>, FrameError>,
    side: Side,
    line: usize,
    time: Option<Instant>,
) -> Captured {
    let (offset, frame) = match found {
        Ok(frame) => (frame.stream_offset, Ok(frame.bytes.to_vec())),
        Err(error) => (error.stream_offset, Err(BrokenFrame::Frame(error))),
    };
    Captured { place: Place { offset, line }, from: Some(side), time, frame }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUERY: &str =
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddr":["version"]}"#;

    fn at(ms: u64) -> Instant {
        Instant::ORIGIN + Duration::from_millis(ms)
    }

    #[test]
    fn transcripts_have_two_sides_with_their_times() {
        let (half, rest) = QUERY.split_at(20);
        let text = [
            about("x"),
            line(Side::Pc, at(5), half.as_bytes()),
            line(Side::Controller, at(6), QUERY.as_bytes()),
            "\n".to_owned(),
            line(Side::Pc, at(7), [rest, "{"].concat().as_bytes()),
        ];
        let recording = Recording::read(text.concat().as_bytes()).unwrap();
        let told = recording
            .frames
            .iter()
            .map(|captured| {
                let Captured { place, from, time, frame } = captured;
                (place.line, place.offset, *from, *time, frame.is_ok())
            })
            .collect::<Vec<_>>();
        assert_eq!(
            told,
            [
                (3, 0, Some(Side::Controller), Some(at(6)), true),
                (5, 0, Some(Side::Pc), Some(at(7)), true),
                (5, 84, Some(Side::Pc), Some(at(7)), false)
            ]
        );
        assert_eq!(recording.other_bytes, 0);
    }

    #[test]
    fn a_line_is_what_the_format_says() {
        let time = Instant::from_nanos(17_999_999);
        assert_eq!(
            line(Side::Pc, time, b"{\"a\":1}\n"),
            "{\"from\":\"pc\",\"ms\":17,\"bytes\":\"{\\\"a\\\":1}\\n\"}\n"
        );
        assert_eq!(
            line(Side::Controller, time, b"\xc4\xe3\n"),
            "{\"from\":\"controller\",\"ms\":17,\"bytes_hex\":\"c4e30a\"}\n"
        );
        assert_eq!(about("a\nb"), "{\"about\":\"a\\nb\"}\n");
    }

    #[test]
    fn a_line_of_another_kind_makes_it_no_transcript() {
        let good = line(Side::Pc, at(1), b"{}");
        for bad in [
            r#"{"from":"robot","ms":0,"bytes":"{}"}"#,
            r#"{"from":"pc","ms":0}"#,
            r#"{"from":"pc","ms":0,"bytes":"{}","bytes_hex":"7b7d"}"#,
            r#"{"from":"pc","ms":0,"bytes_hex":"7b7"}"#,
            r#"{"from":"pc","ms":0,"bytes_hex":"7b7x"}"#,
            "hello",
        ] {
            assert_eq!(writes(format!("{good}{bad}\n").as_bytes()), None, "{bad}");
        }
        assert_eq!(writes(about("nothing was written").as_bytes()), None);
        let three = good.repeat(3);
        assert_eq!(writes_within(three.as_bytes(), 3).map(|writes| writes.len()), Some(3));
        assert_eq!(writes_within(three.as_bytes(), 2), None);
    }

    #[test]
    fn a_time_that_is_missing_or_wrong_costs_only_itself() {
        let text = r#"{"from":"pc","bytes":"{}"}
            {"from":"pc","ms":1.5,"bytes":"{}"}
            {"from":"pc","ms":2,"bytes":"{}"}"#;
        let times: Vec<_> = writes(text.as_bytes()).unwrap().iter().map(|write| write.time).collect();
        assert_eq!(times, [None, None, Some(at(2))]);
    }
}
