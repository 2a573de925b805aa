//! Strategies for bytes that are JSON, almost JSON, or not JSON at all.

use std::fmt;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};

/// Bytes that a failing test prints as text.
#[derive(Clone, PartialEq, Eq)]
pub struct Bytes(pub Vec<u8>);

impl fmt::Debug for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "b\"{}\"", self.0.escape_ascii())
    }
}

/// Keys of the protocol from every level, and a few unknown keys.
const KEYS: &[&str] = &[
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
    "data",
    "oneshot",
    "action",
    "m0",
    "m7",
    "m0_p",
    "m8",
    "ckStatus",
    "speed",
    "delay",
    "smooth",
    "tool",
    "coord",
    "isUse",
    "ioNumber",
    "io_status",
    "type",
    "point",
    "point2",
    "limit",
    "isUnlimit",
    "cnt_id",
    "xpos",
    "ModelID",
    "X",
    "Angel",
    "Angle",
    "Rel",
    "comment",
    "",
];

/// Words that have a meaning somewhere in the protocol.
const WORDS: &[&str] = &[
    "query",
    "command",
    "heartbreak",
    "photo",
    "AddPoints",
    "AddRCC",
    "AddrCC",
    "queryEcho",
    "cmdEcho",
    "version",
    "axis-0",
    "curAlarm",
    "actionStop",
    "rewriteData",
    "ok",
    "err",
    "0x3F",
    "1",
    "0",
    "4",
    "10",
    "100",
    "-1.5",
    "63",
    "www.hc-system.com.RemoteMonitor",
    "HCRemoteCommand",
];

/// Text of a JSON value, nested up to a few levels, with blanks where JSON allows them.
pub fn value() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        4 => string(),
        3 => number(),
        1 => select(&["true", "false", "null"]).prop_map(str::to_owned),
    ];
    leaf.prop_recursive(4, 40, 6, |inner| {
        prop_oneof![
            (vec(inner.clone(), 0..6), blank())
                .prop_map(|(items, blank)| format!("[{blank}{}]", items.join(&format!(",{blank}")))),
            members(inner),
        ]
    })
}

/// Text of a JSON object with the keys of the protocol; some keys occur twice.
pub fn object() -> impl Strategy<Value = String> {
    let typed = (select(&["reqType", "cmdType"]), select(WORDS))
        .prop_map(|(key, word)| format!("\"{key}\":\"{word}\""));
    let payload = prop_oneof![member(value()), list_member()];
    (vec(prop_oneof![1 => typed, 3 => payload], 0..8), blank(), blank()).prop_map(
        |(members, before, between)| format!("{before}{{{}}}", members.join(&format!("{between},{before}"))),
    )
}

/// A member with a value that is roughly valid.
fn list_member() -> impl Strategy<Value = String> {
    let words =
        || vec(prop_oneof![string(), number()], 0..5).prop_map(|items| format!("[{}]", items.join(",")));
    let instruction = || {
        let action = prop_oneof![
            select(&["4", "10", "17", "51", "52", "100", "200", "204", "800", "14"]).prop_map(str::to_owned),
            number(),
        ];
        (action, members(prop_oneof![number(), string()])).prop_map(|(action, rest)| {
            format!("{{\"action\":{action},\"oneshot\":\"1\",{}", join_tail(&rest))
        })
    };
    let set = members(prop_oneof![number(), string()])
        .prop_map(|point| format!("{{\"camID\":0,\"data\":[{point}]}}"));
    prop_oneof![
        (select(&["queryAddr", "queryData", "cmdData", "cmdReply"]), words())
            .prop_map(|(key, words)| format!("\"{key}\":{words}")),
        vec(instruction(), 0..3).prop_map(|list| format!("\"instructions\":[{}]", list.join(","))),
        vec(set, 0..3).prop_map(|list| format!("\"dsData\":[{}]", list.join(","))),
    ]
}

/// Returns the part of an object after its `{`, to be appended to other members. For an empty object it
/// returns a member and the `}`, because the comma before it needs a member.
fn join_tail(object: &str) -> String {
    match object.strip_prefix('{') {
        Some("}") | None => "\"m1\":0}".to_owned(),
        Some(rest) => rest.to_owned(),
    }
}

fn members(value: impl Strategy<Value = String>) -> impl Strategy<Value = String> {
    vec(member(value), 0..6).prop_map(|members| format!("{{{}}}", members.join(",")))
}

fn member(value: impl Strategy<Value = String>) -> impl Strategy<Value = String> {
    let key = prop_oneof![9 => (select(KEYS), any::<Option<Index>>()).prop_map(|(key, at)| quoted(key, at)), 1 => string()];
    (key, blank(), value).prop_map(|(key, blank, value)| format!("{key}{blank}:{blank}{value}"))
}

fn string() -> impl Strategy<Value = String> {
    prop_oneof![
        3 => (select(WORDS), any::<Option<Index>>()).prop_map(|(word, at)| quoted(word, at)),
        1 => any::<String>().prop_map(|text| serde_json::Value::from(text).to_string()),
        1 => "\"([a-z中\"]|\\\\[\"\\\\/bfnrt]|\\\\u[0-9a-fA-F]{4}|\\\\ud83d\\\\ude00){0,6}\"",
        1 => number().prop_map(|number| format!("\"{number}\"")),
    ]
}

/// The word in quotes; occasionally one character is an escape.
fn quoted(word: &str, escaped: Option<Index>) -> String {
    let Some(at) = escaped.filter(|_| !word.is_empty()).map(|index| index.index(word.len() * 8)) else {
        return format!("\"{word}\"");
    };
    let text: String = word
        .char_indices()
        .map(
            |(place, symbol)| {
                if place == at { format!("\\u{:04x}", u32::from(symbol)) } else { symbol.to_string() }
            },
        )
        .collect();
    format!("\"{text}\"")
}

fn number() -> impl Strategy<Value = String> {
    prop_oneof![
        5 => any::<i32>().prop_map(|number| number.to_string()),
        3 => "-?(0|[1-9][0-9]{0,8})\\.[0-9]{1,7}",
        1 => "-?(0|[1-9][0-9]{0,3})(\\.[0-9]{1,3})?[eE][+-]?[0-9]{1,3}",
        1 => any::<i64>().prop_map(|number| number.to_string()),
        1 => any::<u64>().prop_map(|number| number.to_string()),
        1 => "-?[1-9][0-9]{15,400}",
        1 => "0[0-9]{1,3}|[+.][0-9]|[0-9]\\.|-|1e|0x3F",
    ]
}

fn blank() -> impl Strategy<Value = String> {
    prop_oneof![6 => Just(String::new()), 1 => "[ \t\r\n]{1,3}"]
}

/// Bytes from an alphabet that often gives JSON.
pub fn json_like_bytes() -> impl Strategy<Value = Bytes> {
    vec(select(&b"{}[]\"\":,,\\-+.0123eEnulltruefalse abu/\x01\t\n\x80\xd6\x5c\xe4\xb8\xad"[..]), 0..60)
        .prop_map(Bytes)
}

/// One change to a frame.
#[derive(Clone, Debug)]
pub enum Mutation {
    Replace(Index, u8),
    Insert(Index, u8),
    Remove(Index, usize),
    Repeat(Index, usize),
    Cut(Index),
}

pub fn mutations() -> impl Strategy<Value = Vec<Mutation>> {
    let byte = || prop_oneof![select(&b"{}[]\":,\\ 019-.eu\0\n"[..]), any::<u8>()];
    let one = prop_oneof![
        (any::<Index>(), byte()).prop_map(|(at, byte)| Mutation::Replace(at, byte)),
        (any::<Index>(), byte()).prop_map(|(at, byte)| Mutation::Insert(at, byte)),
        (any::<Index>(), 1..12_usize).prop_map(|(at, length)| Mutation::Remove(at, length)),
        (any::<Index>(), 1..40_usize).prop_map(|(at, length)| Mutation::Repeat(at, length)),
        any::<Index>().prop_map(Mutation::Cut),
    ];
    vec(one, 1..4)
}

pub fn mutate(frame: &[u8], mutations: &[Mutation]) -> Vec<u8> {
    let mut bytes = frame.to_vec();
    for mutation in mutations.iter().filter(|_| !frame.is_empty()) {
        if bytes.is_empty() {
            break;
        }
        let length = bytes.len();
        let range = |at: &Index, count: usize| at.index(length)..(at.index(length) + count).min(length);
        match mutation {
            Mutation::Replace(at, byte) => bytes[at.index(length)] = *byte,
            Mutation::Insert(at, byte) => bytes.insert(at.index(length), *byte),
            Mutation::Remove(at, count) => drop(bytes.drain(range(at, *count))),
            Mutation::Repeat(at, count) => {
                let again = bytes[range(at, *count)].to_vec();
                bytes.splice(at.index(length)..at.index(length), again);
            }
            Mutation::Cut(at) => bytes.truncate(at.index(length)),
        }
    }
    bytes
}
