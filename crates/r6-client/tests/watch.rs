//! Watches a virtual controller over real sockets. Also tests what its arm does when the program dies.

use std::time::Duration;

use r6_client::{
    Heartbeat, LinkState, Quality, Robot, RobotSettings, Snapshot, Subscription, WaitError, WaitOptions,
};
use r6_controller::Profile;
use r6_proto::message::instruction::{Coordinates, Manner, Move};
use r6_proto::message::{Action, Instruction};
use r6_proto::{Address, AxisIndex, AxisMask, Reading};
use r6_sim::VirtualController;

const PATIENCE: Duration = Duration::from_secs(20);
const FAST: Duration = Duration::from_millis(20);

async fn robot(controller: &VirtualController, heartbeat: Heartbeat) -> Robot {
    let settings = RobotSettings { heartbeat, ..RobotSettings::default() };
    Robot::connect(&controller.address().to_string(), settings).await.unwrap()
}

async fn next(subscription: &mut Subscription) -> Snapshot {
    tokio::time::timeout(PATIENCE, subscription.next()).await.expect("an update").expect("an open handle")
}

/// J1 to 30 degrees and back to 10, at a speed that takes a second or two.
fn list() -> Vec<Instruction> {
    let manner = Manner { mask: Some(AxisMask::SIX), speed: Some(40.0), ..Manner::default() };
    let to = |degrees| Instruction {
        oneshot: true,
        action: Action::AxisMove(Move {
            target: Coordinates::from_slice(&[degrees, 0.0, 0.0, 0.0, 0.0, 0.0]),
            manner,
        }),
    };
    vec![to(30.0), to(10.0)]
}

#[tokio::test]
async fn every_profile_can_be_watched_while_it_is_commanded() {
    for name in Profile::names() {
        let builder = VirtualController::builder().profile(Profile::named(name).unwrap());
        let controller = builder.start().await.unwrap();
        let robot = robot(&controller, Heartbeat::Off).await;
        let j1 = Address::Axis(AxisIndex::ALL[0]);
        let mut arm = robot.subscribe(&[j1, Address::IsMoving], FAST).unwrap();
        let mut state = robot
            .clone()
            .subscribe(
                &[Address::CurMode, Address::CurMold, Address::RemoteCmdLen],
                Duration::from_millis(40),
            )
            .unwrap();
        next(&mut arm).await;
        robot.add_rcc(true, list()).await.unwrap();
        let mut moved = false;
        loop {
            let snapshot = next(&mut arm).await;
            moved |= snapshot.fresh(Address::IsMoving) == Some(&Reading::Flag(true));
            let Some(Reading::Decimal(degrees)) = snapshot.fresh(j1) else { panic!("{snapshot:?}") };
            if moved && (degrees - 10.0).abs() < 1e-6 {
                break;
            }
        }
        let snapshot = next(&mut state).await;
        for value in snapshot.values() {
            let known = matches!(value.quality, Quality::Fresh | Quality::Unsupported);
            assert!(known, "{name}: {value:?}");
            assert_eq!(value.reading.is_some(), value.quality == Quality::Fresh, "{name}: {value:?}");
        }
        assert_eq!(snapshot.fresh(Address::CurMode), Some(&Reading::Integer(7)), "{name}");
        let link = robot.link_quality();
        assert_eq!(
            (link.state, link.timeouts, link.lost, link.reconnects),
            (LinkState::Alive, 0, 0, 0),
            "{name}"
        );
        assert!(link.latency.unwrap().count > 10, "{name}: {link}");
    }
}

#[tokio::test]
async fn without_a_heartbeat_the_arm_finishes_its_list_when_the_program_dies() {
    let controller = VirtualController::start().await.unwrap();
    let dying = robot(&controller, Heartbeat::Off).await;
    dying.add_rcc(true, list()).await.unwrap();
    drop(dying);
    let next = robot(&controller, Heartbeat::Off).await;
    let done = next.wait_until_done(WaitOptions::default()).await.unwrap();
    assert_eq!((done.moved, done.axes[0]), (true, Some(10.0)));
}

#[tokio::test]
async fn with_a_heartbeat_the_watchdog_stops_the_arm_when_the_program_dies() {
    let profile = Profile::from_toml("heartbeat_timeout_ms = 300").unwrap();
    let controller = VirtualController::builder().profile(profile).start().await.unwrap();
    let dying = robot(&controller, Heartbeat::Managed { every: Duration::from_millis(100) }).await;
    dying.add_rcc(true, list()).await.unwrap();
    drop(dying);
    let next = robot(&controller, Heartbeat::Off).await;
    let error = next.wait_until_done(WaitOptions::default()).await.unwrap_err();
    assert!(matches!(error, WaitError::AlarmRaised { code: 9 }), "{error}");
    let report = next.stop().await.unwrap();
    assert!(report.confirmed, "{report}");
    let axes = controller.handle().snapshot().axes;
    assert!((axes[0] - 10.0).abs() > 1.0, "the list was not finished: {axes:?}");
}
