//! The inside of one frame: its open levels, and whether the next byte is allowed.

use super::{FrameFault, Limits, can_hold_object, is_blank};
use crate::text::{self, Progress, StringState};

/// The position inside a frame. It does not depend on how the bytes were split.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Inside {
    /// How many objects and lists are open.
    depth: u64,
    /// One bit for each of the first [`Limits::DEEPEST`] levels, the innermost lowest. A set bit means an
    /// object.
    objects: u64,
    /// The last byte outside strings that is not a blank.
    previous: u8,
    /// The open string, if any.
    string: Option<StringState>,
    /// Whether a bracket of the wrong kind was found.
    tangled: bool,
}

/// How a walk through a frame ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Walk {
    /// The bytes ended first.
    Out,
    /// The last brace of the frame was read.
    Closed,
    /// A byte is not allowed. It is the last byte read, except for a `{` that begins another frame, which
    /// stays unread.
    Fault(FrameFault),
}

impl Inside {
    /// The position after the first brace of a frame.
    pub const BEGIN: Self = Self { depth: 1, objects: 1, previous: b'{', string: None, tangled: false };

    /// How many objects and lists are open.
    pub fn depth(&self) -> u64 {
        self.depth
    }

    /// The last byte outside strings that is not a blank.
    pub fn previous(&self) -> u8 {
        self.previous
    }

    /// Whether a bracket of the wrong kind was found. From there on the depth is a guess.
    pub fn is_tangled(&self) -> bool {
        self.tangled
    }

    /// Continues to walk through the bytes from the offset `from`. Returns the offset of the next unread
    /// byte.
    ///
    /// A depth limit of `None` means that the frame is known to be broken. Then neither depth nor brackets
    /// are faults, and any closing bracket closes one level.
    pub fn walk(&mut self, bytes: &[u8], from: usize, max_depth: Option<usize>) -> (usize, Walk) {
        let mut at = from;
        loop {
            if let Some(string) = &mut self.string {
                match string.advance(bytes, at) {
                    Progress::Open => return (bytes.len(), Walk::Out),
                    Progress::Closed(quote) => at = quote + 1,
                    Progress::ControlByte(control, byte) => {
                        return (control + 1, Walk::Fault(FrameFault::ControlByteInString { byte }));
                    }
                }
                self.string = None;
                self.previous = b'"';
            }
            // Values that change with every byte are local variables.
            let Self { mut depth, mut objects, mut previous, .. } = *self;
            let mut ended = Walk::Out;
            while let Some(&byte) = bytes.get(at) {
                at += 1;
                match byte {
                    b'"' => {
                        // Nearly every string is plain and has arrived completely.
                        at = text::plain_end(bytes, at);
                        if bytes.get(at) != Some(&b'"') {
                            self.string = Some(StringState::default());
                            break;
                        }
                        at += 1;
                    }
                    b',' | b':' => {}
                    b'{' | b'[' => {
                        if byte == b'{' && !can_hold_object(previous) {
                            at -= 1;
                            ended = Walk::Fault(FrameFault::ObjectWhereNoneCanStand);
                            break;
                        }
                        if depth < Limits::DEEPEST as u64 {
                            objects = objects << 1 | u64::from(byte == b'{');
                        }
                        depth += 1;
                        if let Some(limit) = max_depth
                            && depth > limit as u64
                        {
                            ended = Walk::Fault(FrameFault::TooDeep { limit });
                        }
                    }
                    b'}' | b']' => {
                        let known = depth <= Limits::DEEPEST as u64;
                        let expected = if objects & 1 == 1 { b'}' } else { b']' };
                        if known {
                            objects >>= 1;
                        }
                        depth -= 1;
                        if depth == 0 {
                            ended = Walk::Closed;
                        }
                        if known && byte != expected {
                            self.tangled = true;
                            if max_depth.is_some() {
                                ended = Walk::Fault(FrameFault::MismatchedBracket {
                                    expected: char::from(expected),
                                    found: char::from(byte),
                                });
                            }
                        }
                    }
                    _ if is_blank(byte) => continue,
                    _ => {
                        if previous == b'"' && byte.is_ascii_alphanumeric() {
                            ended = Walk::Fault(FrameFault::TextBehindString { found: char::from(byte) });
                        }
                    }
                }
                previous = byte;
                if ended != Walk::Out {
                    break;
                }
            }
            (self.depth, self.objects, self.previous) = (depth, objects, previous);
            if self.string.is_none() {
                return (at, ended);
            }
        }
    }
}
