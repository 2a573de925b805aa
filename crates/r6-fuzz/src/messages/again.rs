//! Writes the content of a frame again, strictly, and reads it again: it must be the same. Writing it a third
//! time must give the same bytes.

use crate::written::{same_command, same_instructions, same_points};
use r6_proto::dialect::Addressing;
use r6_proto::message::{Body, PhotoAnswer, Point};
use r6_proto::request::CameraPoints;
use r6_proto::{Address, Decoder, Message, Request};

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
    says_the_same(message, &read);
    let second = written(&read).expect("what was written can be written again");
    assert_eq!(first, second, "{} became {}", first.escape_ascii(), second.escape_ascii());
}

/// Compares the first message with the one read again, number by number.
fn says_the_same(first: &Message<'_>, again: &Message<'_>) {
    let frame = again.frame().escape_ascii();
    let pack_id = |message: &Message<'_>| message.header.pack_id.map(|value| value.text().into_owned());
    assert_eq!(pack_id(first), pack_id(again), "{frame}");
    match (&first.body, &again.body) {
        (Body::Query(first), Body::Query(again)) => {
            let asked = |(_, address): (_, Result<Address, _>)| address.ok();
            assert!(first.resolved().map(asked).eq(again.resolved().map(asked)), "{first:?} became {frame}");
        }
        (Body::Command(first), Body::Command(again)) => {
            let [first, again] = [first, again].map(|words| words.read().expect("it was written"));
            same_command(&first, &again);
        }
        (Body::AddRcc(first), Body::AddRcc(again)) => {
            assert_eq!(again.empty_list, Some(first.empty_list.unwrap_or(true)), "{frame}");
            assert!(!again.shape_2020, "the shape of 2020 is not written: {frame}");
            same_instructions(first.instructions, again.instructions);
        }
        (Body::AddPoints(first), Body::AddPoints(again)) => {
            assert_eq!(first.sets().len(), again.sets().len(), "{frame}");
            for ((cam_id, points), (again_id, again)) in first.sets().zip(again.sets()) {
                assert_eq!(cam_id, again_id, "{frame}");
                same_points(points, again);
            }
        }
        (Body::Heartbreak, Body::Heartbreak) => {}
        (Body::PhotoAnswer(first), Body::PhotoAnswer(again)) => assert_eq!(first, again, "{frame}"),
        (first, _) => panic!("what we write is another message: {first:?} became {frame}"),
    }
}

/// The strict form of a request; `None` if it is not a request, or if the wire cannot carry it.
fn written(message: &Message<'_>) -> Option<Vec<u8>> {
    let pack_id = message.header.pack_id.map(|value| value.text());
    let addressing = Addressing { pack_id: pack_id.as_deref(), ..Addressing::default() };
    let mut out = b"before".to_vec();
    let encoded = match &message.body {
        Body::Query(query) => {
            let addresses: Option<Vec<_>> = query.resolved().map(|(_, address)| address.ok()).collect();
            Request::Query(&addresses?).encode(&addressing, &mut out)
        }
        Body::Command(words) => Request::Command(&words.read().ok()?).encode(&addressing, &mut out),
        Body::AddRcc(list) => {
            let empty_list = list.empty_list.unwrap_or(true);
            Request::AddRcc { empty_list, instructions: list.instructions }.encode(&addressing, &mut out)
        }
        Body::AddPoints(points) => {
            let sets: Vec<(i64, &[Point])> = points.sets().collect();
            let cameras: Vec<_> =
                sets.iter().map(|(cam_id, points)| CameraPoints { cam_id: *cam_id, points }).collect();
            Request::AddPoints(&cameras).encode(&addressing, &mut out)
        }
        Body::Heartbreak => Request::Heartbreak.encode(&addressing, &mut out),
        Body::PhotoAnswer(PhotoAnswer { cam_id, ret }) => {
            let answer = PhotoAnswer { cam_id: *cam_id, ret: *ret };
            Request::PhotoAnswer(answer).encode(&addressing, &mut out)
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
