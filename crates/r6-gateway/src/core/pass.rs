//! Passes: a gateway that passes a request on says with one who asked for it, and signs that.
//!
//! A gateway draws a key at its start, and the row of the gateway in the store has its public half. So
//! all who can write the store can be a gateway, and who can only read it cannot. A pass is for one request
//! to one start of one gateway: it names both, has the hash of the head and that of the body, a number that
//! is taken once, and a time after which it is not taken any more.

use std::collections::BTreeSet;
use std::net::SocketAddr;

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use ring::signature::{ED25519, Ed25519KeyPair, KeyPair, UnparsedPublicKey};
use serde::{Deserialize, Serialize};

/// How many numbers a pass may be behind the newest one of its gateway. More requests of one gateway are
/// never on their way at once.
pub const BEHIND: u64 = 4_096;

/// The longest pass, in bytes. It has two hashes and a name.
pub const MAX_BYTES: usize = 2 * 1024;

/// Who asked a gateway for something.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bearer {
    /// The token with this number, or a browser with a session for it.
    Token(i64),
    /// This user, with a session.
    User(String),
    /// The gateway itself, to read.
    Gateway,
}

/// What a gateway says of a request that it passes on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pass {
    /// The gateway that passes it on.
    pub from: u64,
    /// The gateway that it is for.
    pub to: u64,
    /// The number of the pass.
    pub number: u64,
    /// Until when it is taken, in milliseconds of the store's clock. What somebody holds back, or the network
    /// does, is not carried out when it is not expected any more.
    pub until: u64,
    /// SHA-256 of the method of the request, its path and its headers.
    pub head: [u8; 32],
    /// SHA-256 of its body.
    pub body: [u8; 32],
    /// Who asked.
    pub bearer: Bearer,
    /// The address that the request came from.
    pub source: Option<SocketAddr>,
}

/// The key of a gateway.
pub struct PassKey(Ed25519KeyPair);

impl std::fmt::Debug for PassKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("PassKey")
    }
}

impl PassKey {
    /// The key of these random bytes.
    #[must_use]
    pub fn of_seed(seed: [u8; 32]) -> Option<Self> {
        Ed25519KeyPair::from_seed_unchecked(&seed).ok().map(Self)
    }

    /// Its public half, as text.
    #[must_use]
    pub fn public(&self) -> String {
        URL_SAFE_NO_PAD.encode(self.0.public_key().as_ref())
    }

    /// The text of a pass, with its signature.
    #[must_use]
    pub fn sign(&self, pass: &Pass) -> String {
        // Our own types always become JSON.
        let text = serde_json::to_vec(pass).unwrap_or_default();
        let signature = self.0.sign(&text);
        format!("{}.{}", URL_SAFE_NO_PAD.encode(&text), URL_SAFE_NO_PAD.encode(signature.as_ref()))
    }
}

/// The pass in a text, if the gateway that it names has signed it. `key`: the public key of a gateway.
#[must_use]
pub fn open(text: &str, key: impl FnOnce(u64) -> Option<String>) -> Option<Pass> {
    if text.len() > MAX_BYTES {
        return None;
    }
    let (body, signature) = text.split_once('.')?;
    let body = URL_SAFE_NO_PAD.decode(body).ok()?;
    let signature = URL_SAFE_NO_PAD.decode(signature).ok()?;
    let pass: Pass = serde_json::from_slice(&body).ok()?;
    let key = URL_SAFE_NO_PAD.decode(key(pass.from)?).ok()?;
    UnparsedPublicKey::new(&ED25519, key).verify(&body, &signature).ok()?;
    Some(pass)
}

/// The gateways that a text says that it is of and for, which nothing proves yet.
#[must_use]
pub fn claimed(text: &str) -> Option<(u64, u64)> {
    let (body, _) = text.split_once('.').filter(|_| text.len() <= MAX_BYTES)?;
    let pass: Pass = serde_json::from_slice(&URL_SAFE_NO_PAD.decode(body).ok()?).ok()?;
    Some((pass.from, pass.to))
}

/// The numbers of the passes of one gateway that came.
#[derive(Clone, Debug, Default)]
pub struct Taken {
    highest: u64,
    /// Those that are not too far behind it.
    recent: BTreeSet<u64>,
    /// Until when the last of them is taken.
    until: u64,
}

impl Taken {
    /// Takes a pass with this number, which is taken until then. `false`: it came before, or is too far
    /// behind.
    pub fn take(&mut self, number: u64, until: u64) -> bool {
        if number.saturating_add(BEHIND) <= self.highest || !self.recent.insert(number) {
            return false;
        }
        self.highest = self.highest.max(number);
        self.until = self.until.max(until);
        self.recent = self.recent.split_off(&self.highest.saturating_sub(BEHIND - 1));
        true
    }

    /// Whether all of them are too old at this time of the store, so that none comes again.
    #[must_use]
    pub fn is_over(&self, now: u64) -> bool {
        now > self.until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pass() -> Pass {
        Pass {
            from: 3,
            to: 9,
            number: 1,
            until: 1_000,
            head: [6; 32],
            body: [7; 32],
            bearer: Bearer::Token(4),
            source: Some(SocketAddr::from(([10, 0, 0, 7], 5000))),
        }
    }

    #[test]
    fn a_pass_counts_only_with_the_signature_of_its_gateway() {
        let key = PassKey::of_seed([1; 32]).unwrap();
        let text = key.sign(&pass());
        let of = |number| (number == 3).then(|| key.public());
        assert_eq!(open(&text, of), Some(pass()));
        assert_eq!(claimed(&text), Some((3, 9)));
        assert_eq!(open(&text, |_| None), None, "there is no such gateway");
        let other = PassKey::of_seed([2; 32]).unwrap();
        assert_eq!(open(&text, |_| Some(other.public())), None);
        assert_eq!(open(&other.sign(&pass()), of), None);
        let body = |pass: &Pass| key.sign(pass).split_once('.').unwrap().0.to_owned();
        let signature = text.split_once('.').unwrap().1;
        let changed = Pass { bearer: Bearer::Token(5), ..pass() };
        assert_eq!(open(&format!("{}.{signature}", body(&changed)), of), None, "it was changed");
        for wrong in ["", ".", "a.b", &text[1..], &text[..text.len() - 1], &"a".repeat(MAX_BYTES + 1)] {
            assert_eq!(open(wrong, of), None, "{wrong}");
            assert_eq!(claimed(wrong).filter(|_| wrong.len() < 8), None);
        }
    }

    #[test]
    fn a_number_is_taken_once_in_whatever_order_they_come() {
        let mut taken = Taken::default();
        for number in [5, 3, 4, 1_000] {
            assert!(taken.take(number, 0), "{number}");
            assert!(!taken.take(number, 0), "{number} again");
        }
        assert!(taken.take(2, 0));
        assert!(taken.take(10_000, 0));
        assert!(!taken.take(10_000 - BEHIND, 0), "too far behind");
        assert!(taken.take(10_000 - BEHIND + 1, 0));
        assert!(!taken.take(5, 0), "which was taken");
        assert!(taken.recent.len() <= usize::try_from(BEHIND).unwrap());
        assert!(taken.take(u64::MAX, 0));
        assert!(!taken.take(u64::MAX, 0));
        assert!(taken.is_over(1) && !taken.is_over(0));
        let mut taken = Taken::default();
        assert!(taken.take(1, 9) && taken.take(2, 7));
        assert!(!taken.is_over(9) && taken.is_over(10), "the first may still come");
    }
}
