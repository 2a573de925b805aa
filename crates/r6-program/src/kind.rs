//! Which kind of program a text is.

use crate::form;
use crate::taught::MAX_TEXT_BYTES;

/// The keys of instructions for `r6 run`, in TOML and in the frames of AddRCC.
const OF_INSTRUCTIONS: [&str; 7] =
    ["instruction", "instructions", "repeat", "append", "dsID", "reqType", "emptyList"];

/// Which kind of program a text is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// Instructions for `r6 run`: [`crate::MotionProgram`].
    Instructions,
    /// A taught program: [`crate::taught::Program`].
    Taught,
    /// Neither: there is no `[[instruction]]`, no frame and no `[[step]]`.
    Neither,
}

impl FileKind {
    /// The kind of a text by its keys. The text may be wrong in other ways. A text that is neither
    /// TOML nor JSON counts as instructions: their reader says where it is wrong.
    #[must_use]
    pub fn of(text: &str) -> Self {
        // A taught program is not longer. Reading a long list twice would take time.
        if text.len() > MAX_TEXT_BYTES && !text.contains("[[step]]") {
            return Self::Instructions;
        }
        let (document, found) = form::parse(text);
        let has = |key: &str| document.value(key).is_some();
        if found.finish(Some(())).is_err() || OF_INSTRUCTIONS.into_iter().any(has) {
            Self::Instructions
        } else if has("step") {
            Self::Taught
        } else {
            Self::Neither
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_keys_tell_the_kind() {
        for (text, kind) in [
            ("[[instruction]]\ndo = \"wait\"", FileKind::Instructions),
            ("repeat = true", FileKind::Instructions),
            (r#"{"reqType": "AddRCC"}"#, FileKind::Instructions),
            ("// two frames\n{}{}", FileKind::Instructions),
            ("[[step", FileKind::Instructions),
            ("[[instruction]]\n[[step]]", FileKind::Instructions),
            ("[[step]]\ndo = \"nothing\"", FileKind::Taught),
            (r#"{"step": []}"#, FileKind::Taught),
            ("", FileKind::Neither),
            ("[[stepp]]", FileKind::Neither),
        ] {
            assert_eq!(FileKind::of(text), kind, "{text}");
        }
    }
}
