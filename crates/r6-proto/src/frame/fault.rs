//! Why bytes of a stream were thrown away.

use std::fmt;

/// Bytes that were thrown away, and why. Each broken frame and each run of garbage gives one error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameError {
    /// Where the broken frame or the garbage begins, in bytes from the beginning of the stream.
    pub stream_offset: u64,
    /// Position of the fault: the byte that is not allowed there, or the first byte too many, or the first
    /// missing byte.
    pub fault_offset: u64,
    /// The fault.
    pub fault: FrameFault,
    head: Head,
}

/// The faults that a stream of frames can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameFault {
    /// Bytes between frames that are not blanks and do not begin an object. A run ends at the next `{`. If
    /// the run looks like the inside of a frame, it ends at the next `{` that cannot belong to that frame. A
    /// new run begins after [`super::Limits::max_frame_bytes`].
    Garbage,
    /// The frame is longer than this many bytes. The reader skips it to its end.
    TooLarge {
        /// The limit in bytes.
        limit: usize,
    },
    /// The frame has more than this many levels. The reader skips it to its end.
    TooDeep {
        /// The limit in levels.
        limit: usize,
    },
    /// A closing bracket of the wrong kind. After it, any closing bracket closes one level, until the frame
    /// ends.
    MismatchedBracket {
        /// The bracket that would have closed the innermost level.
        expected: char,
        /// The bracket that was found.
        found: char,
    },
    /// A raw control byte inside a string. Usually it is the end of line after a frame that was cut off.
    ControlByteInString {
        /// The byte.
        byte: u8,
    },
    /// A letter or digit directly after a string. A quote is missing, so the reader confuses the strings with
    /// the text between them.
    TextBehindString {
        /// The letter or digit.
        found: char,
    },
    /// A `{` where JSON cannot have one: the frame was cut off, and this `{` begins the next one.
    ObjectWhereNoneCanStand,
    /// The rest of the frame never arrived, and
    /// [`FrameBuffer::abandon_partial`](super::FrameBuffer::abandon_partial) gave it up.
    Incomplete {
        /// How many bytes of the frame arrived.
        received: usize,
    },
}

/// The first bytes of what was thrown away, for logs.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Head {
    bytes: [u8; HEAD_BYTES],
    length: usize,
}

/// Enough bytes to recognise an HTTP request or the first key, and few enough for one line of a log.
pub(super) const HEAD_BYTES: usize = 16;

impl Head {
    fn of(bytes: &[u8]) -> Self {
        let mut head = Self { bytes: [0; HEAD_BYTES], length: bytes.len().min(HEAD_BYTES) };
        head.bytes.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        head
    }

    fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}

impl fmt::Debug for Head {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl fmt::Display for Head {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`", self.bytes().trim_ascii_end().escape_ascii())?;
        if self.length == HEAD_BYTES { f.write_str("…") } else { Ok(()) }
    }
}

impl FrameError {
    /// Creates the error for a fault that was found after reading up to the stream offset `read`.
    pub(super) fn new(stream_offset: u64, read: u64, fault: FrameFault, thrown_away: &[u8]) -> Self {
        let fault_offset = match fault {
            FrameFault::Garbage => stream_offset,
            FrameFault::TooDeep { .. }
            | FrameFault::MismatchedBracket { .. }
            | FrameFault::ControlByteInString { .. }
            | FrameFault::TextBehindString { .. } => read.saturating_sub(1),
            FrameFault::TooLarge { .. }
            | FrameFault::ObjectWhereNoneCanStand
            | FrameFault::Incomplete { .. } => read,
        };
        Self { stream_offset, fault_offset, fault, head: Head::of(thrown_away) }
    }

    /// The first bytes of what was thrown away, at most 16, for a person: in backticks, and escaped.
    #[must_use]
    pub fn shown(&self) -> impl fmt::Display {
        self.head
    }

    /// The first bytes of what was thrown away, at most 16.
    #[must_use]
    pub fn first_bytes(&self) -> &[u8] {
        self.head.bytes()
    }
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { stream_offset: offset, fault_offset: at, fault, head } = self;
        if *fault == FrameFault::Garbage {
            return write!(
                f,
                "bytes that are no JSON object at offset {offset}: {head}; skipped to the next `{{`"
            );
        }
        write!(f, "the frame at offset {offset}, {head}, ")?;
        match fault {
            FrameFault::Garbage => Ok(()),
            FrameFault::TooLarge { limit } => write!(f, "is longer than {limit} bytes; skipped to its end"),
            FrameFault::TooDeep { limit } => {
                write!(f, "nests deeper than {limit} levels; skipped to its end")
            }
            FrameFault::MismatchedBracket { expected, found } => {
                write!(
                    f,
                    "has `{found}` at offset {at} where `{expected}` was due; skipped to the next frame"
                )
            }
            FrameFault::ControlByteInString { byte } => write!(
                f,
                "was cut off inside a string, which has byte 0x{byte:02X} at offset {at}; skipped to the next frame"
            ),
            FrameFault::TextBehindString { found } => write!(
                f,
                "has `{found}` at offset {at} right behind a string, so a quote is missing; skipped to the next frame"
            ),
            FrameFault::ObjectWhereNoneCanStand => {
                write!(f, "was cut off: another begins at offset {at} where it can hold none")
            }
            FrameFault::Incomplete { received } => write!(f, "never ended: only {received} bytes of it came"),
        }
    }
}

impl std::error::Error for FrameError {}
