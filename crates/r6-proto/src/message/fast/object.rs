//! Reads keys and members by habit: it expects the order of the last object.

use super::{Pattern, short_number, short_text, text};
use crate::sixteen_bytes::Chunk;
use crate::value::Node;

/// Remembers the order in which `COUNT` known keys came last time.
#[derive(Clone, Debug)]
pub(in crate::message) struct Habit<const COUNT: usize> {
    /// The slot that followed each slot; the first key's slot is in `first`.
    next: [u8; COUNT],
    first: u8,
    last: Option<u8>,
}

impl<const COUNT: usize> Default for Habit<COUNT> {
    fn default() -> Self {
        Self { next: [0; COUNT], first: 0, last: None }
    }
}

impl<const COUNT: usize> Habit<COUNT> {
    /// Begins an object.
    #[inline(always)]
    pub fn begin(&mut self) {
        self.last = None;
    }

    /// The slot that comes next if the order is the same as last time.
    #[inline(always)]
    fn expected(&self) -> u8 {
        match self.last {
            None => self.first,
            Some(last) => self.next.get(usize::from(last)).copied().unwrap_or(0),
        }
    }

    /// Records that this slot came now.
    #[inline(always)]
    fn came(&mut self, slot: u8) {
        let place = match self.last {
            None => Some(&mut self.first),
            Some(last) => self.next.get_mut(usize::from(last)),
        };
        if let Some(place) = place {
            *place = slot;
        }
        self.last = Some(slot);
    }

    /// Reads a known key and its colon. Returns its slot, the key, and where its value begins. `slot_of`
    /// returns the slot of a name that is not the expected one.
    #[inline(always)]
    pub fn key(
        &mut self,
        bytes: &[u8],
        at: usize,
        patterns: &[Pattern; COUNT],
        slot_of: impl FnOnce(&[u8]) -> Option<usize>,
    ) -> Option<(usize, Node, usize)> {
        let expected = self.expected();
        let pattern = patterns.get(usize::from(expected))?;
        if pattern.matches(Chunk::at(bytes, at)) {
            self.last = Some(expected);
            let value = at + pattern.length;
            return Some((usize::from(expected), text(at + 1, value - 2), value));
        }
        if bytes.get(at) != Some(&b'"') {
            return None;
        }
        let key = short_text(bytes, at + 1)?;
        let end = key.span.end as usize;
        let slot = slot_of(key.span.of(bytes)).filter(|_| bytes.get(end + 1) == Some(&b':'))?;
        self.came(u8::try_from(slot).ok()?);
        Some((slot, key, end + 2))
    }
}

/// The short plain text or number that begins here.
#[inline(always)]
fn short_value(bytes: &[u8], at: usize) -> Option<(Node, usize)> {
    if bytes.get(at) == Some(&b'"') {
        let node = short_text(bytes, at + 1)?;
        Some((node, node.span.end as usize + 1))
    } else {
        let node = short_number(bytes, at)?;
        Some((node, node.span.end as usize))
    }
}

impl<const COUNT: usize> Habit<COUNT> {
    /// Reads a whole object of known keys, each at most once, with short plain values. Returns the present
    /// slots and the offset after the object. Returns `None` for anything else; `members` then holds nothing
    /// useful.
    #[inline]
    pub fn object(
        &mut self,
        bytes: &[u8],
        from: usize,
        patterns: &[Pattern; COUNT],
        slot_of: impl Fn(&[u8]) -> Option<usize>,
        members: &mut [(Node, Node); COUNT],
    ) -> Option<(u64, usize)> {
        let mut at = from;
        let mut present = 0_u64;
        self.begin();
        let mut before = b'{';
        loop {
            if bytes.get(at) != Some(&before) {
                return (before == b',' && bytes.get(at) == Some(&b'}')).then_some((present, at + 1));
            }
            before = b',';
            let (slot, key, value) = self.key(bytes, at + 1, patterns, &slot_of)?;
            let (value, behind) = short_value(bytes, value)?;
            if present >> slot & 1 == 1 {
                return None;
            }
            present |= 1 << slot;
            *members.get_mut(slot)? = (key, value);
            at = behind;
        }
    }
}
