//! The hash chain of the audit log: each entry carries a hash over the hash of the entry before.
//!
//! A changed, removed or moved entry breaks the chain, unless all later hashes are computed anew. Entries cut
//! off at the end leave a shorter chain that is whole: signed heads ([`super::head`]) find that.

use std::fmt;

use sha2::{Digest, Sha256};

use super::head::Unfit;

/// The hash of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hash([u8; 32]);

impl Hash {
    /// What the first entry follows.
    pub const ORIGIN: Self = Self([0; 32]);

    /// The hash with these bytes; `None` if they are not 32.
    #[must_use]
    pub fn of_bytes(bytes: &[u8]) -> Option<Self> {
        bytes.try_into().ok().map(Self)
    }

    /// Its bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

impl fmt::Display for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// The hash of the entry with this number and text, behind the entry with the hash `before`.
#[must_use]
pub fn link(before: Hash, number: u64, body: &str) -> Hash {
    let mut digest = Sha256::new();
    // Says what is hashed, so that no other text of ours has the same hash.
    digest.update(b"r6 audit 1\0");
    digest.update(before.0);
    digest.update(number.to_be_bytes());
    digest.update(body.as_bytes());
    Hash(digest.finalize().into())
}

/// Checks a chain, entry by entry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verifier {
    /// The number of the last entry.
    entries: u64,
    head: Hash,
}

impl Default for Verifier {
    fn default() -> Self {
        Self { entries: 0, head: Hash::ORIGIN }
    }
}

/// Where a chain is broken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Broken {
    /// An entry is missing, or they are in another order.
    Missing {
        /// The number that should have come.
        wanted: u64,
        /// The number that came.
        found: u64,
    },
    /// The hash does not fit: this entry or the one before was changed.
    Changed {
        /// The number of the entry.
        number: u64,
    },
    /// The log does not have the entry of a signed head: its end was cut off, or it was rewritten.
    Head {
        /// The number of the entry.
        number: u64,
    },
    /// A signed head beside the log is wrong.
    Signature(Unfit),
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing { wanted, found } => {
                write!(f, "entry {wanted} is missing: entry {found} stands in its place")
            }
            Self::Changed { number } => {
                write!(f, "entry {number} does not fit its hash: it or an entry before it was changed")
            }
            Self::Head { number } => write!(
                f,
                "a signed head is about entry {number}, and the log does not have this entry: its end was cut \
                 off, or it was rewritten"
            ),
            Self::Signature(unfit) => write!(f, "a stored head: {unfit}"),
        }
    }
}

impl std::error::Error for Broken {}

impl Verifier {
    /// A verifier of the entries behind this one, which has this hash.
    #[must_use]
    pub fn after(number: u64, hash: Hash) -> Self {
        Self { entries: number, head: hash }
    }

    /// Checks the next entry.
    ///
    /// # Errors
    /// [`Broken`]: the chain is not whole. The verifier stays where it was.
    pub fn check(&mut self, number: u64, body: &str, hash: Hash) -> Result<(), Broken> {
        let wanted = self.entries.saturating_add(1);
        if number != wanted {
            return Err(Broken::Missing { wanted, found: number });
        }
        if link(self.head, number, body) != hash {
            return Err(Broken::Changed { number });
        }
        (self.entries, self.head) = (number, hash);
        Ok(())
    }

    /// The number of the last entry that was checked, and its hash.
    #[must_use]
    pub fn head(&self) -> (u64, Hash) {
        (self.entries, self.head)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn chain(bodies: &[String]) -> Vec<(u64, String, Hash)> {
        let mut head = Hash::ORIGIN;
        let entry = |(number, body): (u64, &String)| {
            head = link(head, number, body);
            (number, body.clone(), head)
        };
        (1..).zip(bodies).map(entry).collect()
    }

    fn verify(entries: &[(u64, String, Hash)]) -> Result<(u64, Hash), Broken> {
        let mut verifier = Verifier::default();
        entries.iter().try_for_each(|(number, body, hash)| verifier.check(*number, body, *hash))?;
        Ok(verifier.head())
    }

    proptest! {
        #[test]
        fn an_untouched_chain_is_whole(bodies in prop::collection::vec(".{0,9}", 0..9)) {
            let entries = chain(&bodies);
            let head = entries.last().map_or(Hash::ORIGIN, |(_, _, hash)| *hash);
            prop_assert_eq!(verify(&entries), Ok((bodies.len() as u64, head)));
        }

        #[test]
        fn a_changed_a_removed_and_a_moved_entry_are_found(
            bodies in prop::collection::vec(".{1,9}", 2..9),
            at in any::<prop::sample::Index>(),
            renumbers in any::<bool>(),
        ) {
            let entries = chain(&bodies);
            let at = at.index(entries.len());
            let mut changed = entries.clone();
            changed[at].1.push('x');
            prop_assert_eq!(verify(&changed), Err(Broken::Changed { number: at as u64 + 1 }));

            let at = at.min(entries.len() - 2);
            let renumbered = |mut entries: Vec<(u64, String, Hash)>| {
                for (number, entry) in (1..).zip(&mut entries) {
                    if renumbers {
                        entry.0 = number;
                    }
                }
                entries
            };
            let mut removed = entries.clone();
            removed.remove(at);
            prop_assert!(verify(&renumbered(removed)).is_err());
            let mut moved = entries.clone();
            moved.swap(at, at + 1);
            prop_assert!(verify(&renumbered(moved)).is_err());
        }
    }
}
