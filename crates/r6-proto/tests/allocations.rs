//! Tests that decoding, reading and encoding a frame allocate nothing in the steady state.

use r6_proto::axis::AxisMask;
use r6_proto::client::{ClientSession, ClientSettings, Event};
use r6_proto::dialect::{Addressing, Dialect};
use r6_proto::frame::{FrameBuffer, Limits};
use r6_proto::message::instruction::{Action, BlendLevel, Coordinates, Instruction, Manner, Move};
use r6_proto::message::{Body, Message, Point};
use r6_proto::reply::{ReplyWriter, Verdict, encode_photo};
use r6_proto::request::CameraPoints;
use r6_proto::server::ServerSession;
use r6_proto::time::Instant;
use r6_proto::{Address, AxisIndex, Command, Decoder, Request, RequestType};
use r6_testkit::alloc::{CountingAllocator, allocations_during};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn addresses() -> Vec<Address> {
    let six = AxisIndex::ALL.into_iter().take(6);
    let rest =
        [Address::CurMode, Address::CurAlarm, Address::IsMoving, Address::Origin, Address::RemoteCmdLen];
    six.map(Address::Axis).chain(rest).chain([Address::CurCycle]).collect()
}

fn instructions(count: i32) -> Vec<Instruction> {
    let manner = Manner {
        mask: Some(AxisMask::SIX),
        speed: Some(20.0),
        delay: Some(0.0),
        smooth: BlendLevel::new(3),
        tool: Some(1),
        ..Manner::default()
    };
    let one = |number: i32| {
        let target = Coordinates::from_slice(&[0.5, 10.0, -20.0, f64::from(number), 30.125, 0.0]);
        Instruction { oneshot: true, action: Action::AxisMove(Move { target, manner }) }
    };
    (0..count).map(one).collect()
}

fn points() -> Vec<Point> {
    let one = |model_id| Point {
        model_id,
        x: 888.001,
        y: 1345.001,
        u: Some(0.0),
        angle: Some(123.123),
        ..Point::default()
    };
    (0..8).map(one).collect()
}

fn encoded(request: &Request<'_>) -> Vec<u8> {
    let mut out = Vec::new();
    let addressing = Addressing { pack_id: Some("1048576"), ..Addressing::default() };
    assert_eq!(request.encode(&addressing, &mut out), Ok(()));
    out
}

/// Counts the allocations of one encoding. The buffer has already held a frame of this length.
fn allocations_encoding(request: &Request<'_>) -> u64 {
    let mut out = encoded(request);
    let addressing = Addressing { pack_id: Some("1048576"), ..Addressing::default() };
    let length = out.len();
    let count = allocations_during(|| {
        out.clear();
        assert_eq!(request.encode(&addressing, &mut out), Ok(()));
    });
    assert_eq!(out.len(), length);
    count
}

/// Reads every value of the message as its number or address, as a user of the message does.
fn read(message: &Message<'_>) -> usize {
    match message.body {
        Body::Query(query) => query.resolved().filter(|(_, address)| address.is_ok()).count(),
        Body::QueryReply(reply) => reply.values.iter().filter_map(|value| value.number()).count(),
        Body::Command(words) => words.name().map_or(0, |_| 1 + words.arguments().len()),
        Body::CommandReply(reply) => usize::from(reply.command().is_some()),
        Body::AddRcc(list) => list.instructions.len(),
        Body::AddPoints(points) => points.sets().map(|(_, points)| points.len()).sum(),
        _ => 0,
    }
}

/// Counts the allocations of framing, decoding and reading the bytes. The first pass does not count.
fn allocations_decoding(frame: &[u8], values: usize) -> u64 {
    let mut frames = FrameBuffer::new(Limits::default());
    let mut decoder = Decoder::new();
    let mut pass = || {
        assert_eq!(frames.push(frame), frame.len());
        let frame = frames.next().and_then(Result::ok).map(|frame| frame.bytes).unwrap_or_default();
        let found = decoder.decode(frame).map(|message| read(&message));
        assert_eq!(found, Ok(values));
        assert!(frames.next().is_none());
    };
    pass();
    allocations_during(|| (0..3).for_each(|_| pass()))
}

#[test]
fn decoding_allocates_nothing() {
    let addresses = addresses();
    let (one, fifty, points) = (instructions(1), instructions(50), points());
    let cameras =
        [CameraPoints { cam_id: 0, points: &points[..5] }, CameraPoints { cam_id: 1, points: &points[5..] }];
    let values: Vec<String> = (0..12).map(|number| format!("\"{number}.563782\"")).collect();
    let reply = format!(
        r#"{{"dsID":"www.hc-system.com.RemoteMonitor","packID":"7","queryData":[{}],"reqType":"query"}}"#,
        values.join(",")
    );
    let verdict = br#"{"cmdReply":["AddRCC","ok"],"dsID":"d","packID":"7","reqType":"AddRCC"}"#;
    let cases = [
        ("query", encoded(&Request::Query(&addresses)), 12),
        ("reply", reply.into_bytes(), 12),
        ("verdict", verdict.to_vec(), 1),
        ("command", encoded(&Request::Command(&Command::ModifyGspd { percent: 5.0 })), 2),
        ("AddRCC of 1", encoded(&Request::AddRcc { empty_list: true, instructions: &one }), 1),
        ("AddRCC of 50", encoded(&Request::AddRcc { empty_list: true, instructions: &fifty }), 50),
        ("AddPoints of 8", encoded(&Request::AddPoints(&cameras)), 8),
    ];
    for (name, frame, values) in cases {
        assert_eq!(allocations_decoding(&frame, values), 0, "{name}");
    }
}

#[test]
fn encoding_requests_allocates_nothing() {
    let addresses = addresses();
    let (one, fifty, points) = (instructions(1), instructions(50), points());
    let cameras = [CameraPoints { cam_id: 0, points: &points }];
    let cases = [
        ("query", Request::Query(&addresses)),
        ("command", Request::Command(&Command::ModifyAccDec { acceleration: 0.25, deceleration: 0.3 })),
        ("heartbreak", Request::Heartbreak),
        ("AddRCC of 1", Request::AddRcc { empty_list: true, instructions: &one }),
        ("AddRCC of 50", Request::AddRcc { empty_list: false, instructions: &fifty }),
        ("AddPoints of 8", Request::AddPoints(&cameras)),
    ];
    for (name, request) in cases {
        assert_eq!(allocations_encoding(&request), 0, "{name}");
    }
}

#[test]
fn writing_replies_allocates_nothing() {
    let addresses = addresses();
    let request = encoded(&Request::Query(&addresses));
    let mut decoder = Decoder::new();
    let message = match decoder.decode(&request) {
        Ok(message) => message,
        Err(error) => panic!("{error}"),
    };
    let Body::Query(query) = message.body else { panic!("{message:?}") };
    for (name, dialect) in [("hc1", Dialect::HC1), ("r6", Dialect::R6), ("legacy", Dialect::LEGACY)] {
        let mut out = Vec::new();
        let mut write = || {
            out.clear();
            ReplyWriter::new(dialect, message.header, RequestType::Query).query(
                query.addresses,
                &mut out,
                |data| {
                    for axis in 0..6_u8 {
                        data.decimal(f64::from(axis) - 137.563_782);
                    }
                    [7, 0, 1, 1].into_iter().for_each(|value| data.integer(value));
                    data.flag(true);
                    data.text("HC-QC-RX-7.8.07-master-F5");
                },
            );
            ReplyWriter::new(dialect, message.header, RequestType::Command).verdict(
                "actionStop",
                Verdict::Ok,
                &mut out,
            );
            ReplyWriter::new(dialect, message.header, RequestType::AddPoints).verdict(
                "AddPoints",
                Verdict::Points(8),
                &mut out,
            );
            encode_photo(0, Some("7"), &mut out);
            out.len()
        };
        let length = write();
        assert!(length > 300, "{name}: {length}");
        assert_eq!(allocations_during(|| assert_eq!(write(), length)), 0, "{name}");
    }
}

/// The controller's side of a connection reads and answers a query, and refuses an AddRCC.
#[test]
fn a_server_session_allocates_nothing() {
    let addresses = addresses();
    let list = instructions(10);
    let mut input = encoded(&Request::Query(&addresses));
    input.extend(encoded(&Request::AddRcc { empty_list: true, instructions: &list }));
    let mut session = ServerSession::new(Limits::default());
    let mut pass = || {
        let (inbox, outbox) = session.split();
        assert_eq!(inbox.push(Instant::ORIGIN, &input), input.len());
        let mut sent = 0;
        while let Some(message) = inbox.next_message() {
            let Ok(message) = message else { panic!("it is understood") };
            outbox.send(|out| match message.body {
                Body::Query(query) => {
                    let writer = ReplyWriter::new(Dialect::HC1, message.header, RequestType::Query);
                    writer.query(query.addresses, out, |data| {
                        query.addresses.iter().for_each(|_| data.decimal(-137.563_782));
                    });
                }
                _ => {
                    let writer = ReplyWriter::new(Dialect::HC1, message.header, RequestType::AddRcc);
                    writer.verdict("AddRCC", Verdict::BareErr, out);
                }
            });
        }
        while let Some(frame) = outbox.poll_transmit(Instant::ORIGIN) {
            sent += frame.len();
        }
        sent
    };
    let sent = pass();
    assert!(sent > 500, "{sent}");
    pass();
    assert_eq!(allocations_during(|| (0..20).for_each(|_| assert_eq!(pass(), sent))), 0);
}

/// The PC's side of a connection sends a query and reads its reply.
#[test]
fn a_client_session_allocates_nothing() {
    let addresses = addresses();
    // Every `packID` here has six digits, so the reply can be changed in place.
    let settings = ClientSettings { first_pack_id: 100_000, ..ClientSettings::default() };
    let mut session = ClientSession::new(settings);
    let values: Vec<String> = addresses.iter().map(|_| "\"-137.563782\"".to_owned()).collect();
    let mut reply = format!(
        r#"{{"dsID":"www.hc-system.com.RemoteMonitor","packID":"100000","queryData":[{}],"reqType":"query"}}"#,
        values.join(",")
    )
    .into_bytes();
    let digits = 52..58;
    let mut number = 100_000_u32;
    let mut pass = || {
        let mut rest = number;
        for digit in reply[digits.clone()].iter_mut().rev() {
            *digit = b'0' + u8::try_from(rest % 10).unwrap_or(0);
            rest /= 10;
        }
        number += 1;
        assert!(session.send(Instant::ORIGIN, &Request::Query(&addresses)).is_ok());
        let bytes = session.poll_transmit().map_or(0, <[u8]>::len);
        session.transmitted(bytes);
        assert_eq!(session.handle_input(Instant::ORIGIN, &reply), reply.len());
        let Some(Event::Reply { message, .. }) = session.poll_event(Instant::ORIGIN) else {
            panic!("it is the reply")
        };
        assert_eq!(read(&message), addresses.len());
        assert!(session.poll_event(Instant::ORIGIN).is_none());
    };
    (0..3).for_each(|_| pass());
    assert_eq!(allocations_during(|| (0..20).for_each(|_| pass())), 0);
}
