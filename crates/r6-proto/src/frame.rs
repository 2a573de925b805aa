//! Where frames begin and end on a byte stream: JSON objects one after the other, with nothing between them that could
//! be relied upon (manual 3).
//!
//! The reader counts brackets and steps over strings; it does not check the JSON inside, which is the decoder's
//! part. Broken input costs the frame that is broken and at most the one right behind it, and one [`FrameError`].
//! After it the next `{` begins a frame, unless it may belong to what was broken: an object inside another stands
//! behind `:`, `[` or `,`, where no frame begins.

mod fault;
mod inside;

use fault::HEAD_BYTES;
pub use fault::{FrameError, FrameFault};
use inside::{Inside, Walk};

/// How large a frame may be, in bytes and in levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The longest frame in bytes, from its first to its last brace.
    pub max_frame_bytes: usize,
    /// How many objects and lists may be open at once, the frame itself counted; at most [`Limits::DEEPEST`].
    pub max_depth: usize,
}

impl Limits {
    /// More levels than this are never followed: their kinds are kept in the bits of one word.
    pub const DEEPEST: usize = 64;
}

impl Default for Limits {
    /// 65 536 bytes and 32 levels.
    fn default() -> Self {
        // 64 KiB hold an AddRCC of some 280 motions or an AddPoints of some 450 points, where controllers take
        // 10 and cameras see dozens; and it is what a hostile peer can make us keep. The manual's deepest frame
        // nests five levels.
        Self { max_frame_bytes: 65_536, max_depth: 32 }
    }
}

/// One complete frame: a JSON object from its first to its last brace, balanced, but not otherwise checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'b> {
    /// The bytes, braces included.
    pub bytes: &'b [u8],
    /// Where the first brace stood, in bytes from the beginning of the stream.
    pub stream_offset: u64,
}

/// Finds the frames in a stream of bytes that arrive in pieces of any size.
///
/// Put bytes in with [`push`](Self::push) (or read them into [`spare_mut`](Self::spare_mut) and
/// [`commit`](Self::commit)), then take frames out with [`next`](Self::next) until there is none. Every byte is looked
/// at once, however the stream is cut. Memory is bounded by [`Limits::max_frame_bytes`] and [`READ_ROOM`]; it grows
/// from nothing with the frames that come and is then reused.
#[derive(Debug)]
pub struct FrameBuffer {
    limits: Limits,
    /// The bytes in use are those from `begin` to `filled`; the rest is room.
    storage: Vec<u8>,
    /// The first byte of what is being read, or the next byte where nothing has to be kept.
    begin: usize,
    /// The next byte to look at.
    at: usize,
    filled: usize,
    /// Stream offset of the first byte of `storage`.
    base: u64,
    mode: Mode,
    /// Stream offset where the present mode's bytes begin.
    began: u64,
    /// How far the frame was read, in the modes `Frame` and `Discarding`.
    inside: Inside,
    examined: u64,
}

/// Room that there is at least for new bytes once all frames are taken out: a usual read of a socket.
pub const READ_ROOM: usize = 4096;

/// What the bytes at hand belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    /// Nothing: the next byte that is no blank decides.
    Between,
    /// A byte order mark, of which so many bytes were seen.
    Mark { seen: usize },
    /// Garbage that was not reported yet; its first bytes are kept.
    Garbage { trail: Trail },
    /// A frame.
    Frame,
    /// A frame that was reported as broken, up to its last brace.
    Discarding,
    /// What may still come of reported garbage or of a broken frame, for so many bytes more.
    Skipping { left: usize, trail: Trail },
}

/// What one look at the bytes in one mode came to.
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

/// Takes the place of the previous byte where a frame may begin in any case.
const NOTHING: u8 = 0;

/// Whether an object can be inside another behind this byte.
fn can_hold_object(previous: u8) -> bool {
    matches!(previous, b':' | b'[' | b',')
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n')
}

/// The way through bytes that belong to no frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Trail {
    /// The last byte that is no blank.
    previous: u8,
    /// The bytes look like the inside of a frame: they began with punctuation of JSON, or held a quote. Objects
    /// may then be nested in it, which must not be taken for frames.
    inner: bool,
}

impl Trail {
    /// Takes the next byte, unless it is the first of a frame.
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
    /// A buffer at the beginning of a stream; it allocates when bytes come.
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

    /// Appends bytes of the stream and tells how many there was room for: at least [`READ_ROOM`], or all, once
    /// [`next`](Self::next) has returned `None`. Push the others again after that.
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

    /// Room to read new bytes of the stream into; not empty once [`next`](Self::next) has returned `None`.
    #[must_use]
    pub fn spare_mut(&mut self) -> &mut [u8] {
        self.room(READ_ROOM)
    }

    /// Declares the first `count` bytes of [`spare_mut`](Self::spare_mut) to be the next bytes of the stream.
    pub fn commit(&mut self, count: usize) {
        self.filled = self.filled.saturating_add(count).min(self.storage.len());
    }

    /// The next frame or fault; `None` when more bytes are needed.
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

    /// The bytes that wait where a frame may begin, as many as a frame may have; none within a frame or within what is skipped.
    #[inline]
    pub(crate) fn waiting(&self) -> &[u8] {
        if self.mode == Mode::Between { self.unread(self.limits.max_frame_bytes) } else { &[] }
    }

    /// Takes so many bytes of [`Self::waiting`], which are known to be a frame.
    #[inline]
    pub(crate) fn take_frame(&mut self, length: usize) -> &[u8] {
        let from = self.at;
        self.advance(length);
        self.enter(Mode::Between);
        self.storage.get(from..self.at).unwrap_or_default()
    }

    /// How many bytes came since the beginning of what is not complete: a frame, garbage, or the rest of either that
    /// is being skipped.
    ///
    /// 0 between frames, once [`next`](Self::next) has returned `None`. While it stays above 0 and nothing
    /// comes, the peer has stalled.
    #[must_use]
    pub fn pending(&self) -> usize {
        if self.mode == Mode::Between {
            return 0;
        }
        usize::try_from(self.offset(self.filled) - self.began).unwrap_or(usize::MAX)
    }

    /// Gives up what is not complete, because the peer closed the stream or has stalled; what still comes of it is
    /// skipped. Returns the error for it, or `None` where there is nothing or it was reported before.
    ///
    /// To be called when [`next`](Self::next) has returned `None`.
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

    /// Forgets everything but the memory: the beginning of a new stream, at offset 0.
    pub fn reset(&mut self) {
        *self = Self { storage: std::mem::take(&mut self.storage), ..Self::new(self.limits) };
    }

    /// How many bytes were looked at or moved since the beginning of the stream, a byte twice counting twice: what
    /// the work is proportional to.
    #[must_use]
    pub fn examined(&self) -> u64 {
        self.examined
    }

    /// Room behind the bytes in use: `wanted` bytes unless the limit or untaken frames forbid it.
    fn room(&mut self, wanted: usize) -> &mut [u8] {
        let kept = self.filled - self.begin;
        // Moving must be paid for by bytes that have left since the last time, or the whole would not be linear.
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

    /// The bytes not looked at yet, at most `most`.
    fn unread(&self, most: usize) -> &[u8] {
        self.storage.get(self.at..self.filled.min(self.at.saturating_add(most))).unwrap_or_default()
    }

    /// Marks the next `count` bytes as looked at.
    fn advance(&mut self, count: usize) {
        self.at += count;
        self.examined += count as u64;
    }

    /// Goes into a mode whose bytes begin here.
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

    /// Reads garbage until there is enough of it for a report, or until it ends.
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

    /// Skips what was reported, up to the next frame.
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

    /// Follows a trail through at most `most` bytes; tells whether it ended at the next frame.
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

    /// Walks on through the frame, not beyond the index `end`.
    fn walk(&mut self, end: usize, max_depth: Option<usize>) -> Walk {
        let end = end.min(self.filled);
        let known = self.storage.get(..end).unwrap_or(&self.storage);
        let (at, walk) = self.inside.walk(known, self.at, max_depth);
        self.advance(at - self.at);
        walk
    }

    /// Decides where reading goes on after a fault in a frame.
    fn recover(&mut self, fault: FrameFault) {
        self.begin = self.at;
        match fault {
            FrameFault::TooLarge { .. } | FrameFault::TooDeep { .. } => self.mode = Mode::Discarding,
            FrameFault::MismatchedBracket { .. } if self.inside.depth() > 0 => self.mode = Mode::Discarding,
            FrameFault::MismatchedBracket { .. } | FrameFault::TextBehindString { .. } => {
                self.skip_rest(self.inside.previous());
            }
            FrameFault::ObjectWhereNoneCanStand => self.enter(Mode::Between),
            // The control byte ends what was cut off: the next byte may begin a frame.
            FrameFault::ControlByteInString { .. } | FrameFault::Garbage | FrameFault::Incomplete { .. } => {
                self.skip_rest(NOTHING);
            }
        }
    }

    /// Skips what may still come of a broken frame, whose last byte that is no blank was `previous`.
    fn skip_rest(&mut self, previous: u8) {
        let trail = Trail { previous, inner: true };
        self.enter(Mode::Skipping { left: self.limits.max_frame_bytes, trail });
    }
}
