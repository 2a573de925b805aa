//! The track of the tool: a straight line or an arc, with the tool turning evenly along it.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::error::PlanError;

/// A middle point this close to the line from start to end makes a line, not an arc, in mm. Such a flat arc
/// differs from the line by no more.
const FLAT_MM: f64 = 1e-3;

/// Points closer than this count as one point, mm.
const SAME_MM: f64 = 1e-6;

/// A turn smaller than this has no direction, in radians. For the long way round it becomes a full turn.
const SAME_TURN: f64 = 1e-6;

/// The transform of the tool along the track, from 0 to 1. Beyond both ends the track continues as it was.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Track {
    start: Isometry3<f64>,
    end: Isometry3<f64>,
    /// The turn from start to end in the tool frame: axis times angle, at most half a turn unless the long
    /// way is requested.
    turn: Vector3<f64>,
    shape: Shape,
}

#[derive(Clone, Debug, PartialEq)]
enum Shape {
    Line,
    /// `centre + cos·out + sin·along`, from 0 to `angle` radians.
    Arc {
        centre: Vector3<f64>,
        out: Vector3<f64>,
        along: Vector3<f64>,
        angle: f64,
    },
}

impl Track {
    /// A straight track from start to end.
    pub(super) fn line(start: Isometry3<f64>, end: Isometry3<f64>) -> Self {
        Self::new(start, end, Shape::Line)
    }

    /// A track on the circle from start through middle to end.
    ///
    /// The tool turns evenly from the start's orientation to the end's. A middle on the line between start
    /// and end makes a line.
    pub(super) fn arc(
        start: Isometry3<f64>,
        middle: Point3<f64>,
        end: Isometry3<f64>,
    ) -> Result<Self, PlanError> {
        let (a, b, c) = (start.translation.vector, middle.coords, end.translation.vector);
        let (to_middle, to_end) = (b - a, c - a);
        let span = to_end.norm();
        if span < SAME_MM {
            return if to_middle.norm() < SAME_MM {
                Ok(Self::line(start, end))
            } else {
                Err(PlanError::CurvePoints)
            };
        }
        let normal = to_middle.cross(&to_end);
        if normal.norm() / span < FLAT_MM {
            let part = to_middle.dot(&to_end) / span;
            let between = (-SAME_MM..=span + SAME_MM).contains(&part);
            return if between { Ok(Self::line(start, end)) } else { Err(PlanError::CurvePoints) };
        }
        let to_centre = (normal.cross(&to_middle) * to_end.norm_squared()
            + to_end.cross(&normal) * to_middle.norm_squared())
            / (2.0 * normal.norm_squared());
        let (centre, out) = (a + to_centre, -to_centre);
        let along = normal.normalize().cross(&out);
        let radius_squared = out.norm_squared();
        let (cos, sin) = ((c - centre).dot(&out) / radius_squared, (c - centre).dot(&along) / radius_squared);
        let angle = sin.atan2(cos).rem_euclid(TAU);
        Ok(Self::new(start, end, Shape::Arc { centre, out, along, angle }))
    }

    fn new(start: Isometry3<f64>, end: Isometry3<f64>, shape: Shape) -> Self {
        let turn = start.rotation.rotation_to(&end.rotation).scaled_axis();
        // `rotation_to` is in the base frame; the start's rotation converts it to the tool frame.
        let turn = start.rotation.inverse() * turn;
        Self { start, end, turn, shape }
    }

    /// The same track, but turning the other way round to the same end if `told` is the long way. `told` is a
    /// turn in the tool frame, in radians; zero changes nothing.
    pub(super) fn turned_as_told(self, told: &Vector3<f64>) -> Self {
        if *told == Vector3::zeros() {
            return self;
        }
        let short = self.turn.norm();
        let turn = if short < SAME_TURN {
            told.normalize() * TAU
        } else if self.turn.dot(told) < 0.0 {
            self.turn * (1.0 - TAU / short)
        } else {
            self.turn
        };
        Self { turn, ..self }
    }

    /// The distance of the tool, mm.
    pub(super) fn distance(&self) -> f64 {
        match &self.shape {
            Shape::Line => (self.end.translation.vector - self.start.translation.vector).norm(),
            Shape::Arc { out, angle, .. } => out.norm() * angle,
        }
    }

    /// The turn of the tool in degrees: at most 180, or 360 the long way round.
    pub(super) fn angle(&self) -> f64 {
        self.turn.norm().to_degrees()
    }

    /// The velocity of the tool at this fraction of the track, in the base frame: mm and radians per whole
    /// track.
    pub(super) fn velocity(&self, part: f64) -> Vector6<f64> {
        let linear = match &self.shape {
            Shape::Line => self.end.translation.vector - self.start.translation.vector,
            Shape::Arc { out, along, angle, .. } => {
                let (sin, cos) = (angle * part).sin_cos();
                (along * cos - out * sin) * *angle
            }
        };
        let angular = self.start.rotation * self.turn;
        Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
    }

    /// The tool at this fraction of the track: exactly the start at 0, exactly the end at 1.
    pub(super) fn at(&self, part: f64) -> Isometry3<f64> {
        if part == 0.0 {
            return self.start;
        }
        if part == 1.0 {
            return self.end;
        }
        let position = match &self.shape {
            Shape::Line => self.start.translation.vector.lerp(&self.end.translation.vector, part),
            Shape::Arc { centre, out, along, angle } => {
                let (sin, cos) = (angle * part).sin_cos();
                centre + out * cos + along * sin
            }
        };
        let rotation = self.start.rotation * UnitQuaternion::from_scaled_axis(self.turn * part);
        Isometry3::from_parts(Translation3::from(position), rotation)
    }
}

#[cfg(test)]
mod tests {

    use proptest::prelude::*;

    use super::*;
    use crate::pose::Pose;

    fn at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
        turned(x, y, z, 0.0)
    }

    fn turned(x: f64, y: f64, z: f64, w: f64) -> Isometry3<f64> {
        Pose { x, y, z, u: 180.0, v: 0.0, w }.to_isometry().unwrap()
    }

    fn place(isometry: &Isometry3<f64>) -> Vector3<f64> {
        isometry.translation.vector
    }

    #[test]
    fn half_a_circle_goes_through_its_middle() {
        let track =
            Track::arc(at(100.0, 0.0, 5.0), Point3::new(0.0, 100.0, 5.0), at(-100.0, 0.0, 5.0)).unwrap();
        assert!((track.distance() - 100.0 * std::f64::consts::PI).abs() < 1e-9);
        assert!((place(&track.at(0.5)) - Vector3::new(0.0, 100.0, 5.0)).norm() < 1e-9);
    }

    #[test]
    fn the_velocity_is_the_rate_of_the_place() {
        let start = turned(100.0, 0.0, 5.0, 20.0);
        let end = turned(-100.0, 0.0, 5.0, 100.0);
        let arc = Track::arc(start, Point3::new(0.0, 100.0, 25.0), end).unwrap();
        for track in [arc, Track::line(start, end)] {
            for part in [0.1, 0.5, 0.9] {
                let h = 1e-6;
                let [before, after] = [part - h, part + h].map(|part| track.at(part));
                let linear = (place(&after) - place(&before)) / (2.0 * h);
                let angular = (after.rotation * before.rotation.inverse()).scaled_axis() / (2.0 * h);
                let velocity = track.velocity(part);
                assert!((velocity.fixed_rows::<3>(0) - linear).norm() < 1e-4);
                assert!((velocity.fixed_rows::<3>(3) - angular).norm() < 1e-6);
            }
        }
    }

    #[test]
    fn more_than_half_a_circle_goes_the_long_way() {
        let track =
            Track::arc(at(100.0, 0.0, 0.0), Point3::new(-100.0, 0.0, 0.0), at(0.0, -100.0, 0.0)).unwrap();
        assert!((track.distance() - 150.0 * std::f64::consts::PI).abs() < 1e-9);
        assert!((place(&track.at(1.0 / 3.0)) - Vector3::new(0.0, 100.0, 0.0)).norm() < 1e-9);
    }

    #[test]
    fn a_flat_arc_is_a_line() {
        let track = Track::arc(at(0.0, 0.0, 0.0), Point3::new(40.0, 0.0, 0.0), at(100.0, 0.0, 0.0)).unwrap();
        assert_eq!(track.shape, Shape::Line);
        assert!((track.distance() - 100.0).abs() < 1e-12);
    }

    #[test]
    fn points_that_give_no_circle_are_refused() {
        for (middle, end) in [(200.0, 100.0), (-50.0, 100.0), (100.0, 0.0)] {
            let track = Track::arc(at(0.0, 0.0, 0.0), Point3::new(middle, 0.0, 0.0), at(end, 0.0, 0.0));
            assert_eq!(track, Err(PlanError::CurvePoints), "middle {middle}, end {end}");
        }
        assert!(
            Track::arc(at(1.0, 2.0, 3.0), Point3::new(1.0, 2.0, 3.0), turned(1.0, 2.0, 3.0, 90.0)).is_ok()
        );
    }

    #[test]
    fn the_tool_turns_the_short_way_round() {
        let track = Track::line(turned(0.0, 0.0, 0.0, 170.0), turned(10.0, 0.0, 0.0, -170.0));
        assert!((track.angle() - 20.0).abs() < 1e-9, "{}", track.angle());
        let half = Pose::from_isometry(&track.at(0.5));
        assert!((half.w.abs() - 180.0).abs() < 1e-9 && (half.u.abs() - 180.0).abs() < 1e-9, "{half:?}");
    }

    #[test]
    fn half_a_turn_is_no_trouble() {
        let track = Track::line(turned(0.0, 0.0, 0.0, 0.0), turned(0.0, 0.0, 0.0, 180.0));
        assert!((track.angle() - 180.0).abs() < 1e-9);
        let (before, after) = (track.at(0.999_999_9), track.at(1.0));
        assert!(before.rotation.angle_to(&after.rotation) < 1e-6);
    }

    proptest! {
        #[test]
        fn every_point_of_an_arc_is_on_its_circle(
            a in prop::array::uniform3(-500.0..500.0), b in prop::array::uniform3(-500.0..500.0),
            c in prop::array::uniform3(-500.0..500.0), part in 0.0..1.0,
        ) {
            let (a, b, c) = (Vector3::from(a), Vector3::from(b), Vector3::from(c));
            prop_assume!((b - a).cross(&(c - a)).norm() > 1000.0);
            let track = Track::arc(at(a.x, a.y, a.z), Point3::from(b), at(c.x, c.y, c.z)).unwrap();
            let Shape::Arc { centre, out, .. } = &track.shape else { panic!("no arc: {track:?}") };
            let radius = out.norm();
            for point in [a, b, c, place(&track.at(part))] {
                prop_assert!(((point - centre).norm() - radius).abs() < 1e-9 * (1.0 + radius));
            }
            // The length is right: a small step of it, times the number of steps.
            let step = place(&track.at(part + 1e-6)) - place(&track.at(part));
            prop_assert!((step.norm() * 1e6 / track.distance() - 1.0).abs() < 1e-3);
            let last = place(&track.at(1.0 - 1e-9)) - c;
            prop_assert!(last.norm() < 1e-5 * (1.0 + radius / 1000.0));
        }

        #[test]
        fn a_line_starts_turns_evenly_and_ends(w in -180.0..180.0, part in 0.0..1.0) {
            let (start, end) = (turned(0.0, 10.0, 20.0, 15.0), turned(100.0, -10.0, 0.0, w));
            let track = Track::line(start, end);
            prop_assert_eq!((track.at(0.0), track.at(1.0)), (start, end));
            let turned = track.at(0.0).rotation.angle_to(&track.at(part).rotation).to_degrees();
            prop_assert!((turned - track.angle() * part).abs() < 1e-5, "{} of {}", turned, track.angle());
        }
    }
}
