//! Speed, acceleration and jerk of every kind of move, with every kind of ramps, stay within the limits of
//! its profile.
//!
//! A difference of speeds over a short time is a mean acceleration, and a second difference a mean jerk.
//! Neither exceeds the largest one, so a violation here is a real one.

use proptest::prelude::*;
use r6_motion::kinematics::forward;
use r6_motion::speed_profile::{Peaks, Profile, SmoothStep};
use r6_motion::{
    Axes, Blend, Conditions, Frame, Frames, Move, MoveMask, MoveSpeed, MoveTarget, Movement, Pose, Ramps,
    RobotModel, Turning,
};

/// The error of differences of rounded speeds, as a fraction of the limit.
const ROUNDING: f64 = 1e-3;

fn model() -> &'static RobotModel {
    RobotModel::named("BRTIRUS0707A").unwrap()
}

/// Elbow up, tool down, far from every singularity.
fn tool_down() -> Axes {
    Axes::of_arm([0.0, -10.0, 10.0, 0.0, -90.0, 0.0]).unwrap()
}

/// Anywhere in the soft limits, or closer to zero by a random factor.
fn axis_target() -> impl Strategy<Value = MoveTarget> {
    (prop::array::uniform6(0.0..1.0), prop_oneof![Just(1.0), 1e-4..1.0]).prop_map(|(parts, share)| {
        let mut arm = [0.0; 6];
        for ((slot, part), axis) in arm.iter_mut().zip(parts).zip(&model().axes) {
            *slot = share * (axis.soft.min + part * (axis.soft.max - axis.soft.min));
        }
        MoveTarget::Axes(Axes::of_arm(arm).unwrap())
    })
}

fn any_target() -> impl Strategy<Value = MoveTarget> {
    let near = || {
        prop::array::uniform3(-120.0..120.0).prop_map(|[x, y, z]| {
            let from = forward(model(), &tool_down(), &Frame::identity());
            Pose { x: from.x + x, y: from.y + y, z: from.z + z, ..from }
        })
    };
    prop_oneof![
        axis_target(),
        near().prop_map(MoveTarget::Line),
        (near(), near()).prop_map(|(middle, end)| MoveTarget::Curve { middle, end }),
    ]
}

/// Ramps from a hundredth of a second to ten, equally likely at each size; the two can be far apart.
fn any_ramps() -> impl Strategy<Value = Ramps> {
    prop::array::uniform2(-2.0..1.0_f64)
        .prop_map(|[up, down]| Ramps::new(10_f64.powf(up), 10_f64.powf(down)).unwrap())
}

/// Requested speed in percent, global speed, ramps.
fn any_pace() -> impl Strategy<Value = (f64, f64, Ramps)> {
    (1.0..120.0, 0.05..1.0, any_ramps())
}

fn order(target: MoveTarget, percent: f64, delay: f64) -> Move {
    Move { target, mask: MoveMask::SIX, speed: MoveSpeed::PercentOfMax(percent), delay }
}

fn conditions(global: f64, ramps: Ramps) -> Conditions {
    Conditions { global, ramps, frames: Frames::default(), turning: Turning::Shortest }
}

/// The expected profile of a movement, planned again from its path.
fn profile_of(movement: &Movement, (percent, global, ramps): (f64, f64, Ramps)) -> Profile {
    let path = movement.path();
    Profile::plan(path.length(), (percent / 100.0 * global).min(path.top_speed()), ramps).unwrap()
}

/// The limits of each axis for speed, acceleration and jerk on an axis move.
fn axis_limits(movement: &Movement, peaks: &Peaks) -> [[f64; 3]; 6] {
    let slope = movement.path().at(0.0).slope;
    slope.map(|slope| [peaks.speed, peaks.acceleration, peaks.jerk].map(|peak| slope.abs() * peak))
}

/// Samples the axes near `t` and compares them with their limits. `h` is far below the shortest change.
fn within(movement: &Movement, t: f64, h: f64, limits: &[[f64; 3]; 6]) -> Result<(), TestCaseError> {
    let [before, here, after] = [t, t + h, t + 2.0 * h].map(|t| movement.state_at(t).axis_speeds);
    for (n, most) in limits.iter().enumerate() {
        let seen = [here[n], (after[n] - here[n]) / h, (after[n] - 2.0 * here[n] + before[n]) / (h * h)];
        for (what, (seen, most)) in
            ["speed", "acceleration", "jerk"].into_iter().zip(seen.into_iter().zip(most))
        {
            prop_assert!(
                seen.abs() <= most * (1.0 + ROUNDING) + 1e-6,
                "J{} at {t}: {what} {seen}, {most} allowed",
                n + 1
            );
        }
    }
    Ok(())
}

/// A time that is short compared with the shortest change of these ramps.
fn short_while(ramps: &[Ramps]) -> f64 {
    let shortest =
        ramps.iter().map(|ramps| ramps.acceleration().min(ramps.deceleration())).fold(60.0, f64::min);
    1e-3 * SmoothStep::of(shortest).width()
}

proptest! {
    /// A move follows its path exactly as its profile says, and the profile keeps the limits of its two
    /// changes. So does everything that moves along the path: the tool on a line or curve and each axis of an
    /// axis move.
    #[test]
    fn every_move_keeps_the_speed_acceleration_and_jerk_of_its_profile(
        target in any_target(), pace in any_pace(), delay in 0.0..0.5, parts in prop::collection::vec(0.0..1.0, 20),
    ) {
        let (percent, global, ramps) = pace;
        let planned = Movement::plan(model(), &tool_down(), &order(target, percent, delay), &conditions(global, ramps));
        let movement = planned.map_err(|error| TestCaseError::reject(error.to_string()))?;
        let profile = profile_of(&movement, pace);
        prop_assert!((movement.duration() - delay - profile.duration()).abs() < 1e-9);
        let top = (percent / 100.0 * global).min(movement.path().top_speed());
        let [up, down] = [ramps.acceleration(), ramps.deceleration()].map(SmoothStep::of);
        let peaks = profile.peaks();
        prop_assert!(peaks.speed <= top * (1.0 + 1e-9));
        prop_assert!(peaks.acceleration <= top * up.steepest().max(down.steepest()) * (1.0 + 1e-9));
        prop_assert!(peaks.jerk <= top * (up.sharpest() + down.sharpest()) * (1.0 + 1e-9));
        let h = short_while(&[ramps]);
        for part in parts {
            let t = part * profile.duration();
            let [here, next] = [t, t + h].map(|t| profile.at(t));
            prop_assert!(here.speed <= peaks.speed * (1.0 + 1e-9));
            prop_assert!(here.acceleration.abs() <= peaks.acceleration * (1.0 + 1e-6) + 1e-9);
            let jerk = (next.acceleration - here.acceleration).abs() / h;
            prop_assert!(jerk <= peaks.jerk * (1.0 + ROUNDING) + 1e-6, "{jerk}: {peaks:?}");
            let (state, there) = (movement.state_at(delay + t), movement.path().at(here.position));
            for n in 0..6 {
                prop_assert!((state.axes.arm()[n] - there.axes.arm()[n]).abs() < 1e-8, "J{} at {t}", n + 1);
                let speed = there.slope[n] * here.speed;
                prop_assert!((state.axis_speeds[n] - speed).abs() < 1e-5 * (1.0 + speed.abs()), "J{} at {t}", n + 1);
            }
        }
        if matches!(target, MoveTarget::Axes(_)) {
            let limits = axis_limits(&movement, &peaks);
            for n in 0..50 {
                let part = f64::from(n) / 50.0;
                // As many samples in either change of speed as over the whole.
                for t in [part * up.width(), part * profile.duration(), profile.duration() - part * down.width()] {
                    within(&movement, delay + t.max(0.0), h, &limits)?;
                }
            }
        }
    }

    /// A halt slows down the time of the plan. The acceleration and jerk of that slowing come on top, and
    /// also when resuming from rest.
    #[test]
    fn a_halt_adds_no_more_than_its_own_pace(
        target in axis_target(), pace in any_pace(), part in 0.0..1.0, seconds in 0.02..1.0, looks in prop::collection::vec(0.0..1.0, 30),
    ) {
        let (percent, global, ramps) = pace;
        let settings = conditions(global, ramps);
        let movement = Movement::plan(model(), &tool_down(), &order(target, percent, 0.0), &settings).unwrap();
        let at = part * movement.duration();
        let halted = movement.halt(at, seconds);
        let rested = seconds + 0.1;
        let going_on = halted.resume(rested, global).unwrap();
        let profile = profile_of(&movement, pace);
        // Resuming sets the top of the profile again, which splits a change in two.
        let peaks = profile.peaks();
        let shortest = profile.shortest_change();
        for (moved, over, span) in [(&halted, seconds, seconds), (&going_on, shortest, going_on.duration())] {
            let limits = axis_limits(&movement, &peaks).map(|limits| paced(limits, over));
            let h = short_while(&[ramps]).min(1e-3 * over);
            for look in &looks {
                within(moved, look * span, h, &limits)?;
                within(moved, look * over, h, &limits)?;
            }
        }
    }

    /// If two moves act on one axis, both add up; each keeps the limits of its own profile.
    #[test]
    fn a_rounded_corner_has_no_more_than_both_moves(
        first in axis_target(), second in axis_target(), paces in (any_pace(), any_pace()), level in 1_u8..=9,
        looks in prop::collection::vec(0.0..1.0, 40),
    ) {
        let (one, two) = paces;
        let settings = conditions(one.1, one.2);
        let before = Movement::plan(model(), &tool_down(), &order(first, one.0, 0.0), &settings).unwrap();
        let (next, settings, blend) = (order(second, two.0, 0.0), conditions(two.1, two.2), Blend::new(level));
        let Some(corner) = before.corner(blend) else { return Ok(()) };
        let both = before.join(corner, &next, &settings, blend).unwrap();
        let alone = Movement::plan(model(), &before.end(), &next, &settings).unwrap();
        let profiles = [(&before, one), (&alone, two)].map(|(movement, pace)| (movement, profile_of(movement, pace)));
        let [a, b] = profiles.each_ref().map(|(movement, profile)| axis_limits(movement, &profile.peaks()));
        let asked = profiles.map(|(movement, profile)| movement.path().at(0.0).slope.map(|slope| slope.abs() * profile.fastest()));
        let mut sums = a;
        for (sum, b) in sums.iter_mut().flatten().zip(b.iter().flatten()) {
            *sum += b;
        }
        let h = short_while(&[one.2, two.2]);
        let ends = both.first_ends().unwrap();
        for look in looks {
            within(&both, look * both.duration(), h, &sums)?;
            let t = corner + look * (ends - corner);
            within(&both, t, h, &sums)?;
            for (n, speed) in both.state_at(t).axis_speeds.iter().take(6).enumerate() {
                // Two short moves never reach their requested speeds; together they come closer.
                let faster = asked[0][n].max(asked[1][n]);
                prop_assert!(speed.abs() <= faster * (1.0 + 1e-9), "J{}: {speed} {faster}", n + 1);
            }
        }
    }
}

/// These limits while the time of the plan slows down or speeds up within this many seconds, by a smooth
/// step.
fn paced([speed, acceleration, jerk]: [f64; 3], seconds: f64) -> [f64; 3] {
    let step = SmoothStep::within(seconds);
    let (slope, bend) = (step.steepest(), step.sharpest());
    [speed, acceleration + speed * slope, jerk + 3.0 * acceleration * slope + speed * bend]
}
