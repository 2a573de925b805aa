//! Following a moving target: never more than is safe, no step twice, and never towards an old target.

use std::pin::Pin;
use std::time::Duration;

use r6_client::units::{AxisPosition, Degrees, Percent};
use r6_client::{
    Cause, Envelope, FollowOptions, Followed, MotionError, MotionHandle, OutcomeUnknown, Robot,
    RobotSettings, RunOptions, TargetSender,
};
use r6_controller::{Profile, Scenario, StartState};
use r6_sim::{Builder, VirtualController};

use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};

/// An event that has not happened after this time never will. The clock of these tests jumps to the next
/// event.
const PATIENCE: Duration = Duration::from_secs(600);

const TICK: Duration = Duration::from_millis(50);

async fn cell(builder: Builder) -> (VirtualController, Robot) {
    let controller = builder.start().await.unwrap();
    let address = controller.address().to_string();
    let robot = Robot::connect(&address, RobotSettings::default()).await.unwrap();
    (controller, robot)
}

fn j1(degrees: f64) -> AxisPosition {
    AxisPosition::degrees([degrees])
}

/// Follows the targets of the source until it ends.
async fn follow(
    robot: &Robot,
    options: FollowOptions,
    source: impl AsyncFnOnce(TargetSender),
) -> Result<Followed, MotionError> {
    let (target, targets) = TargetSender::new();
    let following = robot.follow(targets, options);
    timeout(PATIENCE, async { tokio::join!(following, source(target)).0 }).await.expect("it never ends")
}

/// Sends the same target, 20 times a second, for this time.
async fn hold(target: &TargetSender, at: AxisPosition, time: Duration) {
    for _ in 0..time.as_millis() / TICK.as_millis() {
        target.send(at);
        sleep(TICK).await;
    }
}

fn lists(log: &mut tokio::sync::broadcast::Receiver<std::sync::Arc<r6_controller::LogEntry>>) -> usize {
    let mut count = 0;
    while let Ok(line) = log.try_recv() {
        count += usize::from(line.event.is_about_a_list());
    }
    count
}

#[tokio::test(start_paused = true)]
async fn the_newest_target_wins_and_those_in_between_are_skipped() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    let mut log = controller.handle().log();
    let followed = follow(&robot, FollowOptions::default(), async |target| {
        for n in 0..40 {
            // Back and forth: the positions in between are never the target.
            target.send(j1(if n % 2 == 0 { 60.0 } else { -60.0 }));
        }
        hold(&target, j1(5.0), Duration::from_secs(3)).await;
    })
    .await
    .unwrap();
    assert_eq!((followed.steps, followed.axes[0]), (1, Some(5.0)));
    assert_eq!(lists(&mut log), 1);
}

#[tokio::test(start_paused = true)]
async fn a_target_that_is_no_longer_sent_is_not_gone_to() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    let followed = follow(&robot, FollowOptions::default(), async |target| {
        target.send(j1(100.0));
        // The source hangs but has not ended.
        sleep(Duration::from_secs(60)).await;
        drop(target);
    })
    .await
    .unwrap();
    let at = controller.handle().snapshot().axes[0];
    assert!(at > 5.0 && at < 31.0, "half a second, and the step that was begun: {at}");
    assert_eq!(followed.behind, Some(Degrees(100.0 - at)));
}

/// A target that was not repeated in time is not followed. It also does not cause an error.
#[tokio::test(start_paused = true)]
async fn a_target_that_grew_old_while_the_arm_was_on_its_way_is_not_checked() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    let guard = Envelope::new().axis_limits(r6_client::AxisIndex::ALL[0], Degrees(-15.0), Degrees(15.0));
    let slowly = FollowOptions { speed: Percent::new(2.0).unwrap(), ..FollowOptions::default() };
    let followed = follow(&robot.with_guard(guard), slowly, async |target| {
        hold(&target, j1(10.0), Duration::from_millis(200)).await;
        // A target beyond the limits, sent once, and old before the arm has finished its step.
        target.send(j1(50.0));
        sleep(Duration::from_secs(60)).await;
        drop(target);
    })
    .await
    .unwrap();
    assert_eq!((followed.steps, controller.handle().snapshot().axes[0]), (1, 10.0));
    assert_eq!(followed.behind, Some(Degrees(40.0)));
}

#[tokio::test(start_paused = true)]
async fn nothing_more_is_sent_once_the_source_has_ended() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    let mut log = controller.handle().log();
    let followed = follow(&robot, FollowOptions::default(), async |target| {
        hold(&target, j1(90.0), Duration::from_millis(150)).await;
    })
    .await
    .unwrap();
    assert_eq!(followed.steps, 1);
    assert_eq!(controller.handle().snapshot().axes[0], 10.0, "one step of 10 deg");
    assert_eq!(lists(&mut log), 1);
}

#[tokio::test(start_paused = true)]
async fn a_stop_of_any_handle_ends_it() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    let other = robot.clone();
    let error = follow(&robot, FollowOptions::default(), async |target| {
        hold(&target, j1(150.0), Duration::from_secs(1)).await;
        assert!(!target.is_closed());
        timeout(TICK, target.closed()).await.expect_err("it is still followed");
        assert!(other.stop().await.unwrap().confirmed);
        target.closed().await;
        assert!(target.is_closed(), "its source is told");
        hold(&target, j1(150.0), Duration::from_secs(1)).await;
    })
    .await
    .unwrap_err();
    assert_eq!(error.cause, Cause::StoppedHere);
    let now = controller.handle().snapshot();
    assert!(!now.moving && now.list_length == 0 && now.axes[0] < 60.0, "{now:?}");
}

#[tokio::test(start_paused = true)]
async fn a_step_whose_outcome_is_unknown_is_not_sent_again_and_the_arm_is_stopped() {
    let fault = "[[fault]]\nfault = \"not-acknowledged\"\nfrom = 0\nfor = 1";
    let builder = VirtualController::builder().scenario(Scenario::read(fault).unwrap());
    let (controller, robot) = cell(builder).await;
    let mut log = controller.handle().log();
    let error = follow(&robot, FollowOptions::default(), async |target| {
        hold(&target, j1(150.0), Duration::from_secs(10)).await;
    })
    .await
    .unwrap_err();
    assert!(matches!(error.cause, Cause::OutcomeUnknown(OutcomeUnknown::TimedOut { .. })), "{error}");
    assert_eq!((error.progress.left, error.progress.accepted), (1, 0));
    assert!(error.stop.as_ref().unwrap().is_ok(), "{error}");
    // The second list in the log, if there is one, clears the rest.
    assert!((1..=2).contains(&lists(&mut log)));
    assert_eq!(controller.handle().snapshot().axes[0], 10.0);
}

#[tokio::test(start_paused = true)]
async fn the_guard_holds_every_step() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    let guarded = robot.with_guard(
        Envelope::new()
            .axis_limits(r6_client::AxisIndex::ALL[0], Degrees(-25.0), Degrees(25.0))
            .largest_axis_step(Degrees(10.0)),
    );
    let error = follow(&guarded, FollowOptions::default(), async |target| {
        hold(&target, j1(90.0), Duration::from_secs(10)).await;
    })
    .await
    .unwrap_err();
    assert!(matches!(error.cause, Cause::OutsideEnvelope(_)), "{error}");
    assert_eq!(controller.handle().snapshot().axes[0], 20.0, "two steps, and not the third");
    let told = "step 3: J1 goes to 30 deg, outside of -25 to 25 deg; this step was not sent; 2 done, 0 sent and not \
                seen to be done";
    assert!(error.to_string().starts_with(told) && !error.to_string().contains("nothing"), "{error}");
}

#[tokio::test(start_paused = true)]
async fn a_machine_that_is_not_ready_gets_no_step_and_two_do_not_follow() {
    let (controller, robot) = cell(VirtualController::builder().stands(StartState::Stopped)).await;
    let mut log = controller.handle().log();
    let never = async |_: r6_client::TargetSender| {};
    let error = follow(&robot, FollowOptions::default(), never).await.unwrap_err();
    assert!(matches!(error.cause, Cause::NotReady(_)) && error.nothing_left(), "{error}");
    assert_eq!(lists(&mut log), 0);

    let (_controller, robot) = cell(VirtualController::builder()).await;
    let (target, targets) = TargetSender::new();
    let first = tokio::spawn({
        let robot = robot.clone();
        async move { robot.follow(targets, FollowOptions::default()).await }
    });
    sleep(Duration::from_secs(1)).await;
    let error = follow(&robot, FollowOptions::default(), never).await.unwrap_err();
    assert_eq!(error.cause, Cause::AnotherRuns);
    let motion = r6_client::Motion::new().axis_move(j1(1.0), Percent::MAX);
    assert_eq!(robot.run(&motion, RunOptions::default()).await.unwrap_err().cause, Cause::AnotherRuns);
    drop(target);
    assert_eq!(first.await.unwrap().unwrap().steps, 0);
}

/// A motion that a stop has reached, and that ends once this is driven.
async fn stopped(robot: &Robot) -> Pin<Box<dyn Future<Output = Result<Followed, MotionError>>>> {
    let follower = robot.clone();
    let mut following = Box::pin(async move {
        let (target, targets) = TargetSender::new();
        target.send(j1(60.0));
        follower.follow(targets, FollowOptions::default()).await
    });
    assert!(timeout(Duration::from_secs(1), &mut following).await.is_err(), "it follows");
    stop_and_start(robot).await;
    following
}

async fn stop_and_start(robot: &Robot) {
    assert!(robot.stop().await.unwrap().confirmed);
    robot.command(r6_client::Command::StartButton).await.unwrap();
}

/// Runs a motion to 1 degree in a task of its own. Another motion has the turn, so it waits.
async fn waiting_run(robot: &Robot) -> JoinHandle<Result<MotionHandle, MotionError>> {
    let robot = robot.clone();
    let run = tokio::spawn(async move { robot.run(&to_one_degree(), RunOptions::default()).await });
    sleep(Duration::from_secs(1)).await;
    assert!(!run.is_finished(), "the stopped motion still has the turn");
    run
}

fn to_one_degree() -> r6_client::Motion {
    r6_client::Motion::new().axis_move(j1(1.0), Percent::MAX)
}

/// The report of a stop may be there a moment before the motion that it stopped has ended.
#[tokio::test(start_paused = true)]
async fn a_motion_waits_for_the_end_of_one_that_was_stopped() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    let following = stopped(&robot).await;
    let run = waiting_run(&robot).await;
    assert_eq!(following.await.unwrap_err().cause, Cause::StoppedHere);
    run.await.unwrap().unwrap().finished().await.unwrap();
    assert_eq!(controller.handle().snapshot().axes[0], 1.0);
}

#[tokio::test(start_paused = true)]
async fn a_stop_is_also_for_a_motion_that_waits_for_the_end_of_another() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    let following = stopped(&robot).await;
    let run = waiting_run(&robot).await;
    stop_and_start(&robot).await;
    let there = controller.handle().snapshot().axes[0];
    assert_eq!(following.await.unwrap_err().cause, Cause::StoppedHere);
    assert_eq!(run.await.unwrap().unwrap_err().cause, Cause::StoppedHere);
    sleep(Duration::from_secs(1)).await;
    assert_eq!(controller.handle().snapshot().axes[0], there, "nothing of it was sent");
}

#[tokio::test(start_paused = true)]
async fn a_motion_waits_15_s_at_most_for_the_end_of_another() {
    let (_controller, robot) = cell(VirtualController::builder()).await;
    let following = stopped(&robot).await;
    let begun = tokio::time::Instant::now();
    let refused = robot.run(&to_one_degree(), RunOptions::default()).await.unwrap_err();
    assert_eq!((refused.cause, begun.elapsed().as_secs()), (Cause::AnotherRuns, 15));
    drop(following);
    robot.run(&to_one_degree(), RunOptions::default()).await.unwrap().finished().await.unwrap();
}

#[tokio::test(start_paused = true)]
async fn firmware_without_the_length_of_its_list_is_fed_only_at_rest() {
    let profile = Profile::named("legacy").unwrap();
    let (controller, robot) = cell(VirtualController::builder().profile(profile)).await;
    let options = FollowOptions { while_moving: true, ..FollowOptions::default() };
    let handle = controller.handle().clone();
    let mut longest = 0;
    let followed = follow(&robot, options, async |target| {
        for _ in 0..200 {
            target.send(j1(60.0));
            sleep(TICK).await;
            longest = longest.max(handle.snapshot().list_length);
        }
    })
    .await
    .unwrap();
    assert_eq!((followed.axes[0], longest), (Some(60.0), 1));
}

#[tokio::test(start_paused = true)]
async fn an_alarm_ends_it() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    // J6 of this arm ends at 340 degrees.
    let to = AxisPosition::none().with(r6_client::AxisIndex::ALL[5], Degrees(400.0));
    let options =
        FollowOptions { speed: Percent::MAX, largest_step: Degrees(60.0), ..FollowOptions::default() };
    let error = follow(&robot, options, async |target| {
        hold(&target, to, Duration::from_secs(60)).await;
    })
    .await
    .unwrap_err();
    assert_eq!(error.cause, Cause::AlarmRaised { code: 135 });
    assert!(!controller.handle().snapshot().moving);
}

#[tokio::test(start_paused = true)]
async fn options_that_cannot_be_followed_are_refused_before_anything_is_asked() {
    let usual = FollowOptions::default();
    let largest = |largest| FollowOptions { largest_step: Degrees(largest), ..usual };
    let smallest = |smallest| FollowOptions { smallest_step: Degrees(smallest), ..usual };
    let cases = [
        ("largest_step", largest(f64::NAN)),
        ("largest_step", largest(f64::INFINITY)),
        ("largest_step", largest(-10.0)),
        ("largest_step", largest(0.0)),
        ("smallest_step", smallest(f64::NAN)),
        ("smallest_step", smallest(-1.0)),
        ("smallest_step", smallest(0.0)),
        ("smallest_step", smallest(10.1)),
        ("interval", FollowOptions { interval: Duration::ZERO, ..usual }),
        ("interval", FollowOptions { interval: Duration::from_micros(1), ..usual }),
        ("fresh_within", FollowOptions { fresh_within: Duration::ZERO, ..usual }),
    ];
    let (_controller, robot) = cell(VirtualController::builder()).await;
    // All requests on this handle now fail because it is closed.
    robot.clone().close().await;
    for (wrong, options) in cases {
        let error = follow(&robot, options, async |_| {}).await.unwrap_err();
        let Cause::Step(told) = error.cause else { panic!("{wrong}: {error}") };
        assert_eq!((told.step, told.field), (0, wrong), "{options:?}");
        assert!(error.nothing_left() && error.progress.ended);
    }
    let error = follow(&robot, usual, async |_| {}).await.unwrap_err();
    assert!(matches!(error.cause, Cause::Unreadable(_)), "{error}");
}
