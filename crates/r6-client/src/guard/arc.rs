//! Calculates how far an arc reaches.

use std::f64::consts::{PI, TAU};

type Point = [f64; 3];

/// Three points whose triangle is flatter than this, mm², lie on a line.
const FLAT: f64 = 1e-9;

/// The minimum and maximum of X, Y and Z on the arc from one point through another to the third.
pub(super) fn arc_extremes(from: Point, middle: Point, to: Point) -> [(f64, f64); 3] {
    let mut reached = vec![from, middle, to];
    let (first, second) = (minus(middle, from), minus(to, from));
    let normal = cross(first, second);
    let squared = dot(normal, normal);
    if squared > FLAT {
        let to_centre = times(
            plus(
                times(cross(normal, first), dot(second, second)),
                times(cross(second, normal), dot(first, first)),
            ),
            0.5 / squared,
        );
        let centre = plus(from, to_centre);
        // The arc is centre + across·cos + along·sin, starting at angle 0. Around the normal it goes from
        // `from` through `middle` to `to`.
        let across = times(to_centre, -1.0);
        let along = times(cross(normal, across), 1.0 / squared.sqrt());
        let at_end = minus(to, centre);
        let end = dot(at_end, along).atan2(dot(at_end, across)).rem_euclid(TAU);
        for (cos, sin) in across.into_iter().zip(along) {
            let turning = sin.atan2(cos);
            for angle in [turning, turning + PI].map(|angle| angle.rem_euclid(TAU)) {
                if angle <= end {
                    reached.push(plus(centre, plus(times(across, angle.cos()), times(along, angle.sin()))));
                }
            }
        }
    }
    let bounds = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
    let nothing = (f64::INFINITY, f64::NEG_INFINITY);
    reached
        .into_iter()
        .fold([nothing; 3], |[x, y, z], [px, py, pz]| [bounds(x, px), bounds(y, py), bounds(z, pz)])
}

fn plus([ax, ay, az]: Point, [bx, by, bz]: Point) -> Point {
    [ax + bx, ay + by, az + bz]
}

fn minus(a: Point, b: Point) -> Point {
    plus(a, times(b, -1.0))
}

fn times([x, y, z]: Point, by: f64) -> Point {
    [x * by, y * by, z * by]
}

fn dot([ax, ay, az]: Point, [bx, by, bz]: Point) -> f64 {
    ax * bx + ay * by + az * bz
}

fn cross([ax, ay, az]: Point, [bx, by, bz]: Point) -> Point {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: [(f64, f64); 3], wanted: [(f64, f64); 3]) {
        for ((low, high), (wanted_low, wanted_high)) in found.into_iter().zip(wanted) {
            assert!((low - wanted_low).abs() < 1e-9 && (high - wanted_high).abs() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn half_a_circle_bulges_beyond_its_ends() {
        let found = arc_extremes([10.0, 0.0, 5.0], [6.0, 8.0, 5.0], [-10.0, 0.0, 5.0]);
        near(found, [(-10.0, 10.0), (0.0, 10.0), (5.0, 5.0)]);
    }

    #[test]
    fn the_long_way_round_is_followed() {
        let found = arc_extremes([10.0, 0.0, 0.0], [-10.0, 0.0, 0.0], [0.0, -10.0, 0.0]);
        near(found, [(-10.0, 10.0), (-10.0, 10.0), (0.0, 0.0)]);
        let found = arc_extremes([10.0, 0.0, 0.0], [0.0, -10.0, 0.0], [-10.0, 0.0, 0.0]);
        near(found, [(-10.0, 10.0), (-10.0, 0.0), (0.0, 0.0)]);
    }

    #[test]
    fn a_straight_way_is_its_points() {
        let found = arc_extremes([0.0; 3], [1.0; 3], [2.0; 3]);
        near(found, [(0.0, 2.0); 3]);
    }
}
