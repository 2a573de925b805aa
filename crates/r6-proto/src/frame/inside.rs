//! The inside of one frame: what is open, and whether the next byte can stand there.

use super::{FrameFault, Limits, can_hold_object, is_blank};
use crate::text::{self, Progress, StringState};

/// How far a frame was read, whatever pieces it came in.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Inside {
    /// How many objects and lists are open.
    depth: u64,
    /// One bit for each of the first [`Limits::DEEPEST`] levels, the innermost lowest: set for an object.
    objects: u64,
    /// The last byte outside strings that is no blank.
    previous: u8,
    /// The string that is open, where one is.
    string: Option<StringState>,
    /// A bracket of the wrong kind was met.
    tangled: bool,
}

/// How a walk through a frame ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Walk {
    /// With the bytes.
    Out,
    /// With the frame's last brace.
    Closed,
    /// With a byte that cannot stand there. It is the last that was read; a `{` that begins another frame is
    /// left unread.
    Fault(FrameFault),
}

impl Inside {
    /// Behind the first brace of a frame.
    pub const BEGIN: Self = Self { depth: 1, objects: 1, previous: b'{', string: None, tangled: false };

    /// How many objects and lists are open.
    pub fn depth(&self) -> u64 {
        self.depth
    }

    /// The last byte outside strings that is no blank.
    pub fn previous(&self) -> u8 {
        self.previous
    }

    /// Whether a bracket of the wrong kind was met: from there on the depth is a guess.
    pub fn is_tangled(&self) -> bool {
        self.tangled
    }

    /// Walks on through the bytes from the offset `from`; returns the offset of the next unread byte.
    ///
    /// With a depth limit of `None` the frame is known to be broken: neither depth nor brackets are faults any
    /// more, and any closing bracket closes one level.
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
            // What changes with every byte is kept at hand.
            let Self { mut depth, mut objects, mut previous, .. } = *self;
            let mut ended = Walk::Out;
            while let Some(&byte) = bytes.get(at) {
                at += 1;
                match byte {
                    b'"' => {
                        // Nearly every string is plain, and at hand as a whole.
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
