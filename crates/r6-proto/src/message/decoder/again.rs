//! Decodes a repeated reply. A poll gets the same reply again and again, and only the number and the values
//! differ. The bytes around them are compared with the last reply, as two blocks.
//!
//! ```text
//!  {"dsID":…,"packID":" │ 17 │ ","queryAddr":[…],"queryData":[ │ "10.250","7" │ ]}
//!   before: one block     number    between: one block            values read     behind
//! ```
//!
//! If anything else differs, even the length of the number, the decoder reads the whole frame. The members
//! after the values (usually `reqType`) move with the length of the values.

use std::ops::Range;

use crate::message::decoder::{Shape, Top, TopNodes};
use crate::message::fast;
use crate::value::{Kind, Node};

/// The last frame, if it was a reply to a query whose values are short plain texts.
#[derive(Debug)]
pub(super) struct LastReply {
    /// The frame up to the first value, and the part after the last value.
    before: Vec<u8>,
    behind: Vec<u8>,
    /// Position in `before` of the digits of `packID`; empty if the frame has no `packID`.
    digits: Range<usize>,
    /// Position in the frame where `behind` began.
    behind_at: usize,
    /// The slots of the members at the top that are in `behind`, as bits.
    slots_behind: u32,
    /// Whether the last frame was such a reply.
    is_known: bool,
    pub top: TopNodes,
}

impl Default for LastReply {
    fn default() -> Self {
        Self {
            before: Vec::new(),
            behind: Vec::new(),
            digits: 0..0,
            behind_at: 0,
            slots_behind: 0,
            is_known: false,
            top: TopNodes::NONE,
        }
    }
}

impl LastReply {
    /// Records that the last frame was something else.
    pub fn forget(&mut self) {
        self.is_known = false;
    }

    /// Stores a frame that was read completely, with the members at its top and its values.
    pub fn keep(&mut self, bytes: &[u8], top: &TopNodes, shape: Shape, values: &[Node]) {
        let is_plain = |node: &Node| node.kind == Kind::Text { has_escape: false, utf8: true };
        let (Shape::QueryReply, Some(list)) = (shape, top.at(Top::QueryData)) else { return };
        let (Some(first), Some(last)) = (values.first(), values.last()) else { return };
        let digits = match top.at(Top::PackId) {
            None => 0..0,
            Some(number) if is_plain(&number) && number.span.end < list.span.start => {
                number.span.start as usize..number.span.end as usize
            }
            Some(_) => return,
        };
        let (values_at, behind_at) = (first.span.start as usize - 1, last.span.end as usize + 1);
        let (Some(before), Some(behind)) = (bytes.get(..values_at), bytes.get(behind_at..)) else { return };
        if list.kind != Kind::List || !values.iter().all(is_plain) || behind.first() != Some(&b']') {
            return;
        }
        let slots_behind = top.slots_behind(behind_at);
        if slots_behind & Top::QueryAddr.bit() != 0 {
            return;
        }
        self.before.clear();
        self.before.extend_from_slice(before);
        self.behind.clear();
        self.behind.extend_from_slice(behind);
        (self.digits, self.is_known, self.top) = (digits, true, *top);
        (self.behind_at, self.slots_behind) = (behind_at, slots_behind);
    }

    /// If `bytes` begin with the same reply, with another number and other values, returns the length of that
    /// frame and puts the values into `values`.
    #[inline]
    pub fn length_of(&mut self, bytes: &[u8], values: &mut Vec<Node>) -> Option<usize> {
        if !self.is_known {
            return None;
        }
        let (begins, rest) = bytes.split_at_checked(self.before.len())?;
        let (Range { start, end }, same) =
            (self.digits.clone(), |range: Range<usize>| begins.get(range.clone()) == self.before.get(range));
        if !same(end..begins.len()) || !same(0..start) {
            return None;
        }
        if !begins.get(start..end)?.iter().all(u8::is_ascii_digit) || rest.first() != Some(&b'"') {
            return None;
        }
        values.clear();
        let behind_at = fast::read_texts(bytes, begins.len(), values);
        let behind = bytes.get(behind_at..)?.get(..self.behind.len())?;
        if behind != self.behind {
            return None;
        }
        if behind_at != self.behind_at {
            self.top.move_members(self.slots_behind, self.behind_at, behind_at);
            self.behind_at = behind_at;
        }
        Some(behind_at + self.behind.len())
    }
}
