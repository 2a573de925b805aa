//! A guarded handle never sends what goes beyond the envelope.

use std::time::Duration;

use r6_client::units::{AxisPosition, Degrees, Millimetres, MillimetresPerSecond, Pose};
use r6_client::{
    AxisIndex, Cause, Checked, Conditions, Envelope, Invalid, Motion, NotSent, RequestError, RunOptions,
    Violation,
};
use r6_controller::Profile;
use r6_proto::message::instruction::{Action, Instruction};
use r6_sim::Clock;

use crate::cell::{Cell, percent, soon, through, wave};

pub const J1: AxisIndex = AxisIndex::ALL[0];
pub const J6: AxisIndex = AxisIndex::ALL[5];

pub fn place(x: f64, y: f64, z: f64) -> Pose {
    Pose::position([x, y, z].map(Millimetres))
}

pub fn axes(first: f64) -> AxisPosition {
    AxisPosition::degrees([first, 0.0, 0.0, 0.0, 30.0, 0.0])
}

/// The step and value that a check of this motion rejects.
pub fn found(envelope: &Envelope, motion: &Motion) -> Option<(usize, Checked)> {
    motion.instructions().unwrap();
    envelope.check_motion(motion).err().map(|violation| (violation.step, violation.what))
}

#[test]
fn speeds_are_capped() {
    let envelope =
        Envelope::new().speed_cap(percent(20.0)).path_speed_cap(MillimetresPerSecond::new(250).unwrap());
    let path = |speed| {
        Motion::new()
            .path_speed(MillimetresPerSecond::new(speed).unwrap())
            .linear_move_at_path_speed(place(1.0, 1.0, 1.0))
    };
    assert_eq!(found(&envelope, &Motion::new().axis_move(axes(1.0), percent(20.0))), None);
    assert_eq!(
        found(&envelope, &Motion::new().axis_move(axes(1.0), percent(20.1))),
        Some((1, Checked::Speed))
    );
    assert_eq!(found(&envelope, &path(250)), None);
    assert_eq!(found(&envelope, &path(251)), Some((1, Checked::PathSpeed)));
    let without_path_speed = Envelope::new().speed_cap(percent(20.0));
    assert_eq!(found(&without_path_speed, &path(1)), Some((2, Checked::Speed)));
}

/// An earlier list may have set any path speed, and the controller keeps it.
#[test]
fn a_path_speed_that_the_list_does_not_set_is_beyond_the_limit() {
    let envelope = Envelope::new().path_speed_cap(MillimetresPerSecond::new(50).unwrap());
    let set = Motion::new().path_speed(MillimetresPerSecond::new(50).unwrap());
    let whole = set.linear_move_at_path_speed(place(1.0, 1.0, 1.0));
    let [first, second] = <[_; 2]>::try_from(whole.instructions().unwrap().to_vec()).unwrap();
    assert_eq!(found(&envelope, &whole), None);
    assert_eq!(found(&envelope, &Motion::of_list([second])), Some((1, Checked::PathSpeed)));
    let Action::PathSpeed(mut speed) = first.action else { panic!("{first:?}") };
    speed.speed = None;
    let untold = Instruction { action: Action::PathSpeed(speed), ..first };
    assert_eq!(found(&envelope, &Motion::of_list([untold, second])), Some((1, Checked::PathSpeed)));
    speed.in_use = false;
    let off = Instruction { action: Action::PathSpeed(speed), ..first };
    assert_eq!(found(&envelope, &Motion::of_list([first, off, second])), Some((3, Checked::PathSpeed)));
    let told = envelope.check_motion(&Motion::of_list([second])).unwrap_err().to_string();
    assert!(told.contains("this list does not set it, and 50 mm/s is the most"), "{told}");
}

#[test]
fn axes_stay_within_their_limits_and_a_mask_counts() {
    let envelope = Envelope::new().axis_limits(J6, Degrees(-90.0), Degrees(90.0)).axis_limits(
        AxisIndex::ALL[6],
        Millimetres(0.0),
        Millimetres(500.0),
    );
    let turn = |angle| Motion::new().axis_move(AxisPosition::none().with(J6, Degrees(angle)), percent(1.0));
    assert_eq!(found(&envelope, &turn(90.0)), None);
    assert_eq!(found(&envelope, &turn(90.5)), Some((1, Checked::Axis(J6, false))));
    let rail = AxisPosition::degrees([1.0]).with(AxisIndex::ALL[6], Millimetres(501.0));
    let beyond = envelope.check_motion(&Motion::new().axis_move(rail, percent(1.0))).unwrap_err();
    assert_eq!(beyond.to_string(), "step 1: J7 goes to 501 mm, outside of 0 to 500 mm");
}

#[test]
fn limits_that_are_the_wrong_way_round_are_told_and_let_nothing_pass() {
    let still = Motion::new().wait(std::time::Duration::from_secs(1));
    let swapped = Envelope::new().axis_limits(J1, Degrees(30.0), Degrees(-30.0));
    let beyond = swapped.check_motion(&still).unwrap_err();
    assert_eq!(
        beyond.to_string(),
        "the limits of J1 are 30 to -30 deg: the lowest has to come first, and nothing is within them as they are"
    );
    let box_of = |low: f64, high: f64| {
        Envelope::new().workspace([low; 3].map(Millimetres), [high; 3].map(Millimetres))
    };
    assert!(box_of(0.0, 0.0).check_motion(&still).is_ok());
    for wrong in [
        box_of(1.0, 0.0),
        Envelope::new().axis_limits(J1, Degrees(f64::NAN), Degrees(1.0)),
        Envelope::new().and(swapped),
    ] {
        assert_eq!(wrong.check_motion(&still).unwrap_err().step, 0, "{wrong:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_guard_on_a_guarded_handle_loosens_nothing() {
    let cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let narrow = cell.robot.with_guard(Envelope::new().axis_limits(J1, Degrees(-30.0), Degrees(30.0)));
    let both = narrow
        .with_guard(Envelope::new().axis_limits(J1, Degrees(-90.0), Degrees(90.0)).speed_cap(percent(20.0)));
    let to = |degrees: f64, speed: f64| Motion::new().axis_move(axes(degrees), percent(speed));
    for (motion, what) in [(to(40.0, 10.0), Checked::Axis(J1, false)), (to(10.0, 50.0), Checked::Speed)] {
        let error = both.run(&motion, RunOptions::default()).await.unwrap_err();
        let Cause::OutsideEnvelope(violation) = error.cause else { panic!("{error}") };
        assert_eq!(violation.what, what);
        assert!(both.dry_run(&motion, RunOptions::default()).is_err());
    }
    assert!(both.dry_run(&to(10.0, 10.0), RunOptions::default()).is_ok());
    assert!(narrow.dry_run(&to(10.0, 50.0), RunOptions::default()).is_ok(), "the handle before is as it was");
}

#[test]
fn the_tool_stays_in_its_workspace_on_curves_too() {
    let corner = |by: f64| [by, by, by].map(Millimetres);
    let envelope = Envelope::new().workspace(corner(-100.0), corner(100.0));
    let line = |x| Motion::new().linear_move(place(x, 0.0, 0.0), percent(1.0));
    assert_eq!(found(&envelope, &line(100.0)), None);
    assert_eq!(found(&envelope, &line(101.0)), Some((1, Checked::Place(J1))));
    // All three points are inside, but the arc between them is not.
    let arc = |across: f64| {
        line(across).curve_move(place(0.0, across, 0.0), place(-across, 0.0, 0.0), percent(1.0))
    };
    assert_eq!(found(&envelope, &arc(99.0)), None);
    let bulge = line(90.0).curve_move(place(90.0, 80.0, 0.0), place(0.0, 90.0, 0.0), percent(1.0));
    assert_eq!(found(&envelope, &bulge), Some((2, Checked::Place(J1))));
    // In another work frame the same numbers mean another position.
    assert_eq!(found(&envelope, &line(1.0).work_frame(2)), Some((1, Checked::Frame)));
    let bench = Motion::new().workbench(2).linear_move(place(0.0, 0.0, 0.0), percent(1.0));
    assert_eq!(found(&envelope, &bench), Some((2, Checked::Frame)));
}

#[test]
fn steps_from_target_to_target_are_measured() {
    let envelope = Envelope::new().largest_axis_step(Degrees(10.0)).largest_distance(Millimetres(50.0));
    let motion = Motion::new().axis_move(axes(40.0), percent(1.0));
    assert_eq!(found(&envelope, &motion.clone().axis_move(axes(50.0), percent(1.0))), None);
    assert_eq!(
        found(&envelope, &motion.clone().axis_move(axes(50.1), percent(1.0))),
        Some((2, Checked::AxisStep(J1, false)))
    );
    // The client does not know the axis positions of a pose.
    let mixed = motion.linear_move(place(1.0, 1.0, 1.0), percent(1.0));
    assert_eq!(found(&envelope, &mixed), Some((2, Checked::Distance)));
    let lines = Motion::new()
        .linear_move(place(0.0, 0.0, 0.0), percent(1.0))
        .linear_move(place(30.0, 40.0, 0.0), percent(1.0));
    assert_eq!(found(&envelope, &lines), None);
    let beyond = lines.linear_move(place(30.0, 40.0, 51.0), percent(1.0));
    assert_eq!(found(&envelope, &beyond), Some((3, Checked::Distance)));
}

#[test]
fn only_what_is_allowed_passes() {
    let envelope = Envelope::new().only([10, 100]);
    let line = Motion::new().linear_move(place(1.0, 1.0, 1.0), percent(100.0));
    assert_eq!(found(&envelope, &line), None);
    assert_eq!(found(&envelope, &line.axis_move(axes(0.0), percent(1.0))), Some((2, Checked::Action(4))));
}

#[tokio::test(start_paused = true)]
async fn all_motion_of_a_guarded_handle_is_checked_raw_lists_too() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let guarded = cell.robot.with_guard(Envelope::new().speed_cap(percent(20.0)).axis_limits(
        J1,
        Degrees(-90.0),
        Degrees(90.0),
    ));
    let beyond = Motion::new().axis_move(axes(10.0), percent(20.0)).axis_move(axes(91.0), percent(20.0));
    let violation =
        Violation { step: 2, what: Checked::Axis(J1, false), value: Some(91.0), limit: (-90.0, 90.0) };
    for robot in [guarded.clone(), guarded.clone().clone()] {
        let error = robot.run(&beyond, RunOptions::default()).await.unwrap_err();
        assert_eq!(error.cause, Cause::OutsideEnvelope(violation));
        assert_eq!(robot.dry_run(&beyond, RunOptions::default()).unwrap_err(), error.cause);
        let raw = robot.add_rcc(true, beyond.instructions().unwrap().to_vec()).await.unwrap_err();
        assert_eq!(raw, RequestError::Invalid(Invalid::OutsideEnvelope(violation)));
        assert!(raw.to_string().contains("step 2: J1 goes to 91 deg"), "{raw}");
    }
    assert_eq!(cell.taken(), 0, "nothing was sent");
    let within = Motion::new().axis_move(axes(10.0), percent(20.0));
    soon(guarded.run(&within, RunOptions::default()).await.unwrap().finished()).await.unwrap();
    guarded.clear_list().await.unwrap();
    assert!(cell.error(&[10.0, 0.0, 0.0, 0.0, 30.0, 0.0]) < 0.01);
    // The handle without a guard still sends the list.
    cell.robot.add_rcc(true, beyond.instructions().unwrap().to_vec()).await.unwrap();
}

#[tokio::test(start_paused = true)]
async fn the_step_from_the_present_position_counts() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let guarded = cell.robot.with_guard(Envelope::new().largest_axis_step(Degrees(45.0)));
    let far = Motion::new().axis_move(AxisPosition::degrees([46.0]), percent(20.0));
    assert_eq!(guarded.guard().unwrap().check_motion(&far), Ok(()), "by itself it may begin anywhere");
    let error = guarded.run(&far, RunOptions::default()).await.unwrap_err();
    let Cause::OutsideEnvelope(violation) = error.cause else { panic!("{error}") };
    assert_eq!((violation.step, violation.what), (1, Checked::AxisStep(J1, false)));
    let steps = far.instructions().unwrap().to_vec();
    assert!(guarded.add_rcc(true, steps.clone()).await.is_err());
    // Where an appended list begins is not known while another list runs.
    let near = Motion::new().axis_move(AxisPosition::degrees([40.0]), percent(1.0));
    let near = near.instructions().unwrap().to_vec();
    guarded.add_rcc(true, near.clone()).await.unwrap();
    let error = guarded.add_rcc(false, near).await.unwrap_err();
    assert!(error.to_string().contains("cannot be told"), "{error}");
    assert_eq!(cell.taken(), 1);
}

#[tokio::test(start_paused = true)]
async fn a_long_path_within_the_envelope_is_streamed() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let envelope = Envelope::new().speed_cap(percent(20.0)).largest_axis_step(Degrees(1.0));
    let handle =
        cell.robot.with_guard(envelope).run(&through(&wave(100), 20.0, 5), RunOptions::default()).await;
    let error = handle.unwrap_err();
    assert!(matches!(error.cause, Cause::OutsideEnvelope(_)), "{error}");
    let envelope = Envelope::new().speed_cap(percent(20.0)).largest_axis_step(Degrees(2.1));
    let handle =
        cell.robot.with_guard(envelope).run(&through(&wave(100), 20.0, 5), RunOptions::default()).await;
    soon(handle.unwrap().finished()).await.unwrap();
    assert_eq!(cell.taken(), 100);
}

#[test]
fn an_envelope_that_is_laid_over_itself_again_and_again_stays_one() {
    let narrow = Envelope::new().axis_limits(J1, Degrees(-30.0), Degrees(30.0));
    let slow = Envelope::new().speed_cap(percent(20.0));
    let both = narrow.clone().and(slow.clone());
    let again = (0..100_000).fold(both.clone(), |envelope, _| envelope.and(slow.clone()).and(narrow.clone()));
    assert_eq!(again, both);
    let fast = Motion::new().axis_move(AxisPosition::degrees([10.0]), percent(21.0));
    let far = Motion::new().axis_move(AxisPosition::degrees([31.0]), percent(20.0));
    assert!(both.check_motion(&fast).is_err() && both.check_motion(&far).is_err());
}

/// A guard that needs the place of the arm reads it over the connection that the list may leave on.
#[tokio::test(start_paused = true)]
async fn a_guarded_list_leaves_under_conditions_that_hold_and_under_no_others() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let guarded = cell.robot.with_guard(Envelope::new().largest_axis_step(Degrees(45.0)));
    guarded.status().await.unwrap();
    tokio::time::sleep(Duration::from_secs(5)).await;
    let to = |first| Motion::new().axis_move(axes(first), percent(50.0)).instructions().unwrap().to_vec();
    let here = Some(guarded.connection());
    let holds = Conditions { leave_within: Some(Duration::from_secs(1)), only_on: here, permission: None };
    let elsewhere = Conditions { only_on: here.map(|here| here + 1), ..holds.clone() };
    let error = guarded.add_rcc_under(elsewhere, false, to(30.0)).await.unwrap_err();
    assert_eq!(error, NotSent::Disconnected.into());
    let error = guarded.add_rcc_under(holds.clone(), false, to(90.0)).await.unwrap_err();
    assert!(matches!(error, RequestError::Invalid(Invalid::OutsideEnvelope(_))), "{error}");
    assert_eq!(cell.lists(), []);
    // Appended to an empty list it begins where the arm stands.
    guarded.add_rcc_under(holds.clone(), false, to(30.0)).await.unwrap();
    assert_eq!(cell.lists(), [(1, false)]);
    // Behind another step its beginning is not known.
    let error = guarded.add_rcc_under(holds, false, to(40.0)).await.unwrap_err();
    assert!(matches!(error, RequestError::Invalid(Invalid::OutsideEnvelope(_))), "{error}");
}

#[tokio::test(start_paused = true)]
async fn an_appended_motion_begins_where_the_arm_stands_only_if_nothing_is_in_the_list() {
    let cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let guarded = cell.robot.with_guard(Envelope::new().largest_axis_step(Degrees(45.0)));
    let appended = RunOptions { append: true, ..RunOptions::default() };
    let to = |first, speed| Motion::new().axis_move(axes(first), percent(speed));
    soon(guarded.run(&to(30.0, 50.0), appended).await.unwrap().finished()).await.unwrap();
    cell.robot.add_motion(true, &to(-30.0, 1.0)).await.unwrap();
    let error = guarded.run(&to(20.0, 50.0), appended).await.unwrap_err();
    assert!(matches!(error.cause, Cause::OutsideEnvelope(_)), "{error}");
}
