use proptest::prelude::*;

use super::*;
use crate::axes::AxisNumber;
use crate::error::LimitSide;
use crate::kinematics::forward;
use crate::kinematics::tests::{arm_in_limits, model, possible};
use crate::pose::Frame;

pub(super) fn conditions(global: f64) -> Conditions {
    Conditions { global, ramps: Ramps::default(), frames: Frames::default(), turning: Turning::Shortest }
}

pub(super) fn percent(target: MoveTarget, percent: f64) -> Move {
    Move { target, mask: MoveMask::SIX, speed: MoveSpeed::PercentOfMax(percent), delay: 0.0 }
}

pub(super) fn to_axes(degrees: [f64; 6]) -> MoveTarget {
    MoveTarget::Axes(Axes::of_arm(degrees).unwrap())
}

pub(super) fn tool_down() -> Axes {
    Axes::of_arm([0.0, -10.0, 10.0, 0.0, -90.0, 0.0]).unwrap()
}

/// A line from the tool-down position by this many mm.
pub(super) fn line_by(x: f64, y: f64, z: f64) -> MoveTarget {
    let from = forward(model(), &tool_down(), &Frame::identity());
    MoveTarget::Line(Pose { x: from.x + x, y: from.y + y, z: from.z + z, ..from })
}

pub(super) fn plan(start: &Axes, order: &Move, global: f64) -> Movement {
    Movement::plan(model(), start, order, &conditions(global)).unwrap()
}

/// The tool's speed at `t`, mm/s.
fn tool_speed(movement: &Movement, t: f64) -> f64 {
    let h = 1e-4;
    let (a, b) = (movement.state_at(t - h).pose, movement.state_at(t + h).pose);
    ((b.x - a.x).powi(2) + (b.y - a.y).powi(2) + (b.z - a.z).powi(2)).sqrt() / (2.0 * h)
}

#[test]
fn j1_at_ten_percent_of_ten_percent() {
    let movement = plan(&Axes::ZERO, &percent(to_axes([64.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 10.0), 0.1);
    let [j1, others @ ..] = movement.state_at(10.0).axis_speeds;
    assert!((j1 - 2.208).abs() < 1e-12, "{j1}");
    assert_eq!(others, [0.0; 7]);
    // The distance at that speed, and one ramp with its filter.
    assert!((movement.duration() - 64.0 / 2.208 - 0.378).abs() < 1e-9, "{}", movement.duration());
    assert!((model().motor_rpm(&movement.state_at(10.0).axis_speeds)[0] - 36.8).abs() < 1e-9);
}

/// The law measured on a real arm (reported, unit B), with this arm's full speeds: each axis alone, speed 5
/// to 30 %.
#[test]
fn every_axis_alone_goes_by_the_speed_law() {
    for (n, axis) in model().axes.iter().enumerate() {
        for speed in [5.0, 10.0, 20.0, 30.0] {
            let mut degrees = [0.0; 6];
            degrees[n] = 40.0;
            let movement = plan(&Axes::ZERO, &percent(to_axes(degrees), speed), 0.1);
            let measured = movement.state_at(movement.duration() / 2.0).axis_speeds[n];
            assert!(
                (measured - axis.max_speed * speed / 1000.0).abs() < 1e-9,
                "J{} at {speed} %: {measured}",
                n + 1
            );
        }
    }
}

/// The ramp takes the same time at any speed: up to a tenth of it, and up to all of it.
#[test]
fn the_ramp_is_the_same_whatever_the_speed() {
    let full = model().axes[0].max_speed;
    for speed in [20.0, 100.0] {
        let movement = plan(&Axes::ZERO, &percent(to_axes([150.0, 0.0, 0.0, 0.0, 0.0, 0.0]), speed), 1.0);
        let halfway = movement.state_at(0.189).axis_speeds[0];
        assert!((halfway - full * speed / 200.0).abs() < 1e-9, "{halfway}");
    }
    let ramps = Ramps::new(0.8, 0.4).unwrap();
    let slow = Conditions { ramps, ..conditions(1.0) };
    let order = percent(to_axes([150.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 50.0);
    let movement = Movement::plan(model(), &Axes::ZERO, &order, &slow).unwrap();
    let halfway = [(0.8 + 0.128) / 2.0, movement.duration() - (0.4 + 0.128) / 2.0];
    for t in halfway {
        assert!((movement.state_at(t).axis_speeds[0] - full * 0.25).abs() < 1e-9);
    }
}

/// Global speed 5 %: speed 5, 10, 20 % gave 5, 10, 20 mm/s (reported, unit B).
#[test]
fn a_line_goes_by_percent_of_full_line_speed() {
    for (speed, expected) in [(5.0, 5.0), (10.0, 10.0), (20.0, 20.0)] {
        let movement = plan(&tool_down(), &percent(line_by(0.0, 100.0, 0.0), speed), 0.05);
        let measured = tool_speed(&movement, movement.duration() / 2.0);
        assert!((measured - expected).abs() < 0.01, "{measured}");
    }
}

/// Action 51: 1:1 at global 5 % on that arm means scaled by the global speed. So at 100 % it is the number
/// itself.
#[test]
fn a_line_goes_by_millimetres_per_second() {
    let order = Move { speed: MoveSpeed::MmPerSecond(123.0), ..percent(line_by(0.0, 100.0, 0.0), 1.0) };
    let movement = plan(&tool_down(), &order, 1.0);
    let measured = tool_speed(&movement, movement.duration() / 2.0);
    assert!((measured - 123.0).abs() < 0.1, "{measured}");
    let halved = plan(&tool_down(), &order, 0.5);
    assert!((tool_speed(&halved, halved.duration() / 2.0) - 61.5).abs() < 0.1);
}

#[test]
fn turning_is_held_to_the_angular_speed() {
    let from = forward(model(), &tool_down(), &Frame::identity());
    let order = percent(MoveTarget::Line(Pose { w: from.w + 60.0, ..from }), 50.0);
    let movement = plan(&tool_down(), &order, 0.2);
    let h = 1e-3;
    let middle = movement.duration() / 2.0;
    let (a, b) = (movement.state_at(middle - h).pose, movement.state_at(middle + h).pose);
    let turned = (b.w - a.w + 540.0).rem_euclid(360.0) - 180.0;
    assert!((turned.abs() / (2.0 * h) - 20.0).abs() < 0.05, "{turned}");
}

#[test]
fn a_delay_stands_still_first() {
    let order = Move { delay: 1.5, ..percent(to_axes([10.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 100.0) };
    let movement = plan(&Axes::ZERO, &order, 1.0);
    let waiting = movement.state_at(1.4);
    assert_eq!((waiting.axes, waiting.axis_speeds, waiting.done), (Axes::ZERO, [0.0; 8], false));
    assert!(movement.state_at(1.6).axis_speeds[0] > 1.0);
    assert!(movement.duration() > 1.5 && !movement.state_at(movement.duration() - 1e-6).done);
    assert!(movement.state_at(movement.duration()).done);
    assert!(movement.stands_first(0.0) && movement.stands_first(1.4) && !movement.stands_first(1.6));
    assert!(!plan(&Axes::ZERO, &Move { delay: 0.0, ..order }, 1.0).stands_first(0.0));
    // A move that was halted during its delay keeps the rest of the delay.
    let going_on = movement.halt(1.0, STOP_SECONDS).resume(100.0, 1.0).unwrap();
    assert!((going_on.duration() - (movement.duration() - 1.0)).abs() < 1e-9);
    assert!(movement.halt(1.0, STOP_SECONDS).state_at(0.0).done);
}

/// Half-way up the ramp the filter and the S-curve have passed, so the acceleration is that of the straight
/// part.
#[test]
fn the_axes_gain_speed_as_the_ramp_says() {
    let movement = plan(&Axes::ZERO, &percent(to_axes([90.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 50.0), 1.0);
    let full = 110.4 / 0.175;
    let at = |t| movement.accelerations_at(t)[0];
    let up = at(0.189);
    assert!((0.8 * full..=full).contains(&up), "{up} of {full}");
    assert!((at(movement.duration() - 0.189) + up).abs() < 1e-3);
    assert!(at(movement.duration() / 2.0).abs() < 1e-6 && at(movement.duration() + 1.0) == 0.0);
    assert_eq!(movement.accelerations_at(0.1)[1..], [0.0; 7]);
}

#[test]
fn nowhere_to_go_is_done_at_once() {
    let movement = plan(&tool_down(), &percent(line_by(0.0, 0.0, 0.0), 50.0), 1.0);
    assert!(movement.duration() < 1e-3 && movement.state_at(1e-3).done);
    let movement = plan(&Axes::ZERO, &percent(to_axes([0.0; 6]), 50.0), 1.0);
    assert!(movement.state_at(0.0).done && movement.reaches_end());
}

#[test]
fn a_stop_takes_its_time_and_stays_on_the_line() {
    let movement = plan(&tool_down(), &percent(line_by(0.0, 150.0, 0.0), 10.0), 0.1);
    let middle = movement.duration() / 2.0;
    let halted = movement.halt(middle, STOP_SECONDS);
    assert!((halted.duration() - STOP_SECONDS).abs() < 1e-12 && !halted.reaches_end());
    let (before, after) = (halted.state_at(0.0).pose, halted.state_at(1.0).pose);
    // 20 mm/s down to rest in 0.078 s.
    assert!((after.y - before.y - 0.78).abs() < 1e-3, "{before:?} {after:?}");
    assert!((after.x - before.x).abs() < 0.01 && (after.z - before.z).abs() < 0.01);
    assert_eq!(halted.state_at(STOP_SECONDS).axis_speeds, [0.0; 8]);
    let end = movement.state_at(f64::INFINITY).axes;
    assert_eq!(halted.resume(3.0, 0.1).unwrap().state_at(f64::INFINITY).axes, end);
}

#[test]
fn a_pause_near_the_end_ends_there() {
    let movement = plan(&Axes::ZERO, &percent(to_axes([50.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 100.0), 1.0);
    let halted = movement.halt(movement.duration() - 0.1, PAUSE_SECONDS);
    assert!(halted.reaches_end());
    assert_eq!(halted.state_at(PAUSE_SECONDS).axes, movement.state_at(f64::INFINITY).axes);
}

#[test]
fn a_new_global_speed_does_not_wake_what_halts() {
    let movement = plan(&Axes::ZERO, &percent(to_axes([50.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 100.0), 0.2);
    let halted = movement.halt(0.5, PAUSE_SECONDS);
    let changed = halted.with_global(0.2, 1.0).unwrap();
    assert!((changed.duration() - 0.3).abs() < 1e-9);
    let (was, is) = (halted.state_at(9.0).axes.arm(), changed.state_at(9.0).axes.arm());
    assert!((was[0] - is[0]).abs() < 1e-9);
}

#[test]
fn a_move_that_cannot_be_is_refused() {
    let refused =
        |order: &Move, global| Movement::plan(model(), &tool_down(), order, &conditions(global)).unwrap_err();
    let fine = to_axes([10.0; 6]);
    for speed in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300] {
        assert_eq!(refused(&percent(fine, speed), 1.0), PlanError::Speed, "{speed} %");
        assert_eq!(refused(&percent(line_by(0.0, 10.0, 0.0), speed), 1.0), PlanError::Speed, "{speed} %");
        assert_eq!(refused(&percent(fine, 10.0), speed), PlanError::Speed, "global {speed}");
        let by_length = Move { speed: MoveSpeed::MmPerSecond(speed), ..percent(fine, 1.0) };
        assert_eq!(refused(&by_length, 1.0), PlanError::Speed, "{speed} mm/s");
    }
    for delay in [-0.1, f64::NAN, f64::INFINITY, 1e300] {
        assert_eq!(refused(&Move { delay, ..percent(fine, 10.0) }, 1.0), PlanError::NotFinite);
    }
    let outside = refused(&percent(to_axes([0.0, 80.0, 0.0, 0.0, 0.0, 0.0]), 10.0), 1.0);
    assert_eq!(outside, PlanError::OutsideLimits { axis: AxisNumber::ARM[1], side: LimitSide::Plus });
    assert_eq!(refused(&percent(line_by(2000.0, 0.0, 0.0), 10.0), 1.0), PlanError::Unreachable);
    let movement = plan(&Axes::ZERO, &percent(fine, 10.0), 1.0);
    for global in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(movement.with_global(0.1, global).unwrap_err(), PlanError::Speed);
        assert_eq!(movement.resume(0.1, global).unwrap_err(), PlanError::Speed);
        assert_eq!(movement.halt(0.1, 0.5).with_global(0.1, global).unwrap_err(), PlanError::Speed);
    }
}

#[test]
fn odd_times_are_answered() {
    let movement = plan(&Axes::ZERO, &percent(to_axes([10.0; 6]), 10.0), 1.0);
    let end = movement.state_at(movement.duration());
    assert_eq!(end.axes, Axes::of_arm([10.0; 6]).unwrap());
    assert_eq!(movement.state_at(f64::INFINITY), end);
    for t in [f64::NAN, f64::NEG_INFINITY, -1.0] {
        assert_eq!(movement.state_at(t).axes, Axes::ZERO);
        assert!(!movement.state_at(t).done);
        assert_eq!(movement.halt(t, 0.5).state_at(0.0).axes, Axes::ZERO);
        assert!(movement.halt(0.2, t).state_at(0.0).done);
    }
    assert_eq!(movement.halt(f64::INFINITY, 0.5).state_at(0.0).axes, end.axes);
}

/// A move of any kind; most can be planned.
pub(super) fn any_move() -> impl Strategy<Value = (Axes, Move)> {
    let offset = || prop::array::uniform3(-120.0..120.0);
    let target = prop_oneof![
        arm_in_limits().prop_map(to_axes),
        offset().prop_map(|[x, y, z]| line_by(x, y, z)),
        (offset(), offset()).prop_map(|([a, b, c], [x, y, z])| {
            match (line_by(a, b, c), line_by(x, y, z)) {
                (MoveTarget::Line(middle), MoveTarget::Line(end)) => MoveTarget::Curve { middle, end },
                (other, _) => other,
            }
        }),
    ];
    (target, 0.1..150.0, 0.0..0.5)
        .prop_map(|(target, speed, delay)| (tool_down(), Move { delay, ..percent(target, speed) }))
}

/// Numbers of every size, including sensible ones.
fn odd_number() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -400.0..400.0, 2 => 0.0..1.0, 1 => any::<f64>(), 1 => -1e7..1e7]
}

pub(super) fn end_of(movement: &Movement) -> Axes {
    movement.state_at(movement.duration()).axes
}

/// Checks that `new` starts where `old` is at `at`, with the same speed.
pub(super) fn takes_over(old: &Movement, new: &Movement, at: f64) -> Result<(), TestCaseError> {
    let (was, is) = (old.state_at(at), new.state_at(0.0));
    for (was, is) in was.axes.degrees().iter().zip(is.axes.degrees()) {
        prop_assert!((was - is).abs() < 1e-9, "{was} {is}");
    }
    for (was, is) in was.axis_speeds.iter().zip(is.axis_speeds) {
        prop_assert!((was - is).abs() < 1e-6, "{was} {is}");
    }
    Ok(())
}

proptest! {
    #[test]
    fn no_axis_goes_beyond_its_limits_or_speed(
        (start, order) in any_move(), global in 0.01..1.5, parts in prop::collection::vec(0.0..1.0, 20),
    ) {
        let movement = possible(Movement::plan(model(), &start, &order, &conditions(global)))?;
        for part in parts {
            let state = movement.state_at(part * movement.duration());
            for (n, axis) in model().axes.iter().enumerate() {
                prop_assert!(state.axis_speeds[n].abs() <= axis.max_speed * (1.0 + 1e-9));
                let degrees = state.axes.arm()[n];
                prop_assert!(axis.soft.min - 1e-5 <= degrees && degrees <= axis.soft.max + 1e-5);
            }
            prop_assert!(!state.done);
        }
        let end = movement.state_at(movement.duration());
        prop_assert!(end.done && end.axis_speeds == [0.0; 8]);
        match order.target {
            MoveTarget::Axes(target) => prop_assert_eq!(end.axes, target),
            MoveTarget::Line(target) | MoveTarget::Curve { end: target, .. } => {
                for (got, want) in end.pose.components().into_iter().take(3).zip(target.components()) {
                    prop_assert!((got - want).abs() < 1e-9, "{got} {want}");
                }
            }
        }
    }

    /// Small steps in time give small steps in position, and the axis speeds are the rate of these steps.
    #[test]
    fn place_and_speed_have_no_jumps((start, order) in any_move(), global in 0.05..1.0, part in 0.0..1.0) {
        let movement = possible(Movement::plan(model(), &start, &order, &conditions(global)))?;
        let (t, h) = (part * movement.duration(), 1e-5);
        let [before, here, after] = [t - h, t, t + h].map(|t| movement.state_at(t));
        for (n, axis) in model().axes.iter().enumerate() {
            let steps = [(before, here), (here, after)].map(|(a, b)| b.axes.arm()[n] - a.axes.arm()[n]);
            // Full acceleration, and the same again for the bend of the path.
            let slack = 40.0 * axis.max_speed * h;
            for step in steps {
                prop_assert!((step / h - here.axis_speeds[n]).abs() < slack + 1e-4, "J{}: {step}", n + 1);
            }
        }
    }

    #[test]
    fn halting_and_going_on_have_no_jumps(
        (start, order) in any_move(), global in 0.05..1.0, part in 0.0..1.0,
        within in 0.01..1.0, wait in 0.0..1.5, next in 0.05..1.0,
    ) {
        let movement = possible(Movement::plan(model(), &start, &order, &conditions(global)))?;
        let at = part * movement.duration();
        let halted = movement.halt(at, within);
        takes_over(&movement, &halted, at)?;
        prop_assert!(halted.duration() <= within + 1e-9);
        prop_assert!(halted.state_at(within + 1e-9).done);
        // Also while it still slows down.
        let again = wait * within;
        let going_on = halted.resume(again, next).unwrap();
        takes_over(&halted, &going_on, again)?;
        prop_assert_eq!(end_of(&going_on), end_of(&movement));
        prop_assert!(going_on.reaches_end());
    }

    /// Pauses, resumes and stops in any order, also while the one before is still under way: the acceleration
    /// does not jump either.
    #[test]
    fn interruptions_upon_interruptions_keep_the_acceleration(
        target in arm_in_limits(), part in 0.1..0.9,
        interruptions in prop::collection::vec((0.0..0.5, prop_oneof![Just(None), (0.078..0.5).prop_map(Some)]), 1..6),
    ) {
        let order = percent(to_axes(target), 100.0);
        let mut movement = plan(&Axes::ZERO, &order, 1.0);
        let mut at = part * movement.duration();
        for (after, halt) in interruptions {
            let next = match halt {
                Some(within) => movement.halt(at, within),
                None => movement.resume(at, 1.0).unwrap(),
            };
            takes_over(&movement, &next, at)?;
            let h = 1e-6;
            let rate = |movement: &Movement, from: f64, to: f64| -> Vec<f64> {
                let [a, b] = [from, to].map(|t| movement.state_at(t).axis_speeds);
                a.iter().zip(b).map(|(a, b)| (b - a) / (to - from)).collect()
            };
            let ends = movement.duration() - at;
            if at > h && ends > h {
                for (was, is) in rate(&movement, at - h, at).into_iter().zip(rate(&next, 0.0, h)) {
                    // What the jerk of the fastest halt adds in two microseconds.
                    prop_assert!((was - is).abs() < 5.0, "{was} {is}");
                }
            }
            movement = next;
            at = after;
        }
    }

    #[test]
    fn a_new_global_speed_has_no_jumps(
        (start, order) in any_move(), global in 0.05..1.0, next in 0.05..1.0,
        part in 0.0..1.0, rest in 0.0..1.0,
    ) {
        let movement = possible(Movement::plan(model(), &start, &order, &conditions(global)))?;
        let at = part * movement.duration();
        let changed = movement.with_global(at, next).unwrap();
        takes_over(&movement, &changed, at)?;
        prop_assert_eq!(end_of(&changed), end_of(&movement));
        let state = changed.state_at(rest * changed.duration());
        for (speed, axis) in state.axis_speeds.into_iter().zip(&model().axes) {
            prop_assert!(speed.abs() <= axis.max_speed * (1.0 + 1e-9));
        }
        let same = movement.with_global(at, global).unwrap();
        prop_assert!((same.duration() - (movement.duration() - at)).abs() < 1e-6);
    }

    /// With any input there is a result, never a panic, and never an arm outside its limits.
    #[test]
    fn nonsense_is_answered(
        numbers in prop::array::uniform12(odd_number()), axes in prop::array::uniform6(odd_number()),
        mask in any::<u8>(), others in prop::array::uniform4(odd_number()), kind in 0..3, t in odd_number(),
    ) {
        let [a, b, c, d, e, f, g, h, i, j, k, l] = numbers;
        let (first, second) =
            (Pose::from_components([a, b, c, d, e, f]), Pose::from_components([g, h, i, j, k, l]));
        let [speed, delay, global, twist] = others;
        let target = match (kind, Axes::of_arm(axes)) {
            (0, Ok(axes)) => MoveTarget::Axes(axes),
            (1, _) => MoveTarget::Curve { middle: first, end: second },
            _ => MoveTarget::Line(first),
        };
        let tool = Frame::at(&Pose { z: d, w: twist, ..Pose::default() }).unwrap_or_default();
        let settings = Conditions { frames: Frames { tool, work: Frame::identity() }, ..conditions(global) };
        for speed in [MoveSpeed::PercentOfMax(speed), MoveSpeed::MmPerSecond(speed)] {
            let order = Move { target, mask: MoveMask(mask), speed, delay };
            for start in [tool_down(), Axes::of_arm(axes).unwrap_or(Axes::ZERO)] {
                let Ok(movement) = Movement::plan(model(), &start, &order, &settings) else { continue };
                let halted = movement.halt(t, twist);
                prop_assert!(movement.duration().is_finite() && halted.duration().is_finite());
                for state in [movement.state_at(t), halted.state_at(t), movement.state_at(f64::INFINITY)] {
                    let mut all = state.axes.degrees().iter().chain(&state.axis_speeds);
                    prop_assert!(all.all(|number| number.is_finite()));
                }
                let end = movement.state_at(f64::INFINITY).axes;
                prop_assert!(start != tool_down() || model().outside_limits(&end).is_none());
                let _ = (halted.resume(t, twist), movement.with_global(t, twist));
            }
        }
    }
}
