//! What people and programs see: lines, tables, JSON.

pub mod action;
pub mod alarm;
pub mod drawing;
pub mod panel;
pub mod plot;
pub mod queue;
pub mod readings;
pub mod screen;
pub mod status;
pub mod table;

use std::io::{IsTerminal, Write};

use serde::Serialize;

/// Prints one line (or several) to stdout.
pub fn line(text: impl std::fmt::Display) {
    bytes(format!("{}\n", clean(&text.to_string())).as_bytes());
}

/// The text without control characters other than the end of a line: what a peer or a file says must not steer the
/// terminal.
pub fn clean(text: &str) -> String {
    text.chars().map(|c| if c.is_control() && c != '\n' { '\u{FFFD}' } else { c }).collect()
}

/// Writes to stdout and ends the program quietly where nobody reads it any more (`r6 … | head`).
pub fn bytes(bytes: &[u8]) {
    let mut out = std::io::stdout().lock();
    if out.write_all(bytes).and_then(|()| out.flush()).is_err() {
        std::process::exit(0);
    }
}

/// Prints a value as one line of JSON.
pub fn json(value: &impl Serialize) {
    match serde_json::to_string(value) {
        Ok(text) => line(text),
        Err(error) => eprintln!("r6: this cannot be written as JSON: {error}"),
    }
}

/// Prints a value as JSON over several lines.
pub fn json_pretty(value: &impl Serialize) {
    match serde_json::to_string_pretty(value) {
        Ok(text) => line(text),
        Err(error) => eprintln!("r6: this cannot be written as JSON: {error}"),
    }
}

/// `1 line`, `2 lines`, `0 lines`.
pub fn counted(count: usize, word: &str) -> String {
    if count == 1 { format!("1 {word}") } else { format!("{count} {word}s") }
}

/// What stands in the place of lines that nobody read in time.
pub fn lost_lines(lost: u64) -> String {
    if lost == 1 { "(1 line was lost)".to_owned() } else { format!("({lost} lines were lost)") }
}

/// Whether stdout is a terminal.
pub fn is_terminal() -> bool {
    std::io::stdout().is_terminal()
}

/// Prints a line for the person at the terminal, on stderr, so that it never mixes with what programs read.
pub fn note(text: impl std::fmt::Display) {
    eprintln!("{}", clean(&text.to_string()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_of_a_thing_has_no_s() {
        assert_eq!([0, 1, 2].map(|count| counted(count, "line")), ["0 lines", "1 line", "2 lines"]);
        assert_eq!([1, 2].map(lost_lines), ["(1 line was lost)", "(2 lines were lost)"]);
    }

    #[test]
    fn a_peer_cannot_steer_the_terminal() {
        assert_eq!(clean("a\u{1b}[2Jb\r\nc\u{9b}d"), "a\u{FFFD}[2Jb\u{FFFD}\nc\u{FFFD}d");
        assert_eq!(clean("模号"), "模号");
    }
}
