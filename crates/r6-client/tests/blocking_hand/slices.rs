//! Calls that wait in time slices.

use std::future::Future;
use std::pin::{Pin, pin};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use r6_client::blocking::Driver;
use r6_client::{Heartbeat, Instruction, NotSent, RequestError, RobotSettings};
use r6_proto::Address;

use crate::peer::{Peer, Reply, asked, is_heartbreak, settings};
use crate::{AT_ONCE, PATIENCE, register, time_of, until};

/// Shorter than the default read timeout.
const SLICE: Duration = Duration::from_millis(10);

fn connect(peer: &Peer) -> (Driver, r6_client::Robot) {
    Driver::connect(&peer.address, settings()).unwrap()
}

/// Waits to the end, in slices. Returns the result, the number of slices, and the median time of the slices
/// that ended before.
fn in_slices<F: Future>(driver: &Driver, mut future: Pin<&mut F>) -> (F::Output, usize, Duration) {
    let mut slices = Vec::new();
    loop {
        let begun = Instant::now();
        let output = driver.block_on_for(SLICE, future.as_mut());
        let took = begun.elapsed();
        if let Some(output) = output {
            slices.sort_unstable();
            return (output, slices.len() + 1, slices.get(slices.len() / 2).copied().unwrap_or(took));
        }
        assert!(took >= SLICE, "a slice ended after {took:?}");
        slices.push(took);
    }
}

#[test]
fn a_call_waits_on_slice_after_slice_and_is_sent_once() {
    let requests = Arc::<AtomicUsize>::default();
    let seen = Arc::clone(&requests);
    let peer = Peer::start(move |request| match asked(request)[..] {
        ["version", ..] => Reply::Now,
        _ => {
            seen.fetch_add(1, Ordering::SeqCst);
            Reply::After(Duration::from_millis(200))
        }
    });
    let (driver, robot) = connect(&peer);
    in_slices(&driver, pin!(robot.status())).0.unwrap();
    requests.store(0, Ordering::SeqCst);
    let half = time_of(|| {
        let asked = [register(800)];
        let (read, slices, half) = in_slices(&driver, pin!(robot.query(&asked)));
        assert_eq!(read.unwrap().integer(asked[0]), Some(800));
        assert!(slices > 1, "it did not wait");
        half
    });
    assert_eq!(requests.load(Ordering::SeqCst), 5);
    assert!(half < SLICE + Duration::from_millis(25), "{half:?}");
}

/// One of the threads reads, and the others are parked.
#[test]
fn many_threads_come_back_in_time_and_each_has_its_own_reply() {
    let peer = Peer::start(|request| match asked(request)[..] {
        ["version", ..] => Reply::Now,
        _ => Reply::After(Duration::from_millis(150)),
    });
    let (driver, robot) = connect(&peer);
    in_slices(&driver, pin!(robot.status())).0.unwrap();
    let late = time_of(|| {
        thread::scope(|scope| {
            let threads: Vec<_> = (800..808)
                .map(|number| {
                    let (driver, robot) = (&driver, &robot);
                    scope.spawn(move || {
                        let asked = [register(number)];
                        let (read, slices, half) = in_slices(driver, pin!(robot.query(&asked)));
                        assert_eq!(read.unwrap().integer(asked[0]), Some(i64::from(number)));
                        assert!(slices > 1, "it did not wait");
                        half
                    })
                })
                .collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).max().unwrap()
        })
    });
    assert!(late < SLICE + Duration::from_millis(25), "{late:?}");
    assert_eq!(peer.made(), 1);
}

/// The call that is given up had the turn to read.
#[test]
fn a_call_that_is_given_up_between_two_slices_takes_no_reply_from_another() {
    const LATER: Duration = Duration::from_millis(150);
    let peer = Peer::start(|request| match asked(request)[..] {
        ["version", ..] => Reply::Now,
        [address] if address.ends_with("01") => Reply::Never,
        _ => Reply::After(LATER),
    });
    let (driver, robot) = connect(&peer);
    in_slices(&driver, pin!(robot.status())).0.unwrap();
    let late = time_of(|| {
        let (told, given_up) = mpsc::channel();
        thread::scope(|scope| {
            scope.spawn(|| {
                let never = [register(801)];
                let mut query = Box::pin(robot.query(&never));
                (0..3).for_each(|_| assert!(driver.block_on_for(SLICE, query.as_mut()).is_none()));
                drop(query);
                told.send(()).unwrap();
            });
            thread::sleep(SLICE / 2);
            let begun = Instant::now();
            let asked = [register(802)];
            // In one slice, so the thread has to be called to read.
            let read = driver.block_on_for(PATIENCE, pin!(robot.query(&asked))).unwrap();
            assert_eq!(read.unwrap().integer(asked[0]), Some(802));
            given_up.try_recv().unwrap();
            begun.elapsed().saturating_sub(LATER)
        })
    });
    assert!(late < AT_ONCE, "no thread read for {late:?}");
    assert_eq!(peer.made(), 1);
}

#[test]
fn a_list_whose_call_is_given_up_between_two_slices_is_sent_once() {
    let lists = Arc::<AtomicUsize>::default();
    let seen = Arc::clone(&lists);
    let peer = Peer::start(move |request| {
        if request["instructions"].is_array() {
            seen.fetch_add(1, Ordering::SeqCst);
            return Reply::After(Duration::from_millis(100));
        }
        Reply::Now
    });
    let (driver, robot) = connect(&peer);
    in_slices(&driver, pin!(robot.status())).0.unwrap();
    let instructions: Vec<Instruction> = Vec::new();
    let mut list = Box::pin(robot.add_rcc(true, instructions));
    assert!(driver.block_on_for(SLICE, list.as_mut()).is_none());
    drop(list);
    thread::sleep(Duration::from_millis(300));
    let alarm = [Address::CurAlarm];
    let read = in_slices(&driver, pin!(robot.query(&alarm))).0.unwrap();
    assert_eq!(read.integer(Address::CurAlarm), Some(0), "its late reply goes to no other call");
    assert_eq!((lists.load(Ordering::SeqCst), peer.made()), (1, 1));
}

/// Between two slices the caller's thread drives nothing, as when an interpreter is busy.
#[test]
fn heartbeats_leave_and_replies_are_read_between_two_slices() {
    let beats = Arc::<AtomicUsize>::default();
    let seen = Arc::clone(&beats);
    let peer = Peer::start(move |request| {
        if is_heartbreak(request) {
            seen.fetch_add(1, Ordering::SeqCst);
        }
        match asked(request)[..] {
            ["version", ..] => Reply::Now,
            _ => Reply::After(Duration::from_millis(50)),
        }
    });
    let heartbeat = Heartbeat::Managed { every: Duration::from_millis(100) };
    let patient = RobotSettings { heartbeat, reply_timeout: Duration::from_millis(500), ..settings() };
    let (driver, robot) = Driver::connect(&peer.address, patient).unwrap();
    in_slices(&driver, pin!(robot.status())).0.unwrap();
    let asked = [register(803)];
    let mut query = pin!(robot.query(&asked));
    assert!(driver.block_on_for(SLICE, query.as_mut()).is_none());
    beats.store(0, Ordering::SeqCst);
    thread::sleep(Duration::from_secs(1));
    let beats = beats.load(Ordering::SeqCst);
    assert!((7..=12).contains(&beats), "{beats} beats in a second");
    let read = driver.block_on_for(Duration::ZERO, query.as_mut());
    // The reply came long before the call checked, and before its timeout.
    assert_eq!(read.expect("it was read meanwhile").unwrap().integer(asked[0]), Some(803));
}

#[test]
fn the_last_handle_closes_the_connection_whatever_drivers_live() {
    let peer = Peer::start(|_| Reply::Now);
    let (driver, robot) = connect(&peer);
    in_slices(&driver, pin!(robot.status())).0.unwrap();
    assert_eq!(peer.open(), 1);
    let begun = Instant::now();
    drop(robot);
    assert!(begun.elapsed() < AT_ONCE, "dropping it waits");
    let took = until("the client lets go", || peer.open() == 0);
    assert!(took < Duration::from_secs(2), "{took:?}");
    assert!(driver.block_on_for(SLICE, pin!(std::future::pending::<()>())).is_none());
}

/// The first call reads the identity, and then its values: two reads in one wait.
#[test]
fn every_read_of_a_wait_tells_the_time() {
    const LATER: Duration = Duration::from_millis(20);
    let peer = Peer::start(|_| Reply::After(LATER));
    let (driver, robot) = connect(&peer);
    let alarm = [Address::CurAlarm];
    let read = driver.block_on_for(PATIENCE, pin!(robot.query(&alarm))).unwrap().unwrap();
    assert!(read.took() >= LATER, "{:?}", read.took());
}

#[test]
fn an_address_that_is_none_and_a_controller_that_is_away_are_told() {
    let settings = || RobotSettings { connect_timeout: Duration::from_millis(500), ..settings() };
    let error = Driver::connect("host:port", settings()).unwrap_err();
    assert!(matches!(error, RequestError::Invalid(_)), "{error}");
    let nobody = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let error = Driver::connect(&nobody, settings()).unwrap_err();
    assert!(matches!(error, RequestError::NotSent(NotSent::Unreachable { .. })), "{error}");
}
