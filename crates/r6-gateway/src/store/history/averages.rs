//! The store of averages: for each signal the minutes and the hours of each day, as bytes of
//! [`crate::core::history::averages`], and what became of each day.
//!
//! Minutes have a file for each day, hours one for each month. So both can be removed as whole files.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use jiff::civil::{Date, date};
use jiff::{Span, Unit};
use r6_proto::Address;

use crate::core::history::averages::Step;
use crate::core::name::RobotName;
use crate::store::StoreError;

/// A file of averages. Those of minutes come first, and the older ones before the newer ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct AverageFile {
    /// How wide its averages are.
    pub step: Step,
    /// Its first day: days since 1970, UTC.
    pub first: i64,
}

impl AverageFile {
    /// The file that has averages of this day.
    #[must_use]
    pub fn of(step: Step, day: i64) -> Self {
        match step {
            Step::Minute => Self { step, first: day },
            Step::Hour => Self { step, first: day_of(date_of(day).first_of_month()) },
        }
    }

    /// Its days.
    #[must_use]
    pub fn days(self) -> RangeInclusive<i64> {
        match self.step {
            Step::Minute => self.first..=self.first,
            Step::Hour => self.first..=day_of(date_of(self.first).last_of_month()),
        }
    }

    /// Its date: the day, or the first one of the month.
    pub(super) fn date(self) -> Date {
        date_of(self.first)
    }
}

/// The date of a day. Days before 1970 and behind the year 9999 come of a wrong clock: they are put at the
/// nearest date.
fn date_of(day: i64) -> Date {
    let epoch = date(1970, 1, 1);
    let since = Span::new().try_days(day.max(0)).ok();
    since.and_then(|since| epoch.checked_add(since).ok()).unwrap_or(Date::MAX)
}

/// The day of a date.
pub(super) fn day_of(date_of: Date) -> i64 {
    date_of.since((Unit::Day, date(1970, 1, 1))).map_or(0, |since| i64::from(since.get_days()))
}

/// What became of the averages of a day.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DayState {
    /// They are still to be computed. That is written only of a day that has lost values already.
    Pending,
    /// The averages of all its signals are kept.
    Finished,
    /// Values came later: its averages are to be computed anew.
    Reopened,
    /// Values of it were removed, so averages that are computed now would lack them.
    Cut,
}

impl DayState {
    /// This state of a day whose averages have all that was kept.
    #[cfg(test)]
    #[must_use]
    pub const fn whole(self) -> DayNote {
        DayNote { state: self, lacks: false }
    }

    /// This state of a day whose averages lack something.
    #[must_use]
    pub const fn lacking(self) -> DayNote {
        DayNote { state: self, lacks: true }
    }
}

/// What is noted of a day.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DayNote {
    /// What became of its averages.
    pub state: DayState,
    /// Whether some of its values are in no average: they came too late, went too soon, or could not be read.
    pub lacks: bool,
}

/// The averages of a signal on one day.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AverageRow {
    /// The robot.
    pub robot: RobotName,
    /// The signal.
    pub address: Address,
    /// What [`crate::core::history::averages::pack`] wrote.
    pub bytes: Vec<u8>,
}

/// Averages of one signal.
#[derive(Clone, Copy, Debug)]
pub struct AskAverages<'a> {
    /// The robot.
    pub robot: &'a RobotName,
    /// The signal.
    pub address: Address,
    /// Only those from this day on,
    pub from: i64,
    /// up to this one.
    pub to: i64,
}

/// A place for averages. What a method wrote survives the end of the process when it returns.
pub trait AverageStore {
    /// Writes averages of this step and day, all or nothing. They take the place of those that the same
    /// signals had on this day.
    ///
    /// # Errors
    /// [`StoreError`]: nothing was written, or that is unknown.
    fn write(&mut self, step: Step, day: i64, rows: &[AverageRow]) -> Result<(), StoreError>;

    /// The averages of a signal in a file, by day. None without the file.
    ///
    /// # Errors
    /// [`StoreError`].
    fn read(&mut self, file: AverageFile, ask: AskAverages<'_>) -> Result<Vec<(i64, Vec<u8>)>, StoreError>;

    /// Writes what became of a day. All that was written of it before survives a power cut then.
    ///
    /// # Errors
    /// [`StoreError`].
    fn set_state(&mut self, day: i64, note: DayNote) -> Result<(), StoreError>;

    /// What became of these days, as far as it is known. A file that cannot be read is passed over.
    ///
    /// # Errors
    /// [`StoreError`].
    fn states(&mut self, days: RangeInclusive<i64>) -> Result<BTreeMap<i64, DayNote>, StoreError>;

    /// All files, those of minutes first, with their size on the disk in bytes.
    ///
    /// # Errors
    /// [`StoreError`].
    fn files(&mut self) -> Result<Vec<(AverageFile, u64)>, StoreError>;

    /// Removes a file with all that is in it.
    ///
    /// # Errors
    /// [`StoreError`].
    fn remove(&mut self, file: AverageFile) -> Result<(), StoreError>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hours_of_a_month_have_one_file() {
        // 2026-11-25, and 2028-02-10.
        for (day, first, last) in [(20_782, 20_758, 20_787), (21_224, 21_215, 21_243), (0, 0, 30)] {
            let file = AverageFile::of(Step::Hour, day);
            assert_eq!((file.first, *file.days().end()), (first, last), "{day}");
            assert_eq!(AverageFile::of(Step::Hour, last), file);
            assert_ne!(AverageFile::of(Step::Hour, last + 1), file);
            assert_eq!(AverageFile::of(Step::Minute, day).days(), day..=day);
        }
        for wrong in [i64::MIN, -1, i64::MAX] {
            let file = AverageFile::of(Step::Hour, wrong);
            assert!(file.days().contains(&file.first), "{wrong}");
        }
    }
}
