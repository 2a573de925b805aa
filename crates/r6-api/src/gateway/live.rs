//! The messages of `GET /v1/live`, in both directions.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{Event, RobotState, Signal};
use crate::Problem;

/// A message of the gateway. Server-sent events have the type as `event`, and the rest as `data`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum LiveMessage {
    /// The reader may have missed something: forget what is known. A `snapshot` follows for each robot.
    Reset(LiveReset),
    /// All values of a robot, in place of what is known of it.
    Snapshot(Box<RobotState>),
    /// The values of a robot that changed.
    Change(LiveChange),
    /// The robot is not there any more.
    Removed(LiveRemoved),
    /// Something happened. Only for readers that ask for events.
    Event(Event),
    /// Events were missed. Those that the gateway still has follow.
    EventsLost(LiveNothing),
    /// Nothing changed, and the stream is alive. Only for readers that ask for it, over a WebSocket.
    Alive(LiveAlive),
    /// The answer to `subscribe`: what follows is of the new subscription. Over a WebSocket only.
    Subscribed(LiveSubscribed),
    /// The answer to a message that was not carried out. The subscription goes on. Over a WebSocket only.
    Problem(Problem),
}

/// A message over a WebSocket.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LiveSent {
    /// The message.
    #[serde(flatten)]
    pub message: LiveMessage,
    /// If it is there, everything before it was sent too: send it as `?resume=` to go on behind this message.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(example = "1764043200000000-812"))]
    pub resume: Option<String>,
}

/// What to forget.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LiveReset {
    /// The robot; `null` for all robots.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub robot: Option<String>,
}

/// The values of a robot that changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LiveChange {
    /// The robot.
    pub robot: String,
    /// All values that changed after this number are in this message. It is the number of the message before
    /// about this robot, or the number that the reader resumed at.
    pub after: u64,
    /// The number of the robot's last change in this message. A slow reader gets the latest values, and
    /// numbers in between are left out.
    pub number: u64,
    /// The values that changed.
    pub signals: Vec<Signal>,
}

/// The last message about a robot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LiveRemoved {
    /// The robot, which was removed from the gateway.
    pub robot: String,
}

/// A message whose type says all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LiveNothing {}

/// A sign of life.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LiveAlive {
    /// The time of the gateway.
    pub time: String,
    /// How old what the reader has may be, in ms: whatever changed before that is in the messages before this
    /// one. `null` until all robots were told once.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub passed_ms_ago: Option<u64>,
}

/// What is followed from now on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LiveSubscribed {
    /// The robots; `null` for all that the token may see.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub robots: Option<Vec<String>>,
    /// The values; `null` for all.
    #[cfg_attr(feature = "openapi", schema(required = true))]
    pub signals: Option<Vec<String>>,
    /// Whether events are followed.
    pub events: bool,
}

/// A message of the reader over a WebSocket. Each gets one answer, in order.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum LiveRequest {
    /// Follow this from now on, and nothing else.
    Subscribe(LiveSubscribe),
}

/// What to follow.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LiveSubscribe {
    /// Only these robots, 1000 at most; all that the token may see if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(max_items = 1000))]
    pub robots: Option<Vec<String>>,
    /// Only these values, 1000 at most, by their query addresses; all if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(max_items = 1000))]
    pub signals: Option<Vec<String>>,
    /// Whether to follow events too.
    #[serde(default)]
    pub events: bool,
    /// What the reader has. If it is missing, a `snapshot` of each robot comes first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resume: Option<LiveResume>,
}

/// What a reader has.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LiveResume {
    /// The epoch of the snapshots.
    pub epoch: u64,
    /// By robot, the number of its last message.
    #[serde(default)]
    pub robots: BTreeMap<String, u64>,
    /// The id of the last event; events from now on if it is missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub event: Option<u64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_flat_and_read_back() {
        let change = LiveChange { robot: "saw".to_owned(), after: 1, number: 2, signals: Vec::new() };
        let sent = LiveSent { message: LiveMessage::Change(change), resume: Some("7-2".to_owned()) };
        let text = serde_json::to_string(&sent).unwrap();
        let wanted = r#"{"type":"change","robot":"saw","after":1,"number":2,"signals":[],"resume":"7-2"}"#;
        assert_eq!(text, wanted);
        assert_eq!(serde_json::from_str::<LiveSent>(&text).unwrap(), sent);
        let lost = LiveSent { message: LiveMessage::EventsLost(LiveNothing {}), resume: None };
        assert_eq!(serde_json::to_string(&lost).unwrap(), r#"{"type":"events_lost"}"#);
    }

    #[test]
    fn a_request_with_a_word_too_many_is_refused() {
        let read = |text| serde_json::from_str::<LiveRequest>(text);
        assert_eq!(
            read(r#"{"type":"subscribe"}"#).unwrap(),
            LiveRequest::Subscribe(LiveSubscribe::default())
        );
        for wrong in [
            r#"{"type":"subscribe","signal":"axis-0"}"#,
            r#"{"type":"subscribe","resume":{"robots":{}}}"#,
            r#"{"type":"subscribe","resume":{"epoch":1,"number":2}}"#,
            r#"{"type":"follow"}"#,
            "{}",
            "[]",
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
