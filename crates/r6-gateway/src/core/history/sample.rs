//! A value of a signal at a time, or why it has no value.

use std::ops::Deref;
use std::sync::Arc;
use std::time::Duration;

use r6_api::AddressValue;
use r6_api::gateway::Gap;
use r6_proto::Reading;
use r6_proto::address::ValueType;
use serde::{Deserialize, Serialize};

/// The longest text that is kept: names of programs are shorter, and 512 of these still fit into a chunk.
pub const MAX_TEXT: usize = 1024;

/// What a text takes besides its bytes: its length, its room and its counts.
const TEXT: usize = size_of::<String>() + 2 * size_of::<usize>();

/// A signal without a sample for 2.5 of its intervals has no value any more. In halves of an interval.
const HELD_HALVES: i64 = 5;

/// A time of day: microseconds since 1970, UTC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Micros(pub i64);

impl Micros {
    /// The time so long after this one.
    #[must_use]
    pub fn after(self, time: Duration) -> Self {
        Self(self.0.saturating_add(i64::try_from(time.as_micros()).unwrap_or(i64::MAX)))
    }

    /// The time so long before this one.
    #[must_use]
    pub fn before(self, time: Duration) -> Self {
        Self(self.0.saturating_sub(i64::try_from(time.as_micros()).unwrap_or(i64::MAX)))
    }

    /// The time as the history keeps it: to a tenth of a millisecond, never later. Timers are no finer, and
    /// each digit more would cost 3 bits a sample.
    #[must_use]
    pub fn kept(self) -> Self {
        Self(self.0.div_euclid(100).saturating_mul(100))
    }

    /// The number of its day: days since 1970, UTC.
    #[must_use]
    pub fn day(self) -> i64 {
        self.0.div_euclid(86_400_000_000)
    }
}

/// A text of a sample. It is one pointer, so that a sample takes 24 bytes: a query reads a million of them.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Text(Arc<String>);

impl Deref for Text {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

impl From<String> for Text {
    fn from(text: String) -> Self {
        Self(Arc::new(text))
    }
}

impl From<&str> for Text {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}

/// What is known of a signal from a time on.
#[derive(Clone, Debug)]
pub enum State {
    /// A decimal number.
    Decimal(f64),
    /// A whole number, 32 points, or a flag.
    Integer(i64),
    /// A text; a list or a counter as JSON.
    Text(Text),
    /// There is no value.
    Gap(Gap),
}

/// Numbers are the same if their bits are, so that a series can be compared with what was kept of it.
impl PartialEq for State {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Decimal(one), Self::Decimal(other)) => one.to_bits() == other.to_bits(),
            (Self::Integer(one), Self::Integer(other)) => one == other,
            (Self::Text(one), Self::Text(other)) => one == other,
            (Self::Gap(one), Self::Gap(other)) => one == other,
            (Self::Decimal(_) | Self::Integer(_) | Self::Text(_) | Self::Gap(_), _) => false,
        }
    }
}

impl State {
    /// What a reading says. A text that is too long to keep is a gap.
    #[must_use]
    pub fn of(reading: &Reading) -> Self {
        let text = |text: String| match text.len() {
            0..=MAX_TEXT => Self::Text(text.into()),
            _ => Self::Gap(Gap::None),
        };
        match reading {
            // A controller prints -0.000000 for an axis that stands at 0. Both zeros are kept as one.
            Reading::Decimal(number) => Self::Decimal(*number + 0.0),
            Reading::Integer(number) => Self::Integer(*number),
            Reading::Word(word) => Self::Integer(i64::from(*word)),
            Reading::Flag(flag) => Self::Integer(i64::from(*flag)),
            Reading::Text(of) => text(of.clone()),
            Reading::Texts(_) | Reading::Counter(_) => {
                serde_json::to_string(&AddressValue::from(reading.clone())).map_or(Self::Gap(Gap::None), text)
            }
        }
    }

    /// The value for a reader; `None` for a gap, or if it does not fit to the type of its address.
    #[must_use]
    pub fn value(&self, of: ValueType) -> Option<AddressValue> {
        match (self, of) {
            (Self::Decimal(number), _) => Some(AddressValue::Decimal(*number)),
            (Self::Integer(number), ValueType::Flag) => Some(AddressValue::Flag(*number != 0)),
            (Self::Integer(number), ValueType::Word) => u32::try_from(*number).ok().map(AddressValue::Word),
            (Self::Integer(number), _) => Some(AddressValue::Integer(*number)),
            (Self::Text(text), ValueType::TextList | ValueType::Counter) => serde_json::from_str(text).ok(),
            (Self::Text(text), _) => Some(AddressValue::Text(text.to_string())),
            (Self::Gap(_), _) => None,
        }
    }

    /// The value as a number, for averages.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "an average of whole numbers above 2^53 is no use")]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Decimal(number) => Some(*number),
            Self::Integer(number) => Some(*number as f64),
            Self::Text(_) | Self::Gap(_) => None,
        }
    }

    /// The gap, if there is no value.
    #[must_use]
    pub fn gap(&self) -> Option<Gap> {
        if let Self::Gap(gap) = self { Some(*gap) } else { None }
    }
}

/// The number of a gap in a chunk. The numbers never change; 0 is a value.
pub(super) fn gap_code(gap: Gap) -> u8 {
    match gap {
        Gap::Stale => 1,
        Gap::None => 2,
        Gap::Lost => 3,
        Gap::Ended => 4,
        Gap::ClockStepped => 5,
        Gap::NoData => 6,
    }
}

/// The gap with this number.
pub(super) fn gap_of_code(code: u8) -> Option<Gap> {
    Gap::ALL.into_iter().find(|gap| gap_code(*gap) == code)
}

/// What is known of a signal from a time on.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// When the value was asked for: it is no older.
    pub time: Micros,
    /// What is known.
    pub state: State,
}

impl Sample {
    /// How much memory it takes, in bytes.
    #[must_use]
    pub fn size(&self) -> usize {
        let text = if let State::Text(text) = &self.state { text.len() + TEXT } else { 0 };
        size_of::<Self>() + text
    }
}

/// The longest time between two samples of a signal. If none comes for 2.5 of these, there is no value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interval(u32);

impl Interval {
    /// The usual one: a value that does not change is kept once a minute.
    pub const USUAL: Self = Self(60_000);

    /// The longest one: an hour, the longest period of a robot.
    pub const LONGEST: Self = Self(3_600_000);

    /// Of a signal that is read with this period.
    #[must_use]
    pub fn of_period(period: Duration) -> Self {
        let millis = u32::try_from(period.as_millis()).unwrap_or(u32::MAX);
        Self(millis.clamp(Self::USUAL.0, Self::LONGEST.0))
    }

    /// With these milliseconds, 1 to an hour.
    #[must_use]
    pub fn of_millis(millis: u32) -> Option<Self> {
        (1..=Self::LONGEST.0).contains(&millis).then_some(Self(millis))
    }

    /// Its milliseconds.
    #[must_use]
    pub fn millis(self) -> u32 {
        self.0
    }

    /// Until when a sample of this time counts.
    #[must_use]
    pub fn held_until(self, time: Micros) -> Micros {
        Micros(time.0.saturating_add(i64::from(self.0) * 1000 * HELD_HALVES / 2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use r6_proto::message::reading::Counter;

    #[test]
    fn readings_come_back_as_they_were() {
        let counter = Counter { id: 4, target: 20, current: 7, name: Some("parts".to_owned()) };
        let all = [
            (Reading::Decimal(1.5), ValueType::Decimal),
            (Reading::Integer(-3), ValueType::Integer),
            (Reading::Word(u32::MAX), ValueType::Word),
            (Reading::Flag(true), ValueType::Flag),
            (Reading::Text("[1]".to_owned()), ValueType::Text),
            (Reading::Texts(vec!["a".to_owned(), "b, c".to_owned()]), ValueType::TextList),
            (Reading::Counter(counter), ValueType::Counter),
        ];
        for (reading, of) in all {
            let kept = State::of(&reading).value(of);
            assert_eq!(kept, Some(AddressValue::from(reading.clone())), "{reading:?}");
        }
        assert_eq!(State::of(&Reading::Decimal(-0.0)), State::Decimal(0.0));
        let long = Reading::Text("x".repeat(MAX_TEXT + 1));
        assert_eq!(State::of(&long), State::Gap(Gap::None));
    }

    /// A query reads a million samples.
    #[test]
    fn a_sample_takes_24_bytes() {
        assert_eq!(size_of::<Sample>(), 24);
    }

    #[test]
    fn a_value_counts_for_two_and_a_half_intervals() {
        assert_eq!(Interval::USUAL.held_until(Micros(1)), Micros(150_000_001));
        assert_eq!(Interval::of_period(Duration::from_millis(100)), Interval::USUAL);
        assert_eq!(Interval::of_period(Duration::from_secs(120)).millis(), 120_000);
        assert_eq!(Micros(-1).day(), -1);
        assert_eq!(Micros(86_400_000_000).day(), 1);
    }
}
