//! The client against the virtual controller, over real sockets.

use r6_controller::Event;
use std::time::Duration;

use r6_client::units::{AxisPosition, Percent};
use r6_client::{
    Cause, Invalid, ListAfterStop, Motion, NoReading, OutcomeUnknown, Pushed, Refused, RequestError, Robot,
    RobotSettings, RunOptions, Unmet, WaitError, WaitOptions,
};
use r6_controller::{Profile, StartState};
use r6_proto::message::instruction::{Coordinates, Manner, Move};
use r6_proto::message::{Action, Instruction};
use r6_proto::{Address, AxisIndex, AxisMask, Command, Reading};
use r6_sim::VirtualController;

async fn cell(profile: Profile, start: StartState) -> (VirtualController, Robot) {
    let controller = VirtualController::builder().profile(profile).stands(start).start().await.unwrap();
    let address = controller.address().to_string();
    let robot = Robot::connect(&address, RobotSettings::default()).await.unwrap();
    (controller, robot)
}

async fn waiting_cell() -> (VirtualController, Robot) {
    cell(Profile::hc1(), StartState::Waiting).await
}

fn axis_move(axes: [f64; 6], speed: f64) -> Instruction {
    let manner = Manner { mask: Some(AxisMask::SIX), speed: Some(speed), ..Manner::default() };
    Instruction {
        oneshot: true,
        action: Action::AxisMove(Move { target: Coordinates::from_slice(&axes), manner }),
    }
}

fn addresses(names: &[&str]) -> Vec<Address> {
    names.iter().map(|name| name.parse().unwrap()).collect()
}

#[tokio::test]
async fn a_fresh_cell_is_ready_and_moves() {
    let (_controller, robot) = waiting_cell().await;
    let status = robot.status().await.unwrap();
    assert!(status.is_ready(), "{:?}", status.unmet());
    assert_eq!(status.machine_name.as_deref(), Some("r6 virtual BRTIRUS0707A"));
    robot.add_rcc(true, vec![axis_move([10.0, 0.0, 0.0, 0.0, 30.0, 0.0], 50.0)]).await.unwrap();
    let done = robot.wait_until_done(WaitOptions::default()).await.unwrap();
    assert!(done.moved);
    assert_eq!(done.axes[..6], [10.0, 0.0, 0.0, 0.0, 30.0, 0.0].map(Some));
}

#[tokio::test]
async fn what_is_not_ready_is_named() {
    for (start, mode) in [(StartState::Auto, 2), (StartState::Manual, 1), (StartState::Stopped, 3)] {
        let (_controller, robot) = cell(Profile::hc1(), start).await;
        let unmet = robot.status().await.unwrap().unmet();
        assert!(matches!(unmet.as_slice(), [Unmet::Mode { found }] if found.number() == mode), "{unmet:?}");
        let refused = robot.add_rcc(true, vec![axis_move([1.0; 6], 50.0)]).await.unwrap_err();
        assert!(matches!(refused, RequestError::Refused(Refused::InstructionList { .. })), "{refused}");
    }
}

#[tokio::test]
async fn a_short_reply_is_never_zipped() {
    let (_controller, robot) = waiting_cell().await;
    let asked = addresses(&["curMold", "axis-0", "counter-3", "curMode", "counter-2"]);
    let result = robot.query(&asked).await.unwrap();
    let rows = result.rows();
    assert_eq!(rows.iter().map(|(address, _)| *address).collect::<Vec<_>>(), asked);
    assert!(matches!(rows[0].1, Err(NoReading::Unsupported)));
    assert_eq!(rows[1].1.as_ref().unwrap(), &Reading::Decimal(0.0));
    assert!(matches!(rows[2].1, Err(NoReading::Unsupported)));
    assert_eq!(rows[3].1.as_ref().unwrap(), &Reading::Integer(7));
    assert!(matches!(&rows[4].1, Ok(Reading::Counter(counter)) if counter.id == 2));
}

#[tokio::test]
async fn every_profile_is_understood() {
    for name in Profile::names() {
        let (_controller, robot) = cell(Profile::named(name).unwrap(), StartState::Waiting).await;
        let all: Vec<Address> =
            AxisIndex::ALL.into_iter().flat_map(|n| [Address::Axis(n), Address::World(n)]).collect();
        let result = robot.query(&all).await.unwrap();
        assert!(
            result.rows().iter().all(|(_, reading)| matches!(reading, Ok(Reading::Decimal(_)))),
            "{name}"
        );
        robot.command(Command::ModifyOutput { board: 0, point: 3, on: true }).await.unwrap();
        assert_eq!(
            robot.query(&[Address::Output(0)]).await.unwrap().integer(Address::Output(0)),
            None,
            "a word"
        );
        let refused = robot.command(Command::SwitchMold { mold: "no such".into() }).await.unwrap_err();
        assert!(matches!(refused, RequestError::Refused(Refused::Command { .. })), "{name}: {refused}");
        robot.add_rcc(true, vec![axis_move([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0)]).await.unwrap();
        let done = robot.wait_until_done(WaitOptions::default()).await.unwrap();
        assert_eq!(done.axes[0], Some(5.0), "{name}");
        assert_eq!(robot.learned().echoes_pack_id, Some(name == "hc1"), "{name}");
    }
}

#[tokio::test]
async fn stop_stops_and_clears_the_list() {
    let (controller, robot) = waiting_cell().await;
    let list = vec![axis_move([150.0, 0.0, 0.0, 0.0, 0.0, 0.0], 5.0), axis_move([0.0; 6], 5.0)];
    robot.add_rcc(true, list).await.unwrap();
    let report = robot.stop().await.unwrap();
    assert!(report.confirmed, "{report}");
    assert!(matches!(report.list, ListAfterStop::Cleared), "{report}");
    let snapshot = controller.handle().snapshot();
    assert!(!snapshot.moving && snapshot.list_length == 0 && snapshot.axes[0] < 100.0);
    // It moves again only on a new explicit command, after the program was started again.
    robot.command(Command::StartButton).await.unwrap();
    let done = robot
        .wait_until_done(WaitOptions { start_within: Duration::from_millis(200), ..WaitOptions::default() });
    assert!(!done.await.unwrap().moved);
}

#[tokio::test]
async fn an_alarm_ends_the_wait() {
    let (_controller, robot) = waiting_cell().await;
    robot.add_rcc(true, vec![axis_move([0.0, 0.0, 0.0, 0.0, 0.0, 350.0], 50.0)]).await.unwrap();
    let error = robot.wait_until_done(WaitOptions::default()).await.unwrap_err();
    assert!(matches!(error, WaitError::AlarmRaised { code: 135 }), "{error}");
    assert!(error.to_string().contains("J6"), "{error}");
}

#[tokio::test]
async fn a_list_that_no_controller_takes_is_not_sent() {
    let (controller, robot) = waiting_cell().await;
    let error = robot.add_rcc(true, vec![axis_move([1.0; 6], 50.0); 20]).await.unwrap_err();
    assert!(matches!(error, RequestError::Invalid(Invalid::TooLong { .. })), "{error}");
    assert!(!error.may_send_again(), "it fails again");
    assert!(!controller.handle().snapshot().moving);
}

#[tokio::test]
async fn silence_is_an_unknown_outcome_and_nothing_is_sent_again() {
    let profile = Profile::from_toml("add_rcc_unarmed = \"silent\"").unwrap();
    let builder = VirtualController::builder().profile(profile).stands(StartState::Auto);
    let controller = builder.start().await.unwrap();
    let address = controller.address().to_string();
    let settings = RobotSettings { reply_timeout: Duration::from_millis(100), ..RobotSettings::default() };
    let robot = Robot::connect(&address, settings).await.unwrap();
    let mut log = controller.handle().log();
    let error = robot.add_rcc(true, vec![axis_move([1.0; 6], 50.0)]).await.unwrap_err();
    assert!(matches!(error, RequestError::OutcomeUnknown(OutcomeUnknown::TimedOut { .. })), "{error}");
    assert!(!error.may_send_again());
    // The connection is still good, and the controller saw the list exactly once.
    robot.query(&[Address::CurMode]).await.unwrap();
    let mut seen = 0;
    while let Ok(line) = log.try_recv() {
        seen += usize::from(matches!(line.event, Event::ListIgnored { .. }));
    }
    assert_eq!(seen, 1);
}

#[tokio::test]
async fn a_photo_request_arrives_on_its_own_channel() {
    let (controller, robot) = waiting_cell().await;
    let mut pushed = robot.pushed();
    robot.query(&[Address::CurMode]).await.unwrap();
    controller.handle().request_photo(4);
    let event = tokio::time::timeout(Duration::from_secs(20), pushed.recv()).await.unwrap().unwrap();
    assert!(matches!(event, Pushed::Photo { cam_id: 4 }), "{event:?}");
    robot.answer_photo(r6_proto::message::PhotoAnswer { cam_id: 4, ret: 1 }).await.unwrap();
    robot.query(&[Address::CurMode]).await.unwrap();
}

#[tokio::test]
async fn clones_share_one_connection() {
    let (controller, robot) = waiting_cell().await;
    let tasks: Vec<_> = (0..32)
        .map(|_| {
            let robot = robot.clone();
            tokio::spawn(
                async move { robot.query(&[Address::CurMode]).await.unwrap().integer(Address::CurMode) },
            )
        })
        .collect();
    for task in tasks {
        assert_eq!(task.await.unwrap(), Some(7));
    }
    assert_eq!(controller.handle().snapshot().connections, 1);
}

#[tokio::test(start_paused = true)]
async fn discovering_arms_no_watchdog() {
    let controller = VirtualController::start().await.unwrap();
    let heartbeat = r6_client::Heartbeat::Managed { every: Duration::from_secs(1) };
    let settings = RobotSettings { heartbeat, ..RobotSettings::default() };
    let found = r6_client::discover(&[&controller.address().to_string()], &settings).await;
    assert!(found[0].who.is_ok(), "{found:?}");
    // A single heartbreak would have started the watchdog, which raises its alarm long before that.
    tokio::time::sleep(Duration::from_secs(30)).await;
    assert_eq!(controller.handle().snapshot().alarm, 0);
}

#[test]
fn a_motion_whose_runtime_ends_is_told_as_over() {
    let controller = VirtualController::start_blocking().unwrap();
    let runtime =
        || tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let first = runtime();
    let handle = first.block_on(async {
        let address = controller.address().to_string();
        let robot = Robot::connect(&address, RobotSettings::default()).await.unwrap();
        let target = AxisPosition::degrees([150.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let motion = Motion::new().axis_move(target, Percent::new(1.0).unwrap());
        robot.run(&motion, RunOptions::default()).await.unwrap()
    });
    first.shutdown_background();
    let told = async { tokio::time::timeout(Duration::from_secs(20), handle.finished()).await };
    let error = runtime().block_on(told).expect("it is told").unwrap_err();
    assert!(matches!(error.cause, Cause::Abandoned), "{error}");
    assert!(error.progress.ended && error.stop.is_none(), "{error:?}");
}
