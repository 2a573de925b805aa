//! Names of robots.

use std::borrow::Borrow;
use std::fmt;

use arrayvec::ArrayString;

/// The longest name.
const MAX: usize = 32;

/// A name of a robot: 1 to 32 characters out of `a` to `z`, digits and `-`.
///
/// It has its text in place: a list of a thousand robots is searched with every poll.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RobotName(ArrayString<MAX>);

impl RobotName {
    /// What a name is, for people.
    pub const WANTED: &str = "a name of 1 to 32 characters: a to z, digits and -";

    /// The name; `None` if the text is no name.
    #[must_use]
    pub fn new(text: &str) -> Option<Self> {
        let name = ArrayString::from(text).ok()?;
        Self::is_name(text).then_some(Self(name))
    }

    /// Whether the text is a name.
    #[must_use]
    pub fn is_name(text: &str) -> bool {
        let fits = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
        (1..=MAX).contains(&text.len()) && text.bytes().all(fits)
    }

    /// Its text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// Names are found by their text.
impl Borrow<str> for RobotName {
    fn borrow(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for RobotName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_fits_into_a_path_and_a_file_name() {
        for good in ["a", "press-4", "0", &"x".repeat(32)] {
            assert_eq!(RobotName::new(good).unwrap().as_str(), good);
        }
        for bad in ["", "Press", "a b", "a/b", "..", "é", "a_b", &"x".repeat(33)] {
            assert_eq!(RobotName::new(bad), None, "{bad}");
        }
    }
}
