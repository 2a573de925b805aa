//! Motions that are appended or repeat: they are sent at once and as a whole, and their end is reported only
//! with a proof.

use std::time::Duration;

use r6_client::units::{AxisPosition, Degrees};
use r6_client::{Cause, EndProof, Envelope, Motion, MotionHandle, Progress, RunOptions, Unmet};
use r6_controller::Profile;
use r6_sim::Clock;

use crate::cell::{Cell, percent, profile, soon, through, wave};

fn behind() -> RunOptions {
    RunOptions { append: true, ..RunOptions::default() }
}

fn to_j1(degrees: &[f64], speed: f64) -> Motion {
    let to = |degrees| AxisPosition::degrees([degrees]);
    degrees.iter().fold(Motion::new(), |motion, degrees| motion.axis_move(to(*degrees), percent(speed)))
}

/// Waits until the whole motion is in the controller's list.
async fn is_accepted(handle: &MotionHandle) -> Progress {
    let mut progress = handle.watch();
    *soon(progress.wait_for(|progress| progress.accepted == progress.total)).await.unwrap()
}

/// Starts a slow motion that continues without its handle.
async fn goes_on(cell: &Cell) {
    let handle = cell.robot.run(&to_j1(&[5.0], 1.0), RunOptions::default()).await.unwrap();
    is_accepted(&handle).await;
    handle.release().await;
}

#[tokio::test(start_paused = true)]
async fn it_goes_behind_what_runs_and_its_end_is_proved_by_the_place() {
    for profile in ["hc1", "legacy"].map(profile) {
        let name = profile.name.clone();
        let mut cell = Cell::new(profile, Clock::Real).await;
        goes_on(&cell).await;
        // Without the option to append, nothing is sent to a moving robot.
        let refused = cell.robot.run(&to_j1(&[8.0], 50.0), RunOptions::default()).await.unwrap_err();
        let Cause::NotReady(unmet) = refused.cause else { panic!("{name}: {refused}") };
        assert!(unmet.contains(&Unmet::Moving), "{name}: {unmet:?}");
        let handle = cell.robot.run(&to_j1(&[8.0], 50.0), behind()).await.unwrap();
        let done = soon(handle.finished()).await.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((done.proof, done.moved), (EndProof::Reached, true), "{name}");
        assert!((done.axes[0].unwrap() - 8.0).abs() < 0.01, "{name}: {done:?}");
        assert_eq!(cell.lists(), [(1, true), (1, false)], "{name}");
    }
}

#[tokio::test(start_paused = true)]
async fn all_of_it_leaves_at_once_or_nothing() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let motion = through(&wave(25), 20.0, 5);
    let error = cell.robot.run(&motion, behind()).await.unwrap_err();
    assert!(matches!(error.cause, Cause::Step(step) if step.field == "room"), "{error}");
    assert_eq!(cell.taken(), 0);
    let options = RunOptions { room: 25, ..behind() };
    let frames = cell.robot.dry_run(&motion, options).unwrap();
    let text: Vec<_> = frames.iter().map(|frame| String::from_utf8_lossy(frame)).collect();
    assert!(text.iter().all(|frame| frame.contains("\"emptyList\":\"0\"")), "{text:?}");
    let handle = cell.robot.run(&motion, options).await.unwrap();
    let progress = is_accepted(&handle).await;
    assert_eq!((progress.total, progress.done, progress.ended), (25, 0, false));
    assert!(cell.handle().snapshot().list_length > 20, "the arm is at its beginning");
    soon(handle.finished()).await.unwrap();
    assert_eq!(cell.lists(), [(8, false), (8, false), (8, false), (1, false)]);
    assert!(cell.error(&wave(25)[24]) < 0.01);
}

#[tokio::test(start_paused = true)]
async fn a_motion_repeats_until_it_is_stopped() {
    for profile in ["hc1", "legacy"].map(profile) {
        let name = profile.name.clone();
        let mut cell = Cell::new(profile, Clock::Real).await;
        let round = to_j1(&[3.0, 0.0], 50.0).repeat();
        let mut handle = cell.robot.run(&round, RunOptions::default()).await.unwrap();
        is_accepted(&handle).await;
        // Many rounds, and no round is the end.
        tokio::time::timeout(Duration::from_secs(20), handle.wait()).await.unwrap_err();
        assert_eq!(cell.handle().snapshot().list_length, 2, "{name}");
        let mut least_and_most = (f64::INFINITY, f64::NEG_INFINITY);
        for _ in 0..100 {
            tokio::time::sleep(Duration::from_millis(30)).await;
            let j1 = cell.handle().snapshot().axes[0];
            least_and_most = (least_and_most.0.min(j1), least_and_most.1.max(j1));
        }
        assert!(least_and_most.0 < 1.0 && least_and_most.1 > 2.0, "{name}: {least_and_most:?}");
        assert_eq!((handle.progress().done, handle.progress().ended), (0, false), "{name}");
        let report = handle.stop().await.unwrap();
        assert!(report.confirmed, "{name}: {report}");
        let snapshot = cell.handle().snapshot();
        assert_eq!((snapshot.moving, snapshot.list_length), (false, 0), "{name}");
        assert_eq!(cell.lists()[0], (2, true), "{name}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_guard_holds_the_way_back_to_the_beginning_and_knows_no_start_behind_others() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let guarded = cell.robot.with_guard(Envelope::new().largest_axis_step(Degrees(5.0)));
    let away = to_j1(&[4.0, 8.0, 12.0], 50.0);
    let error = guarded.run(&away.repeat(), RunOptions::default()).await.unwrap_err();
    let Cause::OutsideEnvelope(violation) = error.cause else { panic!("{error}") };
    assert_eq!(violation.step, 1, "it goes from 12 to 4 degrees: {violation}");
    assert_eq!(cell.taken(), 0);
    goes_on(&cell).await;
    // The end of the other client's list is not known.
    let error = guarded.run(&to_j1(&[5.0], 50.0), behind()).await.unwrap_err();
    assert!(matches!(error.cause, Cause::OutsideEnvelope(_)), "{error}");
    assert_eq!(cell.taken(), 1);
}

#[test]
fn a_frame_begins_where_it_was_said() {
    let one = to_j1(&[1.0], 50.0);
    let motion = Motion::new().begin_frame().extend(&one).begin_frame().extend(&one).extend(&one);
    let lists = motion.lists(&r6_client::RobotSettings::default(), behind()).unwrap();
    assert_eq!(lists, [0..1, 1..3]);
}
