//! The programs that the gateway keeps: their names, their versions, and who may replace which.

use std::fmt;

/// The longest name of a program: what `curMold` reports of a taught program has the same limit.
const LONGEST_NAME: usize = 64;

/// Words that are paths of their own.
const TAKEN: [&str; 2] = ["check", "plan"];

/// The longest text of a program, in bytes: that of a taught program, more than a thousand steps.
pub const MAX_TEXT: usize = 256 * 1024;

/// The most programs. All of them are listed at once, 300 bytes each.
pub const MAX_PROGRAMS: usize = 1_000;

/// How many versions of a program are kept; then the oldest goes. A page lists all of them.
pub const MAX_VERSIONS: usize = 50;

/// How many bytes all versions of all programs have together. They are in the file of the audit log, which
/// has to stay small enough to be copied.
pub const MAX_TOTAL: u64 = 64 << 20;

/// Whether a program or a point can be called so.
pub fn is_name(text: &str) -> bool {
    let fits = |byte: u8| matches!(byte, b'a'..=b'z' | b'0'..=b'9' | b'-' | b'_');
    (1..=LONGEST_NAME).contains(&text.len()) && text.bytes().all(fits)
}

/// The name of a program: 1 to 64 characters of a to z, digits, `-` and `_`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ProgramName(String);

impl ProgramName {
    /// What a name is, for people.
    pub const WANTED: &str =
        "a name of 1 to 64 characters: a to z, digits, - and _; `check` and `plan` are taken";

    /// The name; `None` if the text is no name.
    #[must_use]
    pub fn new(text: &str) -> Option<Self> {
        (is_name(text) && !TAKEN.contains(&text)).then(|| Self(text.to_owned()))
    }

    /// Its text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for ProgramName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// A version of a program and its content. After a program was removed and stored again, the same number may
/// stand for another text, and the tag does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tag {
    /// The number of the version, from 1.
    pub version: u64,
    /// SHA-256 of the text.
    pub hash: [u8; 32],
}

impl Tag {
    /// As `ETag` has it.
    #[must_use]
    pub fn etag(&self) -> String {
        format!("\"{}-{:.16}\"", self.version, self.sha256())
    }

    /// The hash in hexadecimal digits.
    #[must_use]
    pub fn sha256(&self) -> String {
        self.hash.iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

/// Which version a change is for: what the headers of the request say.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Condition {
    /// The tags of `If-Match`, as they were sent.
    pub matches: Option<String>,
    /// The tags of `If-None-Match`, as they were sent.
    pub none_matches: Option<String>,
}

/// Why a change is not for the program as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unfit {
    /// It does not say which version it is for.
    NeedsIfMatch,
    /// It is for another version.
    NotThisVersion,
}

impl Condition {
    /// Whether a change is for the program as it is; `None` if there is no such program.
    ///
    /// # Errors
    /// [`Unfit`].
    pub fn check(&self, present: Option<Tag>) -> Result<(), Unfit> {
        let lists = |list: &str| present.is_some_and(|tag| lists(list, &tag.etag()));
        match (present.is_some(), self.matches.as_deref(), self.none_matches.as_deref()) {
            (_, _, Some(tags)) if lists(tags) => Err(Unfit::NotThisVersion),
            (true, None, _) => Err(Unfit::NeedsIfMatch),
            (_, Some(tags), _) if !lists(tags) => Err(Unfit::NotThisVersion),
            (_, _, _) => Ok(()),
        }
    }
}

/// Whether a list of tags has this tag. `*` alone stands for any tag; a tag may have commas and stars.
/// Weak tags never fit: they do not stand for these bytes. A text that is no list has no tag.
fn lists(list: &str, etag: &str) -> bool {
    if list.trim() == "*" {
        return true;
    }
    let (mut rest, mut has) = (list, false);
    loop {
        rest = rest.trim_start_matches([',', ' ', '\t']);
        if rest.is_empty() {
            return has;
        }
        let tag = rest.strip_prefix("W/").unwrap_or(rest);
        let is_strong = tag.len() == rest.len();
        let Some((opaque, behind)) = tag.strip_prefix('"').and_then(|tag| tag.split_once('"')) else {
            return false;
        };
        let own = etag.strip_prefix('"').and_then(|own| own.strip_suffix('"'));
        has |= is_strong && own == Some(opaque);
        rest = behind.trim_start_matches([' ', '\t']);
        if !rest.is_empty() && !rest.starts_with(',') {
            return false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_fits_into_a_path_and_is_no_path_of_its_own() {
        for name in ["a", "pick-2", "_", "checks", &"x".repeat(64)] {
            assert_eq!(ProgramName::new(name).unwrap().as_str(), name);
        }
        for name in ["", "Pick", "a b", "a/b", "..", "é", "check", "plan", &"x".repeat(65)] {
            assert!(ProgramName::new(name).is_none(), "{name}");
        }
    }

    #[test]
    fn a_change_says_which_version_it_is_for() {
        let tag = Tag { version: 3, hash: [0xab; 32] };
        assert_eq!(tag.etag(), "\"3-abababababababab\"");
        let check = |matches: Option<&str>, none: Option<&str>, present| {
            let of = |text: Option<&str>| text.map(str::to_owned);
            Condition { matches: of(matches), none_matches: of(none) }.check(present)
        };
        let (needed, another) = (Err(Unfit::NeedsIfMatch), Err(Unfit::NotThisVersion));
        let etag = tag.etag();
        for (matches, none, of_present, of_missing) in [
            (None, None, needed, Ok(())),
            (None, Some("*"), another, Ok(())),
            (Some(etag.as_str()), None, Ok(()), another),
            (Some("*"), None, Ok(()), another),
            (Some("\"2-abababababababab\", \"3-abababababababab\""), None, Ok(()), another),
            (Some("W/\"3-abababababababab\""), None, another, another),
            (Some("\"3-abababababababac\""), None, another, another),
            (Some("3-abababababababab"), None, another, another),
            (Some(""), None, another, another),
            (Some("*"), Some("*"), another, another),
            // A tag with commas and a star in it, and lists that are none.
            (Some("\"x,*,y\""), None, another, another),
            (Some("\"a\", *"), None, another, another),
            (Some("\"x,\",, \"3-abababababababab\" ,"), None, Ok(()), another),
            (Some("\"3-abababababababab\" \"a\""), None, another, another),
            (Some("\"3-abababababababab\", \"a"), None, another, another),
            (None, Some("\"9-00\""), needed, Ok(())),
        ] {
            assert_eq!(check(matches, none, Some(tag)), of_present, "{matches:?} {none:?}");
            assert_eq!(check(matches, none, None), of_missing, "{matches:?} {none:?}");
        }
    }
}
