//! What 64 bytes hold, as one bit for each byte: quotes, brackets, and what only the walk byte by byte can judge.
//!
//! A frame is found by its brackets, and nearly every byte is none. Comparing 64 bytes at once with what counts takes a
//! few instructions where the processor has AVX2 or AVX-512, and is more than twice as fast as the walk byte by byte. With ordinary
//! registers it is slower than that walk, which then does it all.

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

#[cfg(all(test, target_arch = "x86_64"))]
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
                    super::super::stride::with_each_feature(&block, |name, masks| {
                        assert_eq!(checked(masks), expected, "{name}: {byte:02X} at {at}");
                    });
                    block[at] = neighbour;
                }
            }
        }
    }
}
