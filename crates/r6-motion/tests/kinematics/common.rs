//! Helpers that the checks of the models share.
#![allow(dead_code, reason = "each test uses its part")]

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use r6_motion::{Axes, RobotModel};

/// Seeded numbers, the same on every machine (splitmix64).
pub struct Numbers(pub u64);

impl Numbers {
    /// A number between 0 and 1.
    pub fn part(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        f64::from((z >> 32) as u32) / f64::from(u32::MAX)
    }

    /// Axes anywhere in the soft limits.
    pub fn axes(&mut self, model: &RobotModel) -> Axes {
        let mut positions = [0.0; 8];
        for (slot, axis) in positions.iter_mut().zip(model.drives()) {
            *slot = axis.soft.min + self.part() * (axis.soft.max - axis.soft.min);
        }
        Axes::new(positions).unwrap()
    }
}

pub fn model(name: &str) -> &'static RobotModel {
    RobotModel::named(name).unwrap()
}

/// The distance of two poses: mm and degrees.
pub fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    let place = (a.translation.vector - b.translation.vector).norm();
    // From the difference of the matrices, because an angle from an arc cosine would be mostly rounding.
    let turn = (a.rotation.to_rotation_matrix().matrix() - b.rotation.to_rotation_matrix().matrix()).norm();
    (place, (turn / std::f64::consts::SQRT_2).to_degrees())
}

/// One joint of a chain: its position and orientation in the joint before, and its axis.
pub struct Joint {
    pub at: [f64; 3],
    pub rpy: [f64; 3],
    pub axis: [f64; 3],
}

pub fn joint(at: [f64; 3], axis: [f64; 3]) -> Joint {
    Joint { at, rpy: [0.0; 3], axis }
}

/// The product of a chain's joints at these angles, degrees.
pub fn product(chain: &[Joint], angles: [f64; 6]) -> Isometry3<f64> {
    chain.iter().zip(angles).fold(Isometry3::identity(), |at, (joint, degrees)| {
        let [roll, pitch, yaw] = joint.rpy;
        let origin = Isometry3::from_parts(
            Translation3::from(Vector3::from(joint.at)),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        );
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from(joint.axis) * degrees.to_radians());
        at * origin * turn
    })
}

/// A translation in the last joint's own frame.
pub fn along(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::translation(x, y, z)
}
