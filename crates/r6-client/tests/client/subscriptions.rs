//! Many subscriptions with one poller, and the quality of the link.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use futures_util::FutureExt as _;
use r6_client::{LinkState, NotSent, NotSubscribed, Quality, Recorded, Snapshot, Subscription};
use r6_proto::Reading;
use r6_proto::address::Address;
use r6_proto::message::Command;
use serde_json::{Value, json};

use crate::controller::{Controller, Peer, Wires, asked, command_word, settings, soon, values, verdict};

/// The shortest period of subscriptions.
const FAST: Duration = Duration::from_millis(20);

/// A period so long that nothing in a test becomes due.
const SLOW: Duration = Duration::from_secs(1000);

const MODE: Address = Address::CurMode;
const ALARM: Address = Address::CurAlarm;
const NAME: Address = Address::MachineName;
const MOLD: Address = Address::CurMold;

type Log = Arc<Mutex<Vec<Vec<String>>>>;

/// A controller without `curMold` that counts up with each query, and remembers the queries.
fn counting(peer: Peer) -> Log {
    let log = Log::default();
    let seen = Arc::clone(&log);
    tokio::spawn(peer.answer_all(move |request| {
        let names: Vec<String> = asked(request).into_iter().map(str::to_owned).collect();
        let mut log = seen.lock().unwrap();
        log.push(names.clone());
        let of = |name: &String| (name != "curMold").then(|| Value::from(log.len().to_string()));
        Some(values(request, names.iter().filter_map(of).collect()))
    }));
    log
}

async fn next(subscription: &mut Subscription) -> Snapshot {
    soon(subscription.next()).await.expect("the handle is open")
}

fn integer(snapshot: &Snapshot, address: Address) -> i64 {
    match snapshot.fresh(address) {
        Some(Reading::Integer(number)) => *number,
        other => panic!("{other:?} in {snapshot:?}"),
    }
}

/// Answers one poll with these values.
async fn polled(peer: &mut Peer, wanted: &[&str], data: Value) {
    let request = peer.frame().await;
    assert_eq!(asked(&request), wanted);
    peer.send(values(&request, data)).await;
}

#[tokio::test]
async fn many_watchers_share_one_query() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let log = counting(peer);
    let mut first = robot.subscribe(&[MODE, ALARM], FAST).unwrap();
    let mut others: Vec<_> =
        (0..20).map(|_| robot.clone().subscribe(&[ALARM, Address::AxisNum], FAST).unwrap()).collect();
    let mut before = 0;
    for _ in 0..10 {
        let snapshot = next(&mut first).await;
        assert!(integer(&snapshot, MODE) > before, "each update has read anew: {snapshot:?}");
        before = integer(&snapshot, MODE);
    }
    for other in &mut others {
        let snapshot = next(other).await;
        assert_eq!(
            snapshot.values().iter().map(|value| value.address).collect::<Vec<_>>(),
            other.addresses()
        );
        assert!(integer(&snapshot, ALARM) > 0);
    }
    // Subscriptions that were created one after another may be polled separately once.
    for asked in log.lock().unwrap().iter().skip(2) {
        assert_eq!(asked, &["curMode", "axisNum", "curAlarm"]);
    }
}

#[tokio::test]
async fn who_waits_for_many_subscriptions_is_told_of_the_one_that_was_read_and_of_its_end() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let often = robot.subscribe(&[MODE], FAST).unwrap();
    let seldom = robot.subscribe(&[ALARM], SLOW).unwrap();
    let (mut of_often, mut of_seldom) = (often.changes(), seldom.changes());
    polled(&mut peer, &["curMode", "curAlarm"], json!(["7", "0"])).await;
    assert!(of_often.next().await && of_seldom.next().await, "both were read");
    // From now on the first one alone is due.
    polled(&mut peer, &["curMode"], json!(["2"])).await;
    assert!(of_often.next().await);
    assert_eq!(often.latest().fresh(MODE), Some(&Reading::Integer(2)));
    assert!(of_seldom.next().now_or_never().is_none(), "it was not read again");
    drop(seldom);
    assert!(!of_seldom.next().await, "its subscription has ended");
}

#[tokio::test]
async fn at_most_one_poll_is_under_way_and_commands_pass_it() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut fast = robot.subscribe(&[MODE], FAST).unwrap();
    let poll = peer.frame().await;
    assert_eq!(asked(&poll), ["curMode"]);
    // The reply does not come. More subscriptions cause no second query, and a command does not need the
    // reply to the first.
    let _second = robot.subscribe(&[ALARM], FAST).unwrap();
    let (sent, ()) = tokio::join!(robot.command(Command::ClearAlarm), async {
        let request = peer.frame().await;
        assert_eq!(command_word(&request), "clearAlarm");
        peer.send(verdict(&request, &["clearAlarm", "ok"])).await;
    });
    sent.unwrap();
    peer.send(values(&poll, json!(["7"]))).await;
    assert_eq!(integer(&next(&mut fast).await, MODE), 7);
    let request = peer.frame().await;
    assert!(asked(&request).contains(&"curAlarm"), "{request}");
}

#[tokio::test]
async fn what_the_controller_lacks_is_found_out_once() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    let log = counting(peer);
    let mut subscription = robot.subscribe(&[MOLD, MODE], FAST).unwrap();
    assert_eq!(subscription.latest().value(MOLD).unwrap().quality, Quality::NotRead);
    for _ in 0..5 {
        let snapshot = next(&mut subscription).await;
        let mold = snapshot.value(MOLD).unwrap();
        assert_eq!((mold.quality.clone(), &mold.reading), (Quality::Unsupported, &None));
        assert!(integer(&snapshot, MODE) > 0);
        assert_eq!(snapshot.value(ALARM), None);
    }
    let log = log.lock().unwrap();
    let asked = log.iter().filter(|asked| asked.contains(&"curMold".to_owned())).count();
    assert_eq!(asked, 2, "with the other, then alone: {log:?}");
}

#[tokio::test]
async fn a_value_that_cannot_be_one_says_so() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut subscription = robot.subscribe(&[MODE, ALARM], SLOW).unwrap();
    polled(&mut peer, &["curMode", "curAlarm"], json!(["7", "n/a"])).await;
    let snapshot = next(&mut subscription).await;
    assert_eq!(integer(&snapshot, MODE), 7);
    let alarm = snapshot.value(ALARM).unwrap();
    assert!(matches!(alarm.quality, Quality::Unreadable(_)) && alarm.reading.is_none(), "{alarm:?}");
}

#[tokio::test]
async fn who_does_not_look_delays_nobody_and_misses_what_is_old() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    counting(peer);
    let mut sleepy = robot.subscribe(&[MODE], FAST).unwrap();
    let mut awake = robot.subscribe(&[MODE], FAST).unwrap();
    let mut last = 0;
    for _ in 0..10 {
        last = integer(&next(&mut awake).await, MODE);
    }
    assert!(integer(&next(&mut sleepy).await, MODE) >= last, "the latest, not the first");
}

#[tokio::test]
async fn the_last_subscription_takes_the_poller_with_it() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let first = robot.subscribe(&[MODE], FAST).unwrap();
    let second = robot.subscribe(&[MODE, ALARM], SLOW).unwrap();
    let poll = peer.frame().await;
    // Dropped while a poll is under way: this holds up neither the poller nor the connection.
    drop((first, second));
    let (result, ()) = tokio::join!(robot.query(&[NAME]), async {
        let mut request = peer.frame().await;
        while asked(&request) != ["machineName"] {
            request = peer.frame().await;
        }
        peer.send(values(&poll, json!(["7"]))).await;
        peer.send(values(&request, json!(["cell 4"]))).await;
    });
    result.unwrap();
    drop(robot);
    peer.ends().await;
}

#[tokio::test]
async fn a_subscription_may_follow_the_last_one() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    counting(peer);
    for _ in 0..5 {
        let mut subscription = robot.subscribe(&[MODE], FAST).unwrap();
        assert_eq!(subscription.latest().value(MODE).unwrap().quality, Quality::NotRead);
        next(&mut subscription).await;
        next(&mut subscription).await;
    }
}

#[tokio::test]
async fn subscriptions_are_restored_at_once_and_commands_are_not() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut slow = robot.subscribe(&[MODE, ALARM], SLOW).unwrap();
    polled(&mut peer, &["curMode", "curAlarm"], json!(["7", "0"])).await;
    assert_eq!(integer(&next(&mut slow).await, MODE), 7);
    drop(peer);
    let snapshot = next(&mut slow).await;
    let mode = snapshot.value(MODE).unwrap();
    assert_eq!((&mode.quality, &mode.reading), (&Quality::Stale, &Some(Reading::Integer(7))));
    assert_eq!(snapshot.fresh(MODE), None);
    // No caller asks for anything, and the next poll was not due for a quarter of an hour.
    let mut peer = controller.accept().await;
    polled(&mut peer, &["curMode", "curAlarm"], json!(["3", "42"])).await;
    let mut snapshot = next(&mut slow).await;
    while snapshot.fresh(MODE).is_none() {
        snapshot = next(&mut slow).await;
    }
    assert_eq!((integer(&snapshot, MODE), integer(&snapshot, ALARM)), (3, 42));
    assert_eq!(snapshot.failure(), None);
    assert_eq!(robot.link_quality().reconnects, 1);
    // The poller has read mode and alarm, but the caller that sends the command has not.
    assert_eq!(soon(robot.command(Command::StartButton)).await, Err(NotSent::StateNotRead.into()));
}

#[tokio::test]
async fn a_poll_that_fails_is_told_and_tried_again() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut slow = robot.subscribe(&[MODE], SLOW).unwrap();
    polled(&mut peer, &["curMode"], json!(["7"])).await;
    next(&mut slow).await;
    // The controller does not listen for a while: the poller keeps trying.
    let address = controller.address();
    drop((controller, peer));
    let mut snapshot = next(&mut slow).await;
    while snapshot.failure().is_none() {
        snapshot = next(&mut slow).await;
    }
    let failure = snapshot.failure().unwrap().to_string();
    assert!(failure.contains("cannot be reached"), "{failure}");
    assert_eq!(snapshot.value(MODE).unwrap().quality, Quality::Stale);
    let controller = Controller::listen_at(&address).await;
    let mut peer = controller.accept().await;
    polled(&mut peer, &["curMode"], json!(["2"])).await;
    while snapshot.fresh(MODE).is_none() {
        snapshot = next(&mut slow).await;
    }
    assert_eq!(integer(&snapshot, MODE), 2);
}

#[tokio::test]
async fn values_grow_old() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let every = Duration::from_secs(1);
    let mut subscription = robot.subscribe(&[MODE], every).unwrap();
    polled(&mut peer, &["curMode"], json!(["7"])).await;
    assert_eq!(integer(&next(&mut subscription).await, MODE), 7);
    assert_eq!(robot.link_quality().state, LinkState::Alive);
    // From here on the controller is silent, and the test moves the clock.
    tokio::time::pause();
    let ms = Duration::from_millis;
    let now = |subscription: &Subscription| subscription.latest().value(MODE).unwrap().clone();
    assert_eq!(now(&subscription).quality, Quality::Fresh);
    // The next poll leaves on time.
    tokio::time::advance(every).await;
    assert_eq!(asked(&peer.frame().await), ["curMode"]);
    assert!(now(&subscription).age.unwrap() >= every);
    tokio::time::advance(ms(1100)).await;
    assert_eq!(now(&subscription).quality, Quality::Stale);
    assert_eq!(robot.link_quality().state, LinkState::Suspect);
    tokio::time::advance(ms(4000)).await;
    let value = now(&subscription);
    assert_eq!((value.quality, value.reading), (Quality::Dead, Some(Reading::Integer(7))));
    let link = robot.link_quality();
    assert_eq!((link.state, link.requests, link.replies), (LinkState::Dead, 2, 1));
    assert!(link.silent_for.unwrap() >= ms(5000), "{link}");
}

#[tokio::test]
async fn closing_the_handle_ends_its_subscriptions() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut subscription = robot.subscribe(&[MODE], SLOW).unwrap();
    polled(&mut peer, &["curMode"], json!(["7"])).await;
    next(&mut subscription).await;
    let clone = robot.clone();
    robot.close().await;
    assert_eq!(soon(subscription.next()).await, None);
    assert_eq!(clone.subscribe(&[MODE], FAST).unwrap_err(), NotSubscribed::Closed);
    peer.ends().await;
}

#[tokio::test]
async fn what_would_be_too_much_is_refused_with_advice() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    counting(peer);
    let refused = |addresses: &[Address], every| robot.subscribe(addresses, every).unwrap_err();
    assert_eq!(refused(&[], FAST), NotSubscribed::Addresses { asked: 0 });
    let counters = |from: u32, count: u32| (from..from + count).map(Address::Counter).collect::<Vec<_>>();
    assert_eq!(refused(&counters(0, 257), FAST), NotSubscribed::Addresses { asked: 257 });
    for every in [Duration::from_millis(19), Duration::from_secs(3601)] {
        assert_eq!(refused(&[MODE], every), NotSubscribed::Period { asked: every });
    }
    assert!(refused(&[MODE], Duration::ZERO).to_string().contains("20ms"));
    let mut kept: Vec<_> =
        (0..4).map(|part| robot.subscribe(&counters(part * 256, 256), SLOW).unwrap()).collect();
    assert_eq!(refused(&[MODE], SLOW), NotSubscribed::Polled { polled: 1024, new: 1 });
    kept.extend((4..256).map(|_| robot.subscribe(&counters(0, 1), SLOW).unwrap()));
    assert_eq!(refused(&counters(0, 1), SLOW), NotSubscribed::Subscriptions);
    kept.clear();
    robot.subscribe(&[MODE], SLOW).unwrap();
}

/// A reply to one request says nothing about another request that waits.
#[tokio::test(start_paused = true)]
async fn a_link_is_silent_while_one_of_two_requests_waits() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (waits, answered) = (robot.query(&[MODE]), robot.query(&[Address::Counter(0)]));
    tokio::pin!(waits, answered);
    let peer = async {
        peer.frame().await;
        let request = peer.frame().await;
        peer.send(values(&request, json!([["0", "1", "2"]]))).await;
    };
    tokio::select! {
        biased;
        _ = &mut waits => panic!("it has no reply"),
        (_, ()) = async { tokio::join!(&mut answered, peer) } => {}
    }
    let later = Duration::from_millis(300);
    tokio::time::timeout(later, &mut waits).await.unwrap_err();
    assert_eq!(robot.link_quality().silent_for, Some(later));
}

#[tokio::test]
async fn the_link_is_measured() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    assert_eq!(robot.link_quality().state, LinkState::Unknown, "an open socket proves nothing");
    assert_eq!(robot.link_quality().latency, None);
    let (result, ()) = tokio::join!(robot.query(&[MODE]), async {
        let request = peer.frame().await;
        let mut other = request.clone();
        other["packID"] = "4711".into();
        peer.send(values(&other, json!(["3"]))).await;
        peer.send("}}garbage ").await;
        // Its brackets match, but it is not JSON.
        peer.send("{no json}").await;
        peer.send(values(&request, json!(["7"]))).await;
    });
    let took = result.unwrap().took();
    let link = robot.link_quality();
    assert_eq!((link.requests, link.replies, link.strays, link.garbled), (1, 1, 1, 2), "{link}");
    let latency = link.latency.unwrap();
    assert_eq!((link.state, latency.count, latency.p50, latency.max), (LinkState::Alive, 1, took, took));
    let (result, _peer) = tokio::join!(robot.query(&[MODE]), async {
        peer.frame().await;
        drop(peer);
        let mut peer = controller.accept().await;
        let request = peer.frame().await;
        peer.send(values(&request, json!(["7"]))).await;
        peer
    });
    result.unwrap();
    let link = robot.link_quality();
    // Sent again, after the two identity queries.
    assert_eq!((link.requests, link.replies, link.lost, link.reconnects), (5, 4, 1, 1), "{link}");
    assert!(link.to_string().starts_with("link alive, replies within "), "{link}");
}

#[tokio::test(start_paused = true)]
async fn a_recording_has_each_poll_in_order_and_counts_what_a_late_reader_lost() {
    let (_wires, robot, peer) = Wires::with_robot(settings()).await;
    counting(peer);
    let mut recording = robot.record().expect("the handle is open");
    let subscription = robot.subscribe(&[MODE], FAST).unwrap();
    let first = soon(recording.next()).await.expect("a poll");
    let second = soon(recording.next()).await.expect("a poll");
    let of = |values: &[Recorded]| match values {
        [Recorded { address: MODE, reading: Some(Reading::Integer(number)), .. }] => *number,
        other => panic!("{other:?}"),
    };
    assert_eq!(of(&second), of(&first) + 1, "no poll is missing");
    assert_eq!((first[0].connection, recording.lost()), (robot.connection(), 0));
    // 1024 polls wait for a late reader; a hundred and more have come since.
    tokio::time::sleep(FAST * 1200).await;
    let mut before = of(&second);
    while recording.lost() == 0 {
        let poll = soon(recording.next()).await.expect("a poll");
        if recording.lost() == 0 {
            assert_eq!(of(&poll), before + 1, "a value is missing and not counted");
        } else {
            assert_eq!(of(&poll), before + 1 + i64::try_from(recording.lost()).unwrap());
        }
        before = of(&poll);
    }
    drop(subscription);
    soon(robot.clone().close()).await;
    assert!(robot.record().is_none(), "there is nothing to come");
    while soon(recording.next()).await.is_some() {}
}
