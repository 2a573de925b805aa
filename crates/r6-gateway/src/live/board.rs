//! The last values of one robot, and which of them changed since.

use r6_api::gateway::{Signal, SignalQuality};
use r6_api::{AddressValue, Unit};
use r6_client::{Address, Quality, Snapshot};
use r6_proto::time::Instant;

use crate::clock;

/// The values of one robot.
#[derive(Debug)]
pub struct Board {
    /// No other board of the gateway has this one.
    board: u64,
    number: u64,
    rows: Vec<Row>,
}

/// How far a reader has read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The board: a robot that is configured anew gets another one.
    pub board: u64,
    /// The number of the last change.
    pub number: u64,
}

#[derive(Debug)]
struct Row {
    address: Address,
    value: Option<AddressValue>,
    quality: SignalQuality,
    /// Whether the controller does not have it.
    is_unsupported: bool,
    asked_at: Option<Instant>,
    /// The number of its last change.
    changed: u64,
}

impl Board {
    /// No value yet of these addresses.
    #[must_use]
    pub fn new(board: u64, addresses: &[Address]) -> Self {
        let row = |address: &Address| Row {
            address: *address,
            value: None,
            quality: SignalQuality::None,
            is_unsupported: false,
            asked_at: None,
            changed: 0,
        };
        Self { board, number: 0, rows: addresses.iter().map(row).collect() }
    }

    /// The place of the last change.
    #[must_use]
    pub fn place(&self) -> Place {
        Place { board: self.board, number: self.number }
    }

    /// Takes in what was read. Returns whether a value or its quality changed.
    pub fn take(&mut self, now: Instant, snapshot: &Snapshot) -> bool {
        let next = self.number + 1;
        let mut any = false;
        for row in &mut self.rows {
            let Some(read) = snapshot.value(row.address) else { continue };
            let value = read.reading.clone().map(AddressValue::from);
            row.is_unsupported = read.quality == Quality::Unsupported;
            let quality = quality(&read.quality);
            row.asked_at = read.age.map(|age| clock::before(now, age));
            if row.value != value || row.quality != quality {
                (row.value, row.quality, row.changed) = (value, quality, next);
                any = true;
            }
        }
        if any {
            self.number = next;
        }
        any
    }

    /// The values that changed after this number; with 0, all that were read.
    pub fn since(&self, now: Instant, number: u64) -> Vec<Signal> {
        self.rows.iter().filter(|row| row.changed > number).map(|row| row.signal(now)).collect()
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
