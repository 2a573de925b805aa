//! How a path ends early, and what prevents it from starting.

use std::time::Duration;

use r6_client::units::AxisPosition;
use r6_client::{
    Cause, Motion, MotionError, MotionHandle, OperationMode, Robot, RobotSettings, RunOptions, StepState,
    Unmet, WaitCondition, WaitError,
};
use r6_controller::{Key, PanelAction, Profile};
use r6_proto::Command;
use r6_sim::{Clock, VirtualController};

use crate::cell::{Cell, percent, profile, soon, through, wave};

/// A running path of 100 steps that has reached its thirtieth step.
async fn under_way(cell: &Cell, options: RunOptions) -> MotionHandle {
    let handle = cell.robot.run(&through(&wave(100), 20.0, 5), options).await.unwrap();
    assert!(soon(handle.step(30).unwrap().started()).await);
    handle
}

/// Checks that nothing moves and that no instruction is left that could start.
fn assert_at_rest(cell: &Cell) {
    let snapshot = cell.handle().snapshot();
    assert_eq!((snapshot.moving, snapshot.list_length), (false, 0));
}

#[tokio::test(start_paused = true)]
async fn the_handle_stops_the_arm_in_mid_path() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let handle = under_way(&cell, RunOptions::default()).await;
    let (mut done, mut lost, mut queued) =
        (handle.step(29).unwrap(), handle.step(40).unwrap(), handle.step(100).unwrap());
    let report = handle.stop().await.unwrap();
    assert!(report.confirmed, "{report}");
    assert_at_rest(&cell);
    assert!(done.done().await && !lost.done().await && !queued.done().await);
    assert_eq!(
        [done.state(), lost.state(), queued.state()],
        [StepState::Done, StepState::Lost, StepState::Queued]
    );
    assert!(cell.taken() < 70, "{}", cell.taken());
}

#[tokio::test(start_paused = true)]
async fn who_waits_may_give_up_and_stop() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let mut handle = under_way(&cell, RunOptions::default()).await;
    tokio::time::timeout(Duration::from_millis(200), handle.wait()).await.unwrap_err();
    assert!(handle.step(33).unwrap().done().await, "it goes on");
    let report = handle.stop().await.unwrap();
    assert!(report.confirmed, "{report}");
    assert_at_rest(&cell);
    assert!(cell.taken() < 70, "{}", cell.taken());
}

#[tokio::test(start_paused = true)]
async fn the_end_may_be_asked_for_again_and_again() {
    let cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let motion = through(&wave(5), 20.0, 5);
    let mut handle = cell.robot.run(&motion, RunOptions::default()).await.unwrap();
    assert_eq!(handle.steps(), motion.instructions().unwrap());
    assert_eq!([1, 5].map(|step| handle.step(step).unwrap().number()), [1, 5]);
    let done = soon(handle.wait()).await.unwrap();
    assert_eq!(handle.wait().await.unwrap(), done);
    // A motion that has ended can still be stopped.
    let report = handle.stop().await.unwrap();
    assert_eq!((report.confirmed, report.attempts), (true, 1));
    assert_at_rest(&cell);
}

#[tokio::test(start_paused = true)]
async fn a_stop_by_another_clone_ends_the_path() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let handle = under_way(&cell, RunOptions::default()).await;
    let report = cell.robot.clone().stop().await.unwrap();
    assert!(report.confirmed, "{report}");
    let error = soon(handle.finished()).await.unwrap_err();
    assert_eq!(error.cause, Cause::StoppedHere);
    let stopped = error.stop.expect("what became of the other's stop").unwrap();
    assert_eq!(stopped, report);
    assert_at_rest(&cell);
    let taken = cell.taken();
    assert_eq!(taken, error.progress.left);
    // The list was empty or was cleared, and nothing was sent after that.
    cell.robot.status().await.unwrap();
    assert_eq!(cell.taken(), taken);
}

#[tokio::test(start_paused = true)]
async fn whoever_is_stopped_by_another_task_hears_of_it_when_the_stop_is_over() {
    let cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let handle = under_way(&cell, RunOptions::default()).await;
    let other = cell.robot.clone();
    let stopping = tokio::spawn(async move { other.stop().await });
    let error = soon(handle.finished()).await.unwrap_err();
    // A program may end here, so no instruction may be left that runs at the next start.
    assert_at_rest(&cell);
    assert_eq!(cell.handle().snapshot().list_length, 0);
    assert_eq!(error.cause, Cause::StoppedHere);
    assert!(error.to_string().contains("the arm stands"), "{error}");
    let report = error.stop.expect("what became of the stop").unwrap();
    assert!(report.confirmed && report.list_length == Some(0), "{report}");
    assert_eq!(soon(stopping).await.unwrap().unwrap(), report);
    // An older stop does not affect the next motion.
    cell.robot.command(Command::StartButton).await.unwrap();
    let handle = under_way(&cell, RunOptions::default()).await;
    cell.robot.command(Command::ActionPause).await.unwrap();
    let error = soon(handle.finished()).await.unwrap_err();
    assert_eq!((error.cause, error.stop), (Cause::StoppedHere, None));
}

#[tokio::test(start_paused = true)]
async fn whoever_pauses_the_arm_ends_the_path_and_nothing_is_cleared_behind_his_back() {
    let cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let handle = under_way(&cell, RunOptions::default()).await;
    cell.robot.command(Command::ActionPause).await.unwrap();
    let error = soon(handle.finished()).await.unwrap_err();
    assert_eq!((error.cause, error.stop), (Cause::StoppedHere, None));
    assert!(cell.handle().snapshot().list_length > 0);
}

#[tokio::test(start_paused = true)]
async fn an_alarm_in_mid_path_names_the_step_and_leaves_nothing_in_the_list() {
    // J6 goes beyond its soft limit in step 45.
    let mut points = wave(100);
    points[44][5] = 380.0;
    for name in ["hc1", "legacy"] {
        let mut cell = Cell::new(profile(name), Clock::Real).await;
        let handle = cell.robot.run(&through(&points, 20.0, 5), RunOptions::default()).await.unwrap();
        let error = soon(handle.finished()).await.unwrap_err();
        assert_eq!(error.cause, Cause::AlarmRaised { code: 135 }, "{name}");
        let current = error.progress.current();
        // If only the position tells the progress, the step not seen to be over may be one step earlier.
        assert!(current == 45 || (name == "legacy" && current == 44), "{name}: {error}");
        assert!(error.to_string().contains(&format!("step {current} of 100: ")), "{error}");
        assert!(error.to_string().contains("J6"), "{error}");
        let report = error.stop.unwrap().unwrap();
        assert!(report.confirmed, "{report}");
        assert_at_rest(&cell);
        assert_eq!(cell.taken(), error.progress.left, "{name}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_key_that_is_turned_ends_the_path() {
    let cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let handle = under_way(&cell, RunOptions::default()).await;
    cell.handle().operate(&PanelAction::TurnKey(Key::Stop)).unwrap();
    let error = soon(handle.finished()).await.unwrap_err();
    assert_eq!(error.cause, Cause::Stopped { mode: OperationMode::Stop }, "{error}");
    assert!((30..40).contains(&error.progress.current()), "{error}");
}

#[tokio::test(start_paused = true)]
async fn without_a_handle_the_motion_goes_on_to_its_end_and_is_named() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let handle = under_way(&cell, RunOptions::default()).await;
    let number = handle.number();
    drop(handle);
    let done = cell.robot.wait_until_done(r6_client::WaitOptions::default()).await.unwrap();
    assert_eq!((done.motion, done.proof), (Some(number), r6_client::EndProof::Reached));
    assert_eq!(cell.taken(), 100);
    assert_at_rest(&cell);
    assert!(cell.error(&wave(100)[99]) < 0.01);
    // The failure was reported once. The next wait does not concern a motion of this handle.
    let done = cell.robot.wait_until_done(r6_client::WaitOptions::default()).await.unwrap();
    assert_eq!((done.motion, done.moved), (None, false));
}

#[tokio::test(start_paused = true)]
async fn without_a_handle_a_motion_that_is_cut_short_is_never_told_as_done() {
    for stop_on_drop in [true, false] {
        let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
        let handle = under_way(&cell, RunOptions { stop_on_drop, ..RunOptions::default() }).await;
        let left = handle.progress().left;
        drop(handle);
        if !stop_on_drop {
            assert!(cell.robot.stop().await.unwrap().confirmed);
        }
        let error = cell.robot.wait_until_done(r6_client::WaitOptions::default()).await.unwrap_err();
        let WaitError::Motion(error) = error else { panic!("{error:?}") };
        assert_eq!(error.cause, if stop_on_drop { Cause::Dropped } else { Cause::StoppedHere });
        assert!(error.stop.unwrap().unwrap().confirmed);
        assert!(cell.taken() <= left + 16, "{}", cell.taken());
        assert_at_rest(&cell);
    }
}

#[tokio::test(start_paused = true)]
async fn closing_the_robot_tells_which_motion_it_cut_short() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let handle = under_way(&cell, RunOptions::default()).await;
    drop(handle);
    let cut = cell.robot.clone().close().await.cut_short.expect("a motion was under way");
    assert_eq!(cut.cause, Cause::Closed);
    assert!(cut.to_string().contains("never sent"), "{cut}");
    assert_eq!(cell.taken(), cut.progress.left, "nothing more has left");
}

async fn refused(robot: &Robot, options: RunOptions) -> MotionError {
    let error = robot.run(&through(&wave(10), 20.0, 5), options).await.unwrap_err();
    assert!(error.nothing_left());
    error
}

#[tokio::test(start_paused = true)]
async fn conditions_that_are_not_met_are_named_before_anything_is_sent() {
    use r6_controller::StartState;
    for (start, found) in
        [(StartState::Auto, OperationMode::Auto), (StartState::Manual, OperationMode::Manual)]
    {
        let controller = VirtualController::builder().stands(start).start().await.unwrap();
        let mut log = controller.handle().log();
        let robot =
            Robot::connect(&controller.address().to_string(), RobotSettings::default()).await.unwrap();
        let error = refused(&robot, RunOptions::default()).await;
        assert_eq!(error.cause, Cause::NotReady(vec![Unmet::Mode { found }]));
        assert!(error.to_string().contains("nothing was sent"), "{error}");
        while let Ok(line) = log.try_recv() {
            assert!(!line.event.is_about_a_list(), "{line}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_list_that_is_left_over_is_told_or_cleared_as_wished() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let input = "X013".parse().unwrap();
    let waits = Motion::new().wait_for(input, WaitCondition::On, None);
    cell.robot.add_rcc(true, waits.instructions().unwrap().to_vec()).await.unwrap();
    let error = refused(&cell.robot, RunOptions::default()).await;
    assert_eq!(error.cause, Cause::NotReady(vec![Unmet::LeftoverList { length: 1 }]));
    assert_eq!(cell.lists(), [(1, true)]);
    let clears = RunOptions { clear_leftover: true, ..RunOptions::default() };
    let handle = cell.robot.run(&through(&wave(10), 20.0, 5), clears).await.unwrap();
    soon(handle.finished()).await.unwrap();
    assert_eq!(cell.lists(), [(1, true), (0, true), (8, true), (2, false)]);
    assert!(cell.error(&wave(10)[9]) < 0.01);
}

#[tokio::test(start_paused = true)]
async fn what_is_wrong_with_a_motion_is_told_before_anything_is_sent() {
    let cell = Cell::new(profile("legacy"), Clock::Real).await;
    let wrong = through(&wave(3), 20.0, 5).blend(12);
    let error = cell.robot.run(&wrong, RunOptions::default()).await.unwrap_err();
    assert!(error.to_string().contains("step 3: the blend has to be"), "{error}");
    let error = cell.robot.run(&Motion::new(), RunOptions::default()).await.unwrap_err();
    assert!(error.to_string().contains("one step at least"), "{error}");
    let endless = through(&wave(3), 20.0, 5).wait_for("X013".parse().unwrap(), WaitCondition::On, None);
    let error = cell.robot.run(&endless, RunOptions::default()).await.unwrap_err();
    assert!(error.to_string().contains("does not tell the length"), "{error}");
}

#[tokio::test(start_paused = true)]
async fn what_stands_where_it_should_move_is_stalled() {
    let frozen = "[[fault]]\nfault = \"list-frozen\"\nfrom = 5";
    for name in ["hc1", "legacy"] {
        let cell = Cell::with(profile(name), Clock::Real, frozen, RobotSettings::default()).await;
        let handle = cell.robot.run(&through(&wave(100), 20.0, 5), RunOptions::default()).await.unwrap();
        let error = soon(handle.finished()).await.unwrap_err();
        // If the length of the list is not known, this looks like an end at the wrong place.
        let expected = match error.cause {
            Cause::Stalled { .. } => name == "hc1",
            Cause::Elsewhere(_) => name == "legacy",
            _ => false,
        };
        assert!(expected, "{name}: {error}");
        assert!(error.stop.unwrap().unwrap().confirmed);
        assert_at_rest(&cell);
    }
}

#[tokio::test(start_paused = true)]
async fn a_wait_for_a_signal_is_no_stall() {
    let cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let input = "X013".parse().unwrap();
    let motion = through(&wave(3), 20.0, 0).wait_for(input, WaitCondition::On, None);
    let motion = motion.axis_move(AxisPosition::degrees([5.0; 6]), percent(20.0));
    let handle = cell.robot.run(&motion, RunOptions::default()).await.unwrap();
    assert!(soon(handle.step(4).unwrap().started()).await);
    let limit = RunOptions::default().stall_within * 4;
    let mut last = handle.step(5).unwrap();
    assert!(tokio::time::timeout(limit, last.started()).await.is_err(), "it waits");
    cell.handle().operate(&PanelAction::SetInput { board: 0, point: 3, on: true }).unwrap();
    soon(handle.finished()).await.unwrap();
    assert!(cell.error(&[5.0; 6]) < 0.01);
}

#[tokio::test(start_paused = true)]
async fn ok_without_a_motion_is_not_done() {
    let ignores = "[[fault]]\nfault = \"not-executed\"";
    for name in ["hc1", "legacy"] {
        let cell = Cell::with(profile(name), Clock::Real, ignores, RobotSettings::default()).await;
        let handle = cell.robot.run(&through(&wave(30), 20.0, 5), RunOptions::default()).await.unwrap();
        let first = handle.step(1).unwrap();
        let error = soon(handle.finished()).await.unwrap_err();
        assert!(matches!(error.cause, Cause::Elsewhere(_)), "{name}: {error}");
        assert_eq!((error.progress.done, first.state()), (0, StepState::Lost), "{name}: {error}");
    }
}

#[tokio::test(start_paused = true)]
async fn values_that_no_longer_change_are_noticed() {
    let frozen = "[[fault]]\nfault = \"frozen-values\"\nfrom = 5";
    let cell = Cell::with(Profile::hc1(), Clock::Real, frozen, RobotSettings::default()).await;
    let options = RunOptions { stall_within: Duration::from_secs(2), ..RunOptions::default() };
    let handle = cell.robot.run(&through(&wave(100), 20.0, 5), options).await.unwrap();
    let error = soon(handle.finished()).await.unwrap_err();
    assert!(matches!(error.cause, Cause::Stalled { .. }), "{error}");
    // The arm stands, but the client could not see that, and the report does not claim it.
    assert!(!error.stop.unwrap().unwrap().confirmed);
    assert!(!cell.handle().snapshot().moving);
}

#[tokio::test(start_paused = true)]
async fn nothing_is_sent_of_a_motion_of_an_axis_that_is_not_there() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let all_eight = |seventh: f64| AxisPosition::degrees([1.0, 0.0, 0.0, 0.0, 30.0, 0.0, seventh, 0.0]);
    let to = |seventh| {
        Motion::new().axis_move(all_eight(0.0), percent(50.0)).axis_move(all_eight(seventh), percent(50.0))
    };
    let error = cell.robot.run(&to(77.0), RunOptions::default()).await.unwrap_err();
    assert_eq!(
        error.cause.to_string(),
        "nothing was sent: step 2: J7 has to be left out: by its axisNum this robot has fewer axes"
    );
    assert_eq!(cell.lists(), []);
    // Many people write zeros for axes that do not exist.
    soon(cell.robot.run(&to(0.0), RunOptions::default()).await.unwrap().finished()).await.unwrap();
}
