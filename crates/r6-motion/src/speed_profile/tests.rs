use proptest::prelude::*;

use super::*;

/// A ramp of 0.25 s and the filter.
const CHANGE: f64 = 0.378;

fn ramps(acceleration: f64, deceleration: f64) -> Ramps {
    Ramps::new(acceleration, deceleration).unwrap()
}

fn plan(end: f64, top: f64) -> Profile {
    Profile::plan(end, top, Ramps::default()).unwrap()
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-12
}

#[test]
fn a_long_way_takes_one_change_more_than_at_full_speed() {
    for top in [0.01, 0.5, 1.0] {
        let profile = plan(1.0, top);
        assert!(close(profile.duration(), 1.0 / top + CHANGE), "{top}");
        let middle = profile.at(profile.duration() / 2.0);
        assert!(close(middle.speed, top) && close(middle.position, 0.5) && middle.acceleration == 0.0);
        let early = profile.at(CHANGE / 2.0);
        assert!(close(early.speed, top / 2.0), "the ramp takes the same time whatever the speed");
    }
}

#[test]
fn a_short_way_keeps_its_ramps_and_stays_slower() {
    let profile = plan(0.01, 1.0);
    assert!(close(profile.duration(), 0.01 + CHANGE));
    let middle = profile.at(profile.duration() / 2.0);
    assert!(close(middle.position, 0.005) && middle.speed < 0.06 && middle.speed > 0.05, "{middle:?}");
}

#[test]
fn acceleration_and_deceleration_are_apart() {
    let profile = Profile::plan(2.0, 1.0, ramps(0.5, 0.1)).unwrap();
    // Half of each ramp, and the filter once.
    assert!(close(profile.duration(), 2.0 + 0.25 + 0.05 + FILTER_SECONDS));
    assert!(close(profile.at((0.5 + FILTER_SECONDS) / 2.0).speed, 0.5));
    let late = profile.duration() - (0.1 + FILTER_SECONDS) / 2.0;
    assert!(close(profile.at(late).speed, 0.5));
}

#[test]
fn no_way_takes_no_time() {
    let profile = plan(0.0, 1.0);
    assert_eq!(profile.duration(), 0.0);
    assert_eq!(profile.at(0.0), ProfileState { position: 0.0, speed: 0.0, acceleration: 0.0 });
}

#[test]
fn another_top_takes_one_change() {
    let profile = plan(2.0, 0.5).with_top(1.0, 1.0).unwrap();
    assert!(close(profile.at(1.0).speed, 0.5) && close(profile.at(1.0 + CHANGE).speed, 1.0));
    assert!(close(profile.at(1.0 + CHANGE / 2.0).speed, 0.75));
    // Requested: a second at half speed, then the remaining 1.5 at full speed.
    assert!(close(profile.duration(), 1.0 + 1.5 + CHANGE));
    let changed = profile.with_top(2.0, 0.1).unwrap();
    assert!(close(changed.duration(), 1.0 + 1.0 + 5.0 + CHANGE) && close(changed.at(3.0).speed, 0.1));
}

#[test]
fn another_top_too_late_changes_nothing() {
    let profile = plan(1.0, 1.0);
    assert_eq!(profile.with_top(1.0, 0.1), Some(profile.clone()));
    assert_eq!(profile.with_top(9.0, 1.0), Some(profile));
}

#[test]
fn another_top_before_the_start_is_a_new_plan() {
    assert_eq!(plan(1.0, 1.0).with_top(-1.0, 0.5), Some(plan(1.0, 0.5)));
}

#[test]
fn changing_the_top_endlessly_keeps_no_endless_record() {
    let mut profile = plan(1.0, 0.01);
    for n in 1..100_000 {
        let at = f64::from(n) * 1e-5;
        profile = profile.with_top(at, if n % 2 == 0 { 0.01 } else { 0.02 }).unwrap();
        assert!(profile.changes.len() < 400, "{}", profile.changes.len());
    }
    assert_eq!(profile.at(1e9).position, 1.0);
}

#[test]
fn what_is_no_number_is_refused() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(Profile::plan(bad, 1.0, Ramps::default()), None);
        assert_eq!(Profile::plan(1.0, bad, Ramps::default()), None);
        assert_eq!(plan(1.0, 1.0).with_top(0.5, bad), None);
        assert_eq!(Ramps::new(bad, 0.25).or(Ramps::new(0.25, bad)), None);
    }
    assert_eq!(Profile::plan(1.0, 0.0, Ramps::default()), None);
    assert_eq!(Profile::plan(-1.0, 1.0, Ramps::default()), None);
    assert_eq!(Profile::plan(1.0, 1e-300, Ramps::default()), None, "it would never end");
    assert_eq!(Ramps::new(0.0, 0.25), None);
    assert_eq!(plan(1.0, 1.0).at(f64::NAN).position, 0.0);
}

/// A profile with its top changed at these times.
fn changed(way: f64, top: f64, ramps: Ramps, changes: &[(f64, f64)]) -> Profile {
    let mut at = 0.0;
    let mut profile = Profile::plan(way, top, ramps).unwrap();
    for (wait, top) in changes {
        at += wait;
        profile = profile.with_top(at, *top).unwrap();
    }
    profile
}

/// A new speed every two milliseconds, with the longest possible ramps.
#[test]
fn however_often_the_speed_changes_little_is_remembered() {
    for ramp in [0.25, Ramps::LONGEST] {
        let mut profile = Profile::plan(1e4, 0.5, Ramps::new(ramp, ramp).unwrap()).unwrap();
        for n in 1..20_000_u32 {
            let top = if n % 2 == 0 { 0.5 } else { 0.4 };
            profile = profile.with_top(0.002 * f64::from(n), top).unwrap();
            assert!(profile.changes.len() <= 202, "{ramp}: {}", profile.changes.len());
        }
    }
}

proptest! {
    /// Also with another top on the way, and with different ramps up and down.
    #[test]
    fn speed_acceleration_and_jerk_stay_within_what_is_allowed(
        way in 1e-6..5.0, top in 0.001..1.0, up in 0.01..1.0, down in 0.01..1.0,
        changes in prop::collection::vec((0.0..0.4, 0.01..1.0), 0..4), part in 0.0..1.0,
    ) {
        let ramps = ramps(up, down);
        let profile = changed(way, top, ramps, &changes);
        let asked: f64 = changes.iter().map(|(wait, _)| wait).sum();
        let (from, h) = (asked.min(profile.duration()), 1e-5);
        let t = from + part * (profile.duration() - from);
        let [a, b] = [t, t + h].map(|t| profile.at(t));
        let shortest = SmoothStep::of(up.min(down));
        let highest = changes.iter().map(|(_, top)| *top).fold(top, f64::max);
        prop_assert!(b.position >= a.position - 1e-12 && b.position <= way, "{a:?} {b:?}");
        prop_assert!(a.speed >= 0.0 && a.speed <= highest * (1.0 + 1e-9), "{a:?}");
        prop_assert!(a.acceleration.abs() <= highest * shortest.steepest() * (1.0 + 1e-6), "{a:?}");
        // Two changes may bend at the same time, one up and one down.
        let jerk = (b.acceleration - a.acceleration).abs() / h;
        prop_assert!(jerk <= 2.0 * highest * shortest.sharpest() * (1.0 + 1e-3) + 1e-6, "{jerk}");
        prop_assert!((b.position - a.position - a.speed * h).abs() <= 2.0 * highest * shortest.steepest() * h * h + 1e-12);
        prop_assert!((b.speed - a.speed - a.acceleration * h).abs() <= 2.0 * highest * shortest.sharpest() * h * h + 1e-9);
    }

    /// The clamps in `at` only remove rounding: the end is met without them.
    #[test]
    fn the_end_is_met(
        way in 1e-6..5.0, top in 0.001..1.0, up in 0.01..1.0, down in 0.01..1.0,
        changes in prop::collection::vec((0.0..0.4, 0.01..1.0), 0..4),
    ) {
        let profile = changed(way, top, ramps(up, down), &changes);
        let last = profile.at(profile.duration());
        prop_assert_eq!((last.position, last.speed), (way, 0.0));
        let before = profile.at(profile.duration() - 1e-6);
        prop_assert!(way - before.position < 1e-9 && before.speed < 1e-6, "{before:?}");
    }

    /// Nothing jumps where the change begins.
    #[test]
    fn another_top_has_no_jump(
        way in 0.01..3.0, top in 0.01..1.0, next in 0.01..1.0, part in 0.0..1.0,
        up in 0.01..1.0, down in 0.01..1.0,
    ) {
        let profile = Profile::plan(way, top, ramps(up, down)).unwrap();
        let at = part * profile.duration();
        let (was, is) = (profile.at(at), profile.with_top(at, next).unwrap().at(at));
        prop_assert!((was.position - is.position).abs() < 1e-12 && (was.speed - is.speed).abs() < 1e-12);
        prop_assert!((was.acceleration - is.acceleration).abs() < 1e-9);
    }
}
