//! The settings of the hall: its time zone and its shifts.

use serde::{Deserialize, Serialize};

use super::ManagedBy;

/// The settings as they are.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Settings {
    /// The name of the time zone in the IANA database.
    #[cfg_attr(feature = "openapi", schema(example = "Europe/Berlin"))]
    pub time_zone: String,
    /// The shifts, 12 at most. No two overlap.
    #[cfg_attr(feature = "openapi", schema(max_items = 12))]
    pub shifts: Vec<Shift>,
    /// Where they can be changed.
    pub managed_by: ManagedBy,
    /// The `ETag` of these settings, for `If-Match`.
    #[cfg_attr(feature = "openapi", schema(example = "\"3-9f86d081884c7d65\""))]
    pub etag: String,
}

/// The time zone and the shifts of a hall.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct HallSettings {
    /// The name of the time zone in the IANA database.
    #[cfg_attr(feature = "openapi", schema(example = "Europe/Berlin"))]
    pub time_zone: String,
    /// The shifts, 12 at most. No two overlap.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(max_items = 12))]
    pub shifts: Vec<Shift>,
}

/// A shift. Its times are those of the clock on the wall of the hall.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Shift {
    /// Its name: 1 to 32 characters of a to z, digits and -.
    #[cfg_attr(feature = "openapi", schema(example = "night"))]
    pub name: String,
    /// The days on which it begins.
    #[cfg_attr(feature = "openapi", schema(min_items = 1, max_items = 7))]
    pub days: Vec<Weekday>,
    /// When it begins.
    #[cfg_attr(feature = "openapi", schema(example = "22:00"))]
    pub begin: String,
    /// When it ends: on the next day, if that is before its begin. `24:00` is the end of the day.
    #[cfg_attr(feature = "openapi", schema(example = "06:00"))]
    pub end: String,
}

/// A day of the week.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Weekday {
    /// Monday.
    Mon,
    /// Tuesday.
    Tue,
    /// Wednesday.
    Wed,
    /// Thursday.
    Thu,
    /// Friday.
    Fri,
    /// Saturday.
    Sat,
    /// Sunday.
    Sun,
}

impl Weekday {
    /// All of them, Monday first.
    pub const ALL: [Self; 7] = [Self::Mon, Self::Tue, Self::Wed, Self::Thu, Self::Fri, Self::Sat, Self::Sun];

    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Mon => "mon",
            Self::Tue => "tue",
            Self::Wed => "wed",
            Self::Thu => "thu",
            Self::Fri => "fri",
            Self::Sat => "sat",
            Self::Sun => "sun",
        }
    }

    /// The day with this word.
    #[must_use]
    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|day| day.word() == word)
    }
}

/// A shift of one day, with its instants.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ShiftSpan {
    /// Its name.
    pub name: String,
    /// The date of its begin on the calendar of the hall.
    #[cfg_attr(feature = "openapi", schema(example = "2026-11-25"))]
    pub date: String,
    /// The time zone of the hall.
    #[cfg_attr(feature = "openapi", schema(example = "Europe/Berlin"))]
    pub time_zone: String,
    /// Its begin.
    pub begin: String,
    /// Its end.
    pub end: String,
    /// Whether it has not ended: the figures are those up to now.
    pub under_way: bool,
}
