//! Compares the decoder with serde_json on the same bytes: both accept them or both refuse them, every known
//! member agrees, and all other members are extras.
//!
//! They differ only where this is documented: bytes that are not UTF-8 may be GBK texts, and the decoder
//! limits nesting. The object itself and a list that is read item by item do not count as levels, so the
//! limit applies one or two levels later.

#[path = "listed.rs"]
mod listed;
#[path = "lists.rs"]
mod lists;

use std::fmt;

use listed::{integer, number};
use r6_proto::error::JsonError;
use r6_proto::message::{Body, ExtraKind, Place};
use r6_proto::value::{Value as Wire, Values};
use r6_proto::{MAX_DEPTH, Message, RequestType};
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::{Map, Value};

/// Keys at the top of a frame.
const TOP: [&str; 13] = [
    "dsID",
    "reqType",
    "cmdType",
    "packID",
    "queryAddr",
    "queryData",
    "cmdData",
    "cmdReply",
    "camID",
    "ret",
    "emptyList",
    "instructions",
    "dsData",
];

/// The members of an object in their order. Members with the same key stay separate.
struct Members(Vec<(String, Value)>);

impl<'de> Deserialize<'de> for Members {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Every;
        impl<'de> Visitor<'de> for Every {
            type Value = Members;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Members, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = map.next_entry()? {
                    members.push(member);
                }
                Ok(Members(members))
            }
        }
        deserializer.deserialize_map(Every)
    }
}

/// Compares the result of the decoder for these bytes with that of serde_json.
pub fn check(decoded: &Result<Message<'_>, JsonError>, bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match (decoded, serde_json::from_str::<Value>(text)) {
        (Ok(message), Ok(Value::Object(theirs))) => {
            assert!(depth(bytes) <= MAX_DEPTH + 2, "deeper than the limit");
            header(message, &theirs);
            body(message, &theirs);
            nothing_is_lost(message, text);
        }
        (Ok(_), theirs) => panic!("only we take it: serde_json says {theirs:?}"),
        (Err(error), Ok(Value::Object(_))) => {
            assert!(depth(bytes) > MAX_DEPTH, "only serde_json takes it: {error}");
        }
        (Err(error), _) => assert!(error.at <= bytes.len() && !error.to_string().is_empty()),
    }
}

/// Depth of nesting of a JSON text.
fn depth(json: &[u8]) -> usize {
    let (mut depth, mut deepest, mut in_string, mut escaped) = (0_usize, 0, false, false);
    for byte in json {
        match byte {
            _ if escaped => escaped = false,
            b'\\' => escaped = in_string,
            b'"' => in_string = !in_string,
            b'{' | b'[' if !in_string => depth += 1,
            b'}' | b']' if !in_string => depth = depth.saturating_sub(1),
            _ => {}
        }
        deepest = deepest.max(depth);
    }
    deepest
}

fn header(message: &Message<'_>, theirs: &Map<String, Value>) {
    let header = &message.header;
    value("dsID", header.ds_id, theirs.get("dsID"));
    value("type", header.type_word, type_value(theirs));
    value("packID", header.pack_id, theirs.get("packID"));
}

fn type_value(theirs: &Map<String, Value>) -> Option<&Value> {
    theirs.get("reqType").or(theirs.get("cmdType"))
}

/// Each unknown member, and each earlier occurrence of a repeated known key, must be an extra, in order.
fn nothing_is_lost(message: &Message<'_>, text: &str) {
    let Members(members) = serde_json::from_str(text).expect("it was read before");
    let lost = members.iter().enumerate().filter(|(at, (key, _))| {
        let comes_again = members.iter().skip(at + 1).any(|(other, _)| other == key);
        comes_again || !TOP.contains(&key.as_str())
    });
    let extras: Vec<_> = message
        .extras()
        .filter(|extra| extra.place == Place::Top && extra.kind != ExtraKind::OutOfPlace)
        .map(|extra| (extra.key.text().into_owned(), extra.value))
        .collect();
    for (_, (key, theirs)) in lost {
        let kept = extras.iter().any(|(known, ours)| known == key && same_value(*ours, theirs));
        assert!(kept, "`{key}` is lost: {theirs}; there are {extras:?}");
    }
    assert!(extras.len() <= members.len(), "more extras than members: {extras:?}");
}

fn list(key: &str, ours: Values<'_>, theirs: Option<&Value>) {
    let theirs = theirs.and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    assert_eq!(ours.len(), theirs.len(), "{key}");
    for (ours, theirs) in ours.iter().zip(theirs) {
        value(key, Some(ours), Some(theirs));
    }
}

fn body(message: &Message<'_>, theirs: &Map<String, Value>) {
    let is_type =
        |words: &[&str]| type_value(theirs).and_then(Value::as_str).is_none_or(|word| words.contains(&word));
    match &message.body {
        Body::Query(query) => {
            assert!(is_type(&["query"]));
            list("queryAddr", query.addresses, theirs.get("queryAddr"));
        }
        Body::QueryReply(reply) => {
            assert!(is_type(&["query", "queryEcho"]));
            assert_eq!(reply.addresses.is_some(), theirs.contains_key("queryAddr"));
            list("queryAddr", reply.addresses.unwrap_or(Values::EMPTY), theirs.get("queryAddr"));
            list("queryData", reply.values, theirs.get("queryData"));
        }
        Body::Command(command) => {
            assert!(is_type(&["command"]));
            let words = theirs["cmdData"].as_array().expect("a list of words");
            assert_eq!(Some(&*command.word()), words.first().and_then(Value::as_str));
            assert_eq!(command.arguments().len() + 1, words.len());
            for (ours, theirs) in command.arguments().iter().zip(&words[1..]) {
                value("cmdData", Some(ours), Some(theirs));
            }
        }
        Body::CommandReply(reply) if theirs["cmdReply"].is_array() => {
            list("cmdReply", reply.words(), theirs.get("cmdReply"));
        }
        Body::CommandReply(_) => assert!(theirs["cmdReply"].is_string()),
        Body::Heartbreak => assert!(is_type(&["heartbreak"])),
        Body::Photo(photo) => assert_eq!(Some(photo.cam_id), integer(&theirs["camID"])),
        Body::PhotoAnswer(answer) => {
            assert_eq!(Some(answer.cam_id), integer(&theirs["camID"]));
            assert_eq!(Some(answer.ret), integer(&theirs["ret"]));
        }
        Body::AddPoints(points) => lists::points(points, theirs),
        Body::AddRcc(list) => lists::instructions(list, theirs),
        Body::Unknown(unknown) => {
            let word = type_value(theirs).and_then(Value::as_str);
            assert!(word.is_none_or(|word| RequestType::ALL.iter().all(|known| known.word() != word)));
            assert_eq!(unknown.word.is_some(), type_value(theirs).is_some());
        }
        Body::Rejected(rejection) => {
            assert!(is_type(&[rejection.request.word(), "queryEcho", "cmdEcho", "AddrCC"]));
            lists::rejected(rejection, message.frame(), theirs);
        }
    }
}

fn value(key: &str, ours: Option<Wire<'_>>, theirs: Option<&Value>) {
    match (ours, theirs) {
        (None, None) => {}
        (Some(ours), Some(theirs)) => assert!(same_value(ours, theirs), "{key}: {ours:?} and {theirs}"),
        (ours, theirs) => panic!("{key}: {ours:?} and {theirs:?}"),
    }
}

fn same_value(ours: Wire<'_>, theirs: &Value) -> bool {
    match theirs {
        Value::String(text) => ours.is_text() && ours.text() == *text,
        // The decoder does not read a number beyond 64 characters, because it is not a measurement.
        Value::Number(_) => {
            ours.is_number() && (ours.wire().len() > 64 || same(ours.number(), number(theirs)))
        }
        Value::Array(items) => {
            ours.is_list()
                && ours.items().count() == items.len()
                && ours.items().zip(items).all(|(ours, theirs)| same_value(ours, theirs))
        }
        Value::Object(_) | Value::Bool(_) | Value::Null => {
            serde_json::from_slice::<Value>(ours.wire()).is_ok_and(|ours| ours == *theirs)
        }
    }
}

fn same(ours: Option<f64>, theirs: Option<f64>) -> bool {
    ours == theirs
}
