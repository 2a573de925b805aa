//! The blocking client over its own socket: threads that share a connection, and a connection without a
//! waiting call.
#![allow(clippy::unwrap_used, reason = "tests")]

mod losses;
mod peer;
mod slices;

use std::future::{Future, poll_fn};
use std::pin::pin;
use std::sync::{Arc, Mutex, mpsc};
use std::task::Poll;
use std::thread;
use std::time::{Duration, Instant};

use r6_client::blocking::Robot;
use r6_client::{Heartbeat, NotSent, RequestError, RobotSettings, SecondConnection};
use r6_controller::fault::{LinkFault, LinkFaultNow};
use r6_proto::{Address, Command, RegisterIndex};
use r6_sim::VirtualController;

use crate::peer::{Peer, Reply, asked, command_word, is_heartbreak, settings};

/// Long enough for a loaded machine.
const PATIENCE: Duration = Duration::from_secs(30);

/// Longer than a thread takes to wake up, also on a loaded machine. Shorter than the keeper takes to notice
/// something without a call.
const AT_ONCE: Duration = Duration::from_millis(45);

fn register(number: u16) -> Address {
    Address::Addr(RegisterIndex::new(number).unwrap())
}

fn assert_reads(robot: &Robot, number: u16) {
    let read = robot.query(&[register(number)]).unwrap();
    assert_eq!(read.integer(register(number)), Some(i64::from(number)));
}

/// Waits until a condition holds, with short sleeps only.
fn until(what: &str, mut holds: impl FnMut() -> bool) -> Duration {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < PATIENCE, "{what}");
        thread::sleep(Duration::from_millis(1));
    }
    begun.elapsed()
}

/// The time that something takes on a machine that also does other work: the second best of five times.
fn time_of(mut once: impl FnMut() -> Duration) -> Duration {
    let mut times: Vec<_> = (0..5).map(|_| once()).collect();
    times.sort_unstable();
    times[1]
}

#[test]
fn each_of_many_threads_gets_its_own_reply() {
    let peer = Peer::start(|request| match asked(request).first() {
        // Some replies are slower than those to later requests.
        Some(address) if address.ends_with('3') => Reply::After(Duration::from_millis(3)),
        _ => Reply::Now,
    });
    let robot = peer.robot();
    robot.status().unwrap();
    let begun = Instant::now();
    thread::scope(|scope| {
        for thread in 0..16 {
            let robot = robot.clone();
            scope.spawn(move || {
                (0..50).for_each(|round| assert_reads(&robot, 800 + (thread * 7 + round) % 100))
            });
        }
    });
    assert!(begun.elapsed() < Duration::from_secs(10), "{:?}", begun.elapsed());
    assert_eq!(peer.made(), 1);
}

#[test]
fn a_call_that_is_over_leaves_nobody_without_a_reader() {
    const LATER: Duration = Duration::from_millis(60);
    let peer = Peer::start(|request| match asked(request)[..] {
        ["version", ..] => Reply::Now,
        [address] if address.ends_with('1') => Reply::After(Duration::from_millis(20)),
        _ => Reply::After(LATER),
    });
    let robot = peer.robot();
    robot.status().unwrap();
    let late = time_of(|| {
        // Not a scoped thread, because the end of a scoped thread would wake this one.
        let reading = thread::spawn({
            let robot = robot.clone();
            // This thread reads, because it came first. It also gets its answer first.
            move || assert_reads(&robot, 801)
        });
        thread::sleep(Duration::from_millis(5));
        let begun = Instant::now();
        assert_reads(&robot, 802);
        let late = begun.elapsed().saturating_sub(LATER);
        reading.join().unwrap();
        late
    });
    assert!(late < AT_ONCE, "no thread read for {late:?}");
}

#[test]
fn a_thread_that_is_slow_between_two_polls_keeps_nobody_waiting() {
    let peer = Peer::start(|_| Reply::After(Duration::from_millis(1)));
    let robot = peer.robot();
    robot.status().unwrap();
    let (told, asleep) = mpsc::channel();
    thread::scope(|scope| {
        scope.spawn(|| {
            let mut query = pin!(robot.as_async().query(&[Address::CurMode]));
            let mut first = true;
            robot.block_on(poll_fn(|cx| {
                if !std::mem::take(&mut first) {
                    told.send(()).unwrap();
                    thread::sleep(Duration::from_secs(2));
                }
                query.as_mut().poll(cx).map(Result::unwrap)
            }));
        });
        asleep.recv_timeout(PATIENCE).unwrap();
        let begun = Instant::now();
        (0..20).for_each(|_| assert_reads(&robot, 810));
        assert!(begun.elapsed() < Duration::from_secs(1), "{:?}", begun.elapsed());
    });
}

#[test]
fn heartbeats_leave_on_time_while_no_call_waits_and_while_one_waits_long() {
    let beats = Arc::<Mutex<Vec<Instant>>>::default();
    let seen = Arc::clone(&beats);
    let peer = Peer::start(move |request| {
        if is_heartbreak(request) {
            seen.lock().unwrap().push(Instant::now());
        }
        match asked(request)[..] {
            ["version", ..] => Reply::Now,
            _ => Reply::After(Duration::from_secs(1)),
        }
    });
    let heartbeat = Heartbeat::Managed { every: Duration::from_millis(100) };
    let robot = peer.robot_with(RobotSettings { heartbeat, ..settings() });
    robot.status().unwrap();
    for waits in [false, true] {
        beats.lock().unwrap().clear();
        if waits {
            assert_reads(&robot, 800);
        } else {
            thread::sleep(Duration::from_secs(1));
        }
        let beats = beats.lock().unwrap().clone();
        assert!((7..=12).contains(&beats.len()), "{} beats in a second", beats.len());
        let mut gaps: Vec<_> = beats.windows(2).map(|pair| pair[1] - pair[0]).collect();
        gaps.sort_unstable();
        let typical = gaps[gaps.len() / 2];
        assert!(typical < Duration::from_millis(120), "{gaps:?}");
    }
}

#[test]
fn a_stop_leaves_at_once_while_another_thread_reads() {
    let stops = Arc::<Mutex<Vec<Instant>>>::default();
    let seen = Arc::clone(&stops);
    let peer = Peer::start(move |request| {
        if command_word(request) == "actionStop" {
            seen.lock().unwrap().push(Instant::now());
        }
        match asked(request)[..] {
            [address] if address.ends_with("09") => Reply::After(Duration::from_secs(1)),
            _ => Reply::Now,
        }
    });
    let robot = peer.robot();
    robot.status().unwrap();
    thread::scope(|scope| {
        let reading = scope.spawn(|| assert_reads(&robot, 809));
        thread::sleep(Duration::from_millis(20));
        let answered = time_of(|| {
            let begun = Instant::now();
            robot.command(Command::ActionStop).unwrap();
            let left = *stops.lock().unwrap().last().unwrap() - begun;
            assert!(left < Duration::from_millis(200), "it left after {left:?}");
            begun.elapsed()
        });
        assert!(answered < AT_ONCE, "{answered:?}");
        assert!(!reading.is_finished(), "it was not read meanwhile");
    });
}

#[test]
fn a_connection_that_ends_while_nobody_looks_is_let_go_of_and_made_anew() {
    let peer = Peer::start(|request| match command_word(request) {
        "clearAlarm" => Reply::Last(Duration::from_millis(50)),
        _ => Reply::Now,
    });
    let robot = peer.robot();
    robot.status().unwrap();
    robot.command(Command::ClearAlarm).unwrap();
    assert_eq!(peer.open(), 1);
    let took = until("the client lets go", || peer.open() == 0);
    assert!(took < Duration::from_secs(2), "{took:?}");
    assert_reads(&robot, 833);
    assert_eq!((peer.open(), peer.made()), (1, 2));
    let error = robot.command(Command::ClearAlarm).unwrap_err();
    assert!(matches!(error, RequestError::NotSent(NotSent::StateNotRead)), "{error}");
}

/// The controller ends the connection unnoticed. The next request is not sent into it.
#[test]
fn nothing_is_sent_over_a_connection_that_has_ended() {
    let controller = VirtualController::start_blocking().unwrap();
    let robot = Robot::connect(&controller.address().to_string(), settings()).unwrap();
    robot.status().unwrap();
    controller.shutdown_blocking().unwrap();
    thread::sleep(Duration::from_millis(30));
    let error = robot.command(Command::ClearAlarm).unwrap_err();
    assert!(matches!(error, RequestError::NotSent(_)), "{error}");
}

#[test]
fn closing_does_not_wait_for_an_attempt_to_connect() {
    let controller = VirtualController::start_blocking().unwrap();
    let patient = RobotSettings { connect_timeout: PATIENCE, ..settings() };
    let robot = Robot::connect(&controller.address().to_string(), patient).unwrap();
    robot.status().unwrap();
    let always = |fault| LinkFaultNow { fault, chance: 1.0 };
    controller
        .handle()
        .set_link_faults([LinkFault::BlackHole, LinkFault::CloseBeforeReply].map(always).into());
    let (told, asked) = mpsc::channel();
    let asking = thread::spawn({
        let robot = robot.clone();
        move || {
            told.send(()).unwrap();
            robot.query(&[Address::CurMode])
        }
    });
    asked.recv().unwrap();
    thread::sleep(Duration::from_millis(300));
    assert!(!asking.is_finished(), "it does not wait for a connection");
    let begun = Instant::now();
    robot.close();
    assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
    let error = asking.join().unwrap().unwrap_err();
    assert!(error.may_send_again(), "{error}");
}

/// No thread waits on the second connection: its keeper reads.
#[test]
fn a_stop_opens_a_second_connection_where_the_first_one_is_deaf() {
    let controller = VirtualController::start_blocking().unwrap();
    let impatient = RobotSettings { reply_timeout: Duration::from_millis(700), ..settings() };
    let robot = Robot::connect(&controller.address().to_string(), impatient).unwrap();
    robot.status().unwrap();
    controller.handle().set_link_faults(vec![LinkFaultNow { fault: LinkFault::HalfOpen, chance: 1.0 }]);
    // The first frame reveals the fault; then the controller works again.
    robot.query(&[Address::CurMode]).unwrap_err();
    controller.handle().set_link_faults(Vec::new());
    let begun = Instant::now();
    let report = robot.stop().unwrap();
    assert!(report.confirmed, "{report}");
    assert_eq!(report.second, Some(SecondConnection::Used));
    assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
}

/// The keeper reads the reply that an operation in another executor waits for.
#[test]
fn the_async_handle_works_on_any_executor() {
    let peer = Peer::start(|_| Reply::Now);
    let robot = peer.robot();
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    runtime.block_on(robot.as_async().status()).unwrap();
    let took = time_of(|| {
        let begun = Instant::now();
        runtime.block_on(robot.as_async().query(&[register(805)])).unwrap();
        begun.elapsed()
    });
    assert!(took < AT_ONCE, "{took:?}");
}

/// A task that blocks is bad style, but it works, also where tokio would make the task yield to others.
#[test]
fn it_may_be_called_where_a_runtime_runs_and_where_none_does() {
    let peer = Peer::start(|_| Reply::Now);
    let robot = peer.robot();
    assert!(tokio::runtime::Handle::try_current().is_err());
    robot.status().unwrap();
    let mut subscription = robot.subscribe(&[Address::CurMode], Duration::from_millis(20)).unwrap();
    subscription.next().unwrap();
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).build().unwrap();
    let task = runtime.spawn(async move {
        (0..500).for_each(|_| assert_reads(&robot, 807));
        subscription.next().unwrap();
        robot.close();
    });
    runtime.block_on(task).unwrap();
}

/// The poller keeps its period beside a call that waits for long.
#[test]
fn subscribed_values_come_while_a_call_waits() {
    let peer = Peer::start(|request| match asked(request)[..] {
        [address] if address.ends_with("50") => Reply::After(Duration::from_millis(700)),
        _ => Reply::Now,
    });
    let robot = peer.robot();
    robot.status().unwrap();
    let mut values = robot.subscribe(&[Address::CurMode], Duration::from_millis(20)).unwrap();
    thread::scope(|scope| {
        let waiting = scope.spawn(|| assert_reads(&robot, 850));
        let mut count = 0;
        while !waiting.is_finished() {
            values.next().unwrap();
            count += 1;
        }
        assert!(count >= 20, "{count} in 700 ms");
    });
}

#[test]
fn a_poll_that_is_ready_never_waits() {
    let peer = Peer::start(|_| Reply::Never);
    let robot = peer.robot();
    let mut polls = 0;
    let polled = robot.block_on(poll_fn(|cx| {
        polls += 1;
        cx.waker().wake_by_ref();
        if polls == 3 { Poll::Ready(polls) } else { Poll::Pending }
    }));
    assert_eq!(polled, 3);
}
