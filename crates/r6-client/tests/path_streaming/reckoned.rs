//! What a guard takes into account besides the list: inputs that stop it, units, earlier frame changes, and
//! lists of other clients.

use std::time::Duration;

use r6_client::units::{AxisCoordinate, AxisPosition, Degrees, Millimetres};
use r6_client::{
    AxisIndex, Cause, Checked, Command, Envelope, FollowOptions, Invalid, Motion, RequestError, RunOptions,
};
use r6_controller::Profile;
use r6_proto::message::instruction::StopOnSignal;
use r6_proto::message::{Action, Instruction};
use r6_sim::Clock;

use crate::cell::{Cell, percent, soon};
use crate::guarded::{J1, J6, axes, found, place};

const TENTH: Duration = Duration::from_millis(100);

/// If an input stops the motion, each move may end anywhere on its path. So the start of the next move is not
/// known.
#[test]
fn after_an_input_may_have_stopped_the_motion_no_place_is_known() {
    let envelope = Envelope::new().largest_axis_step(Degrees(30.0)).largest_distance(Millimetres(50.0));
    let to = |motion: Motion, angle| motion.axis_move(axes(angle), percent(1.0));
    let watched = to(to(Motion::new(), 0.0).stop_on_input("X013".parse().unwrap(), true), 25.0);
    assert_eq!(found(&envelope, &watched), None, "where the watch begins is known");
    assert_eq!(found(&envelope, &to(watched.clone(), 50.0)), Some((4, Checked::AxisStep(J1, false))));
    let line = |motion: Motion, x| motion.linear_move(place(x, 0.0, 0.0), percent(1.0));
    let lines = line(line(Motion::new(), 0.0).stop_on_input("X013".parse().unwrap(), true), 40.0);
    assert_eq!(found(&envelope, &lines), None);
    assert_eq!(found(&envelope, &line(lines, 0.0)), Some((4, Checked::Distance)));
    // The start of a curve is then unknown too.
    let corner = |by: f64| [by, by, by].map(Millimetres);
    let walled = Envelope::new().workspace(corner(-100.0), corner(100.0));
    let arc = |motion: Motion| motion.curve_move(place(5.0, 5.0, 0.0), place(0.0, 10.0, 0.0), percent(1.0));
    let cut = line(line(Motion::new(), 0.0).stop_on_input("X013".parse().unwrap(), true), 10.0);
    assert_eq!(found(&walled, &arc(cut)), Some((4, Checked::Arc)));
    assert_eq!(found(&walled, &arc(line(line(Motion::new(), 0.0), 10.0))), None);
    // Once no input is watched, the next move that is measured from a known position has a known end again.
    let off = Instruction {
        oneshot: true,
        action: Action::StopOnSignal(StopOnSignal { in_use: false, input: 3, on: true }),
    };
    let limits = Envelope::new().axis_limits(J1, Degrees(-90.0), Degrees(90.0));
    assert_eq!(found(&limits, &to(watched.clone(), 50.0)), None, "limits need no beginning");
    assert_eq!(
        found(&envelope, &to(watched.instruction(off), 30.0)),
        Some((5, Checked::AxisStep(J1, false))),
        "the move before may have been cut short"
    );
}

/// Degrees cannot be compared with millimetres. An axis that the envelope does not declare as sliding counts
/// as turning.
#[test]
fn millimetres_for_an_axis_that_turns_go_beyond() {
    let j7 = AxisIndex::ALL[6];
    let to =
        |axis, to: AxisCoordinate| Motion::new().axis_move(AxisPosition::none().with(axis, to), percent(1.0));
    let (deg, mm) = (AxisCoordinate::from(Degrees(10.0)), AxisCoordinate::from(Millimetres(10.0)));
    let limits = Envelope::new().axis_limits(J1, Degrees(-90.0), Degrees(90.0)).axis_limits(
        j7,
        Millimetres(0.0),
        Millimetres(500.0),
    );
    assert_eq!(found(&limits, &to(J1, deg)), None);
    assert_eq!(found(&limits, &to(j7, mm)), None);
    assert_eq!(found(&limits, &to(J1, mm)), Some((1, Checked::Unit(J1, false))));
    assert_eq!(found(&limits, &to(j7, deg)), Some((1, Checked::Unit(j7, true))));
    let told = limits.check_motion(&to(J1, mm)).unwrap_err().to_string();
    assert_eq!(told, "step 1: J1 is told in mm, but turns: give it limits in mm if it slides");
    for largest in [
        Envelope::new().largest_axis_step(Degrees(45.0)),
        Envelope::new().largest_distance(Millimetres(100.0)),
    ] {
        assert_eq!(found(&largest, &to(J6, mm)), Some((1, Checked::Unit(J6, false))));
    }
    assert_eq!(found(&Envelope::new().speed_cap(percent(5.0)), &to(J6, mm)), None, "nothing compares");
    let mixed = Envelope::new().axis_limits(J1, deg, mm);
    let told = mixed.check_motion(&to(J6, deg)).unwrap_err();
    assert_eq!((told.step, told.what), (0, Checked::Unit(J1, false)));
}

#[tokio::test(start_paused = true)]
async fn millimetres_for_an_axis_that_turns_are_not_sent() {
    let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let guarded = cell.robot.with_guard(Envelope::new().axis_limits(J1, Degrees(-90.0), Degrees(90.0)));
    let target = AxisPosition::none().with(J1, Millimetres(5.0));
    let error = guarded.run(&Motion::new().axis_move(target, percent(5.0)), RunOptions::default()).await;
    assert!(
        matches!(error.unwrap_err().cause, Cause::OutsideEnvelope(v) if v.what == Checked::Unit(J1, false))
    );
    let slides = Motion::new().extend(&Motion::new().axis_move(target, percent(5.0)));
    let error = guarded.add_motion(true, &slides).await.unwrap_err();
    let RequestError::Invalid(Invalid::OutsideEnvelope(violation)) = error else { panic!("{error}") };
    assert_eq!(violation.what, Checked::Unit(J1, false));
    let wrong = Motion::new().axis_move(AxisPosition::none(), percent(5.0));
    let error = guarded.add_motion(true, &wrong).await.unwrap_err();
    assert!(matches!(error, RequestError::Invalid(Invalid::Step(_))) && !error.may_send_again(), "{error}");
    let (sender, targets) = r6_client::TargetSender::new();
    sender.send(target);
    let error = soon(guarded.follow(targets, FollowOptions::default())).await.unwrap_err();
    assert!(matches!(error.cause, Cause::OutsideEnvelope(v) if v.what == Checked::Unit(J1, false)));
    assert_eq!(cell.taken(), 0);
}

/// The limits refer to the frame that was in use when the guard was made.
#[tokio::test(start_paused = true)]
async fn a_frame_that_was_told_before_counts_for_later_lists() {
    let corner = |by: f64| [by, by, by].map(Millimetres);
    let envelope = || Envelope::new().workspace(corner(-2000.0), corner(2000.0));
    let pose = place(400.0, 0.0, 500.0);
    let line = Motion::new().linear_move(pose, percent(1.0));
    let raw = |motion: &Motion| motion.instructions().unwrap().to_vec();
    for told in 0..5 {
        let cell = Cell::new(Profile::hc1(), Clock::Real).await;
        let guarded = cell.robot.with_guard(envelope());
        let narrower = guarded.clone();
        match told {
            0 => drop(cell.robot.command(Command::SwitchTool { tool: 1 }).await.unwrap()),
            1 => drop(cell.robot.command(Command::SwitchCoordinate { workbench: 1 }).await.unwrap()),
            2 => drop(cell.robot.add_rcc(true, raw(&Motion::new().workbench(1))).await.unwrap()),
            3 => drop(cell.robot.add_rcc(true, raw(&line.clone().work_frame(1))).await.unwrap()),
            _ => {
                let bench = Motion::new().workbench(1).wait(TENTH);
                let handle = cell.robot.run(&bench, RunOptions::default()).await.unwrap();
                soon(handle.finished()).await.unwrap();
            }
        }
        cell.robot.stop().await.unwrap();
        for robot in [&guarded, &narrower, &guarded.with_guard(envelope())] {
            let error = robot.add_rcc(true, raw(&line)).await.unwrap_err();
            let RequestError::Invalid(Invalid::OutsideEnvelope(violation)) = error else { panic!("{error}") };
            assert_eq!(violation.what, Checked::FrameUnknown, "{told}");
            assert!(violation.to_string().contains("make a guard"), "{violation}");
        }
        // Axis moves mean the same in every frame. A guard that is made now has the frame in use.
        let axis_move = Motion::new().axis_move(axes(1.0), percent(1.0));
        guarded.guard().unwrap().check_motion(&line).unwrap();
        cell.robot.with_guard(envelope()).dry_run(&line, RunOptions::default()).unwrap();
        guarded.dry_run(&axis_move, RunOptions::default()).unwrap();
    }
}

/// It is not known whether watching an input ends with its list. So later lists take it into account.
#[tokio::test(start_paused = true)]
async fn a_watched_input_counts_for_later_lists() {
    let cell = Cell::new(Profile::hc1(), Clock::Real).await;
    let guarded = cell.robot.with_guard(Envelope::new().largest_axis_step(Degrees(45.0)));
    let two = Motion::new().axis_move(axes(1.0), percent(50.0)).axis_move(axes(2.0), percent(50.0));
    let raw = |motion: &Motion| motion.instructions().unwrap().to_vec();
    cell.robot.add_rcc(true, raw(&Motion::new().stop_on_input("X013".parse().unwrap(), true))).await.unwrap();
    soon(cell.robot.wait_until_done(Default::default())).await.unwrap();
    let error = guarded.add_rcc(true, raw(&two)).await.unwrap_err();
    assert!(error.to_string().contains("step 2") && error.to_string().contains("cannot be told"), "{error}");
    let off = StopOnSignal { in_use: false, input: 3, on: true };
    let off = Instruction { oneshot: true, action: Action::StopOnSignal(off) };
    cell.robot.add_rcc(true, vec![off]).await.unwrap();
    soon(cell.robot.wait_until_done(Default::default())).await.unwrap();
    guarded.add_rcc(true, raw(&two)).await.unwrap();
}

/// Two callers check and send at the same time. The second list would begin where the first ends.
#[tokio::test(start_paused = true)]
async fn a_list_is_checked_against_the_place_where_it_begins() {
    let to = |angle| Motion::new().axis_move(axes(angle), percent(100.0));
    let raw = |motion: &Motion| motion.instructions().unwrap().to_vec();
    for second in 0..3 {
        let mut cell = Cell::new(Profile::hc1(), Clock::Real).await;
        let guarded = cell.robot.with_guard(Envelope::new().largest_axis_step(Degrees(30.0)));
        let first = async {
            guarded.add_rcc(true, raw(&to(25.0))).await.map(drop).map_err(|error| error.to_string())
        };
        let other = async {
            let motion = to(-25.0);
            match second {
                0 => guarded.add_rcc(true, raw(&motion)).await.map(drop).map_err(|error| error.to_string()),
                1 => guarded.add_rcc(false, raw(&motion)).await.map(drop).map_err(|error| error.to_string()),
                _ => match guarded.run(&motion, RunOptions::default()).await {
                    Ok(handle) => soon(handle.finished()).await.map(drop).map_err(|error| error.to_string()),
                    Err(error) => Err(error.to_string()),
                },
            }
        };
        let (first, other) = tokio::join!(first, other);
        assert_eq!(first, Ok(()), "{second}");
        let error = other.expect_err("it would begin elsewhere");
        assert!(error.contains("nothing was sent"), "{second}: {error}");
        assert_eq!(cell.taken(), 1, "{second}: {error}");
    }
}
