//! Small changes of an input, for a target that corrupts what it sends, and for the test that runs the
//! corpus.

use r6_traffic::random::Random;

use crate::input::Input;

/// The bytes with one change, chosen by the input: a byte replaced, inserted or removed, a part repeated, or
/// the end cut off.
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

/// A number below `end`; `end` must not be 0. It is less uniform than [`Random::below`], but the committed
/// corpus was drawn with it.
pub fn below(random: &mut Random, end: usize) -> usize {
    usize::try_from(random.next_number() % u64::try_from(end).unwrap()).unwrap()
}

/// The input with a few changes: single bytes, words of the protocol, and pieces of `other`.
#[must_use]
pub fn mutate(bytes: &[u8], other: &[u8], words: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let mut mutated = bytes.to_vec();
    for _ in 0..=below(random, 4) {
        let at = below(random, mutated.len() + 1);
        let end = (at + below(random, 9)).min(mutated.len());
        let piece = match below(random, 6) {
            0 => vec![],
            1 => vec![random.next_number().to_le_bytes()[0]; 1],
            2 => random.next_number().to_le_bytes()[..1 + below(random, 8)].to_vec(),
            3 => words[below(random, words.len())].clone(),
            4 => mutated[at..].iter().take(1 + below(random, 40)).copied().collect(),
            _ if other.is_empty() => vec![],
            _ => other[below(random, other.len())..].iter().take(1 + below(random, 60)).copied().collect(),
        };
        let end = if below(random, 2) == 0 { at } else { end };
        mutated.splice(at..end, piece);
    }
    mutated
}
