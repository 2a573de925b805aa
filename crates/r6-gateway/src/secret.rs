//! Random secrets of 256 bits: tokens, sessions, one-time links. Only their hashes are kept. Secrets of
//! leases have 128 bits.

use sha2::{Digest, Sha256};

/// Random bytes of the system.
///
/// # Errors
/// The system has no random numbers.
pub fn fill(bytes: &mut [u8]) -> Result<(), getrandom::Error> {
    #[cfg(feature = "simulation")]
    if crate::simulated::fill(bytes) {
        return Ok(());
    }
    getrandom::fill(bytes)
}

/// Draws a secret: its text in hexadecimal behind a prefix, and the hash of this text.
///
/// # Errors
/// The system has no random numbers.
pub fn draw(prefix: &str) -> Result<(String, [u8; 32]), getrandom::Error> {
    let mut bytes = [0; 32];
    fill(&mut bytes)?;
    let text = prefix.to_owned() + &hex(&bytes);
    let hash = hash(&text);
    Ok((text, hash))
}

/// The hash that is kept of a secret. It has 256 random bits, so a fast hash is enough.
pub fn hash(text: &str) -> [u8; 32] {
    Sha256::digest(text).into()
}

/// A second secret that belongs to the first and does not tell it.
pub fn derived(purpose: &str, text: &str) -> String {
    let mut digest = Sha256::new();
    digest.update(purpose);
    digest.update([0]);
    digest.update(text);
    hex(&digest.finalize())
}

/// Compares in a time that does not depend on where the two differ.
pub fn is_same(one: &str, other: &str) -> bool {
    one.len() == other.len() && one.bytes().zip(other.bytes()).fold(0, |all, (a, b)| all | (a ^ b)) == 0
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn secrets_differ_and_are_compared_whole() {
        let (one, hash_of_one) = draw("x_").unwrap();
        assert!(one.len() == 66 && one.starts_with("x_") && hash(&one) == hash_of_one);
        assert_ne!(draw("x_").unwrap().0, one);
        assert_ne!(derived("csrf", &one), derived("other", &one));
        assert!(is_same("abc", "abc"));
        for other in ["", "ab", "abd", "abcd", "bbc"] {
            assert!(!is_same("abc", other), "{other}");
        }
    }
}
