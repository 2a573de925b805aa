//! The mistakes of a file, and their places.

use std::fmt;

/// The maximum number of listed mistakes of one file. More do not fit on a screen, and a file of many
/// megabytes must not produce as many lines.
pub const MAX_MISTAKES: usize = 20;

/// One mistake of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Line and column, both counted from 1, columns in characters; `None` for the whole file.
    pub at: Option<(usize, usize)>,
    /// The mistake.
    pub what: String,
    /// How to correct it.
    pub advice: Option<String>,
}

impl Mistake {
    /// A mistake of the whole file.
    #[must_use]
    pub fn of_the_file(what: impl Into<String>, advice: Option<&str>) -> Self {
        Self { at: None, what: what.into(), advice: advice.map(str::to_owned) }
    }

    /// `FILE:LINE:COLUMN: what`; `FILE: what` for the whole file.
    #[must_use]
    pub fn line(&self, file: &str) -> String {
        format!("{file}:{self}")
    }
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.at {
            Some((line, column)) => write!(f, "{line}:{column}: {}", self.what),
            None => write!(f, " {}", self.what),
        }
    }
}

impl std::error::Error for Mistake {}

/// All mistakes of a file, in the order of their places; at least one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistakes {
    first: Mistake,
    others: Vec<Mistake>,
    more: usize,
}

impl Mistakes {
    /// The mistakes of a list, and how many more there are; `None` if the list is empty.
    #[must_use]
    pub(crate) fn new(mut all: Vec<Mistake>, more: usize) -> Option<Self> {
        all.sort_by_key(|mistake| mistake.at);
        let mut all = all.into_iter();
        Some(Self { first: all.next()?, others: all.collect(), more })
    }

    /// The first mistake.
    #[must_use]
    pub fn first(&self) -> &Mistake {
        &self.first
    }

    /// All listed mistakes, at most [`MAX_MISTAKES`].
    pub fn iter(&self) -> impl Iterator<Item = &Mistake> {
        std::iter::once(&self.first).chain(&self.others)
    }

    /// How many mistakes are not listed.
    #[must_use]
    pub fn more(&self) -> usize {
        self.more
    }
}

impl Mistakes {
    /// A line `FILE:LINE:COLUMN: what` for each listed mistake, a form that editors can read. Advice follows
    /// on an indented line.
    pub fn lines(&self, file: &str) -> impl Iterator<Item = String> {
        let more = (self.more > 0).then(|| format!("and {} more mistakes in {file}", self.more));
        let lines = self.iter().flat_map(move |mistake| {
            let advice = mistake.advice.as_ref().map(|advice| format!("    {advice}"));
            std::iter::once(mistake.line(file)).chain(advice)
        });
        lines.chain(more)
    }
}

impl From<Mistake> for Mistakes {
    fn from(first: Mistake) -> Self {
        Self { first, others: Vec::new(), more: 0 }
    }
}

impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, mistake) in self.iter().enumerate() {
            let separator = if number == 0 { "" } else { "\n" };
            write!(f, "{separator}{}", mistake.to_string().trim_start())?;
            if let Some(advice) = &mistake.advice {
                write!(f, "; {advice}")?;
            }
        }
        if self.more > 0 { write!(f, "\nand {} more", self.more) } else { Ok(()) }
    }
}

impl std::error::Error for Mistakes {}
