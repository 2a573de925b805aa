//! Copies of robots: whose counts, what is fresh, and what a stop and a lease are told as.

use serde_json::json;

use super::*;
use crate::core::live::numbers::Span;
use r6_api::gateway::{LiveChange, RobotLink, RobotState, Signal, SignalQuality};

const SUSPECT_AFTER: Duration = Duration::from_millis(400);

/// The same, and the period.
const FRESH_FOR: Duration = Duration::from_millis(500);

fn state(value: &str, number: u64) -> RobotState {
    let state = json!({
        "name": "press", "address": "10.0.0.1:9760", "managed_by": "file", "link": "up", "identity": null,
        "identity_changed": null, "virtual": null, "stopped": false, "stops_under_way": 0, "period_ms": 100,
        "lease": { "number": 1, "holder": "token 1", "expires_in_ms": 9_000 }, "epoch": 7, "number": number,
        "signals": [signal(value, SignalQuality::Fresh)],
    });
    serde_json::from_value(state).unwrap()
}

fn signal(unit: &str, quality: SignalQuality) -> Signal {
    // The unit says which copy it is of.
    let unit = Some(unit.to_owned());
    Signal { address: "axis-0".to_owned(), value: None, unit, quality, age_ms: Some(0) }
}

fn change(unit: &str, after: u64, number: u64) -> LiveChange {
    let signals = vec![signal(unit, SignalQuality::Fresh)];
    LiveChange { robot: "press".to_owned(), after, number, signals }
}

/// What a reader sees: whose copy, whether it is fresh, and the numbers.
fn seen(far: &Far) -> (String, bool, Span) {
    let (span, _, signals) = far.tell_reader(&mut |_| Step::Snapshot { reset: false });
    let signal = signals.into_iter().next().unwrap();
    (signal.unit.unwrap(), signal.quality == SignalQuality::Fresh, span)
}

/// Waits until the clock has moved.
fn tick() {
    let now = clock::now();
    while clock::now() == now {}
}

fn heard(number: u64) -> Arc<Teller> {
    let teller = Teller::new(number);
    teller.confirm(clock::now());
    Arc::new(teller)
}

#[test]
fn the_rows_say_whose_copy_counts_in_whatever_order_the_gateways_tell() {
    let far = Far::new(state("start", 0), 7, 1);
    assert_eq!(seen(&far), ("start".to_owned(), false, Span { born: 1, number: 1 }));
    let live = BTreeSet::from([3, 4]);
    far.take_snapshot(&heard(3), state("three", 5), SUSPECT_AFTER, || 2);
    assert_eq!(
        seen(&far),
        ("three".to_owned(), true, Span { born: 2, number: 2 }),
        "no other owner is known"
    );
    assert!(!far.settle(Some(3), &live, || unreachable!()));
    // The next owner is faster than the rows.
    far.take_snapshot(&heard(4), state("four", 8), SUSPECT_AFTER, || unreachable!());
    assert!(far.take_change(4, change("four", 8, 9), || unreachable!()));
    assert_eq!(seen(&far).0, "three");
    assert!(far.settle(Some(4), &live, || 3));
    assert_eq!(seen(&far), ("four".to_owned(), true, Span { born: 3, number: 3 }));
    // The last one goes on with what it has lost.
    assert!(far.take_change(3, change("three", 5, 6), || unreachable!()));
    far.take_snapshot(&heard(3), state("three", 7), SUSPECT_AFTER, || unreachable!());
    assert!(!far.forget(3, || unreachable!()));
    assert_eq!(seen(&far).0, "four");
    assert!(far.take_change(4, change("four", 9, 11), || 4));
    assert_eq!(seen(&far).2, Span { born: 3, number: 4 });
    assert!(!far.take_change(4, change("four", 10, 12), || unreachable!()), "a change is missing");
    assert!(!far.take_change(3, change("three", 7, 8), || unreachable!()), "it told nothing to begin with");
}

#[test]
fn nothing_is_fresh_once_the_owner_is_lost_and_a_copy_is_never_stuck() {
    let live = BTreeSet::from([3]);
    let far = Far::new(state("start", 0), 7, 1);
    far.take_snapshot(&heard(3), state("three", 5), SUSPECT_AFTER, || 2);
    // A look that is older than the snapshot.
    assert!(far.settle(None, &live, || 3));
    assert_eq!(seen(&far), ("three".to_owned(), false, Span { born: 3, number: 3 }));
    assert_eq!((far.summary().link, far.summary().lease), (RobotLink::Down, None));
    assert!(far.settle(Some(3), &live, || 4));
    assert_eq!(seen(&far), ("three".to_owned(), true, Span { born: 4, number: 4 }));
    // This gateway had it for a while, and the next owner told of it before.
    far.leave(state("here", 9), || 5);
    assert_eq!(seen(&far), ("here".to_owned(), false, Span { born: 5, number: 5 }));
    assert!(far.settle(Some(3), &live, || 6));
    assert_eq!(seen(&far), ("three".to_owned(), true, Span { born: 6, number: 6 }));
    assert!(far.forget(3, || 7));
    assert_eq!(seen(&far), ("three".to_owned(), false, Span { born: 7, number: 7 }));
    assert!(!far.is_told());
}

#[test]
fn a_lease_is_told_until_the_rows_say_that_its_owner_ended() {
    let live = BTreeSet::from([3]);
    let lease = |far: &Far| far.summary().lease.map(|lease| lease.holder);
    let far = Far::new(state("start", 0), 7, 1);
    assert_eq!(lease(&far), None, "no gateway tells of it");
    far.take_snapshot(&heard(3), state("three", 5), SUSPECT_AFTER, || 2);
    assert!(!far.settle(Some(3), &live, || unreachable!()));
    // Its owner lives, and is not heard of.
    assert!(far.forget(3, || 3));
    assert!(!far.settle(Some(3), &live, || unreachable!()));
    assert_eq!((lease(&far).as_deref(), far.summary().link), (Some("token 1"), RobotLink::Down));
    assert!(far.settle(None, &live, || 4));
    assert_eq!((lease(&far), seen(&far).2), (None, Span { born: 4, number: 4 }), "readers are told");
    assert!(!far.settle(None, &live, || unreachable!()));
    // It has another owner, which is not heard of either.
    far.take_snapshot(&heard(3), state("three", 5), SUSPECT_AFTER, || 5);
    far.forget(3, || 6);
    assert!(far.settle(Some(4), &live, || 7));
    assert_eq!(lease(&far), None);
    // The gateway that had it goes on with it.
    far.take_snapshot(&heard(3), state("three", 5), SUSPECT_AFTER, || unreachable!());
    assert!(!far.has_owner());
}

#[test]
fn a_stop_is_told_at_once_and_what_is_older_says_nothing_against_it() {
    let far = Far::new(state("start", 0), 7, 1);
    far.take_snapshot(&heard(3), state("three", 5), SUSPECT_AFTER, || 2);
    let (before, old) = (clock::now(), far.summary());
    tick();
    far.take_stop(3);
    assert!(far.summary().stopped);
    far.take_summary(3, old.clone(), before);
    assert!(far.summary().stopped, "the list was asked for before the stop");
    far.forget(3, || 3);
    assert!(far.summary().stopped, "its gateway ended");
    let saved = Saved::default();
    assert!(!far.take_saved(&saved, before, || unreachable!()), "so was the store");
    assert!(far.summary().stopped);
    tick();
    assert!(far.take_saved(&saved, clock::now(), || 4), "somebody cleared it");
    assert_eq!((far.summary().stopped, seen(&far).2), (false, Span { born: 4, number: 4 }));
    let stopped = Saved { stopped: true, ..Saved::default() };
    assert!(far.take_saved(&stopped, clock::now(), || 5));
    assert!(!far.take_saved(&stopped, clock::now(), || unreachable!()), "nothing is new");
    assert!(far.summary().stopped);
    far.take_snapshot(&heard(3), state("three", 5), SUSPECT_AFTER, || 6);
    assert!(!far.take_saved(&stopped, clock::now(), || unreachable!()), "its owner tells more");
    far.take_stop(3);
    far.take_summary(3, old.clone(), clock::now());
    assert!(!far.summary().stopped, "it was asked for after the stop");
    let asked = clock::now();
    tick();
    let mut newer = state("three", 6);
    newer.summary.stopped = true;
    far.take_snapshot(&heard(3), newer, FRESH_FOR, || 7);
    far.take_summary(3, old, asked);
    assert!(far.summary().stopped, "the snapshot is newer than the list");
}

#[test]
fn the_store_may_not_have_a_stop_yet_that_its_living_owner_told() {
    let live = BTreeSet::from([3]);
    let far = Far::new(state("start", 0), 7, 1);
    far.take_snapshot(&heard(3), state("three", 5), SUSPECT_AFTER, || 2);
    far.settle(Some(3), &live, || unreachable!());
    far.take_stop(3);
    far.forget(3, || 3);
    let (lost, saved) = (clock::now(), Saved::default());
    assert!(!far.take_saved(&saved, lost + Duration::from_secs(1), || unreachable!()));
    assert!(far.summary().stopped);
    assert!(far.take_saved(&saved, lost + WRITTEN, || 4), "it was cleared since");
    assert!(!far.summary().stopped);
    let stopped = Saved { stopped: true, ..Saved::default() };
    assert!(far.take_saved(&stopped, lost + WRITTEN, || 5));
    // Its owner ended: what the store has counts.
    far.settle(None, &live, || 6);
    assert!(far.take_saved(&saved, lost + WRITTEN, || 7));
}

#[test]
fn what_a_gateway_tells_of_a_robot_of_another_one_is_not_told_on() {
    let live = BTreeSet::from([3, 4]);
    let far = Far::new(state("start", 0), 7, 1);
    assert!(far.may_be_of(3) && far.may_be_of(4), "nothing is known");
    far.take_snapshot(&heard(3), state("three", 5), SUSPECT_AFTER, || 2);
    far.take_snapshot(&heard(4), state("four", 5), SUSPECT_AFTER, || unreachable!());
    far.settle(Some(4), &live, || 3);
    assert!(!far.may_be_of(3) && far.may_be_of(4));
}

#[test]
fn what_waits_here_is_behind_its_owner() {
    let now = clock::now();
    let (far, teller) = (Far::new(state("start", 0), 7, 1), heard(3));
    far.take_snapshot(&teller, state("three", 5), SUSPECT_AFTER, || 2);
    let later = now + Duration::from_secs(9);
    teller.confirm(later);
    assert_eq!(far.behind(later), Duration::ZERO);
    teller.hold_back(Some(now));
    assert_eq!(far.behind(later), Duration::from_secs(9), "an event is not told yet");
    teller.hold_back(None);
    assert_eq!(far.behind(later), Duration::ZERO);
}

#[test]
fn a_value_of_an_owner_that_says_nothing_is_not_told_as_fresh_for_long() {
    let teller = Arc::new(Teller::new(3));
    let copied = Copied::new(Some(Arc::clone(&teller)), state("three", 5), SUSPECT_AFTER);
    let now = clock::now();
    let at = |after: Duration| {
        let signal = copied.signal(0, now + after).unwrap();
        (signal.quality, Duration::from_millis(signal.age_ms.unwrap()))
    };
    let long = Duration::from_secs(60);
    assert_eq!(at(Duration::from_millis(10)).0, SignalQuality::Fresh);
    assert_eq!(at(FRESH_FOR + HEARD + Duration::from_millis(10)).0, SignalQuality::Stale);
    assert!(at(long).1 + Duration::from_millis(1) >= long, "nothing says that it is younger");
    // Its owner says again and again that nothing changed.
    teller.confirm(now + long);
    assert_eq!(at(long), (SignalQuality::Fresh, FRESH_FOR));
    assert_eq!(Far::new(state("start", 0), 7, 1).behind(now + long), Duration::ZERO, "it is not fresh");
    let far = Far::new(state("start", 0), 7, 1);
    far.take_snapshot(&teller, state("three", 5), SUSPECT_AFTER, || 2);
    assert_eq!(far.behind(now + long), Duration::ZERO);
    assert_eq!(far.behind(now + long + HEARD), HEARD);
    let last = long + HEARD;
    assert_eq!(at(last), (SignalQuality::Fresh, FRESH_FOR + HEARD));
    assert_eq!(at(last + Duration::from_millis(1)).0, SignalQuality::Stale);
}
