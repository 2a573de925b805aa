//! Tests that the fast path and the slow path give the same messages, extras and errors for the same frames.
//!
//! Blanks between the tokens of JSON have no meaning, but the fast path stops at them. So every frame is read
//! twice: as it is, and with a blank before every token, which only the slow path reads. Both readings must
//! agree, except for positions.

use std::sync::LazyLock;

use json_text::Bytes;
use proptest::prelude::*;
use proptest::sample::select;
use r6_proto::Decoder;
use r6_proto::frame::{FrameBuffer, Limits};
use r6_proto::message::Body;
use r6_testkit::vector;

#[path = "common/generators.rs"]
#[allow(dead_code, reason = "shared with other tests")]
mod generators;
#[path = "common/json_text.rs"]
#[allow(dead_code, reason = "shared with other tests")]
mod json_text;
#[path = "common/render.rs"]
#[allow(dead_code, reason = "shared with other tests")]
mod render;
#[path = "common/two_ways.rs"]
mod two_ways;

static FRAMES: LazyLock<Vec<Bytes>> =
    LazyLock::new(|| vector::all().into_iter().map(|vector| Bytes(vector.frame)).collect());

#[test]
fn every_vector_is_read_alike_with_and_without_blanks() {
    let mut decoder = Decoder::new();
    for _ in 0..2 {
        for frame in FRAMES.iter().filter(|frame| frame.0.is_ascii()) {
            two_ways::check(&mut decoder, &frame.0);
        }
    }
}

/// Shipped controllers write `reqType` after the values, and the values change their length all the time.
#[test]
fn the_same_reply_with_longer_and_shorter_values_is_read_alike() {
    let frame = |values: &str| {
        format!(
            r#"{{"dsID":"www.hc-system.com.RemoteMonitor","packID":"7","queryAddr":["axis-0","axis-1"],"queryData":[{values}],"reqType":"query"}}"#
        )
    };
    let turned = |values: &str| {
        format!(
            r#"{{"packID":"7","queryData":[{values}],"queryAddr":["axis-0","axis-1"],"reqType":"query"}}"#
        )
    };
    let values = [
        r#""1.000","2.000""#,
        r#""-137.563","2""#,
        r#""1","2""#,
        r#""1","""#,
        r#""1","2","3""#,
        r#""1.000","2.000""#,
    ];
    let mut decoder = Decoder::new();
    for values in values {
        two_ways::check(&mut decoder, frame(values).as_bytes());
    }
    for values in values {
        two_ways::check(&mut decoder, turned(values).as_bytes());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 5_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_frames_are_read_alike(
        before in select(FRAMES.as_slice()),
        frame in select(FRAMES.as_slice()),
        mutations in json_text::mutations(),
    ) {
        let mutated = json_text::mutate(&frame.0, &mutations);
        if !mutated.is_ascii() {
            return Ok(());
        }
        let mut decoder = Decoder::new();
        drop(decoder.decode(&before.0));
        drop(decoder.decode(&frame.0));
        two_ways::check(&mut decoder, &mutated);
    }

    #[test]
    fn generated_json_is_read_alike(before in json_text::object(), text in json_text::object()) {
        if !text.is_ascii() {
            return Ok(());
        }
        let mut decoder = Decoder::new();
        drop(decoder.decode(before.as_bytes()));
        two_ways::check(&mut decoder, text.as_bytes());
    }

    #[test]
    fn members_of_lists_are_read_alike_whatever_their_values(
        value in "-?[0-9]{0,3}(\\.[0-9]{0,14})?([eE][0-9])?[,}]?|\"[0-9a-zA-Z.x/-]{0,20}\"|true|null|\\[\\]|\"\\\\u0034\"",
        key in select(&["X", "Y", "Z", "Angel", "Angle", "m0", "m1", "speed", "type", "unknown", "\\u0058"]),
    ) {
        let mut decoder = Decoder::new();
        for rest in [r#""X":1.5,"Y":-20,"Angel":0"#, r#""oneshot":"1","action":"4","m0":"0.000""#] {
            let points =
                |point: &str| format!(r#"{{"reqType":"AddPoints","dsData":[{{"camID":0,"data":[{point}]}}]}}"#);
            let list = |step: &str| format!(r#"{{"reqType":"AddRCC","emptyList":"1","instructions":[{step}]}}"#);
            let members = format!(r#"{{{rest},"{key}":{value}}},{{{rest}}}"#);
            let other_order = format!(r#"{{"{key}":{value},{rest}}}"#);
            for members in [&members, &other_order] {
                two_ways::check(&mut decoder, points(members).as_bytes());
                two_ways::check(&mut decoder, list(members).as_bytes());
            }
        }
    }

    #[test]
    fn numbers_are_read_as_the_standard_library_reads_them(
        text in "[+-]?[0-9]{0,17}(\\.[0-9]{0,17})?([eE]-?[0-9])?|[ -~]{0,20}",
    ) {
        let text = text.replace(['"', '\\'], "0");
        let frame = format!(r#"{{"queryData":["{text}"]}}"#);
        let mut decoder = Decoder::new();
        let message = decoder.decode(frame.as_bytes()).unwrap();
        let Body::QueryReply(reply) = message.body else { panic!("no reply") };
        let value = reply.values.at(0).unwrap();
        let text = text.trim();
        let plain = text.len() <= 64 && text.bytes().all(|byte| byte.is_ascii_digit() || b"+-.eE".contains(&byte));
        let number = text.parse::<f64>().ok().filter(|number| plain && number.is_finite());
        prop_assert_eq!(value.number().map(f64::to_bits), number.map(f64::to_bits));
        if let Ok(integer) = text.parse::<i64>() {
            prop_assert_eq!(value.integer(), Some(integer));
        }
    }

    #[test]
    fn streams_are_cut_alike_in_any_pieces(
        frames in prop::collection::vec((select(FRAMES.as_slice()), prop::option::of(json_text::mutations())), 1..6),
        piece in 1..200_usize,
    ) {
        let mut stream = Vec::new();
        for (frame, mutations) in &frames {
            match mutations {
                None => stream.extend_from_slice(&frame.0),
                Some(mutations) => stream.extend(json_text::mutate(&frame.0, mutations)),
            }
        }
        let careful = found(&stream, 1);
        prop_assert_eq!(&found(&stream, stream.len().max(1)), &careful);
        prop_assert_eq!(&found(&stream, piece), &careful);
    }
}

/// The frames and faults of a stream that arrives in pieces of this size.
fn found(stream: &[u8], piece: usize) -> Vec<String> {
    let mut buffer = FrameBuffer::new(Limits { max_frame_bytes: 4096, ..Limits::default() });
    let mut found = Vec::new();
    for mut bytes in stream.chunks(piece) {
        while !bytes.is_empty() {
            let taken = buffer.push(bytes);
            bytes = &bytes[taken..];
            while let Some(next) = buffer.next() {
                found.push(match next {
                    Ok(frame) => format!("{} {}", frame.stream_offset, frame.bytes.escape_ascii()),
                    Err(error) => format!("{error:?}"),
                });
            }
        }
    }
    found
}

/// A reply to a query. The fast path reads some of its values in one step, and others not.
fn reply(pack_id: Option<&str>, values: &[&str]) -> String {
    let number = pack_id.map(|id| format!("\"packID\":\"{id}\",")).unwrap_or_default();
    let values: Vec<_> = values.iter().map(|value| format!("\"{value}\"")).collect();
    format!(
        "{{\"dsID\":\"www.hc-system.com.RemoteMonitor\",{number}\"queryAddr\":[\"axis-0\",\"curMode\"],\
         \"queryData\":[{}],\"reqType\":\"query\"}}",
        values.join(",")
    )
}

#[test]
fn the_same_reply_with_other_numbers_and_values_is_read_alike() {
    let mut decoder = Decoder::new();
    let values: [&[&str]; 9] = [
        &["10.250", "7"],
        &["-2597.112793", "1"],
        &["", "7"],
        &["10.250"],
        &["10.250", "7", "1"],
        &["a text that is longer", "7"],
        &["1\\u0030", "7"],
        &["机", "7"],
        &["0.000", "2"],
    ];
    for pack_ids in
        [[Some("17"), Some("18")], [Some("99"), Some("100")], [None, None], [Some("17"), Some("x1")]]
    {
        for first in values {
            for second in values {
                let (first, second) = (reply(pack_ids[0], first), reply(pack_ids[1], second));
                drop(decoder.decode(first.as_bytes()));
                let again = format!("{:?}", decoder.decode(second.as_bytes()));
                assert_eq!(
                    again,
                    format!("{:?}", Decoder::new().decode(second.as_bytes())),
                    "{first} {second}"
                );
            }
        }
    }
}

#[test]
fn what_follows_the_same_reply_is_another_frame() {
    let frame = reply(Some("17"), &["10.250", "7"]);
    let mut decoder = Decoder::new();
    drop(decoder.decode(frame.as_bytes()));
    for longer in [format!("{frame} "), format!("{frame}{frame}"), frame[..frame.len() - 1].to_owned()] {
        let again = format!("{:?}", decoder.decode(longer.as_bytes()));
        assert_eq!(again, format!("{:?}", Decoder::new().decode(longer.as_bytes())));
        drop(decoder.decode(frame.as_bytes()));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 5_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// After any change to an earlier reply, the decoder reads it like a new decoder.
    #[test]
    fn a_changed_reply_is_read_as_if_it_were_the_first(mutations in json_text::mutations()) {
        let frame = reply(Some("17"), &["10.250", "7"]);
        let mutated = json_text::mutate(frame.as_bytes(), &mutations);
        let mut decoder = Decoder::new();
        drop(decoder.decode(frame.as_bytes()));
        let again = format!("{:?}", decoder.decode(&mutated));
        prop_assert_eq!(again, format!("{:?}", Decoder::new().decode(&mutated)));
    }
}
