//! Lines and columns of a text, and its comments.

/// Line and column of a byte offset, both counted from 1; columns count characters.
pub fn position(text: &str, offset: usize) -> (usize, usize) {
    let before = text.as_bytes().get(..offset.min(text.len())).unwrap_or_default();
    let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
    let start = before.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
    let column = String::from_utf8_lossy(before.get(start..).unwrap_or_default()).chars().count() + 1;
    (line, column)
}

/// A place that goes forward through a text. Many places of one text cost one pass over it.
#[derive(Clone, Copy, Debug)]
pub struct Forward {
    offset: usize,
    line: usize,
    column: usize,
}

impl Forward {
    /// The beginning of a text.
    pub fn new() -> Self {
        Self { offset: 0, line: 1, column: 1 }
    }

    /// Line and column of a byte offset, as [`position`] counts them. An offset before the last one gets the
    /// place of the last one.
    pub fn to(&mut self, text: &str, offset: usize) -> (usize, usize) {
        let end = offset.clamp(self.offset, text.len().max(self.offset));
        for byte in text.as_bytes().get(self.offset..end).unwrap_or_default() {
            match byte {
                b'\n' => (self.line, self.column) = (self.line + 1, 1),
                // The later bytes of a character.
                0x80..=0xBF => {}
                _ => self.column += 1,
            }
        }
        self.offset = end;
        (self.line, self.column)
    }
}

/// The byte offset of a line and a column, both counted from 1. Columns count bytes, as in errors of
/// `serde_json`.
pub fn offset(text: &str, line: usize, column: usize) -> usize {
    let start: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    (start + column.saturating_sub(1)).min(text.len())
}

/// The text with every `//` comment outside strings replaced by blanks, so that all offsets stay the same.
pub fn without_comments(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        let comment = comment_start(line);
        let (code, comment) = line.split_at(comment.unwrap_or(line.len()));
        out.push_str(code);
        for character in comment.chars() {
            match character {
                '\n' | '\r' => out.push(character),
                _ => out.extend(std::iter::repeat_n(' ', character.len_utf8())),
            }
        }
    }
    out
}

/// Where the comment of a line begins. A JSON string never spans lines, so each line can be read alone.
fn comment_start(line: &str) -> Option<usize> {
    let mut in_string = false;
    let mut escaped = false;
    let mut slash = false;
    for (at, byte) in line.bytes().enumerate() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if in_string => escaped = true,
            b'"' => in_string = !in_string,
            b'/' if !in_string && slash => return Some(at - 1),
            _ => {}
        }
        slash = byte == b'/' && !in_string;
    }
    None
}

/// Where the innermost list that is still open before `offset` begins.
pub fn open_list(text: &str, offset: usize) -> Option<usize> {
    let mut open = Vec::new();
    let mut in_string = false;
    let mut escaped = false;
    for (at, byte) in text.bytes().enumerate().take(offset) {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if in_string => escaped = true,
            b'"' => in_string = !in_string,
            _ if in_string => {}
            b'{' | b'[' => open.push((at, byte)),
            b'}' | b']' => {
                open.pop();
            }
            _ => {}
        }
    }
    open.last().filter(|(_, byte)| *byte == b'[').map(|(at, _)| *at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_go_and_offsets_stay() {
        let text = "{ // 或 \"x\"\n \"a\": \"http://b\" // c\r\n}";
        let stripped = without_comments(text);
        assert_eq!(stripped.len(), text.len());
        assert_eq!(stripped.split_whitespace().collect::<Vec<_>>(), ["{", "\"a\":", "\"http://b\"", "}"]);
        assert_eq!(stripped.matches('\n').count(), 2);
    }

    #[test]
    fn a_quote_behind_a_backslash_does_not_end_a_string() {
        assert_eq!(without_comments(r#"{"a":"\"//\\"} // b"#).trim_end(), r#"{"a":"\"//\\"}"#);
    }

    #[test]
    fn positions_count_characters_from_one() {
        assert_eq!(position("ab\n字d", 0), (1, 1));
        assert_eq!(position("ab\n字d", 6), (2, 2));
        assert_eq!(position("ab\n字d", 99), (2, 3));
    }

    #[test]
    fn a_place_that_goes_forward_is_the_same() {
        let text = "ab\n字d\r\n\n{}é";
        let mut place = Forward::new();
        for (offset, _) in text.char_indices().chain([(text.len(), ' '), (99, ' ')]) {
            assert_eq!(place.to(text, offset), position(text, offset), "{offset}");
        }
        assert_eq!(place.to(text, 0), position(text, text.len()));
    }

    #[test]
    fn the_open_list_is_found() {
        assert_eq!(open_list("{\"a\":[1,{\"b\":[]}", 16), Some(5));
        assert_eq!(open_list("{\"a[\":[1]}", 10), None);
    }
}
