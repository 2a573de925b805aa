use futures_util::FutureExt as _;
use r6_proto::address::Address;
use r6_proto::message::Command;

use super::*;
use crate::reply::Places;

#[test]
fn a_command_that_waited_long_does_not_leave_and_a_query_does() {
    let settings = RobotSettings::default();
    let backoff = Backoff::new(settings.reconnect, || 0);
    let mut connection = Connection::new(("robot".to_owned(), false), settings, Arc::default(), backoff);
    // Otherwise the controller would have to identify itself first.
    connection.hub.known().present = Some(crate::Identity::default());
    let now = Instant::ORIGIN + Duration::from_millis(2001);
    let places = Places::default();
    let job = |work| {
        let (to, reply) = places.open();
        (Job::new(work, Instant::ORIGIN, to), reply)
    };
    let (start, answer) = job(Work::Command(Command::StartButton));
    connection.give(Lane::Ordinary, start);
    connection.go_on(now);
    assert!(connection.output(now).is_empty());
    match answer.now_or_never().flatten().unwrap().unwrap_err() {
        crate::RequestError::NotSent(NotSent::Busy { waited }) => {
            assert_eq!(waited, Duration::from_millis(2001));
        }
        other => panic!("{other:?}"),
    }
    let (query, _answer) = job(Work::Query([Address::CurMode].into()));
    connection.give(Lane::Ordinary, query);
    connection.go_on(now);
    assert!(!connection.output(now).is_empty());
}

#[test]
fn without_the_permission_of_the_settings_not_even_a_stop_leaves() {
    let permission = Permission::new();
    let settings = RobotSettings { permission: Some(permission.clone()), ..RobotSettings::default() };
    let backoff = Backoff::new(settings.reconnect, || 0);
    let mut connection = Connection::new(("robot".to_owned(), false), settings, Arc::default(), backoff);
    let now = Instant::ORIGIN;
    let (to, _answer) = Places::default().open();
    connection.give(Lane::Urgent, Job::new(Work::Command(Command::ActionStop), now, to));
    connection.go_on(now);
    assert!(!connection.output(now).is_empty());
    permission.withdraw();
    assert!(connection.output(now).is_empty());
}

#[test]
fn what_callers_give_up_does_not_pile_up_and_a_stop_stays() {
    let settings = RobotSettings::default();
    let backoff = Backoff::new(settings.reconnect, || 0);
    let mut connection = Connection::new(("robot".to_owned(), false), settings, Arc::default(), backoff);
    let places = Places::default();
    let (waiting, _answer) = places.open();
    connection
        .give(Lane::Ordinary, Job::new(Work::Query([Address::CurMode].into()), Instant::ORIGIN, waiting));
    for _ in 0..1000 {
        for (lane, work) in [
            (Lane::Ordinary, Work::Command(Command::StartButton)),
            (Lane::Urgent, Work::Command(Command::ActionStop)),
        ] {
            let (to, given_up) = places.open();
            drop(given_up);
            connection.give(lane, Job::new(work, Instant::ORIGIN, to));
        }
    }
    assert!(connection.ordinary.len() <= SWEPT_FROM, "{}", connection.ordinary.len());
    assert!(connection.urgent.len() <= SWEPT_FROM, "{}", connection.urgent.len());
    assert!(connection.ordinary.iter().any(|job| !job.is_given_up()), "a caller that waits keeps its place");
    sweep(&mut connection.urgent);
    assert_eq!(connection.urgent.len(), 1, "one stop still leaves");
}
