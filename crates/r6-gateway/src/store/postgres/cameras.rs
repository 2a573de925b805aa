//! The grants of cameras in the table.

use tokio_postgres::Client;

use super::audit::append;
use super::{plain, users};
use crate::core::camera::CameraGrant;
use crate::core::name::RobotName;
use crate::store::cameras::of_row;
use crate::store::{Author, NewGrant, StoreError};

/// The grants of all robots, for the command line.
pub async fn of_all(client: &Client) -> Result<Vec<(RobotName, CameraGrant)>, StoreError> {
    // A database that is only read can be older than grants.
    let there = client.query_one("SELECT to_regclass('camera') IS NOT NULL", &[]).await?;
    if there.try_get(0)? { all(client, None).await } else { Ok(Vec::new()) }
}

/// The grants of a robot, or all.
pub async fn all(
    client: &Client,
    of: Option<&RobotName>,
) -> Result<Vec<(RobotName, CameraGrant)>, StoreError> {
    let rows = client
        .query(
            "SELECT robot, camera, token, given_by, given_at FROM camera WHERE $1::text IS NULL OR robot = $1
             ORDER BY robot, camera, token",
            &[&of.map(RobotName::as_str)],
        )
        .await?;
    rows.iter()
        .map(|row| {
            let given = (row.try_get(3)?, row.try_get(4)?);
            of_row(row.try_get(0)?, row.try_get(1)?, row.try_get(2)?, given)
        })
        .collect()
}

/// Gives a grant, with its record.
pub async fn give(client: &Client, new: &NewGrant, author: &Author) -> Result<bool, StoreError> {
    // All that write wait for each other, so neither tokens nor grants change meanwhile.
    let tokens = users::tokens(client).await?;
    let known: Vec<_> = all(client, Some(&new.robot)).await?.into_iter().map(|(_, grant)| grant).collect();
    if !new.is_new(&tokens, &known)? {
        return Ok(false);
    }
    let CameraGrant { camera, token, by, at } = new.given(author);
    client
        .execute(
            "INSERT INTO camera (robot, camera, token, given_by, given_at) VALUES ($1, $2, $3, $4, $5)",
            &[&new.robot.as_str(), &i64::from(camera.number()), &token, &plain(&by), &at],
        )
        .await?;
    append(client, &[new.granted(author)]).await?;
    Ok(true)
}

/// Revokes a grant, with its record.
pub async fn revoke(client: &Client, grant: &NewGrant, author: &Author) -> Result<bool, StoreError> {
    let revoked = client
        .execute(
            "DELETE FROM camera WHERE robot = $1 AND camera = $2 AND token = $3",
            &[&grant.robot.as_str(), &i64::from(grant.camera.number()), &grant.token],
        )
        .await?;
    if revoked > 0 {
        append(client, &[grant.revoked(author)]).await?;
    }
    Ok(revoked > 0)
}
