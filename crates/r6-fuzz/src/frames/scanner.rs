//! Implements the rules of frame boundaries again, as plainly as possible: one byte after the other, with the
//! whole stream, without resuming and without fast paths. For UTF-8 streams only.

use r6_proto::frame::{FrameFault, Limits};

/// A frame or a fault of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    Frame { at: u64, length: usize },
    Fault { at: u64, fault: FrameFault },
}

/// What the current bytes belong to.
enum Mode {
    Between,
    /// Bytes outside a frame that are not reported yet.
    Garbage {
        from: usize,
        trail: Trail,
    },
    Frame {
        from: usize,
        walk: Walk,
    },
    /// A frame that was reported as broken, up to its end.
    Discarding {
        walk: Walk,
    },
    /// Reported bytes, for at most `left` more bytes.
    Skipping {
        left: usize,
        trail: Trail,
    },
}

/// The state between frames: whether a `{` may be inside of the broken frame.
#[derive(Clone, Copy, Default)]
struct Trail {
    previous: u8,
    inner: bool,
}

impl Trail {
    fn ends_before(&mut self, byte: u8) -> bool {
        let nested = self.inner && b":[,".contains(&self.previous);
        if byte == b'{' && !nested {
            return true;
        }
        if !b" \t\r\n".contains(&byte) {
            self.inner |= byte == b'"' || (self.previous == 0 && b",:[]}".contains(&byte));
            self.previous = byte;
        }
        false
    }
}

/// The state inside a frame.
struct Walk {
    open: Vec<u8>,
    previous: u8,
    string: bool,
    escape: bool,
    tangled: bool,
}

enum Step {
    On,
    Closed,
    Fault(FrameFault),
}

impl Walk {
    fn begin() -> Self {
        Self { open: vec![b'{'], previous: b'{', string: false, escape: false, tangled: false }
    }

    fn step(&mut self, byte: u8, max_depth: Option<usize>) -> Step {
        if self.string {
            return self.step_in_string(byte);
        }
        let previous = self.previous;
        if byte == b'{' && !b":[,".contains(&previous) {
            return Step::Fault(FrameFault::ObjectWhereNoneCanStand);
        }
        if b" \t\r\n".contains(&byte) {
            return Step::On;
        }
        self.previous = byte;
        match byte {
            b'"' => self.string = true,
            b'{' | b'[' => {
                self.open.push(byte);
                if let Some(limit) = max_depth.filter(|limit| self.open.len() > *limit) {
                    return Step::Fault(FrameFault::TooDeep { limit });
                }
            }
            b'}' | b']' => return self.close(byte, max_depth.is_some()),
            _ if previous == b'"' && byte.is_ascii_alphanumeric() => {
                return Step::Fault(FrameFault::TextBehindString { found: char::from(byte) });
            }
            _ => {}
        }
        Step::On
    }

    fn step_in_string(&mut self, byte: u8) -> Step {
        let escaped = std::mem::take(&mut self.escape);
        match byte {
            0..0x20 => {
                self.string = false;
                return Step::Fault(FrameFault::ControlByteInString { byte });
            }
            b'\\' => self.escape = !escaped,
            b'"' if !escaped => {
                self.string = false;
                self.previous = b'"';
            }
            _ => {}
        }
        Step::On
    }

    fn close(&mut self, byte: u8, strict: bool) -> Step {
        let known = self.open.len() <= Limits::DEEPEST;
        let expected = if self.open.pop() == Some(b'{') { b'}' } else { b']' };
        if known && byte != expected {
            self.tangled = true;
            if strict {
                let (expected, found) = (char::from(expected), char::from(byte));
                return Step::Fault(FrameFault::MismatchedBracket { expected, found });
            }
        }
        if self.open.is_empty() { Step::Closed } else { Step::On }
    }
}

/// All frames and faults of a stream, including a fault at its end.
pub fn scan(stream: &[u8], limits: Limits) -> Vec<Found> {
    let mut found = Vec::new();
    let mut mode = Mode::Between;
    let mut at = 0;
    let skipping =
        |previous| Mode::Skipping { left: limits.max_frame_bytes, trail: Trail { previous, inner: true } };
    // Where reading continues after a fault. The faulty byte counts as read, unless it begins a frame.
    let behind = |fault, walk: Walk| match fault {
        FrameFault::TooLarge { .. } | FrameFault::TooDeep { .. } => Mode::Discarding { walk },
        FrameFault::MismatchedBracket { .. } if !walk.open.is_empty() => Mode::Discarding { walk },
        FrameFault::MismatchedBracket { .. } | FrameFault::TextBehindString { .. } => skipping(walk.previous),
        FrameFault::ObjectWhereNoneCanStand => Mode::Between,
        FrameFault::ControlByteInString { .. } | FrameFault::Garbage | FrameFault::Incomplete { .. } => {
            skipping(0)
        }
    };
    while let Some(&byte) = stream.get(at) {
        let offset = |from: usize| u64::try_from(from).unwrap();
        mode = match mode {
            Mode::Between => match byte {
                b' ' | b'\t' | b'\r' | b'\n' | 0 => {
                    at += 1;
                    Mode::Between
                }
                b'{' => {
                    at += 1;
                    Mode::Frame { from: at - 1, walk: Walk::begin() }
                }
                0xEF => {
                    let mark = [0xEF, 0xBB, 0xBF];
                    let same = stream[at..].iter().zip(mark).take_while(|(a, b)| **a == *b).count();
                    let from = at;
                    at += same;
                    if same == mark.len() {
                        Mode::Between
                    } else {
                        Mode::Garbage { from, trail: Trail::default() }
                    }
                }
                _ => Mode::Garbage { from: at, trail: Trail::default() },
            },
            Mode::Garbage { from, mut trail } => {
                let ended = trail.ends_before(byte);
                at += usize::from(!ended);
                if !ended && at - from < 16 {
                    Mode::Garbage { from, trail }
                } else {
                    found.push(Found::Fault { at: offset(from), fault: FrameFault::Garbage });
                    if ended { Mode::Between } else { Mode::Skipping { left: limits.max_frame_bytes, trail } }
                }
            }
            Mode::Skipping { left, mut trail } => {
                if left == 0 || trail.ends_before(byte) {
                    Mode::Between
                } else {
                    at += 1;
                    Mode::Skipping { left: left - 1, trail }
                }
            }
            Mode::Frame { from, walk } if at - from >= limits.max_frame_bytes => {
                let fault = FrameFault::TooLarge { limit: limits.max_frame_bytes };
                found.push(Found::Fault { at: offset(from), fault });
                Mode::Discarding { walk }
            }
            Mode::Frame { from, mut walk } => match walk.step(byte, Some(limits.max_depth)) {
                Step::On => {
                    at += 1;
                    Mode::Frame { from, walk }
                }
                Step::Closed => {
                    at += 1;
                    found.push(Found::Frame { at: offset(from), length: at - from });
                    Mode::Between
                }
                Step::Fault(fault) => {
                    at += usize::from(fault != FrameFault::ObjectWhereNoneCanStand);
                    found.push(Found::Fault { at: offset(from), fault });
                    behind(fault, walk)
                }
            },
            Mode::Discarding { mut walk } => match walk.step(byte, None) {
                Step::On => {
                    at += 1;
                    Mode::Discarding { walk }
                }
                Step::Closed => {
                    at += 1;
                    if walk.tangled { skipping(walk.previous) } else { Mode::Between }
                }
                Step::Fault(fault) => {
                    at += usize::from(fault != FrameFault::ObjectWhereNoneCanStand);
                    behind(fault, walk)
                }
            },
        };
    }
    let fault = match mode {
        Mode::Between | Mode::Skipping { .. } | Mode::Discarding { .. } => return found,
        Mode::Garbage { from, .. } => (from, FrameFault::Garbage),
        Mode::Frame { from, .. } => (from, FrameFault::Incomplete { received: stream.len() - from }),
    };
    found.push(Found::Fault { at: u64::try_from(fault.0).unwrap(), fault: fault.1 });
    found
}
