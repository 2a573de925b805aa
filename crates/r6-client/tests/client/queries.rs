//! Queries that a controller answers in part, and queries that do not fit into one frame.

use r6_client::{NoReading, NotSent, QueryResult, RequestError, Robot};
use r6_proto::Reading;
use r6_proto::address::{Address, RegisterIndex};
use serde_json::Value;
use std::sync::{Arc, Mutex};

use crate::controller::{Controller, Peer, asked, settings, soon, values};

/// The addresses of each query, in the order in which the queries came.
type Log = Arc<Mutex<Vec<Vec<String>>>>;

/// A controller that leaves out the values it does not have, and remembers the queries.
fn leaving_out(missing: &'static [&'static str]) -> (impl FnMut(&Value) -> Option<String> + Send, Log) {
    let log = Log::default();
    let seen = Arc::clone(&log);
    let answer = move |request: &Value| {
        let names = asked(request);
        seen.lock().unwrap().push(names.iter().map(ToString::to_string).collect());
        let values_of_all: Vec<_> =
            names.iter().filter(|name| !missing.contains(name)).map(|name| of(name)).collect();
        Some(values(request, values_of_all.into()))
    };
    (answer, log)
}

/// A value that identifies its address, so that a mix-up is noticed.
fn of(name: &str) -> Value {
    match name {
        "version" => "v-version".into(),
        "machineName" => "v-machineName".into(),
        "curMode" => "7".into(),
        "curAlarm" => "135".into(),
        "axisNum" => "6".into(),
        name => name.strip_prefix("Addr-").unwrap_or("0").into(),
    }
}

#[tokio::test]
async fn missing_values_are_found_out_and_remembered() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let (answer, log) = leaving_out(&["curMold", "RemoteCmdLen"]);
    tokio::spawn(peer.answer_all(answer));
    let addresses = [
        Address::Version,
        Address::CurMold,
        Address::CurMode,
        Address::RemoteCmdLen,
        Address::CurAlarm,
        Address::AxisNum,
    ];
    for _ in 0..2 {
        let result = robot.query(&addresses).await.unwrap();
        assert_eq!(result.rows().iter().map(|(address, _)| *address).collect::<Vec<_>>(), addresses);
        assert_eq!(result.text(Address::Version), Some("v-version"));
        assert_eq!(result.integer(Address::CurMode), Some(7));
        assert_eq!(result.integer(Address::CurAlarm), Some(135));
        assert_eq!(result.integer(Address::AxisNum), Some(6));
        assert_eq!(result.rows()[1].1, Err(NoReading::Unsupported));
        assert_eq!(result.rows()[3].1, Err(NoReading::Unsupported));
    }
    let log = log.lock().unwrap();
    // First all addresses; then those that every firmware has; then the two doubtful ones together, then each
    // alone, because an empty answer to several proves nothing about any one. After that only the remaining
    // ones.
    assert_eq!(log.len(), 6, "{log:?}");
    assert_eq!(log.first().unwrap().len(), 6);
    assert_eq!(log.last().unwrap(), &["version", "curMode", "curAlarm", "axisNum"], "remembered");
}

#[tokio::test]
async fn what_is_missing_where_nobody_expects_it_is_found_by_halves() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let (answer, _log) = leaving_out(&["curMode", "axisNum"]);
    tokio::spawn(peer.answer_all(answer));
    let addresses =
        [Address::Version, Address::CurMode, Address::CurAlarm, Address::AxisNum, Address::MachineName];
    let result = robot.query(&addresses).await.unwrap();
    assert_eq!(result.text(Address::Version), Some("v-version"));
    assert_eq!(result.rows()[1].1, Err(NoReading::Unsupported));
    assert_eq!(result.integer(Address::CurAlarm), Some(135));
    assert_eq!(result.rows()[3].1, Err(NoReading::Unsupported));
    assert_eq!(result.text(Address::MachineName), Some("v-machineName"));
}

#[tokio::test]
async fn an_absent_counter_is_asked_for_again() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let (answer, log) = leaving_out(&["counter-3"]);
    tokio::spawn(peer.answer_all(answer));
    for _ in 0..2 {
        let result = robot.query(&[Address::Counter(3)]).await.unwrap();
        assert_eq!(result.rows()[0].1, Err(NoReading::Unsupported));
    }
    assert_eq!(log.lock().unwrap().len(), 2);
}

/// The firmware lacks the list's length for good, and has no such counter now.
#[tokio::test]
async fn an_answer_that_is_too_short_is_not_asked_for_again_though_more_is_known_to_be_missing() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let (answer, log) = leaving_out(&["RemoteCmdLen", "counter-3"]);
    tokio::spawn(peer.answer_all(answer));
    let addresses = [Address::CurMode, Address::RemoteCmdLen, Address::Counter(3)];
    robot.query(&addresses).await.unwrap();
    log.lock().unwrap().clear();
    let result = robot.query(&addresses).await.unwrap();
    assert_eq!(result.integer(Address::CurMode), Some(7));
    assert_eq!(result.rows()[1], (Address::RemoteCmdLen, Err(NoReading::Unsupported)));
    assert_eq!(result.rows()[2], (Address::Counter(3), Err(NoReading::Unsupported)));
    assert_eq!(*log.lock().unwrap(), [vec!["curMode", "counter-3"], vec!["curMode"], vec!["counter-3"]]);
}

#[tokio::test]
async fn a_long_query_is_split() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let longest = Arc::new(Mutex::new((0, 0)));
    let seen = Arc::clone(&longest);
    tokio::spawn(peer.answer_all(move |request| {
        let data: Vec<_> = asked(request).into_iter().map(of).collect();
        let reply = values(request, data.into());
        let mut seen = seen.lock().unwrap();
        *seen = (seen.0.max(request.to_string().len().max(reply.len())), seen.1 + 1);
        Some(reply)
    }));
    let registers: Vec<_> =
        (800..=900).map(|number| Address::Addr(RegisterIndex::new(number).unwrap())).collect();
    let result = robot.query(&registers).await.unwrap();
    for (row, number) in result.rows().iter().zip(800..) {
        assert_eq!(row.1, Ok(Reading::Integer(number)), "{}", row.0);
    }
    let (bytes, frames) = *longest.lock().unwrap();
    assert!(bytes <= 2048, "{bytes} bytes");
    assert!((2..=3).contains(&frames), "{frames} frames");
}

#[tokio::test]
async fn a_query_of_nothing_is_refused_and_nothing_is_sent() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let error = robot.query(&[]).await.unwrap_err();
    assert!(matches!(error, RequestError::Invalid(_)), "{error:?}");
    assert!(error.to_string().contains("one address at least, such as curMode"), "{error}");
    drop(robot);
    peer.ends().await;
}

#[tokio::test]
async fn two_values_for_one_address_are_no_value() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (result, ()) = tokio::join!(robot.query(&[Address::CurMode]), async {
        let request = peer.frame().await;
        peer.send(values(&request, serde_json::json!(["7", "2"]))).await;
    });
    let result = result.unwrap();
    assert!(matches!(result.rows()[0].1, Err(NoReading::Unreadable(_))), "{result:?}");
}

/// Replaces the last value by the one before it: the list has as many values as addresses, but one of them is
/// wrong.
fn with_the_last_one_wrong(names: &[&str]) -> Vec<Value> {
    let mut data: Vec<_> = names.iter().map(|name| of(name)).collect();
    if let [.., before, last] = data.as_mut_slice() {
        *last = before.clone();
    }
    data
}

/// Registers whose value is their number.
fn registers(numbers: impl IntoIterator<Item = u16>) -> Vec<Address> {
    numbers.into_iter().map(|number| Address::Addr(RegisterIndex::new(number).unwrap())).collect()
}

fn assert_each_has_its_own(result: &QueryResult) {
    for (address, reading) in result.rows() {
        assert_eq!(
            reading.as_ref().map(Reading::to_string),
            Ok(address.to_string()[5..].to_owned()),
            "{address}"
        );
    }
}

/// The correct values for these names.
fn right(names: &[&str]) -> Vec<Value> {
    names.iter().map(|name| of(name)).collect()
}

/// A robot whose values come from a function of the number of the query, from 1, and the names. Also returns
/// how many names each query had.
async fn answered_by(
    data: impl Fn(usize, &[&str]) -> Vec<Value> + Send + 'static,
) -> (Robot, Arc<Mutex<Vec<usize>>>) {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let lengths = Arc::<Mutex<Vec<usize>>>::default();
    let seen = Arc::clone(&lengths);
    tokio::spawn(peer.answer_all(move |request| {
        let names = asked(request);
        let mut seen = seen.lock().unwrap();
        seen.push(names.len());
        Some(values(request, data(seen.len(), &names).into()))
    }));
    (robot, lengths)
}

/// Found by `make sim SEED=1844`: four addresses had five values. The first half then had two values, the
/// second of which was wrong.
#[tokio::test]
async fn after_too_many_values_only_values_that_came_alone_are_believed() {
    let (robot, lengths) = answered_by(|query, names| match query {
        1 => right(names).into_iter().chain([of("Addr-803")]).collect(),
        _ => with_the_last_one_wrong(names),
    })
    .await;
    assert_each_has_its_own(&robot.query(&registers(800..804)).await.unwrap());
    assert_eq!(*lengths.lock().unwrap(), [4, 1, 1, 1, 1]);
}

#[tokio::test]
async fn parts_that_lack_nothing_do_not_explain_a_list_that_is_too_short() {
    let (robot, lengths) = answered_by(|query, names| {
        let mut data = with_the_last_one_wrong(names);
        if query == 1 {
            data.pop();
        }
        data
    })
    .await;
    assert_each_has_its_own(&robot.query(&registers(800..804)).await.unwrap());
    assert_eq!(*lengths.lock().unwrap(), [4, 2, 2, 1, 1, 1, 1]);
}

/// Also found by `make sim SEED=1844`: a list lacked one value, which seemed to belong to an address that had
/// a value before.
#[tokio::test]
async fn a_value_that_was_there_before_and_is_not_now_explains_nothing() {
    let (robot, _lengths) = answered_by(|query, names| match query {
        // First all addresses, without the last value; then those that every firmware has, with a wrong
        // value; then the last address alone.
        2 => right(&names[..2]),
        3 => with_the_last_one_wrong(names),
        4 => Vec::new(),
        _ => right(names),
    })
    .await;
    let wanted = [Address::AxisNum, Address::CurMode, Address::RemoteCmdLen];
    for _ in 0..2 {
        let result = robot.query(&wanted).await.unwrap();
        assert_eq!(result.integer(Address::AxisNum), Some(6));
        assert_eq!(result.integer(Address::CurMode), Some(7), "not what stands before it");
    }
}

#[tokio::test]
async fn after_a_list_that_was_wrong_the_next_query_asks_for_each_address_alone() {
    // Lists are wrong until the second query is over.
    let (robot, lengths) = answered_by(|query, names| match query {
        1 => with_the_last_one_wrong(names).into_iter().chain([of("Addr-801")]).collect(),
        2..=5 => with_the_last_one_wrong(names),
        _ => right(names),
    })
    .await;
    for _ in 0..3 {
        assert_each_has_its_own(&robot.query(&registers(800..802)).await.unwrap());
    }
    assert_eq!(*lengths.lock().unwrap(), [2, 1, 1, 1, 1, 2]);
}

#[tokio::test]
async fn a_query_of_one_address_does_not_make_lists_believed_again() {
    let (robot, lengths) = answered_by(|query, names| match query {
        1 => with_the_last_one_wrong(names).into_iter().chain([of("Addr-801")]).collect(),
        _ => right(names),
    })
    .await;
    for count in [2, 1, 2, 2] {
        assert_each_has_its_own(&robot.query(&registers(800..800 + count)).await.unwrap());
    }
    assert_eq!(*lengths.lock().unwrap(), [2, 1, 1, 1, 1, 1, 2]);
}

#[tokio::test]
async fn the_firmware_is_asked_for_once() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let (answer, log) = leaving_out(&[]);
    tokio::spawn(peer.answer_all(answer));
    for _ in 0..3 {
        assert_eq!(robot.firmware().await.unwrap().as_deref(), Some("v-version"));
    }
    assert_eq!(log.lock().unwrap().len(), 1);
}

#[tokio::test]
async fn one_empty_reply_hides_neither_alarm_nor_mode() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let wanted = [Address::CurAlarm, Address::IsMoving, Address::CurMode];
    let (first, second) = soon(async {
        let answering = tokio::spawn(async move {
            let request = peer.frame().await;
            assert_eq!(asked(&request).len(), 3);
            peer.send(values(&request, serde_json::json!([]))).await;
            peer.answer_all(|request| {
                Some(values(request, vec![serde_json::Value::from("1"); asked(request).len()].into()))
            })
            .await;
        });
        let results = (robot.query(&wanted).await, robot.query(&wanted).await);
        answering.abort();
        results
    })
    .await;
    for result in [first.unwrap(), second.unwrap()] {
        assert_eq!(result.integer(Address::CurAlarm), Some(1));
        assert_eq!(result.flag(Address::IsMoving), Some(true));
        assert_eq!(result.integer(Address::CurMode), Some(1));
    }
}

#[tokio::test]
async fn a_result_is_read_again_with_the_values_of_then_also_after_a_call_that_was_given_up() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut number = 0;
    let mut answer = |request: &Value| {
        assert_eq!(asked(request), ["curMode", "curAlarm"]);
        number += 1;
        values(request, vec![number.to_string(), (10 * number).to_string()].into())
    };
    let read = async |peer: &mut Peer, answer: &mut dyn FnMut(&Value) -> String| {
        let request = peer.frame().await;
        peer.send(answer(&request)).await;
    };
    let shows = |result: &QueryResult, number: i64| {
        assert_eq!(result.rows().len(), 2);
        assert_eq!(result.integer(Address::CurMode), Some(number));
        assert_eq!(result.integer(Address::CurAlarm), Some(10 * number));
    };
    let first = robot.query(&[Address::CurMode, Address::CurAlarm]);
    let (result, ()) = tokio::join!(first, read(&mut peer, &mut answer));
    let mut result = result.unwrap();
    shows(&result, 1);
    let (again, ()) = tokio::join!(robot.query_again(&mut result), read(&mut peer, &mut answer));
    again.unwrap();
    shows(&result, 2);

    // The caller gives it up once it was sent, and its answer comes late.
    tokio::select! {
        biased;
        again = robot.query_again(&mut result) => panic!("{again:?}"),
        request = peer.frame() => peer.send(answer(&request)).await,
    }
    assert_eq!(result.rows(), []);
    let (again, ()) = tokio::join!(robot.query_again(&mut result), read(&mut peer, &mut answer));
    again.unwrap();
    shows(&result, 4);

    robot.clone().close().await;
    assert_eq!(robot.query_again(&mut result).await, Err(NotSent::Closed.into()));
    assert_eq!(result.rows(), [], "no value of before");
}

#[tokio::test]
async fn raw_values_keep_the_digits_of_the_controller() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let answer = |request: &Value| {
        let of = |name: &&str| match *name {
            "axis-0" => Some("\"-0.050000\""),
            "curMode" => Some("7"),
            "counter-4" => Some("[4,0,373266]"),
            "version" => Some("\"v\\u0031\""),
            _ => None,
        };
        let values: Vec<_> = asked(request).iter().filter_map(of).collect();
        let pack_id = &request["packID"];
        Some(format!(r#"{{"packID":{pack_id},"queryData":[{}],"reqType":"query"}}"#, values.join(",")))
    };
    tokio::spawn(peer.answer_all(answer));
    let axis = Address::parse("axis-0").unwrap();
    let texts = |values: &[Vec<u8>]| -> Vec<String> {
        values.iter().map(|value| String::from_utf8(value.clone()).unwrap()).collect()
    };
    let read = robot.query_raw(&[axis, Address::CurMold, Address::CurMode, axis]).await.unwrap();
    assert_eq!(texts(&read.values), ["\"-0.050000\"", "7", "\"-0.050000\""], "what is missing is left out");
    assert_eq!(robot.raw_values(&[axis]), [None], "values are not kept unless that is asked for");

    robot.keep_raw_values();
    let counter = Address::Counter(4);
    robot.query(&[axis, Address::Version, counter]).await.unwrap();
    let kept = robot.raw_values(&[counter, Address::CurMode, axis, Address::Version]);
    let kept: Vec<_> =
        kept.into_iter().map(|value| value.map(|value| texts(&[value.text]).remove(0))).collect();
    let texts = [Some("[4,0,373266]"), None, Some("\"-0.050000\""), Some("\"v\\u0031\"")];
    assert_eq!(kept, texts.map(|text| text.map(str::to_owned)));
    // A list that is too short says nothing about its values.
    robot.query_raw(&[Address::CurMold, Address::CurMode]).await.unwrap();
    assert_eq!(robot.raw_values(&[Address::CurMold, Address::CurMode]), [None, None]);
}
