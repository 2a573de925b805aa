//! What can be broken on purpose: on the link, in the replies, in what the controller does with requests.
//!
//! Each fault has a word, by which a scenario names it, and the class it belongs to (`docs/SCENARIOS.md`).

pub mod file;
pub mod link;
pub(crate) mod reply;

use std::time::Duration;

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

/// What happens to connections and to bytes on their way; frames are not looked into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LinkFault {
    /// T1: connections are refused.
    Refuse,
    /// T2: nothing answers an attempt to connect.
    BlackHole,
    /// T3: connections that come now are accepted, and never answered, not even later.
    Silence,
    /// T4: a frame breaks off after so many bytes (`None`: drawn), and the connection is reset.
    ResetMidFrame {
        /// After how many bytes of the frame, at most all but one.
        after: Option<usize>,
    },
    /// T5: the connection is closed in good order where a frame should have left.
    CloseBeforeReply,
    /// T6: connections that are there go deaf for ever, without a word; they keep their places among those that are served.
    HalfOpen,
    /// T7: frames leave in pieces, each by itself.
    Pieces {
        /// How many bytes a piece has, from 1.
        bytes: usize,
    },
    /// T7: frames leave together, so many in one piece; the last ones no later than a time after the first.
    Coalesce {
        /// How many frames, from 2.
        frames: usize,
        /// How long the first of them waits at most.
        within: Duration,
    },
    /// T8: bytes take their time; their order stays. What is drawn is drawn for each frame to the client, and for what one read
    /// gave to the controller.
    Latency {
        /// To the controller.
        to_controller: Duration,
        /// To the client.
        to_client: Duration,
        /// How much longer it may be.
        spread: Duration,
    },
    /// T9: so few bytes a second, in each direction; what waits fills the peer's buffers.
    Slow {
        /// Bytes a second, from 1.
        bytes_per_second: u32,
    },
    /// T11: a byte to the client is changed, lost, or followed by one that nobody sent; `chance` is that of a byte.
    Noise,
    /// T14: the second half of a frame leaves that much later, as where two writes meet a peer that delays its
    /// acknowledgements.
    Stall {
        /// How much later.
        delay: Duration,
    },
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

/// A fault that is in force now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkFaultNow {
    /// Which.
    pub fault: LinkFault,
    /// How likely it strikes, 0 to 1: each frame; each byte for [`LinkFault::Noise`]; each connection, once, for
    /// [`LinkFault::Silence`], [`LinkFault::HalfOpen`] and [`LinkFault::Slow`]. The door knows no chance:
    /// [`LinkFault::Refuse`] and [`LinkFault::BlackHole`] hold for everybody.
    pub chance: f64,
}
