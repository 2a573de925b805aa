//! `Idempotency-Key`: the header by which a request that comes twice is recognised.

use axum::http::{HeaderMap, StatusCode};
use r6_api::Code;
use r6_http::Refusal;
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::caller::Caller;
use super::refusal;
use crate::problem::Problem;

/// The header.
const KEY_HEADER: &str = "idempotency-key";

/// The longest key, in characters: a UUID has 36.
const MAX_KEY: usize = 128;

/// The key of a request; `None` without the header.
pub fn key(headers: &HeaderMap) -> Result<Option<String>, Refusal> {
    let mut sent = headers.get_all(KEY_HEADER).iter();
    let key = match (sent.next(), sent.next()) {
        (None, _) => return Ok(None),
        (Some(key), None) => key.to_str().ok(),
        (Some(_), Some(_)) => None,
    };
    let is_visible = |key: &&str| key.bytes().all(|byte| byte.is_ascii_graphic());
    match key.filter(is_visible).filter(|key| (1..=MAX_KEY).contains(&key.len())) {
        Some(key) => Ok(Some(key.to_owned())),
        None => {
            Err(needed(format!("send one `Idempotency-Key` of 1 to {MAX_KEY} visible characters of ASCII")))
        }
    }
}

/// The key of a request that has to have one.
pub fn required(headers: &HeaderMap) -> Result<String, Refusal> {
    key(headers)?.ok_or_else(|| {
        let message = "send one `Idempotency-Key`, drawn anew for each run, such as a UUID: so a request that comes \
                       twice moves the arm once";
        needed(message.to_owned())
    })
}

fn needed(message: String) -> Refusal {
    Refusal::new(StatusCode::BAD_REQUEST, Code::NeedsIdempotencyKey, message)
}

/// SHA-256 of what a request asks for. How its JSON is written does not matter. The lease is not part of it:
/// a client that asks again after a while may have another one.
pub fn hash(asked: &impl Serialize) -> Result<[u8; 32], Refusal> {
    let text = serde_json::to_string(asked);
    let text = text.map_err(|error| refusal::of(Problem::new(Code::BadValue, error.to_string())))?;
    Ok(Sha256::digest(text).into())
}

/// Whose keys these are: names of users are never numbers.
pub fn owner(caller: &Caller) -> String {
    match caller.token() {
        Some(number) => format!("token {number}"),
        None => format!("user {}", caller.by().actor),
    }
}
