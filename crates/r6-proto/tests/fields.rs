//! Tests of every field of the protocol: the forms that are read, the form that is sent, and the error for an
//! invalid value.

use r6_proto::axis::{AxisIndex, AxisMask};
use r6_proto::dialect::{Addressing, CommandReplyForm, Dialect, DsIdForm};
use r6_proto::error::FieldError;
use r6_proto::message::command::Outcome;
use r6_proto::message::instruction::{
    Action, BlendLevel, Instruction, Manner, OutputBoard, OutputKind, WaitCondition, WaitSource,
};
use r6_proto::message::reading::Counter;
use r6_proto::message::{Body, ExtraKind, Message, Photo, PhotoAnswer, Point, TypeKey};
use r6_proto::reply::{DataWriter, ReplyWriter, Verdict, encode_photo};
use r6_proto::request::CameraPoints;
use r6_proto::{Address, Command, Decoder, Reading, Request, RequestType};

fn look<T>(frame: impl AsRef<[u8]>, look: impl FnOnce(&Message<'_>) -> T) -> T {
    let frame = frame.as_ref();
    let mut decoder = Decoder::new();
    match decoder.decode(frame) {
        Ok(message) => look(&message),
        Err(error) => panic!("{}: {error}", frame.escape_ascii()),
    }
}

/// Reads an AddRCC with one instruction that has these members.
fn instruction(members: &str) -> Result<Instruction, FieldError> {
    let frame = format!(r#"{{"reqType":"AddRCC","emptyList":"1","instructions":[{{{members}}}]}}"#);
    look(frame, |message| match message.body {
        Body::AddRcc(list) => Ok(list.instructions[0]),
        Body::Rejected(rejection) => {
            assert_eq!(rejection.request, RequestType::AddRcc);
            Err(rejection.error.clone())
        }
        other => panic!("{other:?}"),
    })
}

#[track_caller]
fn action(members: &str) -> Action {
    instruction(members).unwrap_or_else(|error| panic!("{members}: {error}")).action
}

/// The instruction as it is sent, without the members that all instructions have.
fn sent(action: Action) -> String {
    let list = [Instruction { oneshot: false, action }];
    let frame = encoded(&Request::AddRcc { empty_list: true, instructions: &list });
    let number = action.number();
    let (_, members) =
        frame.split_once(&format!(r#""instructions":[{{"oneshot":"0","action":"{number}","#)).unwrap();
    members.strip_suffix("}]}").unwrap().to_owned()
}

fn encoded(request: &Request<'_>) -> String {
    let mut out = Vec::new();
    request.encode(&Addressing::default(), &mut out).unwrap_or_else(|error| panic!("{error}"));
    String::from_utf8(out).unwrap()
}

/// The error and its text must contain the field, what was found (`None`: nothing), and what is valid.
#[track_caller]
fn check_error(error: &FieldError, path: &str, found: Option<&str>, wanted: &str) {
    assert_eq!((&*error.path.to_string(), error.found.as_deref()), (path, found));
    assert!(error.wanted.english().contains(wanted), "{:?} does not say {wanted:?}", error.wanted);
    let text = error.to_string();
    let parts = [path, found.unwrap_or("missing"), wanted];
    assert!(parts.iter().all(|part| text.contains(part)), "{text}");
}

/// Checks that an instruction with this member in place of a valid one is refused.
#[track_caller]
fn refuses(good: &str, field: &str, values: &[&str], wanted: &str) {
    assert!(instruction(good).is_ok(), "{good}");
    let (before, rest) =
        good.split_once(&format!("\"{field}\":")).unwrap_or_else(|| panic!("no {field} in {good}"));
    let rest = rest.split_once(',').map_or(String::new(), |(_, rest)| format!(",{rest}"));
    for value in values {
        let error = instruction(&format!("{before}\"{field}\":{value}{rest}")).unwrap_err();
        check_error(&error, &format!("instructions[0].{field}"), Some(value), wanted);
    }
}

/// Checks that an instruction without this member is refused.
#[track_caller]
fn requires(good: &str, field: &str, wanted: &str) {
    let without = good.replace(&format!("\"{field}\":"), "\"other\":");
    assert_ne!(good, without);
    let error = instruction(&without).unwrap_err();
    check_error(&error, &format!("instructions[0].{field}"), None, wanted);
}

fn manner(members: &str) -> Manner {
    match action(&format!(r#""action":"4",{members}"#)) {
        Action::AxisMove(motion) => motion.manner,
        other => panic!("{other:?}"),
    }
}

fn sent_manner(manner: Manner) -> String {
    let target = r6_proto::message::instruction::Coordinates::from_slice(&[0.0; 8]);
    let members = sent(Action::AxisMove(r6_proto::message::instruction::Move { target, manner }));
    members.rsplit_once(r#""m7":"0.000","#).unwrap().1.to_owned()
}

// Tolerance for the whole frame.

#[test]
fn ck_status_forms() {
    for (form, bits) in [
        (r#""0x3F""#, 0x3F),
        (r#""0X3f""#, 0x3F),
        (r#""63""#, 63),
        ("63", 63),
        ("63.0", 63),
        (r#"" 0x07 ""#, 7),
        (r#""0x0""#, 0),
        (r#""0x0000FF""#, 0xFF),
        ("255", 255),
    ] {
        assert_eq!(manner(&format!("\"ckStatus\":{form}")).mask, Some(AxisMask::from_bits(bits)), "{form}");
    }
    assert_eq!(manner(r#""m0":0"#).mask, None);
}

#[test]
fn empty_list_forms() {
    let empty_list = |member: &str| {
        look(format!(r#"{{"reqType":"AddRCC",{member}"instructions":[]}}"#), |message| match message.body {
            Body::AddRcc(list) => Ok(list.empty_list),
            Body::Rejected(rejection) => Err(rejection.error.clone()),
            other => panic!("{other:?}"),
        })
    };
    for form in [r#""1""#, "1", "true", r#""1.0""#, r#"" 1 ""#] {
        assert_eq!(empty_list(&format!("\"emptyList\":{form},")), Ok(Some(true)), "{form}");
    }
    for form in [r#""0""#, "0", "false"] {
        assert_eq!(empty_list(&format!("\"emptyList\":{form},")), Ok(Some(false)), "{form}");
    }
    // An absent member means neither, because a client must state that it replaces the list.
    assert_eq!(empty_list(""), Ok(None));
    for form in [r#""2""#, "-1", r#""""#, "null", r#"["1"]"#, r#""yes""#] {
        let error = empty_list(&format!("\"emptyList\":{form},")).unwrap_err();
        check_error(&error, "emptyList", Some(form), "1 (replace the list) or 0 (append to it)");
    }
}

#[test]
fn short_and_long_ds_id() {
    let kinds = [
        (RequestType::Query, "HCRemoteMonitor", "www.hc-system.com.RemoteMonitor"),
        (RequestType::Command, "HCRemoteMonitor", "www.hc-system.com.RemoteMonitor"),
        (RequestType::Heartbreak, "HCRemoteMonitor", "www.hc-system.com.RemoteMonitor"),
        (RequestType::AddRcc, "HCRemoteCommand", "www.hc-system.com.HCRemoteCommand"),
        (RequestType::AddPoints, "www.hc-system.com.cam", "www.hc-system.com.cam"),
        (RequestType::Photo, "www.hc-system.com.cam", "www.hc-system.com.cam"),
    ];
    for (kind, short, long) in kinds {
        assert_eq!((DsIdForm::Short.ds_id(kind), DsIdForm::Long.ds_id(kind)), (short, long));
    }
    for ds_id in ["HCRemoteMonitor", "www.hc-system.com.RemoteMonitor"] {
        let request = format!(r#"{{"dsID":"{ds_id}","reqType":"query","queryAddr":["version"]}}"#);
        // The reply repeats the form of the request.
        assert_eq!(
            query_reply(Dialect::HC1, &request, |data| data.text("v1")),
            format!(r#"{{"dsID":"{ds_id}","queryAddr":["version"],"queryData":["v1"],"reqType":"query"}}"#)
        );
    }
}

#[test]
fn cmd_type() {
    let request = r#"{"dsID":"HCRemoteMonitor","cmdType":"query","queryAddr":["version"]}"#;
    look(request, |message| {
        assert_eq!(message.header.type_key, TypeKey::CmdType);
        assert!(matches!(message.body, Body::Query(_)));
        assert_eq!(message.extras().len(), 0);
    });
    // The reply puts the type under the key of the request. In alphabetical order, this key moves to the
    // front.
    assert_eq!(
        query_reply(Dialect::HC1, request, |data| data.text("v1")),
        r#"{"cmdType":"query","dsID":"HCRemoteMonitor","queryAddr":["version"],"queryData":["v1"]}"#
    );
    // With both keys, the newer one counts and the other is reported.
    look(r#"{"cmdType":"command","reqType":"query","queryAddr":[]}"#, |message| {
        assert_eq!(message.header.type_key, TypeKey::ReqType);
        assert!(matches!(message.body, Body::Query(_)));
        assert_eq!(extras(message), [("cmdType".to_owned(), ExtraKind::OutOfPlace)]);
    });
}

#[test]
fn numbers_for_texts() {
    let texts = r#""oneshot":"1","action":"100","type":"1","point":"7","io_status":"2","limit":"2.5","isUnlimit":"0""#;
    let numbers = texts.replace("\"1\"", "1").replace("\"100\"", "100").replace("\"7\"", "7");
    let numbers = numbers.replace("\"2\"", "2").replace("\"2.5\"", "2.5").replace("\"0\"", "0");
    assert_eq!(numbers.matches('"').count(), texts.matches('"').count() - 14);
    assert_eq!(instruction(texts), instruction(&numbers));
    assert!(instruction(texts).is_ok());
    let command = |data: &str| {
        look(format!(r#"{{"reqType":"command","cmdData":{data}}}"#), |message| match message.body {
            Body::Command(words) => words.read().map(|command| format!("{command:?}")),
            other => panic!("{other:?}"),
        })
    };
    assert_eq!(command(r#"["modifyOutput",0,3,1]"#), command(r#"["modifyOutput","0","3","1"]"#));
    assert!(command(r#"["modifyOutput",0,3,1]"#).is_ok());
}

#[test]
fn duplicate_keys() {
    look(
        r#"{"reqType":"command","reqType":"query","queryAddr":["a","b"],"queryAddr":["version"]}"#,
        |message| {
            let Body::Query(query) = message.body else { panic!("{message:?}") };
            assert_eq!(query.addresses.iter().map(|value| value.text()).collect::<Vec<_>>(), ["version"]);
            let earlier: Vec<_> = message
                .extras()
                .map(|extra| (extra.key.text().into_owned(), format!("{:?}", extra.value)))
                .collect();
            let expected = [("reqType", r#""command""#), ("queryAddr", r#"["a","b"]"#)];
            assert_eq!(earlier, expected.map(|(key, value)| (key.to_owned(), value.to_owned())));
        },
    );
    // The same holds in an instruction. A repeated list replaces the first one.
    let moved = action(r#""action":"800","action":"4","m0":"1","m0":"2""#);
    let Action::AxisMove(moved) = moved else { panic!("{moved:?}") };
    assert_eq!(moved.target.at(AxisIndex::ALL[0]), Some(2.0));
    let twice = r#"{"reqType":"AddRCC","instructions":[{"action":"4"}],"instructions":[{"action":"800","cnt_id":"1"}]}"#;
    look(twice, |message| {
        let Body::AddRcc(list) = message.body else { panic!("{message:?}") };
        assert_eq!(list.instructions.len(), 1);
        assert_eq!(list.instructions[0].action.number(), 800);
    });
    let twice = r#"{"reqType":"AddPoints","dsData":[{"camID":1,"data":[{"X":1,"Y":1}],"camID":2,"data":[{"X":2,"Y":2}]}]}"#;
    look(twice, |message| {
        let Body::AddPoints(points) = message.body else { panic!("{message:?}") };
        let sets: Vec<_> =
            points.sets().map(|(id, set)| (id, set.iter().map(|point| point.x).collect())).collect();
        assert_eq!(sets, [(2, vec![2.0])]);
        assert_eq!(points.len(), 1);
    });
}

#[test]
fn unknown_keys() {
    let frame = r#"{"reqType":"AddRCC","user":{"a":[1]},"instructions":[{"action":"800","cnt_id":"1","speeed":"9","point":"3"}]}"#;
    look(frame, |message| {
        let Body::AddRcc(list) = message.body else { panic!("{message:?}") };
        assert_eq!(list.instructions.len(), 1);
        let told: Vec<String> = message.extras().map(|extra| extra.to_string()).collect();
        assert_eq!(
            told,
            [
                "frame: `user`: unknown key",
                "instructions[0]: `speeed`: unknown key; nearest: `speed`",
                "instructions[0]: `point`: known key without a meaning here",
            ]
        );
    });
    // A misspelt key counts as missing under its correct name, and the extra suggests that name.
    look(r#"{"reqType":"query","queryAddrr":["version"]}"#, |message| {
        let Body::Rejected(rejection) = message.body else { panic!("{message:?}") };
        check_error(rejection.error, "queryAddr", None, "a list of query addresses");
        assert_eq!(message.extras().next().and_then(|extra| extra.nearest()), Some("queryAddr"));
    });
}

#[test]
fn accepted_spellings() {
    for word in ["AddRCC", "AddrCC"] {
        look(format!(r#"{{"reqType":"{word}","instructions":[]}}"#), |message| {
            assert!(matches!(message.body, Body::AddRcc(_)), "{word}");
        });
    }
    let frame =
        r#"{"reqType":"query","queryAddr":["Version","version","boardIONum","boardIOnum","Curmode"]}"#;
    look(frame, |message| {
        let Body::Query(query) = message.body else { panic!("{message:?}") };
        let read: Vec<_> =
            query.resolved().map(|(_, address)| address.map_err(|error| error.to_string())).collect();
        assert_eq!(
            read[..4],
            [Address::Version, Address::Version, Address::BoardIoNum, Address::BoardIoNum].map(Ok)
        );
        assert_eq!(read[4], Err("`Curmode` is no query address; nearest: `curMode`".to_owned()));
    });
    look(
        r#"{"reqType":"AddPoints","dsData":[{"camID":0,"data":[{"X":1,"Y":2,"Angle":"45"}]}]}"#,
        |message| {
            let Body::AddPoints(points) = message.body else { panic!("{message:?}") };
            assert_eq!(points.sets().next().map(|(_, points)| points[0].angle), Some(Some(45.0)));
            assert_eq!(extras(message), [("Angle".to_owned(), ExtraKind::OtherSpelling)]);
        },
    );
}

#[test]
fn shape_2020() {
    let frame = r#"{"dsID":"HCRemoteCommand","emptyList":"0","dsData":[{"camID":"0","data":[{"oneshot":"1","action":"4","xpos":"1","ypos":2,"zpos":"3","upos":"4","vpos":"5","wpos":"6","speed":"20.0"}]},{"camID":"1","data":[{"action":"10","xpos":"7"}]}]}"#;
    look(frame, |message| {
        assert_eq!(message.header.type_key, TypeKey::Absent);
        let Body::AddRcc(list) = message.body else { panic!("{message:?}") };
        assert_eq!((list.empty_list, list.shape_2020, list.instructions.len()), (Some(false), true, 2));
        let Action::AxisMove(motion) = list.instructions[0].action else { panic!("{list:?}") };
        let target: Vec<_> = AxisIndex::ALL.into_iter().filter_map(|axis| motion.target.at(axis)).collect();
        assert_eq!(target, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(motion.manner.speed, Some(20.0));
        assert_eq!(message.extras().len(), 0);
    });
    // In the current shape these names have no meaning.
    look(r#"{"reqType":"AddRCC","instructions":[{"action":"4","xpos":"1"}]}"#, |message| {
        assert_eq!(extras(message), [("xpos".to_owned(), ExtraKind::OutOfPlace)]);
    });
}

#[test]
fn what_the_wire_cannot_carry_is_not_sent() {
    use r6_proto::message::instruction::{Coordinates, Move, Output, OutputKind, PathSpeed};
    let moved = |manner: Manner| Action::AxisMove(Move { target: Coordinates::from_slice(&[1.0]), manner });
    let speed = |speed| moved(Manner { speed: Some(speed), ..Manner::default() });
    let delay = |delay| moved(Manner { speed: Some(1.0), delay: Some(delay), ..Manner::default() });
    for wrong in [-5.0, 0.0, 0.0004, 0.05, 12.34, 100.1, f64::NAN] {
        assert_eq!(refused_to_send(speed(wrong)), "speed", "{wrong}");
    }
    assert_eq!(refused_to_send(delay(1.25)), "delay");
    for wrong in [-1.0, 0.0004, 1e6, f64::INFINITY] {
        assert_eq!(refused_to_send(delay(wrong)), "delay", "{wrong}");
        let output = Output { kind: OutputKind::Y, point: 1, on: true, delay: wrong };
        assert_eq!(refused_to_send(Action::Output(output)), "delay", "{wrong}");
    }
    for wrong in [0.05, -3.0, 0.0, 10_001.0] {
        let speed = PathSpeed { in_use: true, speed: Some(wrong) };
        assert_eq!(refused_to_send(Action::PathSpeed(speed)), "speed", "{wrong}");
    }
    let refused = |command: Command<'_>| {
        let encoded = Request::Command(&command).encode(&Addressing::default(), &mut Vec::new());
        encoded.unwrap_err().to_string()
    };
    let register = r6_proto::RegisterIndex::new(800).unwrap();
    let beyond = Command::RewriteData { register, value: 5_000_000_000, savable: false };
    assert_eq!(refused(beyond), "`value` cannot be sent: it has to be a whole number of 32 bits");
}

/// A setting between two steps of the wire is refused, and the error names both steps. Floating-point noise
/// is accepted.
#[test]
fn what_lies_between_two_steps_of_the_wire_is_not_rounded() {
    use r6_proto::message::instruction::{Output, Wait};
    let refused = |request: &Request<'_>| {
        let mut out = b"before".to_vec();
        let error = request.encode(&Addressing::default(), &mut out).unwrap_err();
        assert_eq!(out, b"before");
        let nearest = error.nearest.unwrap_or_else(|| panic!("{error}"));
        assert!(error.to_string().ends_with(&format!("; nearest: {nearest}")), "{error}");
        format!("{}: {} or {}", error.field, nearest.below(), nearest.above())
    };
    let tool = |x| Command::ModifyTool { tool: 1, offset: [x, 0.0, 0.0, 0.0, 0.0, 0.0] };
    let ramps = |deceleration| Command::ModifyAccDec { acceleration: 0.5, deceleration };
    let stack = |x| Command::ModifyStackData { stack: 0, spacing: [x, 0.0, 0.0], count: [1; 3] };
    for (command, told) in [
        (Command::ModifyGspd { percent: 5.55 }, "percent: 5.5 or 5.6"),
        (Command::ModifyGspd { percent: 0.04 }, "percent: 0 or 0.1"),
        (tool(0.0004), "x: 0 or 0.001"),
        (tool(-120.2505), "x: -120.251 or -120.25"),
        (ramps(0.2505), "deceleration: 0.25 or 0.251"),
        (stack(10.0004), "dx: 10 or 10.001"),
    ] {
        assert_eq!(refused(&Request::Command(&command)), told);
    }
    let step = |action| [Instruction { oneshot: true, action }];
    let moved = |manner| {
        let target = r6_proto::message::instruction::Coordinates::from_slice(&[1.0; 6]);
        Action::AxisMove(r6_proto::message::instruction::Move { target, manner })
    };
    let wait =
        Wait { source: WaitSource::Time, condition: WaitCondition::Off, limit: 0.25, unlimited: false };
    for (action, told) in [
        (moved(Manner { speed: Some(12.345), ..Manner::default() }), "speed: 12.3 or 12.4"),
        (moved(Manner { delay: Some(0.05), ..Manner::default() }), "delay: 0 or 0.1"),
        (Action::Wait(wait), "limit: 0.2 or 0.3"),
        (
            Action::Output(Output { kind: OutputKind::TimedY, point: 0, on: true, delay: 0.0005 }),
            "delay: 0 or 0.001",
        ),
    ] {
        assert_eq!(refused(&Request::AddRcc { empty_list: true, instructions: &step(action) }), told);
    }
    let noisy = Command::ModifyGspd { percent: (0.1 + 0.2) * 10.0 };
    assert!(encoded(&Request::Command(&noisy)).contains(r#"["modifyGSPD","30"]"#));
    // A position is computed, so its seventh decimal is rounded.
    let position = r6_proto::message::instruction::Coordinates::from_slice(&[123.456_789_1; 6]);
    let line = r6_proto::message::instruction::Move { target: position, manner: Manner::default() };
    assert!(sent(Action::LinearMove(line)).contains(r#""m0":"123.456789""#));
}

/// Every axis that moves needs a coordinate, because it is not known what a controller uses for an absent
/// one. It may use 0.
#[test]
fn a_mask_lets_nothing_through_that_has_no_coordinate() {
    use r6_proto::message::instruction::{Coordinates, CurveMove, Move};
    let masked = |mask| Manner { mask: Some(AxisMask::from_bits(mask)), ..Manner::default() };
    let place = Coordinates::from_slice(&[1.0; 3]);
    let pose = Coordinates::from_slice(&[1.0; 6]);
    for mask in [0x3F, 0x0F, 0x40, 0xFF] {
        let line = Move { target: place, manner: masked(mask) };
        assert_eq!(refused_to_send(Action::LinearMove(line)), "ckStatus", "{mask:#x}");
        assert_eq!(refused_to_send(Action::AxisMove(line)), "ckStatus", "{mask:#x}");
        for (middle, end) in [(place, pose), (pose, place)] {
            let curve = CurveMove { middle, end, manner: masked(mask) };
            assert_eq!(refused_to_send(Action::CurveMove(curve)), "ckStatus", "{mask:#x}");
        }
    }
    let line = |manner| sent(Action::LinearMove(Move { target: place, manner }));
    assert!(line(masked(0x07)).ends_with(r#","ckStatus":"0x07""#));
    assert!(
        line(Manner::default()).ends_with(r#","ckStatus":"0x07""#),
        "left out, the mask is of what is given"
    );
    let whole = sent(Action::LinearMove(Move { target: pose, manner: Manner::default() }));
    assert!(!whole.contains("ckStatus"), "{whole}");
}

#[test]
fn items_are_called_by_their_number_whatever_is_wrong_with_the_others() {
    let frame = r#"{"reqType":"AddRCC","instructions":[{"action":"4","speed":"x","bogus":1},7,{"action":"999"},{"action":"4","bogus2":2}]}"#;
    look(frame, |message| {
        let places: Vec<String> =
            message.extras().map(|extra| format!("{}: {}", extra.place, extra.key.text())).collect();
        assert_eq!(places, ["instructions[0]: bogus", "instructions[3]: bogus2"]);
    });
    let frame = r#"{"emptyList":"1","dsData":[{"camID":"0","bogus":1,"data":[],"data":[{"action":"4","m0":"1","xpos":"2"}]}]}"#;
    look(frame, |message| {
        let places: Vec<String> =
            message.extras().map(|extra| format!("{}: {}", extra.place, extra.key.text())).collect();
        assert_eq!(places, ["dsData[0]: bogus", "dsData[0]: data", "instructions[0]: m0"]);
    });
}

#[test]
fn gbk_names() {
    let gbk = |text: &str| encoding_rs::GBK.encode(text).0.into_owned();
    // The second bytes of these characters are a backslash, brackets and braces.
    assert_eq!(["誠", "匽", "昜", "調", "晑"].map(|name| gbk(name)[1]), *b"\\][{}");
    for name in ["计数器", "誠", "匽誠\"", "A誠B", "晑調", "昜"] {
        let escaped = name.replace('"', "\\\"");
        let frame = [
            br#"{"dsID":"HCRemoteMonitor","cmdType":"queryEcho","queryData":[""#.as_slice(),
            &gbk(&escaped),
            b"[4][T:20][C:7]\",\"1\"]}",
        ]
        .concat();
        look(frame, |message| {
            let Body::QueryReply(reply) = message.body else { panic!("{message:?}") };
            assert_eq!(reply.values.len(), 2);
            let counter = Reading::of(Address::Counter(4), reply.values.at(0).unwrap());
            let expected = Counter { id: 4, target: 20, current: 7, name: Some(name.to_owned()) };
            assert_eq!(counter, Ok(Reading::Counter(expected)));
        });
        let frame =
            [br#"{"reqType":"command","cmdData":["switchMold",""#.as_slice(), &gbk(&escaped), b"\"]}"]
                .concat();
        look(frame, |message| {
            let Body::Command(words) = message.body else { panic!("{message:?}") };
            assert_eq!(words.read(), Ok(Command::SwitchMold { mold: name.into() }));
        });
    }
}

fn extras(message: &Message<'_>) -> Vec<(String, ExtraKind)> {
    message.extras().map(|extra| (extra.key.text().into_owned(), extra.kind)).collect()
}

// The six types.

#[test]
fn request_type_query() {
    let frame = encoded(&Request::Query(&[Address::Version, Address::CurMold]));
    assert_eq!(
        frame,
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddr":["version","curMold"]}"#
    );
    look(frame, |message| assert!(matches!(message.body, Body::Query(_))));
    for (wrong, found) in [(r#","queryAddr":"version""#, Some(r#""version""#)), ("", None)] {
        look(format!(r#"{{"reqType":"query"{wrong}}}"#), |message| {
            let Body::Rejected(rejection) = message.body else { panic!("{message:?}") };
            check_error(rejection.error, "queryAddr", found, "a list of query addresses");
        });
    }
}

#[test]
fn request_type_command() {
    let frame = encoded(&Request::Command(&Command::ModifyGspd { percent: 5.0 }));
    assert_eq!(
        frame,
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","cmdData":["modifyGSPD","50"]}"#
    );
    look(frame, |message| assert!(matches!(message.body, Body::Command(_))));
    for (data, path, found) in [
        (r#","cmdData":"actionStop""#, "cmdData", Some(r#""actionStop""#)),
        ("", "cmdData", None),
        (r#","cmdData":[]"#, "cmdData[0]", None),
        (r#","cmdData":[7]"#, "cmdData[0]", Some("7")),
    ] {
        look(format!(r#"{{"reqType":"command"{data}}}"#), |message| {
            let Body::Rejected(rejection) = message.body else { panic!("{message:?}") };
            check_error(rejection.error, path, found, "");
        });
    }
    // Invalid arguments are reported when the command is read, not when the frame is decoded.
    look(r#"{"reqType":"command","cmdData":["modifyGSPD","1001"]}"#, |message| {
        let Body::Command(words) = message.body else { panic!("{message:?}") };
        let error = words.read().unwrap_err().to_string();
        assert_eq!(
            error,
            "`modifyGSPD argument 1 (percent)` is \"1001\", but has to be percent x 10, from 0 to 1000"
        );
    });
    look(r#"{"reqType":"command","cmdData":["actoinStop"]}"#, |message| {
        let Body::Command(words) = message.body else { panic!("{message:?}") };
        assert_eq!(
            words.read().unwrap_err().to_string(),
            "unknown command `actoinStop`; nearest: `actionStop`"
        );
    });
}

#[test]
fn request_type_heartbreak() {
    let frame = encoded(&Request::Heartbreak);
    assert_eq!(frame, r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"heartbreak"}"#);
    assert!(!Request::Heartbreak.expects_reply());
    look(frame, |message| assert!(matches!(message.body, Body::Heartbreak)));
    // The maker's misspelling is the valid word. The correct spelling must not feed a watchdog.
    look(r#"{"reqType":"heartbeat"}"#, |message| {
        let Body::Unknown(unknown) = message.body else { panic!("{message:?}") };
        assert_eq!(unknown.nearest(), Some("heartbreak"));
    });
}

#[test]
fn request_type_photo() {
    let mut frame = Vec::new();
    encode_photo(2, Some("7"), &mut frame);
    assert_eq!(
        String::from_utf8_lossy(&frame),
        r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","packID":"7","camID":2}"#
    );
    look(&frame, |message| assert!(matches!(message.body, Body::Photo(Photo { cam_id: 2 }))));
    let answer = Request::PhotoAnswer(PhotoAnswer { cam_id: 2, ret: 1 });
    assert!(!answer.expects_reply());
    let frame = encoded(&answer);
    assert_eq!(frame, r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":2,"ret":1}"#);
    look(frame, |message| {
        assert!(matches!(message.body, Body::PhotoAnswer(PhotoAnswer { cam_id: 2, ret: 1 })));
    });
}

#[test]
fn request_type_add_points() {
    let points = [Point { x: 1.5, y: -2.0, angle: Some(90.25), ..Point::default() }];
    let frame = encoded(&Request::AddPoints(&[CameraPoints { cam_id: 1, points: &points }]));
    assert_eq!(
        frame,
        concat!(
            r#"{"dsID":"www.hc-system.com.cam","reqType":"AddPoints","dsData":[{"camID":1,"data":[{"ModelID":0,"#,
            r#""X":1.500,"Y":-2.000,"Angel":90.250,"Rel":0}]}]}"#,
        )
    );
    look(frame, |message| {
        let Body::AddPoints(read) = message.body else { panic!("{message:?}") };
        assert_eq!(read.sets().collect::<Vec<_>>(), [(1, points.as_slice())]);
    });
    for (data, path, found, wanted) in [
        ("", "dsData", None, "a list of cameras"),
        (r#","dsData":{}"#, "dsData", Some("{}"), "a list of cameras"),
        (r#","dsData":[7]"#, "dsData[0]", Some("7"), "an object"),
        (r#","dsData":[{"camID":0}]"#, "dsData[0].data", None, "a list of points"),
        (r#","dsData":[{"camID":0,"data":"x"}]"#, "dsData[0].data", Some(r#""x""#), "a list of points"),
        (r#","dsData":[{"camID":0,"data":[7]}]"#, "point[0]", Some("7"), "an object"),
    ] {
        look(format!(r#"{{"reqType":"AddPoints"{data}}}"#), |message| {
            let Body::Rejected(rejection) = message.body else { panic!("{message:?}") };
            check_error(rejection.error, path, found, wanted);
        });
    }
}

#[test]
fn request_type_add_rcc() {
    let bench = Action::Workbench(r6_proto::message::instruction::Workbench { id: 3 });
    let list = [Instruction { oneshot: true, action: bench }];
    let frame = encoded(&Request::AddRcc { empty_list: false, instructions: &list });
    assert_eq!(
        frame,
        concat!(
            r#"{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","emptyList":"0","#,
            r#""instructions":[{"oneshot":"1","action":"800","cnt_id":"3"}]}"#,
        )
    );
    look(frame, |message| assert!(matches!(message.body, Body::AddRcc(_))));
    for (data, path, found, wanted) in [
        ("", "instructions", None, "a list of instructions"),
        (r#","instructions":"""#, "instructions", Some(r#""""#), "a list of instructions"),
        (r#","instructions":[[]]"#, "instructions[0]", Some("[]"), "an object"),
        (
            r#","instructions":[{"action":"4"},{"action":"four"}]"#,
            "instructions[1].action",
            Some(r#""four""#),
            "whole",
        ),
    ] {
        look(format!(r#"{{"reqType":"AddRCC"{data}}}"#), |message| {
            let Body::Rejected(rejection) = message.body else { panic!("{message:?}") };
            check_error(rejection.error, path, found, wanted);
        });
    }
}

// The fields of instructions.

#[test]
fn instruction_oneshot() {
    let oneshot =
        |member: &str| instruction(&format!(r#""action":"800","cnt_id":"0"{member}"#)).map(|one| one.oneshot);
    for (form, read) in [(r#""1""#, true), ("1", true), (r#""0""#, false), ("0", false), ("true", true)] {
        assert_eq!(oneshot(&format!(",\"oneshot\":{form}")), Ok(read), "{form}");
    }
    assert_eq!(oneshot(""), Ok(false));
    // The list also says which instructions have no oneshot, because a firmware may treat these differently.
    let steps = r#"{"action":"800","cnt_id":"0"},{"action":"800","cnt_id":"0","oneshot":"0"},{"action":"800","cnt_id":"0"}"#;
    for (steps, without) in [(steps, &[0, 2][..]), (r#"{"action":"800","cnt_id":"0","oneshot":"1"}"#, &[])] {
        look(format!(r#"{{"reqType":"AddRCC","instructions":[{steps}]}}"#), |message| {
            let Body::AddRcc(list) = message.body else { panic!("{message:?}") };
            assert_eq!(list.without_oneshot, without);
        });
    }
    refuses(
        r#""action":"800","cnt_id":"0","oneshot":"1""#,
        "oneshot",
        &[r#""2""#, r#""""#, "null"],
        "1 or 0",
    );
}

#[test]
fn instruction_action_unknown() {
    let frame = r#"{"reqType":"AddRCC","instructions":[{"value":"7","action":999,"list":[1,"2"],"oneshot":"1","m0":"x"},{"action":"14"}]}"#;
    look(frame, |message| {
        let Body::AddRcc(list) = message.body else { panic!("{message:?}") };
        let Action::Unknown(unknown) = &list.instructions[0].action else { panic!("{list:?}") };
        assert_eq!((unknown.number(), list.instructions[0].oneshot), (999, true));
        let fields: Vec<_> =
            list.unknown_fields(unknown).map(|(name, value)| format!("{}={value:?}", name.text())).collect();
        assert_eq!(fields, [r#"value="7""#, r#"list=[1,"2"]"#, r#"m0="x""#]);
        let Action::Unknown(second) = &list.instructions[1].action else { panic!("{list:?}") };
        assert_eq!((second.number(), list.unknown_fields(second).len()), (14, 0));
        assert_eq!(message.extras().len(), 0, "its fields are no unknown keys");
        // It can be read but not sent on, because its meaning is unknown.
        let mut out = b"before".to_vec();
        let request = Request::AddRcc { empty_list: true, instructions: list.instructions };
        assert_eq!(request.encode(&Addressing::default(), &mut out).unwrap_err().field, "action");
        assert_eq!(out, b"before");
    });
    let error = instruction(r#""oneshot":"1""#).unwrap_err();
    check_error(&error, "instructions[0].action", None, "a whole number");
}

#[test]
fn instruction_4_m() {
    let good = r#""action":"4","m0":"0.000","m3":-10.5,"m7":"1e2""#;
    let Action::AxisMove(motion) = action(good) else { panic!("no axis move") };
    let read: Vec<_> = AxisIndex::ALL.into_iter().map(|axis| motion.target.at(axis)).collect();
    assert_eq!(read, [Some(0.0), None, None, Some(-10.5), None, None, None, Some(100.0)]);
    assert_eq!(motion.target.given(), AxisMask::from_bits(0b1000_1001));
    // An absent coordinate stays absent, and the mask is written.
    let members = r#""m0":"0.000","m3":"-10.500","m7":"100.000","ckStatus":"0x89""#;
    assert_eq!(sent(Action::AxisMove(motion)), members);
    let Action::LinearMove(line) = action(&good.replace("\"4\"", "\"10\"")) else { panic!("no linear move") };
    assert_eq!(line, motion);
    let bad = [r#""""#, r#""1,5""#, r#""NaN""#, r#""inf""#, "null", "true", r#""1e400""#, "[1]", r#""0x10""#];
    refuses(good, "m3", &bad, "a finite number of mm or degrees");
    refuses(good, "m7", &bad, "a finite number of mm or degrees");
    // Six decimals are sent; a number out of range is not.
    let mut sharp = motion;
    sharp.target.set(AxisIndex::ALL[0], -0.123_456_7);
    assert!(sent(Action::AxisMove(sharp)).starts_with(r#""m0":"-0.123457""#));
    sharp.target.set(AxisIndex::ALL[0], 1e10);
    let list = [Instruction { oneshot: true, action: Action::LinearMove(sharp) }];
    let request = Request::AddRcc { empty_list: true, instructions: &list };
    assert_eq!(request.encode(&Addressing::default(), &mut Vec::new()).unwrap_err().field, "m0");
}

#[test]
fn instruction_4_ck_status() {
    let good = r#""action":"4","m0":"1","ckStatus":"0x3F""#;
    assert_eq!(sent_manner(manner(r#""ckStatus":"7""#)), r#""ckStatus":"0x07""#);
    assert_eq!(sent_manner(manner(r#""ckStatus":"0xff""#)), r#""ckStatus":"0xFF""#);
    let bad = [
        "256",
        r#""0x100""#,
        "-1",
        r#""0x""#,
        r#""0x+3""#,
        r#""3F""#,
        r#""0x3G""#,
        "63.5",
        "null",
        r#""0x1FFFFFFFFF""#,
    ];
    refuses(good, "ckStatus", &bad, "a mask from 0 to 0xFF");
    // The misprint of manual 6.1.1: a key without a value is not JSON, and the error names the key.
    let error =
        Decoder::new().decode(br#"{"instructions":[{"ckStatus","speed":"80.0"}]}"#).map(|_| ()).unwrap_err();
    assert_eq!(error.to_string(), "key `ckStatus` has no value: `:` was due at byte 28, found `,`");
}

#[test]
fn instruction_4_speed() {
    for (form, read) in [(r#""80.0""#, 80.0), ("80", 80.0), (r#""0.1""#, 0.1), (r#""100""#, 100.0)] {
        assert_eq!(manner(&format!("\"speed\":{form}")).speed, Some(read), "{form}");
    }
    assert_eq!(manner(r#""m0":1"#).speed, None);
    assert_eq!(sent_manner(Manner { speed: Some(80.0), ..Manner::default() }), r#""speed":"80.0""#);
    assert_eq!(sent_manner(Manner { speed: Some(0.1 + 0.2), ..Manner::default() }), r#""speed":"0.3""#);
    // It is neither 12.3 nor 12.4, so it is read as it is and not sent.
    assert_eq!(manner(r#""speed":"12.345""#).speed, Some(12.345));
    let good = r#""action":"4","m0":"1","speed":"80.0""#;
    refuses(good, "speed", &[r#""fast""#, r#""""#, "null", "[80]"], "a finite number of percent");
}

#[test]
fn instruction_4_delay() {
    for (form, read) in [(r#""1.0""#, 1.0), ("0", 0.0), (r#""86400""#, 86_400.0)] {
        assert_eq!(manner(&format!("\"delay\":{form}")).delay, Some(read), "{form}");
    }
    assert_eq!(manner(r#""m0":1"#).delay, None);
    assert_eq!(sent_manner(Manner { delay: Some(1.0), ..Manner::default() }), r#""delay":"1.0""#);
    let good = r#""action":"4","m0":"1","delay":"1.0""#;
    refuses(good, "delay", &["-0.1", r#""86400.1""#, r#""""#, "null"], "seconds from 0 to 86400");
}

#[test]
fn instruction_4_smooth() {
    for level in 0..=9_u8 {
        assert_eq!(manner(&format!("\"smooth\":\"{level}\"")).smooth, BlendLevel::new(level));
    }
    assert_eq!(manner(r#""m0":1"#).smooth, None);
    assert_eq!(sent_manner(Manner { smooth: BlendLevel::new(9), ..Manner::default() }), r#""smooth":"9""#);
    let good = r#""action":"4","m0":"1","smooth":"0""#;
    refuses(good, "smooth", &["10", "-1", r#""0.5""#, r#""""#, "265"], "a blend level from 0 to 9");
}

#[test]
fn instruction_4_tool() {
    assert_eq!(manner(r#""tool":"2""#).tool, Some(2));
    assert_eq!(manner(r#""tool":0"#).tool, Some(0));
    assert_eq!(manner(r#""m0":1"#).tool, None);
    assert_eq!(sent_manner(Manner { tool: Some(2), ..Manner::default() }), r#""tool":"2""#);
    let good = r#""action":"4","m0":"1","tool":"0""#;
    refuses(good, "tool", &["-1", "4294967296", r#""T1""#, "1.5"], "a tool number from 0");
}

#[test]
fn instruction_4_coord() {
    assert_eq!(manner(r#""coord":"3""#).coord, Some(3));
    assert_eq!(manner(r#""m0":1"#).coord, None);
    // tool and coord come last, in this order.
    let both = Manner { coord: Some(3), tool: Some(1), smooth: BlendLevel::new(0), ..Manner::default() };
    assert_eq!(sent_manner(both), r#""smooth":"0","tool":"1","coord":"3""#);
    let good = r#""action":"4","m0":"1","coord":"0""#;
    refuses(good, "coord", &["-1", r#""""#, "1.5", "null"], "a workbench number from 0");
}

#[test]
fn instruction_17_m_p() {
    let good = r#""action":"17","m0":"1","m5":"2","m0_p":"3.5","m7_p":4"#;
    let Action::CurveMove(curve) = action(good) else { panic!("no curve move") };
    assert_eq!(curve.middle.given(), AxisMask::from_bits(0b10_0001));
    let end: Vec<_> = AxisIndex::ALL.into_iter().filter_map(|axis| curve.end.at(axis)).collect();
    assert_eq!((curve.end.given(), end), (AxisMask::from_bits(0b1000_0001), vec![3.5, 4.0]));
    assert_eq!(
        sent(Action::CurveMove(curve)),
        r#""m0":"1.000","m5":"2.000","m0_p":"3.500","m7_p":"4.000","ckStatus":"0x01""#
    );
    refuses(good, "m0_p", &[r#""x""#, "null", "{}"], "a finite number of mm or degrees");
    refuses(good, "m7_p", &[r#""--1""#], "a finite number of mm or degrees");
    // Only a curve has an end. In other moves the key has no meaning and is reported.
    look(r#"{"reqType":"AddRCC","instructions":[{"action":"10","m0_p":"3"}]}"#, |message| {
        assert_eq!(extras(message), [("m0_p".to_owned(), ExtraKind::OutOfPlace)]);
    });
}

const PATH_SPEED: &str = r#""action":"51","isUse":"1","speed":"1234""#;

#[test]
fn instruction_51_is_use() {
    for (form, read) in [(r#""1""#, true), ("0", false)] {
        let Action::PathSpeed(speed) = action(&PATH_SPEED.replace("\"1\"", form)) else {
            panic!("no path speed")
        };
        assert_eq!(speed.in_use, read);
    }
    refuses(PATH_SPEED, "isUse", &["2", r#""on""#, "null"], "1 or 0");
    requires(PATH_SPEED, "isUse", "1 or 0");
}

#[test]
fn instruction_51_speed() {
    let Action::PathSpeed(speed) = action(PATH_SPEED) else { panic!("no path speed") };
    assert_eq!(speed.speed, Some(1234.0));
    assert_eq!(sent(Action::PathSpeed(speed)), r#""isUse":"1","speed":"1234""#);
    // A controller refuses fractions of a mm/s with alarm 219. The decoder accepts them.
    let Action::PathSpeed(slow) = action(&PATH_SPEED.replace("1234", "0.05")) else {
        panic!("no path speed")
    };
    assert_eq!(slow.speed, Some(0.05));
    let Action::PathSpeed(off) = action(r#""action":"51","isUse":"0""#) else { panic!("no path speed") };
    assert_eq!((off.speed, sent(Action::PathSpeed(off))), (None, r#""isUse":"0""#.to_owned()));
    refuses(PATH_SPEED, "speed", &[r#""fast""#, r#""""#, "null"], "a number of mm/s");
}

const STOP: &str = r#""action":"52","isUse":"1","ioNumber":"5","io_status":"1""#;

#[test]
fn instruction_52_is_use() {
    for (form, read) in [("\"isUse\":1", true), ("\"isUse\":\"0\"", false)] {
        let Action::StopOnSignal(stop) = action(&STOP.replace("\"isUse\":\"1\"", form)) else {
            panic!("no stop")
        };
        assert_eq!((stop.in_use, stop.input, stop.on), (read, 5, true));
    }
    refuses(STOP, "isUse", &["2", r#""""#], "1 or 0");
    requires(STOP, "isUse", "1 or 0");
}

#[test]
fn instruction_52_io_number() {
    for input in [0_u8, 5, 31] {
        let Action::StopOnSignal(stop) = action(&STOP.replace("\"5\"", &format!("\"{input}\""))) else {
            panic!("no stop")
        };
        assert_eq!(stop.input, input);
        let members = format!(r#""isUse":"1","ioNumber":"{input}","io_status":"1""#);
        assert_eq!(sent(Action::StopOnSignal(stop)), members);
    }
    refuses(STOP, "ioNumber", &["32", "-1", r#""X010""#, "1.5", "261"], "a point from 0 to 31");
    requires(STOP, "ioNumber", "a point from 0 to 31");
    let mut stop = r6_proto::message::instruction::StopOnSignal { in_use: true, input: 32, on: true };
    assert_eq!(refused_to_send(Action::StopOnSignal(stop)), "ioNumber");
    stop.input = 31;
    assert!(sent(Action::StopOnSignal(stop)).contains("31"));
}

#[test]
fn instruction_52_io_status() {
    let Action::StopOnSignal(stop) = action(&STOP.replace("\"io_status\":\"1\"", "\"io_status\":0")) else {
        panic!("no stop")
    };
    assert!(!stop.on);
    refuses(STOP, "io_status", &["2", r#""high""#], "1 or 0");
    requires(STOP, "io_status", "1 or 0");
}

fn refused_to_send(action: Action) -> &'static str {
    let list = [Instruction { oneshot: false, action }];
    let request = Request::AddRcc { empty_list: true, instructions: &list };
    request.encode(&Addressing::default(), &mut Vec::new()).unwrap_err().field
}

const WAIT: &str = r#""action":"100","type":"1","point":"7","io_status":"2","limit":"2.5","isUnlimit":"0""#;

fn wait(from: &str, to: &str) -> r6_proto::message::instruction::Wait {
    assert!(WAIT.contains(from), "{from}");
    match action(&WAIT.replace(from, to)) {
        Action::Wait(wait) => wait,
        other => panic!("{other:?}"),
    }
}

#[test]
fn instruction_100_type() {
    let source = |kind: u8| wait("\"type\":\"1\"", &format!("\"type\":\"{kind}\"")).source;
    for board in 0..=4 {
        assert_eq!(source(board), WaitSource::Input { board, point: 7 });
    }
    for board in 0..=2 {
        assert_eq!(source(board + 5), WaitSource::M { board, point: 7 });
    }
    assert_eq!(source(8), WaitSource::Eu { point: 7 });
    assert_eq!(source(100), WaitSource::Time);
    for kind in [0, 4, 5, 7, 8] {
        let wait = r6_proto::message::instruction::Wait { source: source(kind), ..wait("", "") };
        assert!(sent(Action::Wait(wait)).starts_with(&format!(r#""type":"{kind}","point":"7""#)));
    }
    refuses(WAIT, "type", &["9", "99", "101", "-1", r#""X""#, "256"], "100 (time)");
    requires(WAIT, "type", "0–4 (X), 5–7 (M), 8 (EU) or 100 (time)");
    // Boards without a number are not sent.
    for source in [WaitSource::Input { board: 5, point: 0 }, WaitSource::M { board: 3, point: 0 }] {
        assert_eq!(
            refused_to_send(Action::Wait(r6_proto::message::instruction::Wait { source, ..wait("", "") })),
            "type"
        );
    }
}

#[test]
fn instruction_100_point() {
    assert_eq!(wait("\"7\"", "31").source, WaitSource::Input { board: 1, point: 31 });
    refuses(WAIT, "point", &["32", "-1", r#""X017""#, "263"], "a point from 0 to 31");
    requires(WAIT, "point", "a point from 0 to 31");
    // A wait for time needs no point.
    let Action::Wait(wait) = action(r#""action":"100","type":"100","limit":"1.5""#) else {
        panic!("no wait")
    };
    assert_eq!((wait.source, wait.limit), (WaitSource::Time, 1.5));
    let beyond = r6_proto::message::instruction::Wait { source: WaitSource::Eu { point: 32 }, ..wait };
    assert_eq!(refused_to_send(Action::Wait(beyond)), "point");
}

#[test]
fn instruction_100_io_status() {
    let conditions =
        [WaitCondition::Off, WaitCondition::On, WaitCondition::RisingEdge, WaitCondition::FallingEdge];
    for (number, condition) in conditions.into_iter().enumerate() {
        let read = wait("\"io_status\":\"2\"", &format!("\"io_status\":{number}"));
        assert_eq!(read.condition, condition);
        assert!(sent(Action::Wait(read)).contains(&format!(r#""io_status":"{number}""#)));
    }
    refuses(WAIT, "io_status", &["4", "-1", r#""on""#, "true"], "0 off, 1 on, 2 rising or 3 falling");
    requires(WAIT, "io_status", "0 off, 1 on, 2 rising or 3 falling");
}

#[test]
fn instruction_100_limit() {
    assert!((wait("\"2.5\"", "2.5").limit - 2.5).abs() < 1e-12);
    assert_eq!(
        sent(Action::Wait(wait("\"2.5\"", "\"10\""))),
        r#""type":"1","point":"7","io_status":"2","limit":"10","isUnlimit":"0""#
    );
    let Action::Wait(without) = action(r#""action":"100","type":"0","point":"0","io_status":"1""#) else {
        panic!("no wait")
    };
    assert_eq!((without.limit, without.unlimited), (0.0, false));
    refuses(WAIT, "limit", &["-1", r#""""#, "86401", r#""1 s""#], "seconds from 0 to 86400");
}

#[test]
fn instruction_100_is_unlimit() {
    assert!(wait("\"isUnlimit\":\"0\"", "\"isUnlimit\":\"1\"").unlimited);
    assert!(!wait("\"isUnlimit\":\"0\"", "\"isUnlimit\":0").unlimited);
    refuses(WAIT, "isUnlimit", &["2", r#""""#, "null"], "1 or 0");
}

const OUTPUT: &str = r#""action":"200","type":"0","io_status":"1","point":"3","delay":"1""#;

fn output(from: &str, to: &str) -> r6_proto::message::instruction::Output {
    assert!(OUTPUT.contains(from), "{from}");
    match action(&OUTPUT.replace(from, to)) {
        Action::Output(output) => output,
        other => panic!("{other:?}"),
    }
}

#[test]
fn instruction_200_type() {
    for (number, kind) in
        [(0, OutputKind::Y), (5, OutputKind::M), (7, OutputKind::Euy), (100, OutputKind::TimedY)]
    {
        let read = output("\"type\":\"0\"", &format!("\"type\":{number}"));
        assert_eq!(read.kind, kind);
        let members = format!(r#""type":"{number}","io_status":"1","point":"3","delay":"1""#);
        assert_eq!(sent(Action::Output(read)), members);
    }
    refuses(OUTPUT, "type", &["1", "6", "101", "-1", r#""Y""#], "0 (Y), 5 (M), 7 (EUY) or 100 (timed Y)");
    requires(OUTPUT, "type", "0 (Y), 5 (M), 7 (EUY) or 100 (timed Y)");
}

#[test]
fn instruction_200_io_status() {
    assert!(output("\"io_status\":\"1\"", "\"io_status\":1").on);
    assert!(!output("\"io_status\":\"1\"", "\"io_status\":\"0\"").on);
    refuses(OUTPUT, "io_status", &["2", r#""""#, "[]"], "1 or 0");
    requires(OUTPUT, "io_status", "1 or 0");
}

#[test]
fn instruction_200_point() {
    for point in [0_u8, 31, 32] {
        assert_eq!(output("\"point\":\"3\"", &format!("\"point\":\"{point}\"")).point, point);
    }
    refuses(OUTPUT, "point", &["33", "-1", r#""Y013""#], "a point from 0 to 32");
    requires(OUTPUT, "point", "a point from 0 to 32");
    let beyond = r6_proto::message::instruction::Output { point: 33, ..output("", "") };
    assert_eq!(refused_to_send(Action::Output(beyond)), "point");
}

#[test]
fn instruction_200_delay() {
    assert_eq!(output("\"delay\":\"1\"", "\"delay\":0.5").delay.to_string(), "0.5");
    let Action::Output(without) = action(r#""action":"200","type":"0","io_status":"1","point":"3""#) else {
        panic!("no output")
    };
    assert_eq!(without.delay.to_string(), "0");
    refuses(OUTPUT, "delay", &["-1", r#""1 s""#, "null", "1e9"], "seconds from 0 to 86400");
}

const BOARD: &str = r#""action":"204","type":"0","point":"151388258","point2":"393222""#;

fn board_output(from: &str, to: &str) -> r6_proto::message::instruction::BoardOutput {
    assert!(BOARD.contains(from), "{from}");
    match action(&BOARD.replace(from, to)) {
        Action::BoardOutput(output) => output,
        other => panic!("{other:?}"),
    }
}

#[test]
fn instruction_204_type() {
    let boards =
        [(0, OutputBoard::Y(0)), (1, OutputBoard::Y(1)), (5, OutputBoard::M(0)), (6, OutputBoard::M(1))];
    for (number, board) in boards {
        let read = board_output("\"type\":\"0\"", &format!("\"type\":\"{number}\""));
        assert_eq!(read.board, board);
        let members = format!(r#""type":"{number}","point":"151388258","point2":"393222""#);
        assert_eq!(sent(Action::BoardOutput(read)), members);
    }
    refuses(BOARD, "type", &["2", "4", "7", "-1", r#""Y0""#], "0, 1 (Y) or 5, 6 (M)");
    requires(BOARD, "type", "0, 1 (Y) or 5, 6 (M)");
    for board in [OutputBoard::Y(2), OutputBoard::M(2)] {
        let beyond = r6_proto::message::instruction::BoardOutput { board, ..board_output("", "") };
        assert_eq!(refused_to_send(Action::BoardOutput(beyond)), "type");
    }
}

#[test]
fn instruction_204_point() {
    // The later manual's example: Y010, Y012, Y020, Y025 on and Y013, Y021, Y024 off.
    let read = board_output("", "");
    assert_eq!(read.low.bits(), 0x0906_0062);
    let points: Vec<_> = read.low.points().collect();
    let expected = [(0, true), (2, true), (3, false), (8, true), (9, false), (12, false), (13, true)];
    assert_eq!(points, expected);
    assert_eq!(board_output("\"151388258\"", "4294967295").low.bits(), u32::MAX);
    refuses(
        BOARD,
        "point",
        &["-1", "4294967296", "1.5", r#""0x3""#],
        "a number of 32 bits, two for each point",
    );
}

#[test]
fn instruction_204_point2() {
    assert_eq!(board_output("", "").high.bits(), 0x0006_0006);
    // If point2 is absent, points 16 to 31 stay as they are.
    let short = action(r#""action":"204","type":"0","point":"10""#);
    let Action::BoardOutput(short) = short else { panic!("{short:?}") };
    assert_eq!((short.low.bits(), short.high.bits()), (10, 0));
    assert_eq!(sent(Action::BoardOutput(short)), r#""type":"0","point":"10","point2":"0""#);
    refuses(BOARD, "point2", &["-1", "4294967296", r#""""#], "a number of 32 bits, two for each point");
}

#[test]
fn instruction_800_cnt_id() {
    let good = r#""action":"800","cnt_id":"3""#;
    for (form, read) in [("\"3\"", 3), ("3", 3), ("\"0\"", 0), ("4294967295", u32::MAX)] {
        let Action::Workbench(bench) = action(&good.replace("\"3\"", form)) else { panic!("no workbench") };
        assert_eq!(bench.id, read);
        assert_eq!(sent(Action::Workbench(bench)), format!(r#""cnt_id":"{read}""#));
    }
    refuses(good, "cnt_id", &["-1", "4294967296", r#""bench""#, "0.5"], "a number from 0");
    requires(good, "cnt_id", "a number from 0");
}

// The fields of points.

const POINT: &str = r#""ModelID":"1","X":"1.5","Y":"2.5","Z":"3.5","U":"4.5","V":"5.5","Angel":"6.5","Similarity":"98.5","Color":"2","Rel":"1""#;

/// Reads a point with one member replaced or removed.
fn point(field: &str, value: Option<&str>) -> Result<Point, FieldError> {
    let members: Vec<String> = POINT
        .split(',')
        .filter_map(|member| {
            let (key, _) = member.split_once(':')?;
            match value {
                _ if key.trim_matches('"') != field => Some(member.to_owned()),
                Some(value) => Some(format!("{key}:{value}")),
                None => None,
            }
        })
        .collect();
    let frame =
        format!(r#"{{"reqType":"AddPoints","dsData":[{{"camID":0,"data":[{{{}}}]}}]}}"#, members.join(","));
    look(frame, |message| match message.body {
        Body::AddPoints(points) => Ok(points.sets().next().unwrap().1[0]),
        Body::Rejected(rejection) => Err(rejection.error.clone()),
        other => panic!("{other:?}"),
    })
}

/// A decimal number is read with or without quotes; anything else is refused.
fn check_decimal(
    field: &str,
    read: impl Fn(&Point) -> Option<f64>,
    absent: Option<Option<f64>>,
    wanted: &str,
) {
    for form in [r#""-12.25""#, "-12.25", "-1225e-2"] {
        assert_eq!(point(field, Some(form)).map(|point| read(&point)), Ok(Some(-12.25)), "{form}");
    }
    for form in [r#""""#, r#""x""#, "null", "true", r#""NaN""#] {
        let error = point(field, Some(form)).unwrap_err();
        check_error(&error, &format!("point[0].{field}"), Some(form), wanted);
    }
    match (absent, point(field, None)) {
        (Some(absent), Ok(point)) => assert_eq!(read(&point), absent),
        (None, Err(error)) => check_error(&error, &format!("point[0].{field}"), None, wanted),
        (absent, read) => panic!("{field}: {absent:?}, {read:?}"),
    }
}

#[test]
fn add_points_cam_id() {
    for (form, read) in [("0", 0), (r#""7""#, 7), ("-1", -1)] {
        look(format!(r#"{{"reqType":"AddPoints","dsData":[{{"camID":{form},"data":[]}}]}}"#), |message| {
            let Body::AddPoints(points) = message.body else { panic!("{message:?}") };
            assert_eq!(points.sets().map(|(id, points)| (id, points.len())).collect::<Vec<_>>(), [(read, 0)]);
        });
    }
    for (member, found) in
        [("\"camID\":\"left\",", Some("\"left\"")), ("", None), ("\"camID\":1.5,", Some("1.5"))]
    {
        let frame =
            format!(r#"{{"reqType":"AddPoints","dsData":[{{"camID":0,"data":[]}},{{{member}"data":[]}}]}}"#);
        look(frame, |message| {
            let Body::Rejected(rejection) = message.body else { panic!("{message:?}") };
            check_error(rejection.error, "dsData[1].camID", found, "a whole number");
        });
    }
}

#[test]
fn add_points_model_id() {
    assert_eq!(point("ModelID", Some("3")).map(|point| point.model_id), Ok(3));
    assert_eq!(point("ModelID", Some("\"3\"")).map(|point| point.model_id), Ok(3));
    assert_eq!(point("ModelID", None).map(|point| point.model_id), Ok(0));
    let error = point("ModelID", Some("\"cap\"")).unwrap_err();
    check_error(&error, "point[0].ModelID", Some("\"cap\""), "a whole number");
}

#[test]
fn add_points_x() {
    check_decimal("X", |point| Some(point.x), None, "a finite number of mm");
}

#[test]
fn add_points_y() {
    check_decimal("Y", |point| Some(point.y), None, "a finite number of mm");
}

#[test]
fn add_points_z() {
    // An absent Z is not 0: the tool keeps its height.
    check_decimal("Z", |point| point.z, Some(None), "a finite number of mm");
}

#[test]
fn add_points_u() {
    // A four-axis arm has no U.
    check_decimal("U", |point| point.u, Some(None), "a finite number of degrees");
}

#[test]
fn add_points_v() {
    check_decimal("V", |point| point.v, Some(None), "a finite number of degrees");
}

#[test]
fn add_points_angel() {
    // An absent angle is not 0: the wrist keeps its angle.
    check_decimal("Angel", |point| point.angle, Some(None), "a finite number of degrees");
}

#[test]
fn add_points_similarity() {
    check_decimal("Similarity", |point| point.similarity, Some(None), "a finite number");
}

#[test]
fn add_points_color() {
    assert_eq!(point("Color", Some("2")).map(|point| point.color), Ok(Some(2)));
    assert_eq!(point("Color", Some("\"-2\"")).map(|point| point.color), Ok(Some(-2)));
    assert_eq!(point("Color", None).map(|point| point.color), Ok(None));
    let error = point("Color", Some("\"red\"")).unwrap_err();
    check_error(&error, "point[0].Color", Some("\"red\""), "a whole number");
}

#[test]
fn add_points_rel() {
    for (form, read) in [("1", true), ("\"1\"", true), ("0", false), ("false", false)] {
        assert_eq!(point("Rel", Some(form)).map(|point| point.relative), Ok(read), "{form}");
    }
    assert_eq!(point("Rel", None).map(|point| point.relative), Ok(false));
    let error = point("Rel", Some("2")).unwrap_err();
    check_error(&error, "point[0].Rel", Some("2"), "1 or 0");
    let whole = point("", None).unwrap();
    assert!(whole.relative);
    let frame = encoded(&Request::AddPoints(&[CameraPoints { cam_id: 0, points: &[whole] }]));
    assert!(
        frame.ends_with(
            r#"[{"ModelID":1,"X":1.500,"Y":2.500,"Z":3.500,"U":4.500,"V":5.500,"Angel":6.500,"Similarity":98.5,"Color":2,"Rel":1}]}]}"#
        ),
        "{frame}"
    );
}

#[test]
fn photo_cam_id() {
    for (form, read) in [("3", 3), ("\"3\"", 3), ("-1", -1)] {
        look(format!(r#"{{"reqType":"photo","camID":{form}}}"#), |message| {
            assert!(matches!(message.body, Body::Photo(Photo { cam_id }) if cam_id == read), "{form}");
        });
    }
    for (member, found) in
        [("", None), (r#","camID":"left""#, Some(r#""left""#)), (r#","camID":null"#, Some("null"))]
    {
        look(format!(r#"{{"reqType":"photo"{member}}}"#), |message| {
            let Body::Rejected(rejection) = message.body else { panic!("{message:?}") };
            assert_eq!(rejection.request, RequestType::Photo);
            check_error(rejection.error, "camID", found, "a whole number");
        });
    }
}

#[test]
fn photo_ret() {
    for (form, read) in [("1", 1), ("\"1\"", 1), ("0", 0), ("-7", -7)] {
        look(format!(r#"{{"reqType":"photo","camID":0,"ret":{form}}}"#), |message| {
            assert!(matches!(message.body, Body::PhotoAnswer(answer) if answer.ret == read), "{form}");
        });
    }
    look(r#"{"reqType":"photo","camID":0,"ret":"done"}"#, |message| {
        let Body::Rejected(rejection) = message.body else { panic!("{message:?}") };
        check_error(rejection.error, "ret", Some(r#""done""#), "a whole number");
    });
}

// Replies in every dialect.

fn query_reply(dialect: Dialect, request: &str, fill: impl FnOnce(&mut DataWriter<'_, '_>)) -> String {
    let mut out = Vec::new();
    look(request, |message| {
        let Body::Query(query) = message.body else { panic!("{message:?}") };
        ReplyWriter::new(dialect, message.header, RequestType::Query).query(query.addresses, &mut out, fill);
    });
    String::from_utf8(out).unwrap()
}

fn verdict(dialect: Dialect, request: &str, word: &str, verdict: Verdict<'_>) -> String {
    let mut out = Vec::new();
    look(request, |message| {
        let kind = match message.body {
            Body::Command(_) => RequestType::Command,
            Body::AddRcc(_) => RequestType::AddRcc,
            Body::AddPoints(_) => RequestType::AddPoints,
            other => panic!("{other:?}"),
        };
        ReplyWriter::new(dialect, message.header, kind).verdict(word, verdict, &mut out);
    });
    String::from_utf8(out).unwrap()
}

fn outcome(reply: &str) -> (Option<String>, Outcome) {
    look(reply, |message| match message.body {
        Body::CommandReply(reply) => (reply.command().map(|word| word.into_owned()), reply.outcome()),
        other => panic!("{other:?}"),
    })
}

const COMMAND: &str = r#"{"dsID":"d","reqType":"command","packID":"9","cmdData":["actionStop"]}"#;

#[test]
fn reply_dialect_old() {
    // The form that manual 4.2 prints, with the type of the request. Captures show `cmdEcho` with the
    // command's name.
    let manual = Dialect {
        reply_type: Dialect::HC1.reply_type,
        command_reply: CommandReplyForm::Verdict,
        ..Dialect::LEGACY
    };
    let ok = verdict(manual, COMMAND, "actionStop", Verdict::Ok);
    assert_eq!(ok, r#"{"dsID":"d","reqType":"command","cmdReply":["ok"]}"#);
    assert_eq!(outcome(&ok), (None, Outcome::Ok));
    for refused in [Verdict::Err("no such thing"), Verdict::BareErr] {
        let refused = verdict(manual, COMMAND, "actionStop", refused);
        assert_eq!(refused, r#"{"dsID":"d","reqType":"command","cmdReply":[""]}"#);
        assert_eq!(outcome(&refused), (None, Outcome::Refused(None)));
    }
    // The manual's comment can also be read as a bare text.
    assert_eq!(outcome(r#"{"reqType":"command","cmdReply":""}"#), (None, Outcome::Refused(None)));
    assert_eq!(outcome(r#"{"reqType":"command","cmdReply":"ok"}"#), (None, Outcome::Ok));
    assert_eq!(outcome(r#"{"reqType":"command","cmdReply":[]}"#), (None, Outcome::Refused(None)));
    // Replies to AddRCC always carry the name.
    let list = r#"{"dsID":"d","reqType":"AddRCC","instructions":[]}"#;
    for (dialect, word) in [(Dialect::LEGACY, "command"), (manual, "AddRCC")] {
        let ok = verdict(dialect, list, "AddRCC", Verdict::Ok);
        assert_eq!(ok, format!(r#"{{"dsID":"d","reqType":"{word}","cmdReply":["AddRCC","ok"]}}"#));
    }
}

#[test]
fn reply_dialect_new() {
    let ok = verdict(Dialect::HC1, COMMAND, "actionStop", Verdict::Ok);
    assert_eq!(ok, r#"{"cmdReply":["actionStop","ok"],"dsID":"d","packID":"9","reqType":"command"}"#);
    assert_eq!(outcome(&ok), (Some("actionStop".to_owned()), Outcome::Ok));
    let ok = verdict(Dialect::R6, COMMAND, "actionStop", Verdict::Ok);
    assert_eq!(ok, r#"{"dsID":"d","reqType":"command","cmdReply":["actionStop","ok"]}"#);
    let refused = verdict(Dialect::HC1, COMMAND, "actionStop", Verdict::Err("not \"now\""));
    assert_eq!(
        outcome(&refused),
        (Some("actionStop".to_owned()), Outcome::Refused(Some("not \"now\"".to_owned())))
    );
    let list = r#"{"dsID":"d","reqType":"AddRCC","instructions":[]}"#;
    let refused = verdict(Dialect::HC1, list, "AddRCC", Verdict::BareErr);
    assert_eq!(refused, r#"{"cmdReply":["AddRCC","err"],"dsID":"d","reqType":"AddRCC"}"#);
    assert_eq!(outcome(&refused), (Some("AddRCC".to_owned()), Outcome::Refused(None)));
    let points = r#"{"dsID":"d","reqType":"AddPoints","dsData":[]}"#;
    let taken = verdict(Dialect::R6, points, "AddPoints", Verdict::Points(12));
    assert_eq!(taken, r#"{"dsID":"d","reqType":"command","cmdReply":["AddPoints","12"]}"#);
    assert_eq!(outcome(&taken), (Some("AddPoints".to_owned()), Outcome::Points(12)));
    // A number counts points only in a reply to AddPoints.
    assert_eq!(
        outcome(r#"{"reqType":"command","cmdReply":["modifyGSPD","12"]}"#).1,
        Outcome::Unclear("12".to_owned())
    );
    for wrong in [r#""cmdReply":7"#, r#""cmdReply":null"#, r#""cmdReply":{}"#] {
        look(format!(r#"{{"reqType":"command",{wrong}}}"#), |message| {
            let Body::Rejected(rejection) = message.body else { panic!("{message:?}") };
            assert_eq!(rejection.error.path.to_string(), "cmdReply");
        });
    }
}

#[test]
fn query_echo() {
    let request =
        r#"{"dsID":"HCRemoteMonitor","cmdType":"query","packID":"1","queryAddr":["counter-4","isMoving"]}"#;
    let counter = Counter { id: 4, target: 20, current: 7, name: Some("计数".to_owned()) };
    let fill = |data: &mut DataWriter<'_, '_>| {
        data.counter(&counter);
        data.flag(true);
    };
    let legacy = query_reply(Dialect::LEGACY, request, fill);
    assert_eq!(
        legacy,
        r#"{"dsID":"HCRemoteMonitor","cmdType":"queryEcho","queryData":["计数[4][T:20][C:7]","1"]}"#
    );
    assert_eq!(
        query_reply(Dialect::R6, request, fill),
        r#"{"dsID":"HCRemoteMonitor","cmdType":"query","queryData":[["4","20","7"],"1"]}"#
    );
    assert_eq!(
        query_reply(Dialect::HC1, request, fill),
        r#"{"cmdType":"query","dsID":"HCRemoteMonitor","packID":"1","queryAddr":["counter-4","isMoving"],"queryData":[[4,20,7],"1"]}"#
    );
    for reply in [&legacy, &legacy.replace("cmdType", "reqType")] {
        look(reply, |message| {
            let Body::QueryReply(reply) = message.body else { panic!("{message:?}") };
            assert!(reply.addresses.is_none());
            assert_eq!(reply.values.len(), 2);
        });
    }
    // An echo without values is a broken reply, not a request.
    look(r#"{"cmdType":"queryEcho","queryAddr":["version"]}"#, |message| {
        let Body::Rejected(rejection) = message.body else { panic!("{message:?}") };
        check_error(rejection.error, "queryData", None, "a list of values");
    });
}

#[test]
fn cmd_echo() {
    let captured = r#"{"dsID":"HCRemoteMonitor","cmdType":"cmdEcho","cmdReply":["modifyOutput","ok"]}"#;
    assert_eq!(outcome(captured), (Some("modifyOutput".to_owned()), Outcome::Ok));
    assert_eq!(outcome(&captured.replace("cmdType", "reqType")).1, Outcome::Ok);
    let request = r#"{"dsID":"HCRemoteMonitor","cmdType":"command","cmdData":["modifyOutput","0","1","1"]}"#;
    assert_eq!(verdict(Dialect::LEGACY, request, "modifyOutput", Verdict::Ok), captured);
    look(r#"{"cmdType":"cmdEcho","cmdData":["actionStop"]}"#, |message| {
        let Body::Rejected(rejection) = message.body else { panic!("{message:?}") };
        check_error(rejection.error, "cmdReply", None, "a list of words");
    });
}

// The header.

#[test]
fn header_ds_id() {
    // The reply repeats any dsID byte for byte. It has no other effect.
    for ds_id in [r#""www.hc-system.com.cam""#, r#""any\u0074hing""#, "7", "null", r#""""#] {
        let request = format!(r#"{{"dsID":{ds_id},"reqType":"query","queryAddr":[]}}"#);
        assert_eq!(
            query_reply(Dialect::HC1, &request, |_| {}),
            format!(r#"{{"dsID":{ds_id},"queryAddr":[],"queryData":[],"reqType":"query"}}"#)
        );
    }
    // If the request has no dsID, the reply has the long form.
    assert_eq!(
        query_reply(Dialect::HC1, r#"{"reqType":"query","queryAddr":[]}"#, |_| {}),
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","queryAddr":[],"queryData":[],"reqType":"query"}"#
    );
}

#[test]
fn header_req_type() {
    for kind in RequestType::ALL {
        assert_eq!(kind.to_string(), kind.word());
    }
    let told = |frame: &str| {
        look(frame, |message| match message.body {
            Body::Unknown(unknown) => unknown.to_string(),
            other => panic!("{other:?}"),
        })
    };
    assert_eq!(
        told(r#"{"reqType":"qeury"}"#),
        "`reqType` is `qeury`, which is no request type; nearest: `query`"
    );
    assert_eq!(
        told(r#"{"reqType":"actionStop"}"#),
        "`reqType` is `actionStop`, which is no request type; it is a command: send it as `reqType` \"command\" with `cmdData`"
    );
    assert_eq!(told("{}"), "the frame has neither `reqType` nor anything to tell its type by");
    assert!(told(r#"{"reqType":7}"#).starts_with("`reqType` is `7`"));
    // Without a type, the payload decides.
    type IsRight = fn(&Body<'_>) -> bool;
    let absent: [(&str, IsRight); 5] = [
        (r#""queryAddr":["version"]"#, |body| matches!(body, Body::Query(_))),
        (r#""queryData":["v1"]"#, |body| matches!(body, Body::QueryReply(_))),
        (r#""cmdData":["actionStop"]"#, |body| matches!(body, Body::Command(_))),
        (r#""instructions":[]"#, |body| matches!(body, Body::AddRcc(_))),
        (r#""dsData":[]"#, |body| matches!(body, Body::AddPoints(_))),
    ];
    for (payload, is_right) in absent {
        look(format!("{{{payload}}}"), |message| {
            assert_eq!(message.header.type_key, TypeKey::Absent);
            assert!(is_right(&message.body), "{payload}: {:?}", message.body);
        });
    }
    // A word with escapes is the same word.
    look(r#"{"req\u0054ype":"\u0071uery","queryAddr":["\u0076ersion"]}"#, |message| {
        let Body::Query(query) = message.body else { panic!("{message:?}") };
        assert_eq!(query.resolved().next().map(|(_, address)| address), Some(Ok(Address::Version)));
        assert_eq!(message.extras().len(), 0);
    });
}

#[test]
fn header_pack_id() {
    for pack_id in [r#""0""#, r#""a\"b\\c}""#, "14", "null", r#""机器人""#] {
        let request = format!(r#"{{"reqType":"query","packID":{pack_id},"queryAddr":[]}}"#);
        look(&request, |message| {
            assert_eq!(message.header.pack_id.map(|value| format!("{value:?}")), Some(pack_id.to_owned()));
        });
        let reply = query_reply(Dialect::HC1, &request, |_| {});
        assert!(reply.contains(&format!(r#","packID":{pack_id},"#)), "{reply}");
        for dialect in [Dialect::R6, Dialect::LEGACY] {
            assert!(!query_reply(dialect, &request, |_| {}).contains("packID"));
        }
    }
    // Without a packID in the request, the reply has none (captured, unit D).
    assert!(!query_reply(Dialect::HC1, r#"{"reqType":"query","queryAddr":[]}"#, |_| {}).contains("packID"));
    let addressing = Addressing { pack_id: Some("7\""), ..Addressing::default() };
    let mut out = Vec::new();
    assert_eq!(Request::Heartbreak.encode(&addressing, &mut out), Ok(()));
    assert_eq!(
        String::from_utf8(out).unwrap(),
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"heartbreak","packID":"7\""}"#
    );
}

#[test]
fn instruction_10_and_17_have_the_manner_of_4() {
    let members = r#""ckStatus":"0x05","speed":"12.5","delay":"0.5","smooth":"7","tool":"2","coord":"3""#;
    let wanted = manner(members);
    assert_eq!((wanted.tool, wanted.coord, wanted.delay), (Some(2), Some(3), Some(0.5)));
    let Action::LinearMove(line) = action(&format!(r#""action":"10","m0":"1",{members}"#)) else {
        panic!("action 10 is a linear move")
    };
    let Action::CurveMove(curve) = action(&format!(r#""action":"17","m0":"1","m0_p":"2",{members}"#)) else {
        panic!("action 17 is a curve move")
    };
    assert_eq!((line.manner, curve.manner), (wanted, wanted));
    for number in ["10", "17"] {
        let wrong = instruction(&format!(r#""action":"{number}","smooth":"10""#)).unwrap_err();
        assert_eq!(wrong.path.to_string(), "instructions[0].smooth");
    }
}
