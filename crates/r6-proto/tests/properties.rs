//! Properties of every request, every stream and every byte string, beyond the frames that we thought of.

use std::sync::LazyLock;
use std::time::Duration;

use generators::{Owned, OwnedAddressing};
use json_text::Bytes;
use look::look_at_everything;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use r6_proto::client::{ClientSession, ClientSettings, Event};
use r6_proto::dialect::Addressing;
use r6_proto::frame::Limits;
use r6_proto::message::{Body, RequestType, TypeKey};
use r6_proto::request::CameraPoints;
use r6_proto::server::{InputError, ServerSession};
use r6_proto::time::Instant;
use r6_proto::value::Value as WireValue;
use r6_proto::{Decoder, Message, Request};
use r6_testkit::vector;
use serde_json::Value;

#[path = "common/generators.rs"]
mod generators;
#[path = "common/json_text.rs"]
mod json_text;
#[path = "common/look.rs"]
mod look;
#[path = "common/members.rs"]
mod members;
#[path = "common/render.rs"]
mod render;

/// The frames of all vectors, broken ones included.
static FRAMES: LazyLock<Vec<Bytes>> =
    LazyLock::new(|| vector::all().into_iter().map(|vector| Bytes(vector.frame)).collect());

/// The frames of all vectors that are JSON.
static WHOLE_FRAMES: LazyLock<Vec<Bytes>> = LazyLock::new(|| {
    vector::all()
        .into_iter()
        .filter(|vector| vector.error.is_none())
        .map(|vector| Bytes(vector.frame))
        .collect()
});

/// `PROPTEST_CASES` in the environment overrides this number of cases.
fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config(10_000))]

    #[test]
    fn every_request_is_decoded_as_it_was_encoded(
        request in generators::request(),
        addressing in generators::addressing(),
    ) {
        let bytes = encode(&request, &addressing);
        prop_assert!(serde_json::from_slice::<Value>(&bytes).is_ok());
        let mut decoder = Decoder::new();
        let message = decoder.decode(&bytes).map_err(|error| TestCaseError::fail(error.to_string()))?;
        check_header(&message, &request, &addressing)?;
        check_body(&message, &request, addressing.type_key)?;
        prop_assert_eq!(message.extras().len(), 0);
    }

    #[test]
    fn decimals_are_read_to_the_last_bit(
        text in "[+-]?([0-9]{1,18}|[0-9]{0,9}\\.[0-9]{0,9}|[0-9]{1,9}(\\.[0-9]{1,3})?e-?[0-9]{1,2}|-|\\.)",
    ) {
        let frame = format!(r#"{{"reqType":"query","queryData":["{text}"]}}"#);
        let mut decoder = Decoder::new();
        let message = decoder.decode(frame.as_bytes()).map_err(|error| TestCaseError::fail(error.to_string()))?;
        let Body::QueryReply(reply) = message.body else { return Err(TestCaseError::fail("no reply")) };
        let ours = reply.values.at(0).and_then(|value| value.number());
        prop_assert_eq!(ours.map(f64::to_bits), text.parse::<f64>().ok().map(f64::to_bits));
    }

    #[test]
    fn decoding_agrees_with_serde_json_on_generated_json(text in json_text::object()) {
        check_against_serde_json(text.as_bytes());
    }

    #[test]
    fn decoding_agrees_with_serde_json_on_mutated_frames(
        frame in select(FRAMES.as_slice()),
        mutations in json_text::mutations(),
    ) {
        check_against_serde_json(&json_text::mutate(&frame.0, &mutations));
    }

    #[test]
    fn decoding_agrees_with_serde_json_on_any_bytes(
        any in vec(any::<u8>(), 0..60).prop_map(Bytes),
        json_like in json_text::json_like_bytes(),
        other in json_text::value(),
    ) {
        let within = [b"{\"dsID\":".as_slice(), &json_like.0, b"}"].concat();
        for bytes in [any.0.as_slice(), &json_like.0, &within, other.as_bytes()] {
            check_against_serde_json(bytes);
        }
    }
}

fn encode(request: &Owned, addressing: &OwnedAddressing) -> Vec<u8> {
    let cameras: Vec<CameraPoints<'_>>;
    let request = match request {
        Owned::Query(addresses) => Request::Query(addresses),
        Owned::Command(command) => Request::Command(command),
        Owned::AddRcc { empty_list, instructions } => {
            Request::AddRcc { empty_list: *empty_list, instructions }
        }
        Owned::AddPoints(sets) => {
            cameras = sets.iter().map(|(cam_id, points)| CameraPoints { cam_id: *cam_id, points }).collect();
            Request::AddPoints(&cameras)
        }
        Owned::Heartbreak => Request::Heartbreak,
        Owned::PhotoAnswer(answer) => Request::PhotoAnswer(*answer),
    };
    let OwnedAddressing { ds_id, type_key, pack_id } = addressing;
    let addressing = Addressing { ds_id: *ds_id, type_key: *type_key, pack_id: pack_id.as_deref() };
    let mut bytes = Vec::new();
    request.encode(&addressing, &mut bytes).unwrap_or_else(|error| panic!("{error}"));
    bytes
}

fn check_header(
    message: &Message<'_>,
    request: &Owned,
    addressing: &OwnedAddressing,
) -> Result<(), TestCaseError> {
    let kind = match request {
        Owned::Query(_) => RequestType::Query,
        Owned::Command(_) => RequestType::Command,
        Owned::AddRcc { .. } => RequestType::AddRcc,
        Owned::AddPoints(_) => RequestType::AddPoints,
        Owned::Heartbreak => RequestType::Heartbreak,
        Owned::PhotoAnswer(_) => RequestType::Photo,
    };
    let text = |value: Option<WireValue<'_>>| value.map(|value| value.text().into_owned());
    let header = &message.header;
    prop_assert_eq!(text(header.ds_id), Some(addressing.ds_id.ds_id(kind).to_owned()));
    prop_assert_eq!(header.type_key, addressing.type_key);
    let word = (addressing.type_key != TypeKey::Absent).then(|| kind.word().to_owned());
    prop_assert_eq!(text(header.type_word), word);
    prop_assert_eq!(text(header.pack_id), addressing.pack_id.clone());
    Ok(())
}

fn check_body(message: &Message<'_>, request: &Owned, type_key: TypeKey) -> Result<(), TestCaseError> {
    match (&message.body, request) {
        (Body::Query(query), Owned::Query(addresses)) => {
            let decoded: Vec<_> = query.resolved().map(|(_, address)| address).collect();
            prop_assert_eq!(decoded, addresses.iter().copied().map(Ok).collect::<Vec<_>>());
        }
        (Body::Command(words), Owned::Command(command)) => {
            prop_assert_eq!(words.read(), Ok(command.clone()));
            prop_assert_eq!(words.name(), Some(command.name()));
        }
        (Body::AddRcc(list), Owned::AddRcc { empty_list, instructions }) => {
            prop_assert_eq!(list.empty_list, Some(*empty_list));
            prop_assert_eq!(list.instructions, instructions.as_slice());
            prop_assert!(!list.shape_2020);
        }
        (Body::AddPoints(points), Owned::AddPoints(sets)) => {
            let decoded: Vec<_> = points.sets().map(|(cam_id, points)| (cam_id, points.to_vec())).collect();
            prop_assert_eq!(&decoded, sets);
        }
        (Body::Heartbreak, Owned::Heartbreak) => {}
        (Body::PhotoAnswer(decoded), Owned::PhotoAnswer(answer)) => prop_assert_eq!(decoded, answer),
        // Only the type identifies these two.
        (Body::Unknown(_), Owned::Heartbreak | Owned::PhotoAnswer(_)) if type_key == TypeKey::Absent => {}
        (_, _) => prop_assert!(false, "{}", render::message(message)),
    }
    Ok(())
}

fn check_against_serde_json(bytes: &[u8]) {
    let mut decoder = Decoder::new();
    let decoded = decoder.decode(bytes);
    if let Ok(message) = &decoded {
        look_at_everything(message);
    }
    members::check(&decoded, bytes);
}

/// A stream of frames, some of them changed, with bytes between them.
fn hostile_stream() -> impl Strategy<Value = Bytes> {
    let between = select(&["", "\n", "\r\n", "\0", " ", "x", "{", "}"]);
    let piece = prop_oneof![
        3 => select(FRAMES.as_slice()),
        3 => (select(FRAMES.as_slice()), json_text::mutations())
            .prop_map(|(frame, changes)| Bytes(json_text::mutate(&frame.0, &changes))),
        1 => vec(any::<u8>(), 0..40).prop_map(Bytes),
        1 => json_text::object().prop_map(|text| Bytes(text.into_bytes())),
    ];
    vec((piece, between), 1..8).prop_map(|pieces| {
        Bytes(pieces.into_iter().flat_map(|(piece, end)| [&piece.0, end.as_bytes()].concat()).collect())
    })
}

/// Cuts the stream at these places.
fn split<'s>(stream: &'s [u8], cuts: &[Index]) -> Vec<&'s [u8]> {
    let mut places: Vec<usize> = cuts.iter().map(|cut| cut.index(stream.len() + 1)).collect();
    places.sort_unstable();
    places.push(stream.len());
    let mut from = 0;
    let pieces = places.into_iter().map(|to| &stream[std::mem::replace(&mut from, to)..to]);
    pieces.collect()
}

fn at(ms: u64) -> Instant {
    Instant::ORIGIN + Duration::from_millis(ms)
}

/// The results of an inbox for a stream in these pieces: rendered messages, and the texts of errors.
fn received(pieces: &[&[u8]], limits: Limits) -> Vec<Value> {
    let mut session = ServerSession::new(limits);
    let (inbox, _) = session.split();
    let mut out = Vec::new();
    for piece in pieces {
        let mut rest = *piece;
        loop {
            let taken = inbox.push(at(0), rest);
            rest = &rest[taken..];
            while let Some(message) = inbox.next_message() {
                out.push(match message {
                    Ok(message) => {
                        look_at_everything(&message);
                        render::message(&message)
                    }
                    Err(InputError::Frame(error)) => error.to_string().into(),
                    Err(InputError::Json(error)) => error.to_string().into(),
                });
            }
            if rest.is_empty() {
                break;
            }
        }
    }
    out
}

proptest! {
    #![proptest_config(config(2_500))]

    #[test]
    fn any_split_of_vector_frames_gives_the_same_messages(
        frames in vec((select(WHOLE_FRAMES.as_slice()), select(&["", "\n", "\r\n", "\0", " "])), 1..8),
        cuts in vec(any::<Index>(), 0..20),
    ) {
        let stream: Vec<u8> =
            frames.iter().flat_map(|(frame, end)| [&frame.0, end.as_bytes()].concat()).collect();
        let expected: Vec<Value> = frames
            .iter()
            .map(|(frame, _)| render::message(&Decoder::new().decode(&frame.0).unwrap()))
            .collect();
        prop_assert_eq!(&received(&split(&stream, &cuts), Limits::default()), &expected);
        let single: Vec<&[u8]> = stream.chunks(1).collect();
        prop_assert_eq!(&received(&single, Limits::default()), &expected);
    }

    #[test]
    fn no_split_of_a_hostile_stream_changes_or_breaks_anything(
        stream in hostile_stream(),
        cuts in vec(any::<Index>(), 0..20),
        max_frame_bytes in select(&[2_usize, 64, 2048, 65_536]),
    ) {
        let limits = Limits { max_frame_bytes, ..Limits::default() };
        let whole = received(&[&stream.0], limits);
        prop_assert_eq!(received(&split(&stream.0, &cuts), limits), whole);
    }

    #[test]
    fn no_input_breaks_a_client(
        stream in hostile_stream(),
        cuts in vec(any::<Index>(), 0..12),
        requests in vec(generators::request(), 0..5),
        steps in vec(0..3_000_u64, 14),
    ) {
        let mut session = ClientSession::new(ClientSettings { first_pack_id: 0, ..ClientSettings::default() });
        let mut waiting = 0_usize;
        for request in &requests {
            waiting += usize::from(send(&mut session, at(0), request));
        }
        let mut now = at(0);
        let mut settled = 0;
        for (piece, step) in split(&stream.0, &cuts).into_iter().zip(steps) {
            let mut rest = piece;
            loop {
                let taken = session.handle_input(now, rest);
                rest = &rest[taken..];
                while let Some(event) = session.poll_event(now) {
                    settled += usize::from(settles(&event));
                }
                if rest.is_empty() {
                    break;
                }
            }
            now += Duration::from_millis(step);
            session.handle_timeout(now);
        }
        session.handle_disconnect();
        while let Some(event) = session.poll_event(now) {
            settled += usize::from(settles(&event));
        }
        // Every request ends exactly once: with a reply, a timeout, or a loss.
        prop_assert_eq!(settled, waiting);
    }
}

/// Sends the request if possible. Returns whether it expects a reply.
fn send(session: &mut ClientSession, now: Instant, request: &Owned) -> bool {
    let sent = match request {
        Owned::Query(addresses) => session.send(now, &Request::Query(addresses)),
        Owned::Command(command) => session.send(now, &Request::Command(command)),
        Owned::AddRcc { empty_list, instructions } => {
            session.send(now, &Request::AddRcc { empty_list: *empty_list, instructions })
        }
        Owned::AddPoints(sets) => {
            let cameras: Vec<_> =
                sets.iter().map(|(cam_id, points)| CameraPoints { cam_id: *cam_id, points }).collect();
            session.send(now, &Request::AddPoints(&cameras))
        }
        Owned::Heartbreak => session.send(now, &Request::Heartbreak).and(Err(NO_REPLY)),
        Owned::PhotoAnswer(answer) => session.send(now, &Request::PhotoAnswer(*answer)).and(Err(NO_REPLY)),
    };
    sent.is_ok()
}

const NO_REPLY: r6_proto::client::SendError = r6_proto::client::SendError::TooManyInFlight { limit: 0 };

/// Whether the event ends a request. Reads everything in the event.
fn settles(event: &Event<'_>) -> bool {
    match event {
        Event::Reply { message, .. } => {
            look_at_everything(message);
            true
        }
        Event::Photo { message, .. } | Event::Stray { message, .. } => {
            look_at_everything(message);
            false
        }
        Event::TimedOut(_) | Event::Lost { .. } => true,
        Event::BadFrame(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
        Event::NotJson(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
        Event::OutOfStep => false,
    }
}
