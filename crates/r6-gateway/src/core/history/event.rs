//! What was seen to happen at a robot, and how it is kept.

use r6_api::gateway::UnseenBecause;
use serde::{Deserialize, Serialize};

use super::bytes::CRC;
use super::sample::Micros;

/// Something that was seen at a time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// When the value that shows it was asked for; later, if an event that was noticed before stands there.
    pub time: Micros,
    /// When the value was asked for, if that is not [`Self::time`].
    pub true_time: Option<Micros>,
    /// What.
    pub observed: Observed,
}

/// What is kept of an event besides its time. The names stand in files: they never change.
#[derive(Serialize, Deserialize)]
struct Text<O> {
    #[serde(flatten)]
    observed: O,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    true_time: Option<Micros>,
}

/// What was seen. The names of the kinds and fields stand in files: they never change.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Observed {
    /// `curAlarm` became this code.
    AlarmBegan {
        /// The code.
        code: u32,
    },
    /// `curAlarm` is not this code any more.
    AlarmEnded {
        /// The code.
        code: u32,
        /// For how long it was read; `None` if its begin was not seen.
        lasted_ms: Option<u64>,
    },
    /// `curMode` changed.
    ModeChanged {
        /// The mode before.
        from: i64,
        /// The mode from now on.
        to: i64,
    },
    /// `curMold` changed.
    ProgramChanged {
        /// The program before.
        from: String,
        /// The program from now on.
        to: String,
    },
    /// A cycle ended since the last reading.
    CycleDone {
        /// How many are proved to have ended.
        count: u64,
        /// Whether more may have ended.
        at_least: bool,
        /// How long it took; `None` if more may have ended.
        ms: Option<u64>,
        /// The last moment when it can have ended.
        at: Micros,
    },
    /// The counter of parts grew.
    Parts {
        /// The number of the counter: 4 for `counter-4`.
        counter: u32,
        /// By how much.
        added: u64,
        /// What it counts now.
        total: i64,
    },
    /// The counter of parts went back.
    PartsReset {
        /// The number of the counter.
        counter: u32,
        /// What it counted before.
        from: i64,
        /// What it counts now.
        to: i64,
    },
    /// Nothing came back when it was due, or the connection ended.
    LinkLost {},
    /// The robot answers again.
    LinkBack {},
    /// The robot was not seen for a time: what changed meanwhile has no event.
    Unseen {
        /// The last reading before; `None` if that is not known.
        from: Option<Micros>,
        /// The first reading after.
        to: Micros,
        /// Why.
        because: UnseenBecause,
    },
}

/// The kinds of events.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// [`Observed::AlarmBegan`].
    AlarmBegan,
    /// [`Observed::AlarmEnded`].
    AlarmEnded,
    /// [`Observed::ModeChanged`].
    ModeChanged,
    /// [`Observed::ProgramChanged`].
    ProgramChanged,
    /// [`Observed::CycleDone`].
    CycleDone,
    /// [`Observed::Parts`].
    Parts,
    /// [`Observed::PartsReset`].
    PartsReset,
    /// [`Observed::LinkLost`].
    LinkLost,
    /// [`Observed::LinkBack`].
    LinkBack,
    /// [`Observed::Unseen`].
    Unseen,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::AlarmBegan,
        Self::AlarmEnded,
        Self::ModeChanged,
        Self::ProgramChanged,
        Self::CycleDone,
        Self::Parts,
        Self::PartsReset,
        Self::LinkLost,
        Self::LinkBack,
        Self::Unseen,
    ];

    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::AlarmBegan => "alarm_began",
            Self::AlarmEnded => "alarm_ended",
            Self::ModeChanged => "mode_changed",
            Self::ProgramChanged => "program_changed",
            Self::CycleDone => "cycle_done",
            Self::Parts => "parts",
            Self::PartsReset => "parts_reset",
            Self::LinkLost => "link_lost",
            Self::LinkBack => "link_back",
            Self::Unseen => "unseen",
        }
    }

    /// The kind with this word.
    #[must_use]
    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.word() == word)
    }
}

impl Event {
    /// Something that was seen at this time.
    #[must_use]
    pub fn new(time: Micros, observed: Observed) -> Self {
        Self { time, true_time: None, observed }
    }

    /// The same event, which stands at this time and keeps its own.
    #[must_use]
    pub fn standing_at(self, time: Micros) -> Self {
        let own = self.true_time.unwrap_or(self.time);
        Self { time, true_time: (own != time).then_some(own), observed: self.observed }
    }

    /// Its kind.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self.observed {
            Observed::AlarmBegan { .. } => Kind::AlarmBegan,
            Observed::AlarmEnded { .. } => Kind::AlarmEnded,
            Observed::ModeChanged { .. } => Kind::ModeChanged,
            Observed::ProgramChanged { .. } => Kind::ProgramChanged,
            Observed::CycleDone { .. } => Kind::CycleDone,
            Observed::Parts { .. } => Kind::Parts,
            Observed::PartsReset { .. } => Kind::PartsReset,
            Observed::LinkLost {} => Kind::LinkLost,
            Observed::LinkBack {} => Kind::LinkBack,
            Observed::Unseen { .. } => Kind::Unseen,
        }
    }

    /// How much memory it takes, in bytes.
    #[must_use]
    pub fn size(&self) -> usize {
        let text = if let Observed::ProgramChanged { from, to } = &self.observed {
            from.len() + to.len()
        } else {
            0
        };
        size_of::<Self>() + text
    }

    /// What is kept of it besides its time: JSON, and a checksum over time and JSON.
    #[must_use]
    pub fn encode(&self) -> (String, u32) {
        // Our own types always become JSON.
        let text = Text { observed: &self.observed, true_time: self.true_time };
        let text = serde_json::to_string(&text).unwrap_or_default();
        let crc = checksum(self.time, &text);
        (text, crc)
    }

    /// Reads what [`Self::encode`] made; `None` if it was changed, or is of a kind that this version does not
    /// know.
    #[must_use]
    pub fn decode(time: Micros, text: &str, crc: u32) -> Option<Self> {
        let read = || serde_json::from_str::<Text<Observed>>(text).ok();
        let Text { observed, true_time } = (checksum(time, text) == crc).then(read).flatten()?;
        Some(Self { time, true_time, observed })
    }
}

fn checksum(time: Micros, text: &str) -> u32 {
    let mut bytes = time.0.to_le_bytes().to_vec();
    bytes.extend_from_slice(text.as_bytes());
    CRC.checksum(&bytes)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn one_of_each() -> Vec<Event> {
        let time = Micros(1_764_000_000_000_100);
        let all = [
            Observed::AlarmBegan { code: 42 },
            Observed::AlarmEnded { code: 42, lasted_ms: None },
            Observed::ModeChanged { from: 2, to: 7 },
            Observed::ProgramChanged { from: "a \"b\"".to_owned(), to: "部件".to_owned() },
            Observed::CycleDone { count: 1, at_least: false, ms: Some(12_300), at: Micros(5) },
            Observed::Parts { counter: 4, added: 2, total: -7 },
            Observed::PartsReset { counter: 4, from: 9, to: 0 },
            Observed::LinkLost {},
            Observed::LinkBack {},
            Observed::Unseen { from: Some(Micros(1)), to: time, because: UnseenBecause::Link },
        ];
        all.map(|observed| Event::new(time, observed)).into()
    }

    #[test]
    fn events_come_back_as_they_were_and_each_kind_has_its_word() {
        let events = one_of_each();
        for (event, kind) in events.iter().zip(Kind::ALL) {
            let (text, crc) = event.encode();
            assert_eq!(Event::decode(event.time, &text, crc).as_ref(), Some(event), "{text}");
            assert!(text.starts_with(&format!("{{\"event\":\"{}\"", kind.word())), "{text}");
            assert_eq!((event.kind(), Kind::of_word(kind.word())), (kind, Some(kind)));
        }
        assert_eq!(events.len(), Kind::ALL.len());
        assert_eq!(Kind::of_word("alarm"), None);
    }

    #[test]
    fn an_event_that_stands_elsewhere_keeps_its_own_time() {
        for event in one_of_each() {
            let (own, later, latest) = (event.time, event.time.after(SECOND), event.time.after(SECOND * 2));
            let moved = event.standing_at(later);
            assert_eq!((moved.time, moved.true_time), (later, Some(own)));
            let (text, crc) = moved.encode();
            assert_eq!(Event::decode(later, &text, crc), Some(moved.clone()), "{text}");
            let again = moved.standing_at(latest);
            assert_eq!((again.time, again.true_time), (latest, Some(own)));
            assert_eq!(again.standing_at(own).true_time, None);
        }
    }

    #[test]
    fn what_was_changed_is_not_read() {
        let event = one_of_each().remove(0);
        let (text, crc) = event.encode();
        assert_eq!(Event::decode(event.time, &text.replace("42", "43"), crc), None);
        assert_eq!(Event::decode(Micros(event.time.0 + 1), &text, crc), None);
        let newer = "{\"event\":\"of_a_later_version\"}";
        assert_eq!(Event::decode(event.time, newer, checksum(event.time, newer)), None);
    }
}
