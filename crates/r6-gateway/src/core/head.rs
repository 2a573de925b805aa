//! Signed heads of the audit log: which entry was the last one at a time, and its hash.
//!
//! A head is a signed note (C2SP `signed-note`) with a text modelled on C2SP `tlog-checkpoint`: the name of
//! the key, the number of the entry, its hash in base64, and a line that says what the head is for. Ed25519
//! signs it. The hash is that of a chain, not of a Merkle tree. The keys have the text format of
//! `golang.org/x/mod/sumdb/note`.

use std::fmt;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ring::signature::{ED25519, Ed25519KeyPair, KeyPair, UnparsedPublicKey};
use sha2::{Digest, Sha256};

use super::chain::Hash;

/// The longest text of a head or a key, in bytes. A witness may add signatures.
pub const MAX_BYTES: usize = 16 * 1024;

/// The byte that stands for Ed25519 in keys and their numbers.
const ED25519_TYPE: u8 = 1;

/// What the names of all keys begin with.
const NAME: &str = "r6-gateway/audit/";

/// What the secret text of a key begins with.
const PRIVATE: &str = "PRIVATE+KEY+";

/// What a head is for. A head of one kind cannot stand in for one of the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The log had this last entry.
    End,
    /// Retention removed the entries up to this one.
    Cut,
}

impl Kind {
    fn word(self) -> &'static str {
        match self {
            Self::End => "end",
            Self::Cut => "cut",
        }
    }
}

/// An entry of the audit log at a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Head {
    /// What it is for.
    pub kind: Kind,
    /// The number of the entry.
    pub number: u64,
    /// The hash of the entry.
    pub hash: Hash,
    /// When it was signed: RFC 3339, UTC.
    pub time: String,
}

/// Why a text is not a head that a key signed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unfit {
    /// It is not a head.
    Malformed,
    /// It is a head for something else.
    OtherKind,
    /// It has no signature by this key.
    OtherKey,
    /// The signature is not over this text.
    Forged,
}

impl fmt::Display for Unfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Malformed => "it is not a head of an audit log",
            Self::OtherKind => "it is a head for something else",
            Self::OtherKey => "another key signed it",
            Self::Forged => "its signature is wrong: it was changed",
        })
    }
}

/// The public half of the key of an audit log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PublicKey([u8; 32]);

impl PublicKey {
    /// Reads the text of a key.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let key = Self(data_of(text)?);
        (key.to_string() == text).then_some(key)
    }

    /// Its name: the first line of its heads.
    fn name(&self) -> String {
        let digest = Sha256::digest(self.0);
        digest.iter().take(8).fold(NAME.to_owned(), |name, byte| format!("{name}{byte:02x}"))
    }

    /// The number of the key that a signed note uses.
    fn id(&self) -> [u8; 4] {
        let mut digest = Sha256::new();
        digest.update(self.name());
        digest.update([b'\n', ED25519_TYPE]);
        digest.update(self.0);
        let [a, b, c, d, ..]: [u8; 32] = digest.finalize().into();
        [a, b, c, d]
    }

    /// The text behind the word for the kind of key.
    fn text_with(&self, data: &[u8; 32]) -> String {
        let data: Vec<u8> = [ED25519_TYPE].iter().chain(data).copied().collect();
        format!("{}+{:08x}+{}", self.name(), u32::from_be_bytes(self.id()), STANDARD.encode(data))
    }

    /// Reads a head of this kind and checks that this key signed it.
    ///
    /// # Errors
    /// The note is no head, is of another kind, or another key signed it.
    pub fn open_as(&self, kind: Kind, note: &str) -> Result<Head, Unfit> {
        self.open(note).and_then(|head| if head.kind == kind { Ok(head) } else { Err(Unfit::OtherKind) })
    }

    /// Reads a head and checks that this key signed it.
    ///
    /// # Errors
    /// [`Unfit`].
    fn open(&self, note: &str) -> Result<Head, Unfit> {
        let (text, signatures) = split(note).ok_or(Unfit::Malformed)?;
        let (name, head) = read(text).ok_or(Unfit::Malformed)?;
        if name != self.name() {
            return Err(Unfit::OtherKey);
        }
        let own = signatures.lines().filter_map(|line| {
            let (signer, data) = line.strip_prefix("— ")?.split_once(' ')?;
            let data = STANDARD.decode(data).ok().filter(|_| signer == name)?;
            Some(data.strip_prefix(&self.id())?.to_vec())
        });
        let key = UnparsedPublicKey::new(&ED25519, self.0);
        let valid: Vec<_> = own.map(|signature| key.verify(text.as_bytes(), &signature).is_ok()).collect();
        match valid.as_slice() {
            [] => Err(Unfit::OtherKey),
            valid if valid.iter().all(|valid| *valid) => Ok(head),
            _ => Err(Unfit::Forged),
        }
    }
}

impl fmt::Display for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text_with(&self.0))
    }
}

/// The bytes in the text of a key. Base64 may have `/` and `+` too.
fn data_of(text: &str) -> Option<[u8; 32]> {
    let (_, data) = text.strip_prefix(NAME)?.split_once('+')?.1.split_once('+')?;
    let [ED25519_TYPE, data @ ..] = &STANDARD.decode(data).ok()?[..] else { return None };
    data.try_into().ok()
}

/// The text of a note, and its lines of signatures.
fn split(note: &str) -> Option<(&str, &str)> {
    let at = note.rfind("\n\n").filter(|_| note.len() <= MAX_BYTES && note.ends_with('\n'))?;
    Some((note.get(..=at)?, note.get(at + 2..)?))
}

/// The name of the key and the head of a text.
fn read(text: &str) -> Option<(&str, Head)> {
    let mut lines = text.lines();
    let (name, number, hash, last) = (lines.next()?, lines.next()?, lines.next()?, lines.next()?);
    let hash = Hash::of_bytes(&STANDARD.decode(hash).ok()?)?;
    let (word, time) = last.split_once(' ')?;
    // It is shown on terminals.
    if !time.bytes().all(|byte| byte.is_ascii_graphic()) {
        return None;
    }
    let kind = [Kind::End, Kind::Cut].into_iter().find(|kind| kind.word() == word)?;
    let head = Head { kind, number: number.parse().ok()?, hash, time: time.to_owned() };
    // There is one text for each head.
    (text_of(name, &head) == text).then_some((name, head))
}

fn text_of(name: &str, head: &Head) -> String {
    let Head { kind, number, hash, time } = head;
    format!("{name}\n{number}\n{}\n{} {time}\n", STANDARD.encode(hash.bytes()), kind.word())
}

/// The key that signs the heads of an audit log.
pub struct Signer {
    seed: [u8; 32],
    pair: Ed25519KeyPair,
    key: PublicKey,
}

impl fmt::Debug for Signer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Signer").field("key", &self.key).finish_non_exhaustive()
    }
}

impl Signer {
    /// The key of 32 random bytes; `None` if the library refuses them.
    #[must_use]
    pub fn of_seed(seed: [u8; 32]) -> Option<Self> {
        let pair = Ed25519KeyPair::from_seed_unchecked(&seed).ok()?;
        let key = PublicKey(pair.public_key().as_ref().try_into().ok()?);
        Some(Self { seed, pair, key })
    }

    /// Reads the secret text of a key.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let data = data_of(text.trim_end().strip_prefix(PRIVATE)?)?;
        Self::of_seed(data).filter(|signer| signer.secret() == text)
    }

    /// The secret text of the key, a line.
    #[must_use]
    pub fn secret(&self) -> String {
        format!("{PRIVATE}{}\n", self.key.text_with(&self.seed))
    }

    /// The public half.
    #[must_use]
    pub fn key(&self) -> PublicKey {
        self.key
    }

    /// Signs a head. Returns the note, which ends with a line feed.
    #[must_use]
    pub fn sign(&self, head: &Head) -> String {
        let name = self.key.name();
        let text = text_of(&name, head);
        let signature = self.pair.sign(text.as_bytes());
        let data: Vec<u8> = self.key.id().iter().chain(signature.as_ref()).copied().collect();
        format!("{text}\n— {name} {}\n", STANDARD.encode(data))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::core::chain::link;

    fn head(kind: Kind) -> Head {
        let time = "2026-01-01T00:00:00.000000Z".to_owned();
        Head { kind, number: 812, hash: link(Hash::ORIGIN, 1, "{}"), time }
    }

    #[test]
    fn a_head_is_opened_with_its_key_alone() {
        let (one, other) = (Signer::of_seed([1; 32]).unwrap(), Signer::of_seed([2; 32]).unwrap());
        for kind in [Kind::End, Kind::Cut] {
            let note = one.sign(&head(kind));
            assert_eq!(one.key().open(&note), Ok(head(kind)));
            assert_eq!(other.key().open(&note), Err(Unfit::OtherKey));
            // A witness may sign too.
            let witnessed = format!("{note}— witness.example/w AAAAAAAA\n");
            assert_eq!(one.key().open(&witnessed), Ok(head(kind)));
            // The name of the key alone makes no signature of it.
            let text = note.split_once("\n\n").unwrap().0;
            let unsigned = format!("{text}\n\n— witness.example/w AAAAAAAA\n");
            assert_eq!(one.key().open(&unsigned), Err(Unfit::OtherKey));
        }
        let end = one.sign(&head(Kind::End));
        assert_eq!(one.key().open(&end.replacen("\nend ", "\ncut ", 1)), Err(Unfit::Forged));
        assert_eq!(one.key().open(&end.replacen("\n812\n", "\n0812\n", 1)), Err(Unfit::Malformed));
        assert_eq!(one.key().open(""), Err(Unfit::Malformed));
        assert_eq!(one.key().open_as(Kind::End, &end), Ok(head(Kind::End)));
        assert_eq!(one.key().open_as(Kind::Cut, &end), Err(Unfit::OtherKind));
        // The owner of the key cannot write control characters to the terminal of a reader.
        let colours = Head { time: "\u{1b}[31m".to_owned(), ..head(Kind::End) };
        assert_eq!(one.key().open(&one.sign(&colours)), Err(Unfit::Malformed));
    }

    /// RFC 8032, 7.1, test 1: the seed and the public key. The rest of a note is text.
    #[test]
    fn keys_are_those_of_ed25519() {
        let bytes = |hex: &str| -> [u8; 32] {
            let digits = |at: usize| u8::from_str_radix(&hex[2 * at..2 * at + 2], 16).unwrap();
            std::array::from_fn(digits)
        };
        let seed = bytes("9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60");
        let public = bytes("d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a");
        assert_eq!(Signer::of_seed(seed).unwrap().key(), PublicKey(public));
    }

    #[test]
    fn no_secret_is_in_a_log() {
        let signer = Signer::of_seed([7; 32]).unwrap();
        assert!(!format!("{signer:?}").contains(&STANDARD.encode([7; 30])[..20]));
    }

    proptest! {
        #[test]
        fn keys_are_read_as_they_are_written(seed in any::<[u8; 32]>()) {
            let signer = Signer::of_seed(seed).unwrap();
            let text = signer.key().to_string();
            prop_assert_eq!(PublicKey::parse(&text), Some(signer.key()));
            prop_assert_eq!(Signer::parse(&signer.secret()).unwrap().key(), signer.key());
            prop_assert!(PublicKey::parse(&signer.secret()).is_none() && Signer::parse(&text).is_none());
            let note = signer.sign(&head(Kind::End));
            prop_assert_eq!(signer.key().open(&note), Ok(head(Kind::End)));
        }

        #[test]
        fn a_changed_byte_of_a_head_is_noticed(at in any::<prop::sample::Index>(), to in 0..128_u8) {
            let signer = Signer::of_seed([1; 32]).unwrap();
            let mut bytes = signer.sign(&head(Kind::End)).into_bytes();
            let at = at.index(bytes.len());
            prop_assume!(bytes[at] != to);
            bytes[at] = to;
            if let Ok(note) = String::from_utf8(bytes) {
                prop_assert!(signer.key().open(&note).is_err());
            }
        }

        #[test]
        fn no_text_of_a_key_or_a_head_makes_a_panic(text in "(r6-gateway/audit/[0-9a-f]{0,16})?[+\n— a-zA-Z0-9/=]{0,80}") {
            let signer = Signer::of_seed([1; 32]).unwrap();
            prop_assert!(signer.key().open(&text).is_err());
            prop_assert!(PublicKey::parse(&text).is_none() && Signer::parse(&text).is_none());
        }
    }
}
