//! One client, whatever the pieces in which its bytes come.

use proptest::prelude::*;
use r6_proto::Address;

use super::*;
use crate::core::camera::MAX_POINTS;
use crate::core::order::Order;
use crate::core::raw::asked::MAX_ADDRESSES;

fn at(ms: u64) -> Instant {
    Instant::ORIGIN + Duration::from_millis(ms)
}

/// Takes out all requests that may begin.
fn begun(session: &mut Session) -> Vec<(Ticket, Asked)> {
    std::iter::from_fn(|| session.poll_request()).collect()
}

/// All replies, each as it leaves.
fn sent(session: &mut Session) -> Vec<String> {
    let mut frames = Vec::new();
    while let Some(frame) = session.poll_transmit() {
        let frame = String::from_utf8(frame.to_vec()).unwrap();
        session.transmitted(frame.len());
        frames.push(frame);
    }
    frames
}

fn values(values: &[&str]) -> Answer {
    Answer::Values(values.iter().map(|value| value.as_bytes().to_vec()).collect())
}

const QUERY: &str = r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"7","queryAddr":["curMode","nope","axis-0"]}"#;
const STOP: &str =
    r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","packID":"8","cmdData":["actionStop"]}"#;

/// The body of a request of a browser is never taken for a frame.
#[test]
fn a_web_page_cannot_send_frames() {
    for head in ["POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", "\r\nGET /x{ HTTP/1.1\r\n", "x", "\u{0}", "["]
    {
        let mut page = Session::new();
        page.handle_input(at(0), head.as_bytes());
        page.handle_input(at(1), [STOP, QUERY].concat().as_bytes());
        assert_eq!((page.closed(), begun(&mut page)), (Some(Cause::Garbage), Vec::new()), "{head:?}");
    }
}

#[test]
fn a_query_has_a_limit() {
    let query = |count: usize| {
        format!(
            r#"{{"reqType":"query","packID":"1","queryAddr":[{}]}}"#,
            vec!["\"curMode\""; count].join(",")
        )
    };
    let mut session = Session::new();
    session.handle_input(at(0), query(MAX_ADDRESSES + 1).as_bytes());
    assert!(begun(&mut session).is_empty());
    session.handle_input(at(0), query(MAX_ADDRESSES).as_bytes());
    assert!(matches!(&begun(&mut session)[..], [(_, Asked::Query(known))] if known.len() == MAX_ADDRESSES));
}

#[test]
fn a_reply_repeats_what_the_client_sent_and_has_the_digits_of_the_robot() {
    let mut session = Session::new();
    assert_eq!(session.handle_input(at(0), QUERY.as_bytes()), 1);
    let [(ticket, Asked::Query(addresses))] = &begun(&mut session)[..] else { panic!() };
    assert_eq!(addresses.iter().map(Address::to_string).collect::<Vec<_>>(), ["curMode", "axis-0"]);
    session.answer(*ticket, Dialect::HC1, &values(&["\"7\"", "\"-0.050000\""]));
    assert_eq!(
        sent(&mut session),
        [
            r#"{"dsID":"www.hc-system.com.RemoteMonitor","packID":"7","queryAddr":["curMode","nope","axis-0"],"queryData":["7","-0.050000"],"reqType":"query"}"#
        ]
    );
    assert!(session.is_idle());

    let old = r#"{"dsID":"HCRemoteMonitor","cmdType":"query","queryAddr":["curMode"]}"#;
    session.handle_input(at(0), old.as_bytes());
    let (ticket, _) = begun(&mut session).remove(0);
    session.answer(ticket, Dialect::LEGACY, &values(&["\"7\""]));
    assert_eq!(sent(&mut session), [r#"{"dsID":"HCRemoteMonitor","cmdType":"queryEcho","queryData":["7"]}"#]);
}

#[test]
fn a_stop_overtakes_what_waits_and_replies_keep_their_order() {
    let mut session = Session::new();
    let bytes = [QUERY, QUERY, STOP, QUERY].concat();
    assert_eq!(session.handle_input(at(0), bytes.as_bytes()), 4);
    let first = begun(&mut session);
    assert!(matches!(&first[..], [(_, Asked::Stop(_)), (_, Asked::Query(_))]), "{first:?}");
    session.answer(first[0].0, Dialect::HC1, &Answer::Accepted);
    assert!(begun(&mut session).is_empty(), "the second query waits for the first");
    assert!(sent(&mut session).is_empty(), "and the stop's reply for both");
    session.answer(first[1].0, Dialect::HC1, &values(&[]));
    assert_eq!(sent(&mut session).len(), 1);
    let (second, _) = begun(&mut session).remove(0);
    session.answer(second, Dialect::HC1, &Answer::Silence);
    let replies = sent(&mut session);
    assert_eq!(replies.len(), 1, "{replies:?}");
    assert!(replies[0].contains(r#""cmdReply":["actionStop","ok"]"#), "{replies:?}");
    assert_eq!(begun(&mut session).len(), 1);
}

#[test]
fn a_refusal_is_err_with_the_reason() {
    let mut session = Session::new();
    for (frame, request) in [
        (r#"{"reqType":"command","packID":1,"cmdData":["fly","1"]}"#, "fly"),
        (r#"{"reqType":"command","packID":1,"cmdData":["modifyGSPD","x"]}"#, "modifyGSPD"),
        (r#"{"reqType":"AddRCC","packID":1,"instructions":[]}"#, "AddRCC"),
        (
            r#"{"reqType":"AddRCC","packID":1,"emptyList":"1","instructions":[{"oneshot":"1","action":"14"}]}"#,
            "AddRCC",
        ),
        (
            r#"{"reqType":"AddRCC","packID":1,"emptyList":"1","instructions":[{"action":"51","isUse":"0"}]}"#,
            "AddRCC",
        ),
        (
            r#"{"reqType":"AddRCC","packID":1,"emptyList":"1","instructions":[{"oneshot":"1","action":"51","isUse":"1","isUse":"0"}]}"#,
            "AddRCC",
        ),
        (
            r#"{"reqType":"AddRCC","packID":1,"emptyList":"1","dsData":[{"camID":"0","data":[{"oneshot":"1","action":"51","isUse":"0"}]}]}"#,
            "AddRCC",
        ),
        (r#"{"reqType":"AddPoints","packID":1,"dsData":[]}"#, "AddPoints"),
    ] {
        session.handle_input(at(0), frame.as_bytes());
        let (ticket, asked) = begun(&mut session).remove(0);
        let Asked::Refused { request: what, reason } = asked else { panic!("{frame}: {asked:?}") };
        assert_eq!(what, request);
        session.answer(ticket, Dialect::HC1, &Answer::Refused(Some(reason)));
        let reply = sent(&mut session).remove(0);
        assert!(reply.contains(&format!(r#""cmdReply":["{request}","err",""#)), "{reply}");
    }
}

#[test]
fn what_controllers_do_not_answer_is_not_answered_and_not_carried_out() {
    let mut session = Session::new();
    for frame in [
        r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"heartbreak"}"#,
        r#"{"dsID":"www.hc-system.com.cam","camID":0,"ret":1}"#,
        r#"{"reqType":"nothing"}"#,
        r#"{"cmdData":["startButton"]}"#,
        r#"{"queryAddr":["curMode"]}"#,
    ] {
        assert_eq!(session.handle_input(at(0), frame.as_bytes()), 1, "{frame}");
        assert_eq!(begun(&mut session), [], "{frame}");
    }
    assert!(session.is_idle());
    session.handle_input(at(0), br#"{"cmdData":["actionStop"]}"#);
    let (ticket, asked) = begun(&mut session).remove(0);
    assert!(matches!(asked, Asked::Stop(_)), "a stop is carried out all the same");
    session.answer(ticket, Dialect::HC1, &Answer::Accepted);
    assert!(session.is_idle() && session.poll_transmit().is_none());
}

/// What a client asks for with this frame, and what it is answered then.
fn asked_and_told(frame: &str, answer: &Answer) -> (Asked, Vec<String>) {
    let mut session = Session::new();
    assert_eq!(session.handle_input(at(0), frame.as_bytes()), 1, "{frame}");
    let (ticket, asked) = begun(&mut session).remove(0);
    session.answer(ticket, Dialect::HC1, answer);
    assert!(session.waiting.is_empty());
    (asked, sent(&mut session))
}

const POINT: &str = r#"{"ModelID":0,"X":888.001,"Y":1345.001,"Angel":123.123,"Rel":0}"#;

#[test]
fn the_parts_of_a_camera_are_asked_for_and_their_number_is_told() {
    let frame = |set: &str| {
        format!(r#"{{"dsID":"www.hc-system.com.cam","reqType":"AddPoints","packID":"3","dsData":[{set}]}}"#)
    };
    let two = frame(&format!(r#"{{"camID":7,"data":[{POINT},{POINT}]}}"#));
    let (asked, told) = asked_and_told(&two, &Answer::Taken(Some(2)));
    let Asked::Order(Order::Points { camera, points }) = asked else { panic!("{asked:?}") };
    assert_eq!((camera.number(), points.len(), points[1].x), (7, 2, 888.001));
    assert!(told.len() == 1 && told[0].contains(r#""cmdReply":["AddPoints","2"]"#), "{told:?}");
    assert!(told[0].contains(r#""packID":"3""#), "{told:?}");
    let (_, told) = asked_and_told(&two, &Answer::Taken(None));
    assert!(told[0].contains(r#"["AddPoints","ok"]"#), "{told:?}");
    let (_, told) = asked_and_told(&two, &Answer::Silence);
    assert_eq!(told, [] as [String; 0], "an unknown outcome");
    let (asked, _) = asked_and_told(&frame(r#"{"camID":0,"data":[]}"#), &Answer::Taken(Some(0)));
    assert!(matches!(&asked, Asked::Order(Order::Points { points, .. }) if points.is_empty()), "{asked:?}");

    let many = vec![POINT; MAX_POINTS + 1].join(",");
    for (set, reason) in [
        (r#"{"camID":0,"data":[]},{"camID":1,"data":[]}"#.to_owned(), "one camera"),
        (r#"{"camID":1000,"data":[]}"#.to_owned(), "`camID` is 1000"),
        (r#"{"camID":-1,"data":[]}"#.to_owned(), "`camID` is -1"),
        (format!(r#"{{"camID":0,"data":[{many}]}}"#), "at most 50 points"),
        (format!(r#"{{"camID":0,"camID":1,"data":[{POINT}]}}"#), "`camID`"),
        (format!(r#"{{"camID":0,"data":[{}]}}"#, POINT.replace("\"Rel\":0", "\"Rel\":0,\"Rel\":1")), "`Rel`"),
        (format!(r#"{{"camID":0,"data":[{}]}}"#, POINT.replace("\"Rel\":0", "\"Rel\":0,\"w\":1")), "`w`"),
    ] {
        let refused = Answer::Refused(Some("no".to_owned()));
        let (asked, told) = asked_and_told(&frame(&set), &refused);
        let Asked::Refused { request, reason: why } = asked else { panic!("{set}: {asked:?}") };
        assert!(request == "AddPoints" && why.contains(reason), "{why}");
        assert!(told[0].contains(r#""cmdReply":["AddPoints","err","no"]"#), "{told:?}");
    }
}

#[test]
fn an_answer_to_a_photo_is_asked_for_and_gets_no_reply() {
    for (end, taken) in [
        (r#""camID":2,"ret":1"#, Some(true)),
        (r#""camID":2,"ret":0"#, Some(false)),
        (r#""camID":2,"ret":2"#, None),
        (r#""camID":1000,"ret":1"#, None),
        (r#""camID":2,"ret":1,"ret":0"#, None),
    ] {
        let frame = format!(r#"{{"dsID":"www.hc-system.com.cam","reqType":"photo",{end}}}"#);
        for answer in [Answer::Silence, Answer::Accepted, Answer::Refused(Some("no".to_owned()))] {
            let (asked, told) = asked_and_told(&frame, &answer);
            assert_eq!(told, [] as [String; 0], "{frame}");
            match (asked, taken) {
                (Asked::Order(Order::Photo { camera, taken }), Some(wanted)) => {
                    assert_eq!((camera.number(), taken), (2, wanted));
                }
                (Asked::Refused { request, .. }, None) => assert_eq!(request, "photo"),
                (asked, _) => panic!("{frame}: {asked:?}"),
            }
        }
    }
}

#[test]
fn a_photo_is_asked_for_as_the_controller_does_and_cuts_no_reply() {
    let mut session = Session::new();
    session.handle_input(at(0), QUERY.as_bytes());
    let (ticket, _) = begun(&mut session).remove(0);
    session.answer(ticket, Dialect::HC1, &values(&["\"7\"", "\"0\""]));
    let reply = session.poll_transmit().unwrap().to_vec();
    session.transmitted(10);
    session.push_photo(Camera::new(0).unwrap());
    assert_eq!(session.poll_transmit().unwrap(), &reply[10..]);
    session.transmitted(reply.len() - 10);
    // Captured from a controller.
    assert_eq!(sent(&mut session), [r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0}"#]);
    for _ in 0..=MAX_OUTPUT / 60 {
        session.push_photo(Camera::new(0).unwrap());
    }
    assert_eq!(session.closed(), Some(Cause::SlowReader), "it does not read");
}

#[test]
fn the_limits_close_a_client() {
    let mut many = Session::new();
    many.handle_input(at(0), QUERY.repeat(MAX_WAITING).as_bytes());
    assert_eq!(many.closed(), None);
    many.handle_input(at(0), [QUERY, STOP].concat().as_bytes());
    assert_eq!(many.closed(), Some(Cause::TooManyRequests));
    let mut eight = Session::new();
    eight.handle_input(at(0), [QUERY.repeat(MAX_WAITING), STOP.to_owned()].concat().as_bytes());
    assert_eq!(eight.closed(), None, "stops have places of their own");

    let mut long = Session::new();
    let bytes = [br#"{"x":""#.as_slice(), &vec![b'a'; 1 << 20]].concat();
    long.handle_input(at(0), &bytes);
    assert_eq!(long.closed(), Some(Cause::LongFrame));

    let mut garbage = Session::new();
    garbage.handle_input(at(0), "}x{]".repeat(200).as_bytes());
    assert_eq!(garbage.closed(), Some(Cause::Garbage));
    let mut broken = Session::new();
    broken.handle_input(at(0), "{x}".repeat(200).as_bytes());
    assert_eq!(broken.closed(), Some(Cause::Garbage));
    let mut blanks = Session::new();
    assert_eq!(blanks.handle_input(at(0), [" \r\n", QUERY].concat().as_bytes()), 1);
    let mut some = Session::new();
    for _ in 0..100 {
        some.handle_input(at(0), [r#"{"a" 1}"#, QUERY].concat().as_bytes());
        let (ticket, _) = begun(&mut some).remove(0);
        some.answer(ticket, Dialect::HC1, &Answer::Silence);
    }
    assert_eq!(some.closed(), None, "a broken frame now and then is passed over");

    let mut half = Session::new();
    half.handle_input(at(0), b"{\"reqType\"");
    assert_eq!(half.poll_timeout(), Some(at(10_000)));
    half.handle_input(at(9_000), b":");
    half.handle_timeout(at(9_999));
    assert_eq!(half.closed(), None);
    half.handle_timeout(at(10_000));
    assert_eq!(half.closed(), Some(Cause::HalfFrame), "one byte now and then is not enough");

    let mut slow = Session::new();
    let reply = ["\"1\""; 1_000];
    for number in 0.. {
        slow.handle_input(at(0), QUERY.as_bytes());
        let (ticket, _) = begun(&mut slow).remove(0);
        slow.answer(ticket, Dialect::HC1, &values(&reply));
        if slow.closed().is_some() {
            assert!((10..=17).contains(&number), "{number}");
            break;
        }
    }
    assert_eq!(slow.closed(), Some(Cause::SlowReader));
}

#[test]
fn a_stop_is_carried_out_although_its_client_has_to_be_closed() {
    let mut session = Session::new();
    session.handle_input(at(0), [STOP.to_owned(), QUERY.repeat(9)].concat().as_bytes());
    assert_eq!(session.closed(), Some(Cause::TooManyRequests));
    let begun = begun(&mut session);
    assert!(matches!(&begun[..], [(_, Asked::Stop(_))]), "{begun:?}");
}

proptest! {
    /// Whatever the pieces in which the bytes come and the order in which requests are answered: every
    /// request is begun once, stops at once, all others one by one, and replies leave in the order of the
    /// requests.
    #[test]
    fn every_request_is_answered_once_and_in_order(
        kinds in prop::collection::vec(any::<bool>(), 1..8),
        cuts in prop::collection::vec(1..60_usize, 1..40),
        order in prop::collection::vec(any::<prop::sample::Index>(), 40),
    ) {
        let frame = |(number, stop): (usize, &bool)| match stop {
            true => format!(r#"{{"reqType":"command","packID":"{number}","cmdData":["actionPause"]}}"#),
            false => format!(r#"{{"reqType":"query","packID":"{number}","queryAddr":["curMode"]}}"#),
        };
        let frames: Vec<_> = kinds.iter().enumerate().map(frame).collect();
        let bytes = frames.join("\r\n").into_bytes();
        let mut session = Session::new();
        let (mut rest, mut cuts) = (&bytes[..], cuts.iter().cycle());
        let (mut open, mut done, mut replies) = (Vec::new(), 0, Vec::new());
        for pick in order {
            if !rest.is_empty() {
                let (piece, behind) = rest.split_at((*cuts.next().unwrap()).min(rest.len()));
                session.handle_input(at(0), piece);
                rest = behind;
            }
            open.extend(begun(&mut session));
            let others = open.iter().filter(|(_, asked)| !matches!(asked, Asked::Stop(_))).count();
            prop_assert!(others <= 1, "{:?}", open);
            if !open.is_empty() {
                let (ticket, asked) = open.swap_remove(pick.index(open.len()));
                let answer = if matches!(asked, Asked::Stop(_)) { Answer::Accepted } else { values(&["\"2\""]) };
                session.answer(ticket, Dialect::HC1, &answer);
                done += 1;
            }
            replies.extend(sent(&mut session));
        }
        while !rest.is_empty() || !open.is_empty() || done < kinds.len() {
            session.handle_input(at(0), rest);
            rest = &[];
            open.extend(begun(&mut session));
            let (ticket, _) = open.remove(0);
            session.answer(ticket, Dialect::HC1, &Answer::Accepted);
            done += 1;
            replies.extend(sent(&mut session));
        }
        prop_assert_eq!(done, kinds.len());
        let numbers: Vec<_> = replies.iter().map(|reply| {
            reply.split(r#""packID":""#).nth(1).unwrap().split('"').next().unwrap().parse::<usize>().unwrap()
        }).collect();
        prop_assert!(numbers.is_sorted(), "{:?}", replies);
        prop_assert!(session.is_idle());
    }

    /// Whatever bytes come in whatever pieces: no panic, nothing beyond the limits is kept, and a session
    /// that is to be closed begins nothing but stops.
    #[test]
    fn no_bytes_do_harm(
        pieces in prop::collection::vec(prop_oneof![
            3 => prop::collection::vec(any::<u8>(), 0..200),
            3 => prop::sample::select(vec![QUERY, STOP, "{", "}", "\"", "[", r#"{"reqType":"AddRCC","#, r#""instructions":[{"#,
                r#"{"reqType":"command","cmdData":["startButton"]}"#]).prop_map(|text| text.as_bytes().to_vec()),
            1 => (0..40_000_usize).prop_map(|count| vec![b'{'; count]),
        ], 0..60),
        answers in any::<bool>(),
    ) {
        let mut session = Session::new();
        for (number, piece) in (0..).zip(pieces) {
            session.handle_input(at(number * 100), &piece);
            session.handle_timeout(at(number * 100));
            let was_closed = session.closed().is_some();
            for (ticket, asked) in begun(&mut session) {
                prop_assert!(!was_closed || matches!(asked, Asked::Stop(_)), "{:?}", asked);
                if answers {
                    session.answer(ticket, Dialect::HC1, &Answer::Refused(None));
                }
            }
            prop_assert!(session.waiting.len() <= 2 * MAX_WAITING + 1 + 60);
            let kept: usize = session.waiting.iter().map(|waiting| waiting.frame.len()).sum();
            prop_assert!(kept <= session.waiting.len() * MAX_FRAME);
        }
    }
}
