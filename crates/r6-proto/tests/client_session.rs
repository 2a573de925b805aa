//! Tests of the client session: which reply belongs to which request, and what the session reports if it
//! cannot know.

use std::time::Duration;

use r6_proto::client::{
    ClientSession, ClientSettings, Event, LearnedDialect, SendError, StrayReason, Ticket,
};
use r6_proto::dialect::{CommandReplyForm, CounterForm, Dialect, DsIdForm};
use r6_proto::message::command::Outcome;
use r6_proto::message::instruction::{Action, BlendLevel, Coordinates, Instruction, Manner, Move};
use r6_proto::message::{Body, LengthMismatch, PhotoAnswer, TypeKey};
use r6_proto::time::Instant;
use r6_proto::{Address, AxisIndex, AxisMask, Command, Decoder, Message, Request};
use r6_testkit::transcript::{self, Side, Transcript};

/// An event of a session, as an owned value.
#[derive(Clone, Debug, PartialEq)]
enum Seen {
    /// A query reply: its values, and how long the reply took in ms.
    Values(Ticket, Vec<String>, u128),
    /// The reply to a command, AddPoints or AddRCC.
    Outcome(Ticket, Outcome),
    /// A reply that the session cannot read.
    Rejected(Ticket, String),
    Photo(i64),
    Stray(StrayReason),
    BadFrame,
    NotJson(usize),
    TimedOut(Ticket),
    Lost(Ticket, bool),
    OutOfStep,
}

impl Seen {
    fn of(event: Event<'_>) -> Self {
        match event {
            Event::Reply { ticket, message, after } => match message.body {
                Body::QueryReply(reply) => Self::Values(
                    ticket,
                    reply.values.iter().map(|value| value.text().into_owned()).collect(),
                    after.as_millis(),
                ),
                Body::CommandReply(reply) => Self::Outcome(ticket, reply.outcome()),
                Body::Rejected(rejection) => Self::Rejected(ticket, rejection.error.path.to_string()),
                other => panic!("no reply: {other:?}"),
            },
            Event::Photo { cam_id, .. } => Self::Photo(cam_id),
            Event::Stray { reason, .. } => Self::Stray(reason),
            Event::BadFrame(_) => Self::BadFrame,
            Event::NotJson(error) => Self::NotJson(error.at),
            Event::TimedOut(ticket) => Self::TimedOut(ticket),
            Event::Lost { ticket, left } => Self::Lost(ticket, left),
            Event::OutOfStep => Self::OutOfStep,
        }
    }
}

fn at(ms: u64) -> Instant {
    Instant::ORIGIN + Duration::from_millis(ms)
}

fn session() -> ClientSession {
    ClientSession::new(ClientSettings::default())
}

/// Gives all bytes to the session and returns its events.
fn feed(session: &mut ClientSession, ms: u64, bytes: impl AsRef<[u8]>) -> Vec<Seen> {
    let mut rest = bytes.as_ref();
    let mut seen = Vec::new();
    loop {
        let taken = session.handle_input(at(ms), rest);
        rest = &rest[taken..];
        seen.extend(told(session, ms));
        if rest.is_empty() {
            return seen;
        }
    }
}

fn told(session: &mut ClientSession, ms: u64) -> Vec<Seen> {
    let mut seen = Vec::new();
    while let Some(event) = session.poll_event(at(ms)) {
        seen.push(Seen::of(event));
    }
    seen
}

fn pass_time(session: &mut ClientSession, ms: u64) -> Vec<Seen> {
    session.handle_timeout(at(ms));
    told(session, ms)
}

#[track_caller]
fn sent(session: &mut ClientSession, ms: u64, request: &Request<'_>) -> Ticket {
    session.send(at(ms), request).unwrap_or_else(|error| panic!("{error}"))
}

/// Returns all waiting bytes and marks them as written.
fn written(session: &mut ClientSession) -> String {
    let bytes = session.poll_transmit().unwrap_or_default().to_vec();
    session.transmitted(bytes.len());
    String::from_utf8_lossy(&bytes).into_owned()
}

const MODE: &[Address] = &[Address::CurMode];
const ALARM: &[Address] = &[Address::CurAlarm];

fn query(addresses: &[Address]) -> Request<'_> {
    Request::Query(addresses)
}

fn reply(pack_id: Ticket, address: &str, value: &str) -> String {
    format!(
        r#"{{"dsID":"www.hc-system.com.RemoteMonitor","packID":"{}","queryAddr":["{address}"],"queryData":["{value}"],"reqType":"query"}}"#,
        pack_id.number()
    )
}

/// The reply of firmware that echoes nothing.
fn bare_reply(value: &str) -> String {
    format!(r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryData":["{value}"]}}"#)
}

fn verdict(pack_id: Ticket, word: &str) -> String {
    format!(
        r#"{{"cmdReply":["{word}","ok"],"dsID":"d","packID":"{}","reqType":"command"}}"#,
        pack_id.number()
    )
}

fn one(value: &str) -> Vec<String> {
    vec![value.to_owned()]
}

fn axis_move() -> Instruction {
    let target = Coordinates::from_slice(&[0.0, 10.0, -20.0, 0.0, 30.0, 0.0]);
    let smooth = BlendLevel::new(0);
    let manner = Manner {
        mask: Some(AxisMask::SIX),
        speed: Some(20.0),
        delay: Some(0.0),
        smooth,
        ..Manner::default()
    };
    Instruction { oneshot: true, action: Action::AxisMove(Move { target, manner }) }
}

#[test]
fn replies_are_matched_by_pack_id_in_any_order() {
    let mut session = session();
    let (mode, alarm) = (sent(&mut session, 0, &query(MODE)), sent(&mut session, 1, &query(ALARM)));
    let stop = sent(&mut session, 2, &Request::Command(&Command::ActionStop));
    assert_eq!([mode.number(), alarm.number(), stop.number()], [1, 2, 3]);
    let stream =
        [verdict(stop, "actionStop"), reply(alarm, "curAlarm", "42"), reply(mode, "curMode", "7")].concat();
    assert_eq!(
        feed(&mut session, 9, stream),
        [
            Seen::Outcome(stop, Outcome::Ok),
            Seen::Values(alarm, one("42"), 8),
            Seen::Values(mode, one("7"), 9),
        ]
    );
    assert_eq!(session.poll_timeout(), None);
}

#[test]
fn a_pack_id_may_come_back_as_a_number() {
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    let unquoted = reply(mode, "curMode", "7").replace("\"packID\":\"1\"", "\"packID\":1");
    assert_eq!(feed(&mut session, 3, unquoted), [Seen::Values(mode, one("7"), 3)]);
}

#[test]
fn replies_without_pack_id_are_matched_by_kind_and_order() {
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    let stop = sent(&mut session, 0, &Request::Command(&Command::ActionStop));
    let alarm = sent(&mut session, 0, &query(ALARM));
    // The reply to the command comes first; the replies to the two queries come in their order.
    let old_ok = r#"{"dsID":"HCRemoteMonitor","cmdType":"cmdEcho","cmdReply":["ok"]}"#;
    assert_eq!(feed(&mut session, 5, old_ok), [Seen::Outcome(stop, Outcome::Ok)]);
    assert_eq!(
        feed(&mut session, 6, [bare_reply("7"), bare_reply("0")].concat()),
        [Seen::Values(mode, one("7"), 6), Seen::Values(alarm, one("0"), 6)]
    );
    assert_eq!(
        session.learned(),
        LearnedDialect {
            echoes_pack_id: Some(false),
            echoes_query_addr: Some(false),
            names_command: Some(false),
            echo_types: Some(true),
            sorts_keys: Some(false),
        }
    );
    assert_eq!(
        session.learned().dialect(),
        Dialect {
            counter: CounterForm::Numbers,
            command_reply: CommandReplyForm::Verdict,
            ..Dialect::LEGACY
        }
    );
}

#[test]
fn a_first_reply_that_names_nothing_answers_neither_of_two_queries() {
    // The controller does not answer the first query. Its reply to the second could be taken for the first
    // one's.
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    let alarm = sent(&mut session, 0, &query(ALARM));
    assert_eq!(
        feed(&mut session, 5, bare_reply("42")),
        [Seen::Stray(StrayReason::OutOfStep), Seen::OutOfStep]
    );
    assert_eq!(pass_time(&mut session, 2000), [Seen::TimedOut(mode), Seen::TimedOut(alarm)]);
}

#[test]
fn a_request_of_which_nothing_left_can_be_taken_back() {
    let mut session = session();
    let first = session.send(at(0), &query(MODE)).unwrap();
    let list = [axis_move()];
    let motion = session.send(at(0), &Request::AddRcc { empty_list: true, instructions: &list }).unwrap();
    let stop = session.send(at(0), &Request::Command(&Command::ActionStop)).unwrap();
    session.transmitted(1);
    assert!(!session.withdraw(first), "a byte of it has left");
    assert!(session.withdraw(motion));
    assert!(!session.withdraw(motion), "it is gone");
    let output = String::from_utf8(session.poll_transmit().unwrap().to_vec()).unwrap();
    assert!(!output.contains("AddRCC") && output.contains("actionStop"), "{output}");
    // The session still knows how much of each request has left: a part of the query, nothing of the stop.
    session.handle_disconnect();
    let mut lost = Vec::new();
    while let Some(event) = session.poll_event(at(1)) {
        lost.push(Seen::of(event));
    }
    assert_eq!(lost, [Seen::Lost(first, true), Seen::Lost(stop, false)]);
}

#[test]
fn an_unnamed_ok_answers_a_command_and_never_a_motion() {
    let mut session = session();
    let list = [axis_move()];
    let motion = sent(&mut session, 0, &Request::AddRcc { empty_list: true, instructions: &list });
    let stop = sent(&mut session, 1, &Request::Command(&Command::ActionStop));
    let ok = r#"{"dsID":"HCRemoteMonitor","cmdType":"cmdEcho","cmdReply":["ok"]}"#;
    assert_eq!(feed(&mut session, 5, ok), [Seen::Outcome(stop, Outcome::Ok)]);
    let refused = r#"{"dsID":"HCRemoteCommand","reqType":"command","cmdReply":["AddRCC","err"]}"#;
    assert_eq!(feed(&mut session, 20, refused), [Seen::Outcome(motion, Outcome::Refused(None))]);
    // The words of AddRCC are the same in every dialect, so they taught nothing about commands.
    assert_eq!(session.learned().names_command, Some(false));
    assert_eq!(session.learned().echo_types, Some(true));
}

#[test]
fn a_broken_reply_is_matched_only_where_it_can_mean_one_request() {
    let mut session = session();
    let broken = r#"{"dsID":"HCRemoteMonitor","reqType":"cmdEcho","cmdReply":7}"#;
    let stop = sent(&mut session, 0, &Request::Command(&Command::ActionStop));
    let start = sent(&mut session, 0, &Request::Command(&Command::StartButton));
    assert_eq!(feed(&mut session, 1, broken), [Seen::Stray(StrayReason::Contradiction)]);
    let ok = r#"{"dsID":"HCRemoteMonitor","cmdType":"cmdEcho","cmdReply":["ok"]}"#;
    assert_eq!(feed(&mut session, 2, ok), [Seen::Outcome(stop, Outcome::Ok)]);
    assert_eq!(feed(&mut session, 3, broken), [Seen::Rejected(start, "cmdReply".to_owned())]);
}

#[test]
fn a_broken_photo_request_answers_nothing_and_breaks_nothing() {
    let mut session = session();
    sent(&mut session, 0, &query(MODE));
    session.handle_timeout(at(10_000));
    assert!(matches!(session.poll_event(at(10_000)), Some(Event::TimedOut(_))));
    let photo = r#"{"dsID":"www.hc-system.com.cam","reqType":"photo"}"#;
    assert_eq!(feed(&mut session, 10_001, photo), [Seen::Stray(StrayReason::NoReply)]);
}

#[test]
fn without_pack_id_the_named_command_decides() {
    let mut session = session();
    let stop = sent(&mut session, 0, &Request::Command(&Command::ActionStop));
    let pause = sent(&mut session, 0, &Request::Command(&Command::ActionPause));
    let named = |word: &str| format!(r#"{{"cmdReply":["{word}","ok"],"reqType":"command"}}"#);
    assert_eq!(feed(&mut session, 5, named("actionPause")), [Seen::Outcome(pause, Outcome::Ok)]);
    assert_eq!(feed(&mut session, 6, named("startButton")), [Seen::Stray(StrayReason::NothingWaits)]);
    assert_eq!(feed(&mut session, 7, named("actionStop")), [Seen::Outcome(stop, Outcome::Ok)]);
}

#[test]
fn without_pack_id_echoed_addresses_decide() {
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    let alarm = sent(&mut session, 0, &query(ALARM));
    let echo = |name: &str| format!(r#"{{"queryAddr":["{name}"],"queryData":["5"],"reqType":"query"}}"#);
    assert_eq!(feed(&mut session, 5, echo("curAlarm")), [Seen::Values(alarm, one("5"), 5)]);
    assert_eq!(feed(&mut session, 5, echo("isMoving")), [Seen::Stray(StrayReason::NothingWaits)]);
    assert_eq!(feed(&mut session, 5, echo("curMode")), [Seen::Values(mode, one("5"), 5)]);
}

#[test]
fn a_late_reply_is_never_matched_where_the_pack_id_comes_back() {
    let mut session = session();
    let first = sent(&mut session, 0, &query(MODE));
    assert_eq!(session.poll_timeout(), Some(at(2000)));
    assert_eq!(pass_time(&mut session, 1999), []);
    assert_eq!(pass_time(&mut session, 2000), [Seen::TimedOut(first)]);
    let second = sent(&mut session, 2001, &query(MODE));
    // The same addresses with the first request's number do not answer the second request.
    assert_eq!(
        feed(&mut session, 2002, reply(first, "curMode", "1")),
        [Seen::Stray(StrayReason::UnknownPackId)]
    );
    assert_eq!(feed(&mut session, 2003, reply(second, "curMode", "2")), [Seen::Values(second, one("2"), 2)]);
    // After the firmware is known to echo, a reply without packID answers no request.
    let third = sent(&mut session, 2004, &query(MODE));
    assert_eq!(feed(&mut session, 2005, bare_reply("1")), [Seen::Stray(StrayReason::UnknownPackId)]);
    assert_eq!(feed(&mut session, 2006, reply(third, "curMode", "3")), [Seen::Values(third, one("3"), 2)]);
}

#[test]
fn a_late_reply_is_never_matched_where_nothing_comes_back() {
    let mut session = session();
    let known = sent(&mut session, 0, &query(MODE));
    assert_eq!(feed(&mut session, 5, bare_reply("1")), [Seen::Values(known, one("1"), 5)]);
    let first = sent(&mut session, 10, &query(MODE));
    assert_eq!(pass_time(&mut session, 2010), [Seen::TimedOut(first), Seen::OutOfStep]);
    // It is not known whether this is the late reply or the next one.
    let second = sent(&mut session, 2011, &query(MODE));
    assert_eq!(feed(&mut session, 2012, bare_reply("2")), [Seen::Stray(StrayReason::OutOfStep)]);
    assert_eq!(feed(&mut session, 2013, bare_reply("3")), [Seen::Stray(StrayReason::OutOfStep)]);
    // The event is reported once, and the request ends like any other.
    assert_eq!(pass_time(&mut session, 4011), [Seen::TimedOut(second)]);
}

/// Found by `make sim SEED=1235`: the session took an unrequested reply for an answer, and each later reply
/// for the answer to the next request. A reply with more values than the query asked for shows this.
#[test]
fn where_nothing_comes_back_a_reply_with_too_many_values_shows_that_replies_are_out_of_step() {
    let mut session = session();
    let two = sent(&mut session, 0, &query(&[Address::CurMode, Address::CurAlarm]));
    // No query asked for this reply.
    assert_eq!(feed(&mut session, 1, bare_reply("7")), [Seen::Values(two, one("7"), 1)]);
    let next = sent(&mut session, 2, &query(MODE));
    let late = r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryData":["7","0"]}"#;
    assert_eq!(feed(&mut session, 3, late), [Seen::Stray(StrayReason::OutOfStep), Seen::OutOfStep]);
    assert_eq!(feed(&mut session, 4, bare_reply("7")), [Seen::Stray(StrayReason::OutOfStep)]);
    assert_eq!(pass_time(&mut session, 2002), [Seen::TimedOut(next)]);
}

#[test]
fn a_late_reply_is_never_matched_where_nothing_is_known_yet() {
    let mut session = session();
    let first = sent(&mut session, 0, &query(MODE));
    assert_eq!(pass_time(&mut session, 2000), [Seen::TimedOut(first)]);
    let second = sent(&mut session, 2001, &query(MODE));
    assert_eq!(
        feed(&mut session, 2002, bare_reply("1")),
        [Seen::Stray(StrayReason::OutOfStep), Seen::OutOfStep]
    );
    assert_eq!(pass_time(&mut session, 4001), [Seen::TimedOut(second)]);

    // The beginning is the same, but the next reply shows that this firmware echoes, so nothing is lost.
    let mut session = self::session();
    sent(&mut session, 0, &query(MODE));
    session.handle_timeout(at(2000));
    let second = sent(&mut session, 2001, &query(MODE));
    assert_eq!(told(&mut session, 2001).len(), 1);
    assert_eq!(feed(&mut session, 2003, reply(second, "curMode", "2")), [Seen::Values(second, one("2"), 2)]);
}

#[test]
fn a_repeated_reply_is_stray() {
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    let twice = [reply(mode, "curMode", "7"), reply(mode, "curMode", "8")].concat();
    assert_eq!(
        feed(&mut session, 4, twice),
        [Seen::Values(mode, one("7"), 4), Seen::Stray(StrayReason::UnknownPackId)]
    );
}

#[test]
fn a_contradictory_reply_is_stray_and_the_request_waits_on() {
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    let stop = sent(&mut session, 0, &Request::Command(&Command::ActionStop));
    let contradictions = [
        reply(stop, "curMode", "7"),
        verdict(mode, "actionStop"),
        verdict(stop, "actionPause"),
        reply(mode, "curAlarm", "7"),
        reply(mode, "curMode\",\"curAlarm", "7"),
    ];
    for frame in contradictions {
        assert_eq!(feed(&mut session, 3, &frame), [Seen::Stray(StrayReason::Contradiction)], "{frame}");
    }
    assert_eq!(feed(&mut session, 5, reply(mode, "curMode", "7")), [Seen::Values(mode, one("7"), 5)]);
    assert_eq!(feed(&mut session, 6, verdict(stop, "actionStop")), [Seen::Outcome(stop, Outcome::Ok)]);
}

#[test]
fn a_pack_id_that_was_never_given_is_stray() {
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    for wire in ["\"77\"", "\"\"", "\"-1\"", "\"1.5\"", "null", "[1]", "\"abc\"", "18446744073709551617"] {
        let frame = reply(mode, "curMode", "7").replace("\"packID\":\"1\"", &format!("\"packID\":{wire}"));
        assert_eq!(feed(&mut session, 3, frame), [Seen::Stray(StrayReason::UnknownPackId)], "{wire}");
    }
    assert_eq!(feed(&mut session, 5, reply(mode, "curMode", "7")), [Seen::Values(mode, one("7"), 5)]);
}

#[test]
fn a_reply_to_another_client_is_stray() {
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    let foreign = r#"{"packID":"900","queryAddr":["Addr-800"],"queryData":["0"],"reqType":"query"}"#;
    assert_eq!(feed(&mut session, 2, foreign), [Seen::Stray(StrayReason::UnknownPackId)]);
    // The same number by chance, but other addresses.
    let foreign = foreign.replace("900", "1");
    assert_eq!(feed(&mut session, 3, foreign), [Seen::Stray(StrayReason::Contradiction)]);
    assert_eq!(feed(&mut session, 4, reply(mode, "curMode", "7")), [Seen::Values(mode, one("7"), 4)]);
}

#[test]
fn requests_and_what_is_no_reply_are_stray() {
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    let echoed = written(&mut session);
    assert_eq!(feed(&mut session, 1, echoed), [Seen::Stray(StrayReason::Echo)]);
    for frame in [r#"{"reqType":"heartbreak"}"#, r#"{"reqType":"listModel"}"#, "{}"] {
        assert_eq!(feed(&mut session, 1, frame), [Seen::Stray(StrayReason::NoReply)], "{frame}");
    }
    assert_eq!(feed(&mut session, 2, reply(mode, "curMode", "7")), [Seen::Values(mode, one("7"), 2)]);
}

#[test]
fn a_reply_that_cannot_be_understood_still_ends_its_request() {
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    let broken = r#"{"packID":"1","reqType":"query","queryData":"7"}"#;
    assert_eq!(feed(&mut session, 3, broken), [Seen::Rejected(mode, "queryData".to_owned())]);
    assert_eq!(session.poll_timeout(), None);
}

#[test]
fn broken_bytes_cost_no_request() {
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    let stream = ["noise ", r#"{"reqType":"query","queryData":[01]}"#, &reply(mode, "curMode", "7")].concat();
    assert_eq!(
        feed(&mut session, 3, stream),
        [Seen::BadFrame, Seen::NotJson(33), Seen::Values(mode, one("7"), 3)]
    );
}

#[test]
fn half_a_reply_is_given_up_in_time() {
    let mut session = ClientSession::new(ClientSettings {
        reply_timeout: Duration::from_secs(60),
        ..ClientSettings::default()
    });
    let mode = sent(&mut session, 0, &query(MODE));
    let whole = reply(mode, "curMode", "7");
    assert_eq!(feed(&mut session, 100, &whole.as_bytes()[..40]), []);
    assert_eq!(session.poll_timeout(), Some(at(5100)));
    assert_eq!(pass_time(&mut session, 5099), []);
    assert_eq!(pass_time(&mut session, 5100), [Seen::BadFrame]);
    assert_eq!(session.poll_timeout(), Some(at(60_000)));
    assert_eq!(feed(&mut session, 5200, &whole), [Seen::Values(mode, one("7"), 5200)]);
}

#[test]
fn a_query_overtakes_add_rcc() {
    let mut session = session();
    let list = [axis_move()];
    let add = sent(&mut session, 0, &Request::AddRcc { empty_list: true, instructions: &list });
    let mode = sent(&mut session, 2, &query(MODE));
    assert_eq!(feed(&mut session, 6, reply(mode, "curMode", "7")), [Seen::Values(mode, one("7"), 4)]);
    assert_eq!(session.poll_timeout(), Some(at(2000)));
    // Captured controllers repeat the type; manual 6 prints `command`.
    for (ms, kind) in [(18, "AddRCC"), (40, "command")] {
        let add = if ms == 18 {
            add
        } else {
            sent(&mut session, 20, &Request::AddRcc { empty_list: false, instructions: &list })
        };
        let frame =
            verdict(add, "AddRCC").replace("\"reqType\":\"command\"", &format!("\"reqType\":\"{kind}\""));
        assert_eq!(feed(&mut session, ms, frame), [Seen::Outcome(add, Outcome::Ok)]);
    }
}

#[test]
fn a_photo_request_is_told_whatever_waits() {
    let photo = r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":3}"#;
    let mut session = session();
    assert_eq!(feed(&mut session, 0, photo), [Seen::Photo(3)]);
    let mode = sent(&mut session, 1, &query(MODE));
    let answer = reply(mode, "curMode", "7");
    let between = [&answer[..30], photo].concat();
    // The controller sends the photo between two whole frames. A photo inside a frame would make it invalid
    // JSON.
    assert_eq!(feed(&mut session, 2, [photo, &answer, photo].concat()).len(), 3);
    assert_ne!(feed(&mut session, 3, between), [Seen::Photo(3)]);
}

#[test]
fn a_photo_with_the_pack_id_of_a_request_answers_nothing() {
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    let photo = r#"{"camID":0,"dsID":"www.hc-system.com.cam","packID":"1","reqType":"photo"}"#;
    assert_eq!(feed(&mut session, 1, photo), [Seen::Photo(0)]);
    assert_eq!(feed(&mut session, 2, reply(mode, "curMode", "7")), [Seen::Values(mode, one("7"), 2)]);
}

#[test]
fn heartbeat_and_photo_answer_wait_for_nothing() {
    let mut session = session();
    sent(&mut session, 0, &Request::Heartbreak);
    sent(&mut session, 0, &Request::PhotoAnswer(PhotoAnswer { cam_id: 0, ret: 1 }));
    assert_eq!(
        written(&mut session),
        concat!(
            r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"heartbreak"}"#,
            r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0,"ret":1}"#,
        )
    );
    assert_eq!(session.poll_timeout(), None);
    session.handle_disconnect();
    assert_eq!(told(&mut session, 1), []);
}

#[test]
fn lost_requests_say_whether_they_left() {
    let mut session = session();
    let answered = sent(&mut session, 0, &query(MODE));
    written(&mut session);
    feed(&mut session, 1, reply(answered, "curMode", "7"));
    let whole = sent(&mut session, 2, &query(MODE));
    let length = session.poll_transmit().map_or(0, <[u8]>::len);
    let cut = sent(&mut session, 2, &query(MODE));
    let kept = sent(&mut session, 2, &query(ALARM));
    // The connection breaks after the first byte of the second of three frames.
    session.transmitted(length + 1);
    session.handle_disconnect();
    assert_eq!(
        told(&mut session, 3),
        [Seen::Lost(whole, true), Seen::Lost(cut, true), Seen::Lost(kept, false)]
    );

    // The connection breaks exactly between two frames.
    let mut session = self::session();
    let whole = sent(&mut session, 2, &query(MODE));
    let length = session.poll_transmit().map_or(0, <[u8]>::len);
    let kept = sent(&mut session, 2, &query(MODE));
    session.transmitted(length);
    session.handle_disconnect();
    assert_eq!(told(&mut session, 3), [Seen::Lost(whole, true), Seen::Lost(kept, false)]);
}

#[test]
fn what_was_received_before_the_end_still_counts() {
    let mut session = session();
    let mode = sent(&mut session, 0, &query(MODE));
    let alarm = sent(&mut session, 0, &query(ALARM));
    written(&mut session);
    // The shell drains the events before it reports the end of the connection.
    let last_words = [reply(mode, "curMode", "7"), r#"{"packID":"2","#.to_owned()].concat();
    assert_eq!(feed(&mut session, 1, last_words), [Seen::Values(mode, one("7"), 1)]);
    session.handle_disconnect();
    assert_eq!(told(&mut session, 1), [Seen::BadFrame, Seen::Lost(alarm, true)]);
    assert_eq!(session.poll_timeout(), None);
}

#[test]
fn a_short_reply_is_never_paired_with_the_addresses() {
    let mut session = session();
    let addresses = [Address::Version, Address::CurMold, Address::CurMode];
    let ticket = sent(&mut session, 0, &query(&addresses));
    let short = r#"{"packID":"1","queryAddr":["version","curMold","curMode"],"queryData":["v","7"],"reqType":"query"}"#;
    assert_eq!(session.handle_input(at(5), short.as_bytes()), short.len());
    match session.poll_event(at(5)) {
        Some(Event::Reply { ticket: answered, message, .. }) => {
            assert_eq!(answered, ticket);
            let Body::QueryReply(reply) = message.body else { panic!("{message:?}") };
            assert_eq!(
                reply.aligned(addresses.len()).map(|values| values.len()),
                Err(LengthMismatch { asked: 3, answered: 2 })
            );
            assert_eq!(reply.aligned(2).map(|values| values.len()), Ok(2));
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_frame_that_is_too_long_is_not_sent() {
    let mut session = session();
    let list = [axis_move(); 12];
    let before = session.next_pack_id();
    match session.send(at(0), &Request::AddRcc { empty_list: true, instructions: &list }) {
        Err(SendError::TooLong { bytes, limit: 2048 }) => assert!((2049..2600).contains(&bytes), "{bytes}"),
        other => panic!("{other:?}"),
    }
    assert_eq!(
        (session.poll_transmit(), session.poll_timeout(), session.next_pack_id()),
        (None, None, before)
    );
    // If another frame waits, only the long frame is removed.
    sent(&mut session, 0, &query(MODE));
    let waiting = session.poll_transmit().map(<[u8]>::to_vec);
    assert!(session.send(at(0), &Request::AddRcc { empty_list: true, instructions: &list }).is_err());
    assert_eq!(session.poll_transmit().map(<[u8]>::to_vec), waiting);
    assert!(session.send(at(0), &Request::AddRcc { empty_list: true, instructions: &list[..8] }).is_ok());
}

#[test]
fn a_value_that_the_wire_cannot_carry_is_not_sent() {
    let mut session = session();
    let mut bad = axis_move();
    if let Action::AxisMove(motion) = &mut bad.action {
        motion.target.set(AxisIndex::ALL[1], f64::NAN);
    }
    match session.send(at(0), &Request::AddRcc { empty_list: true, instructions: &[axis_move(), bad] }) {
        Err(SendError::Encode(error)) => assert_eq!(error.field, "m1"),
        other => panic!("{other:?}"),
    }
    assert_eq!((session.poll_transmit(), session.poll_timeout()), (None, None));
}

#[test]
fn only_so_many_requests_wait_at_once() {
    let mut session = ClientSession::new(ClientSettings { max_in_flight: 2, ..ClientSettings::default() });
    let first = sent(&mut session, 0, &query(MODE));
    sent(&mut session, 0, &query(MODE));
    assert_eq!(session.send(at(0), &query(MODE)), Err(SendError::TooManyInFlight { limit: 2 }));
    // A request without a reply is sent in any case. Otherwise a busy session would starve the watchdog.
    assert!(session.send(at(0), &Request::Heartbreak).is_ok());
    feed(&mut session, 1, reply(first, "curMode", "7"));
    assert!(session.send(at(1), &query(MODE)).is_ok());
}

#[test]
fn settings_shape_what_is_sent() {
    let mut session = ClientSession::new(ClientSettings {
        type_key: TypeKey::CmdType,
        ds_id: DsIdForm::Short,
        first_pack_id: 41,
        ..ClientSettings::default()
    });
    sent(&mut session, 0, &query(MODE));
    sent(&mut session, 0, &Request::AddRcc { empty_list: true, instructions: &[] });
    assert_eq!(
        written(&mut session),
        concat!(
            r#"{"dsID":"HCRemoteMonitor","cmdType":"query","packID":"41","queryAddr":["curMode"]}"#,
            r#"{"dsID":"HCRemoteCommand","cmdType":"AddRCC","packID":"42","emptyList":"1","instructions":[]}"#,
        )
    );
    assert_eq!(session.next_pack_id(), 43);
}

#[test]
fn the_output_is_written_in_pieces_of_any_size() {
    let mut session = session();
    let mut whole = Vec::new();
    let mut expected = String::new();
    for number in 1..=5_u64 {
        sent(&mut session, 0, &query(MODE));
        expected += &format!(
            r#"{{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"{number}","queryAddr":["curMode"]}}"#
        );
        // Fewer bytes than a frame leave before the next frame is sent.
        let some =
            session.poll_transmit().map(|bytes| bytes[..bytes.len().min(70)].to_vec()).unwrap_or_default();
        session.transmitted(some.len());
        whole.extend(some);
    }
    whole.extend(written(&mut session).into_bytes());
    assert_eq!(String::from_utf8_lossy(&whole), expected);
    assert_eq!(session.poll_transmit(), None);
}

#[test]
fn transcripts_are_understood_from_end_to_end() {
    for transcript in transcript::all() {
        replay(&transcript);
    }
}

/// Sends exactly the bytes that the PC sent. Every request must get its reply, and no frame may be stray.
fn replay(transcript: &Transcript) {
    let mut session = session();
    let mut waiting: Vec<Ticket> = Vec::new();
    let mut photos = 0;
    for write in &transcript.writes {
        let stem = &transcript.stem;
        if write.from == Side::Pc {
            let mut decoder = Decoder::new();
            let message = decoder.decode(&write.bytes).unwrap_or_else(|error| panic!("{stem}: {error}"));
            let pack_id = message.header.pack_id.and_then(|pack_id| pack_id.integer());
            let pack_id = pack_id.and_then(|number| u64::try_from(number).ok());
            if let Some(first_pack_id) = pack_id.filter(|number| *number != session.next_pack_id()) {
                // The recorded client uses its own numbers, so a new session starts at that number.
                assert_eq!(waiting, [], "{stem}");
                session = ClientSession::new(ClientSettings { first_pack_id, ..ClientSettings::default() });
            }
            if let Some(ticket) = send_again(&mut session, write.ms, &message) {
                waiting.push(ticket);
            }
            assert_eq!(written(&mut session).as_bytes(), write.bytes, "{stem} at {} ms", write.ms);
            continue;
        }
        for seen in feed(&mut session, write.ms, &write.bytes) {
            match seen {
                Seen::Values(ticket, _, after) => {
                    assert!(after <= 26, "{stem}: {after} ms");
                    waiting.retain(|other| *other != ticket);
                }
                Seen::Outcome(ticket, outcome) => {
                    assert_eq!(outcome, Outcome::Ok, "{stem}");
                    waiting.retain(|other| *other != ticket);
                }
                Seen::Photo(cam_id) => {
                    assert_eq!(cam_id, 0, "{stem}");
                    photos += 1;
                }
                other => panic!("{stem} at {} ms: {other:?}", write.ms),
            }
        }
    }
    assert_eq!(waiting, [], "{}: never answered", transcript.stem);
    assert_eq!(photos > 0, transcript.stem.contains("photo"), "{}", transcript.stem);
}

/// Sends the message again as a request. Returns the ticket if it expects a reply.
fn send_again(session: &mut ClientSession, ms: u64, message: &Message<'_>) -> Option<Ticket> {
    let mut send = |request: &Request<'_>| {
        let ticket = sent(session, ms, request);
        request.expects_reply().then_some(ticket)
    };
    match message.body {
        Body::Query(query) => {
            let addresses: Vec<Address> = query.resolved().filter_map(|(_, address)| address.ok()).collect();
            send(&Request::Query(&addresses))
        }
        Body::AddRcc(list) => {
            let empty_list = list.empty_list.unwrap_or(true);
            send(&Request::AddRcc { empty_list, instructions: list.instructions })
        }
        Body::PhotoAnswer(answer) => send(&Request::PhotoAnswer(answer)),
        other => panic!("no request of a transcript yet: {other:?}"),
    }
}
