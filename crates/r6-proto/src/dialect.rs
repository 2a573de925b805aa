//! Differences between firmwares on the wire.

use crate::message::{RequestType, TypeKey};

/// How one firmware writes its replies. All dialects read the same: every known form, tolerantly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dialect {
    /// The order of the keys in a reply.
    pub key_order: KeyOrder,
    /// The type that a reply states.
    pub reply_type: ReplyType,
    /// The form of `cmdReply`.
    pub command_reply: CommandReplyForm,
    /// Whether replies echo the request's `packID`.
    pub echo_pack_id: bool,
    /// Whether replies echo a query's `queryAddr`.
    pub echo_query_addr: bool,
    /// The form of a counter.
    pub counter: CounterForm,
    /// Whether a reply ends with `"virtual":true`. No real controller sends this. Clients that read JSON
    /// ignore it.
    pub says_virtual: bool,
}

/// The order of the keys in a reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyOrder {
    /// Alphabetical, as in all captures of units C and D.
    Alphabetical,
    /// `dsID`, the type, then the payload, as the manual prints them.
    Manual,
}

/// The type that a reply states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplyType {
    /// The type of the request (manual 2.1, note 3; captured).
    AsSent,
    /// The type of the request for queries and commands; `command` for AddPoints and AddRCC, as in the
    /// templates of manual 5.2 and 6.
    Templates,
    /// `queryEcho` and `cmdEcho` (manual 8.2; captured, unit E); `command` for all other requests.
    Echo,
}

/// The form of `cmdReply` (manual 4.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandReplyForm {
    /// `["ok"]` or `[""]`, before 2.0.2.1 / 1.6.4.
    Verdict,
    /// `[command, "ok"]` or `[command, "err", message]`, since 2.0.2.1 / 1.6.4.
    NameAndVerdict,
}

impl CommandReplyForm {
    /// Both forms.
    pub const ALL: [Self; 2] = [Self::Verdict, Self::NameAndVerdict];

    /// The firmware that uses this form (manual 4.2).
    #[must_use]
    pub const fn firmware(self) -> &'static str {
        match self {
            Self::Verdict => "before 2.0.2.1 / 1.6.4",
            Self::NameAndVerdict => "since 2.0.2.1 / 1.6.4",
        }
    }
}

/// The form of `counter-n`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CounterForm {
    /// `[4,0,373266]` (captured, unit C).
    Numbers,
    /// `["4","0","373266"]` (manual 4.1.1 #4).
    Texts,
    /// `"name[4][T:0][C:373266]"` (captured, unit E, older firmware).
    OldText,
}

impl Dialect {
    /// The behaviour of captured controllers; the default everywhere.
    pub const HC1: Self = Self {
        key_order: KeyOrder::Alphabetical,
        reply_type: ReplyType::AsSent,
        command_reply: CommandReplyForm::NameAndVerdict,
        echo_pack_id: true,
        echo_query_addr: true,
        counter: CounterForm::Numbers,
        says_virtual: false,
    };

    /// Manual V6.0 to the letter, for firmware from 2.0.2.1 / 1.6.4 on.
    pub const R6: Self = Self {
        key_order: KeyOrder::Manual,
        reply_type: ReplyType::Templates,
        command_reply: CommandReplyForm::NameAndVerdict,
        echo_pack_id: false,
        echo_query_addr: false,
        counter: CounterForm::Texts,
        says_virtual: false,
    };

    /// Firmware before 2.0.2.1 / 1.6.4, as captured from unit E: `cmdEcho` with the command's name. For this
    /// firmware, manual 4.2 prints `command` with the bare verdict ([`ReplyType::AsSent`],
    /// [`CommandReplyForm::Verdict`]). No capture shows `cmdEcho` with the bare verdict.
    pub const LEGACY: Self = Self {
        key_order: KeyOrder::Manual,
        reply_type: ReplyType::Echo,
        command_reply: CommandReplyForm::NameAndVerdict,
        echo_pack_id: false,
        echo_query_addr: false,
        counter: CounterForm::OldText,
        says_virtual: false,
    };

    /// The type word of a reply to this request, or `None` to repeat the word that was sent.
    pub(crate) fn type_word(&self, request: RequestType) -> Option<&'static str> {
        match (self.reply_type, request) {
            (ReplyType::AsSent, _)
            | (ReplyType::Templates, RequestType::Query | RequestType::Command | RequestType::Heartbreak) => {
                None
            }
            (ReplyType::Echo, RequestType::Query) => Some("queryEcho"),
            (ReplyType::Echo, RequestType::Command) => Some("cmdEcho"),
            (
                ReplyType::Templates | ReplyType::Echo,
                RequestType::Photo | RequestType::AddPoints | RequestType::AddRcc | RequestType::Heartbreak,
            ) => Some("command"),
        }
    }
}

/// The `dsID` of a request (manual 2.1 note 1, 3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DsIdForm {
    /// `www.hc-system.com.RemoteMonitor` and similar.
    #[default]
    Long,
    /// `HCRemoteMonitor`, `HCRemoteCommand`: the older form, still accepted.
    Short,
}

impl DsIdForm {
    /// The `dsID` that a request of this type carries.
    #[must_use]
    pub const fn ds_id(self, request: RequestType) -> &'static str {
        match (request, self) {
            (RequestType::Query | RequestType::Command | RequestType::Heartbreak, Self::Long) => {
                "www.hc-system.com.RemoteMonitor"
            }
            (RequestType::Query | RequestType::Command | RequestType::Heartbreak, Self::Short) => {
                "HCRemoteMonitor"
            }
            (RequestType::Photo | RequestType::AddPoints, Self::Long | Self::Short) => {
                "www.hc-system.com.cam"
            }
            (RequestType::AddRcc, Self::Long) => "www.hc-system.com.HCRemoteCommand",
            (RequestType::AddRcc, Self::Short) => "HCRemoteCommand",
        }
    }
}

/// The addressing fields of a request.
#[derive(Clone, Copy, Debug)]
pub struct Addressing<'a> {
    /// The form of `dsID`.
    pub ds_id: DsIdForm,
    /// The key of the type. `Absent` sends no type; such a request gets no reply.
    pub type_key: TypeKey,
    /// `packID`, if any. Some firmware echoes it in the reply.
    pub pack_id: Option<&'a str>,
}

impl Default for Addressing<'_> {
    fn default() -> Self {
        Self { ds_id: DsIdForm::Long, type_key: TypeKey::ReqType, pack_id: None }
    }
}
