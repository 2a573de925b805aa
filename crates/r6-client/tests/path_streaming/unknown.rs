//! Unknown outcomes: nothing is sent again.

use std::time::Duration;

use r6_client::units::AxisPosition;
use r6_client::{
    Cause, Done, FollowOptions, MotionError, NotSent, OutcomeUnknown, RequestError, Robot, RobotSettings,
    RunOptions, StepState,
};
use r6_controller::Profile;
use r6_sim::Clock;
use serde_json::Value;

use crate::cell::{Cell, soon, through, wave};
use crate::relay::{Break, Relay};

/// Streams 100 steps into a controller on which the scenario runs.
async fn stream(scenario: &str, options: RunOptions) -> (Cell, Result<Done, MotionError>, [StepState; 3]) {
    let cell = Cell::with(Profile::hc1(), Clock::Real, scenario, RobotSettings::default()).await;
    let handle = cell.robot.run(&through(&wave(100), 20.0, 5), options).await.unwrap();
    let steps = [1, 50, 100].map(|step| handle.step(step).unwrap());
    let result = soon(handle.finished()).await;
    (cell, result, steps.map(|step| step.state()))
}

#[tokio::test(start_paused = true)]
async fn a_list_that_is_carried_out_and_not_acknowledged_is_never_sent_again() {
    let unanswered = "[[fault]]\nfault = \"not-acknowledged\"\nfrom = 5\nfor = 2";
    let (mut cell, result, states) = stream(unanswered, RunOptions::default()).await;
    let error = result.unwrap_err();
    assert!(matches!(error.cause, Cause::OutcomeUnknown(OutcomeUnknown::TimedOut { .. })), "{error}");
    let progress = error.progress;
    // The controller has the list once, and nothing after it.
    assert_eq!(cell.taken(), progress.left);
    assert!(progress.left > progress.accepted && progress.left < 100, "{progress:?}");
    assert_eq!(progress.step(progress.left), Some(StepState::Lost));
    assert_eq!((states[0], states[2]), (StepState::Done, StepState::Queued));
    assert!(error.to_string().contains("Do not send it again"), "{error}");
    // The arm was stopped and its list was cleared.
    let report = error.stop.unwrap().unwrap();
    assert!(report.confirmed, "{report}");
    let snapshot = cell.handle().snapshot();
    assert_eq!((snapshot.moving, snapshot.list_length), (false, 0));
    // Later too, each step is found once.
    cell.robot.status().await.unwrap();
    assert_eq!(cell.taken(), progress.left);
}

#[tokio::test(start_paused = true)]
async fn who_does_not_want_the_arm_stopped_gets_it_as_it_is() {
    let unanswered = "[[fault]]\nfault = \"not-acknowledged\"\nfrom = 5\nfor = 2";
    let options = RunOptions { stop_on_failure: false, ..RunOptions::default() };
    let (mut cell, result, _) = stream(unanswered, options).await;
    let error = result.unwrap_err();
    assert!(error.stop.is_none());
    assert_eq!(cell.taken(), error.progress.left);
    cell.robot.wait_until_done(r6_client::WaitOptions::default()).await.unwrap();
    assert!(cell.error(&wave(100)[error.progress.left - 1]) < 0.01, "the arm has finished what it had");
    assert_eq!(cell.taken(), error.progress.left);
}

#[tokio::test(start_paused = true)]
async fn the_first_list_unanswered_is_not_sent_again_either() {
    let unanswered = "[[fault]]\nfault = \"not-acknowledged\"\nfor = 1";
    let (mut cell, result, states) = stream(unanswered, RunOptions::default()).await;
    let error = result.unwrap_err();
    assert!(matches!(error.cause, Cause::OutcomeUnknown(_)), "{error}");
    assert_eq!((error.progress.accepted, error.progress.left), (0, 8));
    assert_eq!(states, [StepState::Lost, StepState::Queued, StepState::Queued]);
    assert_eq!(cell.lists()[0], (8, true));
    assert_eq!(cell.taken(), 8);
}

#[tokio::test(start_paused = true)]
async fn half_a_list_taken_and_the_whole_refused_ends_the_path() {
    let half = "[[fault]]\nfault = \"rejected-mid-batch\"\nfrom = 5";
    let (mut cell, result, _) = stream(half, RunOptions::default()).await;
    let error = result.unwrap_err();
    assert!(matches!(error.cause, Cause::Refused(_)), "{error}");
    assert_eq!(error.progress.left, error.progress.accepted + 8, "what became of those eight is unknown");
    assert_eq!(cell.taken(), error.progress.accepted);
    assert!(error.stop.unwrap().unwrap().confirmed);
    assert_eq!(cell.handle().snapshot().list_length, 0);
}

/// Streams 100 steps over a link that breaks.
async fn over(breaks: impl Into<Option<Break>>, delay: Duration) -> (Cell, Relay, Result<Done, MotionError>) {
    let cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let (relay, address) = Relay::to(cell.controller.address(), breaks, delay).await;
    let robot = Robot::connect(&address.to_string(), RobotSettings::default()).await.unwrap();
    let handle = robot.run(&through(&wave(100), 20.0, 5), RunOptions::default()).await.unwrap();
    let result = soon(handle.finished()).await;
    (cell, relay, result)
}

#[tokio::test(start_paused = true)]
async fn a_link_that_breaks_with_a_list_under_way_ends_the_path() {
    for number in [1, 2, 5, 13] {
        for breaks in [Break::Reply("AddRCC", number), Break::Request("AddRCC", number)] {
            let (mut cell, _relay, result) = over(breaks, Duration::ZERO).await;
            let error = result.unwrap_err();
            assert!(
                matches!(error.cause, Cause::OutcomeUnknown(OutcomeUnknown::ConnectionLost { .. })),
                "{breaks:?}: {error}"
            );
            let before = (number - 1) * 8;
            let left = (number * 8).min(100);
            assert_eq!((error.progress.accepted, error.progress.left), (before, left), "{breaks:?}");
            // The client cannot know whether it arrived. In no case did it arrive twice.
            let arrived = if matches!(breaks, Break::Reply(..)) { left } else { before };
            assert_eq!(cell.taken(), arrived, "{breaks:?}");
            let report = error.stop.unwrap().unwrap();
            assert!(report.confirmed, "{breaks:?}: {report}");
            let snapshot = cell.handle().snapshot();
            assert_eq!((snapshot.moving, snapshot.list_length), (false, 0), "{breaks:?}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_link_that_breaks_with_a_question_under_way_ends_the_path_with_it() {
    for number in [40, 100] {
        for breaks in [Break::Reply("query", number), Break::Request("query", number)] {
            let (mut cell, relay, result) = over(breaks, Duration::ZERO).await;
            let error = result.unwrap_err();
            let lost = matches!(error.cause, Cause::NotSent(NotSent::Disconnected));
            assert!(lost, "{breaks:?}: {error}");
            // The robot that answers now may be at another position, or may have just been switched on: it
            // gets nothing of the old path.
            let left = error.progress.left;
            assert!(left < 100 && cell.taken() == left, "{breaks:?}: {error}");
            // One more list clears the rest. It does not belong to the path.
            let steps = |list: &Value| list["instructions"].as_array().map_or(0, Vec::len);
            let told: Vec<usize> = relay.lists().iter().map(steps).collect();
            assert!(told.starts_with(&[8, 8, 8]) && told.len() == left / 8 + 1, "{breaks:?}: {told:?}");
            assert!(error.stop.unwrap().unwrap().confirmed, "{breaks:?}");
            let snapshot = cell.handle().snapshot();
            assert_eq!((snapshot.moving, snapshot.list_length), (false, 0), "{breaks:?}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_link_that_breaks_before_anything_left_hinders_no_path() {
    for breaks in [Break::Reply("query", 2), Break::Request("query", 2)] {
        let (mut cell, relay, result) = over(breaks, Duration::ZERO).await;
        result.unwrap_or_else(|error| panic!("{breaks:?}: {error}"));
        assert!(relay.has_broken(), "{breaks:?}");
        assert_eq!((cell.taken(), relay.lists().len()), (100, 13), "{breaks:?}");
        assert!(cell.error(&wave(100)[99]) < 0.01);
    }
}

/// Another connection does not show whether the end that is seen there is the end of this path.
#[tokio::test(start_paused = true)]
async fn a_link_that_breaks_after_all_has_left_ends_the_path_with_what_was_seen_done() {
    for breaks in [Break::Reply("query", 350), Break::Request("query", 350)] {
        let (mut cell, relay, result) = over(breaks, Duration::ZERO).await;
        let error = result.unwrap_err();
        let lost = RequestError::NotSent(NotSent::Disconnected);
        assert_eq!(error.cause, Cause::Unreadable(lost), "{breaks:?}: {error}");
        let progress = error.progress;
        assert_eq!((progress.left, progress.accepted), (100, 100), "{breaks:?}");
        assert!((50..100).contains(&progress.done), "{breaks:?}: {progress:?}");
        assert_eq!(progress.step(100), Some(StepState::Lost));
        // Nothing came twice, except the list that clears the rest.
        assert_eq!((cell.taken(), relay.lists().len()), (100, 14), "{breaks:?}");
        assert!(error.stop.unwrap().unwrap().confirmed, "{breaks:?}");
        let snapshot = cell.handle().snapshot();
        assert_eq!((snapshot.moving, snapshot.list_length), (false, 0), "{breaks:?}");
    }
}

/// The source continues for much longer than the connection: a followed target is a path without a known end.
#[tokio::test(start_paused = true)]
async fn a_target_that_is_followed_ends_with_its_connection() {
    for number in [20, 45] {
        for breaks in [Break::Reply("query", number), Break::Request("query", number)] {
            let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
            let (relay, address) = Relay::to(cell.controller.address(), breaks, Duration::ZERO).await;
            let robot = Robot::connect(&address.to_string(), RobotSettings::default()).await.unwrap();
            let (target, targets) = r6_client::TargetSender::new();
            let source = async move {
                while !target.is_closed() {
                    target.send(AxisPosition::degrees([150.0]));
                    tokio::time::sleep(Duration::from_millis(50)).await;
                }
            };
            let following = robot.follow(targets, FollowOptions::default());
            let (followed, ()) = soon(async { tokio::join!(following, source) }).await;
            let error = followed.expect_err("its connection is lost");
            // This happens at the next step, or at the look whether the last step is done.
            let lost = matches!(
                error.cause,
                Cause::NotSent(NotSent::Disconnected)
                    | Cause::Unreadable(RequestError::NotSent(NotSent::Disconnected))
            );
            assert!(relay.has_broken() && lost, "{breaks:?}: {error}");
            // Each step is its own list. The last list clears the rest and is not a step.
            let (left, stop) = (error.progress.left, error.stop.unwrap().unwrap());
            assert!(left > 0 && cell.taken() == left, "{breaks:?}: {left} of {} left", cell.taken());
            let steps =
                relay.lists().iter().filter(|list| list["instructions"] != serde_json::json!([])).count();
            assert_eq!(steps, left, "{breaks:?}");
            assert!(stop.confirmed, "{breaks:?}: {stop}");
            let now = cell.handle().snapshot();
            assert!(!now.moving && now.list_length == 0 && now.axes[0] < 140.0, "{breaks:?}: {now:?}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn late_answers_are_waited_for() {
    let (mut cell, _relay, result) = over(None, Duration::from_millis(150)).await;
    result.unwrap();
    assert_eq!((cell.taken(), cell.lists().len()), (100, 13));
    assert!(cell.error(&wave(100)[99]) < 0.01);
}

#[tokio::test(start_paused = true)]
async fn what_is_sent_is_what_a_dry_run_told() {
    let cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let (relay, address) = Relay::to(cell.controller.address(), None, Duration::ZERO).await;
    let robot = Robot::connect(&address.to_string(), RobotSettings::default()).await.unwrap();
    let motion = through(&wave(100), 50.0, 5).wait(Duration::from_millis(100));
    let told = robot.dry_run(&motion, RunOptions::default()).unwrap();
    assert!(relay.lists().is_empty(), "a dry run sends nothing");
    let handle = robot.run(&motion, RunOptions::default()).await.unwrap();
    soon(handle.finished()).await.unwrap();
    let without_id = |mut frame: Value| {
        assert!(frame["packID"].is_string());
        frame["packID"].take();
        frame
    };
    let told: Vec<Value> =
        told.iter().map(|frame| without_id(serde_json::from_slice(frame).unwrap())).collect();
    let sent: Vec<Value> = relay.lists().into_iter().map(without_id).collect();
    assert_eq!(sent, told);
    let steps: usize = sent.iter().map(|frame| frame["instructions"].as_array().unwrap().len()).sum();
    assert_eq!(steps, 101);
}
