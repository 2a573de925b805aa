//! What holds for every request, every stream and every byte string, not only for the frames that we thought of.

use std::sync::LazyLock;
use std::time::Duration;

use generators::{Owned, OwnedEnvelope};
use json_text::Bytes;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use r6_proto::client::{ClientSession, ClientSettings, Event};
use r6_proto::dialect::Envelope;
use r6_proto::frame::Limits;
use r6_proto::message::{Body, RequestType, TypeKey};
use r6_proto::request::CameraPoints;
use r6_proto::server::{InputError, ServerSession};
use r6_proto::time::Instant;
use r6_proto::value::{Value as WireValue, Values};
use r6_proto::{AxisIndex, Decoder, MAX_DEPTH, Message, Reading, Request};
use r6_testkit::vector;
use serde_json::Value;

#[path = "common/generators.rs"]
mod generators;
#[path = "common/json_text.rs"]
mod json_text;
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

/// `PROPTEST_CASES` in the environment takes the place of this number of cases.
fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config(10_000))]

    #[test]
    fn every_request_is_decoded_as_it_was_encoded(
        request in generators::request(),
        envelope in generators::envelope(),
    ) {
        let bytes = encode(&request, &envelope);
        prop_assert!(serde_json::from_slice::<Value>(&bytes).is_ok());
        let mut decoder = Decoder::new();
        let message = decoder.decode(&bytes).map_err(|error| TestCaseError::fail(error.to_string()))?;
        check_header(&message, &request, &envelope)?;
        check_body(&message, &request, envelope.type_key)?;
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
        check_against_serde_json(text.as_bytes())?;
    }

    #[test]
    fn decoding_agrees_with_serde_json_on_mutated_frames(
        frame in select(FRAMES.as_slice()),
        mutations in json_text::mutations(),
    ) {
        check_against_serde_json(&json_text::mutate(&frame.0, &mutations))?;
    }

    #[test]
    fn decoding_agrees_with_serde_json_on_any_bytes(
        any in vec(any::<u8>(), 0..60).prop_map(Bytes),
        json_like in json_text::json_like_bytes(),
        other in json_text::value(),
    ) {
        let within = [b"{\"dsID\":".as_slice(), &json_like.0, b"}"].concat();
        for bytes in [any.0.as_slice(), &json_like.0, &within, other.as_bytes()] {
            check_against_serde_json(bytes)?;
        }
    }
}

fn encode(request: &Owned, envelope: &OwnedEnvelope) -> Vec<u8> {
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
    let OwnedEnvelope { ds_id, type_key, pack_id } = envelope;
    let envelope = Envelope { ds_id: *ds_id, type_key: *type_key, pack_id: pack_id.as_deref() };
    let mut bytes = Vec::new();
    request.encode(&envelope, &mut bytes).unwrap_or_else(|error| panic!("{error}"));
    bytes
}

fn check_header(
    message: &Message<'_>,
    request: &Owned,
    envelope: &OwnedEnvelope,
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
    prop_assert_eq!(text(header.ds_id), Some(envelope.ds_id.ds_id(kind).to_owned()));
    prop_assert_eq!(header.type_key, envelope.type_key);
    let word = (envelope.type_key != TypeKey::Absent).then(|| kind.word().to_owned());
    prop_assert_eq!(text(header.type_word), word);
    prop_assert_eq!(text(header.pack_id), envelope.pack_id.clone());
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
        // Nothing but the type tells these two from others.
        (Body::Unknown(_), Owned::Heartbreak | Owned::PhotoAnswer(_)) if type_key == TypeKey::Absent => {}
        (_, _) => prop_assert!(false, "{}", render::message(message)),
    }
    Ok(())
}

/// Where `serde_json` and the decoder have to agree, they do.
///
/// They differ where documented: bytes that are not UTF-8 may be GBK texts, and nesting has a limit of our own. The
/// object itself and a list that is read item by item are not counted, so it takes hold one or two levels later.
fn check_against_serde_json(bytes: &[u8]) -> Result<(), TestCaseError> {
    let mut decoder = Decoder::new();
    let decoded = decoder.decode(bytes);
    if let Ok(message) = &decoded {
        look_at_everything(message);
    }
    if std::str::from_utf8(bytes).is_err() {
        return Ok(());
    }
    match (decoded, serde_json::from_slice::<Value>(bytes)) {
        (Ok(message), Ok(Value::Object(members))) => {
            prop_assert!(depth(bytes) <= MAX_DEPTH + 2);
            check_members(&message, &members)
        }
        (Err(_), Err(_)) | (Err(_), Ok(_)) if !is_object(bytes) => Ok(()),
        (Err(_), Err(_)) => Ok(()),
        (Err(error), Ok(_)) => {
            prop_assert!(depth(bytes) > MAX_DEPTH, "only serde_json accepts: {error}");
            Ok(())
        }
        (Ok(_), other) => {
            // 128 levels are as deep as serde_json goes; nobody else may take more than it does.
            prop_assert!(false, "serde_json says {other:?}");
            Ok(())
        }
    }
}

fn is_object(bytes: &[u8]) -> bool {
    bytes.trim_ascii_start().first() == Some(&b'{')
}

/// How deep valid JSON nests.
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

type Members = serde_json::Map<String, Value>;

/// Every known key says the same on both sides.
fn check_members(message: &Message<'_>, members: &Members) -> Result<(), TestCaseError> {
    let header = &message.header;
    let type_value = members.get("reqType").or(members.get("cmdType"));
    check_value("dsID", header.ds_id, members.get("dsID"))?;
    check_value("type", header.type_word, type_value)?;
    check_value("packID", header.pack_id, members.get("packID"))?;
    let list = |key: &str, values: Values<'_>| {
        let items = members.get(key).and_then(Value::as_array);
        prop_assert_eq!(items.map_or(0, Vec::len), values.len(), "{}", key);
        for (ours, theirs) in values.iter().zip(items.into_iter().flatten()) {
            check_value(key, Some(ours), Some(theirs))?;
        }
        Ok(())
    };
    let is_type =
        |words: &[&str]| type_value.and_then(Value::as_str).is_none_or(|word| words.contains(&word));
    match &message.body {
        Body::Query(query) => {
            prop_assert!(is_type(&["query"]));
            list("queryAddr", query.addresses)?;
        }
        Body::QueryReply(reply) => {
            prop_assert!(is_type(&["query", "queryEcho"]));
            prop_assert_eq!(reply.addresses.is_some(), members.contains_key("queryAddr"));
            list("queryAddr", reply.addresses.unwrap_or(Values::EMPTY))?;
            list("queryData", reply.values)?;
        }
        Body::Command(command) => {
            prop_assert!(is_type(&["command"]));
            let words = members.get("cmdData").and_then(Value::as_array).unwrap();
            prop_assert_eq!(
                Some(command.word().into_owned()),
                words.first().and_then(Value::as_str).map(str::to_owned)
            );
            prop_assert_eq!(command.arguments().len() + 1, words.len());
            for (ours, theirs) in command.arguments().iter().zip(&words[1..]) {
                check_value("cmdData", Some(ours), Some(theirs))?;
            }
        }
        Body::CommandReply(reply) => list("cmdReply", reply.words())?,
        Body::Heartbreak => prop_assert!(is_type(&["heartbreak"])),
        Body::Photo(photo) => prop_assert_eq!(Some(photo.cam_id), members.get("camID").and_then(integer)),
        Body::PhotoAnswer(answer) => {
            prop_assert_eq!(Some(answer.cam_id), members.get("camID").and_then(integer));
            prop_assert_eq!(Some(answer.ret), members.get("ret").and_then(integer));
        }
        Body::AddPoints(points) => {
            let sets = members.get("dsData").and_then(Value::as_array).unwrap();
            prop_assert_eq!(points.sets().len(), sets.len());
            for ((cam_id, points), theirs) in points.sets().zip(sets) {
                prop_assert_eq!(Some(cam_id), integer(&theirs["camID"]));
                let theirs = theirs["data"].as_array().unwrap();
                prop_assert_eq!(points.len(), theirs.len());
                for (point, theirs) in points.iter().zip(theirs) {
                    prop_assert!(same(Some(point.x), number(&theirs["X"])), "{} {}", point.x, theirs);
                    prop_assert!(same(point.u, theirs.get("U").and_then(number)));
                }
            }
        }
        Body::AddRcc(list) if !list.shape_2020 => {
            let theirs = members.get("instructions").and_then(Value::as_array).unwrap();
            prop_assert_eq!(list.instructions.len(), theirs.len());
            for (ours, theirs) in list.instructions.iter().zip(theirs) {
                prop_assert_eq!(Some(ours.action.number()), integer(&theirs["action"]));
                if let r6_proto::message::Action::AxisMove(motion) = &ours.action {
                    for axis in AxisIndex::ALL {
                        let name = format!("m{}", axis.number());
                        prop_assert!(
                            same(motion.target.at(axis), theirs.get(&name).and_then(number)),
                            "{name}"
                        );
                    }
                    prop_assert!(same(motion.manner.speed, theirs.get("speed").and_then(number)));
                }
            }
        }
        Body::AddRcc(_) => prop_assert!(members.contains_key("dsData")),
        Body::Unknown(unknown) => {
            let known = RequestType::ALL.map(RequestType::word);
            let word = type_value.and_then(Value::as_str);
            prop_assert!(word.is_none_or(|word| !known.contains(&word)));
            prop_assert_eq!(unknown.word.is_some(), type_value.is_some());
        }
        Body::Rejected(rejection) => {
            prop_assert!(is_type(&[rejection.request.word(), "queryEcho", "cmdEcho", "AddrCC"]));
            prop_assert!(!rejection.error.path.is_empty());
        }
    }
    Ok(())
}

fn check_value(key: &str, ours: Option<WireValue<'_>>, theirs: Option<&Value>) -> Result<(), TestCaseError> {
    let (ours, theirs) = match (ours, theirs) {
        (None, None) => return Ok(()),
        (Some(ours), Some(theirs)) => (ours, theirs),
        (ours, theirs) => {
            prop_assert!(false, "{key}: {ours:?} and {theirs:?}");
            return Ok(());
        }
    };
    match theirs {
        Value::String(text) => {
            prop_assert!(ours.is_text());
            prop_assert_eq!(&*ours.text(), text.as_str(), "{}", key);
        }
        Value::Number(_) => {
            prop_assert!(ours.is_number());
            // Beyond 64 characters a number is no measurement: we do not read it.
            prop_assert!(
                ours.wire().len() > 64 || same(ours.number(), number(theirs)),
                "{key}: {ours:?} {theirs}"
            );
        }
        Value::Array(items) => {
            prop_assert!(ours.is_list());
            prop_assert_eq!(ours.items().count(), items.len());
            for (ours, theirs) in ours.items().zip(items) {
                check_value(key, Some(ours), Some(theirs))?;
            }
        }
        Value::Object(_) | Value::Bool(_) | Value::Null => {
            prop_assert_eq!(&serde_json::from_slice::<Value>(ours.wire()).unwrap(), theirs, "{}", key);
        }
    }
    Ok(())
}

/// A number, quoted or not, read by the standard library.
fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64(),
        Value::String(text) => text.trim_ascii().parse().ok(),
        Value::Null | Value::Bool(_) | Value::Array(_) | Value::Object(_) => None,
    }
}

fn integer(value: &Value) -> Option<i64> {
    let exact = match value {
        Value::Number(number) => number.as_i64(),
        Value::String(text) => text.trim_ascii().parse().ok(),
        Value::Null | Value::Bool(_) | Value::Array(_) | Value::Object(_) => None,
    };
    #[expect(clippy::cast_possible_truncation, reason = "only whole numbers within 2^53 are asked for")]
    exact.or_else(|| number(value).filter(|number| number.fract() == 0.0).map(|number| number as i64))
}

/// Equal but for the last digits: serde_json reads long decimals one unit off without its feature for exactness.
fn same(ours: Option<f64>, theirs: Option<f64>) -> bool {
    match (ours, theirs) {
        (None, None) => true,
        (Some(ours), Some(theirs)) => (ours - theirs).abs() <= 1e-15 * ours.abs().max(f64::MIN_POSITIVE),
        (_, _) => false,
    }
}

/// Calls everything that reads from a message; nothing of it may panic.
fn look_at_everything(message: &Message<'_>) {
    for extra in message.extras() {
        assert!(!format!("{extra}").is_empty());
    }
    let look = |values: Values<'_>| {
        for value in values.iter() {
            let _ = (
                value.number(),
                value.integer(),
                value.flag(),
                value.text(),
                value.offset(),
                format!("{value:?}"),
            );
            assert!(value.items().count() <= message.frame().len());
            for row in &r6_proto::ADDRESSES {
                let name = row.name.replace(
                    "-n",
                    row.indices.map_or("-n", |(first, _)| if first == 0 { "-0" } else { "-800" }),
                );
                let address = name.parse().unwrap_or_else(|error| panic!("{error}"));
                let _ = Reading::of(address, value).map(|reading| reading.to_string());
            }
        }
    };
    match &message.body {
        Body::Query(query) => {
            look(query.addresses);
            query.resolved().for_each(|(_, address)| drop(address.map_err(|error| error.to_string())));
        }
        Body::QueryReply(reply) => {
            look(reply.values);
            for asked in [0, 1, reply.values.len()] {
                assert_eq!(reply.aligned(asked).is_ok(), asked == reply.values.len());
            }
        }
        Body::Command(words) => {
            look(words.arguments());
            drop(words.read().map_err(|error| error.to_string()));
        }
        Body::CommandReply(reply) => {
            look(reply.words());
            let _ = (reply.command(), reply.outcome());
        }
        Body::AddRcc(list) => {
            for instruction in list.instructions {
                if let r6_proto::message::Action::Unknown(unknown) = &instruction.action {
                    list.unknown_fields(unknown).for_each(|(name, value)| {
                        drop((name.text().into_owned(), value.text().into_owned()));
                    });
                }
            }
        }
        Body::AddPoints(points) => {
            assert_eq!(points.sets().map(|(_, set)| set.len()).sum::<usize>(), points.len())
        }
        Body::Unknown(unknown) => assert!(!unknown.to_string().is_empty()),
        Body::Rejected(rejection) => assert!(!rejection.error.to_string().is_empty()),
        Body::Heartbreak | Body::Photo(_) | Body::PhotoAnswer(_) => {}
    }
}

/// A stream of frames, some of them changed, with what stands between them.
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

/// The stream cut into pieces at these places.
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

/// What an inbox makes of a stream in these pieces: rendered messages, and errors by their text.
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
        // Every request ends exactly once: answered, timed out or lost.
        prop_assert_eq!(settled, waiting);
    }
}

/// Sends what can be sent; whether a reply is due.
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

/// Whether the event ends a request; looks at all that it brings.
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
