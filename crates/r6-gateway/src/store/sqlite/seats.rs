//! The seats in the table.

use std::path::{Path, PathBuf};

use r6_api::gateway::ActedBy;
use rusqlite::params;

use super::{Sqlite, to_json};
use crate::core::name::RobotName;
use crate::core::seat::Saved;
use crate::reserve;
use crate::store::StoreError;

/// Saves the seat of a robot. That a stop holds must not be lost: if the disk is full, it is written in the
/// room that the gateway holds.
pub fn save(store: &mut Sqlite, robot: &RobotName, saved: &Saved) -> Result<(), StoreError> {
    let written = write(store, robot, saved);
    if !(saved.stopped && matches!(written, Err(StoreError::Unavailable(_)))) {
        return written;
    }
    match folder(store) {
        Some(folder) if reserve::give_way(&folder, "a stop") => write(store, robot, saved),
        _ => written,
    }
}

fn write(store: &mut Sqlite, robot: &RobotName, saved: &Saved) -> Result<(), StoreError> {
    let identity = saved.identity.as_ref().map(to_json).transpose()?;
    let by = saved.stopped_by.as_ref().map(to_json).transpose()?;
    let transaction = store.write()?;
    // A number that was given out once is never given out again.
    transaction.execute(
        "INSERT INTO seat (robot, lease_number, stopped, identity, stopped_by) VALUES (?1, ?2, ?3, ?4, ?5)
         ON CONFLICT (robot) DO UPDATE SET lease_number = max(lease_number, excluded.lease_number),
         stopped = excluded.stopped, identity = excluded.identity, stopped_by = excluded.stopped_by",
        params![robot.as_str(), saved.number, saved.stopped, identity, by],
    )?;
    transaction.commit()?;
    Ok(())
}

/// The folder of the file; `None` for a store in memory.
fn folder(store: &Sqlite) -> Option<PathBuf> {
    let file = store.connection.path().filter(|path| !path.is_empty());
    file.map(Path::new).and_then(Path::parent).map(Path::to_owned)
}

/// Lets a stop hold for each robot that has a seat and is not stopped.
pub fn stop_all(store: &mut Sqlite, by: &ActedBy) -> Result<(), StoreError> {
    let by = to_json(by)?;
    let transaction = store.write()?;
    transaction
        .execute("UPDATE seat SET stopped = 1, stopped_by = ?1 WHERE stopped = 0 AND robot <> ''", [by])?;
    transaction.commit()?;
    Ok(())
}
