//! Grants of cameras in the store.

use r6_api::gateway::{AuditRecord, Deed};

use super::{Author, StoreError, Token};
use crate::core::camera::{Camera, CameraGrant, MAX_GRANTS};
use crate::core::name::RobotName;
use crate::expiry::Expiry;

/// A grant to give or to revoke.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewGrant {
    /// The robot.
    pub robot: RobotName,
    /// The camera.
    pub camera: Camera,
    /// The number of the token.
    pub token: i64,
}

impl NewGrant {
    /// Whether it can be given: `false` if it is there. `tokens`: those that are not revoked. `known`: the
    /// grants of the robot.
    pub(super) fn is_new(&self, tokens: &[Token], known: &[CameraGrant]) -> Result<bool, StoreError> {
        let mut valid = tokens.iter().filter(|token| !token.expires.is_some_and(Expiry::is_over));
        let token = valid.find(|token| token.number == self.token);
        let token = token.ok_or(StoreError::NoSuchToken(self.token))?;
        if !token.grant.covers(self.robot.as_str()) {
            return Err(StoreError::TokenOfAnother(self.token));
        }
        if known.iter().any(|known| known.camera == self.camera && known.token == self.token) {
            return Ok(false);
        }
        if known.len() >= MAX_GRANTS { Err(StoreError::TooManyGrants) } else { Ok(true) }
    }

    /// The grant, as this author gives it.
    pub(super) fn given(&self, author: &Author) -> CameraGrant {
        let (by, at) = (author.actor.clone(), author.time.clone());
        CameraGrant { camera: self.camera, token: self.token, by, at }
    }

    /// The record that it was given.
    pub(super) fn granted(&self, author: &Author) -> AuditRecord {
        self.record(author, Deed::CameraGranted { camera: self.camera.number(), token: self.token })
    }

    /// The record that it was revoked.
    pub(super) fn revoked(&self, author: &Author) -> AuditRecord {
        self.record(author, Deed::CameraRevoked { camera: self.camera.number(), token: self.token })
    }

    fn record(&self, author: &Author, deed: Deed) -> AuditRecord {
        AuditRecord { robot: Some(self.robot.to_string()), ..author.record(deed) }
    }
}

/// A grant of the columns of a row.
pub(super) fn of_row(
    robot: &str,
    camera: i64,
    token: i64,
    (by, at): (String, String),
) -> Result<(RobotName, CameraGrant), StoreError> {
    let unreadable = || StoreError::Unreadable(format!("the grant for camera {camera} of `{robot}`"));
    let robot = RobotName::new(robot).ok_or_else(unreadable)?;
    let camera = Camera::new(camera).ok_or_else(unreadable)?;
    Ok((robot, CameraGrant { camera, token, by, at }))
}
