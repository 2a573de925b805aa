//! Messages: what is decoded says what serde_json reads in the same text, nothing of it is lost, the fast way and the careful
//! one agree, and what is encoded again says the same.
//!
//! An input is a frame.

mod again;
mod careful;
mod look;
mod members;
#[path = "../../r6-proto/tests/common/render.rs"]
#[allow(dead_code, clippy::redundant_pub_crate, reason = "shared with the tests of r6-proto")]
mod render;

pub use look::look_at_everything;

use r6_proto::{Decoder, MAX_DEPTH};
use serde_json::Value;

/// Tries one input.
pub fn run(bytes: &[u8]) {
    // Offsets are 32 bits wide and frames far shorter; longer inputs only cost time.
    if bytes.len() > 65_536 {
        return;
    }
    let mut decoder = Decoder::new();
    let decoded = decoder.decode(bytes);
    if let Ok(message) = &decoded {
        look_at_everything(message);
        again::check(message);
    }
    if let Ok(text) = std::str::from_utf8(bytes) {
        match (&decoded, serde_json::from_str::<Value>(text)) {
            (Ok(message), Ok(Value::Object(theirs))) => {
                assert!(depth(bytes) <= MAX_DEPTH + 2, "deeper than the limit");
                members::check(message, &theirs, text);
            }
            (Ok(_), theirs) => panic!("only we take it: serde_json says {theirs:?}"),
            (Err(error), Ok(Value::Object(_))) => {
                assert!(depth(bytes) > MAX_DEPTH, "only serde_json takes it: {error}");
            }
            (Err(error), _) => assert!(error.at <= bytes.len() && !error.to_string().is_empty()),
        }
    }
    drop(decoded);
    if bytes.is_ascii() {
        careful::check(&mut decoder, bytes);
    }
}

/// How deep JSON nests.
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
