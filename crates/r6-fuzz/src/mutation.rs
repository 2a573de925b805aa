//! Small changes of an input: those of a target that spoils what it sends, and those of the test that tries the corpus.

use crate::input::Input;

/// The bytes with one change that the input tells: a byte replaced, put in or taken out, a stretch repeated, the end cut off.
#[must_use]
pub fn change(bytes: &[u8], input: &mut Input<'_>) -> Vec<u8> {
    let (kind, at, with) = (input.byte(), usize::from(input.number()), input.byte());
    let at = at % (bytes.len() + 1);
    let (before, behind) = bytes.split_at(at);
    let skipped = behind.get(1..).unwrap_or_default();
    match kind % 5 {
        0 => [before, &[with], skipped].concat(),
        1 => [before, &[with], behind].concat(),
        2 => [before, skipped].concat(),
        3 => [before, &behind[..behind.len().min(usize::from(with))], behind].concat(),
        _ => before.to_vec(),
    }
}

/// Numbers that look random and are the same for the same seed (SplitMix64).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The numbers of this seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number.
    pub fn next_number(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    /// A number below `end`, which is not 0.
    pub fn below(&mut self, end: usize) -> usize {
        usize::try_from(self.next_number() % u64::try_from(end).unwrap()).unwrap()
    }
}

/// An input that somebody has changed in a few places: with single bytes, words of the protocol, and pieces of `other`.
#[must_use]
pub fn mutate(bytes: &[u8], other: &[u8], words: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let mut mutated = bytes.to_vec();
    for _ in 0..=random.below(4) {
        let at = random.below(mutated.len() + 1);
        let end = (at + random.below(9)).min(mutated.len());
        let piece = match random.below(6) {
            0 => vec![],
            1 => vec![random.next_number().to_le_bytes()[0]; 1],
            2 => random.next_number().to_le_bytes()[..1 + random.below(8)].to_vec(),
            3 => words[random.below(words.len())].clone(),
            4 => mutated[at..].iter().take(1 + random.below(40)).copied().collect(),
            _ if other.is_empty() => vec![],
            _ => other[random.below(other.len())..].iter().take(1 + random.below(60)).copied().collect(),
        };
        let end = if random.below(2) == 0 { at } else { end };
        mutated.splice(at..end, piece);
    }
    mutated
}
