//! Tests that the reader finds the frames of any stream, in any pieces. Broken input costs one error and is
//! never delivered.

use proptest::prelude::*;
use proptest::sample::select;
use r6_proto::frame::{FrameBuffer, FrameError, FrameFault, Limits, READ_ROOM};
use r6_testkit::alloc::{CountingAllocator, allocations_during};
use serde_json::Value;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

#[derive(Clone, Debug, PartialEq, Eq)]
enum Event {
    Frame(String, u64),
    Fault(FrameError),
}

/// The bytes as text if they are UTF-8; otherwise with escapes.
fn readable(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap_or_else(|_| bytes.escape_ascii().to_string())
}

/// Takes out all frames and errors.
fn drain(buffer: &mut FrameBuffer, events: &mut Vec<Event>) {
    while let Some(next) = buffer.next() {
        events.push(match next {
            Ok(frame) => Event::Frame(readable(frame.bytes), frame.stream_offset),
            Err(error) => Event::Fault(error),
        });
    }
}

/// Pushes all bytes, and takes out frames whenever the buffer is full and at the end.
fn feed(buffer: &mut FrameBuffer, mut bytes: &[u8], events: &mut Vec<Event>) {
    loop {
        let taken = buffer.push(bytes);
        drain(buffer, events);
        bytes = &bytes[taken..];
        if bytes.is_empty() {
            return;
        }
        assert!(taken > 0, "a drained buffer takes bytes");
    }
}

/// The events of a stream that arrives in pieces of these lengths, repeated in turn.
fn read(stream: &[u8], limits: Limits, pieces: &[usize]) -> Vec<Event> {
    let mut buffer = FrameBuffer::new(limits);
    let mut events = Vec::new();
    let mut rest = stream;
    for piece in pieces.iter().cycle() {
        let (now, later) = rest.split_at(rest.len().min(*piece));
        feed(&mut buffer, now, &mut events);
        rest = later;
        if rest.is_empty() {
            break;
        }
    }
    events.extend(buffer.abandon_partial().map(Event::Fault));
    events
}

/// The frames and faults of a stream that arrives in one piece, without the offsets.
fn outcome(stream: &[u8]) -> (Vec<String>, Vec<FrameFault>) {
    let events = read(stream, Limits::default(), &[stream.len().max(1)]);
    assert_eq!(events, read(stream, Limits::default(), &[1]), "{}", stream.escape_ascii());
    let (mut frames, mut faults) = (Vec::new(), Vec::new());
    for event in events {
        match event {
            Event::Frame(frame, _) => frames.push(frame),
            Event::Fault(error) => faults.push(error.fault),
        }
    }
    (frames, faults)
}

/// Any JSON value.
fn json() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i32>().prop_map(Value::from),
        "\\PC{0,12}".prop_map(Value::from),
        select(vec!["", "\\", "\"", "}{", "\\\"{[", "计数器", "\u{0}\n\t", "😀"]).prop_map(Value::from),
    ];
    leaf.prop_recursive(4, 40, 5, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
            prop::collection::hash_map("\\PC{0,6}", inner, 0..5)
                .prop_map(|members| Value::Object(members.into_iter().collect())),
        ]
    })
}

/// A JSON object, compact or indented.
fn object() -> impl Strategy<Value = String> {
    (prop::collection::hash_map("\\PC{0,6}", json(), 0..5), any::<bool>()).prop_map(|(members, indented)| {
        let object = Value::Object(members.into_iter().collect());
        if indented { format!("{object:#}") } else { object.to_string() }
    })
}

fn depth(value: &Value) -> usize {
    match value {
        Value::Array(items) => 1 + items.iter().map(depth).max().unwrap_or(0),
        Value::Object(members) => 1 + members.values().map(depth).max().unwrap_or(0),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => 0,
    }
}

fn blanks() -> impl Strategy<Value = Vec<u8>> {
    let blank = select(vec![&b" "[..], b"\t", b"\r\n", b"\n", b"\0", b"\xEF\xBB\xBF"]);
    prop::collection::vec(blank, 0..3).prop_map(|blanks| blanks.concat())
}

/// A stream of frames, half frames and bytes that have a meaning in a frame.
fn hostile() -> impl Strategy<Value = Vec<u8>> {
    const PIECES: [&[u8]; 16] = [
        b"{\"a\":1}",
        b"{\"a\":[{\"b\":\"c\"},{}]}",
        b"{\"a\":",
        b"{\"a\":\"b",
        b"[[[[",
        b"]]}}",
        b"\"",
        b"\\",
        b"\\\"",
        b"\x81\\",
        b"\xE4\xB8\xAD",
        b"\xEF\xBB",
        b"\xFF",
        b"\0",
        b"\r\n",
        b"GET / HTTP/1.1 ",
    ];
    let piece = prop_oneof![
        3 => select(PIECES.to_vec()).prop_map(<[u8]>::to_vec),
        3 => select(b"{}[]\",:a1 ".to_vec()).prop_map(|byte| vec![byte]),
        1 => object().prop_map(String::into_bytes),
        1 => any::<u8>().prop_map(|byte| vec![byte]),
    ];
    prop::collection::vec(piece, 0..40).prop_map(|pieces| pieces.concat())
}

fn limits() -> impl Strategy<Value = Limits> {
    (select(vec![2, 16, 40, 200, 65_536]), select(vec![1, 2, 3, 32, 64]))
        .prop_map(|(max_frame_bytes, max_depth)| Limits { max_frame_bytes, max_depth })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1000) })]

    #[test]
    fn any_split_gives_the_same_frames_and_faults(
        stream in hostile(), limits in limits(), pieces in prop::collection::vec(1_usize..60, 1..6),
    ) {
        let whole = read(&stream, limits, &[stream.len().max(1)]);
        prop_assert_eq!(&read(&stream, limits, &pieces), &whole);
        prop_assert_eq!(&read(&stream, limits, &[1]), &whole);
    }

    #[test]
    fn only_whole_balanced_frames_are_delivered(stream in hostile(), limits in limits()) {
        let mut buffer = FrameBuffer::new(limits);
        let mut rest = stream.as_slice();
        let mut end_of_last = 0;
        while !rest.is_empty() {
            let taken = buffer.push(rest);
            rest = &rest[taken..];
            while let Some(next) = buffer.next() {
                let Ok(frame) = next else { continue };
                let start = usize::try_from(frame.stream_offset).unwrap();
                prop_assert!(start >= end_of_last, "no byte is delivered twice");
                end_of_last = start + frame.bytes.len();
                prop_assert_eq!(frame.bytes, &stream[start..end_of_last]);
                prop_assert!(frame.bytes.len() <= limits.max_frame_bytes);
                prop_assert_eq!((frame.bytes.first(), frame.bytes.last()), (Some(&b'{'), Some(&b'}')));
                if let Ok(text) = std::str::from_utf8(frame.bytes) {
                    prop_assert!(deepest_if_balanced(text).is_some_and(|deepest| deepest <= limits.max_depth), "{text}");
                }
            }
        }
    }

    #[test]
    fn objects_with_blanks_between_are_recovered_exactly(
        objects in prop::collection::vec((blanks(), object()), 0..12), piece in 1_usize..100,
    ) {
        let mut stream = Vec::new();
        let mut expected = Vec::new();
        for (blanks, object) in &objects {
            stream.extend_from_slice(blanks);
            expected.push(Event::Frame(object.clone(), stream.len() as u64));
            stream.extend_from_slice(object.as_bytes());
        }
        prop_assert_eq!(read(&stream, Limits::default(), &[piece]), expected);
    }

    #[test]
    fn an_object_beyond_a_limit_is_one_error_and_nothing_in_it_is_delivered(
        objects in prop::collection::vec(object(), 0..12), limits in limits(),
    ) {
        let stream = objects.concat();
        let mut offset = 0;
        let mut expected = Vec::new();
        for object in &objects {
            let deepest = depth(&serde_json::from_str(object).unwrap());
            let within = object.len() <= limits.max_frame_bytes && deepest <= limits.max_depth;
            expected.push((offset, within.then(|| object.clone())));
            offset += object.len() as u64;
        }
        let found: Vec<_> = read(stream.as_bytes(), limits, &[7]).into_iter().map(|event| match event {
            Event::Frame(frame, offset) => (offset, Some(frame)),
            Event::Fault(error) => {
                assert!(matches!(error.fault, FrameFault::TooLarge { .. } | FrameFault::TooDeep { .. }), "{error}");
                (error.stream_offset, None)
            }
        }).collect();
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn a_byte_that_was_lost_added_or_changed_costs_at_most_two_frames(
        numbers in prop::collection::vec(0_usize..REALISTIC.len(), 5..9),
        at in any::<prop::sample::Index>(), kind in 0..3, byte in select(b"\"\\{}[]:,x1 \n\0\xE4\x81".to_vec()),
    ) {
        let frames: Vec<&str> = numbers.iter().map(|number| REALISTIC[*number]).collect();
        let mut stream = frames.concat().into_bytes();
        let at = at.index(stream.len());
        match kind {
            0 => drop(stream.remove(at)),
            1 => stream.insert(at, byte),
            _ => stream[at] = byte,
        }
        let mut end = 0;
        let hit = frames.iter().take_while(|frame| { end += frame.len(); end <= at }).count();
        let delivered: Vec<String> = read(&stream, Limits::default(), &[100]).into_iter().filter_map(|event| match event {
            Event::Frame(frame, _) if serde_json::from_str::<Value>(&frame).is_ok() => Some(frame),
            Event::Frame(..) | Event::Fault(_) => None,
        }).collect();
        prop_assert!(delivered.len() >= frames.len() - 2, "{delivered:#?}");
        prop_assert_eq!(&delivered[..hit], &frames[..hit]);
        let behind = &frames[frames.len().min(hit + 2)..];
        prop_assert_eq!(&delivered[delivered.len() - behind.len()..], behind);
    }
}

const REALISTIC: [&str; 5] = [
    r#"{"dsID":"www.hc-system.com.RemoteMonitor","packID":"0","queryAddr":["version","curMold"],"queryData":["HC-QC-RX-7.8.07-master-F5"],"reqType":"query"}"#,
    r#"{"cmdReply":["modifyCounter","ok"],"dsID":"www.hc-system.com.RemoteMonitor","packID":"20","reqType":"command"}"#,
    r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0}"#,
    r#"{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","emptyList":"1","instructions":[{"oneshot":"1","action":"4","m0":"0.000","ckStatus":"0x3F"},{"oneshot":"1","action":"800","cnt_id":"0"}]}"#,
    r#"{"dsID":"www.hc-system.com.cam","reqType":"AddPoints","dsData":[{"camID":0,"data":[{"ModelID":0,"X":888.001},{"ModelID":1,"X":-1.5}]}]}"#,
];

/// The depth of a text with balanced brackets, ignoring strings; `None` if they are not balanced.
fn deepest_if_balanced(text: &str) -> Option<usize> {
    let mut open = Vec::new();
    let mut deepest = 0;
    let mut characters = text.chars();
    while let Some(character) = characters.next() {
        match character {
            '"' => {
                while match characters.next()? {
                    '\\' => characters.next().is_some(),
                    character => character != '"',
                } {}
            }
            '{' => open.push('}'),
            '[' => open.push(']'),
            '}' | ']' if open.pop() != Some(character) => return None,
            _ => {}
        }
        deepest = deepest.max(open.len());
    }
    open.is_empty().then_some(deepest)
}

#[test]
fn a_broken_frame_costs_one_error_and_the_next_frame_is_found() {
    let good = r#"{"b":[2,{"c":"}"}]}"#;
    let cases: [(&[u8], FrameFault); 20] = [
        (b"GET / HTTP/1.1\r\nHost: ", FrameFault::Garbage),
        (b"}", FrameFault::Garbage),
        (b"\xEF\xBB", FrameFault::Garbage),
        // A list is not a frame, and neither are the objects in it. The same holds for the objects of a frame
        // whose beginning is missing.
        (br#"[{"x":1},{"y":2}]"#, FrameFault::Garbage),
        (br#""instructions":[{"x":1},{"y":2}]}"#, FrameFault::Garbage),
        (br#"{"a":[1}"#, FrameFault::MismatchedBracket { expected: ']', found: '}' }),
        (br#"{"a":1]"#, FrameFault::MismatchedBracket { expected: '}', found: ']' }),
        (br#"{"a":1]}"#, FrameFault::MismatchedBracket { expected: '}', found: ']' }),
        (br#"{"a":[1},"x":{"y":1}]}"#, FrameFault::MismatchedBracket { expected: ']', found: '}' }),
        (
            br#"{"a":[{"x":1],"x":{"y":"]"},"z":[[{}]]}"#,
            FrameFault::MismatchedBracket { expected: '}', found: ']' },
        ),
        (b"{\"a\":\"cut\n", FrameFault::ControlByteInString { byte: b'\n' }),
        (b"{\"a\":\"cut:\r\n", FrameFault::ControlByteInString { byte: b'\r' }),
        (b"{\"a\":\"cut,\0", FrameFault::ControlByteInString { byte: 0 }),
        (b"{\"a\":\"\\\0 some more ", FrameFault::ControlByteInString { byte: 0 }),
        (
            b"{\"a\":\"tab\tbed\",\"x\":[{\"y\":1}, {\"y\":2}]}",
            FrameFault::ControlByteInString { byte: b'\t' },
        ),
        (br#"{"a":1"#, FrameFault::ObjectWhereNoneCanStand),
        (b"{\"a\":\r\n\0", FrameFault::ObjectWhereNoneCanStand),
        (b"{ ", FrameFault::ObjectWhereNoneCanStand),
        (br#"{"a":[{"x":"y"}"#, FrameFault::ObjectWhereNoneCanStand),
        (br#"{"a":x","b":"c","d":[{"x":1}]}"#, FrameFault::TextBehindString { found: 'b' }),
    ];
    for (broken, fault) in cases {
        let stream = [broken, good.as_bytes(), b"\r\n", good.as_bytes()].concat();
        let (frames, faults) = outcome(&stream);
        assert_eq!(faults, [fault], "{}", stream.escape_ascii());
        assert_eq!(frames, [good, good], "{}", stream.escape_ascii());
    }
}

#[test]
fn a_frame_cut_inside_a_string_costs_the_frame_behind_it_too() {
    let (frames, faults) = outcome(br#"{"a":"cu{"b":1}{"c":1}{"d":1}"#);
    assert_eq!(faults, [FrameFault::TextBehindString { found: 'b' }]);
    assert_eq!(frames, [r#"{"c":1}"#, r#"{"d":1}"#]);
}

#[test]
fn what_the_manual_misprints_is_left_to_the_decoder() {
    for frame in
        [r#"{"cmdData":["cmd", "d1","d2"...]}"#, r#"{"ckStatus", "speed":"80.0",}"#, r#"{"a":"b" "c":"d"}"#]
    {
        assert_eq!(outcome(frame.as_bytes()), (vec![frame.to_owned()], vec![]));
    }
}

#[test]
fn braces_quotes_and_backslashes_of_gbk_are_text() {
    // 乗 is 81 5C: its second byte looks like a backslash that escapes the closing quote.
    for body in [
        &b"\x81\x5C"[..],
        b"\x81\x7B",
        b"\x81\x7D",
        b"\x81\x5B\x81\x5D",
        b"\xBC\xC6\xCA\xFD\x81\x5C\\\"\x81\x5C",
    ] {
        let frame = [b"{\"machineName\":\"", body, b"\",\"a\":[{\"b\":\"\x81\x5C\"}]}"].concat();
        let (frames, faults) = outcome(&[frame.as_slice(), b"{\"c\":1}"].concat());
        assert_eq!(faults, []);
        assert_eq!(frames, [readable(&frame), r#"{"c":1}"#.to_owned()]);
    }
}

#[test]
fn utf8_is_told_from_gbk() {
    // 中 is E4 B8 AD. Read as GBK, its last byte would form a pair with the `\`, and the quote would close the
    // string.
    let frame = r#"{"a":"中\"}中\\"}"#;
    let (frames, faults) = outcome([frame, frame].concat().as_bytes());
    assert_eq!(faults, []);
    assert_eq!(frames, [frame, frame]);
}

#[test]
fn the_limits_are_exact() {
    let limits = Limits { max_frame_bytes: 20, max_depth: 3 };
    let of_length = |length: usize| format!("{{\"a\":\"{}\"}}", "x".repeat(length - 8));
    let of_depth = |depth: usize| format!("{{\"a\":{}{}}}", "[".repeat(depth - 1), "]".repeat(depth - 1));
    for piece in [1, 5, 100] {
        let stream = of_length(20) + &of_length(21) + &of_depth(3) + &of_depth(4) + "{}";
        let events = read(stream.as_bytes(), limits, &[piece]);
        assert_eq!(events[0], Event::Frame(of_length(20), 0));
        let Event::Fault(too_large) = &events[1] else { panic!("{events:?}") };
        assert_eq!((too_large.stream_offset, too_large.fault_offset), (20, 40));
        assert_eq!(too_large.fault, FrameFault::TooLarge { limit: 20 });
        assert_eq!(events[2], Event::Frame(of_depth(3), 41));
        let Event::Fault(too_deep) = &events[3] else { panic!("{events:?}") };
        assert_eq!((too_deep.stream_offset, too_deep.fault_offset), (51, 58));
        assert_eq!(too_deep.fault, FrameFault::TooDeep { limit: 3 });
        assert_eq!(events[4], Event::Frame("{}".to_owned(), 63));
        assert_eq!(events.len(), 5);
    }
}

#[test]
fn a_frame_of_any_depth_is_skipped_to_its_own_end() {
    let deep = format!("{}{}{}{}", "{\"a\":".repeat(40), "[".repeat(60), "]".repeat(60), "}".repeat(40));
    // The garbage after the frame is reported separately, so the end of the frame was found.
    let (frames, faults) = outcome(format!("{deep}oops{{\"b\":1}}").as_bytes());
    assert_eq!(faults, [FrameFault::TooDeep { limit: 32 }, FrameFault::Garbage]);
    assert_eq!(frames, [r#"{"b":1}"#]);
}

#[test]
fn memory_is_bounded_whatever_comes() {
    let limits = Limits { max_frame_bytes: 1000, max_depth: 8 };
    let endless: [&[u8]; 6] =
        [b"x", b"{\"a\":[", b"[", b"{\"a\":\"xxxxxxxxxxxxx", b"{\"a\":1}", b"\xEF\xBB\xBF\0 "];
    for unit in endless {
        let mut buffer = FrameBuffer::new(limits);
        let mut untaken = 0;
        for _ in 0..5000 {
            untaken += unit.len() - buffer.push(unit);
        }
        assert!(buffer.spare_mut().len() < READ_ROOM, "nothing is dropped before it is taken out");
        drain(&mut buffer, &mut Vec::new());
        assert!(untaken > 0 || unit.len() * 5000 <= 1000 + READ_ROOM);
        for _ in 0..5000 {
            assert_eq!(buffer.push(unit), unit.len());
            while buffer.next().is_some() {}
            let room = buffer.spare_mut().len();
            assert!((READ_ROOM..=1000 + READ_ROOM).contains(&room), "{room}");
        }
    }
}

#[test]
fn the_work_is_linear_in_the_bytes() {
    let streams: [Vec<u8>; 7] = [
        REALISTIC.concat().repeat(100).into_bytes(),
        [b"{\"a\":\"", "中\\\"".repeat(12_000).as_bytes(), b"\xFF\"}"].concat(),
        [b"{\"a\":\"", "x".repeat(60_000).as_bytes(), b"\"}"].concat().repeat(4),
        b"{".repeat(60_000),
        [b"{\"a\":".as_slice(), &b"[".repeat(60_000)].concat(),
        b"{\"a\":\n\n\n\n\n\n\n{\"a\" ".repeat(4_000),
        b"x{\xEF\xBB{".repeat(10_000),
    ];
    for stream in streams {
        for piece in [1, 3, 100, 4096, stream.len()] {
            let mut buffer = FrameBuffer::new(Limits::default());
            for bytes in stream.chunks(piece) {
                feed(&mut buffer, bytes, &mut Vec::new());
            }
            let looks = buffer.examined();
            let length = stream.len() as u64;
            assert!(
                looks >= length && looks <= 2 * length,
                "{looks} looks at {length} bytes in pieces of {piece}"
            );
        }
    }
}

#[test]
fn a_reader_that_takes_one_frame_at_a_time_does_not_make_it_move_all() {
    let frame = b"{\"a\":1}";
    let mut buffer = FrameBuffer::new(Limits::default());
    let fits = |buffer: &mut FrameBuffer| buffer.spare_mut().len() >= frame.len();
    while fits(&mut buffer) {
        assert_eq!(buffer.push(frame), frame.len());
    }
    let before = buffer.examined();
    for _ in 0..20_000 {
        assert!(buffer.next().is_some_and(|next| next.is_ok()));
        if fits(&mut buffer) {
            assert_eq!(buffer.push(frame), frame.len());
        }
    }
    let looks = buffer.examined() - before;
    assert!(looks <= 2 * 20_000 * frame.len() as u64, "{looks}");
}

#[test]
fn in_the_long_run_nothing_is_allocated() {
    let stream = REALISTIC.concat().repeat(50).into_bytes();
    let mut buffer = FrameBuffer::new(Limits::default());
    let mut frames = 0;
    let mut pass = |buffer: &mut FrameBuffer| {
        for piece in stream.chunks(700) {
            let spare = buffer.spare_mut();
            spare[..piece.len()].copy_from_slice(piece);
            buffer.commit(piece.len());
            while buffer.next().is_some_and(|next| next.is_ok()) {
                frames += 1;
            }
        }
    };
    pass(&mut buffer);
    assert_eq!(allocations_during(|| (0..10).for_each(|_| pass(&mut buffer))), 0);
    assert_eq!(frames, 11 * 50 * REALISTIC.len());
}

#[test]
fn a_partial_frame_can_be_given_up() {
    let mut buffer = FrameBuffer::new(Limits::default());
    let mut events = Vec::new();
    feed(&mut buffer, b" {\"a\":1}\r\n", &mut events);
    assert_eq!((events.len(), buffer.pending()), (1, 0));
    assert_eq!(buffer.abandon_partial(), None);

    feed(&mut buffer, b"{\"instructions\":[", &mut events);
    assert_eq!((events.len(), buffer.pending()), (1, 17));
    let error = buffer.abandon_partial().unwrap();
    assert_eq!((error.stream_offset, error.fault_offset), (10, 27));
    assert_eq!(error.fault, FrameFault::Incomplete { received: 17 });
    assert_eq!((buffer.pending(), buffer.abandon_partial()), (0, None));

    // The rest arrives later. An object nested in it is not a frame, but the object after it is.
    feed(&mut buffer, b"null,{\"x\":1},{\"y\":2}]}{\"b\":1}", &mut events);
    assert_eq!(events.len(), 2);
    assert_eq!(events[1], Event::Frame(r#"{"b":1}"#.to_owned(), 49));

    // A new frame may also follow at once.
    feed(&mut buffer, b"{\"c\"", &mut events);
    assert!(buffer.abandon_partial().is_some());
    feed(&mut buffer, b"{\"d\":1}", &mut events);
    assert_eq!(events.len(), 3);

    feed(&mut buffer, b"hello", &mut events);
    assert_eq!((events.len(), buffer.pending()), (3, 5));
    assert_eq!(buffer.abandon_partial().map(|error| error.fault), Some(FrameFault::Garbage));
}

#[test]
fn a_reset_buffer_is_a_new_one() {
    let mut buffer = FrameBuffer::new(Limits::default());
    assert_eq!(buffer.push(b"{\"a\":\"\x81"), 7);
    assert_eq!(buffer.next(), None);
    buffer.reset();
    assert_eq!(buffer.pending(), 0);
    let mut events = Vec::new();
    feed(&mut buffer, b"{}", &mut events);
    assert_eq!(events, [Event::Frame("{}".to_owned(), 0)]);
}

#[test]
fn errors_say_what_was_thrown_away_and_where() {
    let cases: [(&[u8], &str); 9] = [
        (
            b"{}          GET / HTTP/1.1\r\nHost: cabinet",
            "bytes that are no JSON object at offset 12: `GET / HTTP/1.1`…; skipped to the next `{`",
        ),
        (b"ok\n", "bytes that are no JSON object at offset 0: `ok`; skipped to the next `{`"),
        (
            b"{\"a\":[\"\xFF\"",
            "the frame at offset 0, `{\\\"a\\\":[\\\"\\xff\\\"`, never ended: only 9 bytes of it came",
        ),
        (
            b"{\"a\":1]",
            "the frame at offset 0, `{\\\"a\\\":1]`, has `]` at offset 6 where `}` was due; skipped to the next frame",
        ),
        (
            b"{\"a\":\"b\n",
            "the frame at offset 0, `{\\\"a\\\":\\\"b`, was cut off inside a string, which has byte 0x0A at offset 7; skipped to the next frame",
        ),
        (
            b"{\"a\":\"b\"c",
            "the frame at offset 0, `{\\\"a\\\":\\\"b\\\"c`, has `c` at offset 8 right behind a string, so a quote is missing; skipped to the next frame",
        ),
        (
            b"{\"a\":1 {}",
            "the frame at offset 0, `{\\\"a\\\":1`, was cut off: another begins at offset 7 where it can hold none",
        ),
        (
            b"{\"a\":[[[",
            "the frame at offset 0, `{\\\"a\\\":[[[`, nests deeper than 3 levels; skipped to its end",
        ),
        (
            b"{\"a\":\"xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx\"}",
            "the frame at offset 0, `{\\\"a\\\":\\\"xxxxxxxxxx`…, is longer than 30 bytes; skipped to its end",
        ),
    ];
    for (stream, sentence) in cases {
        let events = read(stream, Limits { max_frame_bytes: 30, max_depth: 3 }, &[4]);
        let errors: Vec<String> = events
            .iter()
            .filter_map(|event| match event {
                Event::Fault(error) => Some(error.to_string()),
                Event::Frame(..) => None,
            })
            .collect();
        assert_eq!(errors, [sentence]);
    }
}
