//! Splits a query into parts, and checks whether the numbers of values in the replies agree.
//!
//! A controller leaves out the values that it does not have, so a list of values may be too short. Three
//! kinds of reply cannot be explained like this: one with too many values, one with too few although no
//! address is missing, and one without a value that was there before. After such a reply the client believes
//! no list of this controller. Even in a list of the right length, values may belong to the wrong addresses.
//! A single value for a single address cannot.

use std::collections::{BTreeMap, BTreeSet};

use r6_proto::address::{Address, Ports};

/// The addresses of one frame, each with its place in the whole query.
pub(super) type Part = Vec<(usize, Address)>;

/// The parts of one query that are still to be asked.
#[derive(Debug)]
pub(super) struct Parts {
    open: Vec<Part>,
    /// The places of addresses that were answered in a list. They are believed only while all lists agree.
    in_lists: BTreeMap<usize, Address>,
    /// The places of addresses that have no value when they are asked for alone.
    missing: BTreeSet<usize>,
    /// Lists that were too short: the places asked for, and how many values the list lacked.
    short: Vec<(Vec<usize>, usize)>,
    contradicted: bool,
}

impl Parts {
    /// Takes these parts, in their order.
    pub fn new(mut parts: Vec<Part>) -> Self {
        parts.reverse();
        Self {
            open: parts,
            in_lists: BTreeMap::new(),
            missing: BTreeSet::new(),
            short: Vec::new(),
            contradicted: false,
        }
    }

    /// The next part to ask for; `None` once all are answered. If the lists do not agree, or are doubted
    /// because of another query, each of their addresses is asked for once more, alone.
    pub fn next(&mut self, doubted: bool) -> Option<Part> {
        if self.open.is_empty() {
            if !self.short.iter().all(|list| self.is_explained(list)) {
                self.contradict();
            } else if doubted {
                self.ask_alone();
            }
        }
        self.open.pop()
    }

    /// Whether any reply had an unexplained number of values.
    pub fn contradicted(&self) -> bool {
        self.contradicted
    }

    /// Notes that a part had as many values as addresses.
    pub fn answered(&mut self, part: &[(usize, Address)]) {
        if part.len() > 1 {
            self.in_lists.extend(part.iter().copied());
        }
    }

    /// Notes that a part had a different number of values than addresses. `lacked`: for a single address
    /// without a value, whether the controller is believed to lack it.
    pub fn mismatched(&mut self, part: &[(usize, Address)], values: usize, lacked: bool) {
        let places = || part.iter().map(|(at, _)| *at);
        match (part.len().checked_sub(values), part.len()) {
            (Some(_), 1) if lacked => self.missing.extend(places()),
            (_, 1) => self.contradict(),
            (None, _) => {
                self.open.push(part.to_vec());
                self.contradict();
            }
            (Some(lacks), _) => {
                self.short.push((places().collect(), lacks));
                let (first, second) = divide(part);
                self.open.extend([second, first]);
            }
        }
    }

    fn is_explained(&self, (places, lacks): &(Vec<usize>, usize)) -> bool {
        places.iter().filter(|at| self.missing.contains(at)).count() == *lacks
    }

    fn contradict(&mut self) {
        self.contradicted = true;
        self.ask_alone();
    }

    /// Stops believing lists: asks alone for each address that was not asked for alone yet.
    fn ask_alone(&mut self) {
        self.short.clear();
        let mut left = std::mem::take(&mut self.in_lists);
        left.extend(self.open.drain(..).flatten());
        self.open = alone(left.into_iter().collect());
        self.open.reverse();
    }
}

/// Puts each address into its own part.
pub(super) fn alone(part: Part) -> Vec<Part> {
    part.into_iter().map(|asked| vec![asked]).collect()
}

/// Splits a part into two non-empty parts: the addresses that every controller has and those that some lack,
/// or else two halves.
fn divide(part: &[(usize, Address)]) -> (Part, Part) {
    let (first, second): (Vec<_>, Vec<_>) =
        part.iter().copied().partition(|(_, address)| is_everywhere(*address));
    if !first.is_empty() && !second.is_empty() {
        return (first, second);
    }
    let (first, second) = part.split_at(part.len() / 2);
    (first.to_vec(), second.to_vec())
}

/// Whether a controller may lack the address for good. Counters do not count, because they can be created at
/// any time.
pub(super) fn may_be_missing(address: Address) -> bool {
    !is_everywhere(address) && !matches!(address, Address::Counter(_))
}

/// Whether the oldest manual has the address, on both ports. Counters do not count, because they have to be
/// created first.
pub(super) fn is_everywhere(address: Address) -> bool {
    let info = address.info();
    info.is_in_first_manual() && info.ports == Ports::Both && !matches!(address, Address::Counter(_))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn asked(count: u32) -> Part {
        (0..count).map(|number| (number as usize, Address::Counter(number))).collect()
    }

    /// Plays a controller. `values` returns how many values it sends for a part, given the number of the part
    /// and its addresses. Returns how many addresses each part had.
    fn lengths(parts: &mut Parts, mut values: impl FnMut(usize, &Part) -> usize) -> Vec<usize> {
        let mut lengths = Vec::new();
        while let Some(part) = parts.next(false) {
            let values = values(lengths.len(), &part);
            lengths.push(part.len());
            if values == part.len() {
                parts.answered(&part);
            } else {
                parts.mismatched(&part, values, true);
            }
        }
        lengths
    }

    #[test]
    fn what_was_answered_alone_is_not_asked_for_again() {
        let mut parts = Parts::new(vec![asked(6)]);
        // Part of 6: one value too few. Part of 3: one too few. Part of 1: complete. Part of 2: one too many.
        let found = lengths(&mut parts, |turn, part| match turn {
            0 | 1 => part.len() - 1,
            3 => 3,
            _ => part.len(),
        });
        assert_eq!(found, [6, 3, 1, 2, 1, 1, 1, 1, 1]);
        assert!(parts.contradicted());
    }

    #[test]
    fn where_an_address_lacks_a_value_that_it_had_or_another_query_was_contradicted_lists_are_asked_again() {
        for (lacked, doubted, own) in [(false, false, true), (true, true, false)] {
            let mut parts = Parts::new(vec![asked(3)]);
            let mut turns = Vec::new();
            while let Some(part) = parts.next(doubted) {
                turns.push(part.len());
                match turns.len() {
                    1 => parts.mismatched(&part, 2, true),
                    2 => parts.mismatched(&part, 0, lacked),
                    _ => parts.answered(&part),
                }
            }
            assert_eq!(
                (turns, parts.contradicted()),
                (if own { vec![3, 1, 1, 1] } else { vec![3, 1, 2, 1, 1] }, own)
            );
        }
    }

    proptest! {
        /// A controller that leaves out the values it does not have is believed, and is not asked more often.
        #[test]
        fn missing_addresses_contradict_nothing(missing in prop::collection::btree_set(0_usize..20, 0..20)) {
            let mut parts = Parts::new(vec![asked(20)]);
            let found = lengths(&mut parts, |_, part| {
                part.iter().filter(|(at, _)| !missing.contains(at)).count()
            });
            prop_assert!(!parts.contradicted());
            prop_assert_eq!(&parts.missing, &missing);
            prop_assert!(found.len() <= 1 + missing.len() * 10, "{:?}", found);
        }

        /// For any replies, the query ends. If the replies contradict each other, no value from a list is
        /// kept.
        #[test]
        fn where_lists_disagree_each_value_came_alone(told in prop::collection::vec(0_usize..9, 100)) {
            let mut parts = Parts::new(vec![asked(8)]);
            let found = lengths(&mut parts, |turn, _| told[turn]);
            prop_assert!(found.len() <= 8 + 7 + 8, "{:?}", found);
            if parts.contradicted() {
                prop_assert!(parts.in_lists.is_empty());
                prop_assert_eq!(found.iter().filter(|length| **length == 1).count(), 8);
            } else {
                prop_assert!(parts.short.iter().all(|list| parts.is_explained(list)));
            }
        }
    }
}
