use proptest::prelude::*;

use super::super::tests::{
    any_move, conditions, end_of, line_by, percent, plan, takes_over, to_axes, tool_down,
};
use super::*;
use crate::kinematics::tests::{model, possible};
use crate::speed_profile::Ramps;
use crate::{AxisNumber, Blend, LimitSide, MoveTarget};

/// A ramp of 0.25 s and the filter.
const CHANGE: f64 = 0.378;

fn j1(degrees: f64) -> Move {
    percent(to_axes([degrees, 0.0, 0.0, 0.0, 0.0, 0.0]), 50.0)
}

fn at_j1(degrees: f64) -> Axes {
    Axes::of_arm([degrees, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap()
}

fn over(old: &Movement, at: f64, order: &Move) -> Movement {
    old.take_over(at, order, &conditions(1.0)).unwrap().unwrap()
}

#[test]
fn the_same_way_on_keeps_its_speed() {
    let old = plan(&Axes::ZERO, &j1(90.0), 1.0);
    let next = over(&old, 0.5, &j1(120.0));
    for look in 0..=100 {
        let t = CHANGE * f64::from(look) / 100.0;
        let speed = next.state_at(t).axis_speeds[0];
        assert!((speed - 110.4).abs() < 1e-9, "{t}: {speed}");
    }
    let straight_there = plan(&Axes::ZERO, &j1(120.0), 1.0);
    assert!((next.duration() - (straight_there.duration() - 0.5)).abs() < 1e-9);
    assert_eq!(end_of(&next).arm(), [120.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
}

#[test]
fn turning_round_takes_one_change_of_speed() {
    let old = plan(&Axes::ZERO, &j1(90.0), 1.0);
    let next = over(&old, 0.5, &j1(0.0));
    let speed = |t| next.state_at(t).axis_speeds[0];
    assert!((speed(CHANGE) + 110.4).abs() < 1e-9);
    assert!(speed(CHANGE / 2.0).abs() < 1e-6, "an even change passes rest half-way");
}

/// A line after a turn of J1: once J1 rests, the tool is on the line that begins where J1 came to rest.
#[test]
fn the_tool_is_on_the_new_line_once_the_old_move_rests() {
    let mut turned = tool_down().arm();
    turned[0] = 40.0;
    let old = plan(&tool_down(), &percent(to_axes(turned), 20.0), 1.0);
    let next = over(&old, 0.5, &percent(line_by(30.0, -20.0, 40.0), 20.0));
    let place = |state: crate::MotionState| [state.pose.x, state.pose.y, state.pose.z];
    let way = |from: [f64; 3], to: [f64; 3]| [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let rest = {
        let tail = next.tail.as_ref().unwrap().rest;
        place(plan(&tail, &percent(to_axes(tail.arm()), 1.0), 1.0).state_at(1.0))
    };
    let along = way(rest, place(next.state_at(f64::INFINITY)));
    let mut t = CHANGE;
    while t < next.duration() {
        let gone = way(rest, place(next.state_at(t)));
        let part = dot(gone, along) / dot(along, along).sqrt();
        let off = (dot(gone, gone) - part * part).max(0.0).sqrt();
        assert!(off < 0.01, "{off} mm off the line at {t} s");
        t += 0.01;
    }
    let off_before = way(rest, place(next.state_at(0.0)));
    assert!(dot(off_before, off_before).sqrt() > 1.0, "the old move had some way to go");
}

#[test]
fn what_took_over_can_be_blended_halted_and_resumed() {
    let old = plan(&Axes::ZERO, &j1(90.0), 1.0);
    let next = over(&old, 0.5, &j1(120.0));
    let corner = next.corner(Blend::MOST).unwrap();
    assert!(corner >= CHANGE);
    let joined = next.join(corner, &j1(0.0), &conditions(1.0), Blend::MOST).unwrap();
    assert!(end_of(&joined).arm()[0].abs() < 1e-12);
    let halted = next.halt(0.1, 0.2);
    takes_over(&next, &halted, 0.1).unwrap();
    assert!(halted.take_over(0.1, &j1(0.0), &conditions(1.0)).unwrap().is_none(), "it is being stopped");
    assert_eq!(end_of(&halted.resume(0.2, 1.0).unwrap()), end_of(&next));
}

#[test]
fn a_target_where_the_arm_comes_to_rest_is_met() {
    let old = plan(&Axes::ZERO, &j1(90.0), 1.0);
    let rest = over(&old, 0.5, &j1(0.0)).tail.unwrap().rest;
    let next = over(&old, 0.5, &percent(MoveTarget::Axes(rest), 50.0));
    assert!((next.duration() - CHANGE).abs() < 1e-9);
    assert!(!next.state_at(CHANGE / 2.0).done);
    assert_eq!(end_of(&next), rest);
}

#[test]
fn so_near_a_limit_that_nothing_is_certain_the_arm_has_to_stop_first() {
    let up = plan(&at_j1(140.0), &percent(to_axes(at_j1(154.999).arm()), 100.0), 1.0);
    assert!(up.take_over(0.3, &j1(0.0), &conditions(1.0)).unwrap().is_none());
    let down = plan(&at_j1(154.9), &j1(0.0), 1.0);
    assert!(down.take_over(0.8, &j1(150.0), &conditions(1.0)).unwrap().is_some());
    let outside = down.take_over(0.8, &j1(156.0), &conditions(1.0)).unwrap_err();
    assert_eq!(outside, PlanError::OutsideLimits { axis: AxisNumber::ARM[0], side: LimitSide::Plus });
}

#[test]
fn a_target_that_changes_without_end_leaves_a_bounded_trail() {
    let mut movement = plan(&Axes::ZERO, &j1(90.0), 1.0);
    let mut taken = 0;
    while let Some(next) = movement.take_over(0.001, &j1(f64::from(taken)), &conditions(1.0)).unwrap() {
        movement = next;
        taken += 1;
        assert!(taken < 100);
    }
    assert_eq!(usize::try_from(taken), Ok(MAX_TAILS), "each a millisecond after the last");
    let mut movement = plan(&Axes::ZERO, &j1(90.0), 1.0);
    for n in 0..200 {
        let next = over(&movement, 0.05, &j1(f64::from(n % 40)));
        takes_over(&movement, &next, 0.05).unwrap();
        movement = next;
    }
    assert!(movement.tail.as_ref().unwrap().count() <= 24, "20 targets a second");
}

proptest! {
    #[test]
    fn taking_over_has_no_jumps_and_keeps_the_limits(
        (start, order) in any_move(), (_, next) in any_move(), (_, third) in any_move(),
        global in 0.05..1.0, ramp in 0.1..1.0, part in 0.0..1.0, again in 0.0..0.6,
        parts in prop::collection::vec(0.0..1.0, 20),
    ) {
        let settings = Conditions { ramps: Ramps::new(ramp, ramp).unwrap(), ..conditions(global) };
        let old = possible(Movement::plan(model(), &start, &order, &settings))?;
        let at = part * old.duration();
        let Some(second) = possible(old.take_over(at, &next, &settings))? else { return Ok(()) };
        takes_over(&old, &second, at)?;
        let Some(last) = possible(second.take_over(again, &third, &settings))? else { return Ok(()) };
        takes_over(&second, &last, again)?;
        let h = 1e-5;
        for (movement, part) in [&second, &last].into_iter().flat_map(|one| parts.iter().map(move |part| (one, part))) {
            // Not before its beginning, because the arm already moves there.
            let t = h + part * (movement.duration() - h);
            let [before, here, after] = [t - h, t, t + h].map(|t| movement.state_at(t));
            for (n, axis) in model().axes.iter().enumerate() {
                let speed = here.axis_speeds[n];
                prop_assert!(speed.abs() <= axis.max_speed * (1.0 + 1e-9), "J{}: {speed}", n + 1);
                let degrees = here.axes.arm()[n];
                prop_assert!(axis.soft.min - 1e-5 <= degrees && degrees <= axis.soft.max + 1e-5);
                // Twice full acceleration where two changes meet, and the same again for the bend of the
                // path.
                let slack = 80.0 / ramp.min(0.25) * axis.max_speed * h;
                for (a, b) in [(&before, &here), (&here, &after)] {
                    let step = (b.axes.arm()[n] - a.axes.arm()[n]) / h;
                    prop_assert!((step - speed).abs() < slack + 1e-4, "J{}: {step} {speed}", n + 1);
                }
            }
        }
        prop_assert!(last.state_at(last.duration()).done);
        if let MoveTarget::Axes(target) = third.target {
            prop_assert_eq!(end_of(&last), target);
        }
    }
}
