//! The last values of one robot, and which of them changed since.

use std::time::Duration;

use r6_api::gateway::{Signal, SignalQuality};
use r6_api::{AddressValue, Unit};
use r6_client::{Address, Quality, Snapshot, Value};
use r6_proto::time::Instant;

use crate::clock;
use crate::core::live::numbers::{Numbers, Span};

/// Who sends the values that are taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// This robot, or one of which it was never known who it is.
    This,
    /// It has not said yet over this connection that it is this robot, or it is another one: none of its
    /// values is told as fresh.
    Doubtful,
}

/// The values of one robot.
#[derive(Debug)]
pub struct Board {
    numbers: Numbers,
    rows: Vec<Row>,
}

#[derive(Debug)]
struct Row {
    address: Address,
    /// Its greatest age while it is fresh.
    fresh_for: Duration,
    value: Option<AddressValue>,
    quality: SignalQuality,
    /// Whether the controller does not have it.
    is_unsupported: bool,
    asked_at: Option<Instant>,
}

impl Board {
    /// No value yet of these addresses. With each comes the age from which on its value is not told as fresh,
    /// also if nothing was taken in since. `born`: larger than all numbers before.
    #[must_use]
    pub fn new(born: u64, addresses: impl Iterator<Item = (Address, Duration)>) -> Self {
        let row = |(address, fresh_for)| Row {
            address,
            fresh_for,
            value: None,
            quality: SignalQuality::None,
            is_unsupported: false,
            asked_at: None,
        };
        let rows: Vec<_> = addresses.map(row).collect();
        Self { numbers: Numbers::new(born, rows.len()), rows }
    }

    /// The numbers between which a reader can go on.
    #[must_use]
    pub fn span(&self) -> Span {
        self.numbers.span()
    }

    /// Makes every reader begin anew with these values.
    pub fn bear(&mut self, born: u64) {
        self.numbers.bear(born);
    }

    /// Takes in what was read. Returns whether a value or its quality changed; only then `next` draws the
    /// number of the change, which is larger than all numbers before.
    pub fn take(
        &mut self,
        now: Instant,
        snapshot: &Snapshot,
        source: Source,
        next: impl FnOnce() -> u64,
    ) -> bool {
        let mut changed = Vec::with_capacity(self.rows.len());
        // Both have the same order in general: then each value is found behind the one before.
        let mut begin = 0;
        for read in snapshot.values() {
            let is_it = |row: &Row| row.address == read.address;
            let behind = self.rows.iter().skip(begin).position(is_it).map(|ahead| begin + ahead);
            let Some(place) = behind.or_else(|| self.rows.iter().position(is_it)) else { continue };
            begin = place + 1;
            if self.rows.get_mut(place).is_some_and(|row| row.take(now, read, source)) {
                changed.push(place);
            }
        }
        if changed.is_empty() {
            return false;
        }
        self.numbers.change(&changed, next());
        true
    }

    /// The values that changed after this number.
    pub fn since(&self, now: Instant, number: u64) -> Vec<Signal> {
        let rows = self.numbers.since(number).filter_map(|place| self.rows.get(place));
        rows.map(|row| row.signal(now)).collect()
    }

    /// The value of an address, if it is read, and when it was asked for.
    pub fn signal(&self, now: Instant, address: Address) -> Option<(Signal, Option<Instant>)> {
        let row = self.rows.iter().find(|row| row.address == address)?;
        Some((row.signal(now), row.asked_at))
    }

    /// Whether the controller said that it does not have this address.
    pub fn is_unsupported(&self, address: Address) -> bool {
        self.rows.iter().any(|row| row.address == address && row.is_unsupported)
    }

    /// All values.
    pub fn all(&self, now: Instant) -> Vec<Signal> {
        self.rows.iter().map(|row| row.signal(now)).collect()
    }
}

impl Row {
    /// Takes in what was read. Returns whether it differs from what a reader may have been told.
    fn take(&mut self, now: Instant, read: &Value, source: Source) -> bool {
        let value = read.reading.clone().map(AddressValue::from);
        self.is_unsupported = read.quality == Quality::Unsupported;
        let quality = match quality(&read.quality) {
            SignalQuality::Fresh if source == Source::Doubtful => SignalQuality::Stale,
            quality => quality,
        };
        // A reader may have been told that it grew old. Then it is a change that it is fresh again.
        let told = self.quality_at(self.age(now));
        self.asked_at = read.age.map(|age| clock::before(now, age));
        let is_changed = self.value != value || self.quality != quality || told != quality;
        (self.value, self.quality) = (value, quality);
        is_changed
    }

    /// How old its value is, if it has one.
    fn age(&self, now: Instant) -> Option<Duration> {
        self.asked_at.filter(|_| self.value.is_some()).map(|asked_at| now.since(asked_at))
    }

    /// Its quality, as a reader is told while it has this age.
    fn quality_at(&self, age: Option<Duration>) -> SignalQuality {
        match self.quality {
            SignalQuality::Fresh if age.is_none_or(|age| age > self.fresh_for) => SignalQuality::Stale,
            quality => quality,
        }
    }

    fn signal(&self, now: Instant) -> Signal {
        let age = self.age(now);
        Signal {
            address: self.address.to_string(),
            value: self.value.clone(),
            unit: Unit::word_of(self.address).map(str::to_owned),
            quality: self.quality_at(age),
            age_ms: age.map(|age| u64::try_from(age.as_millis()).unwrap_or(u64::MAX)),
        }
    }
}

fn quality(quality: &Quality) -> SignalQuality {
    match quality {
        Quality::Fresh => SignalQuality::Fresh,
        Quality::Stale | Quality::Dead => SignalQuality::Stale,
        Quality::NotRead | Quality::Unsupported | Quality::Unreadable(_) => SignalQuality::None,
    }
}

#[cfg(test)]
mod tests {
    use r6_proto::Reading;

    use super::*;

    const FRESH_FOR: Duration = Duration::from_millis(1100);

    fn at(millis: u64) -> Instant {
        Instant::ORIGIN + Duration::from_millis(millis)
    }

    /// A value that was asked for at the origin.
    fn row() -> Row {
        Row {
            address: Address::CurMode,
            fresh_for: FRESH_FOR,
            value: Some(AddressValue::from(Reading::Integer(2))),
            quality: SignalQuality::Fresh,
            is_unsupported: false,
            asked_at: Some(Instant::ORIGIN),
        }
    }

    #[test]
    fn a_value_that_grew_old_since_it_was_taken_in_is_not_told_as_fresh() {
        let row = row();
        let told = |millis| row.signal(at(millis)).quality;
        assert_eq!((told(1100), told(1101)), (SignalQuality::Fresh, SignalQuality::Stale));
    }

    #[test]
    fn the_same_value_is_a_change_when_it_was_told_as_stale_before() {
        let read = |quality| Value {
            address: Address::CurMode,
            reading: Some(Reading::Integer(2)),
            age: Some(Duration::from_millis(10)),
            quality,
        };
        let mut row = row();
        assert!(!row.take(at(1100), &read(Quality::Fresh), Source::This), "it was never told as stale");
        assert!(row.take(at(2191), &read(Quality::Fresh), Source::This), "it was told as stale at 2191 ms");
        assert!(!row.take(at(2200), &read(Quality::Fresh), Source::This));
        assert!(row.take(at(9000), &read(Quality::Stale), Source::This), "it was told as fresh before");
        assert!(!row.take(at(9100), &read(Quality::Fresh), Source::Doubtful), "it may be another robot's");
        assert!(row.take(at(9200), &read(Quality::Fresh), Source::This));
    }
}
