//! Reads a fault from its word and fields.

use std::fmt;
use std::time::Duration;

use r6_program::form::{Fields, Wrong};

use super::{BadField, BadJson, BadList, Fault, IgnoredStop, LinkFault, PackIdFault, ReplyFault, TaskFault};

/// The word and the class of every fault (`docs/SCENARIOS.md`).
pub const FAULTS: [(&str, &str); 30] = [
    ("refuse", "T1"),
    ("black-hole", "T2"),
    ("silence", "T3"),
    ("reset-mid-frame", "T4"),
    ("close-before-reply", "T5"),
    ("half-open", "T6"),
    ("pieces", "T7"),
    ("coalesce", "T7"),
    ("latency", "T8"),
    ("slow", "T9"),
    ("noise", "T11"),
    ("stall", "T14"),
    ("bad-json", "P1"),
    ("bad-field", "P2"),
    ("bad-pack-id", "P3"),
    ("late-reply", "P3"),
    ("crossed-reply", "P4"),
    ("bad-list", "P5"),
    ("echo", "P6"),
    ("unsolicited", "P7"),
    ("not-executed", "P10"),
    ("not-acknowledged", "P10"),
    ("list-full", "P11"),
    ("list-frozen", "P11"),
    ("rejected-mid-batch", "P12"),
    ("task-dead", "P13"),
    ("frozen-values", "C9"),
    ("stop-ignored", "E1"),
    ("dwell", "E2"),
    ("late-list", "E4"),
];

const JSON_KINDS: [(&str, BadJson); 9] = [
    ("truncated", BadJson::Truncated),
    ("oversized", BadJson::Oversized),
    ("deep", BadJson::Deep),
    ("duplicate-keys", BadJson::DuplicateKeys),
    ("byte-order-mark", BadJson::ByteOrderMark),
    ("bad-utf8", BadJson::BadUtf8),
    ("nul", BadJson::Nul),
    ("huge-number", BadJson::HugeNumber),
    ("not-a-number", BadJson::NotANumber),
];

const FIELD_KINDS: [(&str, BadField); 4] = [
    ("missing", BadField::Missing),
    ("unknown", BadField::Unknown),
    ("renamed", BadField::Renamed),
    ("wrong-type", BadField::WrongType),
];

const PACK_ID_KINDS: [(&str, PackIdFault); 3] = [
    ("wrong", PackIdFault::Wrong),
    ("repeated", PackIdFault::Repeated),
    ("reordered", PackIdFault::Reordered),
];

const LIST_KINDS: [(&str, BadList); 3] =
    [("short", BadList::Short), ("long", BadList::Long), ("shifted", BadList::Shifted)];

const IGNORED_KINDS: [(&str, IgnoredStop); 3] =
    [("ok", IgnoredStop::Ok), ("err", IgnoredStop::Err), ("every", IgnoredStop::Every)];

/// The kinds of the fault with this word, one of which it has to have; none if it has no kinds.
#[must_use]
pub fn kinds(word: &str) -> Vec<&'static str> {
    fn words<T>(kinds: &[(&'static str, T)]) -> Vec<&'static str> {
        kinds.iter().map(|(word, _)| *word).collect()
    }
    match word {
        "bad-json" => words(&JSON_KINDS),
        "bad-field" => words(&FIELD_KINDS),
        "bad-pack-id" => words(&PACK_ID_KINDS),
        "bad-list" => words(&LIST_KINDS),
        "stop-ignored" => words(&IGNORED_KINDS),
        _ => Vec::new(),
    }
}

/// The numbers that the fault with this word may have besides.
#[must_use]
pub fn numbers(word: &str) -> &'static [&'static str] {
    match word {
        "reset-mid-frame" => &["after"],
        "pieces" => &["bytes"],
        "coalesce" => &["frames", "within"],
        "latency" => &["to_controller", "to_client", "spread"],
        "slow" => &["bytes_per_second"],
        "stall" | "late-reply" | "late-list" => &["delay"],
        "dwell" => &["rest"],
        _ => &[],
    }
}

/// The longest delay of a fault, in seconds: far longer than every timeout of a client.
const LONGEST_DELAY: f64 = 3600.0;

pub(crate) fn read(fields: &Fields<'_>) -> Result<Fault, Wrong> {
    let words = FAULTS.map(|(word, _)| (word, word));
    let word = fields.word("fault", &words).ok_or_else(|| Wrong::missing("fault", "the word of a fault"))?;
    let link = match word {
        "refuse" => Some(LinkFault::Refuse),
        "black-hole" => Some(LinkFault::BlackHole),
        "silence" => Some(LinkFault::Silence),
        "reset-mid-frame" => Some(LinkFault::ResetMidFrame {
            after: fields.whole_in("after", "how many bytes, from 0", 0..=usize::MAX),
        }),
        "close-before-reply" => Some(LinkFault::CloseBeforeReply),
        "half-open" => Some(LinkFault::HalfOpen),
        "pieces" => Some(LinkFault::Pieces {
            bytes: fields.whole_in("bytes", "how many bytes, from 1", 1..=usize::MAX).unwrap_or(1),
        }),
        "coalesce" => Some(LinkFault::Coalesce {
            frames: fields.whole_in("frames", "how many frames, 2 to 100", 2_usize..=100).unwrap_or(2),
            within: delay(fields, "within").unwrap_or(Duration::from_millis(100)),
        }),
        "latency" => Some(LinkFault::Latency {
            to_controller: delay(fields, "to_controller").unwrap_or_default(),
            to_client: delay(fields, "to_client").unwrap_or_default(),
            spread: delay(fields, "spread").unwrap_or_default(),
        }),
        "slow" => Some(LinkFault::Slow {
            bytes_per_second: fields
                .whole_in("bytes_per_second", "how many bytes, from 1", 1..=u32::MAX)
                .unwrap_or(1),
        }),
        "noise" => Some(LinkFault::Noise),
        "stall" => {
            Some(LinkFault::Stall { delay: delay(fields, "delay").unwrap_or(Duration::from_millis(190)) })
        }
        _ => None,
    };
    if let Some(link) = link {
        return Ok(Fault::Link(link));
    }
    Ok(match word {
        "bad-json" => Fault::Reply(ReplyFault::BadJson(fields.due_word("kind", &JSON_KINDS)?)),
        "bad-field" => Fault::Reply(ReplyFault::BadField(fields.due_word("kind", &FIELD_KINDS)?)),
        "bad-pack-id" => Fault::Reply(ReplyFault::PackId(fields.due_word("kind", &PACK_ID_KINDS)?)),
        "late-reply" => Fault::Reply(ReplyFault::PackId(PackIdFault::Late(
            delay(fields, "delay").unwrap_or(Duration::from_secs(3)),
        ))),
        "crossed-reply" => Fault::Reply(ReplyFault::CrossedReply),
        "bad-list" => Fault::Reply(ReplyFault::BadList(fields.due_word("kind", &LIST_KINDS)?)),
        "echo" => Fault::Reply(ReplyFault::Echo),
        "unsolicited" => Fault::Reply(ReplyFault::Unsolicited),
        "not-executed" => Fault::Task(TaskFault::NotExecuted),
        "not-acknowledged" => Fault::Task(TaskFault::NotAcknowledged),
        "list-full" => Fault::Task(TaskFault::ListFull),
        "list-frozen" => Fault::Task(TaskFault::ListFrozen),
        "rejected-mid-batch" => Fault::Task(TaskFault::RejectedMidBatch),
        "task-dead" => Fault::Task(TaskFault::TaskDead),
        "frozen-values" => Fault::Task(TaskFault::FrozenValues),
        "stop-ignored" => Fault::Task(TaskFault::StopIgnored(fields.due_word("kind", &IGNORED_KINDS)?)),
        "dwell" => Fault::Task(TaskFault::Dwell {
            rest: delay(fields, "rest").unwrap_or(Duration::from_millis(300)),
        }),
        "late-list" => Fault::Task(TaskFault::LateList {
            delay: delay(fields, "delay").unwrap_or(Duration::from_secs(3)),
        }),
        other => return Err(format!("nothing is known of `{other}`").into()),
    })
}

impl Fault {
    /// The word that scenarios use for it.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Link(LinkFault::Refuse) => "refuse",
            Self::Link(LinkFault::BlackHole) => "black-hole",
            Self::Link(LinkFault::Silence) => "silence",
            Self::Link(LinkFault::ResetMidFrame { .. }) => "reset-mid-frame",
            Self::Link(LinkFault::CloseBeforeReply) => "close-before-reply",
            Self::Link(LinkFault::HalfOpen) => "half-open",
            Self::Link(LinkFault::Pieces { .. }) => "pieces",
            Self::Link(LinkFault::Coalesce { .. }) => "coalesce",
            Self::Link(LinkFault::Latency { .. }) => "latency",
            Self::Link(LinkFault::Slow { .. }) => "slow",
            Self::Link(LinkFault::Noise) => "noise",
            Self::Link(LinkFault::Stall { .. }) => "stall",
            Self::Reply(ReplyFault::BadJson(_)) => "bad-json",
            Self::Reply(ReplyFault::BadField(_)) => "bad-field",
            Self::Reply(ReplyFault::PackId(PackIdFault::Late(_))) => "late-reply",
            Self::Reply(ReplyFault::PackId(_)) => "bad-pack-id",
            Self::Reply(ReplyFault::CrossedReply) => "crossed-reply",
            Self::Reply(ReplyFault::BadList(_)) => "bad-list",
            Self::Reply(ReplyFault::Echo) => "echo",
            Self::Reply(ReplyFault::Unsolicited) => "unsolicited",
            Self::Task(TaskFault::NotExecuted) => "not-executed",
            Self::Task(TaskFault::NotAcknowledged) => "not-acknowledged",
            Self::Task(TaskFault::ListFull) => "list-full",
            Self::Task(TaskFault::ListFrozen) => "list-frozen",
            Self::Task(TaskFault::RejectedMidBatch) => "rejected-mid-batch",
            Self::Task(TaskFault::TaskDead) => "task-dead",
            Self::Task(TaskFault::FrozenValues) => "frozen-values",
            Self::Task(TaskFault::StopIgnored(_)) => "stop-ignored",
            Self::Task(TaskFault::Dwell { .. }) => "dwell",
            Self::Task(TaskFault::LateList { .. }) => "late-list",
        }
    }

    /// The word of its kind, if it has kinds.
    #[must_use]
    pub fn kind(&self) -> Option<&'static str> {
        fn word<T: PartialEq>(words: &[(&'static str, T)], kind: &T) -> Option<&'static str> {
            words.iter().find(|(_, other)| other == kind).map(|(word, _)| *word)
        }
        match self {
            Self::Reply(ReplyFault::BadJson(kind)) => word(&JSON_KINDS, kind),
            Self::Reply(ReplyFault::BadField(kind)) => word(&FIELD_KINDS, kind),
            Self::Reply(ReplyFault::PackId(kind)) => word(&PACK_ID_KINDS, kind),
            Self::Reply(ReplyFault::BadList(kind)) => word(&LIST_KINDS, kind),
            Self::Task(TaskFault::StopIgnored(kind)) => word(&IGNORED_KINDS, kind),
            Self::Reply(ReplyFault::CrossedReply | ReplyFault::Echo | ReplyFault::Unsolicited)
            | Self::Link(_)
            | Self::Task(_) => None,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())?;
        self.kind().map_or(Ok(()), |kind| write!(f, " ({kind})"))
    }
}

fn delay(fields: &Fields<'_>, name: &'static str) -> Option<Duration> {
    fields.number_in(name, "seconds, 0 to 3600", 0.0..=LONGEST_DELAY).map(Duration::from_secs_f64)
}
