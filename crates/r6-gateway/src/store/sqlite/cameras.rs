//! The grants of cameras in the table.

use rusqlite::{Connection, Transaction, params};

use super::append_in;
use crate::core::camera::CameraGrant;
use crate::core::name::RobotName;
use crate::store::cameras::of_row;
use crate::store::{Author, NewGrant, StoreError, Token};

/// The grants of a robot, or all.
pub fn all(
    connection: &Connection,
    of: Option<&RobotName>,
) -> Result<Vec<(RobotName, CameraGrant)>, StoreError> {
    let mut select = connection.prepare_cached(
        "SELECT robot, camera, token, given_by, given_at FROM camera WHERE ?1 IS NULL OR robot = ?1
         ORDER BY robot, camera, token",
    )?;
    let rows = select.query_map([of.map(RobotName::as_str)], |row| {
        Ok((row.get::<_, String>(0)?, row.get(1)?, row.get(2)?, (row.get(3)?, row.get(4)?)))
    })?;
    rows.map(|row| {
        let (robot, camera, token, given) = row?;
        of_row(&robot, camera, token, given)
    })
    .collect()
}

/// Gives a grant, with its record. `tokens`: those that are valid.
pub fn give(
    transaction: Transaction<'_>,
    new: &NewGrant,
    tokens: &[Token],
    author: &Author,
) -> Result<bool, StoreError> {
    let known: Vec<_> = all(&transaction, Some(&new.robot))?.into_iter().map(|(_, grant)| grant).collect();
    if !new.is_new(tokens, &known)? {
        return Ok(false);
    }
    let CameraGrant { camera, token, by, at } = new.given(author);
    transaction.execute(
        "INSERT INTO camera (robot, camera, token, given_by, given_at) VALUES (?1, ?2, ?3, ?4, ?5)",
        params![new.robot.as_str(), camera.number(), token, by, at],
    )?;
    append_in(&transaction, &[new.granted(author)])?;
    transaction.commit()?;
    Ok(true)
}

/// Revokes a grant, with its record.
pub fn revoke(transaction: Transaction<'_>, grant: &NewGrant, author: &Author) -> Result<bool, StoreError> {
    let revoked = transaction.execute(
        "DELETE FROM camera WHERE robot = ?1 AND camera = ?2 AND token = ?3",
        params![grant.robot.as_str(), grant.camera.number(), grant.token],
    )?;
    if revoked > 0 {
        append_in(&transaction, &[grant.revoked(author)])?;
    }
    transaction.commit()?;
    Ok(revoked > 0)
}
