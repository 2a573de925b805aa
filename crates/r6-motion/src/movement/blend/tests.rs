use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use super::super::tests::{
    any_move, conditions, end_of, line_by, percent, plan, takes_over, to_axes, tool_down,
};
use super::*;
use crate::axes::Axes;
use crate::kinematics::forward;
use crate::kinematics::tests::{arm_in_limits, model, possible};
use crate::movement::MoveTarget;
use crate::pose::{Frame, Pose};
use crate::speed_profile::{Ramps, SmoothStep};

/// A ramp of 0.25 s and the filter.
const CHANGE: f64 = 0.378;

fn joined(first: &Movement, order: &Move, global: f64, blend: Blend) -> Movement {
    first.join(first.corner(blend).unwrap(), order, &conditions(global), blend).unwrap()
}

/// J1 to 40 degrees and back, at half speed.
fn there_and_back(blend: Blend) -> Movement {
    let first = plan(&Axes::ZERO, &percent(to_axes([40.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 50.0), 1.0);
    joined(&first, &percent(to_axes([0.0; 6]), 50.0), 1.0, blend)
}

#[test]
fn each_level_overlaps_more() {
    let alone = 2.0 * (40.0 / 110.4 + CHANGE);
    let mut last = alone;
    for level in 1..=9 {
        let blend = Blend::new(level);
        let duration = there_and_back(blend).duration();
        assert!((duration - (alone - blend.share() * CHANGE)).abs() < 1e-9, "{level}: {duration}");
        assert!(duration < last);
        last = duration;
    }
    assert_eq!((Blend::new(200), Blend::default().share()), (Blend::MOST, 0.0));
    assert!(Blend::MOST.share() < 1.0);
}

#[test]
fn level_0_has_no_corner() {
    let order = percent(to_axes([40.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 50.0);
    let movement = plan(&Axes::ZERO, &order, 1.0);
    assert_eq!(movement.corner(Blend::default()), None);
    assert_eq!(movement.halt(0.4, 0.5).corner(Blend::MOST), None);
    assert_eq!(there_and_back(Blend::MOST).corner(Blend::MOST), None, "this corner comes first");
    assert_eq!(plan(&Axes::ZERO, &percent(to_axes([0.0; 6]), 50.0), 1.0).corner(Blend::MOST), None);
}

/// On a straight path the speed dips less at higher levels, and hardly at the highest.
#[test]
fn the_arm_does_not_stop_at_the_point() {
    let mut last = 0.0;
    for level in 1..=9 {
        let first = plan(&Axes::ZERO, &percent(to_axes([40.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 50.0), 1.0);
        let order = percent(to_axes([80.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 50.0);
        let movement = joined(&first, &order, 1.0, Blend::new(level));
        let slowest = (0..=1000)
            .map(|n| CHANGE + (movement.duration() - 2.0 * CHANGE) * f64::from(n) / 1000.0)
            .map(|t| movement.state_at(t).axis_speeds[0])
            .fold(f64::INFINITY, f64::min);
        assert!(slowest > last && slowest > 0.2 * 110.4 && slowest <= 110.4 + 1e-9, "{level}: {slowest}");
        last = slowest;
    }
    assert!(last > 0.9 * 110.4, "{last}");
}

/// A right angle of two lines at 200 mm/s: how far the tool is from the corner, for each level.
#[test]
fn the_corner_is_cut_more_at_each_level_and_within_bounds() {
    let speed = 200.0;
    let step = SmoothStep::of(Ramps::default().acceleration());
    let mut last = 0.0;
    for level in 1..=9 {
        let blend = Blend::new(level);
        let first = plan(&tool_down(), &percent(line_by(0.0, 120.0, 0.0), 10.0), 1.0);
        let corner = first.state_at(f64::INFINITY).pose;
        let movement = joined(&first, &percent(line_by(120.0, 120.0, 0.0), 10.0), 1.0, blend);
        let nearest = (0..=4000)
            .map(|n| movement.state_at(movement.duration() * f64::from(n) / 4000.0).pose)
            .map(|pose| ((pose.x - corner.x).powi(2) + (pose.y - corner.y).powi(2)).sqrt())
            .fold(f64::INFINITY, f64::min);
        // In the middle of the overlap both moves are this far from the corner.
        let each = speed * step.at(blend.share() * CHANGE / 2.0).area;
        println!("level {level}: {nearest:.3} mm, {each:.3} mm on either line");
        assert!((nearest - each * 2.0_f64.sqrt()).abs() < 0.02 * nearest + 0.01, "{level}: {nearest}");
        assert!(nearest > last);
        last = nearest;
    }
    assert!(last < speed * 0.04, "{last}");
}

#[test]
fn short_moves_overlap_by_half_at_most() {
    let first = plan(&Axes::ZERO, &percent(to_axes([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]), 100.0), 1.0);
    let corner = first.corner(Blend::MOST).unwrap();
    assert!((corner - first.duration() / 2.0).abs() < 1e-9);
    let movement = joined(&first, &percent(to_axes([0.2, 0.0, 0.0, 0.0, 0.0, 0.0]), 100.0), 1.0, Blend::MOST);
    assert!((movement.duration() - 1.5 * first.duration()).abs() < 1e-9);
    assert!((movement.first_ends().unwrap() - first.duration()).abs() < 1e-9);
}

#[test]
fn what_comes_late_begins_at_once() {
    let first = plan(&Axes::ZERO, &percent(to_axes([40.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 50.0), 1.0);
    let late = first.duration() - 0.1;
    let next = percent(to_axes([0.0; 6]), 50.0);
    let movement = first.join(late, &next, &conditions(1.0), Blend::new(5)).unwrap();
    takes_over(&first, &movement.with_global(late, 1.0).unwrap(), late).unwrap();
    assert!((movement.duration() - (late + 40.0 / 110.4 + CHANGE)).abs() < 1e-9);
}

#[test]
fn a_third_move_does_not_join() {
    let order = percent(to_axes([10.0; 6]), 50.0);
    let movement = there_and_back(Blend::MOST);
    assert_eq!(movement.join(0.5, &order, &conditions(1.0), Blend::MOST).unwrap_err(), PlanError::NotFinite);
    let alone = movement.without_first();
    assert!(alone.corner(Blend::MOST).is_some() && alone.first_ends().is_none());
    assert!((alone.duration() - movement.duration()).abs() < 1e-12, "time goes on");
}

/// A short move would be at its corner before the motion that it took over from rests. Then a third move
/// would join.
#[test]
fn a_corner_waits_until_what_was_left_rests() {
    let j1 = |degrees| percent(to_axes([degrees, 0.0, 0.0, 0.0, 0.0, 0.0]), 50.0);
    let left = plan(&Axes::ZERO, &j1(90.0), 1.0);
    let rests_at =
        left.take_over(0.5, &j1(80.0), &conditions(1.0)).unwrap().unwrap().tail.unwrap().rest.arm()[0];
    let short = left.take_over(0.5, &j1(rests_at + 1.0), &conditions(1.0)).unwrap().unwrap();
    assert!(short.duration() < 1.2 * CHANGE, "{}", short.duration());
    let corner = short.corner(Blend::MOST).unwrap();
    assert!((corner - CHANGE).abs() < 1e-9, "{corner}");
    // Also for times before that.
    for at in [0.0, corner] {
        let both = short.join(at, &j1(rests_at + 50.0), &conditions(1.0), Blend::MOST).unwrap();
        let begins = both.second.as_ref().unwrap().starts;
        assert!((begins - CHANGE).abs() < 1e-9, "{at}: {begins}");
        takes_over(&short, &both.with_global(at, 1.0).unwrap(), at).unwrap();
    }
}

/// Two lines near a limit: the nearer the axis is to it, the less the corner is blended.
#[test]
fn a_corner_at_a_limit_is_rounded_less() {
    let mut last = f64::INFINITY;
    for (j1, rounded) in [(150.0, true), (154.99, true), (154.9999, false)] {
        let start = Axes::of_arm([j1, -10.0, 10.0, 0.0, -90.0, 0.0]).unwrap();
        let from = forward(model(), &start, &Frame::identity());
        let aside = Pose { z: from.z - 40.0, ..from };
        let first = plan(&start, &percent(MoveTarget::Line(aside), 10.0), 1.0);
        let movement = joined(&first, &percent(MoveTarget::Line(from), 10.0), 1.0, Blend::MOST);
        let overlap = 2.0 * first.duration() - movement.duration();
        assert!(overlap < last && (overlap > 0.01) == rounded, "J1 at {j1}: {overlap}");
        last = overlap;
    }
}

/// The tool on two successive lines at full speed: it is never faster than requested, not even in the corner.
#[test]
fn the_tool_is_no_faster_in_a_corner() {
    let mut runner =
        TestRunner::new(ProptestConfig { max_global_rejects: 20_000, ..ProptestConfig::default() });
    let offset = || prop::array::uniform3(-200.0..200.0);
    let speed = |movement: &Movement, t: f64| {
        let (a, b) = (movement.state_at(t - 1e-5).pose, movement.state_at(t + 1e-5).pose);
        ((b.x - a.x).powi(2) + (b.y - a.y).powi(2) + (b.z - a.z).powi(2)).sqrt() / 2e-5
    };
    let cases = (offset(), offset(), 1.0..100.0, 1_u8..=9);
    runner
        .run(&cases, |([a, b, c], [x, y, z], told, level)| {
            let order = percent(line_by(a, b, c), told);
            let next = percent(line_by(x, y, z), told);
            let (_, both) = corner_of((tool_down(), order, next, Blend::new(level)), 1.0)?;
            let (begins, ends) = (both.second.as_ref().unwrap().starts, both.first_ends().unwrap());
            for look in 0..=50 {
                let now = speed(&both, begins + (ends - begins) * f64::from(look) / 50.0);
                prop_assert!(now <= 2000.0 * told / 100.0 * 1.001 + 0.01, "{now}");
            }
            Ok(())
        })
        .unwrap();
}

/// Two successive moves of any kind (most can be planned), and a level from 1 to 9.
fn any_corner() -> impl Strategy<Value = (Axes, Move, Move, Blend)> {
    (any_move(), any_move(), 1_u8..=9).prop_map(|((start, first), (_, second), level)| {
        (start, Move { delay: 0.0, ..first }, Move { delay: 0.0, ..second }, Blend::new(level))
    })
}

fn corner_of(
    (start, first, second, blend): (Axes, Move, Move, Blend),
    global: f64,
) -> Result<(Movement, Movement), TestCaseError> {
    let first = possible(Movement::plan(model(), &start, &first, &conditions(global)))?;
    prop_assume!(first.duration() > 0.0);
    let corner = first.corner(blend).unwrap();
    let both = possible(first.join(corner, &second, &conditions(global), blend))?;
    Ok((first, both))
}

proptest! {
    /// Nothing jumps, nothing is too fast, nothing leaves its limits, and both ends are exact.
    #[test]
    fn a_rounded_corner_keeps_all_limits(
        corner in any_corner(), global in 0.02..1.0, parts in prop::collection::vec(0.0..1.0, 20),
    ) {
        let (first, both) = corner_of(corner, global)?;
        let (begins, ends) = (both.second.as_ref().unwrap().starts, both.first_ends().unwrap());
        prop_assert!(begins >= first.corner(corner.3).unwrap() - 1e-9 && begins <= ends + 1e-12);
        prop_assert_eq!(end_of(&both), both.without_first().end());
        for part in parts {
            // Half of the samples are in the corner.
            let t = if part < 0.5 { begins + (ends - begins) * 2.0 * part } else { both.duration() * (2.0 * part - 1.0) };
            let h = 1e-6;
            let [before, here, after] = [t - h, t, t + h].map(|t| both.state_at(t));
            for (n, axis) in model().axes.iter().enumerate() {
                prop_assert!(here.axis_speeds[n].abs() <= axis.max_speed * (1.0 + 1e-9), "J{}", n + 1);
                prop_assert!(axis.soft.min - 1e-5 <= here.axes.arm()[n] && here.axes.arm()[n] <= axis.soft.max + 1e-5);
                let slack = 80.0 * axis.max_speed * h;
                for (a, b) in [(before, here), (here, after)] {
                    let step = b.axes.arm()[n] - a.axes.arm()[n];
                    prop_assert!((step / h - here.axis_speeds[n]).abs() < slack + 1e-3, "J{}: {step}", n + 1);
                    prop_assert!((b.axis_speeds[n] - a.axis_speeds[n]).abs() < slack + 1e-3);
                }
            }
        }
    }

    /// Also with different ramps, and with another speed for the first move on the way.
    #[test]
    fn a_corner_cuts_half_of_either_way_at_most(
        (first, second) in (arm_in_limits(), arm_in_limits()), shares in prop::array::uniform2(1e-3..1.0),
        ramps in prop::array::uniform2(0.01..1.5), next in 0.05..1.0, at in 0.0..1.2, part in 0.0..1.0,
    ) {
        let conditions =
            Conditions { ramps: Ramps::new(ramps[0], ramps[1]).unwrap(), ..conditions(1.0) };
        let [first, second] = [(first, shares[0]), (second, shares[1])].map(|(arm, share)| percent(to_axes(arm.map(|axis| axis * share)), 80.0));
        let one = Movement::plan(model(), &Axes::ZERO, &first, &conditions).unwrap();
        let one = one.with_global(at * one.duration(), next).unwrap();
        let both = one.join(one.corner(Blend::MOST).unwrap(), &second, &conditions, Blend::MOST).unwrap();
        let (begins, ends) = (both.second.as_ref().unwrap().starts, both.first.ends());
        prop_assert!(both.first.part(begins) >= 0.5 - 1e-8);
        prop_assert!(both.second.as_ref().unwrap().part(ends) <= 0.5 + 1e-8);
        let here = both.at(begins + part * (ends - begins));
        for (n, axis) in model().axes.iter().enumerate() {
            prop_assert!(axis.soft.min - 1e-6 <= here.axes.arm()[n] && here.axes.arm()[n] <= axis.soft.max + 1e-6);
            prop_assert!(here.speeds[n].abs() <= axis.max_speed * (1.0 + 1e-9));
        }
    }

    /// Before the corner nothing is different; after it only the second move counts.
    #[test]
    fn outside_the_corner_each_is_alone(corner in any_corner(), global in 0.05..1.0, part in 0.0..1.0) {
        let (first, both) = corner_of(corner, global)?;
        let begins = both.second.as_ref().unwrap().starts;
        let t = part * begins;
        prop_assert_eq!(first.state_at(t).axes, both.state_at(t).axes);
        let ends = both.first_ends().unwrap();
        let t = ends + part * (both.duration() - ends);
        prop_assert_eq!(both.without_first().state_at(t), both.state_at(t));
        // The same as a plan from rest there.
        let second = possible(Movement::plan(model(), &first.end(), &corner.2, &conditions(global)))?;
        let alone = second.state_at(t - begins);
        for (a, b) in alone.axes.arm().into_iter().zip(both.state_at(t).axes.arm()) {
            prop_assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    /// Acceleration and jerk of axis moves are those of one change of speed; twice that if two act on one
    /// axis.
    #[test]
    fn acceleration_and_jerk_of_axis_moves_are_bounded(
        first in arm_in_limits(), second in arm_in_limits(), speed in 1.0..100.0, level in 0_u8..=9, part in 0.0..1.0,
    ) {
        let one = plan(&Axes::ZERO, &percent(to_axes(first), speed), 1.0);
        let blend = Blend::new(level);
        let both = if level == 0 { one } else { joined(&one, &percent(to_axes(second), speed), 1.0, blend) };
        let (t, h) = (part * both.duration(), 1e-5);
        let [a, b, c] = [t - h, t, t + h].map(|t: f64| both.state_at(t.max(0.0)).axis_speeds);
        let step = SmoothStep::of(0.25);
        let changes = if level == 0 { 1.0 } else { 2.0 };
        for (n, axis) in model().axes.iter().enumerate() {
            let top = axis.max_speed * speed / 100.0;
            let acceleration = (b[n] - a[n]).abs() / h;
            prop_assert!(acceleration <= changes * top * step.steepest() * (1.0 + 1e-6) + 1e-6, "{acceleration}");
            let jerk = (c[n] - 2.0 * b[n] + a[n]).abs() / (h * h);
            prop_assert!(jerk <= 2.0 * changes * top * step.sharpest() * (1.0 + 1e-3) + 1.0, "{jerk}");
        }
    }

    /// Stops, pauses and another global speed at any time, in the corner too.
    #[test]
    fn interruptions_of_a_corner_have_no_jumps(
        corner in any_corner(), global in 0.05..1.0, next in 0.05..1.0, part in 0.0..1.2,
        within in 0.01..1.0, wait in 0.0..1.5, rest in 0.0..1.0,
    ) {
        let (_, both) = corner_of(corner, global)?;
        let (begins, ends) = (both.second.as_ref().unwrap().starts, both.first_ends().unwrap());
        let at = begins + part * (ends - begins);
        let halted = both.halt(at, within);
        takes_over(&both, &halted, at)?;
        prop_assert!(halted.duration() <= within + 1e-9 && halted.state_at(within + 1e-9).done);
        let again = wait * within;
        let going_on = halted.resume(again, next).unwrap();
        takes_over(&halted, &going_on, again)?;
        let changed = both.with_global(at, next).unwrap();
        takes_over(&both, &changed, at)?;
        // The same once more, without a time in between.
        let twice = changed.with_global(0.0, global).unwrap();
        takes_over(&both, &twice, at)?;
        for movement in [going_on, changed, twice] {
            prop_assert_eq!(end_of(&movement), end_of(&both));
            prop_assert!(movement.reaches_end());
            let state = movement.state_at(rest * movement.duration());
            for (n, axis) in model().axes.iter().enumerate() {
                prop_assert!(state.axis_speeds[n].abs() <= axis.max_speed * (1.0 + 1e-9));
                prop_assert!(axis.soft.min - 1e-5 <= state.axes.arm()[n] && state.axes.arm()[n] <= axis.soft.max + 1e-5);
            }
        }
    }
}
