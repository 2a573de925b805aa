use proptest::prelude::*;

use super::*;

const REST: PathPoint = PathPoint { position: 0.0, speed: 0.0 };

fn ramps(acceleration: f64, deceleration: f64) -> Ramps {
    Ramps::new(acceleration, deceleration).unwrap()
}

fn plan(start: PathPoint, end: f64, top: f64) -> Profile {
    Profile::plan(start, end, top, Ramps::default()).unwrap()
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-12
}

#[test]
fn a_long_way_has_a_stretch_at_the_top() {
    // At half speed each ramp takes 0.125 s and covers 0.03125.
    let profile = plan(REST, 1.0, 0.5);
    assert!(close(profile.duration(), 0.25 + (1.0 - 0.0625) / 0.5));
    let middle = profile.at(1.0);
    assert!(
        close(middle.speed, 0.5)
            && close(middle.position, 0.031_25 + 0.875 * 0.5)
            && middle.acceleration == 0.0
    );
    assert!(close(profile.at(0.05).speed, 0.2) && close(profile.at(0.05).acceleration, 4.0));
}

#[test]
fn a_short_way_never_reaches_the_top() {
    let profile = plan(REST, 0.01, 1.0);
    assert!(close(profile.duration(), 2.0 * (0.01_f64 / 4.0).sqrt()));
    assert!(close(profile.at(profile.duration() / 2.0).speed, 0.2));
    assert!(close(profile.at(profile.duration() / 2.0).position, 0.005));
}

#[test]
fn acceleration_and_deceleration_are_apart() {
    let profile = Profile::plan(REST, 2.0, 1.0, ramps(0.5, 0.1)).unwrap();
    assert!(close(profile.at(0.25).acceleration, 2.0));
    assert!(close(profile.at(profile.duration() - 0.05).acceleration, -10.0));
    assert!(close(profile.duration(), 0.5 + (2.0 - 0.25 - 0.05) + 0.1));
}

#[test]
fn too_fast_a_start_slows_down_first() {
    let profile = plan(PathPoint { position: 1.0, speed: 0.8 }, 2.0, 0.2);
    assert!(close(profile.at(0.1).acceleration, -4.0) && close(profile.at(0.15).speed, 0.2));
    assert!(close(profile.at(0.2).speed, 0.2));
    assert_eq!(profile.at(1e9), ProfileState { position: 2.0, speed: 0.0, acceleration: 0.0 });
}

#[test]
fn a_start_too_fast_to_stop_brakes_harder() {
    let profile = plan(PathPoint { position: 0.0, speed: 1.0 }, 0.05, 1.0);
    assert!(close(profile.duration(), 0.1) && close(profile.at(0.05).acceleration, -10.0));
    assert_eq!(profile.at(0.1).position, 0.05);
}

#[test]
fn no_way_takes_no_time() {
    let profile = plan(REST, 0.0, 1.0);
    assert_eq!(profile.duration(), 0.0);
    assert_eq!(profile.at(0.0), ProfileState { position: 0.0, speed: 0.0, acceleration: 0.0 });
}

#[test]
fn stopping_takes_the_time_it_is_given() {
    let at = PathPoint { position: 1.0, speed: 0.5 };
    let stop = Profile::stop_from(at, 9.0, 0.078);
    assert!(close(stop.duration(), 0.078) && close(stop.end(), 1.0 + 0.5 * 0.039));
    assert!(close(stop.at(0.039).speed, 0.25));
}

#[test]
fn stopping_never_passes_the_end() {
    let stop = Profile::stop_from(PathPoint { position: 1.0, speed: 0.5 }, 1.01, 0.5);
    assert_eq!(stop.at(1.0).position, 1.01);
    assert!(close(stop.duration(), 0.04));
}

#[test]
fn stopping_in_no_time_stops_dead() {
    let at = PathPoint { position: 1.0, speed: 0.5 };
    for seconds in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let stop = Profile::stop_from(at, 9.0, seconds);
        assert_eq!((stop.duration(), stop.at(0.0).position), (0.0, 1.0), "{seconds}");
    }
}

#[test]
fn what_is_no_number_is_refused() {
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    for bad in bad {
        assert_eq!(Profile::plan(PathPoint { position: bad, speed: 0.0 }, 1.0, 1.0, Ramps::default()), None);
        assert_eq!(Profile::plan(PathPoint { position: 0.0, speed: bad }, 1.0, 1.0, Ramps::default()), None);
        assert_eq!(Profile::plan(REST, bad, 1.0, Ramps::default()), None);
        assert_eq!(Profile::plan(REST, 1.0, bad, Ramps::default()), None);
        assert_eq!(Ramps::new(bad, 0.25).or(Ramps::new(0.25, bad)), None);
        let lost = Profile::stop_from(PathPoint { position: bad, speed: 1.0 }, 1.0, 0.1);
        assert!(lost.at(-1.0).speed.abs() <= 1.0);
    }
    assert_eq!(Profile::plan(REST, 1.0, 0.0, Ramps::default()), None);
    assert_eq!(Profile::plan(REST, -1.0, 1.0, Ramps::default()), None);
    assert_eq!(Profile::plan(REST, 1.0, 1e-300, Ramps::default()), None, "it would never end");
    assert_eq!(Ramps::new(0.0, 0.25), None);
    assert_eq!(plan(REST, 1.0, 1.0).at(f64::NAN).position, 0.0);
}

proptest! {
    #[test]
    fn speed_acceleration_and_place_stay_within_what_is_allowed(
        from in 0.0..5.0, way in 0.0..5.0, speed in 0.0..1.0, top in 0.001..1.0,
        up in 0.01..2.0, down in 0.01..2.0, parts in prop::collection::vec(0.0..1.0, 2..40),
    ) {
        let ramps = ramps(up, down);
        let start = PathPoint { position: from, speed };
        prop_assume!(speed * speed * down / 2.0 <= way);
        let profile = Profile::plan(start, from + way, top, ramps).unwrap();
        let mut times: Vec<f64> = parts.iter().map(|part| part * profile.duration()).collect();
        times.sort_by(f64::total_cmp);
        let steepest = (1.0 / up).max(1.0 / down) * (1.0 + 1e-6);
        let states: Vec<_> = times.iter().map(|t| profile.at(*t)).collect();
        for (pair, times) in states.windows(2).zip(times.windows(2)) {
            let (a, b, dt) = (pair[0], pair[1], times[1] - times[0]);
            prop_assert!(b.position >= a.position);
            prop_assert!((b.speed - a.speed).abs() <= steepest * dt + 1e-9, "speed jumps");
            let (low, high) = (a.speed.min(b.speed), top.max(speed));
            prop_assert!(b.position - a.position <= high * dt + 1e-9, "place jumps");
            prop_assert!(b.position - a.position >= (low - steepest * dt).max(0.0) * dt - 1e-9);
            prop_assert!(b.speed <= high + 1e-12 && b.acceleration.abs() <= steepest);
        }
        let first = profile.at(0.0);
        prop_assert!((first.position - from).abs() < 1e-12 && (first.speed - speed).abs() < 1e-9);
        let last = profile.at(profile.duration());
        prop_assert_eq!((last.position, last.speed), (from + way, 0.0));
        let before = profile.at(profile.duration() - 1e-9);
        prop_assert!(from + way - before.position < 1e-8);
    }

    /// The place is the integral of the speed.
    #[test]
    fn place_and_speed_agree(way in 0.01..3.0, speed in 0.0..0.2, top in 0.01..1.0, part in 0.01..0.99) {
        prop_assume!(speed * speed * 0.125 < way);
        let profile = plan(PathPoint { position: 0.0, speed }, way, top);
        let (t, h) = (part * profile.duration(), 1e-7);
        let measured = (profile.at(t + h).position - profile.at(t - h).position) / (2.0 * h);
        prop_assert!((measured - profile.at(t).speed).abs() < 1e-6 + 4.0 * h);
    }
}
