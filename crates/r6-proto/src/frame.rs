//! Finds where frames begin and end in a byte stream. Frames are JSON objects one after the other, with no
//! reliable separator between them (manual 3).
//!
//! The reader counts brackets and skips strings. The JSON inside is checked by the decoder. Broken input
//! costs the broken frame, at most the frame directly after it, and one [`FrameError`]. After an error the
//! next `{` begins a frame, unless it may belong to the broken frame: a nested object follows `:`, `[` or
//! `,`, and no frame begins after those.

mod fault;
mod inside;

use fault::HEAD_BYTES;
pub use fault::{FrameError, FrameFault};
use inside::{Inside, Walk};

/// Limits on the size of a frame, in bytes and in levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The longest frame in bytes, from its first brace to its last.
    pub max_frame_bytes: usize,
    /// How many objects and lists may be open at the same time, including the frame itself; at most
    /// [`Limits::DEEPEST`].
    pub max_depth: usize,
}

impl Limits {
    /// The highest possible `max_depth`, because the kinds of the levels are the bits of one word.
    pub const DEEPEST: usize = 64;
}

impl Default for Limits {
    /// 65 536 bytes and 32 levels.
    fn default() -> Self {
        // 64 KiB hold an AddRCC of about 280 motions or an AddPoints of about 450 points. Controllers accept
        // 10 motions, and cameras see dozens of points. It is also the memory that a hostile peer can make us
        // keep. The deepest frame in the manual has five levels.
        Self { max_frame_bytes: 65_536, max_depth: 32 }
    }
}

/// One complete frame: a JSON object from its first brace to its last. Its brackets are balanced; nothing
/// else is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'b> {
    /// The bytes, braces included.
    pub bytes: &'b [u8],
    /// Position of the first brace, in bytes from the beginning of the stream.
    pub stream_offset: u64,
}

/// Finds the frames in a stream of bytes that arrive in pieces of any size.
///
/// Put bytes in with [`push`](Self::push), or read them into [`spare_mut`](Self::spare_mut) and call
/// [`commit`](Self::commit). Then call [`next`](Self::next) until it returns `None`. The buffer examines
/// every byte once, in whatever pieces the stream arrives. Memory is bounded by [`Limits::max_frame_bytes`]
/// and [`READ_ROOM`]. It starts at zero, grows with the frames that arrive, and is reused.
#[derive(Debug)]
pub struct FrameBuffer {
    limits: Limits,
    /// The bytes from `begin` to `filled` are in use; the rest is free.
    storage: Vec<u8>,
    /// The first byte of what is being read, or the next byte if nothing has to be kept.
    begin: usize,
    /// The next byte to examine.
    at: usize,
    filled: usize,
    /// Stream offset of the first byte of `storage`.
    base: u64,
    mode: Mode,
    /// Stream offset where the bytes of the current mode begin.
    began: u64,
    /// The position inside the frame, in the modes `Frame` and `Discarding`.
    inside: Inside,
    examined: u64,
}

/// Minimum room for new bytes after all frames were taken out: a usual read of a socket.
pub const READ_ROOM: usize = 4096;

/// What the current bytes belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    /// Nothing. The next byte that is not a blank decides.
    Between,
    /// A byte order mark, of which `seen` bytes have arrived.
    Mark { seen: usize },
    /// Garbage that is not reported yet. Its first bytes are kept for the report.
    Garbage { trail: Trail },
    /// A frame.
    Frame,
    /// A frame that was reported as broken; its bytes are discarded up to its last brace.
    Discarding,
    /// The rest of reported garbage or of a broken frame, for at most `left` more bytes.
    Skipping { left: usize, trail: Trail },
}

/// Result of examining the bytes in one mode.
enum Step {
    /// More bytes are needed.
    Wait,
    /// The mode changed.
    Again,
    Frame {
        from: usize,
    },
    Error(FrameError),
}

const BYTE_ORDER_MARK: [u8; 3] = [0xEF, 0xBB, 0xBF];

/// Used as the previous byte at places where a frame may always begin.
const NOTHING: u8 = 0;

/// Whether a nested object may follow this byte.
fn can_hold_object(previous: u8) -> bool {
    matches!(previous, b':' | b'[' | b',')
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n')
}

/// The state while reading bytes that belong to no frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Trail {
    /// The last byte that is not a blank.
    previous: u8,
    /// The bytes look like the inside of a frame: they began with JSON punctuation or contained a quote. They
    /// may then contain nested objects, which must not be read as frames.
    inner: bool,
}

impl Trail {
    /// Takes the next byte. Returns `true`, and does not take it, if the byte begins a frame.
    fn ends_before(&mut self, byte: u8) -> bool {
        if byte == b'{' && !(self.inner && can_hold_object(self.previous)) {
            return true;
        }
        if !is_blank(byte) {
            let first = self.previous == NOTHING;
            self.inner |= byte == b'"' || (first && matches!(byte, b',' | b':' | b'[' | b']' | b'}'));
            self.previous = byte;
        }
        false
    }
}

impl FrameBuffer {
    /// Creates a buffer at the beginning of a stream. It allocates when the first bytes arrive.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        let limits = Limits {
            // `{}` is the shortest frame.
            max_frame_bytes: limits.max_frame_bytes.max(2),
            max_depth: limits.max_depth.clamp(1, Limits::DEEPEST),
        };
        Self {
            limits,
            storage: Vec::new(),
            begin: 0,
            at: 0,
            filled: 0,
            base: 0,
            mode: Mode::Between,
            began: 0,
            inside: Inside::BEGIN,
            examined: 0,
        }
    }

    /// Appends bytes of the stream and returns how many fit. After [`next`](Self::next) has returned `None`,
    /// at least [`READ_ROOM`] bytes fit, or all. Push the rest again after the next `None`.
    #[must_use = "bytes that were not taken have to be pushed again"]
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        let room = self.room(bytes.len());
        let taken = room.len().min(bytes.len());
        if let (Some(room), Some(bytes)) = (room.get_mut(..taken), bytes.get(..taken)) {
            room.copy_from_slice(bytes);
        }
        self.commit(taken);
        taken
    }

    /// Free room for new bytes of the stream. It is not empty after [`next`](Self::next) has returned `None`.
    #[must_use]
    pub fn spare_mut(&mut self) -> &mut [u8] {
        self.room(READ_ROOM)
    }

    /// Declares that the first `count` bytes of [`spare_mut`](Self::spare_mut) are the next bytes of the
    /// stream.
    pub fn commit(&mut self, count: usize) {
        self.filled = self.filled.saturating_add(count).min(self.storage.len());
    }

    /// Returns the next frame or fault, or `None` if more bytes are needed.
    #[expect(
        clippy::should_implement_trait,
        reason = "a frame borrows the buffer, which an iterator cannot say"
    )]
    #[inline]
    pub fn next(&mut self) -> Option<Result<Frame<'_>, FrameError>> {
        loop {
            let step = match self.mode {
                Mode::Frame => self.read_frame(),
                Mode::Between => self.skip_blanks(),
                Mode::Mark { seen } => self.skip_mark(seen),
                Mode::Garbage { trail } => self.read_garbage(trail),
                Mode::Discarding => self.discard(),
                Mode::Skipping { left, trail } => self.skip(left, trail),
            };
            match step {
                Step::Again => {}
                Step::Wait => return None,
                Step::Error(error) => return Some(Err(error)),
                Step::Frame { from } => {
                    let bytes = self.storage.get(from..self.at).unwrap_or_default();
                    return Some(Ok(Frame { bytes, stream_offset: self.began }));
                }
            }
        }
    }

    /// The waiting bytes at a place where a frame may begin, at most as many as a frame may have. Empty
    /// within a frame or within skipped bytes.
    #[inline]
    pub(crate) fn waiting(&self) -> &[u8] {
        if self.mode == Mode::Between { self.unread(self.limits.max_frame_bytes) } else { &[] }
    }

    /// Takes `length` bytes of [`Self::waiting`] that the caller knows to be a frame.
    #[inline]
    pub(crate) fn take_frame(&mut self, length: usize) -> &[u8] {
        let from = self.at;
        self.advance(length);
        self.enter(Mode::Between);
        self.storage.get(from..self.at).unwrap_or_default()
    }

    /// Number of bytes that arrived since the beginning of an incomplete frame or garbage, or of its skipped
    /// rest.
    ///
    /// It is 0 between frames, after [`next`](Self::next) has returned `None`. If it stays above 0 and no
    /// bytes arrive, the peer has stalled.
    #[must_use]
    pub fn pending(&self) -> usize {
        if self.mode == Mode::Between {
            return 0;
        }
        usize::try_from(self.offset(self.filled) - self.began).unwrap_or(usize::MAX)
    }

    /// Gives up an incomplete frame or garbage, because the peer closed the stream or has stalled. The rest
    /// of it is skipped when it arrives. Returns the error, or `None` if there is nothing to give up or it
    /// was already reported.
    ///
    /// Call this after [`next`](Self::next) has returned `None`.
    pub fn abandon_partial(&mut self) -> Option<FrameError> {
        let fault = match self.mode {
            Mode::Between => return None,
            Mode::Skipping { .. } | Mode::Discarding => None,
            Mode::Mark { .. } | Mode::Garbage { .. } => Some(FrameFault::Garbage),
            Mode::Frame => Some(FrameFault::Incomplete { received: self.at - self.begin }),
        };
        let error = fault.map(|fault| self.error(fault));
        self.skip_rest(NOTHING);
        error
    }

    /// Starts a new stream at offset 0. Keeps only the memory.
    pub fn reset(&mut self) {
        *self = Self { storage: std::mem::take(&mut self.storage), ..Self::new(self.limits) };
    }

    /// Number of bytes examined or moved since the beginning of the stream. The work is proportional to this
    /// number. A byte that is examined twice counts twice.
    #[must_use]
    pub fn examined(&self) -> u64 {
        self.examined
    }

    /// Room after the bytes in use: `wanted` bytes, unless the limit or frames not yet taken prevent it.
    fn room(&mut self, wanted: usize) -> &mut [u8] {
        let kept = self.filled - self.begin;
        // Move bytes only after enough other bytes have left since the last move. Otherwise the total work
        // would not be linear.
        let paid = kept <= self.begin || (self.begin > 0 && self.at == self.filled);
        let short = self.storage.len() - self.filled < wanted;
        if kept == 0 || (short && paid) {
            self.storage.copy_within(self.begin..self.filled, 0);
            self.examined += kept as u64;
            self.base += self.begin as u64;
            self.at -= self.begin;
            self.begin = 0;
            self.filled = kept;
        }
        let needed = self.filled.saturating_add(wanted);
        if needed > self.storage.len() {
            let most = self.limits.max_frame_bytes.saturating_add(READ_ROOM);
            let length = needed.max(self.storage.len().saturating_mul(2)).max(READ_ROOM).min(most);
            self.storage.resize(length.max(self.storage.len()), 0);
        }
        self.storage.get_mut(self.filled..).unwrap_or_default()
    }

    fn offset(&self, index: usize) -> u64 {
        self.base + index as u64
    }

    /// The bytes not yet examined, at most `most`.
    fn unread(&self, most: usize) -> &[u8] {
        self.storage.get(self.at..self.filled.min(self.at.saturating_add(most))).unwrap_or_default()
    }

    /// Marks the next `count` bytes as examined.
    fn advance(&mut self, count: usize) {
        self.at += count;
        self.examined += count as u64;
    }

    /// Enters a mode whose bytes begin at the current position.
    fn enter(&mut self, mode: Mode) {
        self.begin = self.at;
        self.began = self.offset(self.at);
        self.mode = mode;
    }

    fn error(&self, fault: FrameFault) -> FrameError {
        let thrown_away = self.storage.get(self.begin..self.at).unwrap_or_default();
        FrameError::new(self.began, self.offset(self.at), fault, thrown_away)
    }

    fn skip_blanks(&mut self) -> Step {
        let rest = self.unread(usize::MAX);
        let blanks = rest.iter().take_while(|byte| is_blank(**byte) || **byte == 0).count();
        let first = rest.get(blanks).copied();
        self.advance(blanks);
        match first {
            None => {
                self.enter(Mode::Between);
                return Step::Wait;
            }
            Some(b'{') => {
                self.enter(Mode::Frame);
                self.advance(1);
                self.inside = Inside::BEGIN;
            }
            Some(0xEF) => self.enter(Mode::Mark { seen: 0 }),
            Some(_) => self.enter(Mode::Garbage { trail: Trail::default() }),
        }
        Step::Again
    }

    #[cold]
    fn skip_mark(&mut self, seen: usize) -> Step {
        let Some(due) = BYTE_ORDER_MARK.get(seen) else {
            self.enter(Mode::Between);
            return Step::Again;
        };
        match self.unread(1) {
            [] => return Step::Wait,
            [byte] if byte == due => {
                self.advance(1);
                self.mode = Mode::Mark { seen: seen + 1 };
            }
            // The bytes seen so far belong to the garbage.
            [..] => self.mode = Mode::Garbage { trail: Trail::default() },
        }
        Step::Again
    }

    /// Reads garbage until there is enough for a report, or until it ends.
    #[cold]
    fn read_garbage(&mut self, mut trail: Trail) -> Step {
        let ended = self.follow(&mut trail, HEAD_BYTES - (self.at - self.begin));
        if !ended && self.at - self.begin < HEAD_BYTES {
            self.mode = Mode::Garbage { trail };
            return Step::Wait;
        }
        let error = self.error(FrameFault::Garbage);
        let left = self.limits.max_frame_bytes;
        self.enter(if ended { Mode::Between } else { Mode::Skipping { left, trail } });
        Step::Error(error)
    }

    /// Skips reported bytes up to the next frame.
    #[cold]
    fn skip(&mut self, left: usize, mut trail: Trail) -> Step {
        let from = self.at;
        let ended = self.follow(&mut trail, left);
        self.begin = self.at;
        let left = left - (self.at - from);
        if ended || left == 0 {
            self.enter(Mode::Between);
            return Step::Again;
        }
        self.mode = Mode::Skipping { left, trail };
        Step::Wait
    }

    /// Follows a trail through at most `most` bytes. Returns whether it ended at the next frame.
    fn follow(&mut self, trail: &mut Trail, most: usize) -> bool {
        let rest = self.unread(most);
        let found = rest.iter().position(|byte| trail.ends_before(*byte));
        let count = found.unwrap_or(rest.len());
        self.advance(count);
        found.is_some()
    }

    fn read_frame(&mut self) -> Step {
        let from = self.begin;
        let limit = self.limits.max_frame_bytes;
        let fault = match self.walk(from.saturating_add(limit), Some(self.limits.max_depth)) {
            Walk::Closed => {
                self.begin = self.at;
                self.mode = Mode::Between;
                return Step::Frame { from };
            }
            Walk::Out if self.at == self.filled => return Step::Wait,
            Walk::Out => FrameFault::TooLarge { limit },
            Walk::Fault(fault) => fault,
        };
        let error = self.error(fault);
        self.recover(fault);
        Step::Error(error)
    }

    fn discard(&mut self) -> Step {
        let walk = self.walk(self.filled, None);
        self.begin = self.at;
        match walk {
            Walk::Out => return Step::Wait,
            Walk::Closed if self.inside.is_tangled() => self.skip_rest(self.inside.previous()),
            Walk::Closed => self.enter(Mode::Between),
            Walk::Fault(fault) => self.recover(fault),
        }
        Step::Again
    }

    /// Continues to walk through the frame, but not beyond the index `end`.
    fn walk(&mut self, end: usize, max_depth: Option<usize>) -> Walk {
        let end = end.min(self.filled);
        let known = self.storage.get(..end).unwrap_or(&self.storage);
        let (at, walk) = self.inside.walk(known, self.at, max_depth);
        self.advance(at - self.at);
        walk
    }

    /// Decides where reading continues after a fault in a frame.
    fn recover(&mut self, fault: FrameFault) {
        self.begin = self.at;
        match fault {
            FrameFault::TooLarge { .. } | FrameFault::TooDeep { .. } => self.mode = Mode::Discarding,
            FrameFault::MismatchedBracket { .. } if self.inside.depth() > 0 => self.mode = Mode::Discarding,
            FrameFault::MismatchedBracket { .. } | FrameFault::TextBehindString { .. } => {
                self.skip_rest(self.inside.previous());
            }
            FrameFault::ObjectWhereNoneCanStand => self.enter(Mode::Between),
            // The control byte ends the cut-off frame, so the next byte may begin a frame.
            FrameFault::ControlByteInString { .. } | FrameFault::Garbage | FrameFault::Incomplete { .. } => {
                self.skip_rest(NOTHING);
            }
        }
    }

    /// Skips the rest of a broken frame. `previous` is its last byte that is not a blank.
    fn skip_rest(&mut self, previous: u8) {
        let trail = Trail { previous, inner: true };
        self.enter(Mode::Skipping { left: self.limits.max_frame_bytes, trail });
    }
}
