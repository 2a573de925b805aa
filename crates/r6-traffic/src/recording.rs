//! Recordings: the frames in a capture.
//!
//! The reader recognises three forms:
//!
//! - raw bytes: frames one after the other;
//! - a log: frames with any text around them, such as the output of `tcpdump -A`;
//! - a [`transcript`]: one write of one side a line. Only this form contains sides and times, and
//!   [`transcript::line`] writes it.

mod log;
pub mod transcript;

use std::fmt;

use r6_proto::error::JsonError;
use r6_proto::frame::FrameError;
use r6_proto::time::Instant;

use crate::conversation::Side;

/// The longest recording that is read, in bytes: hours of traffic, and an amount that fits in the memory of
/// an ordinary machine.
pub const MAX_BYTES: usize = 256 * 1024 * 1024;

/// The most frames of a recording. A limit is needed because a short frame takes more memory than its bytes.
/// A frame rarely has less than 64 bytes.
pub const MAX_FRAMES: usize = MAX_BYTES / 64;

/// The content of a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recording {
    /// The frames, complete and broken, in the order in which they ended.
    pub frames: Vec<Captured>,
    /// How many bytes belong to no frame, without blanks; 0 for a transcript.
    pub other_bytes: usize,
}

impl Recording {
    /// Reads a recording of any form.
    ///
    /// # Errors
    /// [`TooLong`] if there are more than [`MAX_BYTES`] bytes or [`MAX_FRAMES`] frames. All other bytes are a
    /// valid recording. If they contain no frame, the list of frames is empty.
    pub fn read(input: &[u8]) -> Result<Self, TooLong> {
        if input.len() > MAX_BYTES {
            return Err(TooLong::Bytes);
        }
        Self::read_within(input, MAX_FRAMES)
    }

    fn read_within(input: &[u8], most: usize) -> Result<Self, TooLong> {
        match transcript::writes(input) {
            Some(writes) => transcript::frames(&writes, most),
            None => log::read(input, most),
        }
    }

    fn push(&mut self, captured: Captured, most: usize) -> Result<(), TooLong> {
        if self.frames.len() >= most {
            return Err(TooLong::Frames);
        }
        self.frames.push(captured);
        Ok(())
    }
}

/// A frame of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Captured {
    /// Where it begins.
    pub place: Place,
    /// Who sent it, if the recording says so.
    pub from: Option<Side>,
    /// When its last byte was sent, if the recording says so. The origin is the time when the connection was
    /// made.
    pub time: Option<Instant>,
    /// Its bytes; an error for bytes that begin like a frame but are not one.
    pub frame: Result<Vec<u8>, BrokenFrame>,
}

/// A place in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Bytes from the beginning of the recording; in a transcript, the number of earlier bytes from this
    /// side.
    pub offset: u64,
    /// Line of the recording, counted from 1; in a transcript, the line with the last byte of the frame.
    pub line: usize,
}

/// Why bytes that begin like a frame are not one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BrokenFrame {
    /// It is a printed Python dictionary with single quotes: a program printed the frame that it had read.
    PrintedPython,
    /// Its first fault is in the JSON.
    NoJson(JsonError),
    /// Its first fault is in the brackets, in a string or in the length.
    Frame(FrameError),
}

impl fmt::Display for BrokenFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PrintedPython => {
                f.write_str("single quotes: a printed Python dictionary, not what was on the wire")
            }
            Self::NoJson(error) => write!(f, "no JSON: {error}"),
            Self::Frame(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for BrokenFrame {}

/// The recording is too long and is not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TooLong {
    /// More than [`MAX_BYTES`] bytes.
    Bytes,
    /// More than [`MAX_FRAMES`] frames.
    Frames,
}

impl fmt::Display for TooLong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (most, what) = match self {
            Self::Bytes => (MAX_BYTES, "bytes"),
            Self::Frames => (MAX_FRAMES, "frames"),
        };
        write!(f, "more than {most} {what}: a capture is read into memory as a whole")
    }
}

impl std::error::Error for TooLong {}

/// Whether a frame is a printed Python dictionary.
pub(crate) fn is_printed_python(frame: &[u8]) -> bool {
    frame.get(1..).unwrap_or_default().trim_ascii_start().starts_with(b"'")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_has_no_more_frames_than_its_limit() {
        let write = transcript::line(Side::Pc, Instant::ORIGIN, b"{}");
        for (frame, from) in [("{}", None), (&*write, Some(Side::Pc))] {
            let read = Recording::read_within(frame.repeat(3).as_bytes(), 3).unwrap();
            assert_eq!(read.frames.iter().map(|frame| frame.from).collect::<Vec<_>>(), [from; 3]);
            assert_eq!(Recording::read_within(frame.repeat(4).as_bytes(), 3), Err(TooLong::Frames));
        }
    }

    #[test]
    fn a_recording_has_no_more_bytes_than_its_limit() {
        let blanks = vec![b' '; MAX_BYTES + 1];
        assert_eq!(Recording::read(&blanks), Err(TooLong::Bytes));
    }

    #[test]
    fn any_bytes_are_a_recording() {
        for input in [&b""[..], b"{", b"{{{{", b"\xff{\"a\":\xfe}", b"}}}", b"{\"", b"{ }", b"{'"] {
            let recording = Recording::read(input).unwrap();
            assert!(recording.frames.len() <= input.len());
        }
    }

    #[test]
    fn python_dictionaries_are_recognised() {
        assert!(is_printed_python(b"{ 'reqType': 'query'}") && !is_printed_python(b"{\"a\":'"));
    }
}
