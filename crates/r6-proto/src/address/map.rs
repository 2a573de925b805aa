//! Values by address, for what is looked up with every poll.

use super::Address;

/// How many rows a walk looks at before it searches: a query asks for most addresses of a map, not for all.
const NEAR: usize = 4;

/// Values by address, in the order of the addresses.
///
/// Replies have the same addresses in the same order again and again. A [`Walk`] through the map then finds
/// each of them with about one comparison. Any other order is correct too, and costs a binary search each.
#[derive(Clone, Debug, PartialEq)]
pub struct AddressMap<T> {
    rows: Vec<(Address, T)>,
}

/// The position in a map at which the next lookup begins: behind the address that was found before.
#[derive(Clone, Copy, Debug, Default)]
pub struct Walk(usize);

impl<T> Default for AddressMap<T> {
    fn default() -> Self {
        Self { rows: Vec::new() }
    }
}

impl<T> AddressMap<T> {
    /// The place of the address, or where it would be.
    fn place(&self, walk: &mut Walk, address: Address) -> Result<usize, usize> {
        let near = self.rows.get(walk.0..).unwrap_or_default().iter().take(NEAR);
        let near = near.enumerate().find(|(_, (of, _))| *of == address).map(|(ahead, _)| walk.0 + ahead);
        let place = match near {
            Some(place) => Ok(place),
            None => self.rows.binary_search_by(|(of, _)| of.cmp(&address)),
        };
        walk.0 = place.map_or_else(|place| place, |place| place + 1);
        place
    }

    /// The value of an address; `None` if it has none.
    #[must_use]
    pub fn get(&self, address: Address) -> Option<&T> {
        self.walk_to(&mut Walk::default(), address)
    }

    /// The value of an address, to change it.
    pub fn get_mut(&mut self, address: Address) -> Option<&mut T> {
        self.walk_to_mut(&mut Walk::default(), address)
    }

    /// Whether the address has a value.
    #[must_use]
    pub fn contains(&self, address: Address) -> bool {
        self.get(address).is_some()
    }

    /// The value of the next address of a walk; `None` if it has none.
    #[must_use]
    pub fn walk_to(&self, walk: &mut Walk, address: Address) -> Option<&T> {
        let place = self.place(walk, address).ok()?;
        self.rows.get(place).map(|(_, value)| value)
    }

    /// The value of the next address of a walk, to change it.
    pub fn walk_to_mut(&mut self, walk: &mut Walk, address: Address) -> Option<&mut T> {
        let place = self.place(walk, address).ok()?;
        self.rows.get_mut(place).map(|(_, value)| value)
    }

    /// The value of the next address of a walk, to change it. An address without a value gets this one first.
    pub fn walk_to_or_insert(
        &mut self,
        walk: &mut Walk,
        address: Address,
        value: impl FnOnce() -> T,
    ) -> &mut T {
        let place = match self.place(walk, address) {
            Ok(place) => place,
            Err(place) => {
                self.rows.insert(place, (address, value()));
                walk.0 = place + 1;
                place
            }
        };
        match self.rows.get_mut(place) {
            Some((_, value)) => value,
            None => unreachable!("the place was found in these rows"),
        }
    }

    /// Sets the value of an address. Returns the one before.
    pub fn insert(&mut self, address: Address, value: T) -> Option<T> {
        match self.place(&mut Walk::default(), address) {
            Ok(place) => self.rows.get_mut(place).map(|(_, old)| std::mem::replace(old, value)),
            Err(place) => {
                self.rows.insert(place, (address, value));
                None
            }
        }
    }

    /// Takes the value of an address out.
    pub fn remove(&mut self, address: Address) -> Option<T> {
        let place = self.place(&mut Walk::default(), address).ok()?;
        Some(self.rows.remove(place).1)
    }

    /// Keeps only these values.
    pub fn retain(&mut self, mut is_kept: impl FnMut(Address, &T) -> bool) {
        self.rows.retain(|(address, value)| is_kept(*address, value));
    }

    /// All values, in the order of the addresses.
    pub fn iter(&self) -> impl Iterator<Item = (Address, &T)> {
        self.rows.iter().map(|(address, value)| (*address, value))
    }

    /// All values, in the order of the addresses, to change them.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = (Address, &mut T)> {
        self.rows.iter_mut().map(|(address, value)| (*address, value))
    }

    /// How many addresses have a value.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether no address has a value.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

impl<T> FromIterator<(Address, T)> for AddressMap<T> {
    /// Of two values of one address, the later one counts.
    fn from_iter<I: IntoIterator<Item = (Address, T)>>(values: I) -> Self {
        let mut rows: Vec<_> = values.into_iter().collect();
        // The sort is stable: after it, the later of two stands first.
        rows.reverse();
        rows.sort_by_key(|(address, _)| *address);
        rows.dedup_by_key(|(address, _)| *address);
        Self { rows }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;

    fn address(number: u16) -> Address {
        Address::parse(&format!("Addr-{}", 800 + number)).unwrap()
    }

    #[derive(Clone, Debug)]
    enum Step {
        Insert(u16, u8),
        Remove(u16),
        /// Keeps the ones with an even value.
        Retain,
        /// Looks these up in one walk, and adds the ones that lack.
        Walk(Vec<u16>),
    }

    fn steps() -> impl Strategy<Value = Vec<Step>> {
        let number = 0_u16..30;
        let step = prop_oneof![
            (number.clone(), any::<u8>()).prop_map(|(number, value)| Step::Insert(number, value)),
            number.clone().prop_map(Step::Remove),
            Just(Step::Retain),
            prop::collection::vec(number, 0..20).prop_map(Step::Walk),
            prop::collection::btree_set(0_u16..30, 0..20)
                .prop_map(|numbers| Step::Walk(numbers.into_iter().collect())),
        ];
        prop::collection::vec(step, 0..40)
    }

    proptest! {
        /// Whatever is done with it, it has what a `BTreeMap` has, in the same order.
        #[test]
        fn it_is_a_map(begin in prop::collection::vec((0_u16..30, any::<u8>()), 0..20), steps in steps()) {
            let pairs = || begin.iter().map(|(number, value)| (address(*number), *value));
            let (mut map, mut model): (AddressMap<u8>, BTreeMap<Address, u8>) = (pairs().collect(), pairs().collect());
            for step in steps {
                match step {
                    Step::Insert(number, value) => {
                        prop_assert_eq!(map.insert(address(number), value), model.insert(address(number), value));
                    }
                    Step::Remove(number) => {
                        prop_assert_eq!(map.remove(address(number)), model.remove(&address(number)));
                    }
                    Step::Retain => {
                        map.retain(|_, value| value % 2 == 0);
                        model.retain(|_, value| *value % 2 == 0);
                    }
                    Step::Walk(numbers) => {
                        let (mut read, mut write, mut add) = (Walk::default(), Walk::default(), Walk::default());
                        for number in numbers {
                            let of = address(number);
                            prop_assert_eq!(map.walk_to(&mut read, of), model.get(&of));
                            if let Some(value) = map.walk_to_mut(&mut write, of) {
                                *value = value.wrapping_add(1);
                            }
                            model.entry(of).and_modify(|value| *value = value.wrapping_add(1));
                            prop_assert_eq!(map.walk_to_or_insert(&mut add, of, || 7), model.entry(of).or_insert(7));
                        }
                    }
                }
                prop_assert!(map.iter().eq(model.iter().map(|(address, value)| (*address, value))));
                prop_assert_eq!((map.len(), map.is_empty()), (model.len(), model.is_empty()));
            }
        }
    }
}
