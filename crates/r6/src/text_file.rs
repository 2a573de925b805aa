//! Reads files that a user names, and stdin, as text of a limited length. A source that is longer is never
//! held in memory as a whole, because a device may have no end.

use std::io::Read;
use std::path::Path;

/// Reads a text file of at most `most` bytes. `what` names its content in the error.
pub fn read(path: &Path, what: &str, most: usize) -> Result<String, String> {
    let file = std::fs::File::open(path).map_err(|error| format!("the file cannot be read: {error}"))?;
    read_from(file, "the file", what, most)
}

/// Reads text of at most `most` bytes. `source` and `what` name the source and its content in the error.
pub fn read_from(from: impl Read, source: &str, what: &str, most: usize) -> Result<String, String> {
    // Reading one byte more than allowed shows that the source is too long.
    let limit = u64::try_from(most).unwrap_or(u64::MAX).saturating_add(1);
    let mut bytes = Vec::new();
    let read = from.take(limit).read_to_end(&mut bytes);
    read.map_err(|error| format!("{source} cannot be read: {error}"))?;
    if bytes.len() > most {
        return Err(format!("{source} is too long: {what} has {most} bytes at most"));
    }
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        format!("{source} cannot be read: {what} is UTF-8 text, and byte {at} is not")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_without_an_end_is_read_up_to_the_limit() {
        let read = read_from(std::io::repeat(b'0'), "stdin", "a program", 10);
        assert_eq!(read, Err("stdin is too long: a program has 10 bytes at most".to_owned()));
        // The limit cuts a character in two; the error is still "too long".
        let read = read_from("字字".as_bytes(), "stdin", "a program", 4);
        assert_eq!(read, Err("stdin is too long: a program has 4 bytes at most".to_owned()));
        assert_eq!(read_from("字字".as_bytes(), "stdin", "a program", 6), Ok("字字".to_owned()));
        let read = read_from(&b"ab\xffc"[..], "stdin", "a program", 6);
        assert_eq!(read, Err("stdin cannot be read: a program is UTF-8 text, and byte 2 is not".to_owned()));
    }
}
