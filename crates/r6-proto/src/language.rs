//! The language of texts for people.

/// The language of a text for people.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Language {
    /// English.
    #[default]
    English,
    /// Simplified Chinese. A peer's own words, and the reason why something could not be read or done, are
    /// not translated.
    Chinese,
}
