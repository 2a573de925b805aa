//! The last values of one robot, and which of them changed since.

use r6_api::gateway::{Signal, SignalQuality};
use r6_api::{AddressValue, Unit};
use r6_client::{Address, Quality, Snapshot};
use r6_proto::time::Instant;

use crate::clock;
use crate::core::live::numbers::{Numbers, Span};

/// The values of one robot.
#[derive(Debug)]
pub struct Board {
    numbers: Numbers,
    rows: Vec<Row>,
}

#[derive(Debug)]
struct Row {
    address: Address,
    value: Option<AddressValue>,
    quality: SignalQuality,
    /// Whether the controller does not have it.
    is_unsupported: bool,
    asked_at: Option<Instant>,
}

impl Board {
    /// No value yet of these addresses. `born`: larger than all numbers before.
    #[must_use]
    pub fn new(born: u64, addresses: &[Address]) -> Self {
        let row = |address: &Address| Row {
            address: *address,
            value: None,
            quality: SignalQuality::None,
            is_unsupported: false,
            asked_at: None,
        };
        let numbers = Numbers::new(born, addresses.len());
        Self { numbers, rows: addresses.iter().map(row).collect() }
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
    pub fn take(&mut self, now: Instant, snapshot: &Snapshot, next: impl FnOnce() -> u64) -> bool {
        let mut changed = Vec::new();
        for (place, row) in self.rows.iter_mut().enumerate() {
            let Some(read) = snapshot.value(row.address) else { continue };
            let value = read.reading.clone().map(AddressValue::from);
            row.is_unsupported = read.quality == Quality::Unsupported;
            let quality = quality(&read.quality);
            row.asked_at = read.age.map(|age| clock::before(now, age));
            if row.value != value || row.quality != quality {
                (row.value, row.quality) = (value, quality);
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
    fn signal(&self, now: Instant) -> Signal {
        let has_value = self.value.is_some();
        let age = self.asked_at.filter(|_| has_value).map(|asked_at| now.since(asked_at));
        Signal {
            address: self.address.to_string(),
            value: self.value.clone(),
            unit: Unit::word_of(self.address).map(str::to_owned),
            quality: self.quality,
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
