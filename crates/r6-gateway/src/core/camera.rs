//! Cameras: the standing grants by which programs send points to a robot without the lease.
//!
//! A camera sends what it found when the controller asks for a photo or a part comes. It does not know the
//! lease: the holder moves the robot, and the camera says where the part is. So an admin gives a token the
//! grant for one camera of one robot. It holds until it is revoked. A rule of the raw ports can name cameras
//! instead: its sources have their grants as long as the rule stands.

use std::fmt;

/// How many grants one robot has at most. A cell has a few cameras, each with a program and perhaps a spare.
/// They are all read each time that one of them is used.
pub const MAX_GRANTS: usize = 64;

/// How many points one request has at most: more than a frame of 2048 bytes has room for, which is looked at
/// apart.
pub const MAX_POINTS: usize = 50;

/// A camera of a robot: `camID`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Camera(u16);

impl Camera {
    /// What a number of a camera has to be. Taught programs know the same ones.
    pub const WANTED: &str = "a number from 0 to 999";

    /// The camera with this number.
    #[must_use]
    pub fn new(number: i64) -> Option<Self> {
        u16::try_from(number).ok().filter(|number| *number <= 999).map(Self)
    }

    /// The camera with this number, as people write it.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        // No sign and no space: of two texts that name one camera, one would be missed in a log.
        let is_plain = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        text.parse().ok().filter(|_| is_plain).and_then(Self::new)
    }

    /// Its number.
    #[must_use]
    pub fn number(self) -> u16 {
        self.0
    }
}

impl fmt::Display for Camera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A grant for one camera of one robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraGrant {
    /// The camera.
    pub camera: Camera,
    /// The number of the token that has it.
    pub token: i64,
    /// Who gave it.
    pub by: String,
    /// When.
    pub at: String,
}

/// The proof that a caller has the grant for a camera. Only [`Standing::of`] and [`Standing::of_rule`] make
/// one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Standing {
    camera: Camera,
}

impl Standing {
    /// The proof for this token and this camera, if it is among the grants of the robot.
    #[must_use]
    pub fn of(grants: &[CameraGrant], camera: Camera, token: i64) -> Option<Self> {
        let is_this = |grant: &CameraGrant| grant.camera == camera && grant.token == token;
        grants.iter().any(is_this).then_some(Self { camera })
    }

    /// The proof for clients of raw ports whose rule names these cameras.
    #[must_use]
    pub fn of_rule(cameras: &[Camera], camera: Camera) -> Option<Self> {
        cameras.contains(&camera).then_some(Self { camera })
    }

    /// The camera that it is for.
    #[must_use]
    pub fn camera(self) -> Camera {
        self.camera
    }
}

#[cfg(test)]
pub fn standing(number: u16) -> Standing {
    Standing { camera: Camera(number) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grant_is_for_one_camera_and_one_token() {
        let camera = |number| Camera::new(number).unwrap();
        let grant = |number, token| CameraGrant {
            camera: camera(number),
            token,
            by: "anna".to_owned(),
            at: String::new(),
        };
        let grants = [grant(0, 3), grant(1, 4)];
        assert_eq!(Standing::of(&grants, camera(0), 3), Some(standing(0)));
        assert_eq!(Standing::of(&grants, camera(1), 4).unwrap().camera(), camera(1));
        for (number, token) in [(1, 3), (0, 4), (2, 3)] {
            assert_eq!(Standing::of(&grants, camera(number), token), None);
        }
        assert_eq!(Standing::of(&[], camera(0), 3), None);
        let of_rule = |number| Standing::of_rule(&[camera(0), camera(2)], camera(number));
        assert_eq!([of_rule(0), of_rule(1), of_rule(2)], [Some(standing(0)), None, Some(standing(2))]);
    }

    #[test]
    fn a_camera_is_a_number_of_three_digits() {
        for (text, number) in [("0", 0), ("7", 7), ("007", 7), ("999", 999)] {
            assert_eq!(Camera::read(text).map(Camera::number), Some(number), "{text}");
        }
        for bad in ["", "1000", "-1", "+1", " 1", "1.0", "x", "99999999999999999999"] {
            assert_eq!(Camera::read(bad), None, "{bad}");
        }
        assert_eq!((Camera::new(-1), Camera::new(1000)), (None, None));
    }
}
