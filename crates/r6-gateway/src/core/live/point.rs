//! The place in a stream, as a text that a client sends back.

use std::fmt;

/// How far a reader has read: `EPOCH-NUMBER`, or `EPOCH-NUMBER-EVENT` if it follows events too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Point {
    /// The start of the gateway that the numbers count from.
    pub epoch: u64,
    /// Everything up to this change was sent.
    pub number: u64,
    /// The last event that was sent.
    pub event: Option<u64>,
}

impl Point {
    /// How such a text looks.
    pub const WANTED: &str =
        "EPOCH-NUMBER or EPOCH-NUMBER-EVENT, as a message or an id of the stream gave it";

    /// Reads it, if it is exactly such a text.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let mut parts = text.splitn(3, '-').map(|part| part.parse::<u64>().ok());
        let (epoch, number) = (parts.next()??, parts.next()??);
        let event = match parts.next() {
            Some(event) => Some(event?),
            None => None,
        };
        let point = Self { epoch, number, event };
        (point.to_string() == text).then_some(point)
    }
}

impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.epoch, self.number)?;
        self.event.map_or(Ok(()), |event| write!(f, "-{event}"))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_point_is_read_as_it_was_written(epoch: u64, number: u64, event: Option<u64>) {
            let point = Point { epoch, number, event };
            prop_assert_eq!(Point::parse(&point.to_string()), Some(point));
        }
    }

    #[test]
    fn other_texts_are_no_points() {
        for text in [
            "",
            "-",
            "1",
            "1-",
            "-1",
            "1-2-",
            "1-2-3-4",
            "+1-2",
            "01-2",
            "1- 2",
            "a-1",
            "1-18446744073709551616",
        ] {
            assert_eq!(Point::parse(text), None, "{text}");
        }
    }
}
