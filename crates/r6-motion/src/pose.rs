//! Position and orientation as the controller shows them, and the frames they are measured in.

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion};

use super::error::NotFinite;

/// The largest coordinate of a pose, in mm. No cell is larger; beyond it squares of lengths lose the last
/// hundredth of a millimetre.
const FARTHEST_MM: f64 = 1e6;

/// The largest angle of a pose, in degrees; beyond it a double no longer resolves a ten-millionth of a
/// degree.
const FARTHEST_DEGREES: f64 = 1e6;

/// Cosine of V below which U and W turn about one line and cannot be distinguished: six ten-millionths of a
/// degree.
const GIMBAL: f64 = 1e-8;

/// Position and orientation of a tool: `world-0` … `world-5`.
///
/// The orientation is R = Rz(W) · Ry(V) · Rx(U): turned by U about the fixed X, then by V about the fixed Y,
/// then by W about the fixed Z. Two independent clients assume this convention; it meets V of the one
/// published pair of joint and world values (reported, unit C) to 0.01°, but no measurement far from the axes
/// is known. The tool's approach direction is +Z, so a tool that points down has U = 180, V = 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// X, mm.
    pub x: f64,
    /// Y, mm.
    pub y: f64,
    /// Z, mm.
    pub z: f64,
    /// Turn about X, degrees.
    pub u: f64,
    /// Turn about Y, degrees.
    pub v: f64,
    /// Turn about Z, degrees.
    pub w: f64,
}

impl Pose {
    /// The components X, Y, Z, U, V, W.
    #[must_use]
    pub const fn components(&self) -> [f64; 6] {
        [self.x, self.y, self.z, self.u, self.v, self.w]
    }

    /// A pose from X, Y, Z, U, V, W.
    #[must_use]
    pub const fn from_components([x, y, z, u, v, w]: [f64; 6]) -> Self {
        Self { x, y, z, u, v, w }
    }

    /// The pose as a transform; an error if a component is not finite or beyond all reach.
    pub fn to_isometry(&self) -> Result<Isometry3<f64>, NotFinite> {
        let near = [self.x, self.y, self.z].iter().all(|c| c.abs() <= FARTHEST_MM);
        let turned = [self.u, self.v, self.w].iter().all(|c| c.abs() <= FARTHEST_DEGREES);
        if !(near && turned) {
            return Err(NotFinite);
        }
        Ok(Isometry3::from_parts(Translation3::new(self.x, self.y, self.z), self.rotation()))
    }

    /// A pose from a transform, with U and W in (−180, 180] and V in [−90, 90].
    ///
    /// At V = ±90, U and W turn about the same line: U reads 0 there and W has the whole turn.
    #[must_use]
    pub fn from_isometry(isometry: &Isometry3<f64>) -> Self {
        let [u, v, w] = fixed_axis_angles(&isometry.rotation.to_rotation_matrix());
        let t = &isometry.translation;
        Self { x: t.x, y: t.y, z: t.z, u, v, w }
    }

    fn rotation(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_euler_angles(self.u.to_radians(), self.v.to_radians(), self.w.to_radians())
    }
}

/// U, V, W in degrees of R = Rz(W)·Ry(V)·Rx(U).
///
/// U is measured after W is removed. So the three together give back the rotation, however noisy W is close
/// to V = ±90.
fn fixed_axis_angles(rotation: &Rotation3<f64>) -> [f64; 3] {
    let r = rotation.matrix();
    let level = r[(0, 0)].hypot(r[(1, 0)]);
    let v = (-r[(2, 0)]).atan2(level);
    let w = if level > GIMBAL { r[(1, 0)].atan2(r[(0, 0)]) } else { (-r[(0, 1)]).atan2(r[(1, 1)]) };
    let u = if level > GIMBAL {
        let (sin, cos) = w.sin_cos();
        (sin * r[(0, 2)] - cos * r[(1, 2)]).atan2(cos * r[(1, 1)] - sin * r[(0, 1)])
    } else {
        0.0
    };
    [half_open(u), v.to_degrees(), half_open(w)]
}

/// Radians in [−π, π] as degrees in (−180, 180].
fn half_open(radians: f64) -> f64 {
    let degrees = radians.to_degrees();
    if degrees <= -180.0 { 180.0 } else { degrees }
}

/// A coordinate system: of a tool, measured from the flange's tool 0, or of a workbench, measured from the
/// base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame(Isometry3<f64>);

impl Frame {
    /// The frame that changes nothing: tool 0, or the base itself.
    #[must_use]
    pub fn identity() -> Self {
        Self(Isometry3::identity())
    }

    /// The frame at this pose; an error if a component is not finite or beyond all reach.
    pub fn at(pose: &Pose) -> Result<Self, NotFinite> {
        pose.to_isometry().map(Self)
    }

    /// The frame as a transform.
    #[must_use]
    pub const fn isometry(&self) -> &Isometry3<f64> {
        &self.0
    }
}

impl Default for Frame {
    fn default() -> Self {
        Self::identity()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    fn pose(components: [f64; 6]) -> Pose {
        Pose::from_components(components)
    }

    fn rotation(pose: &Pose) -> Rotation3<f64> {
        pose.to_isometry().unwrap().rotation.to_rotation_matrix()
    }

    /// The largest difference between the matrices of two rotations: about their angle, without the noise of
    /// an arc cosine.
    fn apart(a: &Rotation3<f64>, b: &Rotation3<f64>) -> f64 {
        (a.matrix() - b.matrix()).abs().max()
    }

    #[test]
    fn turns_are_about_fixed_axes_in_order_u_v_w() {
        let r = rotation(&pose([0.0, 0.0, 0.0, 90.0, 0.0, 90.0]));
        // U turns +Y to +Z, and W leaves it there.
        assert!((r * Vector3::y() - Vector3::z()).norm() < 1e-12);
        // U leaves +X, and W turns it to +Y.
        assert!((r * Vector3::x() - Vector3::y()).norm() < 1e-12);
        let down = rotation(&pose([0.0, 0.0, 0.0, 180.0, 0.0, -60.0]));
        assert!((down * Vector3::z() - -Vector3::z()).norm() < 1e-12);
    }

    #[test]
    fn at_the_gimbal_w_carries_the_turn() {
        for v in [90.0, -90.0] {
            let read = Pose::from_isometry(&pose([1.0, 2.0, 3.0, 0.0, v, 30.0]).to_isometry().unwrap());
            for (got, want) in read.components().into_iter().zip([1.0, 2.0, 3.0, 0.0, v, 30.0]) {
                assert!((got - want).abs() < 1e-6, "{read:?}");
            }
        }
    }

    #[test]
    fn half_turns_read_plus_180() {
        for w in [180.0, -180.0] {
            let read = Pose::from_isometry(&pose([0.0, 0.0, 0.0, 0.0, 0.0, w]).to_isometry().unwrap());
            assert!((read.w.abs() - 180.0).abs() < 1e-12 && read.u.abs() < 1e-12, "{read:?}");
        }
        assert_eq!(half_open(-std::f64::consts::PI), 180.0);
    }

    #[test]
    fn what_is_no_number_makes_no_frame() {
        for n in 0..6 {
            for bad in [f64::NAN, f64::INFINITY, -1e300] {
                let mut components = [0.0; 6];
                components[n] = bad;
                assert_eq!(Frame::at(&pose(components)), Err(NotFinite));
            }
        }
    }

    proptest! {
        #[test]
        fn reading_and_writing_give_the_rotation_back(
            u in -180.0..180.0, v in -90.0..90.0, w in -180.0..180.0,
        ) {
            let written = pose([10.0, -20.0, 30.0, u, v, w]);
            let read = Pose::from_isometry(&written.to_isometry().unwrap());
            prop_assert!(apart(&rotation(&written), &rotation(&read)) < 1e-12);
            prop_assert_eq!((read.x, read.y, read.z), (10.0, -20.0, 30.0));
            prop_assert!((read.v - v).abs() < 1e-5);
        }

        /// From a hundredth of a degree to far below the resolution of a double, on both sides of both poles.
        #[test]
        fn the_rotation_survives_close_to_the_gimbal(
            u in -180.0..180.0, w in -180.0..180.0, small in -16.0..-2.0_f64,
            sign in prop::sample::select(vec![1.0, -1.0]),
        ) {
            let written = pose([0.0, 0.0, 0.0, u, sign * (90.0 - 10.0_f64.powf(small)), w]);
            let read = Pose::from_isometry(&written.to_isometry().unwrap());
            prop_assert!(apart(&rotation(&written), &rotation(&read)) < 2.0 * GIMBAL);
        }
    }
}
