//! Makes texts of peers safe for terminals and logs.

use std::fmt::{self, Write};

/// Shows a peer's text on one line. It escapes every character that could begin a line or control a terminal.
///
/// A carriage return becomes `\r`, a line feed `\n`, a tab `\t`, and an escape character `\u{1b}`. All other
/// characters stay, including the backslash, so escaping a text twice changes nothing more.
///
/// Escape a peer's text where it reaches a person: a refusal's reason, a name, a firmware version, a quoted
/// word. Do not escape it where a program reads it.
#[must_use]
pub fn printable(text: &str) -> Printable<'_> {
    Printable(text)
}

/// A text that is escaped when it is displayed; see [`printable`].
#[derive(Clone, Copy, Debug)]
pub struct Printable<'a>(&'a str);

impl fmt::Display for Printable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for character in self.0.chars() {
            if is_safe(character) {
                f.write_char(character)?;
            } else {
                write!(f, "{}", character.escape_default())?;
            }
        }
        Ok(())
    }
}

/// Whether a character only shows itself: it is not a control character, does not end a line, and does not
/// change the direction of a text.
fn is_safe(character: char) -> bool {
    let ends_line = matches!(character, '\u{2028}' | '\u{2029}');
    // These characters can display later text before earlier text (Unicode TR 36, 3.2).
    let turns = matches!(
        character,
        '\u{061C}' | '\u{200E}' | '\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2066}'..='\u{2069}'
    );
    !character.is_control() && !ends_line && !turns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_line_can_be_forged() {
        assert_eq!(printable("no\r\nREADY").to_string(), r"no\r\nREADY");
        assert_eq!(printable("a\u{2028}b\u{2029}c\u{85}d").to_string(), r"a\u{2028}b\u{2029}c\u{85}d");
        for character in ('\0'..='\u{FFFF}').filter(|character| character.is_control()) {
            let shown = printable(&character.to_string()).to_string();
            assert!(!shown.chars().any(char::is_control), "{shown}");
        }
    }

    #[test]
    fn the_terminal_cannot_be_steered() {
        assert_eq!(printable("\u{1b}[2J\u{9b}1A\u{7f}").to_string(), r"\u{1b}[2J\u{9b}1A\u{7f}");
        assert_eq!(printable("a\u{202E}b\u{2066}c").to_string(), r"a\u{202e}b\u{2066}c");
    }

    #[test]
    fn other_text_stays_and_showing_it_twice_changes_nothing_more() {
        assert_eq!(printable("模号 »5 %« C:\\robot").to_string(), "模号 »5 %« C:\\robot");
        let once = printable("a\tb\n").to_string();
        assert_eq!(printable(&once).to_string(), once);
    }
}
