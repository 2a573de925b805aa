//! The client on a simulated event loop other than tokio's: it has its own clock and turns, and bytes in
//! memory.
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests too")]

mod cancelled;
mod world;

use std::time::Duration;

use r6_client::units::{AxisPosition, Percent};
use r6_client::{
    Address, Command, LostReason, Motion, NotSent, OutcomeUnknown, Quality, RequestError, Robot,
    RobotSettings, RunOptions, SecondConnection,
};
use r6_testkit::hostile::{Character, Deaf, Delays, Did, Kind};
use world::World;

const NAME: [Address; 1] = [Address::MachineName];

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn name_of(robot: &Robot) -> impl Future<Output = Result<String, RequestError>> + Send + 'static {
    let robot = robot.clone();
    async move { robot.query(&NAME).await.map(|result| result.text(NAME[0]).unwrap_or_default().to_owned()) }
}

fn send(
    robot: &Robot,
    command: Command<'static>,
) -> impl Future<Output = Result<r6_client::Accepted, RequestError>> + Send + 'static {
    let robot = robot.clone();
    async move { robot.command(command).await }
}

fn to_j1(degrees: f64) -> Motion {
    let target = AxisPosition::degrees([degrees, 0.0, 0.0, 0.0, 0.0, 0.0]);
    Motion::new().axis_move(target, Percent::new(50.0).unwrap())
}

#[test]
fn a_query_leaves_with_its_call_and_ends_with_its_reply() {
    let (mut world, robot) = World::new(Character::default());
    assert_eq!(world.call(name_of(&robot)).unwrap(), "cell 4");
    let (arrived, asked_soon) = (world.arrived(Kind::Query).len(), world.line().own().asked_soon);
    let (_call, told) = world.begin(name_of(&robot));
    assert_eq!(world.arrived(Kind::Query).len(), arrived + 1, "it has left");
    assert_eq!(world.end(told).unwrap(), "cell 4");
    assert_eq!(world.line().own().asked_soon, asked_soon, "no turn of the loop was asked for");
}

#[test]
fn answers_may_come_from_within_a_write() {
    let delays = Delays { query: Duration::ZERO, command: Duration::ZERO, ..Delays::default() };
    let (mut world, robot) = World::new(Character { delays, ..Character::default() });
    world.answer_at_once();
    for _ in 0..10 {
        let (_call, mut told) = world.begin(name_of(&robot));
        assert_eq!(told.try_recv().unwrap().unwrap(), "cell 4", "the call itself brought it");
    }
    world.call(send(&robot, Command::ClearAlarm)).unwrap();
}

#[test]
fn a_command_is_accepted_and_a_motion_runs_to_its_end() {
    let (mut world, robot) = World::new(Character::default());
    let asked = robot.clone();
    assert!(world.call(async move { asked.status().await }).unwrap().is_ready());
    world.call(send(&robot, Command::ClearAlarm)).unwrap();
    let runs = robot.clone();
    let done = world
        .call(async move { runs.run(&to_j1(20.0), RunOptions::default()).await.unwrap().finished().await });
    done.unwrap();
    let position = world.arm(|arm, now| arm.position_at(1, now)[0]);
    assert_eq!(position, 20.0);
}

/// Returns the first request that leaves after this many looks of a motion that does not fit into the list at
/// once. The loop stands still for a time before it takes in the answer.
fn leaves_after(looks: usize, stands_still: Duration) -> Option<Kind> {
    let (mut world, robot) = World::new(Character::default());
    let slow = Percent::new(50.0).unwrap();
    let to = |n: u32| AxisPosition::degrees([2.0 * f64::from(n), 0.0, 0.0, 0.0, 0.0, 0.0]);
    let motion = (1..=40).fold(Motion::new(), |motion, n| motion.axis_move(to(n), slow));
    let runs = robot.clone();
    let _handle = world.call(async move { runs.run(&motion, RunOptions::default()).await }).unwrap();
    let asked = world.arrived(Kind::Query).len() + looks;
    while world.arrived(Kind::Query).len() < asked {
        world.turn();
    }
    let before = world.arm(|arm, _| arm.log().len());
    world.pass(stands_still);
    for _ in 0..20 {
        world.turn();
    }
    let told = |kind: Kind| kind == Kind::Query || kind == Kind::List;
    world.arm(|arm, _| arm.log().iter().skip(before).map(|entry| entry.kind).find(|kind| told(*kind)))
}

#[test]
fn no_list_leaves_on_a_look_from_before_the_loop_stood_still() {
    let feeding: Vec<usize> =
        (1..40).filter(|looks| leaves_after(*looks, Duration::ZERO) == Some(Kind::List)).collect();
    assert!(feeding.len() > 1, "{feeding:?}");
    for looks in feeding {
        assert_ne!(leaves_after(looks, Duration::from_secs(10)), Some(Kind::List), "after look {looks}");
    }
}

#[test]
fn a_stop_is_confirmed_and_goes_on_although_its_call_is_cancelled() {
    let (mut world, robot) = World::new(Character::default());
    let runs = robot.clone();
    let handle = world.call(async move { runs.run(&to_j1(90.0), RunOptions::default()).await }).unwrap();
    let stops = robot.clone();
    let report = world.call(async move { stops.stop().await }).unwrap();
    assert!(report.confirmed, "{report}");
    drop(handle);
    let stops = robot.clone();
    let (call, _told) = world.begin(async move { stops.stop().await });
    call.cancel();
    let mut under_way = robot.stops_under_way();
    let report = world.call(async move { under_way.over().await });
    assert!(report.unwrap().unwrap().confirmed);
}

#[test]
fn a_stop_that_gets_no_answer_goes_over_a_second_connection() {
    let (mut world, robot) = World::new(Character::default());
    let asked = robot.clone();
    assert!(world.call(async move { asked.status().await }).unwrap().is_ready());
    world.arm(|arm, at| arm.character_mut().deaf.push(Deaf { connection: Some(1), at, ..Deaf::default() }));
    let stops = robot.clone();
    let report = world.call(async move { stops.stop().await }).unwrap();
    assert!(report.confirmed, "{report}");
    assert_eq!(report.second, Some(SecondConnection::Used));
    for _ in 0..1000 {
        world.turn();
    }
    assert!(world.lines[1].1.is_over(), "it is closed after that");
}

#[test]
fn a_subscription_is_read_again_and_again_and_across_connections() {
    let (mut world, robot) = World::new(Character::default());
    let mut watched = robot.subscribe(&[Address::CurMode], ms(100)).unwrap();
    let mut seen = 0;
    for round in 0..20 {
        if round == 10 {
            world.arm(|arm, now| arm.break_links(now));
        }
        let (snapshot, back) = world.call(async move { (watched.next().await.unwrap(), watched) });
        watched = back;
        seen += usize::from(snapshot.values()[0].quality == Quality::Fresh);
    }
    assert!(seen >= 15, "{seen}");
    assert!(robot.link_quality().reconnects >= 1);
}

#[test]
fn a_lost_connection_is_made_anew_by_a_query() {
    let (mut world, robot) = World::new(Character::default());
    world.call(name_of(&robot)).unwrap();
    world.arm(|arm, now| arm.break_links(now));
    assert_eq!(world.call(name_of(&robot)).unwrap(), "cell 4");
    assert_eq!(world.line().own().connection, Some(2));
}

#[test]
fn an_attempt_to_connect_that_takes_too_long_is_let_go() {
    let (mut world, robot) = World::new(Character::default());
    world.call(name_of(&robot)).unwrap();
    world.line().own().answers = false;
    world.arm(|arm, now| arm.break_links(now));
    world.turn();
    let begun = world.arm(|_, now| now);
    let let_go = world.line().own().let_go;
    match world.call(name_of(&robot)).unwrap_err() {
        RequestError::NotSent(NotSent::ConnectTimedOut { after, .. }) => assert_eq!(after, ms(3000)),
        other => panic!("{other:?}"),
    }
    assert!(world.arm(|_, now| now) - begun < ms(3200));
    assert_eq!(world.line().own().let_go, let_go + 1);
    // Results of the attempt that arrive later are ignored.
    world.hand().connected();
    world.line().own().answers = true;
    assert_eq!(world.call(name_of(&robot)).unwrap(), "cell 4");
}

#[test]
fn a_request_that_is_refused_a_connection_says_so() {
    let (mut world, robot) = World::new(Character::default());
    world.call(name_of(&robot)).unwrap();
    world.arm(|arm, now| {
        arm.character_mut().reboot =
            Some(r6_testkit::hostile::Reboot { away: ms(5000), ..Default::default() });
        arm.reboot(now);
    });
    world.turn();
    match world.call(name_of(&robot)).unwrap_err() {
        RequestError::NotSent(NotSent::Unreachable {
            kind: std::io::ErrorKind::ConnectionRefused, ..
        }) => {}
        other => panic!("{other:?}"),
    }
}

#[test]
fn closing_ends_the_connection_in_order() {
    let (mut world, robot) = World::new(Character::default());
    world.call(name_of(&robot)).unwrap();
    let clone = robot.clone();
    world.call(async move { robot.close().await });
    assert!(world.hand().is_over());
    let last = world.arm(|arm, _| arm.log().last().unwrap().did);
    assert_eq!(last, Did::Closed);
    assert!(matches!(world.call(name_of(&clone)).unwrap_err(), RequestError::NotSent(NotSent::Closed)));
}

#[test]
fn the_last_handle_that_is_dropped_closes_the_connection() {
    let (mut world, robot) = World::new(Character::default());
    world.call(name_of(&robot)).unwrap();
    drop(robot);
    for _ in 0..100 {
        world.turn();
    }
    assert!(world.hand().is_over());
    assert_eq!(world.line().own().connection, None);
}

#[test]
fn a_call_that_is_cancelled_before_its_request_leaves_sends_nothing() {
    let (mut world, robot) = World::new(Character::default());
    let asked = robot.clone();
    world.call(async move { asked.status().await }).unwrap();
    world.line().own().room = 0;
    let (call, _told) = world.begin(send(&robot, Command::StartButton));
    call.cancel();
    world.line().own().room = usize::MAX;
    assert_eq!(world.call(name_of(&robot)).unwrap(), "cell 4");
    assert!(world.arrived(Kind::Command).is_empty());
}

#[test]
fn frames_leave_whole_where_each_write_takes_a_few_bytes() {
    let (mut world, robot) = World::new(Character::default());
    world.line().own().room = 7;
    let calls: Vec<_> = (0..5).map(|_| world.begin(name_of(&robot))).collect();
    for (_call, told) in calls {
        assert_eq!(world.end(told).unwrap(), "cell 4");
    }
}

#[test]
fn a_reply_that_is_there_counts_however_late_the_loop_comes_to_it() {
    let (mut world, robot) = World::new(Character::default());
    world.call(name_of(&robot)).unwrap();
    let (_call, told) = world.begin(name_of(&robot));
    world.pass(ms(10_000));
    assert_eq!(world.end(told).unwrap(), "cell 4");
}

#[test]
fn a_loop_that_was_late_makes_no_command_old() {
    let (mut world, robot) = World::new(Character::default());
    let asked = robot.clone();
    world.call(async move { asked.status().await }).unwrap();
    world.pass(ms(60_000));
    world.call(send(&robot, Command::ClearAlarm)).unwrap();
}

#[test]
fn who_waits_is_told_when_the_loop_is_gone() {
    let (mut world, robot) = World::new(Character::default());
    world.call(name_of(&robot)).unwrap();
    world.call(send(&robot, Command::ClearAlarm)).unwrap();
    let waiting = send(&robot, Command::ClearAlarm);
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let mut waiting = Box::pin(waiting);
    let pending = runtime.block_on(async { futures_poll(waiting.as_mut()).await });
    assert!(pending.is_pending());
    world.hand().run();
    world.lines.clear();
    match runtime.block_on(waiting).unwrap_err() {
        RequestError::OutcomeUnknown(OutcomeUnknown::ConnectionLost {
            reason: LostReason::ClosedHere,
            ..
        }) => {}
        other => panic!("{other:?}"),
    }
    assert!(matches!(runtime.block_on(name_of(&robot)).unwrap_err(), RequestError::NotSent(NotSent::Closed)));
    assert!(matches!(
        runtime.block_on(robot.stop()).unwrap_err(),
        RequestError::NotSent(NotSent::NotStopped(_) | NotSent::Closed)
    ));
}

async fn futures_poll<F: Future>(mut future: std::pin::Pin<&mut F>) -> std::task::Poll<F::Output> {
    std::future::poll_fn(|cx| std::task::Poll::Ready(future.as_mut().poll(cx))).await
}

#[test]
fn a_robot_may_be_used_from_another_thread() {
    let (mut world, robot) = World::with(Character::default(), RobotSettings::default());
    let (tell, told) = tokio::sync::oneshot::channel();
    let asks = std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        for _ in 0..20 {
            assert_eq!(runtime.block_on(name_of(&robot)).unwrap(), "cell 4");
        }
        tell.send(()).ok();
    });
    world.end(told);
    asks.join().unwrap();
}
