//! The time zone of the hall and its shifts: which instants a shift has on a date.
//!
//! A shift is told in times of the clock on the wall. When that clock is set back, a time comes twice, and
//! the first one is meant. When it is set forward, a time is left out, and the moment of that is meant. So a
//! later time of the wall is never an earlier instant, and shifts that do not overlap on the wall never
//! overlap.

use std::fmt;

use jiff::civil::{Date, DateTime, Time};
use jiff::tz::{AmbiguousOffset, TimeZone, TimeZoneDatabase};
use jiff::{SignedDuration, Span, Timestamp};
use r6_api::gateway::{HallSettings, Shift, Weekday};

use super::history::sample::Micros;

/// The most shifts: four a day, with others at the weekend.
pub const MAX_SHIFTS: usize = 12;

/// The longest name of a time zone that is looked up, in bytes. The longest of the database has 32.
const MAX_ZONE: usize = 64;

/// The longest name of a shift, in bytes.
const MAX_NAME: usize = 32;

const MINUTES_PER_DAY: u16 = 1_440;

/// How many mistakes are told at once: as many as fit on a screen.
const MAX_MISTAKES: usize = 20;

/// A mistake of settings, and where it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// The number of the shift, from 0; `None` for the hall itself.
    pub shift: Option<usize>,
    /// The name of the field.
    pub field: &'static str,
    /// What is wrong.
    pub what: String,
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { shift, field, what } = self;
        match shift {
            Some(number) => write!(f, "shifts[{number}].{field}: {what}"),
            None => write!(f, "{field}: {what}"),
        }
    }
}

/// The settings of a hall that were checked.
#[derive(Clone, Debug)]
pub struct Hall {
    settings: HallSettings,
    zone: TimeZone,
    shifts: Vec<Timed>,
}

/// A shift with its times in minutes from the midnight before it begins.
#[derive(Clone, Copy, Debug)]
struct Timed {
    begin: u16,
    /// Behind the begin, up to two days.
    end: u16,
}

/// A shift of one date.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Occurrence {
    /// The number of the shift in the settings.
    pub shift: usize,
    /// The name of the shift.
    pub name: String,
    /// The date of its begin, such as `2026-11-25`.
    pub date: String,
    /// Its begin.
    pub begin: Micros,
    /// Its end, which does not belong to it.
    pub end: Micros,
}

/// Why there is no such shift.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoShift {
    /// No shift has this name.
    Name,
    /// The text is no date.
    Date,
    /// The shift does not begin on this day of the week.
    Day(Weekday),
    /// The calendar of the hall leaves out this date, or all of the shift.
    LeftOut,
}

impl Hall {
    /// UTC, without shifts.
    #[must_use]
    pub fn usual() -> Self {
        let settings = HallSettings { time_zone: "UTC".to_owned(), shifts: Vec::new() };
        Self { settings, zone: TimeZone::UTC, shifts: Vec::new() }
    }

    /// Checks settings.
    ///
    /// # Errors
    /// All mistakes, or the first 20.
    pub fn new(settings: HallSettings) -> Result<Self, Vec<Mistake>> {
        let mut mistakes = Vec::new();
        let zone = zone(&settings.time_zone);
        if let Err(what) = &zone {
            mistakes.push(Mistake { shift: None, field: "time_zone", what: what.clone() });
        }
        if settings.shifts.len() > MAX_SHIFTS {
            let what = format!("there are at most {MAX_SHIFTS}");
            mistakes.push(Mistake { shift: None, field: "shifts", what });
        }
        let mut shifts = Vec::new();
        for (number, shift) in settings.shifts.iter().enumerate().take(MAX_SHIFTS) {
            let mut wrong = |field, what| mistakes.push(Mistake { shift: Some(number), field, what });
            let fits = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
            if !((1..=MAX_NAME).contains(&shift.name.len()) && shift.name.bytes().all(fits)) {
                let what = format!("a shift has a name of 1 to {MAX_NAME} characters: a to z, digits and -");
                wrong("name", what);
            } else if settings.shifts.iter().take(number).any(|other| other.name == shift.name) {
                wrong("name", format!("two shifts are called `{}`", shift.name));
            }
            let repeated = shift
                .days
                .iter()
                .enumerate()
                .find(|(at, day)| shift.days.iter().take(*at).any(|other| other == *day));
            if let Some((_, day)) = repeated {
                wrong("days", format!("`{}` is there twice", day.word()));
            }
            if shift.days.is_empty() {
                wrong("days", "a shift begins on one day of the week at least".to_owned());
            }
            let begin = minutes(&shift.begin).filter(|begin| *begin < MINUTES_PER_DAY);
            let end = minutes(&shift.end);
            if begin.is_none() {
                wrong("begin", format!("`{}` is not a time from 00:00 to 23:59", shown(&shift.begin)));
            }
            if end.is_none() {
                wrong("end", format!("`{}` is not a time from 00:00 to 24:00", shown(&shift.end)));
            }
            if let (Some(begin), Some(end)) = (begin, end) {
                if begin == end {
                    wrong("end", "it is the begin: a shift of a whole day is from 00:00 to 24:00".to_owned());
                }
                let end = if end <= begin { end + MINUTES_PER_DAY } else { end };
                shifts.push((number, Timed { begin, end }));
            }
        }
        mistakes.extend(overlaps(&settings.shifts, &shifts));
        match zone {
            Ok(zone) if mistakes.is_empty() => {
                let shifts = shifts.into_iter().map(|(_, timed)| timed).collect();
                Ok(Self { settings, zone, shifts })
            }
            _ => {
                mistakes.truncate(MAX_MISTAKES);
                Err(mistakes)
            }
        }
    }

    /// The settings.
    #[must_use]
    pub fn settings(&self) -> &HallSettings {
        &self.settings
    }

    /// The shift with this name that begins on this date of the hall's calendar.
    ///
    /// # Errors
    /// Why there is no such shift on that date.
    pub fn shift(&self, name: &str, date: &str) -> Result<Occurrence, NoShift> {
        let shifts = self.settings.shifts.iter().zip(&self.shifts).enumerate();
        let (number, (shift, timed)) =
            shifts.into_iter().find(|(_, (shift, _))| shift.name == name).ok_or(NoShift::Name)?;
        let date = day(date).ok_or(NoShift::Date)?;
        let weekday = weekday(date);
        if !shift.days.contains(&weekday) {
            return Err(NoShift::Day(weekday));
        }
        self.occurrence(number, shift, *timed, date).ok_or(NoShift::LeftOut)
    }

    /// The shifts that begin in a range of time, in their order, `most` of them at most.
    #[must_use]
    pub fn beginning(&self, from: Micros, to: Micros, most: usize) -> Vec<Occurrence> {
        let mut all = Vec::new();
        let (Some(first), Some(last)) = (self.date(from), self.date(to)) else { return all };
        let mut date = first;
        // A shift begins on its date. Dates of the range only grow, so this ends.
        while date <= last {
            let mut of_date: Vec<_> = self
                .settings
                .shifts
                .iter()
                .zip(&self.shifts)
                .enumerate()
                .filter(|(_, (shift, _))| shift.days.contains(&weekday(date)))
                .filter_map(|(number, (shift, timed))| self.occurrence(number, shift, *timed, date))
                .filter(|found| (from..to).contains(&found.begin))
                .collect();
            of_date.sort_by_key(|found| found.begin);
            all.extend(of_date);
            let Ok(next) = date.tomorrow() else { break };
            if all.len() >= most {
                all.truncate(most);
                break;
            }
            date = next;
        }
        all
    }

    fn occurrence(&self, number: usize, shift: &Shift, timed: Timed, date: Date) -> Option<Occurrence> {
        let begin = self.instant(date, timed.begin)?;
        let end = self.instant(date, timed.end)?;
        (begin < end).then(|| Occurrence {
            shift: number,
            name: shift.name.clone(),
            date: date.to_string(),
            begin,
            end,
        })
    }

    /// The date in the hall at an instant.
    fn date(&self, at: Micros) -> Option<Date> {
        Some(self.zone.to_datetime(Timestamp::from_microsecond(at.0).ok()?).date())
    }

    /// The instant at which the clock on the wall shows this many minutes after the begin of this date.
    fn instant(&self, date: Date, minutes: u16) -> Option<Micros> {
        let date = date.checked_add(Span::new().days(i64::from(minutes / MINUTES_PER_DAY))).ok()?;
        let minutes = minutes % MINUTES_PER_DAY;
        let (hour, minute) = (i8::try_from(minutes / 60).ok()?, i8::try_from(minutes % 60).ok()?);
        let wall = DateTime::from_parts(date, Time::new(hour, minute, 0, 0).ok()?);
        let at = match self.zone.to_ambiguous_timestamp(wall).offset() {
            AmbiguousOffset::Unambiguous { offset } => offset.to_timestamp(wall).ok()?,
            AmbiguousOffset::Fold { before, .. } => before.to_timestamp(wall).ok()?,
            AmbiguousOffset::Gap { before, .. } => {
                // With the offset from before, the left out time is at or behind the moment of the change.
                let behind =
                    before.to_timestamp(wall).ok()?.checked_add(SignedDuration::from_secs(1)).ok()?;
                self.zone.preceding(behind).next()?.timestamp()
            }
        };
        Some(Micros(at.as_microsecond()))
    }
}

/// The shifts that overlap with one before them, on the wall. Each minute of the week has one shift at most.
fn overlaps(shifts: &[Shift], timed: &[(usize, Timed)]) -> Vec<Mistake> {
    let week = usize::from(MINUTES_PER_DAY) * 7;
    let mut owners: Vec<Option<usize>> = vec![None; week];
    let mut mistakes = Vec::new();
    for (number, Timed { begin, end }) in timed {
        let Some(shift) = shifts.get(*number) else { continue };
        let mut met = None;
        for day in &shift.days {
            let midnight = usize::from(MINUTES_PER_DAY) * (*day as usize);
            for minute in usize::from(*begin)..usize::from(*end) {
                let Some(owner) = owners.get_mut((midnight + minute) % week) else { continue };
                match owner {
                    // A day that is there twice is told as such.
                    Some(other) if other != number => met = met.or(Some((*other, *day))),
                    _ => *owner = Some(*number),
                }
            }
        }
        if let Some((other, day)) = met {
            let name = shifts.get(other).map_or("", |other| other.name.as_str());
            let what = format!("on {} it overlaps with `{}`", day.word(), shown(name));
            mistakes.push(Mistake { shift: Some(*number), field: "begin", what });
        }
    }
    mistakes
}

/// Names of the database that are no place: they have no rules, and browsers do not know them.
const NO_PLACES: [&str; 2] = ["Etc/Unknown", "Factory"];

/// Whether this is a name of the database that is no place. An earlier version took them.
#[must_use]
pub fn is_no_place(zone: &str) -> bool {
    NO_PLACES.iter().any(|name| name.eq_ignore_ascii_case(zone))
}

fn zone(name: &str) -> Result<TimeZone, String> {
    if is_no_place(name) {
        return Err(format!("`{name}` is no place, and has no rules; without shifts, `UTC` may do"));
    }
    let zones = TimeZoneDatabase::bundled();
    if name.len() <= MAX_ZONE
        && let Ok(zone) = zones.get(name)
    {
        // Other ways to write it are taken, and one way is kept.
        return match zone.iana_name() {
            Some(known) if known != name => Err(format!("the time zone is written `{known}`")),
            Some(_) | None => Ok(zone),
        };
    }
    let shown = shown(name);
    let known: Vec<_> = zones.available().map(|zone| zone.to_string()).collect();
    let advice = r6_proto::nearest(name, known.iter().map(String::as_str))
        .map_or("such as Europe/Berlin or Asia/Shanghai".to_owned(), |nearest| {
            format!("nearest: `{nearest}`")
        });
    Err(format!("`{shown}` is no time zone of the IANA database; {advice}"))
}

/// A time such as `06:00` or `24:00`, in minutes.
fn minutes(text: &str) -> Option<u16> {
    let &[h1, h2, b':', m1, m2] = text.as_bytes() else { return None };
    let digit = |byte: u8| char::from(byte).to_digit(10).and_then(|digit| u16::try_from(digit).ok());
    let (hours, minutes) = (digit(h1)? * 10 + digit(h2)?, digit(m1)? * 10 + digit(m2)?);
    let all = hours * 60 + minutes;
    (minutes < 60 && all <= MINUTES_PER_DAY).then_some(all)
}

/// A date such as `2026-11-25`.
fn day(text: &str) -> Option<Date> {
    let is_date = text.len() == 10
        && text.bytes().enumerate().all(|(at, byte)| match at {
            4 | 7 => byte == b'-',
            _ => byte.is_ascii_digit(),
        });
    is_date.then(|| text.parse().ok()).flatten()
}

fn weekday(date: Date) -> Weekday {
    use jiff::civil::Weekday as Of;
    match date.weekday() {
        Of::Monday => Weekday::Mon,
        Of::Tuesday => Weekday::Tue,
        Of::Wednesday => Weekday::Wed,
        Of::Thursday => Weekday::Thu,
        Of::Friday => Weekday::Fri,
        Of::Saturday => Weekday::Sat,
        Of::Sunday => Weekday::Sun,
    }
}

/// What a caller wrote, for the answer.
fn shown(text: &str) -> String {
    text.chars().take(48).collect()
}

#[cfg(test)]
mod tests;
