//! Reads sixteen bytes at once, enough for a name or a number of the protocol.
//!
//! Names have up to twelve letters and numbers up to fifteen digits, so one test of sixteen bytes finds the
//! end of almost every text. All x86-64 processors have instructions for this, and they are safe to use.
//! Other processors use two ordinary words of eight bytes. The tests compare the two versions.

/// Number of bytes in a chunk.
pub(crate) const CHUNK: usize = 16;

/// Sixteen bytes; the first byte is the lowest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Chunk(u128);

impl Chunk {
    /// The chunk that begins at this offset, padded with zeros after the end of `bytes`.
    #[inline(always)]
    pub fn at(bytes: &[u8], at: usize) -> Self {
        if let Some(chunk) = bytes.get(at..).and_then(|rest| rest.first_chunk::<CHUNK>()) {
            return Self(u128::from_le_bytes(*chunk));
        }
        Self::near_the_end(bytes, at)
    }

    #[inline]
    fn near_the_end(bytes: &[u8], at: usize) -> Self {
        if let Some(last) = bytes.last_chunk::<CHUNK>()
            && at < bytes.len()
        {
            return Self(u128::from_le_bytes(*last) >> (8 * (at + CHUNK - bytes.len())));
        }
        let mut chunk = [0; CHUNK];
        chunk.iter_mut().zip(bytes.iter().skip(at)).for_each(|(to, from)| *to = *from);
        Self(u128::from_le_bytes(chunk))
    }

    /// The chunk that ends before this offset; `None` if fewer than sixteen bytes come before it.
    #[inline(always)]
    pub fn before(bytes: &[u8], end: usize) -> Option<Self> {
        let chunk = bytes.get(..end)?.last_chunk::<CHUNK>()?;
        Some(Self(u128::from_le_bytes(*chunk)))
    }

    /// The chunk with these bytes; the first byte is the lowest.
    #[inline(always)]
    pub fn of(bits: u128) -> Self {
        Self(bits)
    }

    /// All sixteen bytes as one number.
    #[inline(always)]
    pub fn bits(self) -> u128 {
        self.0
    }

    /// Number of bytes before the first quote, `\`, control byte or non-ASCII byte; 16 if there is no such
    /// byte.
    #[inline(always)]
    pub fn plain(self) -> usize {
        (self.specials() | 1 << CHUNK).trailing_zeros() as usize
    }

    /// Number of consecutive digits from byte `from` on; `from` is at most 16.
    #[inline(always)]
    pub fn digits_from(self, from: usize) -> usize {
        ((self.no_digits() | 1 << CHUNK) >> from).trailing_zeros() as usize
    }

    /// Position of the first byte equal to `byte`; 16 if no byte is equal.
    #[inline(always)]
    pub fn place_of(self, byte: u8) -> usize {
        (self.equals(byte) | 1 << CHUNK).trailing_zeros() as usize
    }

    /// The byte at this position, below 16.
    #[inline(always)]
    pub fn byte(self, at: usize) -> u8 {
        (self.0 >> (8 * (at % CHUNK))).to_le_bytes()[0]
    }

    /// One bit for each byte, set if the byte is not plain.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    #[allow(
        unsafe_code,
        reason = "half the time of the portable way, in which every text of every frame is looked at"
    )]
    fn specials(self) -> u32 {
        // SAFETY: every x86-64 processor has SSE2. The function has no other requirement.
        unsafe { sse2::specials(self.words()) }
    }

    /// One bit for each byte, set if the byte is not a digit.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    #[allow(unsafe_code, reason = "as above, for every number")]
    fn no_digits(self) -> u32 {
        // SAFETY: as above.
        unsafe { sse2::no_digits(self.words()) }
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn specials(self) -> u32 {
        self.portable_specials()
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn no_digits(self) -> u32 {
        self.portable_no_digits()
    }

    /// One bit for each byte, set if the byte equals `byte`.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    #[allow(unsafe_code, reason = "as above, for the point of every number")]
    fn equals(self, byte: u8) -> u32 {
        // SAFETY: as above.
        unsafe { sse2::equals(self.words(), byte) }
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn equals(self, byte: u8) -> u32 {
        self.portable_equals(byte)
    }

    #[cfg(any(test, not(target_arch = "x86_64")))]
    fn portable_equals(self, byte: u8) -> u32 {
        self.gathered(|word| equal(word, byte))
    }

    #[cfg(any(test, not(target_arch = "x86_64")))]
    fn portable_specials(self) -> u32 {
        self.gathered(|word| equal(word, b'"') | equal(word, b'\\') | below(word, 0x20) | word)
    }

    #[cfg(any(test, not(target_arch = "x86_64")))]
    fn portable_no_digits(self) -> u32 {
        self.gathered(|word| below(word, b'0') | !below(word, b'9' + 1) | word)
    }

    /// Applies `mark` to both words and gathers the top bit of each byte.
    #[cfg(any(test, not(target_arch = "x86_64")))]
    fn gathered(self, mark: impl Fn(u64) -> u64) -> u32 {
        let [low, high] = self.words().map(|word| {
            let tops = (mark(word) & TOPS) >> 7;
            u32::from(tops.wrapping_mul(0x0102_0408_1020_4080).to_be_bytes()[0])
        });
        low | high << 8
    }

    /// The first eight bytes and the last eight bytes.
    #[inline(always)]
    pub fn words(self) -> [u64; 2] {
        let [a, b, c, d, e, f, g, h, rest @ ..] = self.0.to_le_bytes();
        [u64::from_le_bytes([a, b, c, d, e, f, g, h]), u64::from_le_bytes(rest)]
    }
}

/// Compares sixteen bytes with one instruction for each comparison.
#[cfg(target_arch = "x86_64")]
mod sse2 {
    use std::arch::x86_64::{
        __m128i, _mm_cmpeq_epi8, _mm_cmpgt_epi8, _mm_cmplt_epi8, _mm_movemask_epi8, _mm_or_si128,
        _mm_set_epi64x, _mm_set1_epi8,
    };

    #[inline]
    #[target_feature(enable = "sse2")]
    fn all(byte: u8) -> __m128i {
        _mm_set1_epi8(byte.cast_signed())
    }

    #[inline]
    #[target_feature(enable = "sse2")]
    pub fn specials([low, high]: [u64; 2]) -> u32 {
        let chunk = _mm_set_epi64x(high.cast_signed(), low.cast_signed());
        // As signed numbers, non-ASCII bytes are negative, so they are below the blank too.
        let low = _mm_cmplt_epi8(chunk, all(0x20));
        let signs = _mm_or_si128(_mm_cmpeq_epi8(chunk, all(b'"')), _mm_cmpeq_epi8(chunk, all(b'\\')));
        _mm_movemask_epi8(_mm_or_si128(low, signs)).cast_unsigned()
    }

    #[inline]
    #[target_feature(enable = "sse2")]
    pub fn equals([low, high]: [u64; 2], byte: u8) -> u32 {
        let chunk = _mm_set_epi64x(high.cast_signed(), low.cast_signed());
        _mm_movemask_epi8(_mm_cmpeq_epi8(chunk, all(byte))).cast_unsigned()
    }

    #[inline]
    #[target_feature(enable = "sse2")]
    pub fn no_digits([low, high]: [u64; 2]) -> u32 {
        let chunk = _mm_set_epi64x(high.cast_signed(), low.cast_signed());
        let outside = _mm_or_si128(_mm_cmplt_epi8(chunk, all(b'0')), _mm_cmpgt_epi8(chunk, all(b'9')));
        _mm_movemask_epi8(outside).cast_unsigned()
    }
}

#[cfg(any(test, not(target_arch = "x86_64")))]
const ONES: u64 = 0x0101_0101_0101_0101;
#[cfg(any(test, not(target_arch = "x86_64")))]
const TOPS: u64 = ONES << 7;

/// Sets the top bit of each byte that equals `byte`. Bytes do not affect each other.
#[cfg(any(test, not(target_arch = "x86_64")))]
fn equal(word: u64, byte: u8) -> u64 {
    let other = word ^ (ONES * u64::from(byte));
    !(((other & !TOPS) + !TOPS) | other) & TOPS
}

/// Sets the top bit of each ASCII byte below `limit`, and clears it in all other bytes.
#[cfg(any(test, not(target_arch = "x86_64")))]
fn below(word: u64, limit: u8) -> u64 {
    !((word & !TOPS) + ONES * (0x80 - u64::from(limit))) & !word & TOPS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_beside_every_neighbour_is_told_right() {
        for byte in 0..=255_u8 {
            for neighbour in 0..=255_u8 {
                let mut bytes = [neighbour; CHUNK];
                bytes[5] = byte;
                let chunk = Chunk::at(&bytes, 0);
                assert_eq!(chunk.specials(), chunk.portable_specials(), "{byte:02X} {neighbour:02X}");
                assert_eq!(chunk.no_digits(), chunk.portable_no_digits(), "{byte:02X} {neighbour:02X}");
                let special = |byte: u8| !(0x20..0x80).contains(&byte) || matches!(byte, b'"' | b'\\');
                assert_eq!(chunk.equals(byte), chunk.portable_equals(byte), "{byte:02X} {neighbour:02X}");
                assert_eq!(chunk.place_of(byte), if byte == neighbour { 0 } else { 5 });
                assert_eq!(chunk.specials() >> 5 & 1 == 1, special(byte));
                assert_eq!(chunk.no_digits() >> 5 & 1 == 1, !byte.is_ascii_digit());
            }
        }
    }

    #[test]
    fn behind_the_end_there_are_zeros() {
        let bytes = b"{\"axis-0\":12.5}";
        for at in 0..20 {
            let expected: Vec<u8> =
                bytes.iter().skip(at).chain(std::iter::repeat(&0)).take(CHUNK).copied().collect();
            assert_eq!(Chunk::at(bytes, at).bits().to_le_bytes(), *expected);
        }
        assert_eq!(Chunk::at(bytes, 2).plain(), 6);
        assert_eq!(Chunk::at(bytes, 10).digits_from(0), 2);
        assert_eq!(Chunk::at(bytes, 10).digits_from(3), 1);
        assert_eq!(Chunk::before(bytes, 14), None);
    }
}
