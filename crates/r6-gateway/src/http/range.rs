//! Ranges of time in queries.

use std::time::{Duration, UNIX_EPOCH};

use r6_http::Refusal;

use super::refusal::bad_value;
use crate::core::history::sample::Micros;

/// A range of time, in µs UTC. Its end does not belong to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    /// The begin.
    pub from: Micros,
    /// The end, which is not behind the present time.
    pub to: Micros,
}

/// How long a range is.
#[derive(Clone, Copy, Debug)]
pub struct Lengths {
    /// If no begin is given.
    pub usual: Duration,
    /// At most.
    pub longest: Duration,
    /// The longest in words, such as `ten years`.
    pub longest_words: &'static str,
}

impl Lengths {
    /// The range of a query. There is nothing behind now, so a range ends now at the latest. Without `from`,
    /// the range moves on with the time: `place`, where a page goes on, may be left of it by now, and then
    /// the range begins there.
    ///
    /// # Errors
    /// `bad_value`: `from` or `to` is not a time, or the range is empty or too long.
    pub fn range(
        &self,
        (from, to): (Option<&str>, Option<&str>),
        place: Option<Micros>,
        now: Micros,
    ) -> Result<Range, Refusal> {
        let wanted = time("to", to)?.unwrap_or(now);
        let end = wanted.min(now);
        let from = time("from", from)?.unwrap_or_else(|| {
            let usual = end.before(self.usual);
            let place = place.filter(|place| end.before(self.longest) < *place);
            place.map_or(usual, |place| place.min(usual))
        });
        let to = end.max(from);
        if from > wanted || to.before(self.longest) > from {
            return Err(bad_value(format!(
                "from is a time before to, and at most {} before",
                self.longest_words
            )));
        }
        Ok(Range { from, to })
    }
}

impl Range {
    /// Refuses a cursor whose place is not in the range, or that has none.
    ///
    /// # Errors
    /// `bad_value`.
    pub fn check_cursor(&self, cursor: Option<&str>, place: Option<Micros>) -> Result<(), Refusal> {
        match cursor {
            Some(cursor) if !place.is_some_and(|place| (self.from..=self.to).contains(&place)) => {
                Err(bad_value(format!("`{}` is no cursor of this range", shown(cursor))))
            }
            Some(_) | None => Ok(()),
        }
    }
}

/// Refuses a limit that is not from 1 to this.
///
/// # Errors
/// `bad_value`.
pub fn check_limit(limit: usize, most: usize) -> Result<(), Refusal> {
    if (1..=most).contains(&limit) { Ok(()) } else { Err(bad_value(format!("limit is from 1 to {most}"))) }
}

/// What a caller wrote, for the answer.
pub fn shown(text: &str) -> String {
    text.chars().take(48).collect()
}

/// A time of a query.
fn time(name: &str, text: Option<&str>) -> Result<Option<Micros>, Refusal> {
    let read = |text| {
        let shown = shown(text);
        let wrong = || bad_value(format!("{name}: `{shown}` is not a time such as 2026-11-25T06:00:00Z"));
        instant(text).ok_or_else(wrong)
    };
    text.map(read).transpose()
}

/// The time of this text: RFC 3339 in UTC.
pub fn instant(text: &str) -> Option<Micros> {
    let time = humantime::parse_rfc3339(text).ok()?.duration_since(UNIX_EPOCH).ok()?;
    i64::try_from(time.as_micros()).ok().map(Micros)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENGTHS: Lengths = Lengths {
        usual: Duration::from_secs(3600),
        longest: Duration::from_secs(86_400),
        longest_words: "a day",
    };
    /// 1970-01-03.
    const NOW: i64 = 2 * 86_400_000_000;
    const HOUR: i64 = 3_600_000_000;

    fn range(from: Option<&str>, to: Option<&str>, place: Option<i64>) -> Option<(i64, i64)> {
        let range = LENGTHS.range((from, to), place.map(Micros), Micros(NOW)).ok()?;
        Some((range.from.0, range.to.0))
    }

    #[test]
    fn a_range_ends_now_at_the_latest_and_has_a_usual_and_a_longest_length() {
        let (day, later) = (Some("1970-01-02T00:00:00Z"), Some("1970-01-04T00:00:00Z"));
        assert_eq!(range(None, None, None), Some((NOW - HOUR, NOW)));
        assert_eq!(range(None, later, None), Some((NOW - HOUR, NOW)));
        assert_eq!(range(day, None, None), Some((NOW / 2, NOW)));
        assert_eq!(range(day, later, None), Some((NOW / 2, NOW)));
        assert_eq!(range(Some("1970-01-01T23:59:59.999999Z"), None, None), None, "it is too long");
        assert_eq!(range(later, None, None), None, "it begins behind its end");
        assert_eq!(
            range(later, Some("1970-01-05T00:00:00Z"), None),
            Some((2 * NOW - NOW / 2, 2 * NOW - NOW / 2))
        );
        assert_eq!(range(Some("today"), None, None), None);
    }

    #[test]
    fn a_page_without_a_begin_goes_on_where_the_last_one_ended() {
        assert_eq!(range(None, None, Some(NOW - 2 * HOUR)), Some((NOW - 2 * HOUR, NOW)));
        assert_eq!(range(None, None, Some(NOW - HOUR / 2)), Some((NOW - HOUR, NOW)));
        assert_eq!(range(None, None, Some(NOW - 25 * HOUR)), Some((NOW - HOUR, NOW)), "too far back");
        assert_eq!(range(Some("1970-01-02T23:00:00Z"), None, Some(5)), Some((NOW - HOUR, NOW)));
        let range = LENGTHS.range((None, None), None, Micros(NOW)).unwrap();
        assert!(range.check_cursor(None, None).is_ok());
        assert!(range.check_cursor(Some("t"), Some(Micros(NOW))).is_ok());
        assert!(range.check_cursor(Some("t"), Some(Micros(NOW + 1))).is_err());
        assert!(range.check_cursor(Some("t"), None).is_err());
    }
}
