//! Fault injection: on the link, in the replies, and in how the controller handles requests.
//!
//! Each fault has a word that scenarios use, and a class (`docs/SCENARIOS.md`).
//!
//! `fault/file.rs` reads the words. Where each class takes effect:
//!
//! - Faults of requests are drawn before the dispatcher (`controller/dispatch.rs`) sees the requests.
//! - Faults of replies change what the dispatcher wrote (`fault/reply.rs`).
//! - Faults of the link are pure too (`r6-traffic/src/link.rs`: bytes and times in, bytes and endings out).
//!   The owners of the sockets apply them: `r6-sim/src/door.rs` where connections come in,
//!   `connection/faulty.rs` on each connection.

pub mod file;
pub(crate) mod reply;

use std::time::Duration;

pub use r6_traffic::fault::{LinkFault, LinkFaultNow};

/// A fault of any kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// A fault of connections and bytes.
    Link(LinkFault),
    /// A fault of a reply.
    Reply(ReplyFault),
    /// A fault in how the controller handles a request.
    Task(TaskFault),
}

/// A fault of a reply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReplyFault {
    /// P1: it is not proper JSON.
    BadJson(BadJson),
    /// P2: a field is wrong.
    BadField(BadField),
    /// P3: its `packID` or its time is wrong.
    PackId(PackIdFault),
    /// P4: every other connection gets it, too.
    CrossedReply,
    /// P5: its list of values does not fit the addresses.
    BadList(BadList),
    /// P6: the request comes back in its place.
    Echo,
    /// P7: an unrequested frame comes before it.
    Unsolicited,
}

/// How a reply is broken as JSON.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadJson {
    /// It ends in the middle, and the next frame follows at once.
    Truncated,
    /// A text of [`crate::fault::OVERSIZED_BYTES`] in one more field.
    Oversized,
    /// Lists in lists, deeper than any decoder allows.
    Deep,
    /// Every key twice.
    DuplicateKeys,
    /// A byte order mark before it.
    ByteOrderMark,
    /// A byte in a text that is not UTF-8.
    BadUtf8,
    /// A NUL in the middle.
    Nul,
    /// A number with 400 digits in one more field.
    HugeNumber,
    /// NaN where a number would be.
    NotANumber,
}

/// How a field of a reply is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadField {
    /// The list of values, or of verdicts, is missing.
    Missing,
    /// There is an unknown field.
    Unknown,
    /// The list has another name.
    Renamed,
    /// The list is a number.
    WrongType,
}

/// How a reply fails to match its request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PackIdFault {
    /// It has another `packID`.
    Wrong,
    /// It comes twice.
    Repeated,
    /// It comes after the next one.
    Reordered,
    /// It comes this much later.
    Late(Duration),
}

/// How the list of values is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadList {
    /// One value less.
    Short,
    /// One value more.
    Long,
    /// Each value stands one place too early.
    Shifted,
}

/// A fault in how the controller handles requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskFault {
    /// P10: commands and lists are answered with ok, but not carried out.
    NotExecuted,
    /// P10: commands and lists are carried out, but not answered.
    NotAcknowledged,
    /// P11: the list has no room for any instruction.
    ListFull,
    /// P11: the list takes instructions, but starts none.
    ListFrozen,
    /// P12: the first half of a list is taken, but the whole list is answered with err.
    RejectedMidBatch,
    /// P13: only heartbreaks are answered.
    TaskDead,
    /// C9: replies come, but their values do not change.
    FrozenValues,
    /// E1: stops are answered, but the arm keeps moving.
    StopIgnored(IgnoredStop),
    /// E2: the arm rests at each point where it stops while more instructions wait.
    Dwell {
        /// How long. Reported, unit A: 0.25 to 0.33 s.
        rest: Duration,
    },
    /// E4: lists are not answered, and are taken later. Clearing the list is not delayed.
    LateList {
        /// How much later.
        delay: Duration,
    },
}

/// Which stops have no effect, and how they are answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IgnoredStop {
    /// `actionStop` is answered with ok.
    Ok,
    /// `actionStop` is answered with `err`.
    Err,
    /// `actionStop`, `actionPause`, `stopButton` and clearing the list are answered with ok.
    Every,
}

impl IgnoredStop {
    /// Whether a command with this word has no effect; `AddRCC` means clearing the list.
    #[must_use]
    pub fn concerns(self, word: &str) -> bool {
        match self {
            Self::Ok | Self::Err => word == "actionStop",
            Self::Every => ["actionStop", "actionPause", "stopButton", "AddRCC"].contains(&word),
        }
    }
}

/// Length of the text of [`BadJson::Oversized`] in bytes: more than any client needs to keep.
pub const OVERSIZED_BYTES: usize = 200_000;

const _: () =
    assert!(OVERSIZED_BYTES < r6_traffic::link::MAX_WAITING_BYTES, "a link can carry the frame as a whole");
