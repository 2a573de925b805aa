//! Applies reply faults to a reply.

use std::time::Duration;

use r6_proto::reply::encode_photo;
use serde_json::{Map, Value, json};

use super::{BadField, BadJson, BadList, OVERSIZED_BYTES, PackIdFault, ReplyFault};
use r6_traffic::random::Random;

/// How deep the lists of [`BadJson::Deep`] are nested: beyond every decoder's limit.
const TOO_DEEP: usize = 1000;

/// The names of the lists in replies.
const LISTS: [&str; 2] = ["queryData", "cmdReply"];

/// One frame for the asker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Outgoing {
    /// The additional delay.
    pub later: Duration,
    /// The frame, or what is left of it.
    pub bytes: Vec<u8>,
}

/// The frames made from one reply.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Fate {
    /// The frames for the asker.
    pub to_asker: Vec<Outgoing>,
    /// The frames for every other connection.
    pub to_others: Vec<Vec<u8>>,
    /// The frames that the asker gets after its next reply.
    pub held: Vec<Vec<u8>>,
}

/// The frames for the reply to `request` after this fault strikes it.
pub(crate) fn strike(fault: &ReplyFault, request: &[u8], reply: Vec<u8>, random: &mut Random) -> Fate {
    let mut fate = Fate::default();
    let mut send = |bytes| fate.to_asker.push(Outgoing { later: Duration::ZERO, bytes });
    match fault {
        ReplyFault::BadJson(kind) => send(bad_json(*kind, reply)),
        ReplyFault::BadField(kind) => send(edited(reply, |object| bad_field(*kind, object))),
        ReplyFault::PackId(PackIdFault::Wrong) => send(edited(reply, |object| wrong_pack_id(object, random))),
        ReplyFault::PackId(PackIdFault::Repeated) => {
            send(reply.clone());
            send(reply);
        }
        ReplyFault::PackId(PackIdFault::Reordered) => fate.held.push(reply),
        ReplyFault::PackId(PackIdFault::Late(later)) => {
            fate.to_asker.push(Outgoing { later: *later, bytes: reply });
        }
        ReplyFault::CrossedReply => {
            send(reply.clone());
            fate.to_others.push(reply);
        }
        ReplyFault::BadList(kind) => send(edited(reply, |object| bad_list(*kind, object))),
        ReplyFault::Echo => send(request.to_vec()),
        ReplyFault::Unsolicited => {
            send(unsolicited(random));
            send(reply);
        }
    }
    fate
}

/// The reply with its object edited. A reply that is not an object is returned unchanged.
fn edited(reply: Vec<u8>, edit: impl FnOnce(&mut Map<String, Value>)) -> Vec<u8> {
    match serde_json::from_slice(&reply) {
        Ok(Value::Object(mut object)) => {
            edit(&mut object);
            Value::Object(object).to_string().into_bytes()
        }
        Ok(_) | Err(_) => reply,
    }
}

/// The reply with one more field, given as text, because no JSON value can hold these fields.
fn with_field(reply: &[u8], field: &[u8]) -> Vec<u8> {
    let rest = reply.strip_prefix(b"{").unwrap_or(reply);
    [b"{".as_slice(), field, b",", rest].concat()
}

fn bad_json(kind: BadJson, reply: Vec<u8>) -> Vec<u8> {
    let half = reply.len() / 2;
    match kind {
        BadJson::Truncated => reply.get(..half).unwrap_or_default().to_vec(),
        BadJson::Oversized => {
            let text = "x".repeat(OVERSIZED_BYTES);
            with_field(&reply, format!("\"log\":\"{text}\"").as_bytes())
        }
        BadJson::Deep => {
            let lists = [b"\"log\":".as_slice(), &b"[".repeat(TOO_DEEP), &b"]".repeat(TOO_DEEP)].concat();
            with_field(&reply, &lists)
        }
        BadJson::DuplicateKeys => {
            let fields = reply.strip_prefix(b"{").and_then(|rest| rest.strip_suffix(b"}"));
            fields.map_or_else(|| reply.clone(), |fields| with_field(&reply, fields))
        }
        BadJson::ByteOrderMark => [b"\xef\xbb\xbf".as_slice(), &reply].concat(),
        BadJson::BadUtf8 => with_field(&reply, b"\"log\":\"\xff\xfe\""),
        BadJson::Nul => {
            let (head, tail) = reply.split_at_checked(half).unwrap_or((&reply, &[]));
            [head, b"\0", tail].concat()
        }
        BadJson::HugeNumber => with_field(&reply, format!("\"log\":1{}", "0".repeat(400)).as_bytes()),
        BadJson::NotANumber => with_field(&reply, b"\"log\":NaN"),
    }
}

fn list_of(object: &Map<String, Value>) -> Option<&'static str> {
    LISTS.into_iter().find(|list| object.contains_key(*list))
}

fn bad_field(kind: BadField, object: &mut Map<String, Value>) {
    let Some(list) = list_of(object) else { return };
    match kind {
        BadField::Missing => {
            object.remove(list);
        }
        BadField::Unknown => {
            object.insert("firmwareHint".to_owned(), json!("tea"));
        }
        BadField::Renamed => {
            let value = object.remove(list).unwrap_or_default();
            object.insert(format!("{list}s"), value);
        }
        BadField::WrongType => {
            object.insert(list.to_owned(), json!(7));
        }
    }
}

fn wrong_pack_id(object: &mut Map<String, Value>, random: &mut Random) {
    // Larger than any number that a client counts to.
    let wrong = format!("{}", 4_000_000_000_u64 + u64::try_from(random.below(1_000_000)).unwrap_or(0));
    object.insert("packID".to_owned(), json!(wrong));
}

fn bad_list(kind: BadList, object: &mut Map<String, Value>) {
    let Some(Value::Array(values)) = object.get_mut("queryData") else { return };
    match kind {
        BadList::Short => {
            values.pop();
        }
        BadList::Long => values.extend(values.last().cloned()),
        BadList::Shifted if !values.is_empty() => values.rotate_left(1),
        BadList::Shifted => {}
    }
}

/// A frame that answers no request.
fn unsolicited(random: &mut Random) -> Vec<u8> {
    match random.below(4) {
        0 => {
            let mut photo = Vec::new();
            encode_photo(0, None, &mut photo);
            photo
        }
        1 => json!({"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "command", "cmdReply": ["switchTool", "ok"]})
            .to_string()
            .into_bytes(),
        2 => json!({"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "query", "queryAddr": ["curMold"],
            "queryData": ["somebody's"]})
        .to_string()
        .into_bytes(),
        _ => b"{\"hello\":\"world\"}".to_vec(),
    }
}
