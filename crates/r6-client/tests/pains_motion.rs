//! Problems of people who move these arms, each with its number in docs/PAINS.md, and the solution: tested on
//! a virtual controller.

#[allow(dead_code, unused_imports, unused_macros, reason = "it has more than these tests need")]
#[path = "hands/hands.rs"]
mod hands;

use r6_controller::Event;
use r6_proto::alarm::AlarmCode;
use std::fmt;
use std::io;
use std::time::Duration;

use r6_client::units::{AxisPosition, Degrees, Millimetres, MillimetresPerSecond, Percent, Pose};
use r6_client::{
    Address, AxisIndex, Cause, Command, Connect, Heartbeat, Motion, Robot, RobotSettings, RunOptions, Unmet,
};
use r6_controller::{PanelAction, Profile, Scenario, StartState};
use r6_sim::{Builder, ControllerHandle, MemoryStream, VirtualController};
use tokio::time::timeout;

use hands::{on_every_hand, pause};

on_every_hand! {
    pain_01_it_does_not_move_and_says_why,
    pain_04_ok_is_no_proof_and_state_is,
    pain_05_a_stop_is_seen_and_nothing_is_left_to_start_again,
    pain_07_a_long_path_is_cut_into_lists_that_are_answered,
    pain_08_a_speed_has_its_unit_and_its_scale,
    pain_10_an_angle_is_told_as_the_near_one,
    pain_14_no_watchdog_is_armed_unless_it_is_fed,
}

/// An event that has not happened after this time never will. The clock of these tests jumps to the next
/// event.
const PATIENCE: Duration = Duration::from_secs(600);

async fn cell(builder: Builder) -> (VirtualController, Robot) {
    cell_with(builder, RobotSettings::default()).await
}

async fn cell_with(builder: Builder, settings: RobotSettings) -> (VirtualController, Robot) {
    let controller = builder.start_in_memory().await.unwrap();
    let robot = hands::connect_with(Wires(controller.handle().clone()), settings).await.unwrap();
    (controller, robot)
}

/// Makes connections in memory.
struct Wires(ControllerHandle);

impl fmt::Display for Wires {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the controller")
    }
}

impl Connect for Wires {
    type Stream = MemoryStream;

    async fn connect(&mut self) -> io::Result<MemoryStream> {
        self.0.dial().await
    }
}

fn profile(text: &str) -> Builder {
    VirtualController::builder().profile(Profile::from_toml(text).unwrap())
}

fn percent(percent: f64) -> Percent {
    Percent::new(percent).unwrap()
}

fn to(axes: [f64; 6]) -> Motion {
    Motion::new().axis_move(AxisPosition::degrees(axes), percent(20.0))
}

async fn cause(robot: &Robot, motion: &Motion) -> Cause {
    match robot.run(motion, RunOptions::default()).await {
        Err(error) => error.cause,
        Ok(handle) => timeout(PATIENCE, handle.finished()).await.unwrap().unwrap_err().cause,
    }
}

async fn moves(robot: &Robot, motion: &Motion) {
    let handle = robot.run(motion, RunOptions::default()).await.unwrap();
    timeout(PATIENCE, handle.finished()).await.unwrap().unwrap();
}

async fn pain_01_it_does_not_move_and_says_why() {
    let there = to([10.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    for start in [StartState::Manual, StartState::Auto, StartState::Stopped] {
        let (controller, robot) = cell(VirtualController::builder().stands(start)).await;
        let refused = cause(&robot, &there).await;
        assert!(matches!(&refused, Cause::NotReady(unmet) if matches!(unmet[..], [Unmet::Mode { .. }])));
        let wanted = match start {
            StartState::Auto => "At the pendant, in Auto, turn Cycle on and press Start",
            _ => "on the pendant switch to Auto, turn Cycle on and press Start",
        };
        assert!(refused.to_string().contains(wanted), "{refused}");
        // The simulator refuses the same list, in its own words.
        let mut log = controller.handle().log();
        robot.add_rcc(true, there.instructions().unwrap().to_vec()).await.unwrap_err();
        let line = log.try_recv().unwrap();
        assert!(matches!(line.event, Event::ListRefused { .. } | Event::Refused { .. }), "{line}");
    }
    let (controller, robot) = cell(VirtualController::builder()).await;
    controller.handle().operate(&PanelAction::RaiseAlarm(AlarmCode(5001))).unwrap();
    let Cause::NotReady(unmet) = cause(&robot, &there).await else { panic!() };
    assert!(unmet.contains(&Unmet::Alarm { code: 5001 }), "{unmet:?}");
    let (controller, robot) = cell(VirtualController::builder()).await;
    robot.add_rcc(true, there.instructions().unwrap().to_vec()).await.unwrap();
    let Cause::NotReady(unmet) = cause(&robot, &there).await else { panic!() };
    assert!(
        unmet.contains(&Unmet::Moving) && unmet.contains(&Unmet::LeftoverList { length: 1 }),
        "{unmet:?}"
    );
    drop(controller);
}

async fn pain_04_ok_is_no_proof_and_state_is() {
    // The controller answers ok, but does not execute the list.
    let scenario = Scenario::read("[[fault]]\nfault = \"not-executed\"\nfrom = 0\nfor = 600").unwrap();
    let (controller, robot) = cell(VirtualController::builder().scenario(scenario)).await;
    let instructions = to([10.0; 6]).instructions().unwrap().to_vec();
    robot.add_rcc(true, instructions).await.expect("the controller says ok");
    let found = cause(&robot, &to([10.0; 6])).await;
    assert!(matches!(found, Cause::Elsewhere(missed) if missed.found == Some(0.0)), "{found}");
    assert_eq!(controller.handle().snapshot().axes[0], 0.0);
    // Three dialects of acceptance and refusal are the same for a caller: ["ok"], [word, "ok"], cmdEcho.
    for name in ["hc1", "r6-pendant", "legacy"] {
        let (_controller, robot) = cell(profile(&format!("base = \"{name}\""))).await;
        robot.command(Command::ModifyGspd { percent: 50.0 }).await.unwrap();
        let refused = robot.command(Command::SwitchMold { mold: "no such".into() }).await.unwrap_err();
        assert!(refused.to_string().contains("refused switchMold"), "{name}: {refused}");
    }
}

async fn pain_05_a_stop_is_seen_and_nothing_is_left_to_start_again() {
    for firmware in ["base = \"hc1\"", "action_stop_mode = \"stop\"\naction_stop_alarm = 42"] {
        let (controller, robot) = cell(profile(firmware)).await;
        let list = to([150.0, 0.0, 0.0, 0.0, 0.0, 0.0]).axis_move(AxisPosition::degrees([0.0]), percent(5.0));
        let handle = robot.run(&list, RunOptions::default()).await.unwrap();
        pause(Duration::from_secs(1)).await;
        let report = handle.stop().await.unwrap();
        assert!(report.confirmed && report.moving == Some(false), "{report}");
        assert_eq!(report.list_length, Some(0));
        // The program is started again by hand, as after any stop: the rest of the list does not run.
        let stopped_at = controller.handle().snapshot().axes;
        assert!(stopped_at[0] > 1.0 && stopped_at[0] < 149.0);
        let handle = controller.handle();
        handle.operate(&PanelAction::ClearAlarm).ok();
        handle.operate(&PanelAction::TurnKey(r6_controller::Key::Auto)).ok();
        robot.command(Command::StartButton).await.unwrap();
        assert!(robot.status().await.unwrap().is_ready(), "{firmware}: {:?}", robot.status().await);
        pause(Duration::from_secs(60)).await;
        assert_eq!(handle.snapshot().axes, stopped_at, "{firmware}");
    }
}

async fn pain_07_a_long_path_is_cut_into_lists_that_are_answered() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    let mut log = controller.handle().log();
    let path = (1..=60).fold(Motion::new(), |path, n| {
        path.axis_move(AxisPosition::degrees([f64::from(n) / 4.0; 6]), percent(30.0)).blend(5)
    });
    // As one list it would get no reply, or a reset. So it is not sent.
    let one = path.instructions().unwrap().to_vec();
    assert!(robot.add_rcc(true, one).await.unwrap_err().to_string().contains("nothing was sent"));
    moves(&robot, &path).await;
    assert_eq!(controller.handle().snapshot().axes[..6], [15.0; 6]);
    let mut taken = Vec::new();
    while let Ok(line) = log.try_recv() {
        taken.extend(line.event.instructions_taken());
    }
    assert_eq!(taken.iter().sum::<usize>(), 60, "each once");
    assert!(taken.iter().all(|list| *list <= 8), "{taken:?}");
}

async fn pain_08_a_speed_has_its_unit_and_its_scale() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    // 5 percent is "50" on the wire. The caller does not need to know that.
    robot.command(Command::ModifyGspd { percent: 5.0 }).await.unwrap();
    assert_eq!(controller.handle().snapshot().global_speed_percent, 5.0);
    let place = [400.0, 0.0, 400.0].map(Millimetres);
    let motion = Motion::new()
        .path_speed(MillimetresPerSecond::new(250).unwrap())
        .linear_move_at_path_speed(Pose::position(place))
        .axis_move(AxisPosition::degrees([0.0]), percent(12.5));
    let frames = robot.dry_run(&motion, RunOptions::default()).unwrap();
    let frame = String::from_utf8(frames.concat()).unwrap();
    assert!(frame.contains("\"action\":\"51\"") && frame.contains("\"speed\":\"250\""), "{frame}");
    assert!(frame.contains("\"speed\":\"12.5"), "{frame}");
    // A fraction of a mm/s raises alarm 219 on a real arm. Here the type can hold neither a fraction nor 0.
    assert!(MillimetresPerSecond::new(0).is_err() && Percent::new(120.0).is_err());
}

async fn pain_10_an_angle_is_told_as_the_near_one() {
    let (controller, robot) = cell(profile("turning = \"as-told\"")).await;
    moves(&robot, &to([0.0, 10.0, -20.0, 0.0, -80.0, 0.0])).await;
    let before = controller.handle().snapshot();
    let [x, y, z, u, v, w] = before.world;
    let place = [x, y, z + 5.0].map(Millimetres);
    // The same orientation, a full turn away.
    let far = Pose::new(place, [Degrees(u), Degrees(v), Degrees(w + 360.0)]);
    let present = [u, v, w].map(Degrees);
    let near = far.nearest_to(present);
    assert!((near.turn().unwrap()[2] - Degrees(w)).abs() < Degrees(1e-9));
    moves(&robot, &Motion::new().linear_move(near, percent(5.0))).await;
    let after = controller.handle().snapshot();
    let most = before.axes.iter().zip(after.axes).map(|(from, to)| (from - to).abs()).fold(0.0, f64::max);
    assert!(most < 5.0, "the wrist did not turn: {most}");
    // In the first form, the wrist of this firmware has to make a full turn, which J6 cannot.
    let alarm = cause(&robot, &Motion::new().linear_move(far, percent(5.0))).await;
    assert!(matches!(alarm, Cause::AlarmRaised { .. }), "{alarm}");
}

async fn pain_14_no_watchdog_is_armed_unless_it_is_fed() {
    let minute = Duration::from_secs(60);
    let (controller, robot) = cell(VirtualController::builder()).await;
    robot.status().await.unwrap();
    pause(minute).await;
    assert_eq!(controller.handle().snapshot().alarm, 0, "off: nothing was armed");

    let every = Duration::from_secs(2);
    let settings = RobotSettings { heartbeat: Heartbeat::Managed { every }, ..RobotSettings::default() };
    let (controller, robot) = cell_with(VirtualController::builder(), settings).await;
    pause(minute).await;
    assert_eq!(controller.handle().snapshot().alarm, 0, "managed: it is fed");
    let read = robot.query(&[Address::Axis(AxisIndex::ALL[0])]).await.unwrap();
    assert_eq!(read.rows().len(), 1);
    robot.close().await;
    pause(Duration::from_secs(9)).await;
    assert_eq!(controller.handle().snapshot().alarm, 0);
    pause(Duration::from_secs(4)).await;
    assert_eq!(controller.handle().snapshot().alarm, 9, "a client that armed it and left is noticed");
}
