//! Where the numbers of a model come from.

/// How far a number can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Certainty {
    /// Read from a real machine.
    Measured,
    /// From a public description of this model by someone else.
    Published,
    /// Calculated from measured or published numbers.
    Derived,
    /// Published for another model.
    Borrowed,
    /// Without a source, but anything else would be odd.
    Assumed,
    /// Not a claim about any real machine.
    Chosen,
}

impl Certainty {
    /// All of them, from most to least certain.
    pub const ALL: [Self; 6] =
        [Self::Measured, Self::Published, Self::Derived, Self::Borrowed, Self::Assumed, Self::Chosen];

    /// Its word in a model file.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Published => "published",
            Self::Derived => "derived",
            Self::Borrowed => "borrowed",
            Self::Assumed => "assumed",
            Self::Chosen => "chosen",
        }
    }
}

/// Where some of a model's numbers come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// The numbers' names: `max_line_speed`, `geometry.d1`, `J3.soft`, or `J*.soft` for every axis.
    pub of: Vec<String>,
    /// How far they can be trusted.
    pub certainty: Certainty,
    /// Who or what says so.
    pub text: String,
}

impl Source {
    /// Whether it covers the number with this name, such as `J3.soft`.
    #[must_use]
    pub fn covers(&self, number: &str) -> bool {
        self.of.iter().any(|pattern| matches(pattern, number))
    }
}

/// Whether a name from a file, with `J*` for every axis, means this number.
pub(super) fn matches(pattern: &str, number: &str) -> bool {
    match (pattern.strip_prefix("J*."), number.split_once('.')) {
        (Some(wanted), Some((axis, field))) => axis.starts_with('J') && field == wanted,
        (Some(_), None) => false,
        (None, _) => pattern == number,
    }
}
