//! Compares the fast path with the slow path. Blanks between tokens have no meaning, but the fast path stops
//! at them.

use r6_proto::message::Body;
use r6_proto::{Decoder, Message};

use super::render;

/// Reads the frame as it is, with a decoder that may have read it before, and again with a blank before each
/// token.
pub fn check(decoder: &mut Decoder, frame: &[u8]) {
    let spaced = spaced(frame);
    let mut careful = Decoder::new();
    match (decoder.decode(frame), careful.decode(&spaced)) {
        (Ok(fast), Ok(careful)) => {
            // A list or an object that is shown as on the wire contains the blanks.
            let shown = |message: &Message<'_>| told(message).replace(' ', "");
            assert_eq!(
                shown(&fast),
                shown(&careful),
                "the fast way reads another message: {}",
                frame.escape_ascii()
            );
        }
        (Err(fast), Err(careful)) => {
            let faults = [&fast.fault, &careful.fault].map(std::mem::discriminant);
            assert_eq!(faults[0], faults[1], "{fast} but {careful}");
        }
        (fast, careful) => {
            panic!("{:?} but {:?}", fast.map(|message| told(&message)), careful.map(|message| told(&message)))
        }
    }
}

/// Puts a blank before each token of the frame outside its strings.
///
/// Bytes after an open quote stay unchanged. In GBK, a quote or `\` can be the second byte of a character.
/// Such a frame is not plain, so the fast path reads neither form.
fn spaced(frame: &[u8]) -> Vec<u8> {
    let mut spaced = Vec::with_capacity(frame.len() * 2);
    let (mut in_string, mut escaped, mut in_word) = (false, false, false);
    for &byte in frame {
        let token = b"{}[],:\"".contains(&byte);
        if !in_string && (token || !in_word) {
            spaced.push(b' ');
        }
        in_word = !in_string && !token;
        if in_string {
            in_string = escaped || byte != b'"';
            escaped = !escaped && byte == b'\\';
        } else {
            in_string = byte == b'"';
        }
        spaced.push(byte);
    }
    spaced
}

/// Everything in a message except the positions.
fn told(message: &Message<'_>) -> String {
    let extras: Vec<_> = message
        .extras()
        .map(|extra| format!("{} {:?} {:?} {:?}", extra.place, extra.key, extra.value.text(), extra.kind))
        .collect();
    let header = message.header;
    let header =
        format!("{:?} {:?} {:?} {:?}", header.ds_id, header.type_key, header.type_word, header.pack_id);
    let numbers: Vec<_> = match message.body {
        Body::QueryReply(reply) => reply
            .values
            .iter()
            .map(|value| (value.number().map(f64::to_bits), value.integer(), value.flag()))
            .collect(),
        _ => Vec::new(),
    };
    let addresses: Vec<_> = match message.body {
        // The name of an unknown address is cut at a length, and blanks count.
        Body::Query(query) => query.resolved().map(|(_, address)| address.ok()).collect(),
        _ => Vec::new(),
    };
    if let Body::Rejected(rejection) = message.body {
        // The value found there is shown as on the wire, including blanks, and cut at a length.
        let error = rejection.error;
        return format!("{header} {:?} {} {} {extras:?}", rejection.request, error.path, error.wanted);
    }
    format!("{header} {} {numbers:?} {addresses:?} {extras:?}", render::message(message))
}
