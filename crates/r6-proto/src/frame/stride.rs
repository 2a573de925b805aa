//! The fast way through the inside of a frame: block by block, for as long as everything is regular.
//!
//! It decides nothing that is out of the ordinary. A block in which an escape, a blank, a byte beyond ASCII or
//! anything wrong stands before the frame's end is left to [`Inside::walk`], whose state it shares: what frames and
//! faults there are does not depend on who walks, which a test of the frame buffer checks.

use super::blocks::{self, BLOCK, Masks};
use super::can_hold_object;
use super::inside::{Inside, Walk};
use crate::text::StringState;

/// What the bits behind the frame's last byte in a block were, so that the next frame need not look again.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Looked {
    /// Index of the block's first byte, and how many of its bytes were there.
    at: usize,
    count: usize,
    masks: Masks,
}

/// From how many bytes on blocks are faster than the walk byte by byte.
const WORTH_IT: usize = 16;

/// How a stride ended.
enum Stride {
    /// With the bytes.
    Out,
    /// With the frame's last brace.
    Closed,
    /// At a block that is not regular.
    Irregular,
    /// Where it began: this processor has nothing that is faster than the walk.
    Never,
}

impl Inside {
    /// Walks on through the bytes up to `end` from the offset `from`, as [`Inside::walk`] does and with the same result.
    ///
    /// `bytes` may go on behind `end`; what stands there counts for nothing.
    pub fn stride(
        &mut self,
        bytes: &[u8],
        from: usize,
        end: usize,
        max_depth: Option<usize>,
        looked: &mut Looked,
    ) -> (usize, Walk) {
        let known = bytes.get(..end).unwrap_or(bytes);
        let mut at = from;
        while at < end {
            if let Some(limit) = max_depth
                && end - at >= WORTH_IT
                && self.is_regular()
            {
                let (reached, stride) = best(self, bytes, at, end, limit, looked);
                at = reached;
                match stride {
                    Stride::Out => return (at, Walk::Out),
                    Stride::Closed => return (at, Walk::Closed),
                    Stride::Irregular => {}
                    Stride::Never => return self.walk(known, at, max_depth),
                }
            }
            let block = known.get(..at.saturating_add(BLOCK)).unwrap_or(known);
            let (reached, walk) = self.walk(block, at, max_depth);
            at = reached;
            if walk != Walk::Out {
                return (at, walk);
            }
        }
        (at, Walk::Out)
    }

    /// Whether the state is one that blocks can go on from: no broken frame, no escape and nothing but ASCII in an open string.
    fn is_regular(&self) -> bool {
        !self.tangled && self.string.is_none_or(|string| string == StringState::default())
    }

    /// One stride with the masks that `classify` makes of a block.
    #[inline(always)]
    fn stride_by(
        &mut self,
        classify: impl Fn(&[u8; BLOCK]) -> Masks,
        bytes: &[u8],
        from: usize,
        end: usize,
        max_depth: usize,
        looked: &mut Looked,
    ) -> (usize, Stride) {
        let mut at = from;
        let mut state = State::of(self);
        let mut ended = Stride::Out;
        while at < end {
            if at < looked.at || at >= looked.at + looked.count {
                *looked = Looked { at, count: BLOCK.min(end - at), masks: classify(&block_at(bytes, at)) };
            }
            let seen = *looked;
            match state.take(&seen.masks, at - seen.at, seen.count.min(end - seen.at), max_depth) {
                Taken::All => at = end.min(seen.at + seen.count),
                Taken::Closed(count) => {
                    at = seen.at + count;
                    ended = Stride::Closed;
                    break;
                }
                Taken::None => {
                    ended = Stride::Irregular;
                    break;
                }
            }
        }
        state.leave(self, bytes.get(from..at).unwrap_or_default());
        (at, ended)
    }
}

/// The block from this offset on; bytes that are not there are 0.
#[inline(always)]
fn block_at(bytes: &[u8], at: usize) -> [u8; BLOCK] {
    let rest = bytes.get(at..).unwrap_or_default();
    if let Some(block) = rest.first_chunk::<BLOCK>() {
        return *block;
    }
    let mut block = [0; BLOCK];
    if let Some(part) = block.get_mut(..rest.len()) {
        part.copy_from_slice(rest);
    }
    block
}

/// The state of [`Inside`] in the form in which blocks carry it on.
struct State {
    depth: u64,
    objects: u64,
    /// All bits set inside a string.
    in_string: u64,
    /// 1 where an object can stand next.
    holds: u64,
    /// 1 behind a closing quote.
    closed: u64,
}

/// What was taken of a block.
enum Taken {
    All,
    /// Up to this number of its bytes, behind the frame's last brace.
    Closed(usize),
    /// Nothing: it is not regular.
    None,
}

impl State {
    #[inline(always)]
    fn of(inside: &Inside) -> Self {
        let outside = inside.string.is_none();
        Self {
            depth: inside.depth,
            objects: inside.objects,
            in_string: if outside { 0 } else { u64::MAX },
            holds: u64::from(outside && can_hold_object(inside.previous)),
            closed: u64::from(outside && inside.previous == b'"'),
        }
    }

    /// Takes the bytes of a block from number `from` up to number `to`.
    #[inline(always)]
    fn take(&mut self, masks: &Masks, from: usize, to: usize, max_depth: usize) -> Taken {
        let there = u64::MAX >> (BLOCK - to) & u64::MAX << from;
        let quote = masks.quote & there;
        // What came before in this block may have had an odd number of quotes.
        let before = 0_u64.wrapping_sub(masks.strings << 1 >> from & 1);
        // From each opening quote on, up to the byte before the closing one.
        let strings = masks.strings ^ before ^ self.in_string;
        let outside = there & !(strings | quote);
        let (open, close) = (masks.open & outside, masks.close & outside);
        let separator = masks.separator & outside;
        let ends = quote & !strings;
        let holders = separator | (open & !masks.object);
        let brackets = open | close;
        let lost = (ends << 1 | self.closed << from) & there & !(separator | brackets);
        let misplaced = open & masks.object & !(holders << 1 | self.holds << from);
        let bad = (masks.irregular & there) | lost | misplaced;
        // Up to the first that is bad, everything is known.
        let mut left = brackets & bad.wrapping_sub(1) & !bad;
        let (mut depth, mut objects) = (self.depth, self.objects);
        while left != 0 {
            let bit = left.trailing_zeros();
            left &= left - 1;
            let is_object = masks.object >> bit & 1;
            if open >> bit & 1 == 1 {
                objects = objects << 1 | is_object;
                depth += 1;
                if depth > max_depth as u64 {
                    return Taken::None;
                }
            } else {
                if (objects ^ is_object) & 1 == 1 {
                    return Taken::None;
                }
                objects >>= 1;
                depth -= 1;
                if depth == 0 {
                    *self = Self { depth, objects, in_string: 0, holds: 0, closed: 0 };
                    return Taken::Closed(bit as usize + 1);
                }
            }
        }
        if bad != 0 {
            return Taken::None;
        }
        let last = to - 1;
        *self = Self {
            depth,
            objects,
            in_string: 0_u64.wrapping_sub(strings >> last & 1),
            holds: holders >> last & 1,
            closed: ends >> last & 1,
        };
        Taken::All
    }

    /// Gives the state back, behind these bytes.
    fn leave(&self, inside: &mut Inside, taken: &[u8]) {
        let outside = self.in_string == 0;
        inside.depth = self.depth;
        inside.objects = self.objects;
        inside.string = if outside { None } else { Some(StringState::default()) };
        // Inside a string it will be the closing quote before anybody asks.
        if let Some(last) = taken.last().filter(|_| outside) {
            inside.previous = *last;
        }
    }
}

/// A stride with the best that this processor has.
#[cfg(target_arch = "x86_64")]
#[inline]
#[allow(unsafe_code, reason = "calling a function for a processor that was just found to be one of those")]
fn best(
    inside: &mut Inside,
    bytes: &[u8],
    from: usize,
    end: usize,
    max_depth: usize,
    looked: &mut Looked,
) -> (usize, Stride) {
    if is_x86_feature_detected!("avx512bw") && is_x86_feature_detected!("pclmulqdq") {
        // SAFETY: the processor has AVX-512BW, with it AVX-512F, and PCLMULQDQ. Nothing else is asked of the caller.
        unsafe { with_avx512(inside, bytes, from, end, max_depth, looked) }
    } else if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("pclmulqdq") {
        // SAFETY: the processor has AVX2 and PCLMULQDQ. Nothing else is asked of the caller.
        unsafe { with_avx2(inside, bytes, from, end, max_depth, looked) }
    } else {
        (from, Stride::Never)
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn best(_: &mut Inside, _: &[u8], from: usize, _: usize, _: usize, _: &mut Looked) -> (usize, Stride) {
    (from, Stride::Never)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,pclmulqdq")]
fn with_avx512(
    inside: &mut Inside,
    bytes: &[u8],
    from: usize,
    end: usize,
    max_depth: usize,
    looked: &mut Looked,
) -> (usize, Stride) {
    inside.stride_by(|block| blocks::avx512(block), bytes, from, end, max_depth, looked)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,pclmulqdq")]
fn with_avx2(
    inside: &mut Inside,
    bytes: &[u8],
    from: usize,
    end: usize,
    max_depth: usize,
    looked: &mut Looked,
) -> (usize, Stride) {
    inside.stride_by(|block| blocks::avx2(block), bytes, from, end, max_depth, looked)
}

/// The masks of a block by everything else that this processor has.
#[cfg(all(test, target_arch = "x86_64"))]
#[allow(unsafe_code, reason = "as in `best`")]
pub(super) fn with_each_feature(block: &[u8; BLOCK], mut check: impl FnMut(&str, Masks)) {
    if is_x86_feature_detected!("avx512bw") && is_x86_feature_detected!("pclmulqdq") {
        // SAFETY: as in `best`.
        check("avx512", unsafe { blocks::avx512(block) });
    }
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("pclmulqdq") {
        // SAFETY: as in `best`.
        check("avx2", unsafe { blocks::avx2(block) });
    }
}
