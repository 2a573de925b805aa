//! In the steady state a query costs no allocation, from its bytes to the bytes of its reply, with the arm
//! moving or not.

use std::time::Duration;

use r6_controller::{ConnectionId, Controller, ControllerSettings, Profile, RobotModel, StartState};
use r6_proto::time::Instant;
use r6_testkit::alloc::{CountingAllocator, allocations_during};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// A typical query of viewers.
const QUERY: &[u8] = br#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"1","queryAddr":["axis-0","axis-1","axis-2","axis-3","axis-4","axis-5","world-0","world-1","world-2","world-3","world-4","world-5","curMode","curAlarm","isMoving","origin","RemoteCmdLen","input-0","output-0","M-0","curCycle","version","counter-0"]}"#;

/// A move that takes minutes.
const SLOW_MOVE: &[u8] = br#"{"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC","emptyList":"1","packID":"2","instructions":[{"oneshot":"1","action":"4","m0":"90","m1":"10","m2":"-20","m3":"0","m4":"30","m5":"0","ckStatus":"0x3F","speed":"0.5","delay":"0","smooth":"0"}]}"#;

fn at(ms: u64) -> Instant {
    Instant::ORIGIN + Duration::from_millis(ms)
}

/// Sends the query and returns the length of the reply.
fn ask(controller: &mut Controller, connection: ConnectionId, now: Instant) -> usize {
    controller.handle_input(now, connection, QUERY);
    controller.poll_transmit(now, connection).map_or(0, <[u8]>::len)
}

/// Counts the allocations in a hundred queries, a hundredth of a second apart.
fn allocations(controller: &mut Controller, connection: ConnectionId, begin: u64) -> u64 {
    // The buffers have to grow first.
    for ms in 0..20 {
        assert!(ask(controller, connection, at(begin + ms)) > 400);
    }
    allocations_during(|| {
        for query in 1..=100 {
            assert!(ask(controller, connection, at(begin + 20 + query * 10)) > 400);
        }
    })
}

#[test]
fn a_query_allocates_nothing_at_rest_and_while_the_arm_moves() {
    let model = RobotModel::named("BRTIRUS0707A").expect("a model that comes with r6-motion").clone();
    let profile = Profile::named("hc1").expect("a profile that comes with the crate");
    let settings =
        ControllerSettings { start: StartState::Waiting, ..ControllerSettings::new(profile, model) };
    let mut controller = Controller::new(settings, Instant::ORIGIN);
    let connection = controller.connect(Instant::ORIGIN);
    assert_eq!(allocations(&mut controller, connection, 0), 0, "at rest");
    controller.handle_input(at(2_000), connection, SLOW_MOVE);
    while controller.poll_log().is_some() {}
    controller.handle_timeout(at(3_000));
    while controller.poll_transmit(at(3_000), connection).is_some() {}
    assert!(controller.machine().is_moving());
    assert_eq!(allocations(&mut controller, connection, 3_000), 0, "moving");
    assert!(controller.machine().is_moving());
}
