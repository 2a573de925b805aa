//! Fuzzes messages. A decoded message agrees with what serde_json reads from the same text, and nothing is
//! lost. The fast path and the slow path agree. A message that is encoded again has the same content.
//!
//! An input is one frame, or two lines. With two lines, the first is read directly before the second, because
//! a repeated reply is read by its difference from the one before.

mod again;
#[path = "../../r6-proto/tests/common/look.rs"]
mod look;
#[path = "../../r6-proto/tests/common/members.rs"]
mod members;
#[path = "../../r6-proto/tests/common/render.rs"]
#[allow(dead_code, clippy::redundant_pub_crate, reason = "shared with the tests of r6-proto")]
mod render;
#[path = "../../r6-proto/tests/common/two_ways.rs"]
mod two_ways;

pub use look::look_at_everything;

use r6_proto::Decoder;

/// Runs one input.
pub fn run(bytes: &[u8]) {
    // Offsets are 32 bits wide, and frames are far shorter. Longer inputs only cost time.
    if bytes.len() > 65_536 {
        return;
    }
    let mut decoder = Decoder::new();
    if let Some(end) = bytes.iter().position(|byte| *byte == b'\n') {
        let (before, frame) = (&bytes[..end], &bytes[end + 1..]);
        drop(decoder.decode(before));
        if frame.is_ascii() {
            two_ways::check(&mut decoder, frame);
        }
    }
    let decoded = decoder.decode(bytes);
    if let Ok(message) = &decoded {
        look_at_everything(message);
        again::check(message);
    }
    members::check(&decoded, bytes);
    drop(decoded);
    if bytes.is_ascii() {
        two_ways::check(&mut decoder, bytes);
    }
}
