//! What is kept of each robot, and the settings of the hall.

use r6_api::gateway::{ActedBy, RobotIdentity};
use tokio_postgres::Client;

use super::{plain, signed, unsigned};
use crate::core::alarms;
use crate::core::name::RobotName;
use crate::core::seat::Saved;
use crate::store::robots::More;
use crate::store::{StoreError, StoredRobot, StoredSettings};

fn json(value: &impl serde::Serialize) -> Result<String, StoreError> {
    serde_json::to_string(value).map_err(|error| StoreError::Unreadable(error.to_string()))
}

/// What was saved of a seat.
pub async fn seat(client: &Client, robot: &RobotName) -> Result<Saved, StoreError> {
    let row = client
        .query_opt(
            "SELECT lease_number, stopped, identity, stopped_by FROM seat WHERE robot IN ($1, '')
             ORDER BY robot = '' LIMIT 1",
            &[&robot.as_str()],
        )
        .await?;
    let Some(row) = row else { return Ok(Saved::default()) };
    let unreadable = |error: serde_json::Error| StoreError::Unreadable(format!("{robot}: {error}"));
    let identity = row.try_get::<_, Option<&str>>(2)?.map(serde_json::from_str::<RobotIdentity>);
    let by = row.try_get::<_, Option<&str>>(3)?.map(serde_json::from_str::<ActedBy>);
    Ok(Saved {
        number: unsigned(row.try_get(0)?),
        stopped: row.try_get(1)?,
        stopped_by: by.transpose().map_err(unreadable)?,
        identity: identity.transpose().map_err(unreadable)?,
    })
}

/// Saves a seat. A number that was given out once is never given out again.
pub async fn save_seat(client: &Client, robot: &RobotName, saved: &Saved) -> Result<(), StoreError> {
    let identity = saved.identity.as_ref().map(json).transpose()?;
    let by = saved.stopped_by.as_ref().map(json).transpose()?;
    client
        .execute(
            "INSERT INTO seat (robot, lease_number, stopped, identity, stopped_by) VALUES ($1, $2, $3, $4, $5)
             ON CONFLICT (robot) DO UPDATE SET
             lease_number = greatest(seat.lease_number, excluded.lease_number),
             stopped = excluded.stopped, identity = excluded.identity, stopped_by = excluded.stopped_by",
            &[&robot.as_str(), &signed(saved.number), &saved.stopped, &identity, &by],
        )
        .await?;
    Ok(())
}

/// What was saved of the alarms of a robot.
pub async fn alarms(client: &Client, robot: &RobotName) -> Result<alarms::Saved, StoreError> {
    let row = client.query_opt("SELECT state FROM alarm WHERE robot = $1", &[&robot.as_str()]).await?;
    let Some(row) = row else { return Ok(alarms::Saved::default()) };
    serde_json::from_str(row.try_get(0)?)
        .map_err(|error| StoreError::Unreadable(format!("the alarms of {robot}: {error}")))
}

/// Saves the alarms of a robot.
pub async fn save_alarms(
    client: &Client,
    robot: &RobotName,
    saved: &alarms::Saved,
) -> Result<(), StoreError> {
    client
        .execute(
            "INSERT INTO alarm (robot, state) VALUES ($1, $2)
             ON CONFLICT (robot) DO UPDATE SET state = excluded.state",
            &[&robot.as_str(), &json(saved)?],
        )
        .await?;
    Ok(())
}

/// The settings of the hall.
pub async fn settings(client: &Client) -> Result<Option<StoredSettings>, StoreError> {
    let row = client.query_opt("SELECT version, settings FROM hall", &[]).await?;
    let Some(row) = row else { return Ok(None) };
    Ok(Some(StoredSettings { version: unsigned(row.try_get(0)?), text: row.try_get(1)? }))
}

/// Puts the settings of the hall.
pub async fn put_settings(client: &Client, settings: &StoredSettings) -> Result<(), StoreError> {
    client
        .execute(
            "INSERT INTO hall (one, version, settings) VALUES (1, $1, $2)
             ON CONFLICT (one) DO UPDATE SET version = excluded.version, settings = excluded.settings",
            &[&signed(settings.version), &settings.text],
        )
        .await?;
    Ok(())
}

/// A database that is only read can be older than the last two columns.
const SELECT: &str = "SELECT name, address, period_ms, read, model,
    COALESCE(to_jsonb(robot) ->> 'poll_groups', '[]'), COALESCE(to_jsonb(robot) ->> 'more', '{}')
    FROM robot ORDER BY name";

/// The robots that were put.
pub async fn all(client: &Client) -> Result<Vec<StoredRobot>, StoreError> {
    let rows = client.query(SELECT, &[]).await?;
    rows.iter()
        .map(|row| {
            let name: &str = row.try_get(0)?;
            let unreadable = || StoreError::Unreadable(format!("the robot `{name}`"));
            let More { parts, guard } = serde_json::from_str(row.try_get(6)?).map_err(|_| unreadable())?;
            Ok(StoredRobot {
                name: RobotName::new(name).ok_or_else(unreadable)?,
                address: row.try_get(1)?,
                period_ms: unsigned(row.try_get(2)?),
                read: serde_json::from_str(row.try_get(3)?).map_err(|_| unreadable())?,
                model: row.try_get(4)?,
                groups: serde_json::from_str(row.try_get(5)?).map_err(|_| unreadable())?,
                parts,
                guard,
            })
        })
        .collect()
}

/// Adds or replaces a robot. Another gateway may have given its address to another one a moment ago.
pub async fn put(client: &Client, robot: &StoredRobot) -> Result<(), StoreError> {
    let address = r6_client::address_with_port(&robot.address);
    for known in all(client).await?.into_iter().filter(|known| known.name != robot.name) {
        if address.is_ok() && r6_client::address_with_port(&known.address) == address {
            return Err(StoreError::AddressTaken(known.name));
        }
    }
    let model = robot.model.as_deref().map(plain);
    client
        .execute(
            "INSERT INTO robot (name, address, period_ms, read, model, poll_groups, more)
             VALUES ($1, $2, $3, $4, $5, $6, $7)
             ON CONFLICT (name) DO UPDATE SET address = excluded.address, period_ms = excluded.period_ms,
             read = excluded.read, model = excluded.model, poll_groups = excluded.poll_groups,
             more = excluded.more",
            &[
                &robot.name.as_str(),
                &plain(&robot.address),
                &signed(robot.period_ms),
                &json(&robot.read)?,
                &model,
                &json(&robot.groups)?,
                &More::of(robot)?,
            ],
        )
        .await?;
    Ok(())
}

/// Removes a robot.
pub async fn remove(client: &Client, name: &RobotName) -> Result<(), StoreError> {
    client.execute("DELETE FROM robot WHERE name = $1", &[&name.as_str()]).await?;
    Ok(())
}
