//! Addresses by their names, in one look: those without an index or with one of a single digit, which are nearly all that are
//! ever asked for. To compare a name with one after the other, the processor would have to guess which it is, each time.

use std::sync::LazyLock;

use super::{ADDRESSES, Address};
use crate::chunk::{CHUNK, Chunk};

/// A power of two, several times the number of names, so that nearly every name stands in its own slot.
const SLOTS: usize = 512;

/// How many slots a name can be away from its own. More names than stand so near to each other are left to
/// [`Address::exact`]; a test checks that there are none.
const REACH: usize = 4;

/// Each name as the number that its bytes make, the first lowest, with its address; 0 where there is none.
static KNOWN: LazyLock<[(u128, Address); SLOTS + REACH]> = LazyLock::new(|| {
    let mut known = [(0, Address::Version); SLOTS + REACH];
    for row in &ADDRESSES {
        let indices = row.indices.map_or(0..=0, |(first, last)| first..=last.min(9));
        for index in indices {
            let name = match row.indices {
                None => row.name.to_owned(),
                Some(_) => row.name.replace("-n", &format!("-{index}")),
            };
            let Some(address) = Address::exact(name.as_bytes()) else { continue };
            let name = number(name.as_bytes(), 0, name.len());
            let free = known.iter_mut().skip(slot_of(name)).take(REACH).find(|(other, _)| *other == 0);
            if let Some(free) = free {
                *free = (name, address);
            }
        }
    }
    known
});

/// The bytes from `start` to `end`, at most sixteen, as one number.
#[inline(always)]
fn number(bytes: &[u8], start: usize, end: usize) -> u128 {
    Chunk::at(bytes, start).bits() & u128::MAX >> (8 * (CHUNK - (end - start)))
}

#[inline(always)]
fn slot_of(name: u128) -> usize {
    let [a, b, c, d, e, f, g, h, rest @ ..] = name.to_le_bytes();
    let folded = u64::from_le_bytes([a, b, c, d, e, f, g, h]) ^ u64::from_le_bytes(rest).rotate_left(29);
    usize::from(folded.wrapping_mul(0x9E37_79B9_7F4A_7C15).to_be_bytes()[0]) << 1
        | usize::from(folded.to_le_bytes()[0] & 1)
}

/// The address whose name stands from `start` to `end`, if it is one of those. No byte of a text is 0.
#[inline]
pub(super) fn address(bytes: &[u8], start: usize, end: usize) -> Option<Address> {
    if end <= start || end - start > CHUNK {
        return None;
    }
    let name = number(bytes, start, end);
    let slot = slot_of(name);
    let near = KNOWN.get(slot..slot + REACH)?;
    near.iter().find(|(known, _)| *known == name).map(|(_, address)| *address)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_short_name_is_known_and_found_wherever_it_stands() {
        let mut count = 0;
        for (_, address) in KNOWN.iter().filter(|(name, _)| *name != 0) {
            let name = address.to_string();
            for (before, behind) in [("", ""), ("[\"", "\",\"axis-0\",\"curMode\"]}"), ("[\"", "\"]}")] {
                let bytes = format!("{before}{name}{behind}");
                let (start, end) = (before.len(), before.len() + name.len());
                assert_eq!(super::address(bytes.as_bytes(), start, end), Some(*address), "{bytes}");
            }
            count += 1;
        }
        let short = |row: &super::super::AddressInfo| {
            row.indices.map_or(1, |(first, last)| (first..=last.min(9)).count())
        };
        assert_eq!(count, ADDRESSES.iter().map(short).sum::<usize>());
    }

    #[test]
    fn nothing_else_is_known() {
        for name in
            ["", "axis-8", "axis-", "axis-00", "Axis-0", "versio", "versionn", "counter-10", "Addr-800"]
        {
            assert_eq!(address(name.as_bytes(), 0, name.len()), None, "{name}");
        }
    }
}
