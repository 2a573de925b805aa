//! In which language people are told what happens.

/// The language of a text for people.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Language {
    /// English.
    #[default]
    English,
    /// Simplified Chinese. What a peer said, and why something could not be read or done, stays as it is.
    Chinese,
}
