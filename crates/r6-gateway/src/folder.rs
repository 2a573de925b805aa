//! The folder of a gateway: its lock, and where its store is, in the folder or in a database (`--store`).
//!
//! Users, leases and stops of the one place count nothing in the other. A gateway whose store is in a
//! database leaves a marker in its folder, so that nothing takes the folder for the store by mistake.

use std::fs::{File, TryLockError};
use std::io;
use std::path::Path;

use crate::files;
use crate::gateway::GatewayError;
use crate::store::FILE;

/// The marker. The URL of the database is not in it, because that can have a password.
const MARKER: &str = "store-in-database";

/// What stands in the marker, for people who look into the folder.
const TEXT: &[u8] =
    b"The gateway of this folder runs with --store: its users, tokens, robots, leases, stops, audit\n\
    log and history are in a database. This folder has its key of the audit log and its certificate.\n";

/// Whether the gateway of this folder has its store in a database.
#[must_use]
pub fn is_of_database(folder: &Path) -> bool {
    folder.join(MARKER).exists()
}

/// Whether the folder has the store of a gateway in it.
#[must_use]
pub fn has_store(folder: &Path) -> bool {
    folder.join(FILE).exists()
}

/// Marks the folder as that of a gateway with its store in a database.
///
/// # Errors
/// What the system says.
pub fn mark(folder: &Path) -> io::Result<()> {
    if is_of_database(folder) {
        return Ok(());
    }
    files::write(&folder.join(MARKER), TEXT)
}

/// A lock on the folder, which the system gives back when the process ends, in whatever way.
///
/// # Errors
/// [`GatewayError::InUse`]: another gateway has it. The system does not allow it.
pub fn lock(folder: &Path) -> Result<File, GatewayError> {
    let mut options = File::options();
    options.create(true).append(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let file = options.open(folder.join("lock")).map_err(GatewayError::System)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(GatewayError::InUse(folder.to_owned())),
        Err(TryLockError::Error(error)) => Err(GatewayError::System(error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_owner_of_a_folder_can_read_its_marker() {
        let folder = tempfile::tempdir().unwrap();
        assert!(!is_of_database(folder.path()) && !has_store(folder.path()));
        mark(folder.path()).unwrap();
        mark(folder.path()).unwrap();
        assert!(is_of_database(folder.path()) && !has_store(folder.path()));
        #[cfg(unix)]
        {
            let meta = std::fs::metadata(folder.path().join(MARKER)).unwrap();
            assert_eq!(std::os::unix::fs::PermissionsExt::mode(&meta.permissions()) & 0o777, 0o600);
        }
    }
}
