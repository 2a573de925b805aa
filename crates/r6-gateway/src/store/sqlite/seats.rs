//! The seats in the table.

use std::path::{Path, PathBuf};

use r6_api::gateway::{ActedBy, AuditRecord};
use rusqlite::{OptionalExtension, Transaction, params};

use super::{Sqlite, append_in, to_json};
use crate::core::name::RobotName;
use crate::core::seat::Saved;
use crate::reserve;
use crate::store::StoreError;

/// Saves the seat of a robot. That a stop holds must not be lost: if the disk does not take it, it is written
/// in the room that the gateway holds, or the next start learns that one may be lacking.
pub fn save(store: &mut Sqlite, robot: &RobotName, saved: &Saved) -> Result<(), StoreError> {
    let written = save_once(store, robot, saved);
    if !matches!(written, Err(StoreError::Unavailable(_))) || !saved.stopped || is_stopped(store, robot) {
        return written;
    }
    match folder(store) {
        Some(folder) if reserve::use_up(&folder, "a stop") => save_once(store, robot, saved),
        _ => written,
    }
}

fn save_once(store: &mut Sqlite, robot: &RobotName, saved: &Saved) -> Result<(), StoreError> {
    let transaction = store.write()?;
    write(&transaction, robot, saved)?;
    transaction.commit()?;
    Ok(())
}

fn write(transaction: &Transaction<'_>, robot: &RobotName, saved: &Saved) -> Result<(), StoreError> {
    let identity = saved.identity.as_ref().map(to_json).transpose()?;
    let by = saved.stopped_by.as_ref().map(to_json).transpose()?;
    // A number that was given out once is never given out again.
    transaction.execute(
        "INSERT INTO seat (robot, lease_number, stopped, identity, stopped_by) VALUES (?1, ?2, ?3, ?4, ?5)
         ON CONFLICT (robot) DO UPDATE SET lease_number = max(lease_number, excluded.lease_number),
         stopped = excluded.stopped, identity = excluded.identity, stopped_by = excluded.stopped_by",
        params![robot.as_str(), saved.number, saved.stopped, identity, by],
    )?;
    Ok(())
}

/// Whether the file has it that a stop holds for this robot.
fn is_stopped(store: &Sqlite, robot: &RobotName) -> bool {
    let select = store.connection.prepare_cached("SELECT stopped FROM seat WHERE robot = ?1");
    let stopped =
        select.and_then(|mut select| select.query_row([robot.as_str()], |row| row.get(0)).optional());
    stopped.ok().flatten().unwrap_or(false)
}

/// The folder of the file; `None` for a store in memory.
fn folder(store: &Sqlite) -> Option<PathBuf> {
    let file = store.connection.path().filter(|path| !path.is_empty());
    file.map(Path::new).and_then(Path::parent).map(Path::to_owned)
}

/// Saves these seats with their records, and lets a stop hold for each other robot that has a seat.
pub fn hold_stops(
    store: &mut Sqlite,
    stops: &[(RobotName, Saved, AuditRecord)],
    by: &ActedBy,
) -> Result<(), StoreError> {
    let by = to_json(by)?;
    let transaction = store.write()?;
    for (robot, saved, record) in stops {
        write(&transaction, robot, saved)?;
        append_in(&transaction, std::slice::from_ref(record))?;
    }
    transaction
        .execute("UPDATE seat SET stopped = 1, stopped_by = ?1 WHERE stopped = 0 AND robot <> ''", [by])?;
    transaction.commit()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::Store as _;

    #[test]
    fn a_stop_that_the_disk_does_not_take_is_told_to_the_next_start() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = Sqlite::open(folder.path()).unwrap();
        let (press, saw) = (RobotName::new("press").unwrap(), RobotName::new("saw").unwrap());
        let stopped = Saved { stopped: true, ..Saved::default() };
        store.save_seat(&press, &stopped).unwrap();
        store.connection.pragma_update(None, "query_only", true).unwrap();
        let marker = folder.path().join("reserve");
        // The file has the one, and what is no stop needs no room.
        assert!(store.save_seat(&press, &Saved { number: 1, ..stopped.clone() }).is_err());
        assert!(store.save_seat(&saw, &Saved::default()).is_err());
        assert!(!marker.exists());
        assert!(store.save_seat(&saw, &stopped).is_err());
        assert!(reserve::Start::begin(folder.path()).may_lack_stops);

        store.connection.pragma_update(None, "query_only", false).unwrap();
        store.save_seat(&RobotName::new("gone").unwrap(), &Saved::default()).unwrap();
        let by = ActedBy { by: "gateway".to_owned(), at: "now".to_owned() };
        store.hold_stops(&[], &by).unwrap();
        let gone = store.seat(&RobotName::new("gone").unwrap()).unwrap();
        assert_eq!((gone.stopped, gone.stopped_by), (true, Some(by)));
        assert_eq!(store.seat(&press).unwrap().stopped_by, None, "it was stopped before");
    }
}
