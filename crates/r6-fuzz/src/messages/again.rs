//! What a frame says is written again, strictly, and read again: the same; and written a third time: the same bytes.

use r6_proto::dialect::Envelope;
use r6_proto::message::{Body, PhotoAnswer, Point};
use r6_proto::request::CameraPoints;
use r6_proto::{Decoder, Message, Request};

/// Checks the frame if it is a request that can be written.
pub fn check(message: &Message<'_>) {
    let Some(first) = written(message) else { return };
    assert!(
        serde_json::from_slice::<serde_json::Value>(&first).is_ok(),
        "what we write is no JSON: {}",
        first.escape_ascii()
    );
    let mut decoder = Decoder::new();
    let read = decoder.decode(&first).unwrap_or_else(|error| panic!("{}: {error}", first.escape_ascii()));
    assert_eq!(read.extras().len(), 0, "what we write has nothing odd in it: {}", first.escape_ascii());
    assert_eq!(
        std::mem::discriminant(&read.body),
        std::mem::discriminant(&message.body),
        "what we write is another message: {}",
        first.escape_ascii()
    );
    let second = written(&read).expect("what was written can be written again");
    assert_eq!(first, second, "{} became {}", first.escape_ascii(), second.escape_ascii());
}

/// The strict form of a request; `None` for what is none, or what the wire cannot carry.
fn written(message: &Message<'_>) -> Option<Vec<u8>> {
    let pack_id = message.header.pack_id.map(|value| value.text());
    let envelope = Envelope { pack_id: pack_id.as_deref(), ..Envelope::default() };
    let mut out = b"before".to_vec();
    let encoded = match &message.body {
        Body::Query(query) => {
            let addresses: Option<Vec<_>> = query.resolved().map(|(_, address)| address.ok()).collect();
            Request::Query(&addresses?).encode(&envelope, &mut out)
        }
        Body::Command(words) => Request::Command(&words.read().ok()?).encode(&envelope, &mut out),
        Body::AddRcc(list) => {
            let empty_list = list.empty_list.unwrap_or(true);
            Request::AddRcc { empty_list, instructions: list.instructions }.encode(&envelope, &mut out)
        }
        Body::AddPoints(points) => {
            let sets: Vec<(i64, &[Point])> = points.sets().collect();
            let cameras: Vec<_> =
                sets.iter().map(|(cam_id, points)| CameraPoints { cam_id: *cam_id, points }).collect();
            Request::AddPoints(&cameras).encode(&envelope, &mut out)
        }
        Body::Heartbreak => Request::Heartbreak.encode(&envelope, &mut out),
        Body::PhotoAnswer(PhotoAnswer { cam_id, ret }) => {
            let answer = PhotoAnswer { cam_id: *cam_id, ret: *ret };
            Request::PhotoAnswer(answer).encode(&envelope, &mut out)
        }
        Body::QueryReply(_)
        | Body::CommandReply(_)
        | Body::Photo(_)
        | Body::Unknown(_)
        | Body::Rejected(_) => return None,
    };
    if encoded.is_err() {
        assert_eq!(out, b"before", "a request that cannot be written leaves nothing behind");
        return None;
    }
    Some(out.split_off(b"before".len()))
}
