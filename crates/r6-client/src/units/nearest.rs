//! Angles with the same orientation: chooses the nearer one of, for example, −180° and 180°.

use crate::units::{Degrees, Millimetres, Pose};

/// A full turn, degrees.
const TURN: f64 = 360.0;

impl Degrees {
    /// Adds or subtracts full turns, so that the result is the same angle at most half a turn from another
    /// one.
    ///
    /// For U, V and W, and for an axis that may turn without limits. Not for an axis whose limits leave no
    /// choice.
    ///
    /// ```
    /// use r6_client::units::Degrees;
    /// assert_eq!(Degrees(180.0).nearest_to(Degrees(-179.5)), Degrees(-180.0));
    /// assert_eq!(Degrees(10.0).nearest_to(Degrees(20.0)), Degrees(10.0));
    /// ```
    #[must_use]
    pub fn nearest_to(self, present: Self) -> Self {
        let turns = ((present.0 - self.0) / TURN).round();
        Self(self.0 + turns * TURN)
    }
}

impl Pose {
    /// The same pose with U, V and W each as near as possible to the present values (`world-3` to `world-5`).
    ///
    /// A real arm that read U −180 and was commanded to +180 turned its wrist the long way round (reported).
    /// A pose without a turn is returned unchanged.
    #[must_use]
    pub fn nearest_to(self, present: [Degrees; 3]) -> Self {
        let Some([u, v, w]) = self.turn() else { return self };
        let [at_u, at_v, at_w] = present;
        let place: [Millimetres; 3] = self.place();
        Self::new(place, [u.nearest_to(at_u), v.nearest_to(at_v), w.nearest_to(at_w)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_is_told_as_near_as_it_can_be() {
        for (angle, present, near) in
            [(180.0, -180.0, -180.0), (-179.0, 179.0, 181.0), (0.0, 720.0, 720.0), (90.0, 80.0, 90.0)]
        {
            assert_eq!(Degrees(angle).nearest_to(Degrees(present)), Degrees(near));
        }
        for n in -1000..1000 {
            let (angle, present) = (Degrees(f64::from(n) * 1.7), Degrees(f64::from(n) * -0.9));
            let near = angle.nearest_to(present);
            assert!((near - present).abs() <= Degrees(180.0 + 1e-9), "{angle} {present} {near}");
            let turns = (near - angle).value() / 360.0;
            assert!((turns - turns.round()).abs() < 1e-9, "{near} is no {angle}");
        }
    }

    #[test]
    fn a_pose_without_a_turn_stays_as_it_is() {
        let place = [1.0, 2.0, 3.0].map(Millimetres);
        let pose = Pose::position(place);
        assert_eq!(pose.nearest_to([Degrees(180.0); 3]), pose);
        let pose = Pose::new(place, [180.0, 0.0, -180.0].map(Degrees));
        let near = pose.nearest_to([-180.0, 0.0, 180.0].map(Degrees));
        assert_eq!(near.turn(), Some([-180.0, 0.0, 180.0].map(Degrees)));
    }
}
