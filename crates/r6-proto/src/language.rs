//! The language of texts for people.

/// The language of a text for people.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Language {
    /// English.
    #[default]
    English,
    /// Simplified Chinese. A peer's own words, and texts of the operating system, are not translated.
    Chinese,
}
