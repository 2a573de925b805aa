//! Finds the known word nearest to an unknown one, for error messages.

/// Longer words are not compared, because no word of the protocol is near them and the comparison is
/// quadratic.
const LONGEST_COMPARED: usize = 64;

/// Returns the word of `known` that `word` most probably means, or `None` if no word is near.
///
/// Case and separators (`-`, `_`, space) do not count. Otherwise about one wrong letter in three is allowed.
/// A word that was cut short counts as one wrong letter.
pub fn nearest<'k>(word: &str, known: impl IntoIterator<Item = &'k str>) -> Option<&'k str> {
    if word.is_empty() || word.len() > LONGEST_COMPARED {
        return None;
    }
    let folded = fold(word);
    known
        .into_iter()
        // Words from a file can have any length.
        .filter(|candidate| candidate.len() <= LONGEST_COMPARED)
        .map(|candidate| (distance(&folded, &fold(candidate)), candidate))
        .min_by_key(|(distance, candidate)| (*distance, candidate.len().abs_diff(word.len())))
        .filter(|(distance, candidate)| *distance * 3 <= candidate.len().max(folded.len()))
        .map(|(_, candidate)| candidate)
}

fn distance(word: &str, candidate: &str) -> usize {
    // Too many words begin with the same three letters to know which was meant.
    let cut_short = word.len() > 3 && candidate.starts_with(word) && candidate.len() > word.len();
    if cut_short { 1 } else { strsim::damerau_levenshtein(word, candidate) }
}

fn fold(word: &str) -> String {
    word.chars().filter(|c| !matches!(c, '-' | '_' | ' ')).flat_map(char::to_lowercase).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORDS: [&str; 5] = ["actionStop", "actionPause", "modifyTool", "modifyStackData", "heartbreak"];

    #[test]
    fn a_slip_is_recognised() {
        assert_eq!(nearest("actoinStop", WORDS), Some("actionStop"));
        assert_eq!(nearest("ACTION_STOP", WORDS), Some("actionStop"));
        assert_eq!(nearest("modifyStack", WORDS), Some("modifyStackData"));
        assert_eq!(nearest("heartbeat", WORDS), Some("heartbreak"));
    }

    #[test]
    fn a_stranger_is_not() {
        assert_eq!(nearest("logout", WORDS), None);
        assert_eq!(nearest("", WORDS), None);
        assert_eq!(nearest(&"a".repeat(1000), WORDS), None);
        assert_eq!(nearest("aaaaaaaa", [&*"a".repeat(1000)]), None);
    }
}
