//! Numbers as bytes: seven bits a byte, the lowest first. Small numbers take one byte.

use crc::{CRC_32_ISCSI, Crc, Table};

use super::codec::BadChunk;

/// CRC-32C: the checksum of a chunk or an event.
pub(super) const CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISCSI);

/// Appends an unsigned number.
pub(super) fn put(out: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        out.push(low_byte(number) | 0x80);
        number >>= 7;
    }
    out.push(low_byte(number));
}

/// Appends a signed number: numbers near zero take one byte, whatever their sign.
pub(super) fn put_signed(out: &mut Vec<u8>, number: i64) {
    put(out, zigzag(number));
}

/// How many bytes a signed number takes.
pub(super) fn signed_len(number: i64) -> usize {
    let bits = 64 - zigzag(number).leading_zeros();
    bits.div_ceil(7).max(1) as usize
}

/// Numbers near zero become small ones.
fn zigzag(number: i64) -> u64 {
    (number << 1 ^ number >> 63).cast_unsigned()
}

/// What [`zigzag`] was made of.
fn unzigzag(number: u64) -> i64 {
    (number >> 1).cast_signed() ^ -(number & 1).cast_signed()
}

fn low_byte(number: u64) -> u8 {
    number.to_le_bytes().first().copied().unwrap_or_default() & 0x7F
}

/// Appends the checksum of all bytes so far.
pub(super) fn seal(out: &mut Vec<u8>) {
    let crc = CRC.checksum(out);
    out.extend_from_slice(&crc.to_le_bytes());
}

/// Reads numbers out of bytes.
#[derive(Debug)]
pub(super) struct Reader<'b> {
    rest: &'b [u8],
}

impl<'b> Reader<'b> {
    /// Reads these bytes.
    #[cfg(test)]
    pub fn new(bytes: &'b [u8]) -> Self {
        Self { rest: bytes }
    }

    /// Reads bytes that end with their checksum.
    pub fn of_sealed(bytes: &'b [u8]) -> Result<Self, BadChunk> {
        let (rest, crc) = bytes.split_last_chunk::<4>().ok_or(BadChunk::Short)?;
        if CRC.checksum(rest) != u32::from_le_bytes(*crc) {
            return Err(BadChunk::Checksum);
        }
        Ok(Self { rest })
    }

    /// One byte.
    pub fn byte(&mut self) -> Result<u8, BadChunk> {
        let (byte, rest) = self.rest.split_first().ok_or(BadChunk::Short)?;
        self.rest = rest;
        Ok(*byte)
    }

    /// So many bytes.
    pub fn take(&mut self, count: usize) -> Result<&'b [u8], BadChunk> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or(BadChunk::Short)?;
        self.rest = rest;
        Ok(taken)
    }

    /// An unsigned number.
    pub fn number(&mut self) -> Result<u64, BadChunk> {
        let mut number = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = u64::from(self.byte()?);
            let part = byte & 0x7F;
            if shift == 63 && part > 1 {
                return Err(BadChunk::Number);
            }
            number |= part << shift;
            if byte < 0x80 {
                return Ok(number);
            }
        }
        Err(BadChunk::Number)
    }

    /// An unsigned number up to this one.
    pub fn up_to(&mut self, most: usize) -> Result<usize, BadChunk> {
        let number = usize::try_from(self.number()?).map_err(|_| BadChunk::Number)?;
        if number <= most { Ok(number) } else { Err(BadChunk::Number) }
    }

    /// A signed number.
    pub fn signed(&mut self) -> Result<i64, BadChunk> {
        self.number().map(unzigzag)
    }

    /// Whether nothing is left.
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// An error unless nothing is left.
    pub fn end(self) -> Result<(), BadChunk> {
        if self.is_empty() { Ok(()) } else { Err(BadChunk::Long) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_and_take_few_bytes() {
        for (number, len) in
            [(0, 1), (-1, 1), (63, 1), (-64, 1), (64, 2), (1 << 20, 4), (i64::MAX, 10), (i64::MIN, 10)]
        {
            let mut bytes = Vec::new();
            put_signed(&mut bytes, number);
            assert_eq!((bytes.len(), signed_len(number)), (len, len), "{number}");
            assert_eq!(Reader::new(&bytes).signed(), Ok(number));
        }
        assert_eq!(Reader::new(&[0xFF; 9]).number(), Err(BadChunk::Short));
        assert_eq!(Reader::new(&[0xFF; 11]).number(), Err(BadChunk::Number));
        assert_eq!(Reader::new(&[5]).up_to(4), Err(BadChunk::Number));
    }

    #[test]
    fn the_checksum_is_crc_32c() {
        let mut bytes = b"123456789".to_vec();
        seal(&mut bytes);
        assert_eq!(bytes.last_chunk::<4>(), Some(&0xE306_9283_u32.to_le_bytes()));
        let mut zeros = vec![0; 32];
        seal(&mut zeros);
        assert_eq!(zeros.last_chunk::<4>(), Some(&0x8A91_36AA_u32.to_le_bytes()), "RFC 3720, B.4");
    }
}
