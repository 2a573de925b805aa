//! The statement "it is done" (docs/EVIDENCE.md): it is made only for a motion that this robot carried out
//! completely, over this connection.

use std::time::Duration;

use r6_client::units::{Millimetres, Percent, Pose};
use r6_client::{
    Cause, Command, Done, EndProof, Motion, MotionError, NotProved, NotSent, RequestError, RunOptions,
    StepState, TargetSender, WaitError, WaitOptions,
};
use r6_client::{FollowOptions, units::AxisPosition};
use r6_testkit::hostile::{
    Cabinet, Character, Foreign, Kind, Links, ListLength, NeverExecuted, Reboot, Swap, SwapWhen,
};
use serde_json::json;
use tokio::time::{Instant, sleep};

use crate::hands::{on_every_hand, pause, spawn};
use crate::{robot_at, there_and_on, to_j1};

on_every_hand! {
    a5_steps_that_another_client_cleared_are_not_told_as_done,
    a5_steps_that_another_client_cleared_in_the_middle_are_not_told_as_done,
    a5_a_path_that_comes_by_its_end_is_not_told_as_done_when_it_was_cleared,
    a5_waits_that_were_cleared_are_not_told_as_done,
    a5_a_list_that_was_accepted_and_never_executed_is_not_done,
    a5_an_appended_list_that_was_never_executed_is_not_done,
    a5_what_repeats_and_was_cleared_is_told,
    a5_what_proves_the_end_is_told,
    a5_firmware_without_the_length_of_its_list_proves_one_move_of_another_tool_only,
    a6_a_motion_whose_handle_was_dropped_is_carried_to_its_end,
    a6_a_dropped_motion_that_failed_is_told_by_the_next_one_before_it_sends_anything,
    a6_a_motion_that_was_stopped_on_purpose_does_not_hold_up_the_next_one,
    b8_waiting_is_not_over_because_the_controller_was_switched_off_and_on,
    d19_a_power_cut_in_the_middle_of_a_motion_is_told_as_such,
    d19_a_power_cut_while_a_target_is_followed_is_told_as_such,
    d19_a_connection_that_was_lost_alone_is_no_power_cut,
    b8_waiting_is_not_over_because_another_robot_stands,
    b8_the_end_of_a_list_is_not_looked_for_on_the_next_connection,
    b10_a_target_ages_from_when_it_was_told,
    b10_no_step_is_put_on_somebody_elses_list,
    b10_a_target_of_an_axis_that_the_robot_does_not_have_is_refused,
    b7_what_is_done_on_one_connection_is_not_said_from_the_next,
    a6_all_who_wait_for_a_motion_that_failed_are_told,
    d19_a_cable_that_is_pulled_after_the_end_is_no_power_cut,
    b10_following_ends_when_the_handle_is_closed,
}

fn fast() -> Percent {
    Percent::new(50.0).unwrap()
}

fn at_x(x: f64) -> Pose {
    Pose::position([x, 0.0, 800.0].map(Millimetres))
}

/// Many steps. The last step of the first three lists uses another tool.
fn with_a_tool(steps: u32) -> Motion {
    (1..=steps).fold(Motion::new(), |motion, n| {
        let motion = motion.linear_move(at_x(500.0 + 20.0 * f64::from(n)), fast());
        if n % 24 == 0 { motion.tool(1) } else { motion }
    })
}

async fn result_of(character: Character, motion: &Motion) -> Result<Done, MotionError> {
    let (_controller, robot) = robot_at(character).await;
    robot.run(motion, RunOptions::default()).await.unwrap().finished().await
}

async fn a5_steps_that_another_client_cleared_are_not_told_as_done() {
    let clears = Foreign { at: Duration::from_millis(400), replace: true, instructions: Vec::new() };
    let (controller, robot) = robot_at(Character { foreign: vec![clears], ..Character::default() }).await;
    let handle = robot.run(&with_a_tool(28), RunOptions::default()).await.unwrap();
    let fourth = handle.step(6).unwrap();
    let error = handle.finished().await.unwrap_err();
    assert_eq!(error.cause, Cause::NotSeen, "{error}");
    assert_eq!((error.progress.left, fourth.state()), (24, StepState::Lost), "{error}");
    assert!(error.stop.unwrap().unwrap().confirmed);
    // The rest of the path was not sent after the gap.
    let carried = controller.arm(|arm, _| arm.carried(1).len());
    assert!(carried < 6, "{carried} steps");
}

/// Another client clears the list, and this one appends before it reads the state again.
async fn a5_steps_that_another_client_cleared_in_the_middle_are_not_told_as_done() {
    let options = RunOptions { frame_instructions: 1, room: 6, ..RunOptions::default() };
    let mut cleared = 0;
    for at in (1000..1500).step_by(3) {
        let clears = Foreign { at: Duration::from_millis(at), replace: true, instructions: Vec::new() };
        let (controller, robot) = robot_at(Character { foreign: vec![clears], ..Character::default() }).await;
        let ended = robot.run(&there_and_on(20), options).await.unwrap().finished().await;
        let carried = controller.arm(|arm, _| arm.carried(1).iter().filter(|step| step.whole).count());
        cleared += u32::from(carried < 19);
        assert!(ended.is_err() || carried >= 19, "{at} ms: {carried} of 20: {ended:?}");
    }
    assert!(cleared > 100, "{cleared}");
}

/// The path passes its end repeatedly, so the arm may stand there in the middle of the path.
async fn a5_a_path_that_comes_by_its_end_is_not_told_as_done_when_it_was_cleared() {
    let to = |j1: f64| AxisPosition::degrees([j1, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let motion = (0..15)
        .fold(Motion::new(), |motion, n| motion.axis_move(to(if n % 2 == 0 { 5.0 } else { 0.0 }), fast()));
    for interval in [30, 50] {
        let options = RunOptions { interval: Duration::from_millis(interval), ..RunOptions::default() };
        let mut cleared = 0;
        for at in (20..1500).step_by(10) {
            let clears = Foreign { at: Duration::from_millis(at), replace: true, instructions: Vec::new() };
            let (controller, robot) =
                robot_at(Character { foreign: vec![clears], ..Character::default() }).await;
            let ended = robot.run(&motion, options).await.unwrap().finished().await;
            let carried = controller.arm(|arm, _| arm.carried(1).iter().filter(|step| step.whole).count());
            cleared += u32::from(carried < 14);
            assert!(ended.is_err() || carried >= 14, "{interval} ms, {at} ms: {carried} of 15: {ended:?}");
        }
        assert!(cleared > 100, "{cleared}");
        // If no other client clears the list, the motion is done.
        let (_controller, robot) = robot_at(Character::default()).await;
        let done = robot.run(&motion, options).await.unwrap().finished().await.unwrap();
        assert_eq!(done.proof, EndProof::Reached);
    }
}

async fn a5_waits_that_were_cleared_are_not_told_as_done() {
    // The controller keeps the step under way.
    let wait = Duration::from_secs(5);
    let motion = Motion::new().wait(wait).wait(wait).wait(wait);
    let clears = Foreign { at: Duration::from_millis(700), replace: true, instructions: Vec::new() };
    let error = result_of(Character { foreign: vec![clears], ..Character::default() }, &motion).await;
    assert_eq!(error.unwrap_err().cause, Cause::NotSeen);
    assert_eq!(result_of(Character::default(), &motion).await.unwrap().proof, EndProof::AtRest);
}

async fn a5_a_list_that_was_accepted_and_never_executed_is_not_done() {
    let never = |what| Character { never_executed: Some(what), ..Character::default() };
    let tool = Motion::new().linear_move(at_x(600.0), fast()).tool(1);
    let error = result_of(never(NeverExecuted::WithTool), &tool).await.unwrap_err();
    assert_eq!(error.cause, Cause::NotSeen, "{error}");
    assert!(error.to_string().contains("nothing proves"), "{error}");

    let bench = to_j1(20.0).workbench(2);
    let error = result_of(never(NeverExecuted::Always), &bench).await.unwrap_err();
    assert!(matches!(error.cause, Cause::Elsewhere(_)), "{error}");

    // There and back: the arm stands where it should end, but it never moved.
    let back = there_and_on(3).axis_move(AxisPosition::degrees([0.0; 6]), fast());
    let error = result_of(never(NeverExecuted::Always), &back).await.unwrap_err();
    assert_eq!(error.cause, Cause::NotSeen, "{error}");
}

async fn a5_an_appended_list_that_was_never_executed_is_not_done() {
    let options = RunOptions { append: true, ..RunOptions::default() };
    let appended = async |motion: &Motion| {
        let never = Character { never_executed: Some(NeverExecuted::Always), ..Character::default() };
        let (_controller, robot) = robot_at(never).await;
        robot.run(motion, options).await.unwrap().finished().await.unwrap_err()
    };
    let error = appended(&to_j1(10.0)).await;
    assert!(matches!(error.cause, Cause::Elsewhere(_)), "{error}");
    // It ends where it begins, so the position of the arm proves nothing.
    let error = appended(&to_j1(10.0).extend(&to_j1(0.0))).await;
    assert_eq!(error.cause, Cause::NotProved(NotProved::WasThere), "{error}");
    assert!(error.stop.unwrap().unwrap().confirmed);
    let error = appended(&Motion::new().linear_move(at_x(520.0), fast()).tool(1)).await;
    assert_eq!(error.cause, Cause::NotProved(NotProved::NoTarget), "{error}");
    let error =
        appended(&Motion::new().stop_on_input("X010".parse().unwrap(), true).extend(&to_j1(10.0))).await;
    assert!(matches!(error.cause, Cause::NotProved(NotProved::MayBeCut(_))), "{error}");
}

async fn a5_what_repeats_and_was_cleared_is_told() {
    let clears = Foreign { at: Duration::from_millis(700), replace: true, instructions: Vec::new() };
    let (_controller, robot) = robot_at(Character { foreign: vec![clears], ..Character::default() }).await;
    let round = to_j1(10.0).extend(&to_j1(0.0)).repeat();
    let error = robot.run(&round, RunOptions::default()).await.unwrap().finished().await.unwrap_err();
    assert_eq!((error.cause.clone(), error.progress.done), (Cause::NotSeen, 0), "{error}");
}

async fn a5_what_proves_the_end_is_told() {
    for (motion, proof) in [
        (there_and_on(5), EndProof::Reached),
        (there_and_on(3).axis_move(AxisPosition::degrees([0.0; 6]), fast()), EndProof::Reached),
        (with_a_tool(24), EndProof::Consumed),
        (to_j1(10.0).workbench(2), EndProof::Reached),
        (Motion::new().wait(Duration::from_millis(300)), EndProof::AtRest),
    ] {
        let done = result_of(Character::default(), &motion).await.unwrap();
        assert_eq!((done.proof, done.motion), (proof, Some(1)), "{motion:?}");
    }
}

async fn a5_firmware_without_the_length_of_its_list_proves_one_move_of_another_tool_only() {
    let old = || Character { list_length: ListLength::Absent, ..Character::default() };
    let one = Motion::new().linear_move(at_x(600.0), fast()).tool(1);
    assert_eq!(result_of(old(), &one).await.unwrap().proof, EndProof::Consumed);
    let two = one.linear_move(at_x(700.0), fast()).tool(1);
    assert_eq!(result_of(old(), &two).await.unwrap_err().cause, Cause::NotSeen);
    assert_eq!(result_of(old(), &there_and_on(4)).await.unwrap().proof, EndProof::Reached);
}

async fn a6_a_motion_whose_handle_was_dropped_is_carried_to_its_end() {
    let (controller, robot) = robot_at(Character::default()).await;
    let handle = robot.run(&there_and_on(60), RunOptions::default()).await.unwrap();
    drop(handle);
    let done = robot.wait_until_done(WaitOptions::default()).await.unwrap();
    assert_eq!((done.motion, done.axes[0], done.proof), (Some(1), Some(300.0), EndProof::Reached));
    controller.arm(|arm, _| assert_eq!(arm.carried(1).len(), 60));
}

async fn a6_a_dropped_motion_that_failed_is_told_by_the_next_one_before_it_sends_anything() {
    let clears = Foreign { at: Duration::from_millis(700), replace: true, instructions: Vec::new() };
    let (controller, robot) = robot_at(Character { foreign: vec![clears], ..Character::default() }).await;
    drop(robot.run(&there_and_on(20), RunOptions::default()).await.unwrap());
    pause(Duration::from_secs(10)).await;
    let lists = || controller.arm(|arm, _| arm.log().iter().filter(|it| it.kind == Kind::List).count());
    let before = lists();
    let error = robot.run(&to_j1(0.0), RunOptions::default()).await.unwrap_err();
    let Cause::EarlierFailed(earlier) = &error.cause else { panic!("{error}") };
    assert_eq!((&earlier.cause, earlier.progress.total), (&Cause::NotSeen, 20));
    assert!(error.nothing_left());
    assert_eq!(lists(), before);
    // The client reports it once. The failed motion stopped the arm.
    let again = robot.run(&to_j1(0.0), RunOptions::default()).await;
    assert!(matches!(again.unwrap_err().cause, Cause::NotReady(_)));
}

async fn a6_a_motion_that_was_stopped_on_purpose_does_not_hold_up_the_next_one() {
    let (_controller, robot) = robot_at(Character::default()).await;
    drop(robot.run(&there_and_on(20), RunOptions::default()).await.unwrap());
    pause(Duration::from_millis(500)).await;
    assert!(robot.stop().await.unwrap().confirmed);
    robot.command(Command::ClearAlarm).await.unwrap();
    robot.command(Command::StartButton).await.unwrap();
    let handle = robot.run(&to_j1(0.0), RunOptions::default()).await.unwrap();
    assert_eq!(handle.finished().await.unwrap().axes[0], Some(0.0));
}

async fn b8_waiting_is_not_over_because_the_controller_was_switched_off_and_on() {
    for listed in [false, true] {
        let (controller, robot) = robot_at(Character::default()).await;
        let list = there_and_on(3).instructions().unwrap().to_vec();
        robot.add_rcc(true, list).await.unwrap();
        pause(Duration::from_millis(300)).await;
        let reboot = Reboot { mode: if listed { 7 } else { 3 }, ..Reboot::default() };
        controller.arm(|arm, now| {
            arm.character_mut().reboot = Some(reboot);
            arm.reboot(now);
        });
        let error = robot.wait_until_done(WaitOptions::default()).await.unwrap_err();
        // If a program runs again, nothing shows whether the controller or the cable failed.
        let is_told = match &error {
            WaitError::Restarted(restart) => !listed && restart.origin_lost,
            WaitError::AnotherConnection | WaitError::Request(_) => listed,
            _ => false,
        };
        assert!(is_told, "{listed}: {error:?}");
    }
}

async fn d19_a_power_cut_in_the_middle_of_a_motion_is_told_as_such() {
    for homed in [false, true] {
        let (controller, robot) = robot_at(Character::default()).await;
        let reboots = |arm: &mut r6_testkit::hostile::Arm, now| {
            arm.character_mut().reboot = Some(Reboot { homed, ..Reboot::default() });
            arm.reboot(now);
        };
        let handle = robot.run(&there_and_on(20), RunOptions::default()).await.unwrap();
        assert!(handle.step(3).unwrap().started().await);
        controller.arm(reboots);
        let error = handle.finished().await.unwrap_err();
        let Cause::Restarted(restart) = &error.cause else { panic!("{error}") };
        assert_eq!((restart.mode.number(), restart.origin_lost), (3, !homed));
        assert!(error.to_string().contains("switched off and on"), "{error}");
    }
}

async fn d19_a_power_cut_while_a_target_is_followed_is_told_as_such() {
    let (controller, robot) = robot_at(Character::default()).await;
    let (target, targets) = TargetSender::new();
    let source = spawn(async move {
        for n in 0..200 {
            target.send(AxisPosition::degrees([f64::from(n)]));
            if n == 10 {
                controller.arm(|arm, now| {
                    arm.character_mut().reboot = Some(Reboot::default());
                    arm.reboot(now);
                });
            }
            pause(Duration::from_millis(50)).await;
        }
    });
    let error = robot.follow(targets, FollowOptions::default()).await.unwrap_err();
    assert!(matches!(error.cause, Cause::Restarted(_)), "{error}");
    source.abort();
}

/// A cable that was pulled and put back is not a power cut.
async fn d19_a_connection_that_was_lost_alone_is_no_power_cut() {
    let (controller, robot) = robot_at(Character::default()).await;
    let handle = robot.run(&there_and_on(20), RunOptions::default()).await.unwrap();
    assert!(handle.step(3).unwrap().started().await);
    controller.arm(|arm, now| arm.break_links(now));
    let error = handle.finished().await.unwrap_err();
    assert!(!matches!(error.cause, Cause::Restarted(_)), "{error}");
}

async fn b8_waiting_is_not_over_because_another_robot_stands() {
    let (controller, robot) = robot_at(Character::default()).await;
    robot.add_rcc(true, there_and_on(3).instructions().unwrap().to_vec()).await.unwrap();
    let to = Cabinet { name: "cell 5".to_owned(), ..Cabinet::default() };
    controller.arm(|arm, now| {
        arm.character_mut().swap = Some(Swap { when: SwapWhen::Told, links: Links::End, to });
        arm.swap(now);
    });
    let error = robot.wait_until_done(WaitOptions::default()).await.unwrap_err();
    assert!(matches!(error, WaitError::Request(_) | WaitError::AnotherConnection), "{error:?}");
}

async fn b8_the_end_of_a_list_is_not_looked_for_on_the_next_connection() {
    let (controller, robot) = robot_at(Character::default()).await;
    robot.add_rcc(true, there_and_on(3).instructions().unwrap().to_vec()).await.unwrap();
    controller.arm(|arm, now| arm.reboot(now));
    // Another caller reads in between, which reconnects.
    while robot.status().await.is_err() {
        pause(Duration::from_millis(200)).await;
    }
    let error = robot.wait_until_done(WaitOptions::default()).await.unwrap_err();
    assert!(matches!(error, WaitError::Restarted(_)), "{error:?}");
}

/// Follows one target that was sent this long before the following began.
async fn told_before(age: Duration) -> r6_client::Followed {
    let (_controller, robot) = robot_at(Character::default()).await;
    let (target, targets) = TargetSender::new();
    target.send(AxisPosition::degrees([75.0]));
    pause(age).await;
    let source = async move {
        sleep(Duration::from_secs(3)).await;
        drop(target);
    };
    let following = robot.follow(targets, FollowOptions::default());
    tokio::join!(following, source).0.unwrap()
}

async fn b10_a_target_ages_from_when_it_was_told() {
    let followed = told_before(Duration::from_secs(4)).await;
    assert_eq!(followed.steps, 0, "{followed:?}");
    assert_eq!(followed.behind.map(|behind| behind.value()), Some(75.0), "it was told and not taken");
    assert!(told_before(Duration::ZERO).await.steps > 0);
}

async fn b10_no_step_is_put_on_somebody_elses_list() {
    let step =
        |j1: &str| json!({ "oneshot": "1", "action": "4", "m0": j1, "ckStatus": "0x3F", "speed": "10" });
    let theirs = Foreign {
        at: Duration::from_millis(60),
        replace: true,
        instructions: vec![
            json!({ "oneshot": "1", "action": "100", "type": "100", "limit": "2" }),
            step("80"),
        ],
    };
    let (controller, robot) = robot_at(Character { foreign: vec![theirs], ..Character::default() }).await;
    let (target, targets) = TargetSender::new();
    let source = async {
        sleep(Duration::from_millis(150)).await;
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(2) {
            target.send(AxisPosition::degrees([10.0]));
            sleep(Duration::from_millis(50)).await;
        }
    };
    let following = robot.follow(targets, FollowOptions::default());
    let error =
        tokio::select! { result = following => result.unwrap_err(), () = source => panic!("it went on") };
    assert!(matches!(error.cause, Cause::AnotherList { length: 2 }), "{error}");
    let ours = controller.arm(|arm, _| {
        arm.log().iter().filter(|entry| entry.frame.to_string().contains("\"m0\":\"10")).count()
    });
    assert_eq!(ours, 0);
}

async fn b10_a_target_of_an_axis_that_the_robot_does_not_have_is_refused() {
    let four = Cabinet { axis_count: 4, ..Cabinet::default() };
    let (_controller, robot) = robot_at(Character { cabinet: four, ..Character::default() }).await;
    let (target, targets) = TargetSender::new();
    target.send(AxisPosition::degrees([0.0, 0.0, 0.0, 0.0, 20.0]));
    let error = robot.follow(targets, FollowOptions::default()).await.unwrap_err();
    assert!(matches!(error.cause, Cause::Step(_)), "{error}");
    drop(target);
}

async fn b7_what_is_done_on_one_connection_is_not_said_from_the_next() {
    let (controller, robot) = robot_at(Character::default()).await;
    let handle = robot.run(&there_and_on(4), RunOptions::default()).await.unwrap();
    assert!(handle.step(3).unwrap().started().await);
    controller.arm(|arm, now| arm.break_links(now));
    let error = handle.finished().await.unwrap_err();
    let lost = RequestError::NotSent(NotSent::Disconnected);
    assert_eq!(error.cause, Cause::Unreadable(lost), "{error}");
}

async fn a6_all_who_wait_for_a_motion_that_failed_are_told() {
    let never = Character { never_executed: Some(NeverExecuted::Always), ..Character::default() };
    let (_controller, robot) = robot_at(never).await;
    let options = RunOptions { stop_on_failure: false, ..RunOptions::default() };
    drop(robot.run(&to_j1(20.0), options).await.unwrap());
    let wait = || robot.wait_until_done(WaitOptions::default());
    let (one, other) = tokio::join!(wait(), wait());
    for told in [one, other] {
        assert!(matches!(told, Err(WaitError::Motion(_))), "{told:?}");
    }
}

/// A motion that was reported as done is not reported as cut short because of later events.
async fn d19_a_cable_that_is_pulled_after_the_end_is_no_power_cut() {
    for stops in [false, true] {
        let (controller, robot) = robot_at(Character::default()).await;
        robot.run(&to_j1(20.0), RunOptions::default()).await.unwrap().finished().await.unwrap();
        if stops {
            assert!(robot.stop().await.unwrap().confirmed);
        }
        controller.arm(|arm, now| arm.break_links(now));
        while robot.status().await.is_err() {
            pause(Duration::from_millis(200)).await;
        }
        let told = robot.wait_until_done(WaitOptions::default()).await;
        let is_true = match &told {
            Ok(done) => !stops && done.proof == EndProof::AtRest,
            Err(WaitError::Stopped { .. } | WaitError::AlarmRaised { .. }) => stops,
            Err(_) => false,
        };
        assert!(is_true, "{stops}: {told:?}");
    }
}

async fn b10_following_ends_when_the_handle_is_closed() {
    let (controller, robot) = robot_at(Character::default()).await;
    let (target, targets) = TargetSender::new();
    let clone = robot.clone();
    let following = spawn(async move { clone.follow(targets, FollowOptions::default()).await });
    let told = tokio::spawn(async move {
        for n in 0..400 {
            target.send(AxisPosition::degrees([f64::from(n)]));
            sleep(Duration::from_millis(50)).await;
        }
    });
    pause(Duration::from_secs(2)).await;
    let begun = Instant::now();
    robot.close().await;
    assert!(begun.elapsed() < Duration::from_secs(1), "{:?}", begun.elapsed());
    let lists = |controller: &r6_testkit::hostile::serve::HostileController| {
        controller.arm(|arm, _| arm.carried(1).len())
    };
    let left = lists(&controller);
    pause(Duration::from_secs(5)).await;
    assert!(lists(&controller) <= left + 1, "the step that was under way at most");
    let error = following.await.unwrap().unwrap_err();
    assert_eq!(error.cause, Cause::Closed, "{error}");
    told.abort();
}
