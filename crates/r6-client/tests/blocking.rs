//! The blocking client: the same robot without a runtime of the caller.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

use r6_client::blocking::{Engine, Robot};
use r6_client::units::{AxisPosition, Percent};
use r6_client::{
    Heartbeat, Motion, NotSent, Pushed, Quality, RequestError, RobotSettings, RunOptions, StepState,
};
use r6_controller::Scenario;
use r6_proto::message::PhotoAnswer;
use r6_proto::{Address, Command, RegisterIndex};
use r6_sim::{Clock, VirtualController};

/// Long enough for a loaded machine.
const PATIENCE: Duration = Duration::from_secs(30);

fn cell() -> (VirtualController, Robot) {
    let controller = VirtualController::start_blocking().unwrap();
    let robot = connect(&controller, RobotSettings::default());
    (controller, robot)
}

fn connect(controller: &VirtualController, settings: RobotSettings) -> Robot {
    Robot::connect(&controller.address().to_string(), settings).unwrap()
}

fn motion(degrees: impl IntoIterator<Item = f64>) -> Motion {
    let fast = Percent::new(100.0).unwrap();
    degrees.into_iter().fold(Motion::new(), |motion, j1| {
        motion.axis_move(AxisPosition::degrees([j1, 0.0, 0.0, 0.0, 30.0, 0.0]), fast)
    })
}

/// Waits until a condition holds, with short sleeps only.
fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < PATIENCE, "{what}");
        thread::yield_now();
    }
}

#[test]
fn queries_and_commands_wait_on_the_callers_thread() {
    let (_controller, robot) = cell();
    let register = RegisterIndex::new(810).unwrap();
    robot.status().unwrap();
    robot.command(Command::RewriteData { register, savable: false, value: -4711 }).unwrap();
    let read = robot.query(&[Address::Addr(register), Address::CurMode]).unwrap();
    assert_eq!(read.integer(Address::Addr(register)), Some(-4711));
    assert_eq!(read.integer(Address::CurMode), Some(7));
    assert!(robot.firmware().unwrap().is_some_and(|version| version.starts_with("HC-QC-RX")));
}

#[test]
fn many_threads_share_one_connection() {
    let (controller, robot) = cell();
    robot.status().unwrap();
    thread::scope(|scope| {
        for thread in 0_i64..16 {
            let robot = robot.clone();
            scope.spawn(move || {
                let register = RegisterIndex::new(820 + u16::try_from(thread).unwrap()).unwrap();
                for round in 0..20 {
                    let value = thread * 100 + round;
                    robot.command(Command::RewriteData { register, savable: false, value }).unwrap();
                    let read = robot.query(&[Address::Addr(register)]).unwrap();
                    assert_eq!(read.integer(Address::Addr(register)), Some(value));
                }
            });
        }
    });
    assert_eq!(controller.handle().snapshot().connections, 1);
}

#[test]
fn a_handle_tells_its_number_and_each_change_and_may_be_asked_again() {
    let (_controller, robot) = cell();
    let mut handle = robot.run(&motion([1.0, 2.0, 3.0]), RunOptions::default()).unwrap();
    assert_eq!(handle.number(), 1);
    let seen: Vec<_> = handle.watch().collect();
    assert!(seen.windows(2).all(|pair| pair[0].done <= pair[1].done && !pair[0].ended), "{seen:?}");
    let last = seen.last().unwrap();
    assert_eq!((last.total, last.done, last.ended), (3, 3, true), "{seen:?}");
    let done = handle.wait().unwrap();
    assert_eq!((done.motion, handle.wait().unwrap()), (Some(1), done));
    assert!(handle.watch().all(|progress| progress.ended), "what is over is told, too");
}

#[test]
fn a_released_motion_goes_on_with_what_is_in_its_list_and_stops_are_waited_for() {
    let (controller, robot) = cell();
    let handle = robot.run(&motion((1..=40).map(f64::from)), RunOptions::default()).unwrap();
    until("it begins", || handle.progress().accepted > 0);
    let released = handle.release();
    assert!(released.ended && (8..=24).contains(&released.left), "{released:?}");
    let mut stops = robot.stops_under_way();
    assert!(!stops.any() && !stops.are_gone() && stops.over().is_none());
    let report = robot.stop().unwrap();
    assert_eq!(stops.over(), Some(Ok(report)));
    assert!(!controller.handle().snapshot().moving);
    drop(robot);
    assert!(stops.are_gone() && stops.over().is_none());
}

/// A motion continues while the caller does something else, without a runtime of the caller.
#[test]
fn a_motion_is_streamed_between_the_calls() {
    let controller = VirtualController::builder().clock(Clock::Times(20.0)).start_blocking().unwrap();
    let robot = connect(&controller, RobotSettings::default());
    // The motion has more steps than fit into the list, so it must be streamed while no call waits.
    let handle = robot.run(&motion((0..60).map(|n| f64::from(n % 2))), RunOptions::default()).unwrap();
    let mut middle = handle.step(40).unwrap();
    until("it is streamed to its 40th step", || {
        assert!(!matches!(middle.state(), StepState::Lost));
        controller.handle().snapshot().connections == 1 && handle.progress().done >= 40
    });
    assert!(middle.started() && middle.done());
    until("it ends", || handle.ended_within(Duration::from_millis(5)));
    let done = handle.finished().unwrap();
    assert_eq!(done.axes[0], Some(1.0));
}

#[test]
fn a_stop_of_one_thread_ends_what_another_waits_for() {
    let (_controller, robot) = cell();
    let handle = robot.run(&motion([150.0, -150.0, 150.0]), RunOptions::default()).unwrap();
    let (told, moving) = mpsc::channel();
    let waiting = thread::spawn(move || {
        told.send(()).unwrap();
        handle.finished().map_err(Box::new)
    });
    moving.recv().unwrap();
    let report = robot.stop().unwrap();
    assert!(report.confirmed, "{report}");
    let error = waiting.join().unwrap().unwrap_err();
    assert!(error.progress.done < 3, "{error}");
    let before = robot.status().unwrap().axes;
    assert_eq!(robot.status().unwrap().axes, before);
}

#[test]
fn subscribed_values_are_read_between_the_calls() {
    let (_controller, robot) = cell();
    let mut mode = robot.subscribe(&[Address::CurMode], Duration::from_millis(20)).unwrap();
    assert!(mode.next().unwrap().fresh(Address::CurMode).is_some());
    // No call waits here. The age of the value shows that it is read nevertheless.
    let (_nothing, comes) = mpsc::channel::<()>();
    comes.recv_timeout(Duration::from_millis(500)).unwrap_err();
    let latest = mode.latest();
    let value = latest.value(Address::CurMode).unwrap();
    assert_eq!(value.quality, Quality::Fresh);
    assert!(value.age.unwrap() < Duration::from_millis(400), "{:?}", value.age);
    assert!(mode.next_within(Duration::ZERO).is_some());
}

/// A loop of calls that are ready at once does not count as silence and drives nothing. The engine continues
/// beside it.
#[test]
fn a_loop_that_waits_for_nothing_keeps_nothing_from_going_on() {
    let controller = VirtualController::builder().clock(Clock::Times(20.0)).start_blocking().unwrap();
    let robot = connect(&controller, RobotSettings::default());
    let handle = robot.run(&motion((0..60).map(|n| f64::from(n % 2))), RunOptions::default()).unwrap();
    let mut mode = robot.subscribe(&[Address::IsMoving], Duration::from_millis(50)).unwrap();
    let begun = Instant::now();
    while handle.progress().done < 60 {
        assert!(begun.elapsed() < PATIENCE, "{:?}", handle.progress());
        // Both calls return without waiting.
        let _ended = handle.ended_within(Duration::ZERO);
        assert!(mode.next_within(Duration::ZERO).is_some());
    }
    handle.finished().unwrap();
}

/// The end of a scope, by an error, by a panic or in order: the arm is stopped first if that was requested.
#[test]
fn the_end_of_a_scope_stops_the_arm_where_that_was_asked_for() {
    let stop_on_drop = RunOptions { stop_on_drop: true, ..RunOptions::default() };
    for panics in [false, true] {
        let (controller, robot) = cell();
        let ended = thread::spawn(move || {
            let handle = robot.run(&motion([150.0, -150.0, 150.0]), stop_on_drop).unwrap();
            assert!(handle.step(1).unwrap().started());
            assert!(!panics, "on purpose");
            drop(handle);
        });
        assert_eq!(ended.join().is_err(), panics);
        let snapshot = controller.handle().snapshot();
        assert_eq!((snapshot.moving, snapshot.list_length), (false, 0));
        assert!(snapshot.axes[0].abs() < 149.0, "{:?}", snapshot.axes);
    }
}

#[test]
fn heartbeats_leave_between_the_calls() {
    // At ten times the speed, the watchdog waits for one second.
    let controller = VirtualController::builder().clock(Clock::Times(10.0)).start_blocking().unwrap();
    let heartbeat = Heartbeat::Managed { every: Duration::from_millis(100) };
    let robot = connect(&controller, RobotSettings { heartbeat, ..RobotSettings::default() });
    let (_nothing, comes) = mpsc::channel::<()>();
    comes.recv_timeout(Duration::from_millis(1500)).unwrap_err();
    assert_eq!(robot.query(&[Address::CurAlarm]).unwrap().integer(Address::CurAlarm), Some(0));
}

#[test]
fn a_photo_is_asked_for_and_answered() {
    let (controller, robot) = cell();
    robot.status().unwrap();
    let mut pushed = robot.pushed();
    assert!(pushed.recv_within(Duration::from_millis(1)).unwrap().is_none());
    controller.handle().request_photo(4);
    assert!(matches!(pushed.next(), Some(Pushed::Photo { cam_id: 4 })));
    robot.answer_photo(PhotoAnswer { cam_id: 4, ret: 1 }).unwrap();
}

#[test]
fn the_last_handle_closes_the_connection_before_it_is_gone() {
    let (controller, robot) = cell();
    robot.status().unwrap();
    let other = robot.clone();
    let subscription = robot.subscribe(&[Address::CurMode], Duration::from_secs(1)).unwrap();
    drop((robot, other));
    assert_eq!(controller.handle().snapshot().connections, 1, "the subscription is a handle too");
    drop(subscription);
    until("the connection is closed", || controller.handle().snapshot().connections == 0);
}

#[test]
fn a_closed_handle_says_so() {
    let (_controller, robot) = cell();
    let other = robot.clone();
    robot.close();
    let error = other.query(&[Address::CurMode]).unwrap_err();
    assert!(matches!(error, RequestError::NotSent(NotSent::Closed)), "{error}");
}

#[test]
fn robots_share_an_engine() {
    let engine = Engine::start().unwrap();
    let controllers: Vec<_> = (0..4).map(|_| VirtualController::start_blocking().unwrap()).collect();
    let robots: Vec<_> = controllers
        .iter()
        .map(|controller| {
            let address = controller.address().to_string();
            Robot::connect_on(&engine, &address, RobotSettings::default()).unwrap()
        })
        .collect();
    drop(engine);
    for robot in &robots {
        assert_eq!(robot.query(&[Address::CurMode]).unwrap().integer(Address::CurMode), Some(7));
    }
}

/// A slow link makes the stop of the other thread take long.
#[test]
fn closing_waits_for_the_stop_of_another_thread() {
    let scenario = "[[fault]]\nfault = \"latency\"\nto_controller = 0.1\nto_client = 0.1\n";
    let controller =
        VirtualController::builder().scenario(Scenario::read(scenario).unwrap()).start_blocking().unwrap();
    let robot = connect(&controller, RobotSettings::default());
    let handle = robot.run(&motion([150.0, -150.0, 150.0]), RunOptions::default()).unwrap();
    assert!(handle.step(1).unwrap().started());
    let (other, stops) = (robot.clone(), robot.as_async().stops_under_way());
    let stopping = thread::spawn(move || other.stop());
    until("the stop is under way", || stops.any());
    robot.close();
    let report = stopping.join().unwrap().unwrap();
    assert!(report.confirmed, "{report}");
    let state = controller.handle().snapshot();
    assert!(!state.moving && state.list_length == 0, "{state:?}");
    drop(handle);
}

#[test]
fn events_end_with_the_handle_whatever_else_lives() {
    let (_controller, robot) = cell();
    let subscription = robot.subscribe(&[Address::CurMode], Duration::from_secs(3600)).unwrap();
    let mut pushed = robot.pushed();
    let (told, ended) = mpsc::channel();
    let waiting = thread::spawn(move || {
        let left = pushed.by_ref().count();
        told.send((left, pushed.recv_within(PATIENCE))).unwrap();
    });
    robot.close();
    let (_left, last) = ended.recv_timeout(PATIENCE).unwrap();
    assert!(last.is_err(), "{last:?}");
    waiting.join().unwrap();
    drop(subscription);
}

#[test]
fn the_stops_under_way_are_gone_with_the_connection() {
    let (_controller, robot) = cell();
    let mut stops = robot.as_async().stops_under_way();
    assert!(!stops.any() && !stops.are_gone());
    assert!(robot.stop().unwrap().confirmed);
    let report = robot.block_on(stops.over()).unwrap().unwrap();
    assert!(report.confirmed, "{report}");
    robot.close();
    until("the connection is gone", || stops.are_gone());
}

/// The handle may be dropped, but not used, inside a runtime.
#[tokio::test]
async fn a_handle_may_be_dropped_where_a_runtime_runs() {
    let controller = VirtualController::start().await.unwrap();
    let address = controller.address().to_string();
    let robot = thread::spawn(move || Robot::connect(&address, RobotSettings::default()).unwrap());
    // The controller runs on this thread.
    until_async(|| robot.is_finished()).await;
    drop(robot.join().unwrap());
    until_async(|| controller.handle().snapshot().connections == 0).await;
}

async fn until_async(mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < PATIENCE);
        tokio::task::yield_now().await;
    }
}
