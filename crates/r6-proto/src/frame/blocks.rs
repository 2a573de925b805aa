//! What 64 bytes hold, as one bit for each byte: quotes, brackets, and what only the walk byte by byte can judge.
//!
//! A frame is found by its brackets, and nearly every byte is none. Comparing 64 bytes at once with what counts takes a
//! few instructions where the processor has AVX2 or AVX-512, and is ten times as fast as a loop. Without them, eight bytes
//! are compared at once in an ordinary register: the same answer, which the tests hold against the others.

/// How many bytes a block has.
pub(super) const BLOCK: usize = 64;

/// The bytes of a block by kind; bit n is byte n.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Masks {
    /// `"`.
    pub quote: u64,
    /// The bytes up to and with which the number of quotes is odd: strings with their opening quotes, where none is open before.
    pub strings: u64,
    /// A control byte, a blank, a `\` or a byte beyond ASCII.
    pub irregular: u64,
    /// `,` or `:`.
    pub separator: u64,
    /// `{` or `[`.
    pub open: u64,
    /// `}` or `]`.
    pub close: u64,
    /// Of the brackets, those of objects. For other bytes it means nothing.
    pub object: u64,
}

/// The bit in which `{` and `}` differ from `[` and `]`.
const OBJECT_BIT: u8 = b'{' ^ b'[';

/// The masks by ordinary instructions, eight bytes at a time.
pub(super) fn portable(block: &[u8; BLOCK]) -> Masks {
    let (words, _) = block.as_chunks::<8>();
    let mut masks = Masks::default();
    for (at, word) in words.iter().enumerate() {
        let word = u64::from_le_bytes(*word);
        let either = word | (ONES * u64::from(OBJECT_BIT));
        let at = at * 8;
        masks.quote |= gather(equal(word, b'"')) << at;
        masks.irregular |= gather(equal(word, b'\\') | at_most_blank(word) | (word & TOPS)) << at;
        masks.separator |= gather(equal(word, b',') | equal(word, b':')) << at;
        masks.open |= gather(equal(either, b'{')) << at;
        masks.close |= gather(equal(either, b'}')) << at;
        masks.object |= gather(word << 2) << at;
    }
    masks.strings = [1, 2, 4, 8, 16, 32].iter().fold(masks.quote, |bits, distance| bits ^ bits << distance);
    masks
}

const ONES: u64 = 0x0101_0101_0101_0101;
const TOPS: u64 = ONES << 7;

/// Sets the top bit of each byte that is this one. No byte touches another.
fn equal(word: u64, byte: u8) -> u64 {
    let other = word ^ (ONES * u64::from(byte));
    !(((other & !TOPS) + !TOPS) | other) & TOPS
}

/// Sets the top bit of each ASCII byte up to and with the blank.
fn at_most_blank(word: u64) -> u64 {
    !((word & !TOPS) + ONES * (0x80 - 0x21)) & !word & TOPS
}

/// The top bits of the eight bytes, side by side.
fn gather(word: u64) -> u64 {
    ((word & TOPS) >> 7).wrapping_mul(0x0102_0408_1020_4080) >> 56
}

/// The bits up to and with which the number of bits set is odd: a multiplication by all ones that carries nothing.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "pclmulqdq")]
fn odd(bits: u64) -> u64 {
    use std::arch::x86_64::{_mm_clmulepi64_si128, _mm_cvtsi128_si64, _mm_set_epi64x, _mm_set1_epi8};
    let product = _mm_clmulepi64_si128::<0>(_mm_set_epi64x(0, bits.cast_signed()), _mm_set1_epi8(-1));
    _mm_cvtsi128_si64(product).cast_unsigned()
}

/// The masks with AVX2, 32 bytes at a time.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,pclmulqdq")]
pub(super) fn avx2(block: &[u8; BLOCK]) -> Masks {
    use std::arch::x86_64::{
        __m256i, _mm256_cmpeq_epi8, _mm256_cmpgt_epi8, _mm256_movemask_epi8, _mm256_or_si256,
        _mm256_set_epi64x, _mm256_set1_epi8, _mm256_slli_epi16,
    };
    let word = |at: usize| {
        let eight = block.as_chunks::<8>().0.get(at).copied().unwrap_or_default();
        i64::from_le_bytes(eight)
    };
    let halves = [0, 4].map(|at| _mm256_set_epi64x(word(at + 3), word(at + 2), word(at + 1), word(at)));
    let all = |byte: u8| _mm256_set1_epi8(byte.cast_signed());
    let equal = |half: __m256i, byte: u8| _mm256_cmpeq_epi8(half, all(byte));
    let bits = |mask: [__m256i; 2]| {
        let [low, high] = mask.map(|half| u64::from(_mm256_movemask_epi8(half).cast_unsigned()));
        low | high << 32
    };
    let either = halves.map(|half| _mm256_or_si256(half, all(OBJECT_BIT)));
    let quote = bits(halves.map(|half| equal(half, b'"')));
    Masks {
        quote,
        strings: odd(quote),
        // Bytes beyond ASCII are negative here.
        irregular: bits(
            halves.map(|half| _mm256_or_si256(equal(half, b'\\'), _mm256_cmpgt_epi8(all(0x21), half))),
        ),
        separator: bits(halves.map(|half| _mm256_or_si256(equal(half, b','), equal(half, b':')))),
        open: bits(either.map(|half| equal(half, b'{'))),
        close: bits(either.map(|half| equal(half, b'}'))),
        object: bits(halves.map(|half| _mm256_slli_epi16(half, 2))),
    }
}

/// The masks with AVX-512, all bytes at once.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,pclmulqdq")]
pub(super) fn avx512(block: &[u8; BLOCK]) -> Masks {
    use std::arch::x86_64::{
        _mm512_cmpeq_epi8_mask, _mm512_cmplt_epi8_mask, _mm512_or_si512, _mm512_set_epi64, _mm512_set1_epi8,
        _mm512_test_epi8_mask,
    };
    let word = |at: usize| {
        let eight = block.as_chunks::<8>().0.get(at).copied().unwrap_or_default();
        i64::from_le_bytes(eight)
    };
    let bytes = _mm512_set_epi64(word(7), word(6), word(5), word(4), word(3), word(2), word(1), word(0));
    let all = |byte: u8| _mm512_set1_epi8(byte.cast_signed());
    let equal = |byte: u8| _mm512_cmpeq_epi8_mask(bytes, all(byte));
    let either = _mm512_or_si512(bytes, all(OBJECT_BIT));
    let quote = equal(b'"');
    Masks {
        quote,
        strings: odd(quote),
        // Bytes beyond ASCII are negative here.
        irregular: equal(b'\\') | _mm512_cmplt_epi8_mask(bytes, all(0x21)),
        separator: equal(b',') | equal(b':'),
        open: _mm512_cmpeq_epi8_mask(either, all(b'{')),
        close: _mm512_cmpeq_epi8_mask(either, all(b'}')),
        object: _mm512_test_epi8_mask(bytes, all(OBJECT_BIT)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the masks mean, byte by byte; `object` only where it means something.
    fn by_definition(block: &[u8; BLOCK]) -> Masks {
        let bits = |is: &dyn Fn(u8) -> bool| {
            block.iter().enumerate().fold(0, |mask, (at, byte)| mask | u64::from(is(*byte)) << at)
        };
        let mut odd = false;
        let strings = block.iter().enumerate().fold(0, |mask, (at, byte)| {
            odd ^= *byte == b'"';
            mask | u64::from(odd) << at
        });
        Masks {
            quote: bits(&|byte| byte == b'"'),
            strings,
            irregular: bits(&|byte| byte <= b' ' || byte == b'\\' || byte >= 0x80),
            separator: bits(&|byte| matches!(byte, b',' | b':')),
            open: bits(&|byte| matches!(byte, b'{' | b'[')),
            close: bits(&|byte| matches!(byte, b'}' | b']')),
            object: bits(&|byte| matches!(byte, b'{' | b'}')),
        }
    }

    fn checked(masks: Masks) -> Masks {
        Masks { object: masks.object & (masks.open | masks.close), ..masks }
    }

    #[test]
    fn every_byte_at_every_place_beside_every_neighbour_is_told_right() {
        for byte in 0..=255_u8 {
            for neighbour in [0, 0x20, 0x21, b'"', b'[', b'\\', 0x7F, 0x80, 0xFF] {
                let mut block = [neighbour; BLOCK];
                for at in [0, 1, 7, 8, 31, 32, 62, 63] {
                    block[at] = byte;
                    let expected = by_definition(&block);
                    assert_eq!(checked(portable(&block)), expected, "{byte:02X} at {at}");
                    #[cfg(target_arch = "x86_64")]
                    super::super::stride::with_each_feature(&block, |name, masks| {
                        assert_eq!(checked(masks), expected, "{name}: {byte:02X} at {at}");
                    });
                    block[at] = neighbour;
                }
            }
        }
    }
}
