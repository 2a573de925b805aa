//! How much of the audit log is kept. The oldest entries go first, so that the rest of the chain stays whole.

/// How many entries are removed at once: others wait for the disk meanwhile.
pub const BATCH: u64 = 1_000;

/// The fewest entries to keep.
pub const LEAST_ENTRIES: u32 = 1_000;

/// The number of the last entry to remove now; `None` if there is nothing to remove.
///
/// `first` and `last` are the numbers of the oldest and the newest entry. `open` is the oldest command
/// without an outcome among the oldest [`BATCH`] entries. It stays, because the next start looks for it.
#[must_use]
pub fn cut(max_entries: u64, first: u64, last: u64, open: Option<u64>) -> Option<u64> {
    let most = max_entries.max(LEAST_ENTRIES.into());
    let cut = last.saturating_sub(most).min(first.saturating_add(BATCH - 1));
    let cut = open.map_or(cut, |open| cut.min(open.saturating_sub(1)));
    (first > 0 && cut >= first).then_some(cut)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_newest_entries_and_open_commands_stay(
            most in 1_000..5_000_u64,
            first in 1..1_000_000_u64,
            count in 1..20_000_u64,
            open in prop::option::of(0..BATCH),
        ) {
            let last = first + count - 1;
            let open = open.map(|after| first + after);
            match cut(most, first, last, open) {
                None => prop_assert!(count <= most || open == Some(first)),
                Some(cut) => {
                    prop_assert!(cut >= first && cut < first + BATCH);
                    prop_assert!(last - cut >= most);
                    prop_assert!(open.is_none_or(|open| cut < open));
                    let all = last - cut == most || cut == first + BATCH - 1;
                    prop_assert!(all || open == Some(cut + 1), "it removes as much as it may");
                }
            }
        }
    }

    #[test]
    fn an_empty_log_and_a_small_bound_remove_nothing() {
        assert_eq!(cut(1_000, 0, 0, None), None);
        assert_eq!(cut(0, 1, 1_000, None), None, "the least is kept always");
        assert_eq!(cut(0, 1, 1_001, None), Some(1));
    }
}
