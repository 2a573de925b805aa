//! Bodies: JSON within limits of length and time.

use std::time::Duration;

use axum::body::{Body, Bytes, to_bytes};
use axum::extract::{FromRequest, Request};
use axum::http::StatusCode;
use r6_api::Code;
use r6_api::gateway::LeaseKey;
use r6_http::body::{require_json, whole};
use r6_http::{Refusal, read_json};
use serde::de::DeserializeOwned;

use super::State;
use super::refusal::bad_value;
use crate::core::seat::{Denied, Key, Secret};
use crate::problem::Problem;

/// The longest body: a list of 101 registers takes about 1 KB.
pub const MAX_BYTES: usize = 16 * 1024;

/// The longest body with a program in it: a text of 256 KiB, each second character of which takes two bytes
/// in JSON, as quotes and ends of lines do. At the rate that the server reads at, it comes in 2 s.
pub const MAX_PROGRAM_BYTES: usize = 384 * 1024 + MAX_BYTES;

/// The longest reason, in bytes: a sentence.
const MAX_REASON: usize = 200;

/// How long a body may take. Clients send it in one piece.
const BODY_TIME: Duration = Duration::from_secs(5);

/// A body of JSON.
#[derive(Debug)]
pub struct Json<T>(pub T);

impl<T: DeserializeOwned> FromRequest<State> for Json<T> {
    type Rejection = Refusal;

    async fn from_request(request: Request, state: &State) -> Result<Self, Refusal> {
        read(request, state, MAX_BYTES).await.map(Self)
    }
}

/// A body of JSON with a program in it. Its route has to allow [`MAX_PROGRAM_BYTES`].
#[derive(Debug)]
pub struct WithProgram<T>(pub T);

impl<T: DeserializeOwned> FromRequest<State> for WithProgram<T> {
    type Rejection = Refusal;

    async fn from_request(request: Request, state: &State) -> Result<Self, Refusal> {
        read(request, state, MAX_PROGRAM_BYTES).await.map(Self)
    }
}

async fn read<T: DeserializeOwned>(request: Request, state: &State, most: usize) -> Result<T, Refusal> {
    require_json(request.headers())?;
    let body = tokio::time::timeout(BODY_TIME, Bytes::from_request(request, state)).await;
    let body = body.map_err(|_| {
        let message = "the body did not come in time";
        Refusal::new(StatusCode::REQUEST_TIMEOUT, Code::TooSlow, message)
    })?;
    read_json(&whole(body, most)?, Code::BadValue)
}

/// A whole body, for another gateway or from one. The routes have limits of their own.
pub async fn bytes(body: Body) -> Result<Bytes, Refusal> {
    let read = tokio::time::timeout(BODY_TIME, to_bytes(body, MAX_PROGRAM_BYTES)).await;
    let read = read.map_err(|_| {
        let message = "the body did not come in time";
        Refusal::new(StatusCode::REQUEST_TIMEOUT, Code::TooSlow, message)
    })?;
    read.map_err(|error| {
        let message = format!("the body broke off, or is longer than {MAX_PROGRAM_BYTES} bytes: {error}");
        Refusal::new(StatusCode::PAYLOAD_TOO_LARGE, Code::TooLong, message)
    })
}

/// The key of a lease. A secret of the wrong form is the secret of no lease.
pub fn key(of: &LeaseKey) -> Result<Key, Problem> {
    let mut secret = [0; 16];
    let mut digits = of.secret.bytes().map(|digit| char::from(digit).to_digit(16));
    let mut digit = || digits.next().flatten().and_then(|digit| u8::try_from(digit).ok());
    let fits = secret.iter_mut().all(|byte| match (digit(), digit()) {
        (Some(high), Some(low)) => {
            *byte = high << 4 | low;
            true
        }
        _ => false,
    });
    if fits && of.secret.len() == 32 {
        return Ok(Key { number: of.number, secret: Secret(secret) });
    }
    Err(Denied::NoLease.into())
}

/// Refuses a reason that is empty, too long for an entry of the audit log, or would break its lines.
pub fn check_reason(field: &str, because: &str) -> Result<(), Refusal> {
    if because.trim().is_empty() || because.len() > MAX_REASON || because.chars().any(char::is_control) {
        let wanted = format!("{field} is a reason of 1 to {MAX_REASON} bytes without control characters");
        return Err(bad_value(wanted));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_secret_is_32_hexadecimal_digits() {
        let key = |secret: &str| key(&LeaseKey { number: 1, secret: secret.to_owned() });
        assert_eq!(key("000102030405060708090a0b0c0d0eff").unwrap().secret.0[14..], [0x0e, 0xff]);
        for bad in ["", "00", &"0".repeat(31), &"0".repeat(33), &"g".repeat(32), &"é".repeat(16)] {
            assert!(key(bad).is_err(), "{bad}");
        }
    }
}
