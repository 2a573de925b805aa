//! What can be broken on purpose: on the link, in the replies, in what the controller does with requests.
//!
//! Each fault has a word, by which a scenario names it, and the class it belongs to (`docs/SCENARIOS.md`).

pub mod file;
pub(crate) mod reply;

use std::time::Duration;

pub use r6_traffic::fault::{LinkFault, LinkFaultNow};

/// One fault, of whichever kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// What happens to connections and bytes.
    Link(LinkFault),
    /// What becomes of a reply.
    Reply(ReplyFault),
    /// What the controller does with a request.
    Task(TaskFault),
}

/// What becomes of a reply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReplyFault {
    /// P1: it is no JSON object that anybody should send.
    BadJson(BadJson),
    /// P2: a field is not what it should be.
    BadField(BadField),
    /// P3: its `packID`, or when it comes, is wrong.
    PackId(PackIdFault),
    /// P4: everybody else who is connected gets it, too.
    CrossedReply,
    /// P5: its list of values does not fit the addresses.
    BadList(BadList),
    /// P6: the request comes back in its place.
    Echo,
    /// P7: a frame that nobody asked for comes before it.
    Unsolicited,
}

/// How a reply is no JSON.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadJson {
    /// It ends in the middle, and what comes next follows at once.
    Truncated,
    /// A text of [`crate::fault::OVERSIZED_BYTES`] in one more field.
    Oversized,
    /// Lists in lists, deeper than anybody reads.
    Deep,
    /// Every key twice.
    DuplicateKeys,
    /// A byte order mark before it.
    ByteOrderMark,
    /// A byte in a text that is no UTF-8.
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
    /// There is one that nobody knows.
    Unknown,
    /// The list has another name.
    Renamed,
    /// The list is a number.
    WrongType,
}

/// How a reply is paired wrongly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PackIdFault {
    /// It has another number.
    Wrong,
    /// It comes twice.
    Repeated,
    /// It comes after the next one.
    Reordered,
    /// It comes that much later.
    Late(Duration),
}

/// How the list of values is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadList {
    /// One value less.
    Short,
    /// One value more.
    Long,
    /// Each value stands where the one before it should.
    Shifted,
}

/// What the controller does with requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskFault {
    /// P10: commands and lists are answered with ok, and not carried out.
    NotExecuted,
    /// P10: commands and lists are carried out, and not answered.
    NotAcknowledged,
    /// P11: the list has no room for any instruction.
    ListFull,
    /// P11: the list takes instructions, and begins none.
    ListFrozen,
    /// P12: the first half of a list is taken, and the whole answered with err.
    RejectedMidBatch,
    /// P13: heartbreaks are answered, and nothing else is.
    TaskDead,
    /// C9: values stay as they were, although replies come.
    FrozenValues,
    /// E1: stops are answered, and the arm goes on.
    StopIgnored(IgnoredStop),
    /// E2: the arm stands so long at each point where it comes to rest and more instructions wait.
    Dwell {
        /// How long. Reported, unit A: 0.25 to 0.33 s.
        rest: Duration,
    },
    /// E4: lists are not answered, and taken that much later. Clearing the list is not late.
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
    /// Whether a command of this word has no effect; `AddRCC` stands for clearing the list.
    #[must_use]
    pub fn concerns(self, word: &str) -> bool {
        match self {
            Self::Ok | Self::Err => word == "actionStop",
            Self::Every => ["actionStop", "actionPause", "stopButton", "AddRCC"].contains(&word),
        }
    }
}

/// How long the text of [`BadJson::Oversized`] is: more than any client has reason to keep.
pub const OVERSIZED_BYTES: usize = 200_000;

const _: () =
    assert!(OVERSIZED_BYTES < r6_traffic::link::MAX_WAITING_BYTES, "a link can carry the frame as a whole");
